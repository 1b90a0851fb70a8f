"""The shapes of a model file, which pairs of them collide, and the numbers of their contacts.

Source: MuJoCo documentation, Computation, section Collision detection, Selection; Modeling, section Contact parameters.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction

from harness.files.equalities import SolverParameters
from harness.files.given import Place, Pose, Vector
from harness.files.tree import WORLD, Tree

PLANE, SPHERE, CAPSULE, BOX = "plane", "sphere", "capsule", "box"
# mjMINMU: a coefficient of friction is no less.
LEAST_FRICTION = 1e-5


@dataclass(frozen=True)
class Shape:
    """One shape of a body that may touch others.

    Attributes:
        name: its own, or "(geom 2 of hand)", counted among those of the body that may touch.
        size: radius of a sphere or capsule, and half the length of a capsule without ``ends``; half the edges of a box, of one with
            ``ends`` those across [m].
        pose: in the body; its z axis is the normal of a plane and the axis of a capsule. ends: of a capsule or box between two points.
        types: ``contype`` and ``conaffinity``. friction: of sliding, spinning and rolling.
    """

    name: str
    body: str
    kind: str
    size: tuple[Fraction, ...]
    pose: Pose
    place: Place
    types: tuple[int, int]
    condim: int
    priority: int
    solmix: float
    friction: tuple[float, float, float]
    softness: SolverParameters
    margin: float
    gap: float
    ends: tuple[Vector, ...] = ()


@dataclass(frozen=True)
class ContactNumbers:
    """The numbers of a contact of two shapes, each as of ``FoundContact``; ``detected`` is the distance below which there is one [m]."""

    friction: tuple[float, ...]
    solref: tuple[float, ...]
    solimp: tuple[float, ...]
    margin: float
    detected: float
    sliding: tuple[float, ...] = (0.0, 0.0)


@dataclass(frozen=True)
class Shapes:
    """The shapes of a file that may touch, and what it says of pairs of them.

    Attributes:
        excluded: pairs of bodies none of whose shapes touch.
        explicit: pairs of shapes whose contacts the file gives numbers of their own; they collide whatever else it says, once for each
            element that names them.
        filters_parents: whether a body and its parent do not touch.
        why_not: why nothing is said of any contact; "" where it is.
    """

    shapes: tuple[Shape, ...] = ()
    excluded: frozenset[frozenset[str]] = frozenset()
    explicit: Mapping[frozenset[str], Sequence[ContactNumbers]] = field(default_factory=dict)
    filters_parents: bool = True
    why_not: str = ""

    def pairs(self, tree: Tree) -> list[tuple[Shape, Shape, Sequence[ContactNumbers]]]:
        """Those that collide where they are near, with the numbers of their contacts, of each time that they do."""
        top, above = _welded(tree)
        found = []
        for number, one in enumerate(self.shapes):
            for other in self.shapes[:number]:
                if (own := self.explicit.get(frozenset((one.name, other.name)))) is not None:
                    found.append((one, other, own))
                elif (
                    _are_compatible(one, other)
                    and frozenset((one.body, other.body)) not in self.excluded
                    and not self._is_filtered(top[one.body], top[other.body], above)
                ):
                    found.append((one, other, [numbers_of_contact(one, other)]))
        return found

    def _is_filtered(self, one: str, other: str, above: dict[str, str]) -> bool:
        """True within what is welded together; next to what carries it, unless that is the world."""
        is_parent = WORLD not in (one, other) and (above[one] == other or above[other] == one)
        return one == other or (self.filters_parents and is_parent)


def _are_compatible(one: Shape, other: Shape) -> bool:
    return bool(one.types[0] & other.types[1] or other.types[0] & one.types[1])


def _welded(tree: Tree) -> tuple[dict[str, str], dict[str, str]]:
    """By body, the first of those that no joint parts it from; by such a first body, that of what carries it."""
    top, above = {WORLD: WORLD}, {WORLD: WORLD}
    for body in tree.bodies:
        top[body.name] = body.name if body.joints else top[body.parent]
        if body.joints:
            above[body.name] = top[body.parent]
    return top, above


def numbers_of_contact(one: Shape, other: Shape) -> ContactNumbers:
    """The numbers of the contacts of two shapes, of which the one with the higher priority decides alone."""
    first, *rest = sorted((one, other), key=lambda shape: -shape.priority)
    deciding = [first] if first.priority > rest[0].priority else [first, *rest]
    condim = max(shape.condim for shape in deciding)
    slide, spin, roll = (max(LEAST_FRICTION, *(shape.friction[axis] for shape in deciding)) for axis in range(3))
    margin, gap = one.margin + other.margin, one.gap + other.gap
    friction = (slide, slide, spin, roll, roll)[: condim - 1]
    solref, solimp = _mixed_softness(deciding)
    return ContactNumbers(friction, solref, solimp, margin, margin + gap)


def _mixed_softness(deciding: Sequence[Shape]) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """The means by ``solmix``; of ``solref`` the least where one is in the direct format."""
    total = sum(shape.solmix for shape in deciding)
    weights = [shape.solmix / total if total else 1 / len(deciding) for shape in deciding]

    def mean(parts: Sequence[tuple[float, ...]]) -> tuple[float, ...]:
        return tuple(sum(weight * value for weight, value in zip(weights, values, strict=True)) for values in zip(*parts, strict=True))

    solrefs = [_floats(shape.softness.solref) for shape in deciding]
    is_direct = any(time <= 0 for time, _ in solrefs)
    solref = tuple(map(min, zip(*solrefs, strict=True))) if is_direct else mean(solrefs)
    return solref, mean([_floats(shape.softness.solimp) for shape in deciding])


def _floats(values: Sequence[float | Fraction]) -> tuple[float, ...]:
    return tuple(map(float, values))
