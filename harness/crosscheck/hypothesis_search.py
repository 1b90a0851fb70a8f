"""The search for the states that subjects do worst at: one search of a system for all its subjects.

States come in blocks. The first state of a block is hypothesis' own draw, which ``target()`` guides towards larger backward
errors, with one label a subject. The others are drawn beside it: special and random ones first, later neighbours of the worst
state of each subject so far. A block is certified once, and every subject is judged on all of it. Hypothesis is given the
errors at its own draw only, so that they depend on nothing but its choices.

Source: Loescher, Sagonas, Targeted property-based testing, ISSTA 2017; Beyer, Schwefel, Evolution strategies: a comprehensive
introduction, Natural Computing 1 (2002), for the neighbours.
"""

from __future__ import annotations

import json
import math
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.crosscheck.assignment import Assignment, load_audited
from harness.crosscheck.stages import Answers
from harness.crosscheck.together import Answered, answered_together
from harness.crosscheck.variation import Variation, count_digits, rows_of, shrink, states_of
from harness.engines import Calls, Model
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.states import States
from harness.study import Note
from harness.truth.compare import Certified, Comparison
from harness.truth.sampling import strategy
from harness.verdict import SEVERITY, SOUND, Verdict

# States of a block. Hypothesis takes 1 to 4 ms for its draw; certifying a state in a block costs a tenth of certifying it alone.
BLOCK = 25
# Of the states, how many are drawn before neighbours of the worst are.
FRESH_SHARE = 0.4
# log10 of an error that is not finite, and of the smallest that differs from none.
WORST, LEAST = 400.0, -20.0
_KEY = b"simplest failing state"


@dataclass(frozen=True)
class Found:
    """The outcome of a search for one subject.

    Attributes:
        states: every state it was asked at, in order. comparison: the judgement of each.
        simplest_failure: index of the shrunk state that does not agree, None where all agree.
        added: how many of the states were not asked for: those that earlier searches kept, and the shrunk one.
        remark: what the answers have in common, as of ``Answers``.
    """

    states: States
    comparison: Comparison
    simplest_failure: int | None
    added: int = 0
    remark: str = ""


def search(
    assignments: Sequence[Assignment], examples: int, seed: int, folder: Path | None, note: Note, *, each: bool = False
) -> dict[str, Found | Answers]:
    """The answers of each subject, all of one mechanism, at ``examples`` states; where it does not agree, the simplest such state.

    The simplest failing states are kept below ``folder`` and tried first the next time. They and the shrunk states come on
    top of ``examples``. A subject that raises an exception has ``Answers`` that say why; the others go on without it. The note
    names the subject that is being asked, or with states of a block all that are asked together; with ``each`` none are.
    """
    panel = _Panel(assignments, note, each)
    kept = _kept(folder, panel)
    panel.judge(kept)
    panel.kept = len(kept)
    _draw(panel, examples, seed)
    for subject in panel.subjects:
        panel.simplify(subject)
        _keep(folder, subject, panel.simplest.get(subject))
    subjects = [str(assignment.subject) for assignment in assignments]
    return {one: Answers.missing(panel.failures[one]) if one in panel.failures else panel.found(one) for one in subjects}


def explore(assignment: Assignment, examples: int, seed: int, note: Note) -> Found:
    """``search`` of one subject, whose exception is raised; nothing is shrunk or kept."""
    panel = _Panel([assignment], note)
    _draw(panel, examples, seed)
    for failure in panel.failures.values():
        raise failure
    return panel.found(str(assignment.subject))


def note_of(subject: str, states: States) -> str:
    """A note that names the states a subject is being asked at: ``{"subject": ..., "states": {"q", "v", "tau"}}``."""
    return json.dumps({"subject": subject, **_named(states)})


def _named(states: States) -> dict[str, Any]:
    return {"states": {name: getattr(states, name).tolist() for name in states.named}}


def objective(comparison: Comparison) -> Array:
    """(n,) log10 of the backward error; ``WORST`` where the answer is not finite, ``LEAST`` where nothing is certified."""
    with np.errstate(divide="ignore"):
        logarithm = np.clip(np.log10(comparison.backward_error), LEAST, WORST)
    missing = np.where(comparison.verdicts == Verdict.ERROR.value, WORST, LEAST)
    return np.asarray(np.where(np.isnan(comparison.backward_error), missing, logarithm))


