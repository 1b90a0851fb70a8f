"""Ranges of actuators that hold another quantity than the one that they are documented for: mistakes that are no number of a file.

MuJoCo holds the control in ``ctrlrange``, and the force that gain and bias make of it in ``forcerange``. The gear is behind that. What all
actuators do on a joint is added, and held in ``actuatorfrcrange``.

Source: MuJoCo documentation, Computation, section Actuation model; Modeling, section Force limits.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from harness.files.given import Given, Place
from harness.files.text.written_numbers import with_attributes_written
from harness.files.tree import Actuator
from harness.trees.robot import Robot

Bounds = tuple[Fraction, Fraction]


@dataclass(frozen=True)
class MovedClamp:
    """A range that holds another quantity.

    Attributes:
        place: of the element that has the range. attribute: its name. held: the quantity that it holds, instead of its own.
        robot: what the file means then. edits: attributes of elements, by which a file says the same.
    """

    place: Place
    attribute: str
    held: str
    robot: Robot
    edits: Sequence[tuple[Place, Mapping[str, str]]]

    @property
    def name(self) -> str:
        """As of ``parameter_name``."""
        return f"{self.place.path.name}:{self.place.line}: {self.place.tag} {self.attribute}"

    def written(self, text: str, model_format: str) -> str:
        """The text of the file that says the same; raises KeyError where an element is in another file."""
        for place, attributes in self.edits:
            text = with_attributes_written(text, model_format, place, attributes)
        return text


def moved_clamps(robot: Robot) -> Iterator[MovedClamp]:
    """Those of a robot whose ranges can hold something else, each alone."""
    read = [one for one in robot.actuators if not one.why_not and one.place is not None]
    for one in read:
        if one.control_range is not None and one.force_range is None and not one.has_activation:
            free = replace(one, control_range=None)
            if not _is_its_control(one):
                yield _of_actuators(robot, one, "ctrlrange", "the force", {one.number: one.control_range}, free)
            if (behind := _before_the_gear(robot, one, one.control_range)) is not None:
                yield _of_actuators(robot, one, "ctrlrange", "what is behind the gear", {one.number: behind}, free)
        if one.force_range is not None and (behind := _before_the_gear(robot, one, one.force_range)) is not None:
            yield _of_actuators(robot, one, "forcerange", "what is behind the gear", {one.number: behind}, one)
    for joint, bounds in robot.force_limits:
        place, ranges = robot.joint(joint).place, dict[int, Bounds]()
        driving = [one for one in read if joint in dict(one.joints)]
        for one in driving:
            if one.force_range is None and one.joints == ((joint, Fraction(1)),):
                behind = _before_the_gear(robot, one, bounds, also_of_one=True)
                ranges |= {} if behind is None else {one.number: behind}
        # Of one actuator alone it is the same.
        if place is not None and len(ranges) == len(driving) > 1:
            yield _of_joint(robot, joint, place, ranges)


def _of_actuators(robot: Robot, owner: Actuator, attribute: str, held: str, ranges: Mapping[int, Bounds], changed: Actuator) -> MovedClamp:
    """A range of an actuator, ``owner``, in the place of which its force is held in ``ranges``; ``changed`` is the actuator without."""
    place = owner.place
    assert place is not None
    edits = [(place, {"ctrllimited": "false"})] if attribute == "ctrlrange" else []
    own = replace(robot, actuators=tuple(changed if one.number == owner.number else one for one in robot.actuators))
    return MovedClamp(place, attribute, held, _ranged(own, ranges), [*edits, *_written(robot, ranges)])


def _of_joint(robot: Robot, joint: str, place: Place, ranges: Mapping[int, Bounds]) -> MovedClamp:
    own = replace(robot, force_limits=tuple(one for one in robot.force_limits if one[0] != joint))
    edits = [(place, {"actuatorfrclimited": "false"}), *_written(robot, ranges)]
    return MovedClamp(place, "actuatorfrcrange", "what each actuator does", _ranged(own, ranges), edits)


def _ranged(robot: Robot, ranges: Mapping[int, Bounds]) -> Robot:
    return replace(
        robot, actuators=tuple(replace(one, force_range=ranges[one.number]) if one.number in ranges else one for one in robot.actuators)
    )


def _written(robot: Robot, ranges: Mapping[int, Bounds]) -> list[tuple[Place, Mapping[str, str]]]:
    places = {one.number: one.place for one in robot.actuators if one.place is not None}
    texts = {number: " ".join(repr(float(bound)) for bound in bounds) for number, bounds in ranges.items()}
    return [(places[number], {"forcelimited": "true", "forcerange": text}) for number, text in texts.items()]


def _is_its_control(actuator: Actuator) -> bool:
    """True where the force of an actuator is its control, so that a range holds the one as the other."""
    numbers = [sign * number for sign, number in (*actuator.gain, *actuator.bias)]
    return numbers[0] == 1 and not any(numbers[1:])


def _before_the_gear(robot: Robot, actuator: Actuator, bounds: Bounds, also_of_one: bool = False) -> Bounds | None:
    """The range before the gear that is ``bounds`` behind it; None where there is no such, or it is the same."""
    gear = float(actuator.gear[0]) if actuator.gear else 0.0
    single = all(robot.joint(name).kind.is_single for name, _ in actuator.joints)
    if actuator.site is not None or not single or not gear or (abs(gear) == 1.0 and not also_of_one):
        return None
    ends = sorted(float(bound) / gear for bound in bounds)
    place = actuator.place
    assert place is not None
    return Given(ends[0], place, "forcerange"), Given(ends[1], place, "forcerange", 1)
