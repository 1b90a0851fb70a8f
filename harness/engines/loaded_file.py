"""A file in an engine, over the joints of a request; and the same over those that move by themselves, as a model."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from harness.arrays import Array
from harness.engines.interface import METHODS, NotOffered, Unsupported
from harness.engines.request import Aid, AskedJoint, JointForces, Refused, Request, by_joint, projected
from harness.files.rules import StepRule

if TYPE_CHECKING:
    from harness.files.contacts import FoundContact


class LoadedFile:
    """A file in an engine; q, v and tau of ``forward_dynamics`` are over the joints of the request.

    Attributes:
        found: the joints of the request that the engine has. q_columns, v_columns: their columns.
        joints: that it answers for, in the order of its columns; with couplings, those that move by themselves.
        aid: what the request supplies, which is nothing to a plain engine.
        notes: what had to be taken out of the file before the engine read it, a sentence each.
        couplings: of the request, of the joints found.
        placed: the engine's model with the places of the joints found, where the harness asks it for more than accelerations.
        applies_dampers, applies_springs: whether the engine applies the dampers of joints, and springs, itself.
        contacts: those of each of the states that were asked last, where bodies act where they touch.
        seconds: that the engine's own call took for each of these [s]; none where nobody times it.
        shapes: names of those that may touch, as of ``Shape``, where they do by the documented rules of the newest version.
    """

    notes: tuple[str, ...] = ()
    contacts: Sequence[tuple[FoundContact, ...]] = ()
    shapes: Sequence[str] = ()
    seconds: Sequence[float] = ()
    placed: Any = None
    applies_dampers = False
    applies_springs = False

    def __init__(self, request: Request, names: Collection[str]) -> None:
        self.request, velocities = request, sum(len(joint.velocities) for joint in request.joints)
        self.aid = request.aid or Aid(np.zeros(3), JointForces(np.zeros(velocities), ()), np.zeros(velocities))
        self.found = tuple(joint for joint in request.joints if joint.name in names)
        self.q_columns = [column for joint in self.found for column in joint.positions]
        self.v_columns = [column for joint in self.found for column in joint.velocities]
        couplings = request.couplings
        self.couplings = None if couplings is None else couplings[self.v_columns]
        self.joints = self.found if couplings is None else request.leaders

    def answered(self, q: Array, v: Array, tau: Array, *driving: Array) -> Array:
        """Accelerations as the request asks for them, with its actuators or without; raises Refused as ``driven_dynamics``."""
        return self.driven_dynamics(q, v, tau, *driving) if self.request.driven else self.forward_dynamics(q, v, tau)

    def driven_dynamics(self, q: Array, v: Array, tau: Array, *driving: Array) -> Array:
        """``forward_dynamics`` with the actuators of the request at controls and activations; ``driving``: as of ``EngineQuestion``.

        Raises:
            Refused: the harness cannot ask the engine with actuators.
        """
        raise Refused("the harness does not ask it with actuators")

    def forward_dynamics(self, q: Array, v: Array, tau: Array) -> Array:
        """(n, velocities of ``joints``) at states over the joints of the request, with what the harness supplies."""
        run = self.prepare(q, v, tau)
        run.compute()
        return run.accelerations()

    def prepare(self, q: Array, v: Array, tau: Array) -> EngineRun:
        """The same states in the engine's own conventions, ready to be computed any number of times."""
        raise NotOffered("the states of this engine are converted one after the other")

    def advanced(self, q: Array, v: Array, rule: StepRule, steps: int) -> tuple[Array, Array]:
        """q (nq,) and v (nv,) over the joints of the request after so many of the engine's own steps, without applied forces."""
        raise NotOffered("its users step by themselves")

    def settled(self, v: Array, steps: Sequence[int]) -> tuple[Array, Array]:
        """q (n, nq) and v (n, nv) over the joints of the request; see ``EngineQuestion``.

        Raises:
            Refused: the harness does not let this engine step, or not with such joints.
        """
        raise Refused("the harness lets it take no steps")

    def of_leaders(self, mass: Array, force: Array) -> Array:
        """Accelerations of the joints that move by themselves, from the engine's own M (nv, nv) and forces (nv,)."""
        velocities = self.addresses[1]
        assert self.couplings is not None
        return projected(mass[np.ix_(velocities, velocities)], force[velocities], self.couplings)

    @property
    def model(self) -> Any:
        """The engine's own; raises ``Unsupported`` where none can be asked by itself."""
        return self._required().model

    @property
    def addresses(self) -> tuple[list[int], list[int]]:
        """Positions and velocities of the joints found in the engine's own q and v; quaternions as (w, x, y, z)."""
        found: tuple[list[int], list[int]] = self._required().addresses
        return found

    def _required(self) -> Any:
        if self.placed is None:
            raise Unsupported("the harness asks this engine for accelerations alone")
        return self.placed

    @property
    def is_supplied_with_forces(self) -> bool:
        """True where forces that its reader leaves out are applied to it."""
        springs = bool(self.aid.forces.springs or self.aid.springs) and not self.applies_springs
        return springs or (bool(self.aid.forces.damping.any()) and not self.applies_dampers)

    def supplied(self, q: Array, v: Array) -> Array:
        """(n, nv) forces [N or N m] of the springs and dampers of joints that the engine does not apply itself, over the file's joints."""
        springs = np.zeros_like(v) if self.applies_springs else self.aid.forces.of_springs(q)
        return springs if self.applies_dampers else springs + self.aid.forces.of_dampers(v)

    @property
    def quantities(self) -> Any:
        """An object with methods of ``harness.engines.interface``, whose q and v are of the joints found."""
        raise NotOffered("robots' files are asked about accelerations alone")


