"""Two robots whose files are built otherwise: the quantities of the parts that move together, and what differs in them.

Both are taken in axes parallel to the world's with every joint at zero, where files of one robot hold the same numbers. A frame that
is turned in one file turns all that it carries: a turn that makes what a joint carries fit is one difference, at that joint. What
differs is set to the other file's value one by one: what that does is its effect alone.

Source: Kabsch, A solution for the best rotation to relate two sets of vectors, Acta Cryst. A32 (1976).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.explain.changes.readings import with_bodies, with_tree
from harness.explain.meant import Meant, change, effects_of_numbers, read_as, reference_of
from harness.files.given import MOMENTS, SPACE, Given, Place, Placement, Quaternion, Vector
from harness.files.tree import WORLD, Body, Coupling, Inertia, Joint, Spring
from harness.results.comparison import FileDifference
from harness.trees.bodies.spatial import parameter_name
from harness.trees.canonical import CanonicalNode, Mass, canonical
from harness.trees.robot import Robot

# Vectors in canonical axes carry the rounding of the rotations that brought them there [unit roundoffs].
_ROUNDINGS = 64
# A turn explains what a joint carries where it leaves this share of the difference.
LEFT_BY_TURN = 1e-2
# Lengths [m] and moments [kg m^2] below which a difference is counted as if they were so large.
LEAST_LENGTH, LEAST_MOMENT = 1e-3, 1e-12
JOINT_NUMBERS = {
    "armature": "armature",
    "damping": "damping",
    "stiffness": "stiffness",
    "spring_reference": "spring reference",
    "multiplier": "multiplier of the mimic",
}
# Stands for a number that is zero in the first file, so that it is a parameter of the equations.
_ALMOST_ZERO = 1e-300
# The joint, "" for none, and the quantity.
Key = tuple[str, str]


@dataclass(frozen=True)
class FileQuantity:
    """One quantity of two files.

    Attributes:
        what: in words. values: in the axes of the first file. scale: by which their difference is measured. places: in either file.
        rounding: share of the scale that rounding explains. names: of the numbers where there are several.
    """

    what: str
    values: tuple[Array, Array]
    scale: float
    places: tuple[Place | None, Place | None]
    rounding: float
    names: Sequence[str] = ("",)

    @property
    def differs(self) -> bool:
        """True where the difference is more than rounding."""
        first, second = self.values
        return bool(np.abs(first - second).max() > self.rounding * self.scale)

    @property
    def texts(self) -> tuple[str, str]:
        """Either's numbers that differ, each with its name, to a thousandth of the difference or to rounding."""
        rounding, first, second = self.rounding * self.scale, list[str](), list[str]()
        for name, one, other in zip(self.names, *(values.ravel().tolist() for values in self.values), strict=True):
            if (apart := abs(one - other)) > rounding:
                for texts, value in ((first, one), (second, other)):
                    texts.append(f"{name} {_short(value, max(rounding, apart / 1000))}".lstrip())
        return ", ".join(first), ", ".join(second)


def rounding_of(first: Robot, second: Robot) -> float:
    """Relative difference of numbers of two files that rounding explains, in the precision of the format that holds fewer digits."""
    return _ROUNDINGS * max(first.unit_roundoff, second.unit_roundoff)


def quantities(first: Robot, second: Robot) -> dict[Key, FileQuantity]:
    """All quantities of two robots with equal names of joints, those of a joint before those of the joints that it carries."""
    nodes, rounding = (canonical(first), canonical(second)), rounding_of(first, second)
    vectors = tuple(np.array([float(value) for value in robot.tree.gravity]) for robot in (first, second))
    gravity = (vectors[0], vectors[1])
    places = (first.tree.places.get("gravity"), second.tree.places.get("gravity"))
    found: dict[Key, FileQuantity] = {
        ("", "gravity"): FileQuantity("gravity", gravity, float(np.abs(gravity).max()), places, rounding, SPACE)
    }
    turns: dict[str, Array] = {"": np.eye(3)}
    for name, one in nodes[0].items():
        other, turn = nodes[1][name], turns[one.parent]
        below = [(child, nodes[1][key]) for key, child in nodes[0].items() if child.parent == name]
        carried = [(one.axis, other.axis), (one.total.centre, other.total.centre)]
        carried += [pair for child, its_like in below for pair in ((child.anchor, its_like.anchor), (child.axis, its_like.axis))]
        turns[name] = _turn(carried, turn, rounding)
        of_node = (*_of_joint(one, other, (turn, turns[name]), rounding), *_of_masses(one, other, turns[name], rounding))
        found |= {(name, key): quantity for key, quantity in of_node}
    return found


