"""Two files: one robot or not, and what differs, ranked by what each difference alone does to the accelerations.

Whether they are one robot is decided by their certified accelerations at the same states. What differs is found in the files: number
by number where their trees have one shape, as those of a file and an edited copy of it, else between what moves together
(``quantities``), in frames that no author chose.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, fields, is_dataclass, replace
from fractions import Fraction
from typing import Any

import numpy as np

from harness.comparison.constraints import constraint_differences, not_held
from harness.comparison.matching import Matching, SameStates, locked, match, renamed_to
from harness.comparison.quantities import difference_of, differences_of_nodes, place_text, rounding_of
from harness.explain.changes.readings import freed, with_joints, with_tree
from harness.explain.meant import Meant, change, columns_of, effects_of_numbers, read_as, reference_of, worst
from harness.files.given import MOMENTS, Given
from harness.files.tree import Body, Inertia, Joint, Tree
from harness.programs.numbers import UNIT_ROUNDOFF
from harness.results.comparison import FileDifference, LockedJoint, PairRecord, names_apart
from harness.results.table import number_text
from harness.trees.bodies.spatial import parameter_name
from harness.trees.robot import Robot
from harness.truth.compare import Comparison, Flags, compare
from harness.verdict import Verdict

# What is said of a number by the field of a tree that holds it.
_NAMES = {
    "mass": "mass",
    "moments": "moments of inertia",
    "axis": "axis",
    "anchor": "anchor",
    "pose": "origin",
    "damping": "damping",
    "stiffness": "stiffness",
    "spring_reference": "spring reference",
    "friction_loss": "friction",
    "limits": "limits",
    "armature": "armature",
    "reference": "reference",
    "multiplier": "multiplier of the mimic",
    "offset": "offset of the mimic",
    "gravity": "gravity",
    "gravity_compensation": "gravity compensation",
}
# A share of numbers that are rounded to fewer digits than those of float64.
_ROUNDED = 1e-9
# Numbers that no equation of motion holds.
_NOT_FELT = ("friction_loss", "limits", "margin", "friction_softness", "limit_softness")


def hold_against(first: Meant, second: Robot, renamed: Mapping[str, str], without: Sequence[str] = ()) -> PairRecord:
    """The second file against the first, at the states of the first.

    Joints that one of them alone moves, and those of ``without``, stand still in both.
    """
    matching = match(first.robot, second, renamed)
    still = _locked(matching, first.robot, second, without)
    record = PairRecord(
        first=str(first.robot.path),
        second=str(second.path),
        same=False,
        locked=[joint for joint, _, _ in still],
        remarks=[f"joint {one} is {matching.names[one]} by place and kind" for one in matching.by_place],
    )
    moving = {one: other for one, other in matching.names.items() if all(one != name for _, name, _ in still)}
    if not moving:
        return replace(record, problem="no joint of the one is known as a joint of the other; --map JOINT=OTHER says which is which")
    led = _mimics(first, second, moving)
    free = {one for one, _ in led}
    robot = locked(_free(first.robot, free), {name for _, name, _ in still if name})
    second = locked(_free(second, {moving[one] for one in free}), {name for _, _, name in still if name})
    second = renamed_to(second, {other: one for one, other in moving.items()})
    first = read_as(first, robot)
    if first.undetermined:
        return replace(record, problem=f"{first.robot.path.name}: {first.undetermined}")
    same_states = SameStates(first.robot, second)
    other = read_as(first, second, same_states.of_second)
    if other.undetermined:
        return replace(record, problem=f"{second.path.name}: {other.undetermined}")
    columns = columns_of(other.joints, first.robot.joints)
    answers = same_states.of_first(other.truth.high.astype(np.longdouble) + other.truth.low)[:, columns]
    compared, both = compare(first.truth, answers), first.truth.certified & other.truth.certified
    # Numbers that a format rounds have the decimals of the other file, or else are no nearer than its precision.
    precision = max(first.robot.unit_roundoff, second.unit_roundoff)
    if in_float32 := precision > UNIT_ROUNDOFF and not _agree(compared, both):
        compared = compare(first.truth.for_unit_roundoff(precision), answers)
    alike = _agree(compared, both) and not led
    try:
        differences, are_built_alike = _different_numbers(first, second), True
    except _OtherShape:
        differences, are_built_alike = differences_of_nodes(first, second), False
    constraints = constraint_differences(first, second, free, are_built_alike)
    return replace(
        record,
        same=alike and not constraints and all(joint.asked for joint in record.locked),
        constraints=constraints,
        not_held=not_held(first.robot, second, are_built_alike),
        alike=alike,
        in_float32=in_float32,
        backward_error=worst(compared),
        relative_error=worst(compared, "relative_error"),
        equivalent=alike and bool(differences),
        # The one that alone moves the accelerations of the first file most comes first.
        differences=[*(one for _, one in led), *sorted(differences, key=lambda one: -(one.alone or 0.0))],
    )


def _agree(compared: Comparison, both: Flags) -> bool:
    """True where both files have certified truths and these agree."""
    return set(compared.verdicts[both].tolist()) == {Verdict.AGREES.value}


def _locked(matching: Matching, first: Robot, second: Robot, without: Sequence[str]) -> list[tuple[LockedJoint, str, str]]:
    """The joints that stand still, each with its name in both files, "" in one that does not have it."""
    files = list(names_apart([str(first.path), str(second.path)]).values())
    pairs = [*matching.names.items(), *((one, "") for one in matching.only_first), *(("", other) for other in matching.only_second)]
    kinds = [{"": "", **{joint.name: joint.kind.value for joint in robot.tree.joints}} for robot in (first, second)]
    reasons: dict[tuple[str, str], tuple[str, bool]] = {}
    for one, other in pairs:
        if {one, other} & set(without):
            reasons[one, other] = "left out as asked for", True
        elif not one or not other:
            reasons[one, other] = f"only {files[0] if one else files[1]} moves it", False
        elif kinds[0][one] != kinds[1][other]:
            reasons[one, other] = f"a {kinds[0][one]} joint in {files[0]}, and a {kinds[1][other]} joint in {files[1]}", False
    for one, other in pairs:
        leaders = [robot.joint(name).follows for robot, name in ((first, one), (second, other)) if name]
        for pair, (_, asked) in list(reasons.items()):
            # What follows a joint that was left out is left out with it, even where one file alone moves it.
            is_new = (one, other) not in reasons or (asked and not reasons[one, other][1])
            if is_new and all(leader and leader in pair for leader in leaders):
                reasons[one, other] = f"it mimics {pair[0] or pair[1]}, which stands still", asked
    found = []
    for (one, other), (why, asked) in reasons.items():
        places = [place_text(robot.joint(name).place) if name else "" for robot, name in ((first, one), (second, other))]
        found.append((LockedJoint(name=one or other, why=why, asked=asked, first_place=places[0], second_place=places[1]), one, other))
    return found


def _mimics(first: Meant, second: Robot, names: Mapping[str, str]) -> list[tuple[str, FileDifference]]:
    """The joints that follow others in one file than in the other, by their names in the first; ``names`` are those that move in both."""
    found = []
    for one, other in ((first.robot.joint(one), second.joint(other)) for one, other in names.items()):
        if names.get(one.follows, one.follows) != other.follows:
            alone = change(first, read_as(first, _free(first.robot, {one.name}))) if one.follows else None
            said = [f"mimics {joint.follows}" if joint.follows else "moves by itself" for joint in (one, other)]
            places = [joint.places.get("multiplier") for joint in (one, other)]
            found.append((one.name, difference_of(f"joint {one.name}", said, places, alone)))
    return found


def _free(robot: Robot, names: Set[str]) -> Robot:
    """The robot with joints that move by themselves, whatever they mimic in the file, so that the rest can be compared."""

    def change(joint: Joint) -> Joint:
        return freed(joint) if joint.name in names else joint

    return with_tree(robot, with_joints(robot.tree, change)) if names else robot


class _OtherShape(Exception):
    """The trees are made of other parts."""


@dataclass(frozen=True)
class _NumberPair:
    """One number of a tree and that of another at its place; ``what`` says of which part."""

    what: str
    first: Fraction
    second: Fraction

    def differs(self, rounding: float) -> bool:
        """True where the two are further apart than a share of them."""
        return self.first != self.second and abs(self.first - self.second) > rounding * max(abs(self.first), abs(self.second))


def _different_numbers(first: Meant, second: Robot) -> list[FileDifference]:
    """The numbers that differ, in the order of the first, with what each does alone.

    Raises:
        _OtherShape: bodies, joints or rotations are other ones.
    """
    # Files of one format hold the same decimals, or others.
    rounding = (
        0.0 if first.robot.format == second.format or rounding_of(first.robot, second) < _ROUNDED else rounding_of(first.robot, second)
    )
    pairs = [pair for pair in _pairs(first.robot.tree, second.tree, "", "") if pair.differs(rounding)]
    # A number that is no parameter of the first is set to the first's value in the second.
    effects = _effects(read_as(first, second), [(pair.second, pair.first) for pair in pairs])
    effects |= _effects(first, [(pair.first, pair.second) for pair in pairs])
    found = []
    for number, pair in enumerate(pairs):
        places = [value.place if isinstance(value, Given) else None for value in (pair.first, pair.second)]
        found.append(
            difference_of(pair.what, [number_text(float(number)) for number in (pair.first, pair.second)], places, effects.get(number, 0.0))
        )
    return found


def _pairs(one: Any, other: Any, owner: str, what: str) -> Iterator[_NumberPair]:
    if isinstance(one, Fraction) and isinstance(other, Fraction):
        component = "" if what in MOMENTS else next((number.component for number in (one, other) if isinstance(number, Given)), "")
        yield _NumberPair(f"{what} {component}".rstrip() + f" of {owner}", one, other)
    elif is_dataclass(one) and type(one) is type(other):
        owner = _owner(one, owner)
        for field in fields(one):
            if field.name not in ("place", *_NOT_FELT):
                name = "centre of mass" if isinstance(one, Inertia) and field.name == "pose" else _NAMES.get(field.name, field.name)
                named = name if isinstance(one, Tree | Body | Joint | Inertia) else what
                yield from _pairs(getattr(one, field.name), getattr(other, field.name), owner, named)
    elif isinstance(one, tuple) and isinstance(other, tuple) and len(one) == len(other):
        names = MOMENTS if what == _NAMES["moments"] else [what] * len(one)
        for part, its_like, name in zip(one, other, names, strict=True):
            yield from _pairs(part, its_like, owner, name)
    elif one != other:
        raise _OtherShape(what)


def _owner(part: Any, owner: str) -> str:
    if isinstance(part, Joint):
        return f"joint {part.name}"
    if isinstance(part, Body):
        return f"link {part.name}"
    return owner or "the world"


def _effects(meant: Meant, numbers: Sequence[tuple[Fraction, Fraction]]) -> dict[int, float | None]:
    """Effect of each other value of a number of a robot: by the place of those that are parameters of its equations."""
    reference = reference_of(meant.robot)
    names = {name for name, _, _ in reference.mechanism.parameters}
    changes = {
        place: {parameter_name(number): float(value)}
        for place, (number, value) in enumerate(numbers)
        if isinstance(number, Given) and parameter_name(number) in names
    }
    return effects_of_numbers(reference, meant.states, changes, np.array(reference.mechanism.parameter_values))
