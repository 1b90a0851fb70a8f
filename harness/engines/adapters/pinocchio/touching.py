"""Points in which bodies of a file touch, as coal finds them between the shapes of a model, and Pinocchio's constraint models of these.

Pinocchio finds no contacts by itself: its user asks for collisions, and makes a constraint of each. Both placements of that are the
point that is found, with the normal from the first shape to the second for third axis. Pinocchio knows no friction of shapes: it is the
product of what their links say in ``<contact>``, as Bullet, whose element this is, combines them; where neither says any, it is the 0.5
that a constraint model has.

Sources: Pinocchio 4.1, constraints/point-contact-constraint.hxx (the default of friction), constraints/sets/coulomb-friction-cone.hxx (the
normal is the third axis); coal, documentation of ``Contact`` (normal and depth); Bullet, btManifoldResult::calculateCombinedFriction.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio

from harness.engines.adapters.pinocchio.versions import reasons
from harness.engines.request import Refused
from harness.files.contacts import FoundContact
from harness.files.tree import WORLD

# Contacts of two shapes, at most.
_MOST = 8
_FRICTIONLESS = "has no friction, of which Pinocchio makes three rows all the same"


@dataclass(frozen=True)
class _Pair:
    """Two shapes that may touch: the numbers of the joints that carry them, their links, their names, and their friction."""

    joints: tuple[int, int]
    bodies: tuple[str, str]
    shapes: tuple[str, str]
    friction: float


def _coefficients(root: Any) -> dict[str, float]:
    """Friction by link, of those that say any."""
    links = root.iterfind("link")
    return {str(link.get("name")): float(one.get("value")) for link in links for one in link.iterfind("contact/lateral_friction")}


class TouchingShapes:
    """The shapes of a file that may touch, and the contacts between them.

    Those of one body, and of two that a joint connects, may not, unless a body floats or ``among_neighbours`` says so: robots' links
    overlap at their joints.
    """

    def __init__(self, model: Any, path: Path, root: Any, among_neighbours: bool = False) -> None:
        """``root`` is the root element of the file.

        Raises:
            Refused: the shapes cannot be read, as where their meshes are not there.
        """
        self._model, self._data = model, model.createData()
        with reasons(lambda words: Refused(" ".join(words.split()))):
            self._shapes = pinocchio.buildGeomFromUrdf(model, str(path), pinocchio.GeometryType.COLLISION)
        self._shapes.addAllCollisionPairs()
        if not among_neighbours:
            for pair in [pair for pair in self._shapes.collisionPairs if self._are_neighbours(pair)]:
                self._shapes.removeCollisionPair(pair)
        self._found = pinocchio.GeometryData(self._shapes)
        for asked in self._found.collisionRequests:
            asked.num_max_contacts, asked.enable_contact = _MOST, True
        coefficients = _coefficients(root)
        self._pairs = [self._pair(pair, coefficients) for pair in self._shapes.collisionPairs]

    def _are_neighbours(self, pair: Any) -> bool:
        own, other = (self._shapes.geometryObjects[number].parentJoint for number in (pair.first, pair.second))
        parents = self._model.parents
        return any(parents[one] == another and self._model.joints[one].nv < 6 for one, another in ((own, other), (other, own)) if one)

    def _pair(self, pair: Any, coefficients: Mapping[str, float]) -> _Pair:
        shapes = [self._shapes.geometryObjects[number] for number in (pair.first, pair.second)]
        links = [str(self._model.frames[shape.parentFrame].name) for shape in shapes]
        said = [coefficients[link] for link in links if link in coefficients]
        friction = math.prod(said) if said else float(pinocchio.PointContactConstraintModel(self._model, 0, 0).getFriction())
        joints = shapes[0].parentJoint, shapes[1].parentJoint
        one, other = (link if joint else WORLD for link, joint in zip(links, joints, strict=True))
        return _Pair(joints, (one, other), (shapes[0].name, shapes[1].name), friction)

    def at(self, q: Any) -> Iterator[tuple[FoundContact, Any]]:
        """The contacts where shapes overlap, each with its constraint model."""
        pinocchio.computeCollisions(self._model, self._data, self._shapes, self._found, q, False)
        for own, result in zip(self._pairs, self._found.collisionResults, strict=True):
            for place in range(result.numContacts()):
                contact = result.getContact(place)
                # Of some boxes coal has no point.
                if contact.penetration_depth < 0 and math.isfinite(sum(contact.pos)):
                    yield self._one(contact, own)

    def _one(self, contact: Any, pair: _Pair) -> tuple[FoundContact, Any]:
        axes, point = _axes(contact.normal.tolist()), contact.pos.tolist()
        place = pinocchio.SE3(axes, contact.pos)
        first, second = ((joint, self._data.oMi[joint].actInv(place)) for joint in pair.joints)
        model = pinocchio.PointContactConstraintModel(self._model, *first, *second)
        model.setFriction(pair.friction)
        found = FoundContact(
            bodies=pair.bodies,
            point=tuple(point),
            frame=tuple(axes[:, [2, 0, 1]].T.ravel().tolist()),
            distance=float(contact.penetration_depth),
            margin=0.0,
            friction=(pair.friction, pair.friction),
            why_not="" if pair.friction else _FRICTIONLESS,
            shapes=pair.shapes,
        )
        return found, model


def _axes(normal: Any) -> Any:
    """(3, 3) axes in columns, the third along the normal; along a coordinate axis they are exact."""
    sizes = [abs(one) for one in normal]
    other = [0.0, 0.0, 0.0]
    other[sizes.index(min(sizes))] = 1.0
    third = _unit(normal)
    first = _unit(_cross(other, third))
    # No minus zero, whose sign would be a number of its own.
    return np.array([first, _cross(third, first), third]).T + 0.0


def _cross(one: Sequence[float], other: Sequence[float]) -> list[float]:
    """As ``numpy.cross``, which takes longer than a step."""
    (a, b, c), (x, y, z) = one, other
    return [b * z - c * y, c * x - a * z, a * y - b * x]


def _unit(vector: Sequence[float]) -> list[float]:
    length = math.hypot(*vector)
    return [one / length for one in vector]
