"""Numbers, attributes and elements of a model file with their places in the text, and the effect of changes.

The text is changed in place, so that everything else in the file stays as its author wrote it. A ``Watch`` is given the
function that evaluates a model; no engine is imported here. Decoration is left out.

The text is scanned here once more, after ``harness.files.document.xml`` has found it well-formed: expat and lxml report the line or
offset of a tag, never the characters that an attribute or a number occupies.
"""

from __future__ import annotations

import bisect
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from harness.arrays import Array
from harness.errors import InvalidModel
from harness.files.document.source import Numbers
from harness.files.lint.formats import rules_at
from harness.files.model_file import ModelFile

_TAG = re.compile(
    r"<!--.*?-->|<\?.*?\?>|<!\[CDATA\[.*?\]\]>"
    r"|<(?P<close>/)?(?P<tag>[^\s/>]+)(?P<attributes>(?:[^>\"']|\"[^\"]*\"|'[^']*')*?)(?P<empty>/)?>",
    re.DOTALL,
)
_ATTRIBUTE = re.compile(r"\s+(?P<name>[^\s=]+)\s*=\s*(?P<quote>[\"'])(?P<value>.*?)(?P=quote)", re.DOTALL)
_WORD = re.compile(r"\S+")

# (start, end, what stands there instead)
Edit = tuple[int, int, str]


@dataclass(frozen=True)
class TextPlace:
    """The place of a change in a model file.

    Attributes:
        line: 1-based line of the attribute, or of the element where the attribute is absent.
        element: tag; attribute: name, "" for the text between the tags.
        index: place of the number within the attribute; None for the attribute as a whole.
        found: the text that stands there; "" where the attribute is absent.
    """

    line: int
    element: str
    attribute: str
    index: int | None
    found: str

    @property
    def key(self) -> tuple[int, str, str]:
        """Line, element and attribute: what a diagnosis must name."""
        return self.line, self.element, self.attribute


@dataclass(frozen=True)
class Number:
    """One number of a model file.

    Attributes:
        start, end: where it stands in the text.
        line: 1-based line of the number itself, which need not be that of its tag.
        element: tag of its element; attribute: "" for a number between the tags; index: its place in the attribute.
    """

    start: int
    end: int
    value: float
    line: int
    element: str
    attribute: str
    index: int


@dataclass(frozen=True)
class Attribute:
    """One attribute; ``start`` includes the blanks before it, so that the text without it is well-formed."""

    name: str
    start: int
    end: int
    line: int
    value: str
    numbers: tuple[Number, ...]


@dataclass(frozen=True)
class Element:
    """One element; its text is ``[start, end)``, its content ``[opened, closed)``, which is empty for ``<tag/>``."""

    path: tuple[str, ...]
    start: int
    opened: int
    closed: int
    end: int
    line: int
    attributes: tuple[Attribute, ...]

    @property
    def tag(self) -> str:
        return self.path[-1]

    def get(self, name: str) -> str | None:
        """The text of attribute ``name``."""
        return next((attribute.value for attribute in self.attributes if attribute.name == name), None)

    def holds(self, part: Number | Element) -> bool:
        """True for a number of the element, and for numbers and elements inside of it."""
        return self.start < part.start < self.end


def innermost(holders: Iterable[Element], element: Element) -> Element | None:
    """The innermost of ``holders`` around ``element``; None where there is none."""
    return max((holder for holder in holders if holder.holds(element)), key=lambda holder: holder.start, default=None)


def find_elements(text: str, model_format: str) -> list[Element]:
    """Every element of a valid model but its decoration, in document order."""
    return [element for element in all_elements(text, model_format) if rules_at(model_format, element.path) is not None]


def all_elements(text: str, model_format: str) -> list[Element]:
    """Every element, which stands where the places of a tree number it."""
    scan = _Scan(text, model_format)
    found: list[Element] = []
    # Places in ``found`` of the elements that are still open.
    waiting: list[int] = []
    for token in _TAG.finditer(text):
        if token["tag"] is None:
            continue
        if token["close"]:
            place = waiting.pop()
            between = scan.between_tags(found[place], token.start())
            attributes = (*found[place].attributes, *between)
            found[place] = replace(found[place], closed=token.start(), end=token.end(), attributes=attributes)
            continue
        path = (*(found[waiting[-1]].path if waiting else ()), token["tag"])
        if not token["empty"]:
            waiting.append(len(found))
        attributes, line = tuple(scan.attributes(token, path)), scan.line(token.start())
        found.append(Element(path, token.start(), token.end(), token.end(), token.end(), line, attributes))
    return found


