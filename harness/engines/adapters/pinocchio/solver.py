"""Pinocchio's algorithms for constraints as data, which whoever compares them chooses from; see ``constraints``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal


@dataclass(frozen=True)
class Solver:
    """One of Pinocchio's algorithms for constraints, and what it is told.

    Attributes:
        algorithm: the function of ``pinocchio``. ``lcaba`` wants a mu above 0.
        mu: proximal parameter; None for a call without settings, which ``lcaba`` does not take.
        iterations: at most so many. accuracy: residual at which they end; with 0, where it no longer changes.
    """

    algorithm: Literal["constraintDynamics", "lcaba"] = "constraintDynamics"
    mu: float | None = 1e-12
    iterations: int = 100
    accuracy: float = 0.0

    def settings(self) -> tuple[Any, ...]:
        """The last arguments of the call, into which the algorithm writes its counts and residuals."""
        import pinocchio

        return () if self.mu is None else (pinocchio.ProximalSettings(self.accuracy, self.mu, self.iterations),)

    @property
    def told(self) -> str:
        """The settings in words."""
        if self.mu is None:
            return "mu = 0, one iteration"
        return f"mu = {self.mu:g}, accuracy {self.accuracy:g}, up to {self.iterations} iterations"

    def written(self) -> tuple[str, str]:
        """Python text: a statement that readies the data ``d``, and the call."""
        last = "" if self.mu is None else f", pin.ProximalSettings({self.accuracy}, {self.mu}, {self.iterations})"
        ready = "computeJointMinimalOrdering(m, d, cs)" if self.algorithm == "lcaba" else "initConstraintDynamics(m, d, cs, cd)"
        return f"pin.{ready}", f"pin.{self.algorithm}(m, d, q, v, tau, cs, cd{last})"


ACCURATE = Solver()
