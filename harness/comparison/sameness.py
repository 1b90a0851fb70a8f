"""Two files: one robot or not, and what differs, ranked by what each difference alone does to the accelerations.

Whether they are one robot is decided by their certified accelerations at the same states. What differs is found in the files: number
by number where they are built alike, else between what moves together, in frames that no author chose.

Of files that are built otherwise, what differs is set to the other file's value one by one: what that does is its effect alone.
"""

from __future__ import annotations

from collections.abc import Mapping, Set
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np

from harness.arrays import Array
from harness.comparison.matching import match, renamed_to
from harness.comparison.numbers import OtherShape, different_numbers, place_text, ranked
from harness.comparison.quantities import JOINT_NUMBERS, FileQuantity, Key, quantities
from harness.comparison.same_states import SameStates
from harness.comparison.truth import STATES_OF_EFFECTS, Meant, change, change_by_numbers, columns_of, read_as, reference_of
from harness.explain.changes.readings import freed, with_joints, with_tree
from harness.files.tree import WORLD, Body, Given, Inertia, Joint, Place, Placement, Quaternion, Vector
from harness.results.comparison import FileDifference, PairRecord
from harness.trees.bodies.spatial import parameter_name
from harness.trees.canonical import CanonicalNode, canonical
from harness.trees.robot import Robot
from harness.truth.compare import compare
from harness.verdict import Verdict


def hold_against(first: Meant, second: Robot, renamed: Mapping[str, str]) -> PairRecord:
    """The second file against the first, at the states of the first."""
    matching = match(first.robot, second, renamed)
    record = PairRecord(
        first=str(first.robot.path),
        second=str(second.path),
        same=False,
        remarks=[f"joint {one} is {matching.names[one]} by place and kind" for one in matching.by_place],
    )
    if matching.problem or first.undetermined:
        return replace(record, problem=matching.problem or first.undetermined)
    second = renamed_to(second, {other: one for one, other in matching.names.items()})
    led, (first, second) = _mimics(first, second), _freed(first, second)
    same_states = SameStates(first.robot, second)
    other = read_as(first, second, same_states)
    if other.undetermined:
        return replace(record, problem=f"{second.path.name}: {other.undetermined}")
    columns = columns_of(other.joints, first.robot.joints)
    compared = compare(first.truth, same_states.of_first(other.truth.high.astype(np.longdouble) + other.truth.low)[:, columns])
    verdicts = set(compared.verdicts[first.truth.certified & other.truth.certified].tolist())
    same = verdicts == {Verdict.AGREES.value} and not led
    backward, relative = compared.known("backward_error"), compared.known("relative_error")
    try:
        differences = ranked(first, second, different_numbers(first.robot.tree, second.tree))
    except OtherShape:
        differences = differences_of_nodes(first, second)
    return replace(
        record,
        same=same,
        backward_error=float(backward.max()) if len(backward) else None,
        relative_error=float(relative.max()) if len(relative) else None,
        equivalent=same and bool(differences),
        differences=[*led, *differences],
    )


def _mimics(first: Meant, second: Robot) -> list[FileDifference]:
    """The joints that move by themselves in one file only."""
    found = []
    for one in first.robot.tree.joints:
        other = second.joint(one.name)
        if one.follows != other.follows:
            alone = change(first, read_as(first, _free(first.robot, {one.name}))) if one.follows else None
            places = [place_text(joint.places.get("multiplier")) for joint in (one, other)]
            said = [f"mimics {joint.follows}" if joint.follows else "moves by itself" for joint in (one, other)]
            found.append(
                FileDifference(
                    what=f"joint {one.name}", first=said[0], second=said[1], first_place=places[0], second_place=places[1], alone=alone
                )
            )
    return found


def _freed(first: Meant, second: Robot) -> tuple[Meant, Robot]:
    """Both with the joints free that do not mimic the same joint in both, so that the rest can be compared."""
    names = {joint.name for joint in first.robot.tree.joints if joint.follows != second.joint(joint.name).follows}
    if not names:
        return first, second
    return read_as(first, _free(first.robot, names)), _free(second, names)


def _free(robot: Robot, names: Set[str]) -> Robot:
    def change(joint: Joint) -> Joint:
        return freed(joint) if joint.name in names else joint

    return with_tree(robot, with_joints(robot.tree, change))


# Stands for a number that is zero in the first file, so that it is a parameter of the equations.
_ALMOST_ZERO = 1e-300


