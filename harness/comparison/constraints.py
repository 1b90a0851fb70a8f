"""Two files held against each other beside their equations of motion: limits, dry friction, equalities, contacts, actuators.

No equation of motion holds them, so that files may move alike and differ. What an equality does is that of the law which an engine
documents for it, in certified accelerations at the states of the first file; what the others do is not judged.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from dataclasses import replace
from fractions import Fraction
from itertools import zip_longest

from harness.comparison.quantities import difference_of, rounding_of
from harness.comparison.switched_on import truth_with
from harness.explain.meant import Meant, largest_change
from harness.files.equalities import Equality, Linkage, Meeting, SolverParameters, TendonLinkage
from harness.files.findings import ACTUATORS
from harness.files.given import Place
from harness.files.left_out import Declared
from harness.files.tree import Actuator, Joint, Signed
from harness.results.comparison import FileDifference
from harness.results.table import counted_nouns
from harness.trees.robot import Robot

_NONE = "none"


def constraint_differences(first: Meant, second: Robot, followers: Set[str], are_built_alike: bool) -> list[FileDifference]:
    """The differences of two robots with equal names of joints, those that move accelerations most first.

    ``followers`` are joints whose couplings are told elsewhere. Points of equalities are compared in files that are built alike.
    """
    found = [*_equalities(first, second, followers, are_built_alike), *_of_joints(first.robot, second)]
    found += _elements(first.robot, second) if first.robot.format == second.format else _actuators(first.robot, second)
    return sorted(found, key=lambda one: -(one.alone or 0.0))


def not_held(first: Robot, second: Robot, are_built_alike: bool) -> list[str]:
    """Parts of either file that are not held against the other, such as "contacts (17 and 3)"."""
    found = []
    if first.format != second.format:
        known = (ACTUATORS,) if first.actuators and second.actuators else ()
        counts = [Counter(one.what for one in robot.declared if one.what not in known) for robot in (first, second)]
        found += [f"{what} ({counts[0][what]} and {counts[1][what]})" for what in dict.fromkeys([*counts[0], *counts[1]])]
    points = sum(isinstance(one.says, Meeting) for robot in (first, second) for one in robot.equalities)
    return [*found, f"the points of {counted_nouns(points, 'equalities')}"] if points and not are_built_alike else found


def _of_joints(first: Robot, second: Robot) -> Iterator[FileDifference]:
    """Limits and dry friction."""
    others, rounding = {joint.name: joint for joint in second.tree.joints}, rounding_of(first, second)
    for one in first.tree.joints:
        if (other := others.get(one.name)) is None or not one.kind.has_axis:
            continue
        limits = [_limits(joint) for joint in (one, other)]
        if (limits[0] is None) != (limits[1] is None) or (
            limits[0] is not None and limits[1] is not None and _differ(limits[0], limits[1], rounding)
        ):
            places = [joint.places.get("limits") for joint in (one, other)]
            yield _not_judged(f"limits of joint {one.name}", _values(limits), places)
        friction = [(float(joint.friction_loss),) for joint in (one, other)]
        if _differ(friction[0], friction[1], rounding):
            places = [joint.places.get("friction_loss") for joint in (one, other)]
            yield _not_judged(f"dry friction of joint {one.name}", _values(friction), places)


def _limits(joint: Joint) -> tuple[float, ...] | None:
    """[m or rad]; None without."""
    if joint.limits is None:
        return None
    return tuple(math.radians(value) if joint.in_degrees else float(value) for value in joint.limits)


def _differ(one: Sequence[float], other: Sequence[float], rounding: float) -> bool:
    return any(abs(a - b) > rounding * max(abs(a), abs(b)) for a, b in zip(one, other, strict=True))


def _values(pair: Sequence[Sequence[float] | None]) -> tuple[str, str]:
    """Both as people read them, with the digits of a file."""
    first, second = (_NONE if values is None else " ".join(f"{value:.15g}" for value in values) for values in pair)
    return first, second


def _not_judged(what: str, values: Sequence[str], places: Sequence[Place | None]) -> FileDifference:
    return replace(difference_of(what, values, places, None), is_judged=False)


# Equalities


def _equalities(first: Meant, second: Robot, followers: Set[str], are_built_alike: bool) -> Iterator[FileDifference]:
    ones, others = _by_tied(first.robot, followers), _by_tied(second, followers)
    for tied in dict.fromkeys([*ones, *others]):
        one, other = ones.get(tied), others.get(tied)
        what = f"{tied[0]} equality of {tied[1]}" + (f", number {tied[2]}" if tied[2] > 1 else "")
        places = [None if each is None else each.place for each in (one, other)]
        if one is not None and other is not None and _are_of_one_polynomial(one, other, rounding_of(first.robot, second)):
            other = replace(other, says=one.says)
        for values, changed in _changes(one, other, are_built_alike):
            before, after = truth_with(first.few, one), truth_with(first.few, changed)
            alone = None
            if before is not None and after is not None:
                alone = largest_change(before, after.high, before.certified & after.certified)
            yield replace(difference_of(what, values, places, alone), is_judged=alone is not None)


def _by_tied(robot: Robot, followers: Set[str]) -> dict[tuple[str, str, int], Equality]:
    """The equalities by what they tie, with their number among those that tie the same.

    None of a joint that follows in the tree, or that stands still, as it is in none.
    """
    told = followers | {joint.name for joint in robot.tree.joints if joint.follows}
    moving = robot.tree.joints_before
    found: dict[tuple[str, str, int], Equality] = {}
    counts: Counter[tuple[str, str]] = Counter()
    for one in robot.equalities:
        if isinstance(one.says, Linkage) and (one.says.joint in told or one.says.joint not in moving):
            continue
        tied = one.couples, _names(one)
        counts[tied] += 1
        found[*tied, counts[tied]] = one
    return found


def _names(equality: Equality) -> str:
    says = equality.says
    if isinstance(says, Linkage):
        return " and ".join(filter(None, (says.joint, says.leader)))
    if isinstance(says, TendonLinkage):
        return " and ".join(tendon.name for tendon in says.tendons)
    return " and ".join(sorted(says.bodies)) if isinstance(says, Meeting) else equality.name or equality.kind


def _changes(one: Equality | None, other: Equality | None, are_built_alike: bool) -> Iterator[tuple[tuple[str, str], Equality | None]]:
    """Each thing in which two equalities differ, in both files' words, and the first as it is with that of the second."""
    if one is None or other is None:
        present = "stands in the file" if (one or other).is_active else "stands in the file, switched off"  # type: ignore[union-attr]
        yield (_NONE, present) if one is None else (present, _NONE), other
        return
    if one.is_active != other.is_active:
        on, off = "switched on", "switched off"
        yield (on, off) if one.is_active else (off, on), replace(one, is_active=other.is_active)
    soft = one.softness or SolverParameters(), other.softness or SolverParameters()
    for name in ("solref", "solimp") if one.softness and other.softness else ():
        values = [getattr(each, name) for each in soft]
        if values[0] != values[1]:
            texts = _values([_floats(value) for value in values])
            yield (f"{name} {texts[0]}", f"{name} {texts[1]}"), replace(one, softness=replace(soft[0], **{name: values[1]}))
    if one.says == other.says or one.says is None or other.says is None or (isinstance(one.says, Meeting) and not are_built_alike):
        return
    if isinstance(one.says, Linkage | TendonLinkage) and isinstance(other.says, Linkage | TendonLinkage):
        texts = _values([_floats(each.says.coefficients) for each in (one, other)])  # type: ignore[union-attr]
        words = (f"polycoef {texts[0]}", f"polycoef {texts[1]}") if texts[0] != texts[1] else ("one tendon", "another of its name")
    else:
        texts = _values([_positions(each.says) for each in (one, other)])
        words = (f"at {texts[0]}", f"at {texts[1]}") if texts[0] != texts[1] else ("one frame", "another")
    yield words, replace(one, says=other.says, why_not=other.why_not)


