"""Cost and error of every subject in a quantity beyond accelerations, on one system, by how many states are asked for at once.

Timed are the engine's own calls; what makes their arguments, or arranges answers for the comparison, is not. Errors are those of the
cross-check, at the same states for each number of states at once, so that they differ only where the engine's answers do.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.bench.acceleration_cost import MINIMUM_COUNT
from harness.bench.measuring import Effort, cost_of_each, measure, shared_fields
from harness.crosscheck.assignment import Assignment, load_audited
from harness.crosscheck.scene import Scene
from harness.crosscheck.stages import Truths
from harness.crosscheck.tasks import Note
from harness.engines import Subject, load_engine, runs_elsewhere
from harness.results.benchmark import QuantityCost
from harness.truth.compare import compare
from harness.truth.quantities import Quantity
from harness.truth.sampling import generic_sample

# Numbers of states that are asked for at once.
SIZES = (1, 10, 100, 1000, 10_000)


def quantity_costs(scene: Scene, quantity: Quantity, subjects: Sequence[Subject], effort: Effort, note: Note) -> list[QuantityCost]:
    """Costs of each subject, in their order: one for each number of states that are asked for at once.

    A subject that does not offer the quantity, or that fails, has one entry with the reason as its note.
    """
    mechanism = scene.mechanism
    states = generic_sample(mechanism, effort.most, effort.seed)
    truths = Truths(states[: effort.judged])

    def costs(subject: Subject) -> Iterator[QuantityCost]:
        assignment = Assignment(scene.library, subject, mechanism, scene.models.get(subject.format), quantity=quantity.name)
        model, truth = load_audited(assignment), assignment.truth
        elsewhere = runs_elsewhere(load_engine(scene.library, subject.engine))
        remark = "times hold the exchange with the process of its environment" if elsewhere else ""
        certified = truths.of(truth)
        for count in effort.counts:
            batch, judged = states[:count], len(certified)
            calls = EngineCalls(model, batch.q)
            first = truth.answers(calls, batch)
            rest = [truth.answers(model, states[start : min(start + count, judged)]) for start in range(count, judged, count)]
            comparison = compare(certified, np.concatenate([first, *rest])[:judged])
            times = measure(calls.again, MINIMUM_COUNT, effort.minimum_seconds)
            yield QuantityCost(**about(subject), states=count, **shared_fields(comparison, certified.certified, times, count, remark))

    def about(subject: Subject) -> dict[str, Any]:
        return {"system": mechanism.name, "quantity": quantity.name, "method": str(subject)}

    def missing(subject: Subject, why: str, failed: bool) -> QuantityCost:
        return QuantityCost(**about(subject), states=0, seconds_per_state=None, note=why, failed=failed)

    asked = [(f"{mechanism.name}: {quantity.name} of {subject}", subject) for subject in subjects]
    return cost_of_each(asked, costs, missing, note)


class EngineCalls:
    """An engine's model that notes what it is asked at ``q``, (n, nq), to be asked it again.

    What a quantity asks at other positions, as at zero for the engine's own convention of frames, is passed on and not noted.
    """

    def __init__(self, model: Any, q: Array) -> None:
        self._model, self._q = model, q
        self._calls: list[tuple[Callable[..., object], tuple[Any, ...]]] = []

    def __getattr__(self, name: str) -> Any:
        attribute = getattr(self._model, name)
        if not callable(attribute):
            return attribute

        def call(*arguments: Any) -> Any:
            if arguments and arguments[0] is self._q:
                self._calls.append((attribute, arguments))
            return attribute(*arguments)

        return call

    def again(self) -> None:
        """Every call that was noted, in their order.

        Raises:
            ValueError: none was.
        """
        if not self._calls:
            raise ValueError("the engine was asked nothing at the states")
        for method, arguments in self._calls:
            method(*arguments)
