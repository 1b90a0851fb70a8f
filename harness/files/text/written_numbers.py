"""A number of a tree written back into the text of the file that it is from."""

from __future__ import annotations

from collections.abc import Sequence

from harness.files.given import Given
from harness.files.text.scan import all_elements, edited


def with_number_written(text: str, model_format: str, number: Given, value: float, beside: Sequence[float] = ()) -> str:
    """The text in which a number has another value, written exactly.

    ``beside`` are all numbers of its attribute, which is written whole where the file leaves it, or the number, to its default.

    Raises:
        KeyError: the text has no such element, or more than numbers in its place.
    """
    elements = all_elements(text, model_format)
    if not number.place.element < len(elements) or elements[number.place.element].tag != number.place.tag:
        raise KeyError(f"<{number.place.tag}> at {number.place}")
    element = elements[number.place.element]
    own = next((one for one in element.attributes if one.name == number.attribute), None)
    words = [] if own is None else own.value.split()
    words += [repr(float(one)) for one in beside[len(words) :]]
    if not number.index < len(words):
        raise KeyError(f"{number.attribute} of <{number.place.tag}> at {number.place}")
    words[number.index] = repr(float(value))
    # Behind the tag where the attribute is not written.
    behind = element.start + 1 + len(element.tag)
    start, end = (behind, behind) if own is None else (own.start, own.end)
    return edited(text, [(start, end, f' {number.attribute}="{" ".join(words)}"')])
