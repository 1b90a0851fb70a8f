"""The harness' own float64 code, and what a check adds to the engine that it asks."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from benchmarks.benchmark import Benchmark, Measure, cpu
from benchmarks.suites import ARMS, MANY, MECHANISMS

# Of pin.aba in a loop: of the compiled code, and of the whole call from (q, v, tau) to qdd. A free body costs pin.aba least, and its 19
# inputs a state are most to turn into columns.
OF_A_LOOP = 1 / 25
WITH_INPUTS = {"free_body": 1 / 18, "quadrotor": 1 / 12}
OF_ABA_IN_PARALLEL = 1 / 5
# A check judges pin.aba: pin.abaInParallel is another algorithm, and less exact.
OVERHEAD = {"harness check of mujoco": "mujoco batch", "harness check of pinocchio": "pinocchio aba"}
MOST_OVERHEAD = 1.25
# Velocities of a free joint are turned into the body and accelerations back, for a body that costs pin.aba least.
MOST_WITH_A_FREE_JOINT = {("harness check of pinocchio", name): 1.45 for name in ("free_body", "quadrotor")}


def benchmarks() -> Iterator[Benchmark]:
    for name in MECHANISMS:
        yield Benchmark(f"kernels/accelerations/{name}", partial(kernel, name), "pin.aba in a loop", OF_A_LOOP)
    for name in MECHANISMS:
        bar = WITH_INPUTS.get(name, OF_A_LOOP)
        yield Benchmark(f"kernels/whole call/{name}", partial(whole_call, name), "pin.aba in a loop", bar)
    for name in (*ARMS, "quadrotor"):
        yield Benchmark(f"kernels/derivatives/{name}", partial(derivatives, name), "pin.computeABADerivatives in a loop", 1.0)
    for name in MECHANISMS:
        yield Benchmark(
            f"kernels/of abaInParallel/{name}", partial(methods, name, "heyoka float64", "pinocchio abaInParallel"),
            "pinocchio abaInParallel", OF_ABA_IN_PARALLEL,
        )  # fmt: skip
    for name in MECHANISMS:
        for checked, bare in OVERHEAD.items():
            most = MOST_WITH_A_FREE_JOINT.get((checked, name), MOST_OVERHEAD)
            yield Benchmark(f"kernels/{checked}/{name}", partial(methods, name, checked, bare), bare, most)


def with_pinocchio(name: str) -> tuple[Any, Any, Any, list[tuple[Any, ...]]]:
    """The kernel of a mechanism and its states; and, as the harness loads it, Pinocchio's model with the same states one by one."""
    from harness.engines import Subject, load_model
    from harness.files.model_file import read_model
    from harness.lagrange.derivation import load_mechanism
    from harness.library import Library
    from harness.truth.sampling import generic_sample

    library = replace(Library.built_in(), calls_engines_here=True)
    mechanism = load_mechanism(library, name)
    loaded: Any = load_model(library, Subject("pinocchio", "urdf"), mechanism, read_model(library.model_path(name, "urdf"), "urdf"))
    states = generic_sample(mechanism, MANY, seed=0)
    columns = loaded.columns(states.q, states.v, states.tau)
    rows = [tuple(map(np.ascontiguousarray, row)) for row in zip(*(part.T for part in columns), strict=True)]
    return mechanism.float64(), states, loaded.model, rows


def in_a_loop(algorithm: str, model: Any, rows: list[tuple[Any, ...]]) -> Callable[[], None]:
    """One call of Pinocchio for each state."""
    import pinocchio

    call, data = getattr(pinocchio, algorithm), model.createData()

    def loop() -> None:
        for row in rows:
            call(model, data, *row)

    return loop


def kernel(name: str) -> tuple[Measure, Measure]:
    own, states, model, rows = with_pinocchio(name)
    inputs = own.inputs(states.q, states.v, states.tau)
    return cpu(lambda: own.compiled.accelerations(inputs), MANY), cpu(in_a_loop("aba", model, rows), MANY)


def whole_call(name: str) -> tuple[Measure, Measure]:
    own, states, model, rows = with_pinocchio(name)
    return cpu(lambda: own.accelerations(states.q, states.v, states.tau), MANY), cpu(in_a_loop("aba", model, rows), MANY)


def derivatives(name: str) -> tuple[Measure, Measure]:
    own, states, model, rows = with_pinocchio(name)
    call = partial(own.forward_derivatives, states.q, states.v, states.tau)
    return cpu(call, MANY), cpu(in_a_loop("computeABADerivatives", model, rows), MANY)


def methods(name: str, first: str, second: str) -> tuple[Measure, Measure]:
    """Two ways of ``harness bench`` to compute accelerations, in CPU time of all their threads."""
    from harness.bench.methods import find_methods
    from harness.crosscheck.scene import Scene
    from harness.library import Library
    from harness.truth.sampling import generic_sample

    scene = Scene.of(Library.built_in(), name)
    states = generic_sample(scene.mechanism, MANY, seed=0)
    found = {method.name: method for method in find_methods()}
    own, other = (cpu(found[one].prepare(scene, states).compute, MANY) for one in (first, second))
    return own, other
