"""One file beside an engine with all on that is judged: how the engine is asked, at which states, and the truth of its answers there."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from harness.arrays import Array
from harness.comparison.robot_library import ask_engine
from harness.comparison.touching import Touching, put, settling, steps_of
from harness.crosscheck.constraint_laws import effect_of
from harness.engines import Engine
from harness.engines.request import EngineAnswers, EngineQuestion, SolverSettings
from harness.explain.as_read import Folded, fold
from harness.explain.changes.departures import Departure, departures_of
from harness.explain.clamps import moved_clamps
from harness.explain.documented import documented, laws_of
from harness.explain.meant import Meant, question_of, reference_of, request_of, spread
from harness.explain.suspects import Explained, ExplainedOrder, Suspect, SuspectSearch, suspects_of
from harness.explain.switches import Switch, constraints_among, held_with
from harness.files.findings import CONTACTS
from harness.library import Stance
from harness.results.readings import FELT, Effect
from harness.trees.mechanism import RobotMechanism, mechanism_of
from harness.trees.robot import with_actuators
from harness.truth.compare import Flags
from harness.truth.declared import DeclaredMechanism
from harness.truth.displaced import near, pressed, slowed
from harness.truth.reference import Reference, ReferenceKernel

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
        """What is read, at states of which some are where the engine's own steps lead; as it is where the harness lets it take none."""
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


@dataclass(frozen=True)
class FileCase:
    """Elements that are judged, at the states of what is read, ``at``, and the contacts there.

    ``within``: the states at which no limit pushes, and where no bodies touch if there are such.
    """

    original: Meant
    caller: Engine
    folded: Folded
    at: Meant
    judged: Sequence[Switch]
    touching: Touching
    within: Flags

    @property
    def has_constraints(self) -> bool:
        return bool(constraints_among(self.at.robot, self.judged)) or bool(self.touching.is_any.any())

    @property
    def apart(self) -> Flags:
        """(n,) the states at which no bodies touch."""
        return ~self.touching.is_any

    def by(self, departures: Iterable[Departure] = ()) -> Reference:
        """The truth by the laws that the engine documents, or with departures from them."""
        own = self.at.robot, self.caller, self.judged
        return self.touching.truth(self.at.states, lambda contacts: documented(*own, departures, contacts))

    @cached_property
    def truth(self) -> Reference:
        """By the documentation alone."""
        return self.by()

    @cached_property
    def departures(self) -> dict[Departure, Effect]:
        """The engine's departures from the documented laws, each with what it does alone; none that does nothing."""
        robot, caller, found = self.at.robot, self.caller, dict[Departure, Effect]()
        chosen, laws = laws_of(robot, caller, self.judged, self.touching.first)
        for one in departures_of(caller.name, caller.reader):
            if concerned := one.concerned(robot.tree, chosen, laws):
                found[one] = effect_of(one, concerned, self.truth, self.by([one]))
        return {one: effect for one, effect in found.items() if effect.alone is None or effect.alone > FELT}

    @cached_property
    def _departures_elsewhere(self) -> list[Departure]:
        """Those of a file with another number: what the engine does with a curve concerns no coupling that is straight."""
        laws = laws_of(self.at.robot, self.caller, self.judged)
        every = departures_of(self.caller.name, self.caller.reader)
        return [one for one in every if one in self.departures or not one.concerned(self.at.robot.tree, *laws)]

    @cached_property
    def computed(self) -> Reference:
        """The truth with the departures."""
        return self.by(self.departures) if self.departures else self.truth

    @cached_property
    def without_actuators(self) -> Reference:
        """The truth of the tree without its actuators, and with nothing else on."""
        return reference_of(with_actuators(self.at.robot, ())).evaluate(self.at.states)

    @cached_property
    def where_apart(self) -> Meant:
        """What is read, at the states at which no bodies touch."""
        return replace(self.at, states=self.at.states[self.apart], certified=self.computed[np.flatnonzero(self.apart)])

    @cached_property
    def search(self) -> SuspectSearch:
        """The numbers of what is on, beside the truth at the states at which no bodies touch."""
        return SuspectSearch(suspects_of(self.original.robot), self._truth_with, self.where_apart.truth)

    def explaining(self, accelerations: Array) -> Sequence[Explained | ExplainedOrder]:
        """The numbers with another value of which the truth is what an engine answers, (n, nv); where none does, ranges out of order."""
        own = accelerations[self.apart]
        return self.search.explaining(own) or self.search.orders_explaining(own, moved_clamps(self.original.robot))

    @cached_property
    def _by_parameters(self) -> tuple[ReferenceKernel, dict[object, int]]:
        """The equations of what is on, and the places of numbers of the file among their parameters; none where readings change some."""
        mechanism = documented(self.at.robot, self.caller, self.judged, self._departures_elsewhere)
        given = () if self.folded.applied or not isinstance(mechanism, RobotMechanism | DeclaredMechanism) else mechanism.given
        return ReferenceKernel(mechanism), {number.key: place for place, number in enumerate(given)}

    def _truth_with(self, suspect: Suspect, value: float) -> tuple[Array, Array]:
        if suspect.is_parameter:
            kernel, places = self._by_parameters
            if (place := places.get(suspect.number.key)) is not None:
                values = np.array(kernel.mechanism.parameter_values)
                values[place] = value
                return kernel.accelerations(self.where_apart.states, values)
        acting = [one.number for one in self.original.robot.tree.actuators]
        robot = fold(with_actuators(suspect.robot(value), acting), [reading for reading, _ in self.folded.applied]).robot
        mechanism = reference_of(self.at.robot).mechanism if suspect.is_of_rows else mechanism_of(robot)
        changed = documented(robot, self.caller, self.judged, self._departures_elsewhere, mechanism=mechanism)
        return ReferenceKernel(changed).accelerations(self.where_apart.states)


def felt(asked: AskedEngine, read: Meant, judged: Sequence[Switch]) -> tuple[Meant, Flags]:
    """What is read, at states where constraints are felt, and which of them no limit pushes.

    Half of the states nearly close the equalities: anywhere else impedances are those of far away. A quarter is beyond limits, and
    another where the engine's steps lead, so that bodies touch.
    """
    asked_about = {joint.name for joint in request_of(asked.original.robot, Stance.PLAIN).joints}
    numbers, within = np.arange(len(read.states)), np.ones(len(read.states), dtype=bool)
    touches, constraints = any(one.group.what == CONTACTS for one in judged), constraints_among(read.robot, judged)
    if not (touches or constraints) or not asked_about <= set(read.robot.joints):
        return read, within
    mechanism, states = documented(with_actuators(read.robot, ()), asked.caller, judged), read.states
    if isinstance(mechanism, DeclaredMechanism):
        for displaced, chosen in (
            (near if mechanism.constraints else None, numbers % 2 == 0),
            (pressed if mechanism.pushing else None, numbers % _EACH_PRESSED == 1),
            (slowed, numbers % _EACH_PRESSED > 1),
        ):
            if displaced is not None:
                moved = displaced(mechanism, states[chosen])
                q, v = states.q.copy(), states.v.copy()
                q[chosen], v[chosen] = moved.q, moved.v
                states = replace(states, q=q, v=v)
    if touches:
        states = asked.settled(judged, replace(read, states=states)).states
    if isinstance(mechanism, DeclaredMechanism) and mechanism.pushing:
        within = ~mechanism.reaches_limits(states)
    return Meant(read.robot, states, reference_of(read.robot).evaluate(states)), within
