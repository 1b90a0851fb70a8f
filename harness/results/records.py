"""Records of what was compared, as plain data: one ``Record`` is one (system, subject) pair of one run."""

from __future__ import annotations

import math
from collections import UserList
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from typing import Annotated

from harness.results.detail import Detail
from harness.results.readings import MOST_IN_CELL, Effect, do_depart, explanation, reading_lines, share_text
from harness.results.table import Cell, Column, Table, TableOf, grouped, printable
from harness.verdict import AGREEMENT, DECLARED, DEPARTS, SOFT, SOUND, Verdict, is_soft

# Of a record that names none.
ACCELERATIONS = "accelerations"


def quantity_words(quantity: str) -> list[str]:
    """The name of a quantity, none for the one that is meant where none is named."""
    return [] if quantity == ACCELERATIONS else [quantity]


def quantity_options(quantity: str) -> list[str]:
    """The option of a command that asks for a quantity; none where it is asked for anyway."""
    return [word for name in quantity_words(quantity) for word in ("--quantity", name)]


_VERDICTS = [verdict.value for verdict in Verdict]


@dataclass(frozen=True, kw_only=True)
class Representative:
    """A state that shows a verdict better than the worst one: the simplest that was found, or the one at which a process died.

    Attributes:
        state: {"q": (nq,), "v": (nv,), "tau": (nv,)}.
        backward_error: there [units of data roundoff]; None where there is none.
        replay: shell command that computes it again.
        is_alone: whether the state with the worst backward error has a milder verdict.
    """

    state: dict[str, list[float]]
    backward_error: float | None
    replay: str = ""
    is_alone: bool = False