def _of_joint(one: CanonicalNode, other: CanonicalNode, turns: tuple[Array, Array], rounding: float) -> Iterator[tuple[str, FileQuantity]]:
    """Quantities of the joint: its origin, the orientation of what it carries, its axis and its numbers; ``turns``: before it, its own."""
    name, (before, own) = one.joint.name, turns
    size = max(float(np.linalg.norm(one.anchor)), float(np.linalg.norm(one.total.centre)), LEAST_LENGTH)
    frames = (one.body.places.get("pose"), other.body.places.get("pose"))
    yield "anchor", FileQuantity(f"origin of joint {name}", (one.anchor, before @ other.anchor), size, frames, rounding, SPACE)
    turned = _quaternion(np.eye(3)), _quaternion(own @ before.T)
    yield "turn", FileQuantity(f"orientation of joint {name}", turned, 1.0, frames, rounding, ("w", *SPACE))
    axes = (one.joint.places.get("axis"), other.joint.places.get("axis"))
    yield "axis", FileQuantity(f"axis of joint {name}", (one.axis, own @ other.axis), 1.0, axes, rounding, SPACE)
    for number, words in JOINT_NUMBERS.items():
        first, second = (np.array([float(getattr(node.joint, number))]) for node in (one, other))
        places = (one.joint.places.get(number), other.joint.places.get(number))
        scale = float(max(abs(first[0]), abs(second[0])))
        yield number, FileQuantity(f"{words} of joint {name}", (first, second), scale, places, rounding)


def _of_masses(one: CanonicalNode, other: CanonicalNode, turn: Array, rounding: float) -> Iterator[tuple[str, FileQuantity]]:
    """Mass, centre and moments of each body where the bodies have the same names, else of all that moves with the joint."""
    if one.bodies.keys() == other.bodies.keys():
        for body in one.bodies:
            elements = (one.elements[body], other.elements[body])
            masses = one.bodies[body], other.bodies[body].turned(turn)
            yield from _of_mass((body, f"link {body}"), masses, elements, rounding)
    else:
        totals = (one.total, other.total.turned(turn))
        yield from _of_mass(("", f"all that moves with joint {one.joint.name}"), totals, (_heaviest(one), _heaviest(other)), rounding)


def _of_mass(
    named: tuple[str, str], masses: tuple[Mass, Mass], bodies: tuple[Body, Body], rounding: float
) -> Iterator[tuple[str, FileQuantity]]:
    (key, owner), (first, second) = named, masses

    def places(part: str) -> tuple[Place | None, Place | None]:
        one, other = (body.inertia.places.get(part) if body.inertia is not None else body.place for body in bodies)
        return one, other

    amounts = (np.array([first.mass]), np.array([second.mass]))
    yield f"mass {key}", FileQuantity(f"mass of {owner}", amounts, float(max(amounts)[0]), places("mass"), rounding)
    size = max(float(np.linalg.norm(first.centre)), LEAST_LENGTH)
    yield f"centre {key}", FileQuantity(f"centre of mass of {owner}", (first.centre, second.centre), size, places("pose"), rounding, SPACE)
    moments = (_six(first.moments), _six(second.moments))
    # The moments of several bodies together carry the rounding of what their distances add.
    added = 0.0 if key else float(max(amounts)[0]) * size**2
    scale = max(float(np.abs(moments).max()), added, LEAST_MOMENT)
    yield f"moments {key}", FileQuantity(f"moments of inertia of {owner}", moments, scale, places("moments"), rounding, MOMENTS)


def _heaviest(node: CanonicalNode) -> Body:
    heaviest = max(node.bodies, key=lambda name: node.bodies[name].mass, default="")
    return node.elements[heaviest] if heaviest else node.body


def _six(moments: Array) -> Array:
    return np.array([moments[0, 0], moments[1, 1], moments[2, 2], moments[0, 1], moments[0, 2], moments[1, 2]])


