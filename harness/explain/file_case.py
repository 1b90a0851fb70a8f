"""One file with elements on that are judged: the truth of an engine's answers at some states, and numbers that explain others."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from harness.arrays import Array, Indices
from harness.engines import Engine
from harness.engines.request import EngineAnswers
from harness.explain.as_read import Folded, fold
from harness.explain.changes.departures import Departure, departures_of
from harness.explain.clamps import moved_clamps
from harness.explain.documented import documented, effect_of, laws_of
from harness.explain.file_numbers import left_beside_readings, unexplained
from harness.explain.meant import Meant, reference_of
from harness.explain.suspects import Explained, ExplainedOrder, Suspect, SuspectSearch, suspects_of
from harness.explain.switches import Switch, constraints_among
from harness.explain.touching import Touching, judged_again
from harness.results.readings import FELT, Effect
from harness.trees.mechanism import RobotMechanism, mechanism_of
from harness.trees.robot import with_actuators
from harness.truth.compare import Comparison, Flags, compare
from harness.truth.declared import DeclaredMechanism
from harness.truth.reference import Reference, ReferenceKernel
from harness.verdict import Verdict

_HELD = {Verdict.AGREES.value, Verdict.UNSTABLE.value, Verdict.UNDECIDED.value}


def is_held(compared: Comparison) -> bool:
    """True for answers that agree, but for lost digits, wherever the truth is decided."""
    return set(compared.verdicts.tolist()) <= _HELD


@dataclass(frozen=True)
class FileCase:
    """Elements that are judged, at the states of what is read, ``at``, and the contacts there.

    ``within``: the states at which no limit pushes and nothing is nearly at rest, and where no bodies touch if there are such.
    """

    original: Meant
    caller: Engine
    folded: Folded
    at: Meant
    judged: Sequence[Switch]
    touching: Touching
    within: Flags

    @property
    def apart(self) -> Flags:
        """(n,) the states at which no bodies touch."""
        return ~self.touching.is_any

    def by(self, departures: Iterable[Departure] = (), near: Array | None = None) -> Reference:
        """The truth by the laws that the engine documents, or with departures from them; ``near`` as of ``Touching.truth``."""
        own, kernel = (self.at.robot, self.caller, self.judged), partial(ReferenceKernel, unit_roundoff=self.at.unit_roundoff)
        return self.touching.truth(self.at.states, lambda contacts: documented(*own, departures, contacts), kernel, near)

    def among(self, numbers: Indices) -> FileCase:
        """The same at some states."""
        at = replace(self.at, states=self.at.states[numbers], certified=self.at.truth[numbers])
        return replace(self, at=at, within=self.within[numbers], touching=self.touching.among(numbers))

    @cached_property
    def truth(self) -> Reference:
        """By the documentation alone."""
        return self.by()

    @cached_property
    def departures(self) -> dict[Departure, Effect]:
        """The engine's departures from the documented laws, each with what it does alone; none that does nothing."""
        robot, caller, found = self.at.robot, self.caller, dict[Departure, Effect]()
        various = [laws_of(robot, caller, self.judged, contacts) for contacts in self.touching.various]
        for one in departures_of(caller.name, caller.reader):
            if concerned := next(filter(None, (one.concerned(robot.tree, *laws) for laws in various)), None):
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

    def stops_as_documented(self, answers: EngineAnswers, compared: Comparison) -> float | None:
        """The largest share of what the engine's solver documents to leave that its answers leave where they disagree.

        None where the engine documents none, or an answer leaves more.
        """
        rule, wrong = self.caller.stops, compared.verdicts == Verdict.DISAGREES.value
        if rule is None:
            return None
        # Most solvers go on to the end, or can be told to.
        from harness.truth.stopping import share_of_rule

        shares, own = np.zeros(len(wrong)), answers.of(self.at.robot.joints)
        # Rows that its program leaves out call no solver.
        about = self.at.robot, self.caller, self.judged, departures_of(self.caller.name, self.caller.reader)
        for mechanism, values, numbers in self.touching.by_structure(lambda contacts: documented(*about, contacts)):
            if (among := numbers[wrong[numbers]]).size:
                if not isinstance(mechanism, DeclaredMechanism):
                    return None
                shares[among] = share_of_rule(mechanism, self.at.states[among], values[wrong[numbers]], own[among], rule)
        return float(shares.max()) if (shares <= 1.0).all() else None

    @cached_property
    def without_actuators(self) -> Reference:
        """The truth of the tree without its actuators, and with nothing else on."""
        return reference_of(with_actuators(self.at.robot, ()), self.at.unit_roundoff).evaluate(self.at.states)

    @cached_property
    def where_apart(self) -> Meant:
        """The robot as read, at the states at which no bodies touch."""
        return replace(self.at, states=self.at.states[self.apart], certified=self.computed[np.flatnonzero(self.apart)])

    @cached_property
    def search(self) -> SuspectSearch:
        """The numbers of what is on, beside the truth at the states at which no bodies touch."""
        return SuspectSearch(suspects_of(self.original.robot), self._truth_with, self.where_apart.truth)

    def explaining(self, accelerations: Array) -> Sequence[Explained | ExplainedOrder]:
        """The numbers with another value of which the truth is what an engine answers, (n, nv); where none does, ranges out of order."""
        own = accelerations[self.apart]
        return self.search.explaining(own) or self.search.orders_explaining(own, moved_clamps(self.original.robot))

    def left(self, answers: EngineAnswers, compared: Comparison) -> list[str]:
        """Sentences on answers that nothing explains; none where digits are lost and no more."""
        accelerations = answers.of(self.at.robot.joints)
        if self.touching.is_any.any() and is_held(compared[self.apart]):
            # Most answers are right.
            from harness.explain.contact_suspects import contacts_explaining

            named = contacts_explaining(self, accelerations, compared)
            return ["it is only at states where bodies touch that it is not what its documentation gives", *named]
        has_constraints = bool(constraints_among(self.at.robot, self.judged)) or bool(self.touching.is_any.any())
        if not has_constraints and is_held(compared):
            return left_beside_readings(self.original, self.folded, self.at, answers, compared)
        if compared.are_all(Verdict.AGREES, Verdict.UNDECIDED):
            return []
        if found := self.explaining(accelerations):
            return [one.sentence for one in found]
        if not has_constraints:
            return left_beside_readings(self.original, self.folded, self.at, answers, compared)
        if is_held(compared):
            return []
        documentation = documented(self.at.robot, self.caller, self.judged, self.departures)
        kernel = ReferenceKernel(documentation, unit_roundoff=self.at.unit_roundoff)
        return unexplained(self.where_apart, accelerations[self.apart], kernel)

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


def judged_by(case: FileCase, truth: Reference, accelerations: Array, departures: Iterable[Departure] = ()) -> Comparison:
    """Answers, (n, nv), beside the truth with these departures; where several are right by the law of a contact, each by the nearest."""
    found = compare(truth, accelerations, factorises=True)
    laws = [laws_of(case.at.robot, case.caller, case.judged, contacts)[1].values() for contacts in case.touching.various]
    if all(law.has_cost for own in laws for law in own):
        return found

    def nearest(left: Indices) -> Comparison:
        return compare(case.among(left).by(departures, accelerations[left]), accelerations[left], factorises=True)

    return judged_again(found, np.flatnonzero((found.verdicts != Verdict.AGREES.value) & case.touching.is_any), nearest)
