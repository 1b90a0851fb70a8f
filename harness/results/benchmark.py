"""The measurements of a benchmark: plain data that the report and the JSON file are made of.

Seconds are per state; absolute times compare within one run only. Errors are backward errors [units of data roundoff].
``harness.results.motion_benchmark`` has those of motions.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

from harness.results.motion_benchmark import Drift, Figure, MotionCost, MotionTruth, Order, Stationarity
from harness.results.run import StudyResult
from harness.results.table import Column, counted


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
class SolverCost:
    """One way of solving for constraints by an engine, on one robot's file with all on that is judged.

    Attributes:
        system: the file. engine: its name.
        method: of the solver, by the engine's name; "" for the one that the file chooses.
        iterations: at most, with a tolerance of 0, so that it goes on so long or until nothing changes; None for those and the tolerance of
            the file.
        states, touching: number of states, and of those at which bodies touch.
        seconds_per_state: median over the states of what the engine's own call took [s]; None where nothing was timed or asked.
        backward_error, median_backward_error, relative_error, median_relative_error: distances from the optimum that the engine documents.
        right: number of states whose answer agrees with it.
        note: why there are none.
    """

    system: Annotated[str, Column("file")]
    engine: Annotated[str, Column("engine")]
    method: str = ""
    iterations: int | None = None
    states: Annotated[int, Column("states", "count")] = 0
    touching: Annotated[int, Column("where bodies touch", "count")] = 0
    seconds_per_state: Annotated[float | None, Column("time per state", "seconds")] = None
    backward_error: Annotated[float | None, Column("worst backward error", "error")] = None
    median_backward_error: Annotated[float | None, Column("median backward error", "error")] = None
    relative_error: Annotated[float | None, Column("worst relative error", "relative")] = None
    median_relative_error: Annotated[float | None, Column("median relative error", "relative")] = None
    right: Annotated[int, Column("states to the last digit", "count")] = 0
    note: Annotated[str, Column("remark")] = ""

    @property
    def solver(self) -> Annotated[str, Column("solver")]:
        """The method and its iterations in words."""
        own = "as the file says" if self.iterations is None else f"at most {counted(self.iterations, 'iteration')}"
        return f"{self.method}, {own}" if self.method else own

    @property
    def is_right(self) -> bool:
        """True where every answer agrees."""
        return 0 < self.right == self.states


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
    solvers: list[SolverCost] = field(default_factory=list)
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