class EngineRun:
    """States in an engine's own conventions: q, v, forces and more, (n, ...) each, which ``evaluate`` gives accelerations of, one by one.

    ``in_file`` takes accelerations of a joint from the engine's conventions to those of the request.

    Attributes:
        found: (n, velocities of the engine), or with couplings those of the joints that move by themselves.
    """

    def __init__(
        self,
        loaded: LoadedFile,
        own: tuple[Array, ...],
        evaluate: Callable[..., Array],
        in_file: Callable[[AskedJoint, Array], Array],
    ) -> None:
        self.loaded, self.own, self.evaluate, self.in_file = loaded, own, evaluate, in_file
        self._rows = list(zip(*own, strict=True))
        couplings = loaded.couplings
        self.found = np.full((len(own[1]), own[1].shape[1] if couplings is None else couplings.shape[1]), np.nan)

    def compute(self) -> None:
        """Let the engine compute all states: nothing is converted."""
        evaluate, found = self.evaluate, self.found
        for state, row in enumerate(self._rows):
            found[state] = evaluate(*row)

    def accelerations(self) -> Array:
        """(n, velocities of the loaded joints): what the last ``compute`` found."""
        joints = self.loaded.joints
        columns = by_joint(joints, self.found if self.loaded.couplings is not None else self.found[:, self.loaded.addresses[1]])
        return np.hstack([np.empty((len(self.found), 0)), *(self.in_file(joint, columns[joint.name]) for joint in joints)])


def refuse_joints(request: Request, engine: str, floating: Collection[str]) -> None:
    """Raises Refused for joints that the harness does not ask the engine about: all of several axes but ``floating`` ones."""
    for joint in request.joints:
        is_asked = joint.name in floating and joint.kind.has_attitude and joint.is_measured_in_the_world
        if not joint.kind.is_single and not is_asked:
            raise Refused(f"the harness asks {engine} about no {joint.kind} joint, as {joint.name!r} is")