@dataclass(frozen=True, kw_only=True)
class Record:
    """The outcome of one subject on one system.

    Attributes:
        system, subject: names, as "arm_2r" and "mujoco/mjcf".
        states: number of states compared.
        verdict, expected: values of ``Verdict``; ``expected`` is "agrees" unless a file lists another.
        backward_error: worst over the states [units of data roundoff]; may be inf; None where nothing
            was compared.
        relative_error: at the worst state; for the reader only. None where it says nothing, as beside an answer of about zero.
        worst_state: {"q": (nq,), "v": (nv,), "tau": (nv,)} of the state with the worst backward error.
        seconds_per_state: cost of the subject, the median of repeated calls; fastest_seconds_per_state: of the fastest.
        message: plain sentences, as what an engine raised; "" where there is nothing to say.
        failed: whether the engine, or what runs it, failed: an exception, a death, or answers that contradict each other. A file that
            is refused is no such failure.
        median_backward_error, percentile_99_backward_error: over the sampled states, which no search has chosen [units of data
            roundoff]; over all where none is sampled.
        share: of those states, how many do not agree, from 0 to 1.
        distribution: ``half_decade`` of a backward error to number of states.
        verdict_counts: verdict to number of states.
        expected_backward_error, expected_median_backward_error, expected_share: the largest backward error, median and share of
            unstable states that go with the expected verdict.
        expected_reason, expected_link: why another verdict than "agrees" is expected.
        replay: shell command that computes the worst state again.
        representative: another state that shows the verdict; None where the worst one does.
        componentwise_error: componentwise backward error at the worst state, see ``harness.truth.componentwise``; None where
            it is certainly not beyond ``AGREEMENT`` and was not asked for, and where it is not known.
        granted: number of states that agree only with the share of motion and weight, see ``harness.truth.reference``.
        in_balls: number of states whose truth double-double could not decide, and ball arithmetic did.
        quantity: what was compared.
        median_bounds, percentile_99_bounds: errors of the same sample between which those of all states lie but for one run in 400;
            see ``harness.results.quantiles``. Empty where a sample is too small for them.
        origins: number of states that are "stored" with the system, "sampled", "searched" for, and the "simplest" failing ones
            of this run and of earlier ones, which come on top; empty for a given state.
        features: what the subject's model file and the mechanism ask of an engine beyond hinges and slides, as "loops" or "springs".
        from_rigid: median over the states of the relative distance from accelerations that hold constraints rigid, of a subject that is
            held against what its engine declares of constraints that give; None for the others.
        readings: what the engine's reader makes of a user's file, by effect, where the answer is not that of the file.
        stance: how the engine was asked about a user's file, "plain" or "aided"; "" for a mechanism.
        rest: sentences on what that leaves of a user's file, or on why the engine refuses it.
        unequal_worlds: largest difference of answers of equal worlds, in one run, of two and of one world by itself, relative; None where
            that was not asked.

    Raises:
        ValueError: ``verdict`` or ``expected`` is no verdict.
    """

    system: Annotated[str, Column("system")]
    subject: Annotated[str, Column("subject")]
    states: Annotated[int, Column("states", "count")]
    verdict: str
    expected: Annotated[str, Column("expected")]
    backward_error: Annotated[float | None, Column("worst backward error", "error")]
    relative_error: Annotated[float | None, Column("relative error there", "relative")]
    worst_state: dict[str, list[float]] | None
    seconds_per_state: Annotated[float | None, Column("time per state", "seconds")]
    message: str
    median_backward_error: Annotated[float | None, Column("median backward error", "error")] = None
    distribution: dict[str, int] = field(default_factory=dict)
    verdict_counts: dict[str, int] = field(default_factory=dict)
    expected_backward_error: float = math.inf
    expected_reason: str = ""
    expected_link: str = ""
    replay: str = ""
    representative: Representative | None = None
    origins: dict[str, int] = field(default_factory=dict)
    granted: int = 0
    in_balls: int = 0
    fastest_seconds_per_state: Annotated[float | None, Column("fastest", "seconds")] = None
    componentwise_error: Annotated[float | None, Column("componentwise there", "error")] = None
    percentile_99_backward_error: Annotated[float | None, Column("99 % backward error", "error")] = None
    share: float = 0.0
    expected_median_backward_error: float = math.inf
    expected_share: float = 1.0
    failed: bool = False
    quantity: Annotated[str, Column("quantity")] = ACCELERATIONS
    median_bounds: list[float] = field(default_factory=list)
    percentile_99_bounds: list[float] = field(default_factory=list)
    features: list[str] = field(default_factory=list)
    from_rigid: float | None = None
    readings: list[Effect] = field(default_factory=list)
    rest: list[str] = field(default_factory=list)
    stance: str = ""
    unequal_worlds: float | None = None

    def __post_init__(self) -> None:
        for verdict in (self.verdict, self.expected):
            if verdict not in _VERDICTS:
                raise ValueError(f"{verdict!r} is no verdict; expected one of {', '.join(_VERDICTS)}")

    @property
    def asked(self) -> str:
        """The subject, and the quantity where it is not the usual one, for a reader."""
        return ", ".join([self.subject, *quantity_words(self.quantity)])

    @property
    def series(self) -> str:
        """The subject, and the quantity where it is not the usual one, by which trends and nights know it."""
        return " ".join([self.subject, *quantity_words(self.quantity)])

    @property
    def title(self) -> str:
        """System and subject, and the quantity where it is not the usual one."""
        return f"{self.system} {self.series}"

    @property
    def is_further(self) -> bool:
        """True for another quantity than accelerations."""
        return bool(quantity_words(self.quantity))

    @property
    def is_asked(self) -> bool:
        """False for another quantity than accelerations that the engine does not claim to compute."""
        return self.verdict != Verdict.UNSUPPORTED or not self.is_further or bool(self.expected_link) or not self.as_expected

    @property
    def as_expected(self) -> bool:
        """True for the expected verdict with no larger errors than the expectation explains."""
        return self.verdict == self.expected and not self.beyond

    @property
    def outcome(self) -> str:
        """The verdict, or ``SOFT`` where constraints give as the engine documents, and ``DEPARTS`` where they do otherwise."""
        if self.verdict == Verdict.EXPLAINED and do_depart(self.readings):
            return DEPARTS
        return SOFT if is_soft(self.verdict, self.from_rigid) else self.verdict

    @property
    def tone(self) -> str:
        """The class of the style sheet for the outcome."""
        return DECLARED if self.outcome == SOFT else self.verdict

    @property
    def is_noteworthy(self) -> bool:
        """True where there is more to say than that it agrees, or that nobody claims to compute it."""
        return not self.as_expected or self.verdict not in (Verdict.AGREES, Verdict.UNSUPPORTED)

    @property
    def beyond(self) -> list[str]:
        """A phrase for each number that is larger than the expectation explains."""
        bounds = (
            ("worst backward error", self.backward_error, self.expected_backward_error),
            ("median backward error", self.median_backward_error, self.expected_median_backward_error),
            ("share of states that do not agree", self.share, self.expected_share),
        )
        return [f"{name} {found:.3g}, expected up to {most:g}" for name, found, most in bounds if (found or 0.0) > most]

    @property
    def explanation(self) -> str:
        """Verdict, message, states and replay commands, a line each: what a person needs to go on from an unexpected record."""
        error, componentwise, simplest = self.backward_error, self.componentwise_error, []
        if (shown := self.representative) is not None:
            size = "no backward error" if shown.backward_error is None else f"backward error {shown.backward_error:.3g} data roundoffs"
            simplest = [f"the simplest state that shows it: {size}", *state_and_replay(shown.state, shown.replay)]
        over, moves = (
            f"over {self.states:,} states; up to {AGREEMENT:g} agrees",
            "every input and answer moves by that many times 2^-53 of itself",
        )
        lines = [
            f"{self.title}: {self.verdict}, expected {self.expected}",
            "" if error is None else f"worst backward error {error:.3g} data roundoffs {over}",
            "" if componentwise is None else f"componentwise {componentwise:.3g} there: {moves}",
            *self.beyond,
            f"expected because {self.expected_reason} ({self.expected_link})" if self.expected_reason else "",
            "remove or mend the entry in expected_verdicts.toml if that is past" if self.expected_reason else "",
            self.message,
            *(reading_lines(self.readings) if self.verdict != Verdict.DISAGREES else []),
            *state_and_replay(self.worst_state, self.replay),
            *simplest,
        ]
        return "\n  ".join(map(printable, filter(None, lines)))

    @property
    def marked_verdict(self) -> Annotated[Cell, Column("verdict")]:
        """The verdict, and the expected one where it is another; with how far constraints that give are from rigid ones."""
        if self.as_expected:
            text = self.outcome if self.verdict in SOUND else f"{self.verdict} (as expected)"
            far = f"{share_text(self.from_rigid)} from rigid" if self.outcome == SOFT else ""
            text = ": ".join(filter(None, [text, far or explanation(self.readings, MOST_IN_CELL)]))
            return Cell(text, tone=f"{self.tone} expected")
        return Cell(f"{self.verdict} (expected {self.expected})", tone=f"{self.verdict} surprise")

    @property
    def counts(self) -> Annotated[str, Column("states by verdict")]:
        """The counts of verdicts in words."""
        return ", ".join(f"{name} {count}" for name, count in sorted(self.verdict_counts.items()))


