"""Pinocchio as its user calls it: ``pin.buildModelFromUrdf`` or ``pin.buildModelFromMJCF``, then ``pin.aba``.

A continuous joint has two positions there, cosine and sine, and so has the turn of a planar joint; a quaternion ends with w; the linear
velocity of a free or planar joint is in the body's frame. Source: Pinocchio 4 documentation, joints.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.engines import NotOffered
from harness.engines.adapters.pinocchio.forces import ForceElements, JointPlace, has_body
from harness.engines.adapters.pinocchio.quantities import PinocchioQuantities
from harness.engines.adapters.pinocchio.versions import set_armature
from harness.engines.coordinates import accelerations_from_body, body_turn, to_body
from harness.engines.loaded_file import LoadedFile
from harness.engines.reading import captured_standard_error
from harness.engines.request import AskedJoint, Refused, Request, projected
from harness.files.facts import ForceElement, JointDamper, JointSpring

# Several joints of one body; its first gives the name. A joint without name, as the tree names it.
_COMPOSITE, _UNNAMED = "Composite_", re.compile(r"\(joint (\d+) of (.+)\)")


def read(request: Request) -> PinocchioFile:
    """A file as its user loads it, or aided; see ``harness.engines.Engine``."""
    # The reader's reasons go to file descriptor 2 alone; its exceptions do not hold them.
    with captured_standard_error() as captured:
        try:
            model = _read(request)
        except Exception as error:
            raise Refused(" ".join((captured() or str(error)).split())) from error
    return PinocchioFile(model, request)


def _read(request: Request) -> Any:
    import pinocchio

    path = str(request.path)
    if request.format == "mjcf":
        return pinocchio.buildModelFromMJCF(path)
    if request.floating_base:
        return pinocchio.buildModelFromUrdf(path, pinocchio.JointModelFreeFlyer(), request.floating_base)
    if request.supplied_ball_joint:
        return pinocchio.buildModelFromUrdf(path, pinocchio.JointModelSpherical(), request.supplied_ball_joint)
    return pinocchio.buildModelFromUrdf(path)


class PinocchioFile(LoadedFile):
    """A ``pinocchio.Model`` with the joints of a request."""

    def __init__(self, model: Any, request: Request) -> None:
        self.places = _places(model, request.joints)
        super().__init__(request, self.places)
        self._model = model
        self.own = [number for joint in self.found for number in self.places[joint.name].velocities]
        known = {place.joint for place in self.places.values()}
        self.further = tuple(name for number, name in enumerate(model.names) if number and number not in known)
        if request.aid is not None:
            model.gravity.linear = request.aid.gravity
            set_armature(model, self.own, request.aid.armature[self.v_columns])
        springs = () if request.aid is None else request.aid.springs
        # A reader that leaves bodies out leaves nothing for springs to pull at.
        self._springs = [one for one in springs if all(has_body(model, body) for body, _ in one.ends)]
        self._point_springs = ForceElements(model, self._springs, self.places)

    @property
    def model(self) -> Any:
        return self._model

    @property
    def is_supplied_with_forces(self) -> bool:
        aid = self.request.aid
        return aid is not None and (bool(aid.forces.springs) or bool(aid.springs) or bool(aid.forces.damping.any()))

    @property
    def addresses(self) -> tuple[list[int], list[int]]:
        positions: list[int] = []
        for joint in self.found:
            own = list(self.places[joint.name].positions)
            if len(own) in (4, 7):
                own[-4:] = [own[-1], *own[-4:-1]]
            positions += own
        return positions, self.own

    @property
    def quantities(self) -> _Quantities:
        if floating := [joint.name for joint in self.found if joint.kind.linear > 1]:
            raise NotOffered(f"the linear velocity of joint {floating[0]!r} is in another frame, converted for accelerations alone")
        return _Quantities(self, list(self._elements()))

    def _elements(self) -> Iterator[ForceElement]:
        """The springs and dampers that are supplied."""
        yield from self._springs
        if self.request.aid is None:
            return
        forces, by_velocity = self.request.aid.forces, {joint.velocities[0]: joint for joint in self.found}
        for velocity, joint in by_velocity.items():
            if damping := float(forces.damping[velocity]):
                yield JointDamper(joint.name, damping, joint.line)
        for _, velocity, stiffness, reference in forces.springs:
            if (sprung := by_velocity.get(velocity)) is not None:
                if self.places[sprung.name].nq != 1:
                    raise NotOffered(f"joint {sprung.name!r} with a spring stands in q as the cosine and sine of its position")
                yield JointSpring(sprung.name, stiffness, reference, sprung.line)

    def supplied(self, q: Array, v: Array) -> Array:
        """The forces of springs and dampers that are supplied, (n, nv)."""
        if self.request.aid is None:
            return np.zeros_like(v)
        forces = self.request.aid.forces
        return forces.of_dampers(v) + forces.of_springs(q)

    def prepare(self, q: Array, v: Array, tau: Array) -> PinocchioRun:
        return PinocchioRun(self, q, v, tau)

    def columns(self, q: Array, v: Array, tau: Array) -> tuple[Array, Array, Array]:
        """Pinocchio's own q, v and tau, one row a state."""
        import pinocchio

        configuration = np.tile(pinocchio.neutral(self.model), (len(q), 1))
        velocity, force = np.zeros((len(q), self.model.nv)), np.zeros((len(q), self.model.nv))
        for joint in self.found:
            positions, velocities = self.places[joint.name].positions, self.places[joint.name].velocities
            own_q, own_v, own_tau = q[:, joint.positions], v[:, joint.velocities], tau[:, joint.velocities]
            if joint.kind.linear > 1:
                turn = body_turn(joint.kind, own_q)
                own_v, own_tau = to_body(turn, own_v), to_body(turn, own_tau)
            if len(positions) in (2, 4) and not joint.kind.has_attitude:
                own_q = np.hstack([own_q[:, :-1], np.cos(own_q[:, -1:]), np.sin(own_q[:, -1:])])
            elif joint.kind.has_attitude:
                own_q = np.hstack([own_q[:, :-4], own_q[:, -3:], own_q[:, -4:-3]])
            configuration[:, positions], velocity[:, velocities], force[:, velocities] = own_q, own_v, own_tau
        return configuration, velocity, force

    def pulled(self, q: Array, v: Array, tau: Array) -> tuple[Array, Array, Array]:
        """``columns`` with the forces of all that is supplied."""
        configuration, velocity, force = self.columns(q, v, tau + self.supplied(q, v))
        if not self._point_springs.empty:
            force += self._point_springs.generalised_forces(configuration.T, velocity.T).T
        return configuration, velocity, force

    def to_frame_of_parent(self, accelerations: Array, q: Array, v: Array) -> None:
        """Accelerations of free and planar joints, given as rates of components in the body's frame, in that of the parent instead."""
        start, own = 0, {joint.name: joint for joint in self.found}
        for joint in self.joints:
            end = start + len(joint.velocities)
            if joint.kind.linear > 1:
                asked = own[joint.name]
                turn = body_turn(joint.kind, q[:, asked.positions])
                accelerations[:, start:end] = accelerations_from_body(turn, accelerations[:, start:end], v[:, asked.velocities])
            start = end


