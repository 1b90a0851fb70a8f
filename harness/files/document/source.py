"""The elements of a model's files: their places, their numbers and the rules of these, the files they name, and what is passed over.

What is in them and known to nobody is read past. A number that is read is checked, and refused at its line.

Numbers are decimal and finite: what strtod reads beyond that (hexadecimal, nan, inf) engines take in
silence and answer with NaN.
"""

from __future__ import annotations

import functools
import math
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

from lxml import etree

from harness.errors import InvalidModel
from harness.files.document.xml import Document, describe, irregular, literal_tag, parse_any, read_text, shorten
from harness.files.given import Given, Place
from harness.library import STAGE_SUFFIXES, nearest

UNIT_TOLERANCE = 1e-6
_NUMBER = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
# Attributes that name a file: of meshes, height fields, skins and models, in URDFs, and the six sides of a texture.
_NAMING = re.compile("file(name|up|down|left|right|front|back)?")
# Before a path in a URDF.
_SCHEME = re.compile("^[a-z]+://")
_SPACE = re.compile(r"[ \t\r\n]+")

Check = Callable[[tuple[float, ...]], str | None]


def not_negative(values: tuple[float, ...]) -> str | None:
    """A check: zero or more."""
    return "is negative; expected zero or more" if min(values) < 0 else None


def positive(values: tuple[float, ...]) -> str | None:
    """A check: more than zero."""
    return "is not positive; expected more than zero" if min(values) <= 0 else None


def whole(values: tuple[float, ...]) -> str | None:
    """A check: a number of times, which is 1 or more."""
    return None if values[0] >= 1 and values[0].is_integer() else "is no number of times; expected 1, 2, 3, ..."


def not_zero(values: tuple[float, ...]) -> str | None:
    """A check: a direction or a rotation needs a length."""
    return None if any(values) else "is zero; expected a direction or rotation"


def one_sign(values: tuple[float, ...]) -> str | None:
    """A check: all positive or none, which says which of two meanings a pair has."""
    return "mixes signs; expected both positive, or none" if len({value > 0 for value in values}) > 1 else None


def unit(values: tuple[float, ...]) -> str | None:
    """A check: a vector of length one."""
    length = math.hypot(*values)
    if length == 0:
        return "is zero; expected a unit vector"
    return None if abs(length - 1) <= UNIT_TOLERANCE else f"has length {length:.6g}; expected a unit vector"


def no_dry_friction(values: tuple[float, ...]) -> str | None:
    """A check: none but zero."""
    return "is dry friction, which the smooth equations of motion cannot hold; remove it" if any(values) else None


@dataclass(frozen=True)
class Numbers:
    """A list of ``fewest`` to ``most`` (default: ``fewest``) finite numbers that passes ``check``."""

    fewest: int = 1
    most: int | None = None
    check: Check | None = None
    required: bool = False

    # A diagnosis reads a file a thousand times with one number changed.
    @functools.lru_cache(maxsize=4096)  # noqa: B019  (rules live as long as the process)
    def read(self, text: str) -> tuple[float, ...]:
        """The numbers in ``text``; ValueError says what is wrong and what was expected."""
        words = _SPACE.split(text.strip(" \t\r\n")) if text.strip(" \t\r\n") else []
        values = []
        for word in words:
            value = float(word) if _NUMBER.fullmatch(word) else math.nan
            if not math.isfinite(value):
                raise ValueError(f"contains {shorten(word)!r}; expected a finite decimal number")
            values.append(value)
        most = self.fewest if self.most is None else self.most
        if not self.fewest <= len(values) <= most:
            expected = f"{self.fewest}" if most == self.fewest else f"{self.fewest} to {most}"
            raise ValueError(f"holds {len(values)} numbers; expected {expected}")
        complaint = self.check(tuple(values)) if self.check else None
        if complaint:
            raise ValueError(complaint)
        return tuple(values)


@dataclass(frozen=True)
class Choice:
    """One word out of ``options``."""

    options: tuple[str, ...]
    required: bool = False

    def read(self, text: str) -> str:
        """``text`` itself; ValueError names the nearest option."""
        if text not in self.options:
            raise ValueError(f"is unknown; {nearest(shorten(text), self.options)}")
        return text


