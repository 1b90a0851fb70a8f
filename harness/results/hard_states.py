"""Hard states that a search found, stored with the system and compared again in every later run; and the result of a search.

``hard_states/<system>.json`` of a library is a list of objects with the fields of ``FoundState``. Of a subject,
a verdict and a term, the worst state stays. A state at which everything agrees is not stored.
"""

from __future__ import annotations

import json
import math
import shlex
from collections.abc import Callable, Collection, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from datetime import date
from itertools import groupby, islice
from operator import attrgetter
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from harness.errors import InvalidInput
from harness.library import Library
from harness.results.readings import Effect, explanation, reading_lines
from harness.results.records import ACCELERATIONS, Record, state_and_replay
from harness.results.table import error_text, plural
from harness.storage import write_atomically
from harness.verdict import AGREEMENT, SEVERITY, SOUND, Verdict

FOLDER = "hard_states"
# In place of a term, where a solver of constraints stops before the optimum that its engine documents.
SOLVER = "solver"
_Case = TypeVar("_Case", "FoundState", "RankedCase")


@dataclass(frozen=True, kw_only=True)
class FoundState:
    """One state at which a subject did badly.

    Attributes:
        state: {"q": (nq,), "v": (nv,), "tau": (nv,)} in SI; with time, control and activation where these are not 0.
        subject: as "mujoco/mjcf".
        backward_error: [units of data roundoff]; None for a crash or an answer that is not finite.
        digits_lost: decimal digits beyond those the data leave open.
        verdict: value of ``Verdict``.
        term: the term of the equations that loses them; see ``harness.hard.worst_cases``.
        statement: that in a sentence.
        versions: distribution to version, of the harness and the engine.
        date: ISO 8601, of the search.
        quantity: what it was asked for.

    Raises:
        ValueError: a field is not of that kind.
    """

    state: dict[str, list[float]]
    subject: str
    backward_error: float | None
    digits_lost: float
    verdict: str
    term: str
    statement: str
    versions: dict[str, str]
    date: str
    quantity: str = ACCELERATIONS

    def __post_init__(self) -> None:
        first, further = list(self.state)[:3], list(self.state)[3:]
        is_state = first == ["q", "v", "tau"] and further == [name for name in ("time", "control", "activation") if name in further]
        if not is_state or not all(math.isfinite(value) for part in self.state.values() for value in part):
            raise ValueError('"state" is not {"q": [...], "v": [...], "tau": [...]} with finite numbers')
        if self.verdict not in SEVERITY:
            raise ValueError(f'"verdict" is {self.verdict!r}; expected one of {", ".join(SEVERITY)}')
        if math.isnan(self.digits_lost) or (self.backward_error is not None and math.isnan(self.backward_error)):
            raise ValueError('"backward_error" or "digits_lost" is no number')
        date.fromisoformat(self.date)


def path_of(library: Library, system: str) -> Path:
    """The file of a system's hard states."""
    return library.hard_states / f"{library.label(system)}.json"


def load_found(library: Library, system: str) -> list[FoundState]:
    """The stored states of a system, in the file's order; none where there is no file.

    Raises:
        InvalidInput: the file cannot be read, or holds something else.
    """
    path = path_of(library, system)
    if not path.exists():
        return []
    names = [part.name for part in fields(FoundState)]
    expected = f"expected a list of objects with {', '.join(names)}"
    try:
        entries = json.loads(path.read_text(encoding="utf-8"))
    except json.JSONDecodeError as error:
        raise InvalidInput(path, error.lineno, f"is not JSON: {error.msg}; {expected}") from error
    except (OSError, UnicodeDecodeError) as error:
        raise InvalidInput(path, None, f"cannot be read: {error}; {expected}") from error
    if not isinstance(entries, list):
        raise InvalidInput(path, None, f"holds no list; {expected}")
    found = []
    for number, entry in enumerate(entries, start=1):
        # A field that this harness does not know would be lost when the file is written again.
        if unknown := set(entry) - set(names) if isinstance(entry, dict) else ():
            raise InvalidInput(path, None, f"entry {number} holds {', '.join(sorted(unknown))}; {expected}")
        try:
            # JSON has no infinity; lax conversion reads the text of one.
            found.append(msgspec.convert(entry, FoundState, strict=False))
        except ValueError as error:
            raise InvalidInput(path, None, f"entry {number}: {error}; {expected}") from error
    return found


