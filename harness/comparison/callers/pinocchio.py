"""Pinocchio as its user calls it: ``pin.buildModelFromUrdf`` or ``pin.buildModelFromMJCF``, then ``pin.aba``.

A continuous joint has two positions there, cosine and sine; a quaternion ends with w; the linear velocity of a free joint is in the
body's frame. Source: Pinocchio 4 documentation, joints.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.comparison.aided import AidedEngine
from harness.comparison.questions import Asked, Refused, Request, projected
from harness.engines._standard_error import captured_standard_error

# Linear velocities of a joint whose frame turns with them.
_LINEAR = {"planar": 2, "free": 3}


class PinocchioCaller:
    engine = "pinocchio"
    formats: tuple[str, ...] = ("urdf", "mjcf")
    requires = ("pinocchio", "pin")
    factorises_mass_matrix = False
    supplied: Mapping[str, str] = dict.fromkeys(
        formats, "gravity, and dampers, springs and rotor inertias of joints, are supplied from the file"
    )
    takes_inertias_about_tree = False
    call: Mapping[str, str] = {
        "urdf": "pin.aba(m := pin.buildModelFromUrdf(PATH), m.createData(), q, v, tau)",
        "mjcf": "pin.aba(m := pin.buildModelFromMJCF(PATH), m.createData(), q, v, tau)",
    }

    def load(self, request: Request) -> LoadedRobot:
        # The reader's reasons go to file descriptor 2 alone; its exceptions do not hold them.
        with captured_standard_error() as captured:
            try:
                model = _read(request)
            except Exception as error:
                raise Refused(" ".join((captured() or str(error)).split())) from error
        return LoadedRobot(model, request)


def _read(request: Request) -> Any:
    import pinocchio

    path = str(request.path)
    if request.format == "mjcf":
        return pinocchio.buildModelFromMJCF(path)
    if request.floating_base:
        return pinocchio.buildModelFromUrdf(path, pinocchio.JointModelFreeFlyer(), request.floating_base)
    return pinocchio.buildModelFromUrdf(path)


class LoadedRobot:
    """A ``pinocchio.Model`` with the joints of a request."""

    notes: tuple[str, ...] = ()

    def __init__(self, model: Any, request: Request) -> None:
        self.model, self.request = model, request
        self.places = _places(model, request.joints)
        self.found = tuple(joint for joint in request.joints if joint.name in self.places)
        self.own = [number for joint in self.found for number in self.places[joint.name][1]]
        self.known = [column for joint in self.found for column in joint.velocities]
        self.further = tuple(name for number, name in enumerate(model.names) if number and name not in _names(self.places))
        self.couplings = None if request.couplings is None else request.couplings[self.known]
        self.joints = self.found if request.aid is None or self.couplings is None else request.aid.leaders
        if request.aid is not None:
            model.gravity.linear = request.aid.gravity
            model.armature[self.own] = request.aid.armature[self.known]

    @property
    def is_supplied_with_forces(self) -> bool:
        aid = self.request.aid
        return aid is not None and (bool(aid.forces.springs) or bool(aid.forces.damping.any()))

    def addresses(self, names: Sequence[str]) -> tuple[list[int], list[int]]:
        positions: list[int] = []
        for name in names:
            own = list(self.places[name][0])
            if len(own) in (4, 7):
                own[-4:] = [own[-1], *own[-4:-1]]
            positions += own
        return positions, [number for name in names for number in self.places[name][1]]

    def prepare(self, q: Array, v: Array, tau: Array) -> _Run:
        return _Run(self, q, v, tau)

    def columns(self, q: Array, v: Array, tau: Array) -> tuple[Array, Array, Array]:
        """Pinocchio's own q, v and tau, one row a state."""
        import pinocchio

        configuration = np.tile(pinocchio.neutral(self.model), (len(q), 1))
        velocity, force = np.zeros((len(q), self.model.nv)), np.zeros((len(q), self.model.nv))
        if self.request.aid is not None:
            supplied = self.request.aid.forces
            tau = tau + (supplied.of_dampers(v) + supplied.of_springs(q))
        for joint in self.found:
            positions, velocities, _ = self.places[joint.name]
            own_q, own_v, own_tau = q[:, joint.positions], v[:, joint.velocities], tau[:, joint.velocities]
            if joint.kind in _LINEAR:
                turn, k = _turn(joint, own_q), _LINEAR[joint.kind]
                own_v = np.hstack([_turned(turn, own_v[:, :k], back=True), own_v[:, k:]])
                own_tau = np.hstack([_turned(turn, own_tau[:, :k], back=True), own_tau[:, k:]])
            if len(positions) in (2, 4) and joint.kind != "ball":
                own_q = np.hstack([own_q[:, :-1], np.cos(own_q[:, -1:]), np.sin(own_q[:, -1:])])
            elif joint.kind in ("ball", "free"):
                own_q = np.hstack([own_q[:, :-4], own_q[:, -3:], own_q[:, -4:-3]])
            configuration[:, positions], velocity[:, velocities], force[:, velocities] = own_q, own_v, own_tau
        return configuration, velocity, force

    def to_frame_of_parent(self, accelerations: Array, q: Array, v: Array) -> None:
        """Linear accelerations of free and planar joints, given as rates of components in the body's frame, in that of the parent."""
        start = 0
        for joint in self.found:
            if joint.kind in _LINEAR:
                k, turn, own_v = _LINEAR[joint.kind], _turn(joint, q[:, joint.positions]), v[:, joint.velocities]
                rates, linear = np.zeros((2, len(q), 3))
                rates[:, 3 - own_v[:, k:].shape[1] :], linear[:, :k] = own_v[:, k:], _turned(turn, own_v[:, :k], back=True)
                own = accelerations[:, start : start + k] + np.cross(rates, linear)[:, :k]
                accelerations[:, start : start + k] = _turned(turn, own)
            start += len(joint.velocities)


