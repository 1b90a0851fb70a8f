"""Every single number of a model file as a change, with its natural size."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence

from harness.explain.changes import NUMBER, Change
from harness.files.mjcf.attributes import ORIENTATIONS
from harness.files.model_file import ModelFile
from harness.files.text.scan import Attribute, Element, Number, TextPlace, find_elements, with_values
from harness.files.urdf.kinds import BALL_CONSTRAINT, POINT_SPRING

# Of a value beside far larger ones, which may be what a wrong unit left: its scale is at least this share of theirs.
LEAST_SHARE = 1e-3
# A file whose lengths are all below this [m] has none by which to measure one.
NEGLIGIBLE_LENGTH = 1e-6
# Format and element to the attributes that are moments or products of inertia.
INERTIAS = {("urdf", "inertia"): ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), ("mjcf", "inertial"): ("diaginertia", "fullinertia")}
_LENGTHS = {"pos", "xyz", "springlength"}
# Elements whose value is a length or a point.
_POINTS = (f"{POINT_SPRING}_p_", f"{POINT_SPRING}_free_length", f"{BALL_CONSTRAINT}_p_")
_ANGLES = {"rpy", "axis", *ORIENTATIONS}


def numeric_changes(model: ModelFile) -> list[Change]:
    """Every number of the model as a change whose free value stands in its place, zeros included.

    A component of an axis changes with the others so that the axis keeps its length. A moment of inertia that
    physics may forbid to change alone comes a second time, in proportion with the others of its body.
    """
    elements = find_elements(model.text, model.format)
    return [
        change
        for element in elements
        for attribute in element.attributes
        for number in attribute.numbers
        for change in _of_number(model, elements, element, attribute, number)
    ]


def _of_number(model: ModelFile, elements: Sequence[Element], element: Element, attribute: Attribute, number: Number) -> Iterator[Change]:
    place = place_of(model, number)
    names = INERTIAS.get((model.format, element.tag), ())
    inertia = [other for own in element.attributes if own.name in names for other in own.numbers] if attribute.name in names else []
    group = inertia or list(attribute.numbers)
    scale = _scale(elements, element, attribute, number, group)
    if "axis" in (element.tag, attribute.name):
        others = [other for other in group if other is not number]
        rest = math.hypot(*(other.value for other in others))
        length = math.hypot(number.value, rest)
        if rest > 0:
            beside = (place_of(model, other) for other in others if other.value)
            yield Change(NUMBER, "", (place, *beside), _turned(model.text, group, number, rest, length), number.value, length)
            return
    yield Change(NUMBER, "", (place,), lambda value: with_values(model.text, {number: value}), number.value, scale)
    moments = [other for other in inertia if other.value != 0]
    if number in moments and len(moments) > 1:
        yield Change(
            NUMBER,
            "with the other moments of inertia in proportion",
            (place, *(place_of(model, other) for other in moments if other is not number)),
            lambda value: with_values(model.text, {other: other.value * (value / number.value) for other in moments}),
            number.value,
            scale,
        )


def place_of(model: ModelFile, number: Number) -> TextPlace:
    """The place of a change of one number."""
    return TextPlace(number.line, number.element, number.attribute, number.index, model.text[number.start : number.end])


def _turned(text: str, components: Sequence[Number], number: Number, rest: float, length: float) -> Callable[[float], str]:
    """The text with another component of an axis, the others scaled so that the axis keeps its length."""

    def turned(value: float) -> str:
        value = max(-length, min(length, value))
        share = math.sqrt(max(0.0, length**2 - value**2)) / rest
        # At its own value the text is the file's, not what rounding makes of it.
        others = {} if value == number.value else {other: other.value * share for other in components}
        return with_values(text, {**others, number: value})

    return turned


def _scale(elements: Sequence[Element], element: Element, attribute: Attribute, number: Number, group: Sequence[Number]) -> float:
    """The natural size of a number: its own, its neighbours', or that of its like elsewhere in the file."""
    largest, is_length = max(abs(other.value) for other in group), _is_length(element, attribute)
    if largest > 0 and not is_length and len(group) > 1:
        return max(abs(number.value), LEAST_SHARE * largest) if number.value else largest
    if attribute.name in _ANGLES:
        return 1.0
    # A name such as "value" means something else in each element.
    like = [
        abs(other.value)
        for holder in elements
        for own in holder.attributes
        if (_is_length(holder, own) if is_length else (holder.tag, own.name) == (element.tag, attribute.name))
        for other in own.numbers
    ]
    alike = max(like, default=0.0)
    if alike <= (NEGLIGIBLE_LENGTH if attribute.name in _LENGTHS else 0.0):
        alike = 1.0
    # A length or a mass far below all others may be what is wrong: its step must be felt.
    return max(abs(number.value) or largest or alike, LEAST_SHARE * alike)


def _is_length(element: Element, attribute: Attribute) -> bool:
    return attribute.name in _LENGTHS or (element.tag.startswith(_POINTS) and attribute.name == "value")