def merged(stored: Iterable[FoundState], new: Iterable[FoundState]) -> list[FoundState]:
    """The states to store: of each subject, quantity, verdict and term the worst; in a fixed order, and without states that agree."""
    key = attrgetter("subject", "quantity", "verdict", "term")
    return sorted(worst_of_each((found for found in [*stored, *new] if found.verdict not in SOUND), key), key=key)


def keep(library: Library, system: str, new: Sequence[FoundState]) -> Path | None:
    """Store what is new and worse; the file written, None where nothing had to be.

    Raises:
        InvalidInput: the file is broken, or cannot be written.
    """
    stored, path = load_found(library, system), path_of(library, system)
    together = merged(stored, new)
    if together == stored:
        return None
    try:
        path.parent.mkdir(exist_ok=True)
    except OSError as error:
        raise InvalidInput(path, None, f"cannot be written ({error.strerror}); make the folder {FOLDER} writable") from error
    write_atomically(path, as_text(together))
    return path


def as_text(found: Sequence[FoundState]) -> str:
    """The text of a file that holds ``found``."""
    # Imported late: to compare what is stored takes nothing of it.
    from harness.results.plain_json import dumps

    return dumps(found, indent=1) + "\n"


@dataclass(frozen=True, kw_only=True)
class RankedCase:
    """One line of a subject's worst cases; attributes as in ``FoundState``, and what to run to see it.

    Attributes:
        replay: shell command; reproducer: program in the engine's own Python API, "" where there is none.
    """

    system: str
    subject: str
    verdict: str
    backward_error: float | None
    state: dict[str, list[float]]
    statement: str
    replay: str
    reproducer: str = ""


def worst_cases(records: Iterable[Record], most: int = 10) -> list[RankedCase]:
    """By subject the worst case of each system, the worst system first, at most ``most`` each; none with a reproducer yet.

    Cases are of accelerations. A record without a state, and a verdict that is no answer of the engine, is no case. Stored states are
    among those of the records: what was stored of their errors was measured elsewhere.
    """
    cases = []
    for record in (one for one in records if not one.is_further):
        state, error, replay = record.worst_state, record.backward_error, record.replay
        if (shown := record.representative) is not None and shown.is_alone:
            # The largest error may be that of an answer that agrees, beside one without a number, or one that is explained.
            state, error, replay = shown.state, shown.backward_error, shown.replay
        if state is not None:
            about = {"system": record.system, "subject": record.subject, "verdict": record.verdict, "statement": record.message}
            cases.append(RankedCase(**about, backward_error=error, state=state, replay=replay))
    judged = [case for case in cases if case.verdict not in (Verdict.UNDECIDED, Verdict.UNSUPPORTED)]
    worst = worst_of_each(judged, attrgetter("subject", "system"))
    ranking = sorted(worst, key=lambda case: (case.subject, [-part for part in severity(case)], case.system))
    return [case for _, own in groupby(ranking, key=attrgetter("subject")) for case in islice(own, most)]


def severity(case: FoundState | RankedCase) -> tuple[int, float]:
    """Sort key, ascending severity."""
    return SEVERITY[case.verdict], math.inf if case.backward_error is None else case.backward_error


def worst_of_each(cases: Iterable[_Case], key: Callable[[_Case], Hashable]) -> list[_Case]:
    """The worst of all cases with one key, and of equals the first; in the order in which the keys come."""
    worst: dict[Hashable, _Case] = {}
    for case in cases:
        if key(case) not in worst or severity(case) > severity(worst[key(case)]):
            worst[key(case)] = case
    return list(worst.values())


def replay_command(system: str, subject: str, state: Mapping[str, Sequence[float]], options: Collection[str] = ()) -> str:
    """Shell command that compares one subject at one state again; ``options`` say where library and models are."""
    return shlex.join(["harness", "check", system, "--subject", subject, *options, "--state", json.dumps(dict(state))])


@dataclass(frozen=True, kw_only=True)
class FoundCase:
    """One hard state with what a person needs to go on.

    Attributes:
        found: the state, shrunk.
        expected: the verdict that is expected; as_expected: whether the state is no worse than that.
        replay: shell command; reproducer: program in the engine's own Python API, "" where there is none.
    """

    found: FoundState
    expected: str
    as_expected: bool
    replay: str
    reproducer: str = ""