class _Quantities(PinocchioQuantities):
    """What Pinocchio computes beside accelerations, over the joints found."""

    def __init__(self, loaded: PinocchioFile, elements: Sequence[ForceElement]) -> None:
        self.model, self._loaded, self._joints = loaded.model, loaded, [joint.name for joint in loaded.found]
        self._data, self.constraints = loaded.model.createData(), None
        self.force_elements = ForceElements(loaded.model, elements, loaded.places)

    @property
    def addresses(self) -> tuple[list[int], list[int]]:
        return self._loaded.addresses

    def columns(self, q: Array, v: Array, tau: Array) -> tuple[Array, Array, Array]:
        """Pinocchio's own (nq, n), (nv, n) and (nv, n)."""
        positions, velocities, forces = (np.ascontiguousarray(rows.T) for rows in self._loaded.columns(q, v, tau))
        return positions, velocities, forces


class PinocchioRun:
    """States in Pinocchio's own q, v and tau."""

    def __init__(self, loaded: PinocchioFile, q: Array, v: Array, tau: Array) -> None:
        self._loaded, self._q, self._v = loaded, q, v
        self._data = loaded.model.createData()
        # Rows cost half of what columns cost.
        self._rows = list(zip(*loaded.pulled(q, v, tau), strict=True))
        couplings = loaded.couplings
        self._found = np.full((len(q), loaded.model.nv if couplings is None else couplings.shape[1]), np.nan)

    def compute(self) -> None:
        import pinocchio

        model, data, found = self._loaded.model, self._data, self._found
        if self._loaded.couplings is None:
            for state, (configuration, velocity, force) in enumerate(self._rows):
                found[state] = pinocchio.aba(model, data, configuration, velocity, force)
        else:
            for state, row in enumerate(self._rows):
                found[state] = _coupled(self._loaded, data, self._loaded.couplings, *row)

    def accelerations(self) -> Array:
        loaded = self._loaded
        accelerations = self._found[:, loaded.own] if loaded.couplings is None else self._found.copy()
        loaded.to_frame_of_parent(accelerations, self._q, self._v)
        return accelerations