_TABLE = TableOf(
    Record,
    "system subject quantity states marked_verdict expected backward_error componentwise_error median_backward_error "
    "percentile_99_backward_error relative_error seconds_per_state fastest_seconds_per_state counts",
)


def state_and_replay(state: Mapping[str, list[float]] | None, replay: str) -> list[str]:
    """A state and the command that computes it again, a line each."""
    lines = [] if state is None else ["at " + ", ".join(f"{name} = {values}" for name, values in state.items())]
    return [*lines, f"replay: {replay}"] if replay else lines


class Records(UserList[Record]):
    """The records of a run, by system and subject; a table on a terminal and in a notebook."""

    def __init__(self, records: Iterable[Record] = ()) -> None:
        super().__init__(sorted(records, key=lambda record: (record.system, record.subject, record.quantity)))

    @property
    def unexpected(self) -> Records:
        """Those whose verdict is not the expected one."""
        return Records(record for record in self if not record.as_expected)

    @property
    def origins(self) -> str:
        """Origins of the states in a sentence over all records; "" where none says."""
        known = [record.origins for record in self if any(record.origins.values())]
        if not known:
            return ""
        names = ("sampled", "searched", "stored", "simplest")
        sampled, searched, stored, simplest = (_range([origins.get(name, 0) for origins in known]) for name in names)
        on_top = f"; on top {stored} stored with the system, {simplest} simplest failing ones of this run and earlier ones"
        return f"states: {sampled} sampled, {searched} searched for by hypothesis{on_top}"

    def table(self) -> Table:
        """One row per record; the quantity has a column where it is not the usual one in all of them."""
        several = any(record.is_further for record in self)
        table = _TABLE(self)
        return table if several else table.without("quantity")

    def brief(self, detail: Detail = Detail.BRIEF) -> Table:
        """The columns that fit a terminal; the fastest call is one where all is told."""
        compared = [record for record in self if record.backward_error is not None]
        unknown = () if compared and all(record.componentwise_error is not None for record in compared) else ("componentwise there",)
        fastest = () if detail == Detail.VERBOSE else ("fastest",)
        return self.table().without("expected", "median backward error", "99 % backward error", "states by verdict", *unknown, *fastest)

    @property
    def remarks(self) -> list[str]:
        """Lines on each unexpected record, and on what there is to say of one that is as expected although it was compared."""
        lines = [line for record in self.unexpected for line in ("", *record.explanation.split("\n"))]
        told = [one for one in self if one.as_expected and one.states and (one.message or one.readings)]
        # Quantities that are explained by the same readings are told together.
        alike = grouped(((one.system, one.subject, one.message or one.verdict, *reading_lines(one.readings)), one) for one in told)
        for (system, subject, said, *readings), own in alike.items():
            title = own[0].title if len(own) == 1 else f"{system} {subject}, {len(own)} quantities"
            lines += ["", f"{title}: {said}", *(f"  {line}" for line in readings)]
        return lines

    def __str__(self) -> str:
        return "\n".join([str(self.brief()), *self.remarks])

    __repr__ = __str__

    def _repr_html_(self) -> str:
        remarks = escape("\n".join(self.remarks).strip())
        return self.brief().html() + (f'<pre style="white-space: pre-wrap">{remarks}</pre>' if remarks else "")


def _range(counts: Sequence[int]) -> str:
    low, high = min(counts), max(counts)
    return f"{low:,}" if low == high else f"{low:,} to {high:,}"
