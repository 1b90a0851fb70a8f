"""The truth's side of a diagnosis: the one number of its that a subject seems to have another value of.

The truth is a textbook's, with its parameters, or that of a robot's file, with every number there. Its values at other numbers are
certified like those at its own, without a new derivation; its derivatives are those of the data roundoff.

Source: Khalil, Dombre, Modeling, Identification and Control of Robots (2002), chapter 12.
"""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from harness.arrays import Array
from harness.explain.changes import PARAMETER, Change
from harness.explain.columns import ChangeColumn, parameter_derivatives
from harness.explain.result import TriedChange, to_four_digits
from harness.explain.search import ChangeSearch, Limits, Side, Tried
from harness.files.text.scan import TextPlace
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.states import States
from harness.truth.reference import Reference, ReferenceKernel

# Instructions of the equations that all certified evaluations of a diagnosis may have together, and the bounds of their number.
INSTRUCTIONS, LEAST_EVALUATIONS, MOST_EVALUATIONS = 200_000, 50, 600
# Noise of the direction of an exact column.
ROUNDING = 1e-7


def textbook_evaluations(mechanism: Mechanism) -> int:
    """Certified evaluations that the diagnosis of a mechanism takes at most: fewer for longer equations."""
    return max(LEAST_EVALUATIONS, min(MOST_EVALUATIONS, INSTRUCTIONS // len(mechanism.program.instructions)))


class TextbookSide(Side):
    """Texts of parameter values are evaluated to the certified accelerations that have them.

    Args:
        kernel: certified accelerations, in the subject's frames. accelerations: the subject's answers at ``states``, (n, nv).
        file: that gives the parameters their values. limits: as many evaluations as ``textbook_evaluations`` says by default.
        certified: the kernel's accelerations at ``states``, where they are known.
    """

    def __init__(
        self,
        kernel: ReferenceKernel,
        states: States,
        accelerations: Array,
        file: Path,
        limits: Limits | None = None,
        certified: Reference | None = None,
    ) -> None:
        limits = Limits(textbook_evaluations(kernel.mechanism)) if limits is None else limits
        self.truth = kernel.evaluate(states) if certified is None else certified
        super().__init__(file, self.truth, accelerations, limits)
        self._kernel, self._states, self._mechanism = kernel, states, kernel.mechanism
        self.changes = list(map(self._change, range(len(kernel.mechanism.parameters))))

    def _change(self, number: int) -> Change:
        """Another value of a parameter; its text holds the values of all, exactly. It stands in no line of a file."""
        values, (name, own, _) = list(self._mechanism.parameter_values), self._mechanism.parameters[number]

        def text(value: float) -> str:
            return json.dumps([*values[:number], value, *values[number + 1 :]])

        return Change(PARAMETER, "", (TextPlace(1, PARAMETER, name, None, repr(own)),), text, values[number], abs(values[number]) or 1.0)

    def evaluate(self, text: str) -> tuple[Reference, Array] | None:
        values = json.loads(text)
        reference = self._kernel.evaluate(self._states, self._mechanism.parameters_at(self._states, values))
        return (reference, self.answers) if reference.certified[self.decides].all() else None

    def slope(self, change: Change, value: float) -> Array | None:
        text = change.text(value)
        evaluated = self.evaluated(text)
        if evaluated is None:
            return None
        assert isinstance(evaluated[0], Reference)
        return np.asarray(self._slopes(evaluated[0], json.loads(text))[self.changes.index(change), self.seen])

    def columns(self, count: int | None = None) -> list[ChangeColumn]:
        """At the truth's own values, of the first ``count`` parameters, those that some acceleration depends on."""
        slopes = self._slopes(self.truth, self._mechanism.parameter_values)
        columns = [ChangeColumn(values, ROUNDING, change) for change, values in zip(self.changes[:count], slopes, strict=False)]
        of_states = frozenset() if self._mechanism.actuation is None else self._mechanism.actuation.own
        return [column for place, column in enumerate(columns) if column.norm > 0 and place not in of_states]

    def _slopes(self, reference: Reference, values: Sequence[float]) -> Array:
        """Derivatives of the whitened residual by each parameter p, (parameters, n, nv), 0 at states that fits do not see.

        They are -M^-1 d(force - M qdd)/dp in the measure of the unchanged reference, M = R^T R of ``reference``.
        """
        slopes = -parameter_derivatives(self._kernel, self._states, reference, values)
        found = np.array([self.whitening.change(column) for column in slopes])
        found[:, ~self.seen] = 0.0
        return np.where(np.isfinite(found), found, 0.0)

    def shown(self, tried: Tried) -> TriedChange:
        place, value = replace(tried.change.place, line=_line(self.file, tried.change.place.attribute)), tried.value
        assert value is not None
        _, own, unit = self._mechanism.parameters[self.changes.index(tried.change)]
        value = value if tried.explains else to_four_digits(value, own)
        found, shown = f"{place.attribute} = {own!r} {unit}".strip(), f"{value!r} {unit}".strip()
        return TriedChange(PARAMETER, "", place, value, found, shown, tried.left, tried.explains)


def search_parameters(side: TextbookSide, count: int | None = None) -> ChangeSearch:
    """The search for the one parameter that a subject seems to have another value of.

    ``count``: how many of the kernel's parameters are the truth's own; those behind them are of the subject's file. All for None.
    """
    search = ChangeSearch(side)
    if search.is_needed:
        search.fit_best(side.columns(count))
        search.fit_from_other_starts(side.changes[:count])
    return search


def _line(file: Path, name: str) -> int:
    """The line that gives the parameter its value, or where the values of all begin; 1 where neither is found."""
    try:
        lines = file.read_text(encoding="utf-8").splitlines()
    except OSError:
        return 1
    patterns = rf"\s*{re.escape(name)}\s*:\s*\(", r"\s*parameters\s*="
    return next((number for pattern in patterns for number, line in enumerate(lines, 1) if re.match(pattern, line)), 1)
