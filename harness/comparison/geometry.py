"""Contacts that an engine finds, held against those that the model file has by the engine's documentation.

Which pairs of shapes touch and the numbers of their contacts are judged of shapes of all kinds. That no contact is missing, and
distances, normals and points, are judged of pairs with a closed form. Tangents are the engine's own choice, and are held to be square to
the normal. Others stay given.

Source: MuJoCo documentation, Computation, section Collision detection; API reference, ``mjContact``.
"""

from __future__ import annotations

import itertools
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import flint
import numpy as np

from harness.arrays import Array
from harness.files.contacts import FoundContact
from harness.files.shapes import PLANE, ContactNumbers, Shape
from harness.results.shapes import ShapesRecord
from harness.trees.robot import Robot
from harness.trees.shapes import PlacedShape, ShapesInWorld
from harness.truth.nearest import Nearest, are_parallel, facing, is_closed_form, nearest
from harness.verdict import AGREEMENT, Verdict

# States at which shapes are placed, of those with contacts first.
MOST_STATES = 48
_BITS = 192
_DOUBLE = 2.0**-53
# Roundings of numbers that are averaged.
_MEAN = 4

_AXES = "axes of contact"

_Pair = tuple[Shape, Shape]


@dataclass
class _Held:
    """Findings on the contacts of one engine, state by state, whose numbers are of a unit roundoff."""

    unit_roundoff: float
    every_corner: bool
    placed: ShapesInWorld
    known: dict[frozenset[str], tuple[_Pair, Sequence[ContactNumbers]]]
    shapes: dict[str, Shape]
    judged: int = 0
    given: int = 0
    error: float = 0.0
    faults: dict[tuple[str, frozenset[str]], tuple[_Pair, str, float]] = field(default_factory=dict)

    def fault(self, names: frozenset[str], what: str, text: str, size: float = float("inf")) -> None:
        """Note the largest of its kind of a pair of shapes."""
        first, second = (self.shapes[name] for name in sorted(names))
        if (what, names) not in self.faults or self.faults[what, names][2] < size:
            self.faults[what, names] = (first, second), text, size

    def state(self, q: Array, found: Sequence[FoundContact]) -> None:
        contacts = defaultdict[frozenset[str], list[FoundContact]](list)
        for one in found:
            contacts[frozenset(one.shapes)].append(one)
        placed = {one.shape.name: one for one in self.placed.at(q.tolist())}
        for names in list(contacts):
            if names <= set(self.shapes) and names not in self.known:
                self.fault(names, "pair", "touch, and the file has them touch nowhere")
                del contacts[names]
        for names, ((first, second), numbers) in self.known.items():
            own = contacts.pop(names, [])
            for one in own:
                # One of another law has numbers by that, as no friction where it pulls.
                if not one.why_not:
                    self._numbers(names, one, numbers)
            if not (first.name in placed and second.name in placed):
                self.given += len(own)
            elif own or _may_be_near(placed[first.name], placed[second.name], max(one.detected for one in numbers)):
                self._pair(placed[first.name], placed[second.name], own, [one.detected for one in numbers])
        self.given += sum(map(len, contacts.values()))

    def _numbers(self, names: frozenset[str], one: FoundContact, numbers: Sequence[ContactNumbers]) -> None:
        """Note numbers of a contact that are others than the file's, of whichever it may be."""
        faults = [[*self._other_numbers(one, own)] for own in numbers]
        for what, text in faults[0] if all(faults) else ():
            self.fault(names, what, text)

    def _other_numbers(self, one: FoundContact, numbers: ContactNumbers) -> Iterator[tuple[str, str]]:
        sums: dict[str, tuple[Sequence[float], Sequence[float]]] = {
            "margin": ((one.margin,), (numbers.margin,)),
            "friction": (one.friction, numbers.friction),
            "solreffriction": (one.sliding, numbers.sliding),
        }
        means = {"solref": (one.solref, numbers.solref), "solimp": (one.solimp, numbers.solimp)}
        for what, (own, wanted) in {**sums, **means}.items():
            # In float64 they are the file's own.
            roundings = _MEAN if what in means else self.unit_roundoff > _DOUBLE
            room = roundings * self.unit_roundoff
            if len(own) != len(wanted) or any(abs(x - y) > room * abs(y) for x, y in zip(own, wanted, strict=True)):
                yield what, f"have {what} {_text(own)} where the file has {_text(wanted)}"

    def _pair(self, first: PlacedShape, second: PlacedShape, found: Sequence[FoundContact], detected: Sequence[float]) -> None:
        """Hold the contacts of two shapes, ``detected`` up to such a distance each time that they collide."""
        names, points = frozenset((first.shape.name, second.shape.name)), nearest(first, second, self.unit_roundoff, self.every_corner)
        if are_parallel(first, second):
            beside = [one.point for one in found] or [tuple(map(float, second.centre))]
            points = [one for place in beside if (one := facing(first, second, place)) is not None]
            if found and len(points) < len(found):
                self.fault(names, "points", "touch where they are further apart than elsewhere")
                return
            detected = [max(detected)]
        elif points is None:
            self.given += len(found)
            return
        self.judged += len(found)
        each = list(itertools.product(points, detected))
        room = [AGREEMENT * self.unit_roundoff * (one.size + abs(end)) for one, end in each]
        beyond = [float(one.distance.mid()) - end for one, end in each]
        needed = sum(one.is_sure and far < -little for (one, _), far, little in zip(each, beyond, room, strict=True))
        possible = [one for (one, _), far, little in zip(each, beyond, room, strict=True) if far <= little]
        if len(found) < needed:
            self.fault(names, "missing", f"touch in {needed} points by the file, and in {len(found)} by the engine")
        elif len(found) > len(possible):
            self.fault(names, "missing", f"touch in {len(found)} points, where the file has {len(possible)}")
        else:
            self._nearest(names, [[_errors(one, own, first.shape.name, self.unit_roundoff) for one in possible] for own in found])

    def _nearest(self, names: frozenset[str], errors: Sequence[Sequence[dict[str, float]]]) -> None:
        """Note errors of contacts against points of the file, each against one of its own, as they fit best."""
        worst = [[max(one.values()) for one in own] for own in errors]
        choices = itertools.permutations(range(len(errors[0]) if errors else 0), len(errors))
        chosen = min(choices, key=lambda order: max((own[one] for own, one in zip(worst, order, strict=True)), default=0.0))
        for what, error in (item for own, one in zip(errors, chosen, strict=True) for item in own[one].items()):
            self.error = max(self.error, error)
            if error > AGREEMENT:
                far = "that are not square" if what == _AXES else f"{error:.2g} roundoffs from those of the file"
                self.fault(names, what, f"have {what} {far}", error)


