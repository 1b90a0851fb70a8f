"""Cost and error of every way of computing accelerations, on one system and over the sizes of a family.

Cost is per state and takes in neither loading nor conversion; error is the backward error against the
certified reference at the same states.

``harness.certify.compare`` says what an error is, ``harness.bench.timing`` how the cost is taken.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from harness.arrays import Array
from harness.bench.methods import Method
from harness.bench.timing import measure
from harness.certify.compare import compare
from harness.certify.reference import Reference
from harness.certify.sampling import sample
from harness.crosscheck.scene import Scene
from harness.crosscheck.tasks import Note, reference_kernel
from harness.engines import Unsupported
from harness.equations.mechanism import Mechanism
from harness.equations.states import States
from harness.library import MODEL_SUFFIXES, Library
from harness.models.model_file import ModelFile
from harness.results.benchmark import AccelerationCost, Growth

MINIMUM_COUNT = 5
FAMILY, SIZES = "chain", (1, 2, 4, 8, 16, 32)
# Where a state costs this many times what the cheapest costs, at most half is the call's own.
HIDDEN_BELOW = 2.0
FEWEST_SIZES = 2
FEWEST_STATES = 64


def acceleration_costs(
    library: Library,
    mechanism: Mechanism,
    models: Mapping[str, ModelFile],
    methods: Sequence[Method],
    count: int,
    seed: int,
    minimum_seconds: float,
    note: Note,
) -> list[AccelerationCost]:
    """One measurement per method, in their order, at up to ``count`` sampled states each.

    ``models`` holds the model file of each format there is. A method that cannot do the system has an entry
    with the reason as its note. ``minimum_seconds`` is how long each method is timed at least.
    """
    scene = Scene(library, mechanism, models)
    states = sample(mechanism, count, seed)
    references: dict[bool, Reference] = {}
    costs = []
    for method in methods:
        note(f"{mechanism.name}: {method.name}")
        in_body = method.linear_velocity_in_body and bool(mechanism.charts_in_body)
        if in_body not in references:
            references[in_body] = reference_kernel(mechanism, in_body).evaluate(states)
        chosen = slice(method.most_states)
        costs.append(_cost(method, scene, states[chosen], references[in_body][chosen], minimum_seconds))
    return costs


def _cost(method: Method, scene: Scene, states: States, reference: Reference, minimum_seconds: float) -> AccelerationCost:
    name, n = scene.mechanism.name, len(states)
    try:
        if method.format in MODEL_SUFFIXES and method.format not in scene.models:
            raise Unsupported(f"there is no {method.format} model")
        prepared = method.prepare(scene, states)
    except Unsupported as reason:
        return AccelerationCost(system=name, method=method.name, threads=method.threads, states=0, seconds_per_state=None, note=str(reason))
    timing = measure(prepared.compute, MINIMUM_COUNT, minimum_seconds)
    comparison = compare(reference, prepared.accelerations())
    backward, relative = (_numbers(errors) for errors in (comparison.backward_error, comparison.relative_error))
    remarks = [prepared.note]
    undecided, useless = n - int(reference.certified.sum()), int(reference.certified.sum()) - len(backward)
    if undecided:
        remarks.append(f"{undecided} of {n} states are undecided")
    if useless:
        remarks.append(f"{useless} of {n} answers are not finite")
    return AccelerationCost(
        system=name,
        method=method.name,
        threads=method.threads,
        states=n,
        seconds_per_state=timing.median / n,
        fastest=timing.fastest / n,
        slowest=timing.slowest / n,
        repetitions=timing.repetitions,
        backward_error=float(backward.max()) if len(backward) else None,
        median_backward_error=float(np.median(backward)) if len(backward) else None,
        relative_error=float(relative.max()) if len(relative) else None,
        note="; ".join(filter(None, remarks)),
    )


def _numbers(values: Array) -> Array:
    return values[~np.isnan(values)]


def growth(
    library: Library,
    methods: Sequence[Method],
    count: int,
    seed: int,
    minimum_seconds: float,
    note: Note,
    family: str = FAMILY,
    sizes: Sequence[int] = SIZES,
) -> list[Growth]:
    """Cost and error of each method over the sizes of ``family``, in one process.

    ``count`` is the number of states at size 1; larger members are given fewer. To spread the sizes over
    workers, run ``growth_at`` for each and hand its results to ``fitted``.
    """
    measured = {size: growth_at(library, family, size, methods, count, seed, minimum_seconds, note) for size in sizes}
    return fitted(family, methods, measured)


def growth_at(
    library: Library, family: str, size: int, methods: Sequence[Method], count: int, seed: int, minimum_seconds: float, note: Note
) -> list[AccelerationCost]:
    """``acceleration_costs`` of one member of a family."""
    note(f"{family}_{size}: derivation")
    scene = Scene.of(library, f"{family}_{size}")
    fewer = max(FEWEST_STATES, count // size)
    return acceleration_costs(library, scene.mechanism, scene.models, methods, fewer, seed, minimum_seconds, note)


def fitted(family: str, methods: Sequence[Method], measured: Mapping[int, Sequence[AccelerationCost]]) -> list[Growth]:
    """One ``Growth`` per method from the measurements at each size, whatever their order."""
    found = []
    sizes = sorted(measured)
    for method in methods:
        at_size = [{cost.method: cost for cost in measured[size]}.get(method.name) for size in sizes]
        seconds = [None if cost is None else cost.seconds_per_state for cost in at_size]
        fastest = [None if cost is None else cost.fastest for cost in at_size]
        errors = [None if cost is None else cost.backward_error for cost in at_size]
        found.append(
            Growth(
                family=family,
                method=method.name,
                sizes=sizes,
                seconds_per_state=seconds,
                backward_errors=errors,
                # The noise of a machine only adds, and at a few sizes one outlier would decide.
                exponent=exponent(sizes, fastest),
                expected=method.growth,
            )
        )
    return found


def exponent(sizes: Sequence[int], seconds: Sequence[float | None]) -> float | None:
    """Slope of log seconds over log size by least squares, where the cost of a call no longer hides it.

    Those are the largest sizes at each of which a state costs at least ``HIDDEN_BELOW`` times what it costs
    at the cheapest; None where there are fewer than two.
    """
    known = [(size, cost) for size, cost in zip(sizes, seconds, strict=True) if cost]
    if not known:
        return None
    least = HIDDEN_BELOW * min(cost for _, cost in known)
    hidden = [place for place, (_, cost) in enumerate(known) if cost < least]
    upper = known[hidden[-1] + 1 :] if hidden else known
    if len(upper) < FEWEST_SIZES:
        return None
    logarithms = np.log(np.array(upper))
    return float(np.polyfit(logarithms[:, 0], logarithms[:, 1], 1)[0])