class FileModel:
    """A user's file as a model; q, v and tau are over the joints that move by themselves, in the order of the request.

    Attributes:
        takes_driving: whether actuators act, so that ``forward_dynamics`` takes controls and activations too.
        is_coupled: whether joints that mimic others are eliminated from the engine's M and forces.
        factorises_mass_matrix: whether M is factorised, by the engine or for that.
    """

    def __init__(self, loaded: LoadedFile, factorises: bool) -> None:
        self.request, self.loaded_file = loaded.request, loaded
        self.takes_driving = bool(self.request.driven)
        self.is_coupled = loaded.couplings is not None
        self.factorises_mass_matrix = factorises or self.is_coupled
        ends = np.cumsum([0, *(len(joint.velocities) for joint in loaded.joints)])
        places = {joint.name: range(*bounds) for joint, *bounds in zip(loaded.joints, ends[:-1], ends[1:], strict=True)}
        self._own = [column for name in self.request.moving for column in places[name]]

    def loaded(self) -> None:
        """Nothing to audit: the file itself is what the engine is held against."""

    def forward_dynamics(self, q: Array, v: Array, tau: Array, *driving: Array) -> Array:
        try:
            found = self.loaded_file.answered(*self.request.spread(q, v, tau), *driving)
        except Refused as refusal:
            raise Unsupported(f"the engine refuses what the file holds: {refusal}") from refusal
        return self.ordered(found)

    def contacts(self, q: Array, v: Array, tau: Array, *driving: Array) -> list[tuple[FoundContact, ...]]:
        """The contacts that the engine finds at each state, where bodies act where they touch; raises as ``forward_dynamics``."""
        self.forward_dynamics(q, v, tau, *driving)
        return list(self.loaded_file.contacts)

    def settled(self, v: Array, steps: Sequence[int]) -> tuple[Array, Array]:
        """q (n, nq) and v (n, nv) after so many of the engine's own steps from where the file puts all bodies, at velocities ``v``.

        Raises:
            Unsupported: the harness does not let this engine step, or not with such joints.
        """
        request, by_name = self.request, {joint.name: joint for joint in self.request.joints}
        q = np.zeros((len(v), sum(len(joint.positions) for joint in request.leaders)))
        try:
            found = self.loaded_file.settled(request.spread(q, v, v)[1], steps)
        except Refused as refusal:
            raise Unsupported(f"the engine takes no steps: {refusal}") from refusal
        own = [by_name[name] for name in request.moving]
        places = [column for joint in own for column in joint.positions], [column for joint in own for column in joint.velocities]
        return found[0][:, places[0]], found[1][:, places[1]]

    def prepare(self, q: Array, v: Array, tau: Array) -> EngineRun:
        """The run of ``loaded_file``, with the states of joints that follow others."""
        return self.loaded_file.prepare(*self.request.spread(q, v, tau))

    def ordered(self, accelerations: Array) -> Array:
        """(n, nv) in the order of the joints, of what ``loaded_file`` answers."""
        return np.ascontiguousarray(accelerations[:, self._own])

    @property
    def model(self) -> Any:
        """The engine's own model, for what it computes by itself.

        Raises:
            Unsupported: the model alone is another mechanism, because something is supplied to it state by state.
        """
        if self.is_coupled:
            raise Unsupported("joints that mimic others are eliminated state by state, and no step of the engine's own does that")
        if not self._is_measured_in_the_world:
            raise Unsupported("a free joint is measured in a frame of the file, which no step of the engine's own does")
        if self.loaded_file.is_supplied_with_forces:
            raise Unsupported("springs or dampers are supplied as applied forces, which no step of the engine's own feels")
        return self.loaded_file.model

    @property
    def addresses(self) -> tuple[list[int], list[int]]:
        """Positions and velocities of the joints in the engine's own q and v, in their order."""
        return self.loaded_file.addresses

    @property
    def _is_measured_in_the_world(self) -> bool:
        return all(joint.is_measured_in_the_world for joint in self.request.joints)

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *METHODS]

    def __getattr__(self, name: str) -> Any:
        """Quantities that the engine computes beside accelerations, as ``harness.engines.interface`` says.

        Raises:
            NotOffered: the engine computes no such thing, states would have to be converted on the way, or it is asked about
                accelerations alone.
        """
        if name not in METHODS:
            raise AttributeError(name)
        if self.is_coupled:
            raise NotOffered("joints that mimic others are eliminated from accelerations alone")
        if not self._is_measured_in_the_world:
            raise NotOffered("a free joint is measured in a frame of the file")
        found = getattr(self.loaded_file.quantities, name, None)
        if found is None:
            raise NotOffered(f"the engine offers no {name.replace('_', ' ')}")
        return found


def lacking(request: Request, joints: Sequence[AskedJoint]) -> list[str]:
    """The joints that move by themselves and that are not among those of an engine."""
    return [name for name in request.moving if name not in {joint.name for joint in joints}]
