"""Two robots whose files are built otherwise: what differs between the parts that move together.

Both are taken in axes parallel to the world's with every joint at zero, where files of one robot hold the same numbers. A frame that
is turned in one file turns all that it carries: a turn that makes what a joint carries fit is one difference, at that joint.

Source: Kabsch, A solution for the best rotation to relate two sets of vectors, Acta Cryst. A32 (1976).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from harness.arrays import Array
from harness.compare.canonical import Mass, Node, canonical
from harness.compare.numbers import place_text
from harness.compare.truth import STATES_OF_EFFECTS, Meant, largest_change, reference_of
from harness.results.comparison import Difference
from harness.robots.robot import Robot
from harness.robots.spatial import parameter_name
from harness.robots.tree import WORLD, Body, Given, Inertia, Joint, Place, Placement, Quaternion, Tree

# Vectors in canonical axes carry the rounding of the rotations that brought them there.
ROUNDING = 64 * 2.0**-53
# A turn explains what a joint carries where it leaves this share of the difference.
LEFT_BY_TURN = 1e-2
# Stands for a number that is zero in one file, so that it is a parameter of the equations.
_ALMOST_ZERO = 1e-300
_JOINT_NUMBERS = ("armature", "damping", "stiffness", "spring_reference", "multiplier")
_WORDS = {"spring_reference": "spring reference", "multiplier": "multiplier of the mimic"}
Key = tuple[str, str]


@dataclass
class Quantity:
    """A quantity of either file; ``first`` and ``second`` are arrays of one shape, in the axes of the first file."""

    what: str
    first: Array
    second: Array
    scale: float
    first_place: Place | None
    second_place: Place | None

    @property
    def differs(self) -> bool:
        return bool(np.abs(self.first - self.second).max() > ROUNDING * self.scale)


def differences_of_nodes(first: Meant, second: Robot) -> list[Difference]:
    """The differences of two robots with equal names of joints, the one that alone moves the first's accelerations most first."""
    quantities = _quantities(first.robot, second)
    differing = {key: one for key, one in quantities.items() if one.differs}
    effects = _effects(first, quantities, differing)
    found = [
        Difference(
            what=one.what,
            **dict(zip(("first", "second"), shown(one.first, one.second), strict=True)),
            first_place=place_text(one.first_place),
            second_place=place_text(one.second_place),
            alone=effects.get(key),
        )
        for key, one in differing.items()
    ]
    return sorted(found, key=lambda one: -(one.alone or 0.0))


def shown(first: Array, second: Array) -> tuple[str, str]:
    """Both with as few digits as tell them apart."""
    for digits in (6, 9, 12, 17):
        one, other = (" ".join(f"{value:.{digits}g}" for value in array.ravel().tolist()) for array in (first, second))
        if one != other:
            break
    return one, other


def _quantities(first: Robot, second: Robot) -> dict[Key, Quantity]:
    """All quantities by the joint and what they are."""
    ones, others = canonical(first), canonical(second)
    found: dict[Key, Quantity] = {}
    gravity = [np.array([float(value) for value in robot.tree.gravity]) for robot in (first, second)]
    places = [robot.tree.places.get("gravity") for robot in (first, second)]
    found["", "gravity"] = Quantity("gravity", *gravity, float(np.abs(gravity[0]).max()) or 1.0, *places)
    turns: dict[str, Array] = {"": np.eye(3)}
    for name, one in ones.items():
        other, turn = others[name], turns[one.parent]
        children = [(child.anchor, others[below].anchor) for below, child in ones.items() if child.parent == name]
        axes = [(child.axis, others[below].axis) for below, child in ones.items() if child.parent == name]
        carried = [(one.axis, other.axis), (one.total.centre, other.total.centre), *children, *axes]
        own = _turn(carried, turn)
        size = max(float(np.linalg.norm(one.anchor)), float(np.linalg.norm(one.total.centre)), 1e-3)
        about = dict(first_place=one.body.places.get("pose"), second_place=other.body.places.get("pose"))
        found[name, "anchor"] = Quantity(f"origin of joint {name}", one.anchor, turn @ other.anchor, size, **about)
        found[name, "turn"] = Quantity(f"orientation of joint {name}", _quaternion(np.eye(3)), _quaternion(own @ turn.T), 1.0, **about)
        places = [node.joint.places.get("axis") for node in (one, other)]
        found[name, "axis"] = Quantity(f"axis of joint {name}", one.axis, own @ other.axis, 1.0, *places)
        found |= _of_masses(name, one, other, own)
        for number in _JOINT_NUMBERS:
            values = [np.array([float(getattr(node.joint, number))]) for node in (one, other)]
            places = [node.joint.places.get(number) for node in (one, other)]
            scale = float(np.abs(values).max())
            found[name, number] = Quantity(f"{_WORDS.get(number, number)} of joint {name}", *values, scale, *places)
        turns[name] = own
    return found


