"""An MJCF with its included files and replicas in place, as one tree of elements.

A file is included once, and looked for from the folder of the main file, as MuJoCo does. A replica becomes a ``<frame>`` of its own,
in the frame of the one before; its names end with its number. MuJoCo 4.0.0 departs from that documentation where replicas turn about
several axes: it multiplies the angles by the number of the replica.

Source: MuJoCo documentation, XML reference, ``include`` and ``replicate``.
"""

from __future__ import annotations

import copy

from lxml import etree

from harness.errors import InvalidModel
from harness.files.document.source import Source
from harness.files.document.values import Numbers, not_negative
from harness.files.document.xml import MAXIMUM_ELEMENTS, describe, read_any, shorten
from harness.files.mjcf.attributes import REPEATED

MOST_FILES = 100
# Elements that make bodies by rules that only a simulator's program spells out.
_MAKERS = ("attach", "composite", "flexcomp")


def expand(source: Source) -> None:
    """Put included files and replicas into the elements of a file, in place.

    Raises:
        InvalidModel: a file that cannot be read or is included again, more elements than a model needs, or an element that makes
            bodies by the rules of MuJoCo's program.
    """
    _include(source)
    for element in source.root.iter(*_MAKERS):
        source.refuse(element, f"{describe(element)} makes bodies by the rules of MuJoCo's program, which is not read; write them out")
    # The innermost first, as MuJoCo numbers names.
    for element in reversed(list(source.root.iter("replicate"))):
        _replicate(source, element)


def _include(source: Source) -> None:
    path = source.document.path
    seen = {path.resolve()}
    while (element := next(source.root.iter("include"), None)) is not None:
        name = element.get("file")
        if not name:
            source.refuse(element, "<include> has no file; add its name")
        file = path.parent / name
        if file.resolve() in seen:
            source.refuse(element, f'<include file="{shorten(name)}"> stands for the second time, or in itself; include a file once')
        if len(seen) > MOST_FILES:
            source.refuse(element, f"<include> is file {len(seen) + 1}; expected at most {MOST_FILES}, no robot needs more")
        seen.add(file.resolve())
        try:
            included = source.add(read_any(file, "elements of an MJCF"), included_by=element)
        except InvalidModel as error:
            if error.path == file and error.line is None:
                source.refuse(element, f'<include file="{shorten(name)}">: {file} {error.problem}')
            raise
        _put_in_place(element, list(included.iterchildren("*")))
        _bound(source, source.root)


def _put_in_place(element: etree._Element, parts: list[etree._Element]) -> None:
    parent = element.getparent()
    at = parent.index(element)
    parent.remove(element)
    for number, part in enumerate(parts):
        parent.insert(at + number, part)


def _bound(source: Source, element: etree._Element, further: int = 0) -> None:
    count = further + sum(1 for _ in source.root.iter("*"))
    if count > MAXIMUM_ELEMENTS:
        source.refuse(
            element, f"{describe(element)} makes {count} elements; expected at most {MAXIMUM_ELEMENTS}, for no robot needs that many"
        )


def _replicate(source: Source, element: etree._Element) -> None:
    (count,) = source.read(element, "count", element.get("count", ""), Numbers(check=not_negative))
    if count.denominator != 1 or count > MAXIMUM_ELEMENTS:
        source.refuse(element, f'<replicate count="{shorten(str(element.get("count")))}">: expected a whole number of replicas')
    _bound(source, element, (int(count) - 1) * sum(1 for _ in element.iter("*")))
    separator, width = element.get("sep", ""), len(str(int(count) - 1))
    frames = []
    for number in range(int(count)):
        frame = copy.deepcopy(element)
        source.add_copy(element, frame)
        frame.tag = "frame"
        frame.set(REPEATED, str(number))
        for part in frame.iterdescendants("*"):
            if part.get("name"):
                part.set("name", f"{part.get('name')}{separator}{number:0{width}}")
        frames.append(frame)
    _put_in_place(element, frames)
