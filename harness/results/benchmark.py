"""The measurements of a benchmark: plain data that the report and the JSON file are made of.

Seconds are per state for accelerations and in all for motion; absolute times compare within one run
only. Errors of accelerations are backward errors [units of data roundoff]; errors of motion are relative
to the size of the motion, and a number that is not finite stands for a run that broke down.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

from harness.results.run import StudyResult
from harness.results.table import Cell, Column, counted

# How energy may wander over a long run, from the best to the worst.
DRIFTS = ("bounded", "random walk", "secular")


@dataclass(frozen=True, kw_only=True)
class AccelerationCost:
    """One way of computing accelerations on one system.

    Attributes:
        system, method: names, as "arm_2r" and "pinocchio aba".
        threads: threads the method was given.
        states: number of states.
        seconds_per_state: median over the repetitions; None where nothing was timed.
        fastest, slowest: extremes over the repetitions [s per state].
        repetitions: how often the batch was timed.
        backward_error, median_backward_error: over the states; None where nothing was compared.
        relative_error: worst over the states, in the kinetic-energy norm; None where nothing was compared.
        from_rigid: median over the states of the relative distance from accelerations that hold constraints rigid, of a method that is
            held against what its engine declares of constraints that give; None for the others.
        note: what the number means where it is no plain cost of a plain answer, or why there is none.
        loop: what went from state to state, as ``Method.loop``.
        failed: whether there is none although the method claims to do the system.
    """

    system: Annotated[str, Column("system")]
    method: Annotated[str, Column("method")]
    threads: Annotated[int, Column("threads", "count")] = 1
    states: Annotated[int, Column("states", "count")]
    seconds_per_state: Annotated[float | None, Column("time per state", "seconds")]
    fastest: Annotated[float | None, Column("fastest", "seconds")] = None
    slowest: Annotated[float | None, Column("slowest", "seconds")] = None
    repetitions: int = 0
    backward_error: Annotated[float | None, Column("worst backward error", "error")] = None
    median_backward_error: Annotated[float | None, Column("median backward error", "error")] = None
    relative_error: Annotated[float | None, Column("worst relative error", "relative")] = None
    from_rigid: Annotated[float | None, Column("distance from rigid", "relative")] = None
    note: Annotated[str, Column("remark")] = ""
    loop: Annotated[str, Column("loop over states")] = ""
    failed: bool = False

    @property
    def timed(self) -> Annotated[str, Column("timed", "plain")]:
        """The repetitions in words."""
        return counted(self.repetitions, "time")


@dataclass(frozen=True, kw_only=True)
class QuantityCost(AccelerationCost):
    """One subject's answers to a quantity beyond accelerations on one system, so many states at once.

    Attributes:
        quantity: its name, as "mass_matrix".
        method: the subject, as "pinocchio/urdf".
        states: number of states that were asked for at once; 0 where there is no cost. Errors are over the same states for each number.
    """

    quantity: Annotated[str, Column("quantity")]
    method: Annotated[str, Column("subject")]
    states: Annotated[int, Column("states at once", "count")]


@dataclass(frozen=True, kw_only=True)
class DerivativeCost:
    """One way of computing derivatives by q and v on one system.

    Attributes:
        system, method: names, as "arm_2r" and "mujoco mjd_inverseFD".
        of: "qdd" or "tau", what is differentiated.
        steps: of finite differences, from the largest on; [] for derivatives without a step.
        errors, worst_errors: relative errors at each step, or one of each; median and worst over the states.
        best_step: the one with the least median; None for derivatives without. error: the median there, None where nothing was computed.
        states: numbers of states that were asked for at once; seconds_per_state: medians over the repetitions, of each.
        loop, note, failed: as of ``AccelerationCost``.
    """

    system: Annotated[str, Column("system")]
    method: Annotated[str, Column("method")]
    of: Annotated[str, Column("of")]
    steps: list[float] = field(default_factory=list)
    errors: list[float] = field(default_factory=list)
    worst_errors: list[float] = field(default_factory=list)
    best_step: Annotated[float | None, Column("best step", "given")] = None
    error: Annotated[float | None, Column("relative error there", "relative")] = None
    states: list[int] = field(default_factory=list)
    seconds_per_state: list[float] = field(default_factory=list)
    loop: Annotated[str, Column("loop over states")] = ""
    note: Annotated[str, Column("remark")] = ""
    failed: bool = False

    @property
    def first_seconds(self) -> Annotated[float | None, Column("time of one state", "seconds")]:
        """Seconds per state for the fewest states at once."""
        return next(iter(self.seconds_per_state), None)

    @property
    def last_seconds(self) -> Annotated[float | None, Column("time per state of most", "seconds")]:
        """Seconds per state for the most states at once."""
        return next(reversed(self.seconds_per_state), None)

    @property
    def most_states(self) -> Annotated[int, Column("most states at once", "count")]:
        """Largest number of states that were asked for at once."""
        return max(self.states, default=0)


@dataclass(frozen=True, kw_only=True)
class Yardstick:
    """The reference computation, timed beside the methods on one system: its fastest call [s], by which costs of two runs compare."""

    system: str
    seconds: float


@dataclass(frozen=True, kw_only=True)
class EngineFinding:
    """Fault of an engine in one way of being asked.

    Attributes:
        system, method: names.
        statement: how many answers are wrong and by how much, and what the engine says of them itself.
        backward_error: the largest [units of data roundoff]; None where answers are not finite.
        reproducer: three lines in the engine's own Python API that print its answer there beside the certified one.
    """

    system: Annotated[str, Column("system")]
    method: Annotated[str, Column("method")]
    statement: Annotated[str, Column("finding")]
    backward_error: float | None = None
    reproducer: str


@dataclass(frozen=True, kw_only=True)
class Growth:
    """Cost and error of one method over the sizes of a family.

    Attributes:
        family, method: names, as "chain" and "pinocchio aba".
        sizes: numbers of bodies; seconds_per_state, backward_errors: at each, None where there is none.
        exponent: slope of log cost over log size where the cost of a call no longer hides it; None where
            there are too few sizes.
        expected: the highest exponent the algorithm allows, as text for the reader: "1", "up to 3".
    """

    family: Annotated[str, Column("family")]
    method: Annotated[str, Column("method")]
    sizes: list[int]
    seconds_per_state: list[float | None]
    backward_errors: list[float | None]
    exponent: Annotated[float | None, Column("exponent", "rounded")]
    expected: str

    @property
    def bodies(self) -> Annotated[str, Column("bodies")]:
        """The sizes in words."""
        return ", ".join(map(str, self.sizes))

    @property
    def theory(self) -> Annotated[str | None, Column("expected", "plain")]:
        """``expected``; None where nothing is."""
        return self.expected or None


@dataclass(frozen=True, kw_only=True)
class MotionTruth:
    """The reference motion of one system.

    Attributes:
        system: its name.
        start: {"q", "v"} of the start; no forces are applied.
        horizon: length of the motion that was asked for [s].
        trusted: how far the reference is trusted [s]; shorter than the horizon where its error passes the bound.
        error: largest relative difference from the second run in higher precision, up to ``trusted``.
        precision: how the two runs differ, in words.
        seconds: cost of the reference.
    """

    system: Annotated[str, Column("system")]
    start: dict[str, list[float]]
    horizon: Annotated[float, Column("length", "given", "s")]
    trusted: Annotated[float, Column("trusted", "figure", "s")]
    error: Annotated[float, Column("error", "error")]
    precision: Annotated[str, Column("the two runs")]
    seconds: Annotated[float, Column("cost", "seconds")]

    @property
    def begins(self) -> Annotated[str, Column("start")]:
        """The start to four digits."""
        return "; ".join(f"{name} = [{', '.join(map('{:.4g}'.format, part))}]" for name, part in self.start.items())


@dataclass(frozen=True, kw_only=True)
class MotionCost:
    """One integrator with one step on one system.

    Attributes:
        system, integrator: names, as "cart_pendulum" and "mujoco RK4".
        step: step [s]; None for an integrator that chooses its own, which has ``tolerance`` instead.
        steps, evaluations: of the whole motion; evaluations of the accelerations.
        seconds: wall time of the whole motion; duration: length of that motion [s], None where it did not run.
        state_error: relative error of the end state.
        energy_error: largest |E0 - E(t) - work of dampers| over the largest kinetic energy.
        gap: largest that a constraint is open along the motion [m or rad]; None without constraints, or where the motion broke down.
        note: why there are no errors, "" where there are.
    """

    system: str
    integrator: Annotated[str, Column("integrator")]
    step: float | None
    tolerance: float | None
    steps: Annotated[int, Column("steps", "count")] = 0
    evaluations: Annotated[int, Column("evaluations", "count")] = 0
    seconds: Annotated[float, Column("time", "seconds")] = 0.0
    state_error: Annotated[float | None, Column("error of the end state", "relative")] = None
    energy_error: Annotated[float | None, Column("error of the energy balance", "relative")] = None
    gap: Annotated[float | None, Column("constraints open by", "error")] = None
    duration: float | None = None
    note: Annotated[str, Column("remark")] = ""

    @property
    def setting(self) -> Annotated[str | None, Column("step or tolerance", "plain")]:
        """The step or the tolerance, as text."""
        if self.step is not None:
            return f"{self.step:g} s"
        return None if self.tolerance is None else f"{self.tolerance:.0e}"

    @property
    def cost(self) -> Annotated[float | None, Column("time per second of motion", "seconds")]:
        """Wall time [s] per second of motion; None where it did not run."""
        return self.seconds / self.duration if self.duration else None


@dataclass(frozen=True, kw_only=True)
class Order:
    """Order of convergence of one integrator on one system.

    Attributes:
        measured: slope of log state error over log step in the asymptotic range; None where there is none.
        expected: what theory says; None for an integrator that has no fixed order.
        verdict: "as expected", "differs", or "no asymptotic range".
        explanation: why it differs or why there is no range; "" where nothing is to be explained.
        steps: the steps [s] the slope was fitted over.
    """

    system: str
    integrator: str
    measured: float | None = None
    expected: float | None
    verdict: str
    explanation: str = ""
    steps: list[float] = field(default_factory=list)

    @property
    def as_expected(self) -> bool:
        """True where the order is that of theory or the difference is explained."""
        return self.verdict != "differs" or bool(self.explanation)


@dataclass(frozen=True, kw_only=True)
class Drift:
    """Energy over a long run of one integrator on one system without dampers.

    Attributes:
        step, steps: of the run [s]; seconds: its cost.
        largest: largest |E - E0| over the largest kinetic energy.
        gap: largest that a constraint is open along the run [m or rad]; None as of ``MotionCost``.
        growth: slope of log energy error over log time: 0 bounded, 1/2 a random walk, 1 secular.
        verdict: "bounded", "random walk" or "secular"; expected: the same, or "" where theory is silent.
    """

    system: Annotated[str, Column("system")]
    integrator: Annotated[str, Column("integrator")]
    step: Annotated[float, Column("step", "given", "s")]
    steps: Annotated[int, Column("steps", "count")]
    seconds: Annotated[float, Column("time", "seconds")]
    largest: Annotated[float, Column("largest error", "relative")]
    growth: Annotated[float | None, Column("grows as time to the", "rounded")]
    verdict: str
    expected: str
    gap: Annotated[float | None, Column("constraints open by", "error")] = None

    @property
    def as_expected(self) -> bool:
        """True where the energy drifts no faster than theory says."""
        return self.expected not in DRIFTS or self.verdict not in DRIFTS or DRIFTS.index(self.verdict) <= DRIFTS.index(self.expected)

    @property
    def energy(self) -> Annotated[Cell, Column("energy is")]:
        """The verdict, marked where it is not as expected."""
        return Cell(self.verdict, tone="" if self.as_expected else "disagrees")

    @property
    def theory(self) -> Annotated[str, Column("expected")]:
        """``expected``; a dash where theory is silent."""
        return self.expected or "-"


@dataclass(frozen=True, kw_only=True)
class Stationarity:
    """Hamilton's principle along one computed path.

    Attributes:
        residual: largest discrete Euler-Lagrange residual along the path, relative to the largest term in it.
        slope: of log |S[q + eps eta] - S[q]| over log eps: 2 for a true path, 1 for a wrong one.
        first_variation: |dS/d eps| at eps = 0, relative to the largest term in it.
    """

    system: Annotated[str, Column("system")]
    path: Annotated[str, Column("path")]
    step: Annotated[float, Column("step", "given", "s")]
    residual: Annotated[float, Column("residual of the discrete Euler-Lagrange equations", "error")]
    slope: Annotated[float | None, Column("S changes as ε to the", "rounded")]
    first_variation: Annotated[float, Column("first variation", "error")]


@dataclass(frozen=True, kw_only=True)
class Figure:
    """A number that a text prints, computed again.

    Attributes:
        what: in words; printed: as the text has it; computed: here; truth: by the reference motion.
        unit: of all of them.
        reproduced: whether the computed number rounds to the printed one.
        remark: what to say where it does not.
    """

    system: Annotated[str, Column("system")]
    what: Annotated[str, Column("what")]
    unit: Annotated[str, Column("unit")]
    printed: Annotated[float, Column("printed", "given")]
    computed: Annotated[float, Column("computed", "figure")]
    truth: Annotated[float, Column("true motion", "figure")]
    reproduced: bool
    remark: Annotated[str, Column("remark")] = ""

    @property
    def as_expected(self) -> bool:
        """True for the printed number, and for another one that a remark explains."""
        return self.reproduced or bool(self.remark)

    @property
    def verdict(self) -> Annotated[Cell, Column("reproduced")]:
        """Yes or no, marked where it is no."""
        if self.reproduced:
            return Cell("yes", tone="agrees")
        return Cell("no", tone="unstable" if self.remark else "disagrees")


@dataclass(frozen=True, kw_only=True)
class Cheapest:
    """The cheapest way to an error on one system.

    Attributes:
        kind: "accelerations" or "motion".
        error: the error asked for; for accelerations a relative one.
        way: the method or integrator with its step; None where none reaches it.
        cost: seconds per state, or per second of motion; fastest: of the repetitions, None for a motion.
    """

    system: str
    kind: str
    error: float
    way: str | None
    cost: float | None
    fastest: float | None = None


@dataclass(kw_only=True)
class Benchmark(StudyResult):
    """Everything one benchmark run measured; ``cheapest`` follows from the rest."""

    STUDY = "benchmark"

    accelerations: list[AccelerationCost] = field(default_factory=list)
    quantities: list[QuantityCost] = field(default_factory=list)
    derivatives: list[DerivativeCost] = field(default_factory=list)
    findings: list[EngineFinding] = field(default_factory=list)
    growth: list[Growth] = field(default_factory=list)
    truths: list[MotionTruth] = field(default_factory=list)
    motion: list[MotionCost] = field(default_factory=list)
    orders: list[Order] = field(default_factory=list)
    drifts: list[Drift] = field(default_factory=list)
    stationarity: list[Stationarity] = field(default_factory=list)
    figures: list[Figure] = field(default_factory=list)
    cheapest: list[Cheapest] = field(default_factory=list, metadata={"derived": True})
    problems: list[str] = field(default_factory=list)
    yardsticks: list[Yardstick] = field(default_factory=list)

    @property
    def unexpected(self) -> list[str]:
        """A sentence for each measurement that contradicts theory or text without an explanation."""
        found = []
        for order in (one for one in self.orders if not one.as_expected):
            measured, expected = ("unknown" if value is None else f"{value:.2f}" for value in (order.measured, order.expected))
            found.append(f"{order.integrator} on {order.system}: order of convergence {measured}, expected {expected}")
        found += [
            f"{drift.integrator} on {drift.system}: energy over a long run is {drift.verdict}, expected {drift.expected}"
            for drift in self.drifts
            if not drift.as_expected
        ]
        found += [
            f"{figure.system}, {figure.what}: printed {figure.printed:g} {figure.unit}, computed {figure.computed:g} {figure.unit}"
            for figure in self.figures
            if not figure.as_expected
        ]
        return found
