"""Parts that adapters of files share: the text of a URDF, what is taken out of it before an engine reads it, and what native code writes.

Reasons of programs go to file descriptors 1 and 2 alone; messages of the harness repeat them.
"""

from __future__ import annotations

import ctypes
import os
import tempfile
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager

from lxml import etree

from harness.engines.interface import Unsupported
from harness.engines.request import Request
from harness.files.document.xml import Document, describe, literal_tag, parse_any
from harness.files.model_file import ModelFile
from harness.files.tree import WORLD
from harness.files.urdf.kinds import DRAKE_JOINT, JOINT_TAGS

SHAPES = ("visual", "collision")


def document_of(request: Request) -> Document:
    """The elements of the file, by their tags without a default namespace; whoever asks may change them."""
    document = parse_any(request.path, request.content.decode(), "a model", any_prefix=True)
    for element in document.root.iter("*"):
        if element.prefix is None and element.tag.startswith("{"):
            element.tag = etree.QName(element).localname
    etree.cleanup_namespaces(document.root)
    return document


def elements_of(request: Request) -> etree._Element:
    """The root element of the file, as of ``document_of``."""
    return document_of(request).root


def carriers(root: etree._Element, tags: Collection[str] = JOINT_TAGS) -> dict[str, etree._Element]:
    """The joint that carries each link of a URDF that is carried, by the link's name."""
    joints = [joint for joint in root.iterchildren("*") if literal_tag(joint) in tags]
    return {str(child.get("link")): joint for joint in joints for child in joint.iterfind("child")}


def parent_of(joint: etree._Element) -> str:
    """The name of the link that a joint hangs on."""
    return str(joint.find("parent").get("link"))


def is_displaced(joint: etree._Element) -> bool:
    """True for a joint with an origin other than that of its parent."""
    return any(float(word) for origin in joint.iterfind("origin") for text in origin.attrib.values() for word in str(text).split())


def root_link(root: etree._Element, tags: Collection[str] = JOINT_TAGS) -> str:
    """The name of the link of a URDF that no joint carries; "" where Drake's ball joint carries the first."""
    carried = carriers(root, tags)
    return next((str(link.get("name")) for link in root.iterfind("link") if link.get("name") not in carried), "")


def links_without_inertia(root: etree._Element) -> list[etree._Element]:
    """The links that have no inertia in the file, for which engines have one of their own."""
    return [link for link in root.iterfind("link") if link.find("inertial") is None]


def without_root_joint(request: Request, engine: str) -> tuple[etree._Element | None, str]:
    """A URDF without a free or ball joint from the world to its root link, and without that world; and the joint's name.

    None and the name of the floating base, where there is one, of a file that is read as it is.

    Raises:
        Unsupported: joints of a mechanism's model that an engine all of whose models have a base that floats does not have.
    """
    if request.aid is None or request.floating_base:
        return None, request.floating_base
    document = document_of(request)
    root, name = document.root, ""
    carried = carriers(root, ["joint"])
    for joint in list(root.iterfind("joint")):
        kind, parent = joint.get("type"), parent_of(joint)
        alone = len(root.findall(f"joint/parent[@link='{parent}']")) == 1
        if kind == "floating" and parent == WORLD and parent not in carried and alone and not is_displaced(joint):
            name = str(joint.get("name"))
            (world,) = (link for link in root.iterfind("link") if link.get("name") == WORLD)
            root.remove(joint)
            root.remove(world)
        elif request.text is not None and kind not in ("fixed", "revolute", "continuous", "prismatic"):
            raise Unsupported(f"line {document.lines[joint]}: {describe(joint)} is {kind}, which {engine} has at the root of a model alone")
    for joint in [element for element in root.iterchildren("*") if literal_tag(element) == DRAKE_JOINT]:
        name = str(joint.get("name"))
        root.remove(joint)
    return root if name else None, name


def moving_mass(request: Request, masses: Mapping[str, float]) -> float:
    """The mass of the links that move, of an engine's ``masses`` by link [kg]: those behind a joint that is not fixed."""
    carried = carriers(elements_of(request))

    def moves(link: str) -> bool:
        while link in carried and carried[link].get("type") == "fixed":
            link = parent_of(carried[link])
        return link in carried

    return sum(mass for link, mass in masses.items() if moves(link))


def without_shapes(root: etree._Element, meshes_alone: bool = False) -> etree._Element:
    """The same element of a URDF, its links without shapes, or without those that are meshes."""
    for link in root.iterfind("link"):
        for shape in [part for tag in SHAPES for part in link.iterchildren(tag)]:
            if not meshes_alone or shape.find("geometry/mesh") is not None:
                link.remove(shape)
    return root


def text_of(root: etree._Element) -> str:
    return str(etree.tostring(root, encoding="unicode"))


def refuse_unexpressed(file: ModelFile, no_constraints: str) -> None:
    """Raises Unsupported for the constraints of a model, with the reason, and for forces that no force element expresses."""
    if file.constraints:
        shown = "; ".join(f"line {one.line}: {one.couples} constraint {one.name!r}" for one in file.constraints)
        raise Unsupported(f"{no_constraints}: {shown}")
    if file.unexpressed:
        raise Unsupported("; ".join(f"line {one.line}: {one.what}, which the harness cannot supply" for one in file.unexpressed))


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