def _of_masses(name: str, one: Node, other: Node, turn: Array) -> Iterator[tuple[Key, Quantity]] | dict[Key, Quantity]:
    """Mass, centre and moments of each body where the bodies have the same names, else of all that moves with the joint."""
    if one.bodies.keys() == other.bodies.keys():
        pairs = [(body, f"link {body}", one.bodies[body], other.bodies[body], one.elements[body], other.elements[body]) for body in one.bodies]
    else:
        pairs = [("", f"all that moves with joint {name}", one.total, other.total, _first(one), _first(other))]
    found: dict[Key, Quantity] = {}
    for body, owner, mass, its_like, *elements in pairs:
        turned: Mass = its_like.turned(turn)
        places = {part: [_place(element, part) for element in elements] for part in ("mass", "pose", "moments")}
        size = max(float(np.linalg.norm(mass.centre)), 1e-3)
        found[name, f"mass {body}"] = Quantity(
            f"mass of {owner}", np.array([mass.mass]), np.array([turned.mass]), mass.mass or 1.0, *places["mass"]
        )
        found[name, f"centre {body}"] = Quantity(f"centre of mass of {owner}", mass.centre, turned.centre, size, *places["pose"])
        scale = max(float(np.abs(mass.moments).max()), 1e-12)
        found[name, f"moments {body}"] = Quantity(f"moments of inertia of {owner}", _six(mass.moments), _six(turned.moments), scale, *places["moments"])
    return found


def _first(node: Node) -> Body:
    """The body of a node that weighs most."""
    heaviest = max(node.bodies, key=lambda name: node.bodies[name].mass, default="")
    return node.elements[heaviest] if heaviest else node.body


def _place(body: Body, part: str) -> Place | None:
    return body.inertia.places.get(part) if body.inertia is not None else body.place


def _six(moments: Array) -> Array:
    return np.array([moments[0, 0], moments[1, 1], moments[2, 2], moments[0, 1], moments[0, 2], moments[1, 2]])


def _turn(pairs: list[tuple[Array, Array]], before: Array) -> Array:
    """The rotation of the second's vectors into the first's: that of the joint before, or another one that makes them fit."""
    kept = [(one, before @ other) for one, other in pairs if min(np.linalg.norm(one), np.linalg.norm(other)) > 1e-9]
    if not kept:
        return before
    first, second = (np.array([pair[side] / np.linalg.norm(pair[side]) for pair in kept]) for side in (0, 1))
    apart = float(np.abs(first - second).max())
    if apart <= ROUNDING or np.linalg.matrix_rank(second, tol=1e-6) < 2:
        return before
    left, _, right = np.linalg.svd(first.T @ second)
    turn = left @ np.diag([1.0, 1.0, np.linalg.det(left @ right)]) @ right
    fits = float(np.abs(first - second @ turn.T).max()) <= max(LEFT_BY_TURN * apart, ROUNDING)
    return np.asarray(turn @ before) if fits else before