def _turn(pairs: list[tuple[Array, Array]], before: Array, rounding: float) -> Array:
    """The rotation of the second's vectors into the first's: that of the joint before, or another one that makes them fit."""
    kept = [(one, before @ other) for one, other in pairs if min(np.linalg.norm(one), np.linalg.norm(other)) > LEAST_LENGTH * 1e-6]
    if not kept:
        return before
    first, second = (np.array([pair[side] / np.linalg.norm(pair[side]) for pair in kept]) for side in (0, 1))
    apart = float(np.abs(first - second).max())
    if apart <= rounding or np.linalg.matrix_rank(second, tol=1e-6) < 2:
        return before
    left, _, right = np.linalg.svd(first.T @ second)
    turn = left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right
    fits = float(np.abs(first - second @ turn.T).max()) <= max(LEFT_BY_TURN * apart, rounding)
    return np.asarray(turn @ before) if fits else before


def _quaternion(turn: Array) -> Array:
    """(w, x, y, z) of a rotation."""
    w = float(np.sqrt(max(0.0, 1 + np.trace(turn)))) / 2
    if w < LEAST_LENGTH:
        values, vectors = np.linalg.eigh((turn + turn.T) / 2)
        return np.array([0.0, *vectors[:, values.argmax()]])
    vector = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]) / (4 * w)
    return np.array([w, *vector])


def differences_of_nodes(first: Meant, second: Robot) -> list[FileDifference]:
    """The differences of two robots with equal names of joints, with what each does alone to the accelerations of the first."""
    found = quantities(first.robot, second)
    differing = {key: one for key, one in found.items() if one.differs}
    effects = _effects(first, found, differing) if differing else {}
    return [
        *(difference_of(one.what, one.texts, one.places, effects[key]) for key, one in differing.items()),
        *_differences_of_shares(first, second),
        *_differences_of_springs(first, second),
    ]


def _differences_of_shares(first: Meant, second: Robot) -> Iterator[FileDifference]:
    """The shares of gravity that bodies of one name do not feel."""
    others, rounding = {body.name: body for body in second.tree.bodies}, rounding_of(first.robot, second)
    for body in first.robot.tree.bodies:
        other = others.get(body.name, body)
        shares = body.gravity_compensation, other.gravity_compensation
        if abs(shares[0] - shares[1]) > rounding * max(map(abs, shares)):
            robot = with_tree(first.robot, with_bodies(first.robot.tree, partial(_with_share, body.name, shares[1])))
            texts = [f"{float(share):.15g}" for share in shares]
            places = [one.places.get("gravity_compensation") for one in (body, other)]
            alone = change(first, read_as(first, robot))
            yield difference_of(f"gravity compensation of link {body.name}", texts, places, alone)


def _with_share(name: str, share: Fraction, body: Body) -> Body:
    return replace(body, gravity_compensation=share) if body.name == name else body


_Force = Spring | Coupling
_OF_FORCES = ("stiffness", "damping", "free_length", "rest", "slack_to", "armature")


def _differences_of_springs(first: Meant, second: Robot) -> Iterator[FileDifference]:
    """The springs and dampers between points, and those on sums of joint positions, by what they join."""
    tree, rounding = first.robot.tree, rounding_of(first.robot, second)
    ones, others = (_forces(one.springs, one.couplings) for one in (tree, second.tree))
    for key in dict.fromkeys([*ones, *others]):
        one, other = ones.get(key), others.get(key)
        values: list[dict[str, float]] = [{} if force is None else _numbers_of(force) for force in (one, other)]
        differing = [name for name in _OF_FORCES if not math.isclose(*(each.get(name, 0.0) for each in values), rel_tol=rounding)]
        if one is not None and other is not None and not differing:
            continue
        texts = ["none" if not each else ", ".join(f"{name} {each.get(name, 0.0):.15g}" for name in differing) for each in values]
        places = [None if force is None else force.places.get("".join(differing[:1]), force.place) for force in (one, other)]
        alone = None
        if one is not None:
            kept = [] if other is None else [replace(one, **{name: getattr(other, name) for name in differing})]
            springs = tuple(own for force in tree.springs for own in (kept if force is one else [force]) if isinstance(own, Spring))
            couplings = tuple(own for force in tree.couplings for own in (kept if force is one else [force]) if isinstance(own, Coupling))
            alone = change(first, read_as(first, with_tree(first.robot, replace(tree, springs=springs, couplings=couplings))))
        yield difference_of(f"spring between {' and '.join(key[:-1])}", texts, places, alone)


