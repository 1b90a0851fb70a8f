"""The elements of a robot's files, which need be neither minimal nor strict: their places, and their numbers.

What is in them and known to nobody is read past. A number that is read is checked, and refused at its line.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NoReturn

from lxml import etree

from harness.errors import InvalidModel
from harness.files.tree import Given, Place
from harness.models.values import Check, Numbers
from harness.models.xml import Document, describe, literal_tag, shorten


class Source:
    """The elements of one or several files; element to its place."""

    def __init__(self) -> None:
        self._places: dict[etree._Element, Place] = {}
        self._included_by: dict[Path, Place] = {}

    def add(self, document: Document, included_by: etree._Element | None = None) -> etree._Element:
        """The root of a document, whose elements then have places; tags in a default namespace are as without."""
        if included_by is not None:
            self._included_by[document.path] = self._places[included_by]
        for number, (element, line) in enumerate(document.lines.items()):
            name = etree.QName(element)
            if name.namespace and not element.prefix:
                element.tag = name.localname
            self._places[element] = Place(document.path, line, number, literal_tag(element))
        return document.root

    def add_copy(self, original: etree._Element, copy: etree._Element) -> None:
        """Give the elements of a copy the places of the original."""
        for one, other in zip(original.iter("*"), copy.iter("*"), strict=True):
            self._places[other] = self._places[one]

    def place(self, element: etree._Element) -> Place:
        return self._places[element]

    def refuse(self, element: etree._Element, problem: str) -> NoReturn:
        """Raises InvalidModel at the line of ``element``."""
        place = self._places[element]
        raise InvalidModel(place.path, place.line, problem)

    def lines(self, elements: Iterable[etree._Element]) -> tuple[int, ...]:
        """The lines of elements in the robot's own file, each once; of one in an included file, that of the element that includes it."""
        return tuple(sorted({self._line(self._places[element]) for element in elements}))

    def _line(self, place: Place) -> int:
        while place.path in self._included_by:
            place = self._included_by[place.path]
        return place.line

    def numbers(
        self,
        element: etree._Element,
        attribute: str,
        default: Sequence[float] | None,
        check: Check | None = None,
        fewest: int = 0,
        most: int = 0,
    ) -> tuple[Given, ...]:
        """The numbers of an attribute, ``default`` where the element has none.

        As many as ``default`` holds, or from ``fewest`` to ``most``; None demands the attribute.

        Raises:
            InvalidModel: another number of numbers, one that is not finite, or one that ``check`` complains of.
        """
        text = element.get(attribute)
        if text is None:
            if default is None:
                self.refuse(element, f"{describe(element)} has no attribute {attribute!r}; add it")
            return self.default(element, attribute, default)
        count = len(default) if default is not None and not most else fewest
        return self.read(element, attribute, text, Numbers(count, most or count, check))

    def default(self, element: etree._Element, attribute: str, values: Sequence[float]) -> tuple[Given, ...]:
        """The numbers that hold for ``element`` where the file gives none."""
        place = self._places[element]
        return tuple(Given(value, place, attribute, index) for index, value in enumerate(values))

    def read(self, element: etree._Element, attribute: str, text: str, rule: Numbers) -> tuple[Given, ...]:
        """The numbers that ``text`` holds, as those of an attribute of ``element``."""
        place = self._places[element]
        try:
            values = rule.read(text)
        except ValueError as error:
            shown = f' {attribute}="{shorten(text)}"' if attribute else ""
            self.refuse(element, f"<{literal_tag(element)}{shown}> {error}")
        return tuple(Given(value, place, attribute, index) for index, value in enumerate(values))

    def number(self, element: etree._Element, attribute: str, default: float | None, check: Check | None = None) -> Given:
        """``numbers`` of one."""
        (value,) = self.numbers(element, attribute, None if default is None else (default,), check, 1, 1)
        return value
