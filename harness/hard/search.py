"""Search for the states a subject does worst at: what ``harness search`` does.

The budget is split into hunts that know nothing of each other, so that they run on as many processes as there
are: one by hypothesis, whose draws hold the special values, and evolution strategies of growing populations. The
worst state of each is shrunk, explained and, unless it agrees, stored with the system, where every later
cross-check compares it again. Storing is the default because a hard state that is only printed is lost by the next
run; what cannot be stored, as in a library that is installed read-only, is reported with the place it belongs to.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from operator import attrgetter
from typing import Any

import numpy as np

from harness.crosscheck.assignment import Assignment, load_audited, refuse_robots
from harness.crosscheck.expected import load_expectations, on_file
from harness.crosscheck.hypothesis_search import note_of
from harness.crosscheck.side_tasks import ask_one_by_one, readings_and_refusal
from harness.crosscheck.variation import shrink
from harness.engines import NotOffered, Subject, Unsupported, asked_of, engine_files, installed_version, load_engine, select_subjects
from harness.errors import InvalidInput, InvalidRequest, not_installed
from harness.hard.evolution import Hunt, hunt, hunts
from harness.hard.worst_cases import Loss, digits_lost, locate, reproduce
from harness.lagrange.derivation import load_mechanism
from harness.library import Library
from harness.programs.states import States
from harness.results.hard_states import (
    SOLVER,
    FoundCase,
    FoundState,
    SearchResult,
    keep,
    merged,
    path_of,
    replay_command,
    severity,
    worst_of_each,
)
from harness.results.records import ACCELERATIONS, quantity_options
from harness.study import Inquiry, Note, Part, Study, ask, call
from harness.truth.compare import Comparison
from harness.truth.quantities import find_quantities, require_quantity
from harness.verdict import SEVERITY, Verdict
from harness.version import __version__
from harness.workers import Crash, Outcome

# Measured: with it each of ten seeds passes the best of every one of ten samples of 10,000 random states on the
# two-link pendulums; a half of it passes that of the sample with its own seed.
DEFAULT_BUDGET = 8000
MECHANISM = "mechanism"


@dataclass(frozen=True, kw_only=True)
class SearchSettings:
    """A choice of states to search.

    Attributes:
        library, name: where, and which system.
        subjects: subjects as text; for none the native ones that have a model, as it is engines that are searched, not readers.
        budget: states a subject is asked for; what shrinking asks comes on top.
        quantity: what the subjects are asked for. seed: of the random starts.
        keep: whether what is found is stored with the system.
        replay_options: command-line options that say where the library is, for replay commands.
    """

    library: Library
    name: str
    subjects: Sequence[str] = ()
    budget: int = DEFAULT_BUDGET
    quantity: str = ACCELERATIONS
    seed: int = 0
    keep: bool = True
    replay_options: Sequence[str] = ()


class StateSearch(Study):
    """One search of a system; a ``harness.study.Study`` whose parts are steps without a value.

    Raises:
        InvalidInput: the expected verdicts or the stored states cannot be used; from ``take``, the system or a model.
        InvalidRequest: a system, subject or quantity that does not exist, an engine that cannot express the system or does not offer the
            quantity, or another quantity of a robot than accelerations.
    """

    title = "search"

    def __init__(self, settings: SearchSettings) -> None:
        super().__init__()
        self.settings = settings
        (self.name,) = settings.library.select([settings.name])
        require_quantity(settings.quantity)
        if not find_quantities()[settings.quantity].is_default:
            refuse_robots(settings.library, self.name, settings.quantity)
        self._expectations = load_expectations(settings.library, settings.quantity)
        self.found = SearchResult(place=path_of(settings.library, self.name))
        self._subjects = self._select()
        self._hunts = hunts(settings.budget)
        self.steps = 1 + (len(self._hunts) + 1) * len(self._subjects)
        self._assignments: list[Assignment] = []
        self._worst: dict[Subject, dict[int, States]] = {}
        # One crash of a subject is enough: each costs a process.
        self._crashes: dict[Subject, Crash] = {}
        self._cases: list[tuple[FoundState, str]] = []
        # Nobody claims to compute these.
        self._not_offered: dict[Subject, str] = {}

    def inquiries(self) -> Iterator[Iterable[Inquiry[None]]]:
        yield [self._read()]
        yield [self._hunt(one, number) for number in range(len(self._hunts)) for one in self._assignments]
        yield [self._examine(one) for one in sorted(self._assignments, key=lambda one: str(one.subject)) if one.subject in self._worst]
        yield [self._replay(one, self._crashes[one.subject]) for one in self._assignments if one.subject in self._crashes]
        self._conclude()

    def _read(self) -> Inquiry[None]:
        """The system and the models that its subjects read."""
        outcome = yield from ask(read, self.settings.library, self.name, self._subjects, self.settings.quantity)
        if outcome.exception is not None:
            raise outcome.exception
        if outcome.crash is not None:
            raise InvalidRequest(f"reading the system and its models failed: {outcome.crash}")
        self._assignments = outcome.value
        yield Part(MECHANISM, None)

    def _hunt(self, assignment: Assignment, number: int) -> Inquiry[None]:
        """The worst states of one subject that one way of hunting finds."""
        subject, result = assignment.subject, self.found
        states, population = self._hunts[number]
        outcome = yield from ask(hunt, assignment, states, population, self.settings.seed)
        yield Part(f"{subject} {states:,} states by {f'a population of {population}' if population else 'hypothesis'}", None)
        if isinstance(outcome.exception, InvalidInput):
            raise outcome.exception
        if isinstance(outcome.exception, NotOffered) and not self.settings.subjects:
            self._not_offered[subject] = str(outcome.exception)
            return
        if isinstance(outcome.exception, Unsupported):
            raise InvalidRequest(f"{subject}: {outcome.exception}") from outcome.exception
        if self._has_failed(outcome, subject):
            return
        taken: Hunt = outcome.value
        self._worst.setdefault(subject, {})[number] = taken.worst
        own, error = str(subject), taken.backward_error
        result.states[own] = result.states.get(own, 0) + taken.states
        result.undecided[own] = result.undecided.get(own, 0) + taken.undecided
        if math.isnan(error):
            error = math.inf if taken.undecided < taken.states else 0.0
        result.worst[own] = max(result.worst.get(own, 0.0), error)

    def _examine(self, assignment: Assignment) -> Inquiry[None]:
        """The worst states that were found of one subject, shrunk and explained."""
        own = self._worst[assignment.subject]
        outcome = yield from ask(examine, assignment, States.concatenate([own[number] for number in sorted(own)]))
        yield Part(f"{assignment.subject} explained", None)
        if self._has_failed(outcome, assignment.subject):
            return
        self._cases += outcome.value
        if any(found.verdict == Verdict.EXPLAINED and found.term != SOLVER for found, _ in outcome.value):
            outcome = yield from ask(call, readings_and_refusal, assignment, self.settings.seed, "")
            if not self._has_failed(outcome, assignment.subject) and outcome.value[0]:
                self.found.readings[str(assignment.subject)] = outcome.value[0]

    def _replay(self, assignment: Assignment, crash: Crash) -> Inquiry[None]:
        """The state at which the engine died; without one if it does not die again."""
        # No states where it died before it was asked for any.
        nothing = States(np.empty((0, 0)), np.empty((0, 0)), np.empty((0, 0)), np.empty(0))
        batch = States.at(**json.loads(crash.note)["states"]) if crash.note else nothing
        outcome = yield from ask(ask_one_by_one, assignment, batch)
        if outcome.crash is None or not outcome.crash.note:
            self.found.failures[str(assignment.subject)] = f"{crash}; no single state repeats it: try a lower --budget"
            return
        state = json.loads(outcome.crash.note)
        # Neither loading nor certifying asks the engine at that state.
        program = yield from ask(_program, assignment, States.at(**state))
        about = {"state": state, "verdict": Verdict.ERROR.value, "term": "none", "statement": str(crash)}
        self._cases.append((_found(assignment, backward_error=None, digits_lost=0.0, **about), program.value or ""))

    def _select(self) -> list[Subject]:
        """The subjects that can be searched; one that was asked for by name and cannot be is refused."""
        library, chosen = self.settings.library, []
        selected = select_subjects(library, self.settings.subjects, native_only=True)
        asked = asked_of(library, self.name, selected)
        for subject in selected if self.settings.subjects else ():
            if subject not in asked:
                formats = " and ".join(library.formats_of(self.name))
                raise InvalidRequest(f"{subject} cannot be searched on {self.name}: it has a model in {formats} alone")
        for subject in asked:
            reason = self._expectations.why_no_model(library, self.name, subject)
            file = engine_files(library)[subject.engine]
            if failure := self.failure(file.outcome):
                self.found.failures[str(subject)] = failure
                self.found.crashed = self.crashed
                continue
            if not reason and file.version is None:
                reason = not_installed(file.requires[1])
            if reason and self.settings.subjects:
                raise InvalidRequest(f"{subject} cannot be searched on {self.name}: {reason}")
            if not reason:
                chosen.append(subject)
        if not chosen and not self.found.failures:
            raise InvalidRequest(f"no subject can be searched on {self.name}")
        return chosen

    def _has_failed(self, outcome: Outcome, subject: Subject) -> bool:
        failure = self.failure(outcome)
        if outcome.crash is not None:
            self.found.crashed = True
            self._crashes.setdefault(subject, outcome.crash)
        elif failure:
            self.found.failures[str(subject)] = failure
        return bool(failure)

    def _conclude(self) -> None:
        """Rank what was found, and store it."""
        settings, result = self.settings, self.found
        if self._not_offered and not result.states:
            raise InvalidRequest(f"{self.name}, {settings.quantity}: " + "; ".join(dict.fromkeys(self._not_offered.values())))
        options = [*settings.replay_options, *quantity_options(settings.quantity)]
        distinct = {(one.subject, json.dumps(one.state)): (one, program) for one, program in self._cases}
        for one, program in sorted(distinct.values(), key=lambda pair: severity(pair[0]), reverse=True):
            expectation = self._expectations.of(settings.library.label(self.name), one.subject)
            if settings.library.reads_files:
                expectation = on_file(expectation, one.verdict)
            replay = replay_command(self.name, one.subject, one.state, options)
            # No worse than what is expected of the pair over many states.
            is_mild = SEVERITY[one.verdict] <= SEVERITY[expectation.verdict] and (one.backward_error or 0.0) <= expectation.limit
            result.cases.append(FoundCase(found=one, expected=expectation.verdict, as_expected=is_mild, replay=replay, reproducer=program))
        new = merged([], [case.found for case in result.cases])
        explained = any(case.found.verdict == Verdict.EXPLAINED for case in result.cases)
        if not new:
            result.not_stored = "every state agrees or is explained" if explained else "every state agrees"
        elif not settings.keep:
            result.not_stored = "not asked for"
        else:
            try:
                keep(settings.library, self.name, new)
                result.not_stored = ""
            except InvalidInput as error:
                # The search has not failed where its library cannot be written; a broken file has been reported before.
                result.not_stored = str(error)


def read(library: Library, name: str, subjects: Sequence[Subject], quantity: str, note: Note) -> list[Assignment]:
    """Assignment of each subject.

    Raises:
        InvalidInput: the system or its model cannot be used.
    """
    load_mechanism(library, name)
    return [Assignment.of(library, name, subject).about(quantity) for subject in subjects]


def examine(assignment: Assignment, states: States, note: Note) -> list[tuple[FoundState, str]]:
    """Each state shrunk and explained, with its reproducer; of states with one verdict and term the worst."""
    explained = [_examined(assignment, states[index : index + 1], note) for index in range(len(states))]
    worst = worst_of_each(explained, attrgetter("verdict", "term"))
    return [(found, reproduce(assignment, States.at(**found.state))) for found in worst]


def _examined(assignment: Assignment, state: States, note: Note) -> FoundState:
    """One state shrunk, under its own controls, and explained."""
    driving = {name: getattr(state, name) for name in ("control", "activation")}

    def driven(batch: States) -> States:
        return replace(batch, **{name: np.repeat(value, len(batch), axis=0) for name, value in driving.items()})

    def judged(batch: States) -> Comparison:
        note(note_of(str(assignment.subject), driven(batch)))
        return assignment.judge(driven(batch))

    state, error = shrink(judged, assignment.mechanism, state)
    state, comparison, stopped = driven(state), judged(state), ""
    if comparison.are_all(Verdict.DISAGREES):
        # Imported late: a search in which nobody disagrees needs nothing of it.
        from harness.crosscheck.solvers import judged_to_the_end

        certified, model = assignment.truth.evaluate(state), load_audited(assignment)
        comparison, stopped = judged_to_the_end(assignment, certified, model, state, comparison)
    loss = Loss(SOLVER, stopped) if stopped else locate(assignment, state)
    seen = {"state": state.as_json(0), "verdict": str(comparison.verdicts[0]), "term": loss.term, "statement": loss.statement}
    return _found(assignment, backward_error=None if math.isnan(error) else error, digits_lost=digits_lost(error), **seen)


def _found(assignment: Assignment, **seen: Any) -> FoundState:
    """The stored form of what a subject answered at a state, with today's versions and date."""
    engine = load_engine(assignment.library, assignment.subject.engine)
    versions = {"harness": __version__, engine.requires[1]: installed_version(engine) or ""}
    today, quantity = datetime.now(UTC).date().isoformat(), assignment.quantity
    return FoundState(subject=str(assignment.subject), quantity=quantity, versions=versions, date=today, **seen)


def _program(assignment: Assignment, state: States, note: Note) -> str:
    return reproduce(assignment, state)