@dataclass(kw_only=True)
class SearchResult:
    """The result of a search.

    Attributes:
        cases: the worst first; at least one for each subject that answered.
        states, undecided: subject to states tried, and to those of them without certified truth.
        worst: subject to the largest backward error before shrinking; inf for an answer that is not finite.
        failures: subject to why a part of its search gave nothing.
        readings: subject to what its engine's reader makes of a user's file, where that explains its answers.
        crashed: whether an engine's process died or ran out of time.
        place: where what was found would be stored, and not_stored why it was not; "" where it was.
    """

    cases: list[FoundCase] = field(default_factory=list)
    states: dict[str, int] = field(default_factory=dict)
    undecided: dict[str, int] = field(default_factory=dict)
    worst: dict[str, float] = field(default_factory=dict)
    failures: dict[str, str] = field(default_factory=dict)
    readings: dict[str, list[Effect]] = field(default_factory=dict)
    crashed: bool = False
    place: Path
    not_stored: str = "the search has not ended"

    @property
    def status(self) -> int:
        """Exit status: 3 an engine crashed or timed out, 1 something worse than expected or nobody asked, 0 neither."""
        if self.crashed:
            return 3
        return int(bool(self.failures) or not (self.states or self.cases) or not all(case.as_expected for case in self.cases))

    @property
    def sentence(self) -> str:
        """The result in one sentence: who does worse than is expected of it, and how bad the worst is."""
        if not (self.states or self.cases):
            return "no state was tried; name another subject"
        wrong = list(dict.fromkeys(case.found.subject for case in self.cases if not case.as_expected))
        asked = f"{sum(self.states.values()):,} states"
        worst = max(self.worst, key=lambda subject: self.worst[subject], default="")
        size = f"the worst answer, of {worst}, is {error_text(self.worst[worst])} data roundoffs off" if worst else "none was answered"
        if wrong:
            return (
                f"{', '.join(wrong)} {plural(len(wrong), 'does', 'do')} worse than expected; of {asked} {size}, up to {AGREEMENT:g} agree"
            )
        read = [f"; {subject} answers for the file as it reads it: {explanation(one)}" for subject, one in self.readings.items()]
        stops = [f"; {case.found.statement}" for case in self.cases if case.found.term == SOLVER]
        return f"nobody does worse than expected; of {asked} {size}, up to {AGREEMENT:g} agree{''.join([*read, *stops])}"

    def to_json(self) -> dict[str, Any]:
        """Plain data for ``harness.results.plain_json.dumps``."""
        numbers = {name: getattr(self, name) for name in ("states", "undecided", "worst", "failures", "readings", "not_stored")}
        return {"found": self.cases, "stored": not self.not_stored} | numbers


def as_lines(result: SearchResult) -> list[str]:
    """Plain text for the terminal: each case with its state, digits, term, replay and reproducer, then what was stored."""
    unstored = f"not stored: {result.not_stored}; its place is {result.place}"
    return [
        *(line for subject, own in result.readings.items() for line in (f"{subject}: explained", *reading_lines(own), "")),
        *(line for case in result.cases for line in _case_lines(case)),
        *(f"{subject}: {reason}" for subject, reason in result.failures.items()),
        *(_tried(result, subject, count) for subject, count in result.states.items()),
        unstored if result.not_stored else f"stored in {result.place}",
    ]


def _case_lines(case: FoundCase) -> list[str]:
    found = case.found
    expected = "" if case.expected == found.verdict else f", expected {case.expected}"
    error = "no finite answer" if found.backward_error is None else f"{found.backward_error:.3g} data roundoffs"
    return [
        f"{found.subject}: {found.verdict}{expected}: {error}, {found.digits_lost:.1f} digits lost ({found.term})",
        f"  {found.statement}",
        *(f"  {line}" for line in state_and_replay(found.state, case.replay)),
        *([] if case.as_expected else [f"    {line}" for line in case.reproducer.splitlines()]),
        "",
    ]


def _tried(result: SearchResult, subject: str, count: int) -> str:
    without = f", {result.undecided[subject]:,} of them without certified truth" if result.undecided[subject] else ""
    return f"{subject}: {count:,} states tried{without}; the worst had {result.worst[subject]:.3g} data roundoffs"
