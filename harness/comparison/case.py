"""One file beside an engine with all on that is judged: how the engine is asked, and at which states."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from harness.comparison.robot_library import ask_engine
from harness.engines import Engine
from harness.engines.request import EngineAnswers, EngineQuestion, SolverSettings
from harness.explain.documented import documented
from harness.explain.meant import Meant, question_of, reference_of, request_of, spread
from harness.explain.switches import Switch, constraints_among, held_with
from harness.explain.touching import put, settling, steps_of
from harness.files.findings import CONTACTS
from harness.library import Stance
from harness.programs.states import States
from harness.trees.robot import with_actuators
from harness.truth.compare import Flags
from harness.truth.declared import DeclaredMechanism
from harness.truth.displaced import held, near, pressed, slowed
from harness.truth.reference import asked_at

# One of so many states is beyond limits.
_EACH_PRESSED = 4


@dataclass(frozen=True)
class AskedEngine:
    """An engine that is asked about a file, ``original``, with some of its elements on; it loads a copy at ``path``, if any."""

    original: Meant
    caller: Engine
    path: Path | None = None

    def with_those(
        self, switches: Sequence[Switch], at: Meant | None = None, few: bool = False, solver: SolverSettings | None = None
    ) -> EngineAnswers:
        """Its accelerations, at the states of the file, ``few`` of them, or those of what is read, ``at``."""
        return ask_engine(self.caller.name, self._question(switches, at, few, solver))

    def settled(self, switches: Sequence[Switch], at: Meant) -> Meant:
        """The robot as read, at states of which some are where the engine's own steps lead; as it is where it may take none."""
        numbers = settling(len(at.states))
        part = replace(at, states=at.states[numbers])
        question = self._question(switches, part, few=False, solver=None)
        found = ask_engine(self.caller.name, replace(question, steps=steps_of(len(numbers))))
        joints = {joint.name: joint for joint in question.request.joints}
        if not found.states or not set(at.robot.joints) <= set(joints):
            return at
        own = [joints[name] for name in at.robot.joints]
        places = [column for joint in own for column in joint.positions], [column for joint in own for column in joint.velocities]
        return replace(at, states=put(at.states, numbers, *(part[:, columns] for part, columns in zip(found.states, places, strict=True))))

    def _question(self, switches: Sequence[Switch], at: Meant | None, few: bool, solver: SolverSettings | None) -> EngineQuestion:
        original = self.original.few if few else self.original
        question = question_of(original, Stance.PLAIN, held_with(original.robot, switches, solver))
        if self.path is not None:
            question = replace(question, request=replace(question.request, path=self.path))
        if at is not None and {joint.name for joint in question.request.joints} <= set(at.robot.joints):
            states = spread(at.robot, at.states, question.request.joints)
            driving = (states.control, states.activation) if question.driving else ()
            question = replace(question, q=states.q, v=states.v, tau=states.tau, driving=driving)
        return question


def felt(asked: AskedEngine, read: Meant, judged: Sequence[Switch]) -> tuple[Meant, Flags]:
    """The robot as read, at states where constraints are felt; and which of them no limit pushes and nothing is nearly at rest.

    Half of the states nearly close the equalities: anywhere else impedances are those of far away. A quarter is beyond limits, another
    where the engine's steps lead, so that bodies touch, and another so slow and so nearly at rest that dry friction gives.
    """
    asked_about = {joint.name for joint in request_of(asked.original.robot, Stance.PLAIN).joints}
    numbers, within = np.arange(len(read.states)), np.ones(len(read.states), dtype=bool)
    touches, constraints = any(one.group.what == CONTACTS for one in judged), constraints_among(read.robot, judged)
    if not (touches or constraints) or not asked_about <= set(read.robot.joints):
        return read, within
    mechanism, states = documented(with_actuators(read.robot, ()), asked.caller, judged), read.states
    if isinstance(mechanism, DeclaredMechanism):
        laws = [law for _, law in mechanism.laws]
        is_rigid, rubs = any(law.is_rigid for law in laws), any(law.rubs for law in laws)

        def given(_mechanism: DeclaredMechanism, states: States) -> States:
            return held(reference_of(read.robot), states)

        for displaced, chosen in (
            (near if mechanism.constraints else None, numbers % 2 == 0),
            (pressed if mechanism.pushing else None, numbers % _EACH_PRESSED == 1),
            (slowed if is_rigid else None, numbers % _EACH_PRESSED > 1),
            (given if rubs else None, numbers % _EACH_PRESSED == 2),
        ):
            if displaced is not None:
                moved = displaced(mechanism, states[chosen])
                q, v, tau = states.q.copy(), states.v.copy(), states.tau.copy()
                q[chosen], v[chosen], tau[chosen] = moved.q, moved.v, moved.tau
                states = replace(states, q=q, v=v, tau=tau)
    if touches:
        states = asked.settled(judged, replace(read, states=states)).states
    if isinstance(mechanism, DeclaredMechanism):
        if mechanism.pushing:
            within = ~mechanism.reaches_limits(states)
        if rubs:
            # There an acceleration is next to nothing, and any change many times that.
            within &= numbers % _EACH_PRESSED != 2
    states = asked_at(states, read.unit_roundoff)
    return replace(read, states=states, certified=reference_of(read.robot, read.unit_roundoff).evaluate(states)), within