class _Scan:
    """A text with the ends of its lines."""

    def __init__(self, text: str, model_format: str) -> None:
        self._text, self._format = text, model_format
        self._ends = [match.start() for match in re.finditer("\n", text)]

    def line(self, place: int) -> int:
        """The 1-based line of a place in the text."""
        return bisect.bisect_left(self._ends, place) + 1

    def attributes(self, token: re.Match[str], path: tuple[str, ...]) -> Iterator[Attribute]:
        for match in _ATTRIBUTE.finditer(self._text, token.start("attributes"), token.end("attributes")):
            numbers = self._numbers(match.start("value"), match["value"], path, match["name"])
            yield Attribute(match["name"], match.start(), match.end(), self.line(match.start("name")), match["value"], numbers)

    def between_tags(self, element: Element, closed: int) -> Iterator[Attribute]:
        """The numbers between the tags of an element as the attribute ""; nothing where there are none."""
        content = self._text[element.opened : closed]
        if numbers := self._numbers(element.opened, content, element.path, ""):
            yield Attribute("", element.opened, closed, numbers[0].line, content, numbers)

    def _numbers(self, start: int, value: str, path: tuple[str, ...], name: str) -> tuple[Number, ...]:
        if not isinstance((rules_at(self._format, path) or {}).get(name), Numbers):
            return ()
        try:
            return tuple(
                Number(start + word.start(), start + word.end(), float(word[0]), self.line(start + word.start()), path[-1], name, index)
                for index, word in enumerate(_WORD.finditer(value))
            )
        except ValueError:
            # Written with character references, which no model needs.
            return ()


def find_numbers(text: str, model_format: str) -> list[Number]:
    """Every number of a valid model but its decoration's, in document order."""
    return [number for element in find_elements(text, model_format) for attribute in element.attributes for number in attribute.numbers]


def edited(text: str, edits: Iterable[Edit]) -> str:
    """The text after all edits, which do not overlap; one that is asked for twice is made once."""
    for start, end, replacement in sorted(dict.fromkeys(edits), reverse=True):
        text = text[:start] + replacement + text[end:]
    return text


def with_values(text: str, values: Mapping[Number, float]) -> str:
    """The text with other values for some of its numbers, each written exactly."""
    return edited(text, ((number.start, number.end, repr(value)) for number, value in values.items()))


def scaled(text: str, numbers: Iterable[Number], factor: float) -> str:
    """The text with some of its numbers multiplied by ``factor``."""
    return with_values(text, {number: number.value * factor for number in numbers})


def without(text: str, *spans: tuple[int, int]) -> str:
    """The text without some of its parts, which do not overlap."""
    return edited(text, ((start, end, "") for start, end in spans))


@dataclass
class Watch:
    """The accelerations of a model, to be compared with those of changed copies of its text.

    Attributes:
        model: the model as it is.
        answer: its accelerations (n, nv) at states of the caller's choice; InvalidModel or ValueError where
            a reader refuses the model.
        nv: number of accelerations where rows of constraints [m or rad] stand behind them; None where none do.
    """

    model: ModelFile
    answer: Callable[[ModelFile], Array]
    nv: int | None = None
    healthy: Array = field(init=False)

    def __post_init__(self) -> None:
        self.healthy = self.answer(self.model)

    def accelerations(self, text: str) -> Array | None:
        """The accelerations with another text; None where a reader refuses that."""
        try:
            return self.answer(self.model.with_text(text))
        except (InvalidModel, ValueError):
            return None

    def movement(self, text: str) -> float | None:
        """``largest_change`` of the answers with another text; None where it is refused."""
        moved = self.accelerations(text)
        return None if moved is None else largest_change(self.healthy, moved, self.nv)


def largest_change(healthy: Array, moved: Array, nv: int | None = None) -> float:
    """The largest change of any joint's accelerations, both (n, nv), relative to that joint's largest; inf where they are not finite.

    Joints are measured each by itself, or the wrist of an arm would hide its shoulder. Columns from ``nv`` on are rows of constraints
    [m or rad], whose change counts as it is: those of a closed loop hold nothing but rounding, by which nothing can be measured.
    """
    largest = np.abs(healthy).max(axis=0)
    if nv is not None:
        largest[nv:] = 1.0
    with np.errstate(divide="ignore", invalid="ignore"):
        change = np.where(moved == healthy, 0.0, np.abs(moved - healthy) / largest)
    return float(np.nan_to_num(change, nan=np.inf, posinf=np.inf).max())


def written(text: str, model_format: str, place: TextPlace) -> str:
    """The whole of the attribute that a place is in, or what the place says was found."""
    of_place = (
        attribute
        for element in find_elements(text, model_format)
        for attribute in element.attributes
        if element.tag == place.element and attribute.name == place.attribute
        for line in {attribute.line, *(number.line for number in attribute.numbers if place.index in (None, number.index))}
        if line == place.line
    )
    attribute = next(of_place, None)
    return place.found if attribute is None else " ".join(attribute.value.split())


def tag(place: TextPlace, whole: str) -> str:
    """An attribute as a reader finds it in the file."""
    if not place.attribute:
        return f"<{place.element}>{whole}</{place.element}>" if whole else f"<{place.element}>"
    return f'<{place.element} {place.attribute}="{whole}">' if whole else f"<{place.element} {place.attribute}>"


def compact(text: str) -> str:
    """A model file on one line, without comments; every number stays as it is written."""
    text = re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL)
    return re.sub(r"\s+", " ", re.sub(r">\s+<", "><", text)).strip()
