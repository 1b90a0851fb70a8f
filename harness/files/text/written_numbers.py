"""Numbers and attributes of a tree written back into the text of the file that it is from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from harness.files.given import Given, Place
from harness.files.text.scan import Attribute, Element, all_elements, edited


def with_number_written(text: str, model_format: str, number: Given, value: float, beside: Sequence[float] = ()) -> str:
    """The text in which a number has another value, written exactly.

    ``beside`` are all numbers of its attribute, which is written whole where the file leaves it, or the number, to its default.

    Raises:
        KeyError: the text has no such element, or more than numbers in its place.
    """
    element = _element(text, model_format, number.place)
    own = _own(element, number.attribute)
    words = [] if own is None else own.value.split()
    words += [repr(float(one)) for one in beside[len(words) :]]
    if not number.index < len(words):
        raise KeyError(f"{number.attribute} of <{number.place.tag}> at {number.place}")
    words[number.index] = repr(float(value))
    return _put(text, element, {number.attribute: " ".join(words)})


def with_attributes_written(text: str, model_format: str, place: Place, attributes: Mapping[str, str]) -> str:
    """The text in which attributes of an element have other values; raises KeyError where the text has no such element."""
    return _put(text, _element(text, model_format, place), attributes)


def _element(text: str, model_format: str, place: Place) -> Element:
    elements = all_elements(text, model_format)
    if not place.element < len(elements) or elements[place.element].tag != place.tag:
        raise KeyError(f"<{place.tag}> at {place}")
    return elements[place.element]


def _own(element: Element, name: str) -> Attribute | None:
    return next((one for one in element.attributes if one.name == name), None)


def _put(text: str, element: Element, attributes: Mapping[str, str]) -> str:
    # Behind the tag where an attribute is not written.
    behind, edits = element.start + 1 + len(element.tag), []
    for name, value in attributes.items():
        own = _own(element, name)
        start, end = (behind, behind) if own is None else (own.start, own.end)
        edits.append((start, end, f' {name}="{value}"'))
    return edited(text, edits)