def differences_of_nodes(first: Meant, second: Robot) -> list[FileDifference]:
    """The differences of two robots with equal names of joints, the one that moves the first's accelerations most first."""
    all_of_them = quantities(first.robot, second)
    differing = {key: one for key, one in all_of_them.items() if one.differs}
    effects = _effects(first, all_of_them, differing) if differing else {}
    found = []
    for key, one in differing.items():
        value, other = shown(*one.values)
        place, other_place = map(place_text, one.places)
        found.append(
            FileDifference(what=one.what, first=value, second=other, first_place=place, second_place=other_place, alone=effects.get(key))
        )
    return sorted(found, key=lambda one: -(one.alone or 0.0))


def shown(first: Array, second: Array) -> tuple[str, str]:
    """Both with as few digits as tell them apart."""
    texts = ("", "")
    for digits in (6, 9, 12, 17):
        one, other = (" ".join(f"{value:.{digits}g}" for value in array.ravel().tolist()) for array in (first, second))
        texts = (one, other)
        if one != other:
            break
    return texts


def _effects(first: Meant, all_of_them: Mapping[Key, FileQuantity], differing: Mapping[Key, FileQuantity]) -> dict[Key, float | None]:
    writer = _CanonicalRobot(first.robot, all_of_them, differing)
    reference = reference_of(writer.robot)
    columns = {name: column for column, (name, _, _) in enumerate(reference.mechanism.parameters)}
    own = np.array([0.0 if abs(value) <= _ALMOST_ZERO else value for value in reference.mechanism.parameter_values])
    states = first.states[np.arange(min(STATES_OF_EFFECTS, len(first.states)))]
    found: dict[Key, float | None] = {}
    for key, quantity in differing.items():
        changed = own.copy()
        for number, value in zip(writer.numbers[key], quantity.values[1].ravel().tolist(), strict=True):
            if parameter_name(number) in columns:
                changed[columns[parameter_name(number)]] = value
        found[key] = change_by_numbers(reference, states, own, changed)
    return found


class _CanonicalRobot:
    """The first robot in canonical axes.

    Attributes:
        numbers: of each quantity, as they are parameters of its equations.
    """

    def __init__(self, robot: Robot, all_of_them: Mapping[Key, FileQuantity], differing: Mapping[Key, FileQuantity]) -> None:
        self._path, self._all, self._differing = robot.path, all_of_them, differing
        self.numbers: dict[Key, tuple[Given, ...]] = {
            key: _given(robot.path, line, quantity) for line, (key, quantity) in enumerate(all_of_them.items())
        }
        bodies = [body for name, node in canonical(robot).items() for body in self._bodies(name, node)]
        tree = replace(robot.tree, bodies=tuple(bodies), gravity=self._three(("", "gravity")), total_mass=None, bounds=None)
        self.robot = replace(robot, tree=tree)

    def _three(self, key: Key) -> Vector:
        x, y, z = self.numbers[key]
        return x, y, z

    def _bodies(self, name: str, node: CanonicalNode) -> list[Body]:
        """The joint on a body without mass, and its masses on bodies fixed to that."""
        turn = (Quaternion(self.numbers[name, "turn"]),) if (name, "turn") in self._differing else ()
        numbers = {key: self.numbers[name, key][0] for key in JOINT_NUMBERS if self._all[name, key].scale}
        joint = Joint(
            name,
            node.joint.kind,
            axis=self._three((name, "axis")) if node.axis.any() else node.joint.axis,
            armature=numbers.get("armature", Fraction(0)),
            damping=numbers.get("damping", Fraction(0)),
            stiffness=numbers.get("stiffness", Fraction(0)),
            spring_reference=numbers.get("spring_reference", Fraction(0)),
            in_degrees=node.joint.in_degrees,
            follows=node.joint.follows,
            multiplier=numbers["multiplier"] if node.joint.follows else Fraction(1),
        )
        found = [Body(name, node.parent or WORLD, (Placement(self._three((name, "anchor")), turn),), (joint,), None)]
        for key in [what.removeprefix("mass ") for owner, what in self._all if owner == name and what.startswith("mass ")]:
            (mass,), moments = self.numbers[name, f"mass {key}"], self.numbers[name, f"moments {key}"]
            inertia = Inertia((Placement(self._three((name, f"centre {key}"))),), mass, moments)
            found.append(Body(f"{name} {key}", name, (), (), inertia))
        return found


def _given(path: Path, line: int, quantity: FileQuantity) -> tuple[Given, ...]:
    """The numbers of the first file as parameters, each with a name of its own."""
    place = Place(path, line)
    return tuple(Given(value or _ALMOST_ZERO, place, "value", index) for index, value in enumerate(quantity.values[0].ravel().tolist()))
