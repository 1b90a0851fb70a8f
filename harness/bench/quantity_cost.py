"""Cost and error of every subject in a quantity beyond accelerations, on one system, by how many states are asked for at once.

Timed are the engine's own calls; what makes their arguments, or arranges answers for the comparison, is not. Errors are those of the
cross-check, at the same states for each number of states at once, so that they differ only where the engine's answers do.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.bench.acceleration_cost import MINIMUM_COUNT, measure, shared_fields
from harness.certify.certified import Certified
from harness.certify.compare import compare
from harness.certify.quantities import Quantity, Truth
from harness.certify.sampling import generic_sample
from harness.crosscheck.assignment import Assignment, load_audited, truth_of
from harness.crosscheck.scene import Scene
from harness.crosscheck.tasks import Note
from harness.engines import Subject, Unsupported, load_engine, runs_elsewhere
from harness.equations.states import States
from harness.results.benchmark import QuantityCost
from harness.study import sentence

# Numbers of states that are asked for at once.
SIZES = (1, 10, 100, 1000, 10_000)


def quantity_costs(
    scene: Scene,
    quantity: Quantity,
    subjects: Sequence[Subject],
    counts: Sequence[int],
    judged: int,
    seed: int,
    minimum_seconds: float,
    note: Note,
) -> list[QuantityCost]:
    """Of each subject, in their order, one measurement per number of states in ``counts``; errors at ``judged`` states.

    A subject that does not offer the quantity, or that fails, has one entry with the reason as its note. ``minimum_seconds`` is how long
    each number of states is timed at least.
    """
    mechanism, found = scene.mechanism, list[QuantityCost]()
    states = generic_sample(mechanism, max(judged, *counts), seed)
    known: dict[Hashable, Certified] = {}
    for subject in subjects:
        note(f"{mechanism.name}: {quantity.name} of {subject}")
        try:
            assignment = Assignment(scene.library, subject, mechanism, scene.models.get(subject.format), quantity=quantity.name)
            model, truth = load_audited(assignment), truth_of(assignment)
            if truth.key not in known:
                known[truth.key] = truth.evaluate(states[:judged])
            certified = known[truth.key]
            elsewhere = runs_elsewhere(load_engine(scene.library, subject.engine))
            remark = "times hold the exchange with the process of its environment" if elsewhere else ""
            found += [
                QuantityCost(
                    system=mechanism.name,
                    quantity=quantity.name,
                    method=str(subject),
                    states=count,
                    **_measured(truth, model, certified, states, count, minimum_seconds, remark),
                )
                for count in counts
            ]
        except Unsupported as reason:
            found.append(_missing(mechanism.name, quantity, subject, str(reason)))
        except Exception as error:
            # What one subject raises or answers is not the others' fault.
            found.append(_missing(mechanism.name, quantity, subject, sentence(error), failed=True))
    return found


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


def _measured(
    truth: Truth, model: Any, certified: Certified, states: States, count: int, minimum_seconds: float, remark: str
) -> dict[str, Any]:
    """What ``QuantityCost`` has of ``count`` states at once."""
    batch, judged = states[:count], len(certified)
    calls = EngineCalls(model, batch.q)
    first = truth.answers(calls, batch)
    rest = [truth.answers(model, states[start : min(start + count, judged)]) for start in range(count, judged, count)]
    comparison = compare(certified, np.concatenate([first, *rest])[:judged])
    return shared_fields(comparison, certified.certified, measure(calls.again, MINIMUM_COUNT, minimum_seconds), count, remark)


def _missing(system: str, quantity: Quantity, subject: Subject, why: str, failed: bool = False) -> QuantityCost:
    return QuantityCost(
        system=system, quantity=quantity.name, method=str(subject), states=0, seconds_per_state=None, note=why, failed=failed
    )
