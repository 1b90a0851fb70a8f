"""Search for the states a subject does worst at: what ``harness search`` does.

The budget is split into hunts that know nothing of each other, so that they run on as many processes as there
are: one by hypothesis, whose draws hold the special values, and evolution strategies of growing populations. The
worst state of each is shrunk, explained and, unless it agrees, stored with the system, where every later
cross-check compares it again. Storing is the default because a hard state that is only printed is lost by the next
run; what cannot be stored, as in a library that is installed read-only, is told with the place it belongs to.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from harness.check import tasks
from harness.check.expected import Expectation, load_expectations, why_no_model
from harness.engines import EQUATIONS, Subject, Unsupported, installed_version, load_engine, select_subjects, subjects
from harness.equations.mechanism import Mechanism
from harness.equations.states import States
from harness.errors import InvalidInput, InvalidRequest
from harness.hard import evolution
from harness.hard.lost_digits import digits_lost, locate
from harness.hard.reproducer import reproduce
from harness.hard.shrinking import shrink
from harness.library import Library
from harness.results.hard_states import FoundState, keep, merged, path_of, replay_command
from harness.results.search import Case, SearchResult
from harness.verdict import SEVERITY, Verdict
from harness.version import __version__
from harness.workers import Crash, Outcome, Task, Workers

# Measured: with it each of ten seeds passes the best of every one of ten samples of 10,000 random states on the
# two-link pendulums; a half of it passes that of the sample with its own seed.
DEFAULT_BUDGET = 8000
# Hypothesis costs ten times as much per state as a population.
HYPOTHESIS_SHARE = 8
# Populations of the evolution strategies and the decades of their scales; each gets states in proportion, hence as many
# generations. The plain scale is for what is hard far from zero.
POPULATIONS = {20: 0, 40: evolution.DECADES, 80: evolution.DECADES}


@dataclass(frozen=True, kw_only=True)
class SearchSettings:
    """What to search.

    Attributes:
        library, name: where, and which system.
        subjects: subjects as text; for none the native ones that have a model, as it is engines that are searched, not readers.
        budget: states a subject is asked for; what shrinking asks comes on top.
        seed: of the random starts.
        keep: whether what is found is stored with the system.
        replay_options: command-line options that say where the library is, for replay commands.
    """

    library: Library
    name: str
    subjects: Sequence[str] = ()
    budget: int = DEFAULT_BUDGET
    seed: int = 0
    keep: bool = True
    replay_options: Sequence[str] = ()


def hunts(budget: int) -> list[tuple[int, int]]:
    """(states, population) of each hunt; population 0 is hypothesis. A budget that is small has fewer hunts."""
    by_hypothesis = max(1, budget // HYPOTHESIS_SHARE)
    rest = budget - by_hypothesis
    shares = [(rest * population // sum(POPULATIONS), population) for population in POPULATIONS]
    return [(by_hypothesis, 0), *((states, population) for states, population in shares if states >= evolution.SMALLEST_POPULATION)]


def run_search(settings: SearchSettings, workers: Workers, progress: Callable[[str], None] = lambda text: None) -> SearchResult:
    """Search one system on workers whose context the caller has entered; ``progress`` is told what is done.

    Raises:
        InvalidInput: the system, a model, the expected verdicts or the stored states cannot be used.
        InvalidRequest: a system or subject that does not exist, or an engine that cannot express the system.
    """
    (name,) = settings.library.select([settings.name])
    expectations = load_expectations(settings.library, [str(subject) for subject in subjects(settings.library)])
    result = SearchResult(place=path_of(settings.library, name))
    mechanism: Mechanism = _value(next(workers.run([Task(None, tasks.derive, (settings.library, name))])))
    progress("equations")
    assignments = _assignments(settings, mechanism, workers, expectations)
    hunted: dict[Subject, list[States]] = {assignment.subject: [] for assignment in assignments}
    work = [
        Task((assignment, number), hunt, (assignment, states, population, settings.seed))
        for number, (states, population) in enumerate(hunts(settings.budget))
        for assignment in assignments
    ]
    crashes: list[tuple[tasks.Assignment, Crash]] = []
    worst: dict[tuple[Subject, int], States] = {}
    for outcome in workers.run(work):
        assignment, number = outcome.task.key
        progress(f"{assignment.subject} {_describe(*hunts(settings.budget)[number])}")
        if outcome.crash is not None:
            crashes.append((assignment, outcome.crash))
        elif taken := _taken(outcome, assignment.subject, result):
            worst[assignment.subject, number] = taken.worst
    for (subject, _), states in sorted(worst.items(), key=lambda item: (str(item[0][0]), item[0][1])):
        hunted[subject].append(states)
    # One crash of a subject is enough: each costs a process.
    first = {assignment.subject: (assignment, crash) for assignment, crash in reversed(crashes)}
    found: list[tuple[FoundState, str]] = [_crashed(assignment, crash, workers, result) for assignment, crash in first.values()]
    examinations = [
        Task(assignment, examine, (assignment, States.concatenate(hunted[assignment.subject])))
        for assignment in assignments
        if hunted[assignment.subject]
    ]
    for outcome in workers.run(examinations):
        assignment = outcome.task.key
        progress(f"{assignment.subject} explained")
        if outcome.crash is not None:
            found.append(_crashed(assignment, outcome.crash, workers, result))
        elif outcome.exception is not None:
            result.failures[str(assignment.subject)] = _reason(outcome)
        else:
            found += outcome.value
    for one, program in sorted(_distinct(found), key=lambda pair: pair[0].severity, reverse=True):
        expectation = expectations.get((name, one.subject), Expectation())
        replay = replay_command(name, one.subject, one.state, settings.replay_options)
        expected = _is_expected(one, expectation)
        result.cases.append(Case(found=one, expected=expectation.verdict, as_expected=expected, replay=replay, reproducer=program))
    _store(settings, name, result)
    return result


def examine(assignment: tasks.Assignment, states: States, note: tasks.Note) -> list[tuple[FoundState, str]]:
    """Each state shrunk and explained, with its reproducer; of states with one verdict and term the worst."""
    judge = tasks.judge_of(assignment)

    def noted(batch: States) -> Any:
        note(evolution.as_note(batch))
        return judge(batch)

    engine = load_engine(assignment.library, assignment.subject.engine)
    versions = {"harness": __version__, engine.requires[1]: installed_version(engine) or ""}
    worst: dict[tuple[str, str], FoundState] = {}
    for index in range(len(states)):
        state, error = shrink(noted, assignment.mechanism, states[index : index + 1])
        verdict = str(noted(state).verdicts[0])
        loss = locate(assignment, state)
        found = FoundState(
            state=state.as_json(0),
            subject=str(assignment.subject),
            backward_error=None if math.isnan(error) else error,
            digits_lost=digits_lost(error),
            verdict=verdict,
            term=loss.term,
            statement=loss.statement,
            versions=versions,
            date=datetime.now(UTC).date().isoformat(),
        )
        key = verdict, loss.term
        if key not in worst or found.severity > worst[key].severity:
            worst[key] = found
    return [(found, reproduce(assignment, States.at(**found.state))) for found in worst.values()]


def hunt(assignment: tasks.Assignment, states: int, population: int, seed: int, note: tasks.Note = lambda text: None) -> evolution.Hunt:
    """One hunt of ``hunts``; population 0 is hypothesis."""
    if population:
        return evolution.evolve(assignment, states, population, seed, note, POPULATIONS[population])
    return evolution.explore(assignment, states, seed, note)


def _describe(states: int, population: int) -> str:
    return f"{states:,} states by {f'a population of {population}' if population else 'hypothesis'}"


def _assignments(settings: SearchSettings, mechanism: Mechanism, workers: Workers, expectations: Any) -> list[tasks.Assignment]:
    """The subjects that can be searched; one that was asked for by name and cannot be is refused."""
    chosen: list[Subject] = []
    for subject in select_subjects(settings.library, settings.subjects, native_only=True):
        reason = why_no_model(settings.library, mechanism.name, str(subject), subject.format, expectations)
        engine = load_engine(settings.library, subject.engine)
        if not reason and installed_version(engine) is None:
            reason = f"{engine.requires[1]} is not installed"
        if reason and settings.subjects:
            raise InvalidRequest(f"{subject} cannot be searched on {mechanism.name}: {reason}")
        if not reason:
            chosen.append(subject)
    if not chosen:
        raise InvalidRequest(f"no subject can be searched on {mechanism.name}")
    formats = sorted({subject.format for subject in chosen} - {EQUATIONS})
    paths = {model_format: settings.library.model_path(mechanism.name, model_format) for model_format in formats}
    reading = [Task(model_format, tasks.read, (path, model_format)) for model_format, path in paths.items()]
    models = {outcome.task.key: _value(outcome) for outcome in workers.run(reading)}
    return [tasks.Assignment(settings.library, subject, mechanism, models.get(subject.format)) for subject in chosen]


def _value(outcome: Outcome) -> Any:
    if outcome.exception is not None:
        raise outcome.exception
    if outcome.crash is not None:
        raise InvalidRequest(f"reading the system and its models failed: {outcome.crash}")
    return outcome.value


def _taken(outcome: Outcome, subject: Subject, result: SearchResult) -> evolution.Hunt | None:
    if isinstance(outcome.exception, InvalidInput):
        raise outcome.exception
    if isinstance(outcome.exception, Unsupported):
        raise InvalidRequest(f"{subject}: {outcome.exception}") from outcome.exception
    if outcome.exception is not None:
        result.failures[str(subject)] = _reason(outcome)
        return None
    taken: evolution.Hunt = outcome.value
    for counts, count in ((result.states, taken.states), (result.undecided, taken.undecided)):
        counts[str(subject)] = counts.get(str(subject), 0) + count
    error = math.inf if math.isnan(taken.backward_error) and taken.undecided < taken.states else taken.backward_error
    result.worst[str(subject)] = max(result.worst.get(str(subject), 0.0), 0.0 if math.isnan(error) else error)
    return taken


def _reason(outcome: Outcome) -> str:
    return f"{type(outcome.exception).__name__}: {outcome.exception}"


def _crashed(assignment: tasks.Assignment, crash: Crash, workers: Workers, result: SearchResult) -> tuple[FoundState, str]:
    """The state at which the engine died, found by asking for the last batch one by one; without a state if it does not die again."""
    result.crashed = True
    state: dict[str, list[float]] = {"q": [], "v": [], "tau": []}
    if crash.note:
        replayed = next(workers.run([Task(None, tasks.accelerate_one_by_one, (assignment, States.at(**json.loads(crash.note))))]))
        if replayed.crash is not None and replayed.crash.note:
            state = json.loads(replayed.crash.note)
    program = ""
    if state["q"]:
        # Neither loading nor certifying asks the engine at that state.
        program = next(workers.run([Task(None, _program, (assignment, States.at(**state)))])).value or ""
    else:
        result.failures[str(assignment.subject)] = f"{crash}; no single state repeats it: lower --budget or raise --time-limit"
    engine = load_engine(assignment.library, assignment.subject.engine)
    found = FoundState(
        state=state,
        subject=str(assignment.subject),
        backward_error=None,
        digits_lost=0.0,
        verdict=Verdict.ERROR.value,
        term="none",
        statement=str(crash),
        versions={"harness": __version__, engine.requires[1]: installed_version(engine) or ""},
        date=datetime.now(UTC).date().isoformat(),
    )
    return found, program


def _distinct(found: list[tuple[FoundState, str]]) -> list[tuple[FoundState, str]]:
    """Those that have a state, each state of a subject once."""
    return list({(one.subject, json.dumps(one.state)): (one, program) for one, program in found if one.state["q"]}.values())


def _program(assignment: tasks.Assignment, state: States, note: tasks.Note) -> str:
    return reproduce(assignment, state)


def _is_expected(found: FoundState, expectation: Expectation) -> bool:
    """Whether a state is no worse than what is expected of the pair over many states."""
    return SEVERITY[found.verdict] <= SEVERITY[expectation.verdict] and (found.backward_error or 0.0) <= expectation.backward_error


def _store(settings: SearchSettings, name: str, result: SearchResult) -> None:
    new = merged([], [case.found for case in result.cases])
    if not new:
        result.not_stored = "every state agrees"
    elif not settings.keep:
        result.not_stored = "not asked for"
    else:
        try:
            keep(settings.library, name, new)
            result.stored = result.place
        except InvalidInput as error:
            # The search has not failed where its library cannot be written; a broken file has been told before.
            result.not_stored = str(error)