@dataclass(frozen=True)
class Text:
    """Anything: a name, or what only people read."""

    required: bool = False

    def read(self, text: str) -> str:
        """``text`` itself."""
        return text


Rule = Numbers | Choice | Text


@dataclass(frozen=True)
class PassedOver:
    """An element that is no part of the tree.

    Attributes:
        line: in the model's own file. problem: why a mechanism's model may not have it.
        what: as of ``LeftOut``; "" for what needs no mention.
    """

    place: Place
    line: int
    problem: str
    what: str


@dataclass(frozen=True)
class Unread:
    """A force or an inertia that the file states and no tree holds, and what its author can do about it."""

    place: Place
    what: str
    advice: str

    @property
    def line(self) -> int:
        return self.place.line


# Elements by their names.
Elements = Mapping[str, etree._Element]


class Source:
    """The elements of a file, and of those that it includes; element to its place.

    Attributes:
        document: the file. root: its root element.
        passed_over: what is no part of the tree, and no model of a mechanism may say, in the order in which it was found.
        unread: forces and inertias that no tree holds.
    """

    def __init__(self, document: Document) -> None:
        self.document = document
        self._places: dict[etree._Element, Place] = {}
        self._included_by: dict[Path, Place] = {}
        self.passed_over: list[PassedOver] = []
        self.unread: list[Unread] = []
        self.root = self.add(document)

    def add(self, document: Document, included_by: etree._Element | None = None) -> etree._Element:
        """The root of a document, whose elements then have places; tags in a default namespace are as without."""
        if included_by is not None:
            self._included_by[document.path] = self._places[included_by]
        for number, (element, line) in enumerate(document.lines.items()):
            if element.tag[0] == "{" and not element.prefix:
                element.tag = etree.QName(element).localname
            self._places[element] = Place(document.path, line, number, literal_tag(element))
        return document.root

    @property
    def included(self) -> tuple[Path, ...]:
        """The files that it includes."""
        return tuple(self._included_by)

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

    def pass_over(self, element: etree._Element, problem: str, what: str = "") -> None:
        """Leave an element out as ``what``, "" for what needs no mention; ``problem`` is why a mechanism's model may not have it."""
        self.passed_over.append(PassedOver(self._places[element], self.lines([element])[0], problem, what))

    def lines(self, elements: Iterable[etree._Element]) -> tuple[int, ...]:
        """The lines of elements in the model's own file, each once; of one in an included file, that of the element that includes it."""
        found = set()
        for place in (self._places[element] for element in elements):
            while place.path in self._included_by:
                place = self._included_by[place.path]
            found.add(place.line)
        return tuple(sorted(found))

    def one(self, element: etree._Element, tag: str) -> etree._Element | None:
        """The part of that tag; raises InvalidModel where there are two, of which readers take the one or the other."""
        found = list(children(element, tag))
        if len(found) > 1:
            self.refuse(found[1], f"second <{tag}> in {describe(element)}; expected one, keep the right one")
        return found[0] if found else None

    def resolve(self, element: etree._Element, attribute: str, known: Elements) -> str:
        """The name in ``attribute``; raises InvalidModel where ``known`` does not hold it."""
        name = element.get(attribute)
        if name not in known:
            self.refuse(element, unresolved(element, attribute, known))
        return str(name)

    # Numbers.

    def numbers(
        self,
        element: etree._Element,
        attribute: str,
        default: Sequence[float] | None,
        check: Check | None = None,
        count: int = 0,
    ) -> tuple[Given, ...]:
        """The numbers of an attribute, as many as ``default`` holds, which stand where the element has none.

        None for ``default`` demands the attribute, which is to hold ``count``.

        Raises:
            InvalidModel: another number of numbers, one that is not finite, or one that ``check`` complains of.
        """
        text = element.get(attribute)
        if text is None:
            if default is None:
                self.refuse(element, f"{describe(element)} has no attribute {attribute!r}; add it")
            return self.default(element, attribute, default)
        return self.read(element, attribute, text, Numbers(count if default is None else len(default), None, check))

    def default(self, element: etree._Element, attribute: str, values: Sequence[float], start: int = 0) -> tuple[Given, ...]:
        """The numbers that hold for ``element`` where the file gives none, from number ``start`` on."""
        return _given(self._places[element], attribute, tuple(values[start:]), start)

    def read(self, element: etree._Element, attribute: str, text: str, rule: Numbers) -> tuple[Given, ...]:
        """The numbers that ``text`` holds, as those of an attribute of ``element``."""
        try:
            values = rule.read(text)
        except ValueError as error:
            shown = f' {attribute}="{shorten(text)}"' if attribute else ""
            self.refuse(element, f"<{literal_tag(element)}{shown}> {error}")
        return _given(self._places[element], attribute, values)

    def number(self, element: etree._Element, attribute: str, default: float | None, check: Check | None = None) -> Given:
        """``numbers`` of one."""
        (value,) = self.numbers(element, attribute, None if default is None else (default,), check, 1)
        return value


