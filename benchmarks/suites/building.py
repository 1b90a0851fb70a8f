"""What is made once of a mechanism: equations from its energies, and programs ready to be evaluated."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from functools import partial
from pathlib import Path

from benchmarks.benchmark import REFERENCE_WORK, Benchmark, Measure, cpu, reference_work
from benchmarks.suites.certified import ARMS_OF_A_TRUNK, FEWEST_INSTRUCTIONS

# Of the reference work, which took 1.6 ms of CPU time where the bars were set: 5, 15, 60 and 2 s.
DERIVED = {"chain_16": 3_000.0, "chain_32": 9_000.0, "chain_64": 36_000.0}
ENCODED = 1_200.0


def benchmarks() -> Iterator[Benchmark]:
    for name, most in DERIVED.items():
        yield Benchmark(f"building/derive/{name}", partial(derived, name), REFERENCE_WORK, most, rounds=1, warm=False)
    yield Benchmark("building/encode/30,000 instructions", encoded, REFERENCE_WORK, ENCODED, rounds=5)


def derived(name: str) -> tuple[Measure, Measure]:
    from harness.lagrange.derivation import derive_mechanism
    from harness.library import Library

    library = Library.built_in()
    return cpu(lambda: derive_mechanism(library.system_path(name), name)), cpu(reference_work())


def encoded() -> tuple[Measure, Measure]:
    from harness.bench.further_costs import arms
    from harness.programs.loops.encoding import encode
    from harness.trees.mechanism import mechanism_of
    from harness.trees.robot import read_robot

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "arms.urdf")
        path.write_text(arms(ARMS_OF_A_TRUNK), encoding="utf-8")
        program = mechanism_of(read_robot(path)).program
    code = encode(program)
    assert code is not None and len(code.instructions) >= FEWEST_INSTRUCTIONS
    return cpu(lambda: encode(program)), cpu(reference_work())