def _are_of_one_polynomial(one: Equality, other: Equality, rounding: float) -> bool:
    """True where two equalities couple the same joints by coefficients that rounding alone tells apart."""
    if not isinstance(one.says, Linkage) or not isinstance(other.says, Linkage):
        return False
    pair = one.says.coefficients, other.says.coefficients
    return (one.says.joint, one.says.leader) == (other.says.joint, other.says.leader) and not _differ(
        _floats(pair[0]), _floats(pair[1]), rounding
    )


def _positions(says: object) -> tuple[float, ...]:
    """Positions of the points that meet, in their bodies [m]; none of what is no point."""
    ends = says.ends if isinstance(says, Meeting) else ()
    return tuple(float(value) for _, pose in ends for placement in pose for value in placement.position)


def _floats(numbers: Sequence[Fraction]) -> tuple[float, ...]:
    return tuple(map(float, numbers))


# Actuators of files of two formats, each of which says them in its own way


def _actuators(first: Robot, second: Robot) -> Iterator[FileDifference]:
    """The forces of actuators that both files have, by the joints that they drive; none of a format that holds no gains."""
    if not (first.actuators and second.actuators):
        return
    ones, others = _by_joint(first), _by_joint(second)
    for key in dict.fromkeys([*ones, *others]):
        one, other = ones.get(key), others.get(key)
        what = f"actuator of joint {key[0]}" + (f", number {key[1]}" if key[1] > 1 else "")
        if one is None or other is None:
            texts = [_NONE if each is None else "stands in the file" for each in (one, other)]
            yield _not_judged(what, texts, [None if each is None else each.place for each in (one, other)])
            continue
        for name, of in _FORCES.items():
            pair = of(one), of(other)
            if (pair[0] is None) != (pair[1] is None) or (pair[0] and pair[1] and _differ(pair[0], pair[1], rounding_of(first, second))):
                places = [each.places.get(name) for each in (one, other)]
                yield _not_judged(f"{name.replace('_', ' ')} of {what}", _values(pair), places)


