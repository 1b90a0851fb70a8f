"""The measurements of motions in a benchmark: references, integrators, energy over long runs, and numbers that texts print.

Seconds are of a whole motion. Errors are relative to the size of the motion, and a number that is not finite stands for a run that broke
down.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

from harness.results.table import Cell, Column

# How energy may wander over a long run, from the best to the worst.
DRIFTS = ("bounded", "random walk", "secular")


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
