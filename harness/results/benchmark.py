"""The measurements of a benchmark: plain data that the report and the JSON file are made of.

Seconds are per state for accelerations and in all for motion; absolute times compare within one run
only. Errors of accelerations are backward errors [units of data roundoff]; errors of motion are relative
to the size of the motion, and a number that is not finite stands for a run that broke down.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from harness.results.study_result import StudyResult

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

    system: str
    method: str
    threads: int = 1
    states: int
    seconds_per_state: float | None
    fastest: float | None = None
    slowest: float | None = None
    repetitions: int = 0
    backward_error: float | None = None
    median_backward_error: float | None = None
    relative_error: float | None = None
    from_rigid: float | None = None
    note: str = ""
    loop: str = ""
    failed: bool = False


@dataclass(frozen=True, kw_only=True)
class QuantityCost(AccelerationCost):
    """One subject's answers to a quantity beyond accelerations on one system, so many states at once.

    Attributes:
        quantity: its name, as "mass_matrix".
        method: the subject, as "pinocchio/urdf".
        states: number of states that were asked for at once; 0 where there is no cost. Errors are over the same states for each number.
    """

    quantity: str


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

    system: str
    method: str
    of: str
    steps: list[float] = field(default_factory=list)
    errors: list[float] = field(default_factory=list)
    worst_errors: list[float] = field(default_factory=list)
    best_step: float | None = None
    error: float | None = None
    states: list[int] = field(default_factory=list)
    seconds_per_state: list[float] = field(default_factory=list)
    loop: str = ""
    note: str = ""
    failed: bool = False


@dataclass(frozen=True, kw_only=True)
class Yardstick:
    """The reference computation, timed beside the methods on one system: its fastest call [s], by which costs of two runs compare."""

    system: str
    seconds: float


@dataclass(frozen=True, kw_only=True)
class EngineFinding:
    """What an engine gets wrong in one way of being asked.

    Attributes:
        system, method: names.
        statement: how many answers are wrong and by how much, and what the engine says of them itself.
        backward_error: the largest [units of data roundoff]; None where answers are not finite.
        reproducer: three lines in the engine's own Python API that print its answer there beside the certified one.
    """

    system: str
    method: str
    statement: str
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

    family: str
    method: str
    sizes: list[int]
    seconds_per_state: list[float | None]
    backward_errors: list[float | None]
    exponent: float | None
    expected: str


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

    system: str
    start: dict[str, list[float]]
    horizon: float
    trusted: float
    error: float
    precision: str
    seconds: float


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
    integrator: str
    step: float | None
    tolerance: float | None
    steps: int = 0
    evaluations: int = 0
    seconds: float = 0.0
    state_error: float | None = None
    energy_error: float | None = None
    gap: float | None = None
    duration: float | None = None
    note: str = ""


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

    system: str
    integrator: str
    step: float
    steps: int
    seconds: float
    largest: float
    growth: float | None
    verdict: str
    expected: str
    gap: float | None = None

    @property
    def as_expected(self) -> bool:
        """True where the energy drifts no faster than theory says."""
        return self.expected not in DRIFTS or self.verdict not in DRIFTS or DRIFTS.index(self.verdict) <= DRIFTS.index(self.expected)


@dataclass(frozen=True, kw_only=True)
class Stationarity:
    """Hamilton's principle along one computed path.

    Attributes:
        residual: largest discrete Euler-Lagrange residual along the path, relative to the largest term in it.
        slope: of log |S[q + eps eta] - S[q]| over log eps: 2 for a true path, 1 for a wrong one.
        first_variation: |dS/d eps| at eps = 0, relative to the largest term in it.
    """

    system: str
    path: str
    step: float
    residual: float
    slope: float | None
    first_variation: float


@dataclass(frozen=True, kw_only=True)
class Figure:
    """A number that a text prints, computed again.

    Attributes:
        what: in words; printed: as the text has it; computed: here; truth: by the reference motion.
        unit: of all of them.
        reproduced: whether the computed number rounds to the printed one.
        remark: what to say where it does not.
    """

    system: str
    what: str
    unit: str
    printed: float
    computed: float
    truth: float
    reproduced: bool
    remark: str = ""

    @property
    def as_expected(self) -> bool:
        """True for the printed number, and for another one that a remark explains."""
        return self.reproduced or bool(self.remark)


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
