"""Findings of engines among the ways of computing accelerations: answers that are wrong, and what the engine says of them itself.

A way is a finding where answers are not finite, or further from their truth than data roundoff explains, and the engine alone can
reproduce it. What it reads as its own residual is compared with what a way that is right reads at the same states.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from harness.arrays import Array
from harness.bench.methods import Method, Prepared
from harness.certify.certified import Certified
from harness.certify.compare import Comparison
from harness.results.benchmark import EngineFinding
from harness.verdict import AGREEMENT, Verdict

# Residuals at the same states tell two ways apart where their medians differ by more than that factor.
TELLING = 2.0


@dataclass(frozen=True)
class Judged:
    """One way of computing accelerations after its answers were compared at states with ``reference``."""

    method: Method
    prepared: Prepared
    reference: Certified
    comparison: Comparison

    @property
    def is_right(self) -> bool:
        """True where every answer agrees."""
        return bool((self.comparison.verdicts == Verdict.AGREES.value).all())


def findings(system: str, judged: Sequence[Judged]) -> list[EngineFinding]:
    """What is wrong among the ways on one system, each with a program that shows it."""
    residuals = {one.method.name: one.prepared.residual() for one in judged if one.prepared.residual is not None}
    right = [residuals[one.method.name] for one in judged if one.is_right and one.method.name in residuals]
    return [finding for one in judged for finding in _of(system, one, residuals.get(one.method.name), right)]


def _of(system: str, one: Judged, residual: Array | None, right: Sequence[Array]) -> Iterator[EngineFinding]:
    if one.prepared.reproducer is None:
        return
    errors = one.comparison.backward_error
    decided = one.reference.certified
    useless, wrong = decided & ~np.isfinite(errors), decided & (errors > AGREEMENT)
    if not (useless.any() or wrong.any()):
        return
    n = int(decided.sum())
    if useless.any():
        index = int(np.flatnonzero(useless)[0])
        statement = f"{int(useless.sum())} of {n} answers are not finite, and no exception says so"
    else:
        index = int(np.argmax(np.where(wrong, errors, -np.inf)))
        relative = one.comparison.relative_error[index]
        far = f"{int(wrong.sum())} of {n} answers are further from their truth than data roundoff explains"
        statement = f"{far}, by up to {errors[index]:.3g} data roundoffs ({relative:.2g} of their size)"
        if residual is not None:
            statement += f"; {_said(residual[decided], [each[decided] for each in right])}"
    yield EngineFinding(
        system=system,
        method=one.method.name,
        statement=statement,
        backward_error=None if useless.any() else float(errors[index]),
        reproducer=one.prepared.reproducer(index, one.reference.high[index]),
    )


def _said(residual: Array, right: Sequence[Array]) -> str:
    """What the engine's own residual says, in words."""
    own = f"the engine's own residual reads {_range(residual)}"
    for other in right:
        low, high = sorted([float(np.median(residual)), float(np.median(other))])
        if high <= TELLING * low:
            return f"{own}, and {_range(other)} where the answers are right"
    return own


def _range(values: Array) -> str:
    return f"{values.min():.3g} to {values.max():.3g}"
