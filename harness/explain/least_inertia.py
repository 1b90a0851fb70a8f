"""A point mass that is written with the least inertia a reader accepts, where that inertia is felt.

Less cannot be tried, for the reader refuses it. Answers change in proportion to so little: those without any inertia are as far
from those of the file as those with twice as much, on the other side.

Source: MuJoCo documentation, XML reference, ``body/inertial``, and ``mjMINVAL``.
"""

from __future__ import annotations

from collections.abc import Callable

from harness.arrays import Array
from harness.explain.changes.numbers import INERTIAS
from harness.explain.result import TriedChange
from harness.models.formats import LEAST
from harness.models.text import Place, Watch, find_elements, tag, with_values

_REMEDIES = {
    "mjcf": "take it off the inertia of a body that turns with this one, make the mechanism larger, or give the mass the size that it has",
    "urdf": "write 0, which a URDF may hold",
}


def felt_least_inertia(watch: Watch, left_of: Callable[[Array], float], tolerance: float) -> TriedChange | None:
    """The change that explains the answers if they are right without the least inertias of the file; None if not.

    ``left_of`` gives the largest backward error of answers [data roundoffs], which explains up to ``tolerance``.
    """
    model = watch.model
    held = [
        (attribute, [number for number in attribute.numbers if number.value == LEAST])
        for element in find_elements(model.text, model.format)
        for attribute in element.attributes
        if attribute.name in INERTIAS.get((model.format, element.tag), ())
    ]
    least = [(attribute, numbers) for attribute, numbers in held if numbers]
    if not least:
        return None
    doubled = {number: 2 * LEAST for _, numbers in least for number in numbers}
    twice = watch.accelerations(with_values(model.text, doubled))
    if twice is None or (left := left_of(2 * watch.healthy - twice)) > tolerance:
        return None
    attribute, (number, *_) = least[0]
    place = Place(attribute.line, number.element, attribute.name, None, attribute.value)
    statement = f"the least inertia that MuJoCo accepts, {LEAST:g} kg m^2, is felt here; {_REMEDIES[model.format]}"
    return TriedChange("least inertia", statement, place, None, tag(place, " ".join(attribute.value.split())), "", left, True)