def _forces(springs: Sequence[Spring], couplings: Sequence[Coupling]) -> dict[tuple[str, ...], _Force]:
    """By the sorted names of bodies or joints, and a number among those of the same."""
    found: dict[tuple[str, ...], _Force] = {}
    every: list[_Force] = [*springs, *couplings]
    for force in every:
        names = [body for body, _ in force.ends] if isinstance(force, Spring) else [name for name, _ in force.joints]
        number = sum(key[:-1] == (*sorted(names),) for key in found)
        found[(*sorted(names), str(number))] = force
    return found


def _numbers_of(force: _Force) -> dict[str, float]:
    found = {name: getattr(force, name, None) for name in _OF_FORCES}
    return {name: float(value) for name, value in found.items() if value is not None}


def difference_of(what: str, values: Sequence[str], places: Sequence[Place | None], alone: float | None) -> FileDifference:
    """A difference whose places are written as "robot.urdf:12"; "" for none."""
    first, second = map(place_text, places)
    return FileDifference(what=what, first=values[0], second=values[1], first_place=first, second_place=second, alone=alone)


def place_text(place: Place | None) -> str:
    """A place as "robot.urdf:12"; "" for none."""
    return "" if place is None else f"{Path(place.path).name}:{place.line}"


def _short(value: float, within: float) -> str:
    """The shortest decimal so close to a value."""
    texts = (f"{0.0 if abs(value) <= within else value:.{digits}g}" for digits in range(1, 18))
    return next(text for text in texts if abs(float(text) - value) <= within)


def _effects(first: Meant, found: Mapping[Key, FileQuantity], differing: Mapping[Key, FileQuantity]) -> dict[Key, float | None]:
    # The numbers of the first file as parameters, each with a name of its own.
    numbers = {
        key: tuple(
            Given(value or _ALMOST_ZERO, Place(first.robot.path, line), "value", index)
            for index, value in enumerate(quantity.values[0].ravel().tolist())
        )
        for line, (key, quantity) in enumerate(found.items())
    }
    nodes = canonical(first.robot)
    bodies = [body for name, node in nodes.items() for body in _bodies(name, node, numbers, found, differing)]
    tree = replace(first.robot.tree, bodies=tuple(bodies), gravity=_three(numbers["", "gravity"]), total_mass=None, bounds=None)
    reference = reference_of(replace(first.robot, tree=tree))
    own = [0.0 if abs(value) <= _ALMOST_ZERO else value for value in reference.mechanism.parameter_values]
    changes = {
        key: {parameter_name(number): value for number, value in zip(numbers[key], one.values[1].ravel().tolist(), strict=True)}
        for key, one in differing.items()
    }
    return effects_of_numbers(reference, first.states, changes, np.array(own))


def _three(numbers: tuple[Given, ...]) -> Vector:
    x, y, z = numbers
    return x, y, z


def _bodies(
    name: str,
    node: CanonicalNode,
    numbers: Mapping[Key, tuple[Given, ...]],
    found: Mapping[Key, FileQuantity],
    differing: Mapping[Key, FileQuantity],
) -> Iterator[Body]:
    """The joint on a body without mass, and its masses on bodies fixed to that."""
    turn = (Quaternion(numbers[name, "turn"]),) if (name, "turn") in differing else ()
    felt: dict[str, Any] = {
        key: numbers[name, key][0] for key in JOINT_NUMBERS if (node.joint.follows if key == "multiplier" else found[name, key].scale)
    }
    axis = _three(numbers[name, "axis"]) if node.axis.any() else node.joint.axis
    joint = Joint(name, node.joint.kind, axis, in_degrees=node.joint.in_degrees, follows=node.joint.follows, **felt)
    yield Body(name, node.parent or WORLD, (Placement(_three(numbers[name, "anchor"]), turn),), (joint,), None)
    for key in [what.removeprefix("mass ") for owner, what in found if owner == name and what.startswith("mass ")]:
        (mass,), moments = numbers[name, f"mass {key}"], numbers[name, f"moments {key}"]
        inertia = Inertia((Placement(_three(numbers[name, f"centre {key}"])),), mass, moments)
        yield Body(f"{name} {key}", name, (), (), inertia)