def _by_joint(robot: Robot) -> dict[tuple[str, int], Actuator]:
    counts: Counter[str] = Counter()
    found: dict[tuple[str, int], Actuator] = {}
    for one in robot.actuators:
        if len(one.joints) == 1 and not one.why_not and one.joints[0][0] in robot.tree.joints_before:
            counts[one.joints[0][0]] += 1
            found[one.joints[0][0], counts[one.joints[0][0]]] = one
    return found


def _in_joint(actuator: Actuator, numbers: Sequence[Signed], powers: Sequence[int]) -> tuple[float, ...]:
    """Coefficients of a force in the joint itself, in whose units a gear counts by its powers."""
    gear = float(actuator.gear[0]) if actuator.gear else 1.0
    return tuple(sign * float(number) * gear**power for (sign, number), power in zip(numbers, powers, strict=True))


# Of a constant, a length and a velocity, and of a range.
_POWERS = (1, 2, 2)
_FORCES: dict[str, Callable[[Actuator], tuple[float, ...] | None]] = {
    "gain": lambda one: _in_joint(one, one.gain, _POWERS),
    "bias": lambda one: _in_joint(one, one.bias, _POWERS),
    "force_range": lambda one: one.force_range and tuple(float(end) * float(one.gear[0]) for end in one.force_range),
}


# Elements that no equation of motion holds


def _elements(first: Robot, second: Robot) -> Iterator[FileDifference]:
    ones, others = _by_owner(first), _by_owner(second)
    for key in dict.fromkeys([*ones, *others]):
        one, other = ones.get(key), others.get(key)
        values = _different_attributes({} if one is None else one.values, {} if other is None else other.values)
        if one is None or other is None:
            values = [_NONE if each is None else "stands in the file" for each in (one, other)]
        if values:
            places = [None if each is None else each.place for each in (one, other)]
            yield _not_judged(f"{key[0]} of {key[1]}", values, places)


def _by_owner(robot: Robot) -> dict[tuple[str, str, int], Declared]:
    """The elements by what they are about, but for joints that stand still."""
    found: dict[tuple[str, str, int], Declared] = {}
    counts: Counter[tuple[str, str]] = Counter()
    for one in robot.declared:
        kind, _, name = one.owner.partition(" ")
        if kind == "joint" and name not in robot.tree.joints_before:
            continue
        counts[one.what, one.owner] += 1
        found[one.what, one.owner, counts[one.what, one.owner]] = one
    return found


def _different_attributes(one: Mapping[str, str], other: Mapping[str, str]) -> list[str]:
    """Those that differ, as the files write them."""
    names = [name for name in dict.fromkeys([*one, *other]) if not _are_equal(one.get(name, ""), other.get(name, ""))]
    return [", ".join(f"{name} {values.get(name) or 'by default'}" for name in names) for values in (one, other)] if names else []


def _are_equal(one: str, other: str) -> bool:
    def value(word: str) -> float | str:
        try:
            return float(word)
        except ValueError:
            return word

    words = one.split(), other.split()
    return all(value(a) == value(b) for a, b in zip_longest(*words, fillvalue=""))
