"""The truth of accelerations of a user's file with contacts on: at each state with those that the engine finds there.

Points, frames, distances and numbers of contacts are inputs of the truth, as where files are compared, so that law and solver are judged
apart from geometry.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Hashable, Iterator, Sequence
from dataclasses import dataclass, fields
from functools import partial
from typing import Any

import numpy as np

from harness.arrays import Array, Indices
from harness.engines import Call, Calls, Engine, Model, Unsupported, driving_of, timed_answers_of
from harness.explain.changes.departures import Departure, departures_of
from harness.explain.changes.readings import element_at
from harness.explain.documented import all_judged, documented
from harness.explain.switches import Switch
from harness.explain.touching import EACH_SETTLED, Touching, judged_again, put, settling, steps_of
from harness.files.contacts import FoundContact, structure_of
from harness.files.equalities import Constraint
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.states import States
from harness.storage import Kept
from harness.trees.mechanism import RobotMechanism
from harness.trees.robot import Robot
from harness.truth.compare import Comparison
from harness.truth.declared import DeclaredMechanism
from harness.truth.quantities import ASKED_ELSEWHERE
from harness.truth.quantities.accelerations import AccelerationTruth, Gaps, with_all
from harness.truth.reference import Reference, ReferenceKernel
from harness.verdict import Verdict


@dataclass(frozen=True, eq=False)
class ContactSource:
    """An engine's model of a user's file with contacts on.

    Attributes:
        model: loads it, or gives it where it is loaded. into: from states of the mechanism that is meant to those of the model.
        is_alike: whether both have the same states.
    """

    model: Callable[[], Model]
    into: Callable[[States], States]
    is_alike: bool

    def contacts(self, states: States) -> Sequence[Sequence[FoundContact]]:
        """The contacts that the engine finds at each state, those that do not push among them."""
        model, own = self.model(), self.into(states)
        call = Call("contacts", (own.q, own.v, own.tau, *driving_of(model, own)), None)
        found: Sequence[Sequence[FoundContact]] = timed_answers_of(model, [Calls((call,))])[0][0]
        return found

    def settled(self, v: Array, steps: Sequence[int]) -> tuple[Array, Array]:
        """q and v after so many of the engine's own steps, from where the file puts all bodies with velocities ``v``, (n, nv)."""
        found: tuple[Array, Array] = timed_answers_of(self.model(), [Calls((Call("settled", (v, tuple(steps)), None),))])[0][0]
        return found


@dataclass(frozen=True, eq=False)
class TouchingTruth(AccelerationTruth):
    """Accelerations by the law that an engine documents of a robot's constraints that are ``judged``, and of its contacts.

    ``equations``: the robot's, with its actuators; the parent's mechanism has the constraints that are the same at all states.
    """

    robot: Robot | None = None
    caller: Engine | None = None
    judged: Sequence[Switch] = ()
    departures: Sequence[Departure] = ()
    equations: Mechanism | None = None
    source: ContactSource | None = None

    @property
    def key(self) -> Hashable:
        """See ``Truth``; engines whose equations are one without contacts may document other laws of these."""
        return super().key, "contacts", self.caller and self.caller.name, tuple(one.name for one in self.departures)

    def touching(self, states: States) -> Touching:
        """The contacts that push at states.

        Raises:
            harness.engines.Unsupported: one is of a kind that is not judged.
        """
        assert self.robot is not None and self.caller is not None and self.caller.contacts is not None and self.source is not None
        cone, why_not = self.caller.contacts(element_at(self.robot.tree.place), self.robot.format)
        found = Touching.of(self.source.contacts(states), self.robot, cone, affordable=False)
        if why_not or found.refused:
            raise Unsupported(f"contacts are not judged: one {why_not or found.refused[0]}")
        return found

    def by_structure(self, states: States) -> Iterator[tuple[Mechanism, Array, Indices]]:
        """As of ``Touching``."""
        return self.touching(states).by_structure(self._documented)

    def evaluate(self, states: States) -> Reference:
        """See ``Truth``."""
        return self._by(self.touching(states), states) if len(states) else super().evaluate(states)

    def _by(self, touching: Touching, states: States, near: Array | None = None) -> Reference:
        """``near`` as of ``Touching.truth``."""
        return touching.truth(states, self._documented, partial(_kernel, unit_roundoff=self.unit_roundoff), near)

    def _judge(self, certified: Any, states: States, answers: Array, gaps: Gaps, model: Model) -> Comparison:
        """As of the parent; where several answers are right by the law of a contact, each beside the nearest."""
        found, judge = super()._judge(certified, states, answers, gaps, model), super()._judge

        def nearest(left: Indices) -> Comparison:
            own, touching = states[left], self.touching(states[left])
            mechanisms = [mechanism for mechanism, *_ in touching.by_structure(self._documented)]
            if all(law.has_cost for one in mechanisms if isinstance(one, DeclaredMechanism) for _, law in one.laws):
                return found[left]
            return judge(
                self._by(touching, own, answers[left]), own, answers[left], {name: rows[left] for name, rows in gaps.items()}, model
            )

        return judged_again(found, np.flatnonzero(found.verdicts != Verdict.AGREES.value), nearest)

    def asked_at(self, states: States, share: float = ASKED_ELSEWHERE) -> States:
        """See ``Truth``; one of ``EACH_SETTLED`` states is where the engine's own steps lead, so that bodies touch."""
        states = super().asked_at(states, share)
        if not share or len(states) < EACH_SETTLED:
            return states
        return self.settled(states, settling(len(states)))

    def settled(self, states: States, numbers: Indices) -> States:
        """The states with those of ``numbers`` where the engine's own steps lead; as they are where it takes none."""
        assert self.source is not None
        if not self.source.is_alike:
            return states
        try:
            q, v = self.source.settled(states.v[numbers], steps_of(len(numbers)))
        except Unsupported:
            return states
        return put(states, numbers, q, v)

    def _documented(self, contacts: Sequence[Constraint]) -> Mechanism:
        """The equations with contacts of one structure."""
        assert self.robot is not None and self.caller is not None
        about = self.robot, self.caller, self.judged, self.departures, contacts, self.equations
        return _DOCUMENTED.get((self.key, structure_of(contacts)), lambda: documented(*about))


def _kernel(mechanism: Mechanism, unit_roundoff: float) -> ReferenceKernel:
    return _KERNELS.get((mechanism.key, unit_roundoff), lambda: ReferenceKernel(mechanism, unit_roundoff=unit_roundoff))


def touching_truth(
    truth: AccelerationTruth, mechanism: RobotMechanism, caller: Engine, departures: Collection[str], source: ContactSource
) -> TouchingTruth:
    """The truth of a user's file with the contacts of each state; ``truth`` is that without, and departures are named."""
    known, robot = departures_of(caller.name, caller.reader), mechanism.robot
    about = {one.name: getattr(truth, one.name) for one in fields(AccelerationTruth)}
    own = [one for one in known if one.name in departures]
    return TouchingTruth(
        **about, robot=robot, caller=caller, judged=all_judged(robot, caller), departures=own, equations=with_all(mechanism), source=source
    )


# By truth, and the structure of contacts.
_DOCUMENTED: Kept[Mechanism] = Kept(128)
_KERNELS: Kept[ReferenceKernel] = Kept(128)