class _Panel:
    """Subjects of one mechanism that are judged on the same states; one that raises an exception leaves, and has it in ``failures``.

    ``simplest`` holds the simplest failing state of a subject, once ``simplify`` has found it; ``kept`` counts the states of earlier
    searches. With ``each`` every subject is asked by itself.
    """

    def __init__(self, assignments: Sequence[Assignment], note: Note, each: bool = False) -> None:
        self.mechanism: Mechanism = assignments[0].mechanism
        self.failures: dict[str, Exception] = {}
        self.kept = 0
        self.simplest: dict[str, States] = {}
        self._asked = {str(assignment.subject): assignment for assignment in assignments}
        self._truths = {subject: assignment.truth for subject, assignment in self._asked.items()}
        self._seen: dict[str, list[tuple[States, Comparison]]] = {subject: [] for subject in self._asked}
        self._worst: dict[str, tuple[float, Array]] = {}
        self._remarks: dict[str, str] = {}
        self._note, self._each = note, each

    @property
    def subjects(self) -> list[str]:
        """Those that have not left."""
        return [subject for subject in self._asked if subject not in self.failures]

    def judge(self, states: States) -> dict[str, Comparison]:
        """The judgement of each subject's answers at ``states``; each truth is certified once."""
        subjects = self.subjects if len(states) else []
        distinct = {self._truths[subject].key: self._truths[subject] for subject in subjects}
        asked = {key: truth.asked_at(states) for key, truth in distinct.items()}
        certified = {key: truth.evaluate(asked[key]) for key, truth in distinct.items()}
        found = {} if self._each else self._asked_together(subjects, states, asked)
        comparisons: dict[str, Comparison] = {}
        for subject in subjects:
            key = self._truths[subject].key
            try:
                comparison = self._ask(subject, asked[key], certified[key], found.get(subject))
            except Exception as error:
                self.failures[subject] = error
                continue
            comparisons[subject] = comparison
            self._seen[subject].append((asked[key], comparison))
            score = objective(comparison)
            index = int(score.argmax())
            if subject not in self._worst or score[index] > self._worst[subject][0]:
                self._worst[subject] = float(score[index]), rows_of(states[index : index + 1])[0]
        return comparisons

    def _asked_together(self, subjects: Sequence[str], states: States, asked: Mapping[Hashable, States]) -> dict[str, Answered]:
        def asks(assignment: Assignment, model: Model) -> Sequence[Calls]:
            truth = assignment.truth
            return [truth.asks_all(model, asked[truth.key])]

        return answered_together({subject: self._asked[subject] for subject in subjects}, asks, self._note, _named(states))

    def _ask(self, subject: str, states: States, certified: Certified, found: Answered | None = None) -> Comparison:
        assignment = self._asked[subject]
        if found is None:
            self._note(note_of(subject, states))
            comparison = assignment.judge(states, certified)
        else:
            comparison = assignment.judge_all(states, certified, found[0][0])
        if (comparison.verdicts == Verdict.DISAGREES.value).any():
            # Imported late: a run in which all is well needs nothing of it.
            from harness.crosscheck.solvers import judged_to_the_end

            comparison, stopped = judged_to_the_end(assignment, certified, load_audited(assignment), states, comparison)
            self._remarks[subject] = stopped or self._remarks.get(subject, "")
        return comparison

    def worst(self, count: int) -> Array:
        """``count`` rows, (count, columns): the worst states of the subjects, in turn."""
        rows = np.array([self._worst[subject][1] for subject in self.subjects])
        return np.asarray(rows[np.arange(count) % len(rows)])

    def simplify(self, subject: str) -> None:
        """Shrink the simplest state of the gravest verdict, where a subject does not agree everywhere."""
        found = self.found(subject)
        severity = np.array([SEVERITY[verdict] for verdict in found.comparison.verdicts.tolist()])
        if severity.max() <= max(SEVERITY[verdict] for verdict in SOUND):
            return
        rows = rows_of(found.states)
        index = min(np.flatnonzero(severity == severity.max()).tolist(), key=lambda index: count_digits(rows[index]))

        truth = self._truths[subject]

        def judge(states: States) -> Comparison:
            asked = truth.asked_at(states)
            return self._ask(subject, asked, truth.evaluate(asked))

        try:
            # The verdict is kept, however small the error becomes.
            state, _ = shrink(judge, self.mechanism, found.states[index : index + 1], kept=0.0)
            self._seen[subject].append((truth.asked_at(state), judge(state)))
            self.simplest[subject] = state
        except Exception as error:
            self.failures[subject] = error

    def found(self, subject: str) -> Found:
        """The outcome for a subject; its simplest failing state comes last."""
        states = States.concatenate([states for states, _ in self._seen[subject]])
        comparison = Comparison.concatenate([comparison for _, comparison in self._seen[subject]])
        simplified = subject in self.simplest
        last = len(states) - 1 if simplified else None
        return Found(states, comparison, last, self.kept + simplified, self._remarks.get(subject, ""))


