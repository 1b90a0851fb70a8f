"""The parts of a stage that its tree does not hold, with their lines."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from harness.files.document.stage import Prim, applied
from harness.files.equalities import Equality
from harness.files.findings import ACTUATORS, CONTACTS, EFFORT, EQUALITIES, FRICTION, LIMITS, LeftOut
from harness.files.given import Place
from harness.files.left_out import Declared
from harness.files.tree import WORLD, Actuator, Body
from harness.files.usd.joints import JointReader
from harness.files.usd.masses import BODY, COLLIDER
from harness.files.usd.tendons import TENDON, bounds_of

# Numbers that say nothing where they are zero.
_NUMBERS = {
    "physxRigidBody:linearDamping": "damping of bodies",
    "physxRigidBody:angularDamping": "damping of bodies",
    "physxJoint:maxJointVelocity": EFFORT,
    "newton:velocityLimit": EFFORT,
    "physxJoint:jointFriction": "friction of joints by a coefficient of PhysX",
    "mjc:option:density": "fluid",
    "mjc:option:viscosity": "fluid",
}
_ONE_SIDED, _WEAKER = "limits on one side", "numbers that a stronger namespace contradicts"


@dataclass(frozen=True)
class BesideTree:
    """Sources from which the parts are told; ``names`` are those of bodies by path, ``moving`` the prims of joints that move."""

    path: Path
    prims: Mapping[str, Prim]
    names: Mapping[str, str]
    bodies: Sequence[Body]
    moving: Sequence[Prim]
    equalities: Sequence[Equality]
    actuators: Sequence[Actuator]
    joints: JointReader

    def left_out(self) -> tuple[LeftOut, ...]:
        """The parts that bear on the motion."""
        parts: dict[str, set[int]] = {}
        for what, place in self._found():
            # In another layer there is no line of the file itself.
            parts.setdefault(what, set()).add(place.line if place.path == self.path else 1)
        return tuple(LeftOut(what, tuple(sorted(lines)), True) for what, lines in parts.items())

    def declared(self) -> Iterator[Declared]:
        """The actuators and colliders."""
        for one in self.actuators:
            assert one.place is not None
            values = self.prims[one.place.tag].values
            own = {name: " ".join(map(repr, value.numbers)) for name, value in values.items() if name.startswith(("drive:", "mjc:"))}
            owner = f"joint {one.joints[0][0]}" if one.joints else f"actuator {one.name}"
            yield Declared(ACTUATORS, owner, own, one.place)
        for prim in self._colliders():
            holder = next(applied(self.prims, prim.path, BODY), None)
            owner = WORLD if holder is None else self.names.get(holder.path, holder.name)
            yield Declared(CONTACTS, f"link {owner}", {}, prim.place)

    def _colliders(self) -> Iterable[Prim]:
        return (prim for prim in self.prims.values() if COLLIDER in prim.schemas and prim.is_on("physics:collisionEnabled"))

    def _found(self) -> Iterator[tuple[str, Place]]:
        yield from ((CONTACTS, prim.place) for prim in self._colliders())
        yield from ((EQUALITIES, one.place) for one in self.equalities)
        yield from ((ACTUATORS, one.place) for one in self.actuators if one.place is not None)
        for joint in (joint for body in self.bodies for joint in body.joints):
            if joint.limits is not None:
                yield LIMITS, joint.place_of("limits")
            if joint.friction_loss:
                yield FRICTION, joint.place_of("friction_loss")
        yield from ((_ONE_SIDED, prim.place) for prim in self.moving if self.joints.one_sided(prim))
        yield from ((_WEAKER, prim.at(name)) for prim, name in self.joints.weaker)
        for prim in self.prims.values():
            yield from ((what, prim.at(name)) for name, what in _NUMBERS.items() if prim.number(name))
            if prim.kind == TENDON:
                yield from ((what, prim.place) for what in bounds_of(prim))
            if BODY in prim.schemas and prim.is_on("physics:kinematicEnabled", False):
                yield "bodies moved from outside", prim.at("physics:kinematicEnabled")
            if prim.kind == "NewtonActuator":
                yield ACTUATORS, prim.place
            if any("Deformable" in schema for schema in prim.schemas):
                yield "deformable bodies", prim.place
