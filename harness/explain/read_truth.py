"""The truth of a quantity of a user's file as an engine's reader has it, at the states of the file."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from dataclasses import replace

import numpy as np

from harness.arrays import Array
from harness.engines import Model
from harness.programs.states import States
from harness.truth.compare import Certified, Comparison, Flags, compare
from harness.truth.quantities import Truth
from harness.verdict import Verdict


class ReadTruth(Truth):
    """The truth of the mechanism that an engine's readings make of a file.

    An answer that agrees with it, and not with the file, is ``explained``.

    Attributes:
        read: the truth, at states of the mechanism as it is read. of_file: that of the file. into: from states of the file to these.
        columns: of the file's values among those that are read; None where they cannot be compared.
    """

    def __init__(self, read: Truth, of_file: Truth, into: Callable[[States], States], columns: list[int] | slice | None) -> None:
        self.read, self.of_file, self.into, self.columns = read, of_file, into, columns
        self.blocks = read.blocks

    @property
    def key(self) -> Hashable:
        """See ``Truth``."""
        return self.read.key, self.of_file.key

    @property
    def is_compiled(self) -> bool:
        """See ``Truth``."""
        return self.read.is_compiled

    def evaluate(self, states: States) -> Certified:
        """See ``Truth``; of what is read."""
        return self.read.evaluate(self.into(states))

    def answers(self, model: Model, states: States) -> Array:
        """See ``Truth``."""
        return self.read.answers(model, self.into(states))

    def may_lose_digits(self, model: Model) -> bool:
        """See ``Truth``."""
        return self.read.may_lose_digits(model)

    def judge(self, certified: Certified, states: States, answers: Array, model: Model) -> Comparison:
        """See ``Truth``."""
        found = self.read.judge(certified, self.into(states), answers, model)
        explained = found.verdicts == Verdict.AGREES.value
        if explained.any():
            explained[explained] = ~self._agrees_with_file(states[explained], answers[explained])
        return replace(found, verdicts=np.where(explained, Verdict.EXPLAINED.value, found.verdicts))

    def _agrees_with_file(self, states: States, answers: Array) -> Flags:
        if self.columns is None:
            return np.zeros(len(states), dtype=bool)
        own = answers[:, self.columns]
        return np.asarray(compare(self.of_file.evaluate(states), own).verdicts == Verdict.AGREES.value)

    def describe(self, certified: Certified, states: States, answers: Array, model: Model) -> str:
        """See ``Truth``."""
        return self.read.describe(certified, self.into(states), answers, model)
