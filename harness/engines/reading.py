"""What adapters share that read a file: the text of a URDF, what is taken out of it before an engine reads it, and what native code writes.

Reasons of programs go to file descriptors 1 and 2 alone; messages of the harness repeat them.
"""

from __future__ import annotations

import ctypes
import os
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import TypeVar

from lxml import etree

from harness.engines.interface import Unsupported
from harness.engines.request import Refused, Request
from harness.files.document.xml import describe, literal_tag, parse_document
from harness.files.model_file import ROOT_TAGS, ModelFile
from harness.files.tree import WORLD

Found = TypeVar("Found")
SHAPES = ("visual", "collision")


def elements_of(request: Request) -> etree._Element:
    """The root element of the file."""
    return etree.fromstring(request.content, etree.XMLParser(resolve_entities=False, no_network=True, remove_comments=True))


def root_link(request: Request) -> str:
    """The name of the link of a URDF that no joint carries; "" where Drake's ball joint carries the first."""
    root = elements_of(request)
    joints = (joint for joint in root.iterchildren("*") if literal_tag(joint) in ("joint", "drake:joint"))
    carried = {child.get("link") for joint in joints for child in joint.iterfind("child")}
    return next((str(link.get("name")) for link in root.iterfind("link") if link.get("name") not in carried), "")


def links_without_inertia(request: Request) -> set[str]:
    """The links that have no inertia in the file, for which engines have one of their own."""
    return {str(link.get("name")) for link in elements_of(request).iterfind("link") if link.find("inertial") is None}


def take_root_off(request: Request, engine: str) -> tuple[bytes | None, str]:
    """The text of a URDF without a free or ball joint from the world to its root link, and without that world; and the joint's name.

    None and the name of the floating base, where there is one, of a file that is read as it is.

    Raises:
        Unsupported: joints of a mechanism's model that an engine all of whose models have a base that floats does not have.
    """
    if request.aid is None or request.floating_base:
        return None, request.floating_base
    document = parse_document(request.path, request.content.decode(), ROOT_TAGS["urdf"])
    root = document.root
    carried = {joint.find("child").get("link") for joint in root.iterfind("joint")}
    name = ""
    for joint in list(root.iterfind("joint")):
        kind, parent, origin = joint.get("type"), joint.find("parent").get("link"), joint.find("origin")
        moved = origin is not None and any(float(word) for text in origin.attrib.values() for word in text.split())
        alone = len(root.findall(f"joint/parent[@link='{parent}']")) == 1
        if kind == "floating" and parent == WORLD and parent not in carried and alone and not moved:
            name = str(joint.get("name"))
            (world,) = (link for link in root.iterfind("link") if link.get("name") == WORLD)
            root.remove(joint)
            root.remove(world)
        elif request.text is not None and kind not in ("fixed", "revolute", "continuous", "prismatic"):
            raise Unsupported(f"line {document.lines[joint]}: {describe(joint)} is {kind}, which {engine} has at the root of a model alone")
    for joint in [element for element in root.iterchildren("*") if literal_tag(element) == "drake:joint"]:
        name = str(joint.get("name"))
        root.remove(joint)
    if name:
        return text_of(root), name
    return (None if request.text is None else request.content), name


def refuse_constraints(file: ModelFile, engine: str) -> None:
    """Raises Unsupported for what closes loops and couples joints in a mechanism's model, and for forces that nobody can supply."""
    if file.constraints:
        shown = "; ".join(f"line {one.line}: {one.couples} constraint {one.name!r}" for one in file.constraints)
        raise Unsupported(f"{engine} reads no constraints and couples no joints: {shown}")
    refuse_unexpressed(file)


def refuse_unexpressed(file: ModelFile) -> None:
    """Raises Unsupported for forces and inertias of a model that no force element expresses."""
    if file.unexpressed:
        raise Unsupported("; ".join(f"line {one.line}: {one.what}, which the harness cannot supply" for one in file.unexpressed))


def moving_mass(request: Request, masses: Mapping[str, float]) -> float:
    """The mass of the links that move, of an engine's ``masses`` by link [kg]: those behind a joint that is not fixed."""
    root = elements_of(request)
    joints = [joint for joint in root.iterchildren("*") if literal_tag(joint) in ("joint", "drake:joint")]
    parents = {joint.find("child").get("link"): joint.find("parent").get("link") for joint in joints}
    fixed = {joint.find("child").get("link") for joint in joints if joint.get("type") == "fixed"}

    def moves(link: str) -> bool:
        while link in fixed:
            link = parents[link]
        return link in parents

    return sum(mass for link, mass in masses.items() if moves(link))


def without_shapes(root: etree._Element, meshes_alone: bool = False) -> etree._Element:
    """The same element of a URDF, its links without shapes, or without those that are meshes."""
    for link in root.iterfind("link"):
        for shape in [part for tag in SHAPES for part in link.iterchildren(tag)]:
            if not meshes_alone or shape.find("geometry/mesh") is not None:
                link.remove(shape)
    return root


def text_of(root: etree._Element) -> bytes:
    return bytes(etree.tostring(root))


def read_without_meshes(request: Request, read: Callable[[bytes], Found]) -> tuple[Found, tuple[str, ...]]:
    """What ``read`` returns of the file; without its meshes where it refuses it with them, which a note says.

    Engines refuse a file whose meshes are not where they look for them.

    Raises:
        Refused: from ``read``, with the meshes, where it refuses the file without them too.
    """
    try:
        return read(request.content), ()
    except Refused as refusal:
        if elements_of(request).find(".//geometry/mesh") is None:
            raise
        try:
            found = read(text_of(without_shapes(elements_of(request), meshes_alone=True)))
        except Refused:
            raise refusal from None
        return found, (f"refused with its meshes, and read without them: {refusal}",)


@contextmanager
def captured_standard_error() -> Iterator[Callable[[], str]]:
    """Redirect file descriptor 2 of the whole process; yields a function that returns the text written so far.

    The caller sees to it that one thread does so at a time.
    """
    saved = os.dup(2)
    with tempfile.TemporaryFile() as stream:

        def text() -> str:
            stream.seek(0)
            return stream.read().decode("utf-8", errors="replace").strip()

        os.dup2(stream.fileno(), 2)
        try:
            yield text
        finally:
            os.dup2(saved, 2)
            os.close(saved)


@contextmanager
def captured_output() -> Iterator[Callable[[], str]]:
    """The same of file descriptors 1 and 2, for programs that write their reasons to standard output."""
    libc = ctypes.CDLL(None)
    libc.fflush(None)
    saved = os.dup(1)
    with captured_standard_error() as text:
        os.dup2(2, 1)

        def flushed() -> str:
            libc.fflush(None)
            return text()

        try:
            yield flushed
        finally:
            libc.fflush(None)
            os.dup2(saved, 1)
            os.close(saved)