def hold_shapes(
    robot: Robot,
    states: Array,
    found: Sequence[Sequence[FoundContact]],
    engine_has: Sequence[str],
    unit_roundoff: float = _DOUBLE,
    every_corner: bool = False,
) -> ShapesRecord | None:
    """The contacts of each state, whose q are (n, nq), held against the file; None where nothing is said of them.

    ``engine_has``: names of the shapes of the engine's model that may touch. ``unit_roundoff``: as of the engine.
    ``every_corner``: as of ``nearest``.
    """
    file = robot.shapes
    if file is None or file.why_not or not engine_has:
        return None
    shapes = {shape.name: shape for shape in file.shapes}
    pairs = [pair for pair in file.pairs(robot.tree) if {pair[0].name, pair[1].name} <= set(engine_has)]
    closed = {shape.name: shape for one, other, _ in pairs if is_closed_form(one.kind, other.kind) for shape in (one, other)}
    if any(shape.body not in {"world", *(body.name for body in robot.tree.bodies)} for shape in shapes.values()):
        return None
    known = {frozenset((one.name, other.name)): ((one, other), numbers) for one, other, numbers in pairs}
    order = sorted(range(len(found)), key=lambda number: not found[number])[:MOST_STATES]
    with flint.ctx.workprec(_BITS):
        held = _Held(unit_roundoff, every_corner, ShapesInWorld(robot.tree, robot.joints, [*closed.values()]), known, shapes)
        for number in order:
            held.state(states[number], found[number])
    verdict = Verdict.DISAGREES if held.faults else Verdict.AGREES
    return ShapesRecord(
        verdict=str(verdict.value), contacts=held.judged, given=held.given, error=held.error, rest=[*_sentences(held, robot.path)]
    )


def _sentences(held: _Held, path: Path) -> Iterator[str]:
    for (first, second), text, _ in sorted(held.faults.values(), key=lambda one: -one[2]):
        yield f"{_told(first, path)} and {_told(second, path)} {text}"


def _told(shape: Shape, path: Path) -> str:
    return f"{shape.name!r} ({shape.place.within(path)})"


def _text(values: Sequence[float]) -> str:
    return " ".join(f"{value:.17g}" for value in values) or "of none"


def _may_be_near(first: PlacedShape, second: PlacedShape, detected: float) -> bool:
    """False where shapes are surely further apart than that."""
    one, other = ([float(part.mid()) for part in (*own.centre, *own.axis, own.radius, own.half, *own.halves)] for own in (first, second))
    between, reach = np.subtract(other[:3], one[:3]), sum(one[6:]) + sum(other[6:]) + detected
    planes = [own[3:6] for own, shape in ((one, first), (other, second)) if shape.shape.kind == PLANE]
    far = abs(float(between @ planes[0])) if planes else float(np.linalg.norm(between))
    if planes:
        sign = 1 if first.shape.kind == PLANE else -1
        far = sign * float(between @ planes[0])
    return far <= reach + 1e-6 * (first.size + second.size)


def _errors(wanted: Nearest, found: FoundContact, first: str, roundoff: float) -> dict[str, float]:
    """Errors of a contact in roundoffs of what is added."""
    frame, sign = np.reshape(found.frame, (3, 3)), 1 if found.shapes[0] == first else -1
    normal = [sign * float(part.mid()) for part in wanted.normal]
    point = [float(part.mid()) for part in wanted.point]
    return {
        "distances": abs(found.distance - float(wanted.distance.mid())) / (roundoff * wanted.size),
        "normals": float(np.linalg.norm(frame[0] - normal)) / (roundoff * wanted.of_normal),
        "points": float(np.linalg.norm(np.subtract(found.point, point))) / (roundoff * wanted.of_point),
        _AXES: float(np.abs(frame @ frame.T - np.eye(3)).max()) / (roundoff * wanted.of_frame),
    }