class _Run:
    """States in Pinocchio's own q, v and tau."""

    def __init__(self, loaded: LoadedRobot, q: Array, v: Array, tau: Array) -> None:
        self._loaded, self._q, self._v = loaded, q, v
        self._data = loaded.model.createData()
        # Rows cost half of what columns cost.
        self._rows = list(zip(*loaded.columns(q, v, tau), strict=True))
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
        if loaded.couplings is not None:
            return self._found
        accelerations = self._found[:, loaded.own]
        loaded.to_frame_of_parent(accelerations, self._q, self._v)
        return accelerations


def _coupled(loaded: LoadedRobot, data: Any, couplings: Array, configuration: Array, velocity: Array, force: Array) -> Array:
    """Accelerations of the joints that move by themselves, from Pinocchio's own M and forces; ``aba`` refuses such a model."""
    import pinocchio

    upper = np.triu(pinocchio.crba(loaded.model, data, configuration))
    mass = (upper + np.triu(upper, 1).T)[np.ix_(loaded.own, loaded.own)]
    terms = force[loaded.own] - pinocchio.nonLinearEffects(loaded.model, data, configuration, velocity)[loaded.own]
    return projected(mass, terms, couplings)


def _places(model: Any, joints: Sequence[Asked]) -> dict[str, tuple[list[int], list[int], str]]:
    """Positions, velocities and Pinocchio's name of each joint that the model has; one of several in a body is part of a composite."""
    places = {}
    for number in range(1, model.njoints):
        joint, name = model.joints[number], model.names[number]
        parts = _parts(joint, name, joints)
        q, v = joint.idx_q, joint.idx_v
        for part, nq, nv in parts:
            places[part] = list(range(q, q + nq)), list(range(v, v + nv)), name
            q, v = q + nq, v + nv
    return {joint.name: places[joint.name] for joint in joints if joint.name in places}


def _parts(joint: Any, name: str, joints: Sequence[Asked]) -> list[tuple[str, int, int]]:
    """Name, positions and velocities of a joint, or of those that a composite of the MJCF reader is made of, in their order."""
    if not name.startswith("Composite_"):
        return [(name, joint.nq, joint.nv)]
    names = [one.name for one in joints]
    first = names.index(name.removeprefix("Composite_"))
    found: list[tuple[str, int, int]] = []
    for one in joints[first:]:
        if sum(nv for _, _, nv in found) < joint.nv:
            found.append((one.name, len(one.positions), len(one.velocities)))
    return found


def _names(places: Mapping[str, tuple[list[int], list[int], str]]) -> set[str]:
    return {name for _, _, name in places.values()}


def _rotations(quaternions: Array) -> Array:
    """(n, 3, 3) of unit quaternions (w, x, y, z), (n, 4)."""
    w, x, y, z = quaternions.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def _turn(joint: Asked, q: Array) -> Array:
    """(n, 3, 3) rotation of a free or planar joint at its own positions."""
    if joint.kind == "free":
        return _rotations(q[:, 3:])
    half = q[:, 2] / 2
    return _rotations(np.stack([np.cos(half), 0 * half, 0 * half, np.sin(half)], axis=1))


def _turned(turn: Array, vectors: Array, back: bool = False) -> Array:
    """Vectors (n, 3), or (n, 2) in the plane, turned or turned back."""
    size = vectors.shape[1]
    return np.asarray(np.einsum("nji,nj->ni" if back else "nij,nj->ni", turn[:, :size, :size], vectors))


CALLER = PinocchioCaller()
ENGINE = AidedEngine(CALLER)
