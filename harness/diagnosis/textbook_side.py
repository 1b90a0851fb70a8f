"""The textbook's side of a diagnosis: the one parameter of the system whose other value explains a subject's answers.

The subject behaves as if the textbook had this value. The reference at other values is certified like the reference itself,
without a new derivation; its derivatives are those of the data roundoff.

Source: Khalil, Dombre, Modeling, Identification and Control of Robots (2002), chapter 12.
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np

from harness.arrays import Array
from harness.certify.parameter_columns import parameter_derivatives
from harness.certify.reference import Reference, ReferenceKernel
from harness.crosscheck.perturbation import Column, Whitening
from harness.diagnosis.hypotheses import Candidate
from harness.diagnosis.result import PARAMETER, Diagnosis, TriedChange, to_four_digits
from harness.diagnosis.search import Search, Tried
from harness.equations.mechanism import Mechanism
from harness.equations.states import States
from harness.models.text import Place
from harness.verdict import AGREEMENT

# Instructions of the equations that all certified evaluations of a diagnosis may have together, and the bounds of their number.
INSTRUCTIONS, LEAST_EVALUATIONS, MOST_EVALUATIONS = 200_000, 50, 600
# Noise of the direction of an exact column.
ROUNDING = 1e-7


def textbook_evaluations(mechanism: Mechanism) -> int:
    """Certified evaluations that the diagnosis of a mechanism takes at most: fewer for longer equations."""
    return max(LEAST_EVALUATIONS, min(MOST_EVALUATIONS, INSTRUCTIONS // len(mechanism.program.instructions)))


def diagnose_textbook(
    kernel: ReferenceKernel,
    states: States,
    accelerations: Array,
    file: Path,
    *,
    evaluations: int | None = None,
    tolerance: float = AGREEMENT,
    factorises: bool = False,
    parameters: int | None = None,
) -> Diagnosis:
    """Find the one parameter of the textbook that a subject seems to have another value of.

    Args:
        kernel: certified accelerations of the system, in the subject's frames.
        states: n of them; every third is held out of fits. See ``harness.crosscheck.perturbation.diagnostic_states``.
        accelerations: the subject's answers, (n, nv) [SI per s^2]. file: of the system, to be named.
        evaluations: of the certified reference, after which the best so far is reported; ``textbook_evaluations`` by default.
        tolerance, factorises: as for ``harness.diagnosis.model_side.diagnose``.
        parameters: how many of the kernel's are the textbook's; those behind them are of the subject's file. All for None.
    """
    evaluations = textbook_evaluations(kernel.mechanism) if evaluations is None else evaluations
    search = _TextbookSearch(kernel, states, accelerations, tolerance, evaluations, factorises)
    if search.is_needed:
        candidates = [_candidate(kernel, file, number) for number in range(len(kernel.mechanism.parameters))[:parameters]]
        columns = [Column(candidate, values, ROUNDING) for candidate, values in zip(candidates, search.columns(), strict=False)]
        search.fit_best([column for column in columns if column.norm > 0])
        search.fit_from_other_starts(candidates)
    return search.diagnosis(file, partial(_tried_change, kernel))


def _candidate(kernel: ReferenceKernel, file: Path, number: int) -> Candidate:
    """Another value of one parameter; its text holds the values of all, exactly."""
    name, own, _ = kernel.mechanism.parameters[number]
    values = list(kernel.mechanism.parameter_values)
    place = Place(_line(file, name), PARAMETER, name, None, repr(own))

    def text(value: float) -> str:
        return json.dumps([*values[:number], value, *values[number + 1 :]])

    return Candidate(PARAMETER, "", place, text, values[number], abs(values[number]) or 1.0)


class _TextbookSearch(Search[Reference]):
    """Texts of parameter values are evaluated to the reference that has them."""

    def __init__(
        self, kernel: ReferenceKernel, states: States, accelerations: Array, tolerance: float, evaluations: int, factorises: bool
    ) -> None:
        super().__init__(kernel.evaluate(states), accelerations, tolerance, evaluations, factorises)
        self._kernel, self._states = kernel, states
        self._names = [name for name, _, _ in kernel.mechanism.parameters]

    def evaluate(self, text: str) -> Reference | None:
        reference = self._kernel.evaluate(self._states, self._for_all(json.loads(text)))
        return reference if reference.certified[self.certified].all() else None

    def residual_of(self, evaluated: Reference) -> Array:
        # In the measure of the unchanged reference: where one term acts alone, its own roundoff shrinks with it.
        with np.errstate(all="ignore"):
            return self.whitening.change((self.accelerations - evaluated.high) - evaluated.low)

    def left_of(self, evaluated: Reference) -> float:
        return self.largest(Whitening(evaluated).residual(self.accelerations))

    def slope(self, candidate: Candidate, value: float) -> Array | None:
        text = candidate.text(value)
        reference = self.evaluated(text)
        if reference is None:
            return None
        return np.asarray(self._slopes(reference, json.loads(text))[self._names.index(candidate.place.attribute), self.seen])

    def columns(self) -> Array:
        """Slopes at the textbook's own values, (parameters, n, nv)."""
        return self._slopes(self.reference, self._kernel.mechanism.parameter_values)

    def _for_all(self, values: Sequence[float]) -> Array:
        return np.broadcast_to(np.array(values, dtype=np.float64), (len(self._states), len(values)))

    def _slopes(self, reference: Reference, values: Sequence[float]) -> Array:
        """Derivatives of the whitened residual by each parameter p, (parameters, n, nv), 0 at states that fits do not see.

        They are -M^-1 d(force - M qdd)/dp in the measure of the unchanged reference, M = R^T R of ``reference``.
        """
        slopes = -parameter_derivatives(self._kernel, self._states, reference, values)
        found = np.array([self.whitening.change(column) for column in slopes])
        found[:, ~self.seen] = 0.0
        return np.where(np.isfinite(found), found, 0.0)


def _tried_change(kernel: ReferenceKernel, tried: Tried) -> TriedChange:
    place, value = tried.candidate.place, tried.value
    assert value is not None
    _, own, unit = next(parameter for parameter in kernel.mechanism.parameters if parameter[0] == place.attribute)
    value = value if tried.explains else to_four_digits(value, own)
    found, shown = f"{place.attribute} = {own!r} {unit}".strip(), f"{value!r} {unit}".strip()
    return TriedChange(PARAMETER, "", place, value, found, shown, tried.left, tried.explains)


def _line(file: Path, name: str) -> int:
    """The line that gives the parameter its value, or where the values of all begin; 1 where neither is found."""
    try:
        lines = file.read_text(encoding="utf-8").splitlines()
    except OSError:
        return 1
    patterns = rf"\s*{re.escape(name)}\s*:\s*\(", r"\s*parameters\s*="
    return next((number for pattern in patterns for number, line in enumerate(lines, 1) if re.match(pattern, line)), 1)