def _quaternion(turn: Array) -> Array:
    """(w, x, y, z) of a rotation of less than half a turn."""
    w = np.sqrt(max(0.0, 1 + np.trace(turn))) / 2
    if w < 1e-6:
        values, vectors = np.linalg.eigh((turn + turn.T) / 2)
        return np.array([0.0, *vectors[:, values.argmax()]])
    return np.array([w, turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]) / np.array([1, 4 * w, 4 * w, 4 * w])


# What each difference does alone: the robot in canonical axes, with each quantity as a parameter of its equations.


@dataclass
class _Numbers:
    """Makes the numbers of quantities parameters, by the name that they get in a program."""

    path: Path
    keys: list[Key] = field(default_factory=list)

    def given(self, key: Key, quantity: Quantity) -> tuple[Given, ...]:
        self.keys.append(key)
        place = Place(self.path, len(self.keys))
        return tuple(Given(value or _ALMOST_ZERO, place, "value", index) for index, value in enumerate(quantity.first.ravel().tolist()))

    def name(self, key: Key, index: int) -> str:
        return parameter_name(Given(1.0, Place(self.path, self.keys.index(key) + 1), "value", index))


def _effects(first: Meant, quantities: Mapping[Key, Quantity], differing: Mapping[Key, Quantity]) -> dict[Key, float | None]:
    numbers = _Numbers(first.robot.path)
    robot = _canonical_robot(first.robot, quantities, differing, numbers)
    reference = reference_of(robot)
    columns = {name: column for column, (name, _, _) in enumerate(reference.mechanism.parameters)}
    own = np.array([0.0 if abs(value) <= _ALMOST_ZERO else value for value in reference.mechanism.parameter_values])
    few = np.arange(min(STATES_OF_EFFECTS, len(first.states)))
    states = first.states[few]
    before = reference.evaluate(states, np.tile(own, (len(few), 1)))
    found: dict[Key, float | None] = {}
    for key, quantity in differing.items():
        changed = np.tile(own, (len(few), 1))
        for index, value in enumerate(quantity.second.ravel().tolist()):
            if numbers.name(key, index) in columns:
                changed[:, columns[numbers.name(key, index)]] = value
        after = reference.evaluate(states, changed)
        both = before.certified & after.certified
        found[key] = largest_change(before, after.high, both) if both.any() else None
    return found


def _canonical_robot(robot: Robot, quantities: Mapping[Key, Quantity], differing: Mapping[Key, Quantity], numbers: _Numbers) -> Robot:
    """The first robot in canonical axes."""
    from dataclasses import replace
    from fractions import Fraction

    bodies = []
    for name, node in canonical(robot).items():

        def value(what: str, name: str = name) -> tuple[Given, ...]:
            return numbers.given((name, what), quantities[name, what])

        turn = (Quaternion(value("turn")),) if (name, "turn") in differing else ()
        x, y, z = value("anchor")
        joint = Joint(
            name,
            node.joint.kind,
            axis=_three(value("axis")) if node.axis.any() else node.joint.axis,
            **{number: value(number)[0] if quantities[name, number].scale else Fraction(0) for number in _JOINT_NUMBERS if number != "multiplier"},
            follows=node.joint.follows,
            multiplier=value("multiplier")[0] if node.joint.follows else Fraction(1),
        )
        bodies.append(Body(name, node.parent or WORLD, (Placement((x, y, z), turn),), (joint,), None))
        for key in [what for owner, what in quantities if owner == name and what.startswith("mass ")]:
            body = key.removeprefix("mass ")
            inertia = Inertia((Placement(_three(value(f"centre {body}"))),), value(key)[0], value(f"moments {body}"))
            bodies.append(Body(f"{name} {body}", name, (), (), inertia))
    gravity = _three(numbers.given(("", "gravity"), quantities["", "gravity"]))
    tree = Tree(tuple(bodies), gravity, springs=(), couplings=())
    return replace(robot, tree=tree)


def _three(values: tuple[Given, ...]) -> tuple[Given, Given, Given]:
    x, y, z = values
    return x, y, z