def _coupled(loaded: PinocchioFile, data: Any, couplings: Array, configuration: Array, velocity: Array, force: Array) -> Array:
    """Accelerations of the joints that move by themselves, from Pinocchio's own M and forces; ``aba`` refuses such a model."""
    import pinocchio

    upper = np.triu(pinocchio.crba(loaded.model, data, configuration))
    mass = (upper + np.triu(upper, 1).T)[np.ix_(loaded.own, loaded.own)]
    terms = force[loaded.own] - pinocchio.nonLinearEffects(loaded.model, data, configuration, velocity)[loaded.own]
    return projected(mass, terms, couplings)


def _places(model: Any, joints: Sequence[AskedJoint]) -> dict[str, JointPlace]:
    """The places of the joints that the model has; one of several in a body is part of a composite."""
    places, names = dict[str, JointPlace](), _names_of_reader(joints)
    for number in range(1, model.njoints):
        joint, name = model.joints[number], model.names[number]
        parts = _parts(joint, names.get(name.removeprefix(_COMPOSITE), name), name.startswith(_COMPOSITE), joints)
        q, v = joint.idx_q, joint.idx_v
        for part, nq, nv in parts:
            places[part] = JointPlace(q, nq, v, nv, number)
            q, v = q + nq, v + nv
    return {joint.name: places[joint.name] for joint in joints if joint.name in places}


def _names_of_reader(joints: Sequence[AskedJoint]) -> dict[str, str]:
    """Names of joints by those that the MJCF reader gives them: a joint without one is called after its body."""
    found: dict[str, str] = {}
    for joint in joints:
        names = [joint.name]
        if unnamed := _UNNAMED.fullmatch(joint.name):
            number, body = unnamed.groups()
            names = [f"{body}Joint_{int(number) - 1}", f"{body}_free"]
        found |= dict.fromkeys(names, joint.name)
    return found


def _parts(joint: Any, name: str, is_composite: bool, joints: Sequence[AskedJoint]) -> list[tuple[str, int, int]]:
    """Name, positions and velocities of a joint, or of those that a composite of the MJCF reader is made of, in their order."""
    names = [one.name for one in joints]
    if not is_composite or name not in names:
        return [(name, joint.nq, joint.nv)]
    found: list[tuple[str, int, int]] = []
    for one in joints[names.index(name) :]:
        if sum(nv for _, _, nv in found) < joint.nv:
            found.append((one.name, len(one.positions), len(one.velocities)))
    return found
