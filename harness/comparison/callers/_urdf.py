"""The file of a request as text, and what a caller takes out of it before an engine reads it."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from lxml import etree

from harness.comparison.questions import Refused, Request

Found = TypeVar("Found")
SHAPES = ("visual", "collision")


def elements_of(request: Request) -> etree._Element:
    """The root element of the file."""
    return etree.fromstring(request.path.read_bytes(), etree.XMLParser(resolve_entities=False, no_network=True, remove_comments=True))


def root_link(request: Request) -> str:
    """The name of the link of a URDF that no joint carries."""
    root = elements_of(request)
    carried = {child.get("link") for child in root.iterfind("joint/child")}
    return next(str(link.get("name")) for link in root.iterfind("link") if link.get("name") not in carried)


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
        return read(request.path.read_bytes()), ()
    except Refused as refusal:
        if elements_of(request).find(".//geometry/mesh") is None:
            raise
        try:
            found = read(text_of(without_shapes(elements_of(request), meshes_alone=True)))
        except Refused:
            raise refusal from None
        return found, (f"refused with its meshes, and read without them: {refusal}",)