def _draw(panel: _Panel, examples: int, seed: int) -> None:
    """Judge ``examples`` states in blocks."""
    import hypothesis
    from hypothesis.internal.conjecture import providers

    mechanism, left = panel.mechanism, examples
    variation = Variation(mechanism, np.random.default_rng(seed))
    failures: list[BaseException] = []

    def judged(drawn: Array) -> dict[str, Comparison]:
        """The judgement of a block that begins with ``drawn`` rows; of nothing where all states are judged or nobody is left."""
        nonlocal left
        others = min(BLOCK, left) - len(drawn)
        if others < 0 or not left or failures or not panel.subjects:
            return {}
        beside = variation.fresh(others) if left > (1 - FRESH_SHARE) * examples else variation.near(panel.worst(others))
        left -= len(drawn) + others
        try:
            return panel.judge(states_of(mechanism, np.vstack([drawn, beside])))
        except (Exception, SystemExit) as error:
            # Hypothesis would ask again, where no state is left to be asked, and call the failure flaky.
            failures.append(error)
            return {}

    def judge(state: States) -> None:
        for subject, comparison in judged(rows_of(state)).items():
            if 0 < (size := float(comparison.backward_error[0])) < math.inf:
                hypothesis.target(math.log10(size), label=subject)

    settings = hypothesis.settings(
        max_examples=math.ceil(examples / BLOCK),
        database=None,
        deadline=None,
        derandomize=False,
        suppress_health_check=list(hypothesis.HealthCheck),
        phases=[hypothesis.Phase.generate, hypothesis.Phase.target],
        verbosity=hypothesis.Verbosity.quiet,
    )
    # Hypothesis would also draw constants from the sources of whatever happens to be imported.
    providers.is_local_module_file = lambda path: False  # type: ignore[assignment, attr-defined]
    settings(hypothesis.seed(seed)(hypothesis.given(strategy(mechanism))(judge)))()
    # Hypothesis ends early where it has no other draw; the states that were asked for are judged all the same.
    while judged(np.empty((0, mechanism.nq + 2 * mechanism.nv))):
        pass
    for failure in failures:
        raise failure


def _kept(folder: Path | None, panel: _Panel) -> States:
    """The failing states that earlier searches kept of the panel's subjects, as far as they are states of its mechanism."""
    mechanism = panel.mechanism
    none = np.empty((0, mechanism.nq + 2 * mechanism.nv))
    values = [] if folder is None else [value for subject in panel.subjects for value in _database(folder, subject).fetch(_KEY)]
    # Subjects that read one file often fail at one state.
    rows = [np.frombuffer(value)[None] for value in dict.fromkeys(values) if len(value) == none.itemsize * none.shape[1]]
    return states_of(mechanism, np.vstack([none, *rows]))


def _keep(folder: Path | None, subject: str, state: States | None) -> None:
    """Keep the simplest failing state of a subject instead of the one that was; without a failure there is no folder."""
    if folder is None or (state is None and not folder.is_dir()):
        return
    database = _database(folder, subject)
    for value in list(database.fetch(_KEY)):
        database.delete(_KEY, value)
    if state is not None:
        database.save(_KEY, rows_of(state).tobytes())


def _database(folder: Path, subject: str) -> Any:
    from hypothesis.database import DirectoryBasedExampleDatabase

    return DirectoryBasedExampleDatabase(folder / subject.replace("/", "-"))
