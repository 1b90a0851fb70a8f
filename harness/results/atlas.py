"""The measurements of an atlas of hard cases: plain data that the report and the JSON file are made of.

Errors are in the kinetic-energy norm. A number that is None was not measured, and ``reason`` says why.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import Annotated

from harness.results.records import ACCELERATIONS, quantity_words
from harness.results.rigid import RigidDistance
from harness.results.run import StudyResult
from harness.results.table import Cell, Column


@dataclass(frozen=True, kw_only=True)
class HardPoint:
    """One subject at one value of a knob; the worst of its states.

    Attributes:
        knob: the value; system: name of the system.
        verdict: the gravest of the states; "unsupported" where the engine refuses the model.
        backward_error: largest over the states [units of data roundoff].
        digits_lost: log10 of the largest forward relative error over the unit roundoff; 0 for a smaller error.
        condition: largest kappa_s, the condition number of M scaled to unit diagonal.
        unstable_bound: backward error up to which the verdict of the worst state is "unstable" [data roundoffs].
        certified: how many of the states are; states: of how many.
        bits: largest precision that was needed; in_balls: at how many states double-double was not enough.
        reason: the engine's words where it refuses or fails, and why a state is undecided.
        state: the worst one, {"q", "v", "tau"}.
    """

    knob: float
    system: str
    verdict: str
    backward_error: float | None = None
    digits_lost: float | None = None
    condition: float | None = None
    unstable_bound: float | None = None
    certified: int = 0
    states: int = 0
    bits: int = 0
    in_balls: int = 0
    reason: str = ""
    state: dict[str, list[float]] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class HardReason:
    """The reason of a verdict that is expected along a family.

    Attributes:
        verdict: value of ``Verdict``; reason: the step of the algorithm that loses the digits.
        remedy: what a user can do; link: where that is from.
    """

    verdict: str
    reason: str
    remedy: str
    link: str


@dataclass(frozen=True, kw_only=True)
class HardRow:
    """One subject along one family.

    Attributes:
        case, title, subject: names.
        knob, unit: what is turned.
        points: in the order of the knob.
        verdict: the gravest of the points; a refused point counts as "unsupported", one not certified as "undecided".
        growth: slope of log backward error over log knob where it is above the floor; None where there is none.
        digits_growth: the same of the forward error.
        theory_verdict, theory_growth, theory_digits_growth: what theory expects; source: where that is from.
        remedy: what a user can do.
        problems: what is not as expected, in words; none where every verdict is expected.
        reasons: why each verdict that is expected is.
        crashed: whether the engine's process died or ran out of time.
        seconds: wall time of the whole row.
        quantity: what the subject was asked for.
    """

    case: str
    title: str
    subject: Annotated[str, Column("subject")]
    knob: str
    unit: str
    points: list[HardPoint]
    verdict: str
    growth: Annotated[float | None, Column("slope", "rounded")] = None
    digits_growth: Annotated[float | None, Column("slope of digits", "rounded")] = None
    theory_verdict: str = "agrees"
    theory_growth: float | None = None
    theory_digits_growth: float | None = None
    source: str = ""
    remedy: str = ""
    problems: list[str] = field(default_factory=list)
    reasons: list[HardReason] = field(default_factory=list)
    crashed: bool = False
    seconds: Annotated[float, Column("time", "seconds")] = 0.0
    quantity: str = ACCELERATIONS

    @property
    def family(self) -> Annotated[str, Column("family")]:
        """The case, and the quantity where it is not the usual one."""
        return ", ".join([self.case, *quantity_words(self.quantity)])

    @property
    def as_expected(self) -> bool:
        """True where every verdict along the family is agreement or an expected other one."""
        return not self.problems

    @property
    def verdicts(self) -> dict[str, int]:
        """Number of points by verdict."""
        return dict(Counter(point.verdict for point in self.points))

    @property
    def share_in_balls(self) -> float:
        """Share of the states of all points that needed ball arithmetic."""
        return sum(point.in_balls for point in self.points) / max(1, sum(point.states for point in self.points))

    @property
    def worst(self) -> Annotated[float | None, Column("largest backward error", "error")]:
        """Largest backward error along the family."""
        return max((point.backward_error for point in self.points if point.backward_error is not None), default=None)

    @property
    def marked_verdict(self) -> Annotated[Cell, Column("verdict")]:
        """The verdict, marked where it is not as expected."""
        return Cell(self.verdict, tone=f"{self.verdict} {'expected' if self.as_expected else 'surprise'}")

    @property
    def digits_lost(self) -> Annotated[float | None, Column("digits lost", "error")]:
        """Most digits lost along the family."""
        return max((point.digits_lost for point in self.points if point.digits_lost is not None), default=None)

    @property
    def condition(self) -> Annotated[float | None, Column("kappa_s", "error")]:
        """Largest condition number along the family."""
        return max((point.condition for point in self.points if point.condition is not None), default=None)

    @property
    def theory(self) -> Annotated[str, Column("theory")]:
        """The expectation of theory in words."""
        slopes = [(self.theory_growth, "slope"), (self.theory_digits_growth, "of digits")]
        return ", ".join([self.theory_verdict, *(f"{what} {slope:g}" for slope, what in slopes if slope is not None)])

    @property
    def counts(self) -> Annotated[str, Column("points")]:
        """The points of each verdict in words."""
        counts = ", ".join(f"{verdict} {count}" for verdict, count in sorted(self.verdicts.items()))
        return counts if self.as_expected else f"{counts} (not as expected)"

    @property
    def balls(self) -> Annotated[str, Column("truth in balls")]:
        """``share_in_balls`` in percent."""
        return f"{100 * self.share_in_balls:.0f} %"


@dataclass(frozen=True, kw_only=True)
class Parting:
    """The growth of one integrator's distance from a baseline motion, from one start.

    Attributes:
        motion, system, integrator: names.
        knob: the value that chose the start.
        rate: slope of log distance over time while it is small [1/s]; None where it does not grow through that range.
        expected_rate: the same by theory, or of a motion whose start is one unit roundoff off.
        parted: when the distance reaches a tenth of the motion [s]; None where it does not.
        earliest: when a motion parts whose start is as far off as an answer that agrees may be [s].
        largest: largest distance, relative to the motion.
        verdict: "agrees", or "disagrees" where it parts sooner than that.
    """

    motion: str
    system: str
    integrator: str
    knob: float
    rate: float | None
    expected_rate: float | None
    parted: float | None
    earliest: float | None
    largest: float
    verdict: str


@dataclass(frozen=True, kw_only=True)
class StableStep:
    """The largest stable step of one integrator on an undamped oscillator.

    Attributes:
        case, system, integrator: names.
        knob: the value that chose the oscillator; frequency: its angular frequency [rad/s].
        measured: the step times the frequency; infinite where every step that was tried is stable.
        expected: by theory.
        verdict: "agrees", or "disagrees" beyond the resolution of the search.
    """

    case: str
    system: str
    integrator: str
    knob: float
    frequency: float
    measured: float
    expected: float
    verdict: str


@dataclass(kw_only=True)
class Atlas(StudyResult):
    """Everything one run along the hard cases measured.

    Attributes:
        problems: sentences on motions that could not be measured.
    """

    STUDY = "atlas"

    rows: list[HardRow] = field(default_factory=list)
    partings: list[Parting] = field(default_factory=list)
    stable_steps: list[StableStep] = field(default_factory=list)
    distances: list[RigidDistance] = field(default_factory=list)
    problems: list[str] = field(default_factory=list)

    @property
    def unexpected(self) -> list[str]:
        """A sentence for each thing that is not as expected."""
        found = [f"{row.family}, {row.subject}: {problem}" for row in self.rows for problem in row.problems]
        found += [
            f"{one.motion}, {one.integrator} from {one.knob:g}: parts after {one.parted:g} s, sooner than {_seconds(one.earliest)}"
            for one in self.partings
            if one.verdict != "agrees" and one.parted is not None
        ]
        found += [
            f"{one.integrator}, {one.frequency:g} rad/s: stable up to {one.measured:.4g} over the frequency, expected {one.expected:.4g}"
            for one in self.stable_steps
            if one.verdict != "agrees"
        ]
        return found


def _seconds(time: float | None) -> str:
    return "a motion from a nudged start, which never does" if time is None else f"{time:g} s"