# A diagnosis reads a file a thousand times with one number changed; most numbers of an MJCF are defaults, which stand in no attribute.
@functools.lru_cache(maxsize=4096)
def _given(place: Place, attribute: str, values: tuple[float, ...], start: int = 0) -> tuple[Given, ...]:
    """The numbers of an attribute from number ``start`` on."""
    return tuple(Given(value, place, attribute, index) for index, value in enumerate(values, start))


def read_any(path: Path, expected: str) -> Document:
    """Read and parse ``path``, whatever its root element is; ``expected`` says what an empty file should have been.

    Prefixes need not be declared: engines read tags as they are written. The elements of a USD file are its prims, without attributes;
    the document has their values.

    Raises:
        InvalidModel: not a readable file of well-formed XML in UTF-8, or beyond the limits of ``harness.files.document.xml``; or no USD
            file that can be read.
    """
    if path.suffix.lower() in STAGE_SUFFIXES:
        from harness.files.document.stage import read_stage

        return read_stage(path)
    return parse_any(path, read_text(path), expected, any_prefix=True)


def children(element: etree._Element, *tags: str) -> Iterator[etree._Element]:
    """The elements right inside another one that are written with one of the tags."""
    return (child for child in element.iterchildren("*") if literal_tag(child) in tags)


def unresolved(element: etree._Element, attribute: str, known: Collection[str]) -> str:
    """The complaint about an attribute that is missing, or names nothing of ``known``."""
    name = element.get(attribute)
    if name is None:
        return f"{describe(element)} has no attribute {attribute!r}; add it"
    return f'<{literal_tag(element)} {attribute}="{shorten(name)}"> names nothing in this file; {nearest(shorten(name), known)}'


# Files that elements name. To open a FIFO or a device may wait forever.


def refuse_irregular_files(source: Source) -> None:
    """Refuse an element that names a FIFO, a device, a socket or a directory as a file, before an engine opens it.

    Raises:
        InvalidModel: at the line of the element.
    """
    naming = [
        (element, attribute, text)
        for element in source.root.iter("*")
        for attribute, text in element.attrib.items()
        if _NAMING.fullmatch(attribute)
    ]
    folders = _folders(source) if naming else []
    for element, attribute, text in naming:
        kinds = {path: _kind(path) for path in _places(text, folders)}
        # Readers differ in where they look; a directory beside the file that they find is none of their business.
        is_found = any(path.is_file() for path in kinds)
        for path, kind in kinds.items():
            if kind and not (is_found and path.is_dir()):
                what = f'<{literal_tag(element)} {attribute}="{shorten(text)}">'
                source.refuse(element, f"{what}: {path} is {kind}; expected a regular file")


def _kind(path: Path) -> str:
    try:
        return irregular(path)
    except (OSError, ValueError):
        return ""


def _folders(source: Source) -> list[Path]:
    """The folders in which readers look: those of the model and of its included files, and in those that it names below them."""
    own = dict.fromkeys([source.document.path.parent, *(source.place(element).path.parent for element in source.root.iter("*"))])
    named = [str(one.get(name)) for one in source.root.iter("compiler") for name in ("meshdir", "texturedir", "assetdir") if one.get(name)]
    return [folder / name for folder in own for name in ("", *named)]


def _places(text: str, folders: list[Path]) -> Iterator[Path]:
    """Paths at which the file of an attribute may lie; some readers go by the name of a file alone."""
    name = _SCHEME.sub("", text.strip())
    if name:
        yield from dict.fromkeys(folder / one for folder in folders for one in (name, Path(name).name))
