"""The textbook side of a diagnosis: the one parameter of the system whose other value explains a subject's answers.

The subject behaves as if the textbook had this value. The reference at other values is certified like the
reference itself, without a new derivation; its derivatives are those that the data roundoff is made of.

Source: Khalil, Dombre, Modeling, Identification and Control of Robots (2002), chapter 12.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from harness.arrays import Array
from harness.certify.compare import compare
from harness.certify.reference import Reference, ReferenceKernel
from harness.diagnose.fit import Deadline, fit, settled
from harness.diagnose.perturbation import Whitening, backward_errors, held_out
from harness.diagnose.result import PARAMETER, Diagnosis, Explanation, Finding, digits_of, to_four_digits
from harness.diagnose.screening import fit_in_order, screen
from harness.equations.mechanism import Mechanism
from harness.equations.states import States
from harness.models.text import Place
from harness.verdict import AGREEMENT, Verdict

# Of the time, what the search may take; the rest is for telling.
SHARE_OF_TIME = 0.85
# So many of the best are fitted once more from these multiples of their values.
FITTED_FROM_OTHER_STARTS, OTHER_STARTS = 8, (0.0, 0.5, 2.0, -1.0)
# Relative size of a value that may be a rounded zero.
ALL_BUT_ZERO = 1e-6
# By which the cosine of parallel columns differs from 1.
ROUNDING = 1e-12


def diagnose_textbook(
    kernel: ReferenceKernel,
    states: States,
    accelerations: Array,
    file: Path,
    *,
    seconds: float = 10.0,
    tolerance: float = AGREEMENT,
) -> Diagnosis:
    """Find the one parameter of the textbook that a subject seems to have another value of.

    Args:
        kernel: certified accelerations of the system, in the subject's frames.
        states: n of them; every third is held out of fits. See ``harness.diagnose.perturbation.diagnostic_states``.
        accelerations: the subject's answers, (n, nv) [SI per s^2].
        file: of the system, to be named. seconds, tolerance: as for ``harness.diagnose.model_side.diagnose``.
    """
    search = _Search(kernel, states, accelerations, tolerance, Deadline.after(SHARE_OF_TIME * seconds))
    before = search.left_at(None, 0.0)
    if not search.certified.any():
        return Diagnosis(file=file, finding=Finding.UNDECIDED, before=before, seconds=seconds)
    if before <= tolerance:
        return Diagnosis(file=file, finding=Finding.SOUND, before=before, seconds=seconds)
    found = search.fit_all()
    tried = [_explanation(kernel.mechanism, file, place, value, left, tolerance) for place, (value, left) in found.items() if left < before]
    tried.sort(key=lambda one: (not one.explains, digits_of(one.value) if one.explains else 0, one.residual))
    verdicts = compare(search.reference, accelerations).verdicts[search.certified].tolist()
    ending = Finding.UNEXPLAINED if Verdict.DISAGREES.value in verdicts else Finding.UNSTABLE
    if tried and tried[0].explains:
        ending = Finding.EXPLAINED
    elif not np.isfinite(accelerations[search.certified]).all():
        ending = Finding.NOT_FINITE
    return Diagnosis(file=file, finding=ending, before=before, tried=tuple(tried), seconds=seconds, stopped=search.out_of_time())


class _Search:
    """One subject's answers and the parameters they are compared at."""

    def __init__(self, kernel: ReferenceKernel, states: States, accelerations: Array, tolerance: float, out_of_time: Deadline) -> None:
        self.kernel, self.states, self.accelerations = kernel, states, accelerations
        self.tolerance, self.out_of_time = tolerance, out_of_time
        self.values: Sequence[float] = kernel.mechanism.parameter_values
        self.reference = kernel.evaluate(states)
        self.certified = self.reference.certified
        self._whitening = Whitening(self.reference)
        self._here = self._whitening.residual(accelerations)
        self._seen = self.certified & ~held_out(len(states))
        finite = np.isfinite(self._here).all(axis=1)
        # At rest without any force there is no data roundoff, and a wrong answer has no measure; it counts in the end.
        if (self._seen & finite).any():
            self._seen &= finite

    def fit_all(self) -> dict[int, tuple[float, float]]:
        """Place of a parameter to its best value and the largest backward error left, those that promise most first."""
        here = self._here[self._seen]
        columns = self.columns(self.reference, self.values)
        promises = screen(list(columns), [abs(value) or 1.0 for value in self.values], here)
        found: dict[int, tuple[float, float]] = {}

        def explaining() -> list[int]:
            return [place for place, (_, left) in found.items() if left <= self.tolerance]

        def in_class(place: int) -> bool:
            return any(_are_parallel(columns[place], columns[other]) for other in explaining())

        fit_in_order(
            promises, lambda place: self._fit(found, place, self.values[place], columns[place]), in_class, lambda: bool(explaining())
        )
        if not explaining():
            for promise in promises[:FITTED_FROM_OTHER_STARTS]:
                for factor in OTHER_STARTS:
                    self._fit(found, promise.place, factor * self.values[promise.place], None)
        return {place: self._settled(place, *value) for place, value in found.items()}

    def _fit(self, found: dict[int, tuple[float, float]], place: int, start: float, column: Array | None) -> None:
        if self.out_of_time():
            return
        scale = abs(self.values[place]) or 1.0

        def residual(value: float) -> Array | None:
            reference = self.at(place, value)
            if not reference.certified[self.certified].all():
                return None
            # In the measure of the unchanged reference: where one term acts alone, its own roundoff shrinks with it.
            with np.errstate(all="ignore"):
                difference = (self.accelerations - reference.high) - reference.low
            return self._whitening.change(difference)[self._seen]

        value = fit(residual, lambda at: self._slope(place, at), start, column, scale, self.out_of_time)
        if value is None:
            return
        # Of a term that is left out, the least remainder is a wrong answer where that term acts alone.
        for candidate in [0.0, value] if abs(value) <= ALL_BUT_ZERO * scale else [value]:
            left = self.left_at(place, candidate)
            if left < found.get(place, (0.0, math.inf))[1]:
                found[place] = candidate, left

    def _settled(self, place: int, value: float, left: float) -> tuple[float, float]:
        if left > self.tolerance:
            return value, left
        return settled(value, self._slope(place, value), left, self.tolerance, lambda at: self.left_at(place, at))

    def at(self, place: int | None, value: float) -> Reference:
        """The reference with another value of one parameter; as it is for None."""
        return self.reference if place is None else self.kernel.evaluate(self.states, self._for_all(self._changed(place, value)))

    def _changed(self, place: int, value: float) -> list[float]:
        return [value if number == place else own for number, own in enumerate(self.values)]

    def _for_all(self, values: Sequence[float]) -> Array:
        return np.broadcast_to(np.array(values, dtype=np.float64), (len(self.states), len(values)))

    def left_at(self, place: int | None, value: float) -> float:
        """Largest backward error over all states; inf where an answer or the reference is not finite."""
        reference = self.at(place, value)
        if not self.certified.any() or not reference.certified[self.certified].all():
            return math.inf
        errors = backward_errors(Whitening(reference).residual(self.accelerations)[self.certified])
        return float(errors.max()) if np.isfinite(errors).all() else math.inf

    def _slope(self, place: int, value: float) -> Array:
        return np.asarray(self.columns(self.at(place, value), self._changed(place, value))[place])

    def columns(self, reference: Reference, values: Sequence[float]) -> Array:
        """Derivatives of the whitened residual by each parameter p at the states that fits see, (parameters, n, nv).

        They are -M^-1 d(force - M qdd)/dp in the measure of the unchanged reference, M = R^T R of ``reference``.
        """
        parameters = self._for_all(values)
        forces = np.empty((len(values), *reference.high.shape))
        for chart, chosen in self.kernel.by_chart(self.states):
            inputs = self.kernel.mechanism.inputs(self.states[chosen], parameters[chosen])
            derivatives = chart.float64.input_derivatives(inputs, np.ascontiguousarray(reference.high[chosen].T))
            forces[:, chosen] = derivatives[:, -len(values) :].transpose(1, 2, 0)
        seen = self._seen
        with np.errstate(all="ignore"):
            factor = reference.norm_factor[seen]
            slopes = np.linalg.solve(factor, np.linalg.solve(factor.transpose(0, 2, 1), forces[:, seen].transpose(1, 2, 0)))
            everywhere = np.zeros_like(forces)
            everywhere[:, seen] = -slopes.transpose(2, 0, 1)
            found = np.array([self._whitening.change(column)[seen] for column in everywhere])
        return np.where(np.isfinite(found), found, 0.0)


def _are_parallel(first: Array, second: Array) -> bool:
    """To the rounding of exact derivatives."""
    lengths = float(np.linalg.norm(first)) * float(np.linalg.norm(second))
    return abs(float(np.vdot(first, second))) >= (1 - ROUNDING) * lengths > 0


def _explanation(mechanism: Mechanism, file: Path, place: int, value: float, left: float, tolerance: float) -> Explanation:
    name, own, unit = mechanism.parameters[place]
    explains = left <= tolerance
    value = value if explains else to_four_digits(value, own)
    where = Place(_line(file, name), PARAMETER, name, None, repr(own))
    return Explanation(PARAMETER, "", where, value, f"{name} = {own!r} {unit}".strip(), f"{value!r} {unit}".strip(), left, explains)


def _line(file: Path, name: str) -> int:
    """The line that gives the parameter its value, or where the values of all begin; 1 where neither is found."""
    try:
        lines = file.read_text(encoding="utf-8").splitlines()
    except OSError:
        return 1
    for pattern in (rf"\s*{re.escape(name)}\s*:\s*\(", r"\s*parameters\s*="):
        for number, line in enumerate(lines, 1):
            if re.match(pattern, line):
                return number
    return 1
