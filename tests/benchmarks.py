"""Bars on speed: ``pytest -n 0 tests/benchmarks.py``, on a machine with nothing else to do.

Kernels are compared as ratios within one run. Not collected by a plain ``pytest``.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
import sympy as sp

from harness.bench import costs
from harness.bench.further_costs import arms
from harness.bench.methods import find_methods
from harness.crosscheck.scene import Scene
from harness.engines import Subject, load_model
from harness.files.model_file import read_model
from harness.lagrange.derivation import degrees_of_freedom, derive_mechanism, load_mechanism, load_system
from harness.lagrange.equations import derive
from harness.lagrange.system import TIME
from harness.library import Library
from harness.programs.loops.encoding import encode
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.states import States
from harness.trees.mechanism import mechanism_of
from harness.trees.robot import read_robot
from harness.truth.manifold import closed
from harness.truth.quantities.derivatives import FORWARD, DerivativeTruth
from harness.truth.reference import PRECISIONS, ReferenceKernel
from harness.truth.sampling import generic_sample

LIBRARY = Library.built_in()
# Of constraints the other programs know nothing; their bar is below.
SYSTEMS = [name for name in LIBRARY.system_names() if load_mechanism(LIBRARY, name).constraints is None]
# A mechanism with closed loops, and a tree of as many bodies that costs it at most so many times. Data roundoff takes derivatives by
# parameters: seven bodies with one mass and one length for all would be no match for seven that have their own.
LOOPS = {"four_bar": "chain_3", "slider_crank": "arm_3r", "parallelogram": "scara", "andrews_squeezer": "arm_7r"}
DEARER_THAN_A_TREE = 5.0
# Of rows of four-bars, in bodies: the program grows in proportion, as J M^-1 J' is tridiagonal by blocks; its derivatives for each
# velocity as the square; and the factor of M, which norms take, as the cube.
ROWS_OF_LOOPS, ROWS_EXPONENT = (2, 5, 10), 3.0
WITH_URDF = [name for name in SYSTEMS if LIBRARY.has_model(name, "urdf")]
DIGITS = 50
MANY, FEW, FEWEST = 20_000, 2_000, 100
FASTER_THAN_A_LOOP = 25.0
# Of the whole call from (q, v, tau) to qdd. pin.aba of one free body costs least, and to turn 19 inputs a state into columns most.
FASTER_WITH_INPUTS = {"free_body": 18.0, "quadrotor": 12.0}
BARS = {("mpmath", "certified reference"): 80.0}
# Of the certified reference: over a solution in balls of 128 bits, which has no data roundoff yet; and over pin.aba in a loop.
FASTER_THAN_BALLS, SLOWER_THAN_ABA = 10.0, 20.0
# Of 147 certified entries with data roundoff over seven accelerations without, where balls take 0.6 ms a state: 20 ms.
DERIVATIVES_OVER_BALLS = 34.0
SEED_SYSTEMS = ("double_pendulum", "cart_pendulum", "spherical_pendulum", "spring_damper", "arm_3r")
MILLION = 1_000_000
# Cost of the first method over that of the second, on one thread each: at least, or at most.
FASTER = {("pinocchio abaInParallel", "heyoka float64"): 5.0}
OVERHEAD = {("harness check of mujoco", "mujoco batch"): 1.25, ("harness check of pinocchio", "pinocchio aba"): 1.25}
SMALL = [name for name in WITH_URDF if load_mechanism(LIBRARY, name).nv <= 7]
ROUNDS, SECONDS_EACH = 40, 0.001
GROWTH_SECONDS = {"chain_16": 5.0, "chain_32": 15.0, "chain_64": 60.0}
seconds_per_state: dict[tuple[str, str], float] = {}


def measure(benchmark: Any, name: str, method: str, states: int, call: Callable[[], object]) -> None:
    benchmark.group = name
    benchmark.extra_info |= {"system": name, "method": method, "states": states}
    benchmark.pedantic(call, warmup_rounds=2, rounds=10)
    seconds_per_state[name, method] = benchmark.stats.stats.median / states


@pytest.mark.parametrize("name", SYSTEMS)
def test_float64_kernel(benchmark: Any, name: str) -> None:
    mechanism = load_mechanism(LIBRARY, name)
    states = generic_sample(mechanism, MANY, seed=0)
    kernel = mechanism.float64()
    inputs = kernel.inputs(states.q, states.v, states.tau)
    measure(benchmark, name, "float64 kernel", MANY, lambda: kernel.compiled.accelerations(inputs))


@pytest.mark.parametrize("name", SYSTEMS)
def test_certified_reference(benchmark: Any, name: str) -> None:
    mechanism = load_mechanism(LIBRARY, name)
    kernel, states = ReferenceKernel(mechanism), generic_sample(mechanism, FEW, seed=0)
    measure(benchmark, name, "certified reference", FEW, lambda: kernel.evaluate(states))


@pytest.mark.parametrize("name", SYSTEMS)
def test_mpmath(benchmark: Any, name: str) -> None:
    mechanism = load_mechanism(LIBRARY, name)
    system, _ = load_system(LIBRARY.system_path(name))
    equations = derive(system)
    forces = sp.symbols(f"tau:{mechanism.nv}", seq=True)
    inputs = [*equations.coordinates, *equations.rates, *forces, TIME, *system.parameters]
    right_hand_side = sp.Matrix(forces) + equations.right_hand_side
    evaluate = sp.lambdify(inputs, [equations.mass_matrix, right_hand_side], modules="mpmath", cse=True)
    columns = mechanism.inputs(generic_sample(mechanism, FEWEST, seed=0)).T.tolist()
    # Three parts of a quaternion are as good as any three angles of the text.
    for earlier, place in reversed(list(enumerate(mechanism.attitudes))):
        for column in columns:
            del column[place + earlier]

    def loop() -> None:
        with mpmath.workdps(DIGITS):
            for column in columns:
                mass, force = evaluate(*map(mpmath.mpf, column))
                mpmath.lu_solve(mass, force)

    measure(benchmark, name, "mpmath", FEWEST, loop)


@pytest.mark.parametrize(("arguments", "limit"), [(["list"], 0.5), (["check"], 20.0)], ids=["list", "check"])
def test_command(benchmark: Any, tmp_path: Path, arguments: list[str], limit: float) -> None:
    def command() -> None:
        subprocess.run([sys.executable, "-m", "harness", *arguments], check=True, stdout=subprocess.DEVNULL, cwd=tmp_path)

    benchmark.group = "commands, from a warm cache"
    benchmark.pedantic(command, warmup_rounds=1, rounds=3)
    assert benchmark.stats.stats.median <= limit


def cpu_seconds(*command: str, cwd: Path, **environment: str) -> float:
    """User and system time of a command with its children [s]."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, *command], check=True, stdout=subprocess.DEVNULL, cwd=cwd, env={**os.environ, **environment})
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def importing(cwd: Path) -> float:
    """CPU time of what every check imports [s]: 1.3 where the bars were set."""
    return min(cpu_seconds("-c", "import sympy, heyoka, mujoco, pinocchio, hypothesis, flint, lxml.etree", cwd=cwd) for _ in range(2))


def test_a_warm_check_of_one_mechanism_costs_three_times_the_imports_at_most(tmp_path: Path) -> None:
    """4 CPU seconds where the imports cost 1.3; the ratio holds on slower machines too."""
    check = ("-m", "harness", "check", "double_pendulum")
    cpu_seconds(*check, cwd=tmp_path)
    assert min(cpu_seconds(*check, cwd=tmp_path) for _ in range(2)) <= 3.1 * importing(tmp_path)


@pytest.mark.parametrize("name", [name for name in SYSTEMS if degrees_of_freedom(LIBRARY, name)[0] == 3])
def test_a_first_check_costs_five_and_a_half_times_the_imports_at_most(tmp_path: Path, name: str) -> None:
    """6 CPU seconds where the imports cost 1.1, of a mechanism with three degrees of freedom and an empty cache."""

    def first_check(cache: Path) -> float:
        environment = {"HARNESS_CACHE": str(cache), "HEYOKA_CACHE_DIR": str(cache / "machine_code")}
        return cpu_seconds("-m", "harness", "check", name, cwd=tmp_path, **environment)

    assert min(first_check(tmp_path / cache) for cache in ("one", "another")) <= 5.5 * importing(tmp_path)


@pytest.mark.parametrize("name", SMALL)
def test_certified_reference_over_balls(name: str) -> None:
    """With data roundoff, against the accelerations alone in ball arithmetic."""
    mechanism = load_mechanism(LIBRARY, name)
    states, kernel = generic_sample(mechanism, FEW, seed=0), ReferenceKernel(mechanism)
    few = states[:FEWEST]
    parameters = np.broadcast_to(np.array(mechanism.parameter_values), (FEWEST, len(mechanism.parameters)))
    [(chart, _), *_] = kernel.by_chart(few)
    calls = (lambda: chart.balls.solve(few, parameters, PRECISIONS[0])), (lambda: kernel.evaluate(states))
    rounds = [[min(costs.measure(call, 1, SECONDS_EACH)) for call in calls] for _ in range(ROUNDS // 4)]
    in_balls, certified = np.min(rounds, axis=0) / (FEWEST, FEW)
    print(f"\n{name}: certified in 1/{in_balls / certified:.1f} of the time of balls; the bar is {FASTER_THAN_BALLS:g}")
    assert mechanism.nv < 2 or in_balls >= FASTER_THAN_BALLS * certified


@pytest.mark.parametrize("name", ["arm_7r", "puma_560", "stanford_arm"])
def test_certified_reference_over_pinocchio_in_a_loop(name: str) -> None:
    import pinocchio

    mechanism = load_mechanism(LIBRARY, name)
    file = read_model(LIBRARY.model_path(name, "urdf"), "urdf")
    loaded: Any = load_model(LIBRARY, Subject("pinocchio", "urdf"), mechanism, file)
    states, kernel, data = generic_sample(mechanism, FEW, seed=0), ReferenceKernel(mechanism), loaded.model.createData()
    columns = loaded.columns(states.q, states.v, states.tau)
    rows = [tuple(map(np.ascontiguousarray, row)) for row in zip(*(part.T for part in columns), strict=True)]

    def loop() -> None:
        for row in rows:
            pinocchio.aba(loaded.model, data, *row)

    rounds = [[min(costs.measure(call, 1, SECONDS_EACH)) for call in (loop, lambda: kernel.evaluate(states))] for _ in range(ROUNDS)]
    aba, certified = np.min(rounds, axis=0)
    print(f"\n{name}: the certified reference costs {certified / aba:.1f} times pin.aba; the bar is {SLOWER_THAN_ABA:g}")
    assert certified <= SLOWER_THAN_ABA * aba


def fastest(*calls: Callable[[], object]) -> list[float]:
    """CPU seconds of the fastest run of each call, timed in turns."""

    def seconds(call: Callable[[], object]) -> float:
        started = time.process_time()
        call()
        return time.process_time() - started

    return [float(seconds) for seconds in np.min([[seconds(call) for call in calls] for _ in range(5)], axis=0)]


def test_certified_derivatives_over_accelerations_in_balls() -> None:
    """Of all 147 entries of three matrices with their data roundoff, over seven accelerations alone, in balls of 128 bits."""
    mechanism = load_mechanism(LIBRARY, "arm_7r")
    states, kernel = generic_sample(mechanism, FEWEST, seed=0), ReferenceKernel(mechanism)
    parameters = np.broadcast_to(np.array(mechanism.parameter_values), (FEWEST, len(mechanism.parameters)))
    [(chart, _)] = kernel.by_chart(states)
    truth = DerivativeTruth(FORWARD, mechanism, linear_velocity_in_body=False)
    truth.evaluate(states[:1])
    balls, derivatives = fastest(lambda: chart.balls.solve(states, parameters, PRECISIONS[0]), lambda: truth.evaluate(states))
    print(f"\narm_7r: certified derivatives in {1e3 * derivatives / FEWEST:.1f} ms a state, {derivatives / balls:.1f} times balls")
    assert derivatives <= DERIVATIVES_OVER_BALLS * balls


@pytest.mark.parametrize("name", ["arm_7r", "puma_560", "stanford_arm", "quadrotor"])
def test_kernel_of_derivatives_over_pinocchio_in_a_loop(name: str) -> None:
    import pinocchio

    mechanism = load_mechanism(LIBRARY, name)
    loaded: Any = load_model(LIBRARY, Subject("pinocchio", "urdf"), mechanism, read_model(LIBRARY.model_path(name, "urdf"), "urdf"))
    model, states, data = loaded.model, generic_sample(mechanism, FEW, seed=0), loaded.model.createData()
    rows = [tuple(map(np.ascontiguousarray, row)) for row in zip(*(part.T for part in loaded.columns(*inputs_of(states))), strict=True)]
    kernel = mechanism.float64()
    kernel.forward_derivatives(*inputs_of(states))

    def loop() -> None:
        for row in rows:
            pinocchio.computeABADerivatives(model, data, *row)

    analytic, own = fastest(loop, lambda: kernel.forward_derivatives(*inputs_of(states)))
    print(f"\n{name}: the whole call is {analytic / own:.1f} times as fast as pin.computeABADerivatives in a loop; the bar is 1")
    assert own <= analytic


def inputs_of(states: States) -> tuple[Any, Any, Any]:
    return states.q, states.v, states.tau


def test_certifying_a_million_states_of_the_first_systems() -> None:
    kernels = [(ReferenceKernel(mechanism), mechanism) for mechanism in (load_mechanism(LIBRARY, name) for name in SEED_SYSTEMS)]
    states = [generic_sample(mechanism, MILLION // len(kernels), seed=0) for _, mechanism in kernels]
    started = time.process_time()
    references = [kernel.evaluate(own) for (kernel, _), own in zip(kernels, states, strict=True)]
    seconds = time.process_time() - started
    print(f"\n{MILLION:,} certified states in {seconds:.1f} CPU s")
    assert seconds <= 60.0
    assert all(reference.certified.all() and reference.in_balls.mean() < 0.01 for reference in references)


def test_certifying_a_program_of_30_000_instructions(tmp_path: Path) -> None:
    """A trunk with seven arms of seven joints each, nowhere parallel."""
    path = tmp_path / "arms.urdf"
    path.write_text(arms(7))
    mechanism = mechanism_of(read_robot(path))
    started = time.process_time()
    encoded = encode(mechanism.program)
    ready = time.process_time() - started
    assert encoded is not None and len(encoded.instructions) >= 30_000
    kernel, states = ReferenceKernel(mechanism), generic_sample(mechanism, FEWEST, seed=0)
    reference = kernel.evaluate(states)

    def seconds() -> float:
        started = time.process_time()
        kernel.evaluate(states)
        return time.process_time() - started

    # A neighbour on the same machine doubles single times.
    each = min(seconds() for _ in range(5)) / FEWEST
    print(f"\n{len(encoded.instructions):,} instructions ready in {ready:.2f} s, {1e3 * each:.2f} ms a state")
    assert not reference.in_balls.any() and ready <= 2.0 and each <= 0.002 * len(encoded.instructions) / 30_000


def test_certifying_100_000_states_of_every_system(benchmark: Any) -> None:
    mechanisms = [load_mechanism(LIBRARY, name) for name in SYSTEMS]

    def certify() -> None:
        for mechanism in mechanisms:
            assert ReferenceKernel(mechanism).evaluate(generic_sample(mechanism, 100_000, seed=0)).certified.all()

    benchmark.group = "100,000 certified states of every system, one process"
    benchmark.pedantic(certify, rounds=1)
    assert benchmark.stats.stats.median <= 90.0


def certified_cost(*names: str) -> list[float]:
    """CPU seconds per certified state of some systems, timed in turns: of the references, and of closing the states under constraints."""
    calls = []
    for name in names:
        mechanism = load_mechanism(LIBRARY, name)
        kernel, states = ReferenceKernel(mechanism), generic_sample(mechanism, FEW, seed=0)
        calls.append((mechanism, kernel, states))

    def seconds(mechanism: Mechanism, kernel: ReferenceKernel, states: States) -> float:
        started = time.process_time()
        kernel.evaluate(closed(mechanism, states))
        return time.process_time() - started

    rounds = [[seconds(*call) for call in calls] for _ in range(ROUNDS // 2)]
    return [float(seconds) / FEW for seconds in np.min(rounds, axis=0)]


@pytest.mark.parametrize(("loop", "tree"), LOOPS.items(), ids=LOOPS)
def test_certified_loops_beside_trees(loop: str, tree: str) -> None:
    """From the coordinates that no row determines to the truth: the state is closed, which a tree's is as it comes."""
    own, others = certified_cost(loop, tree)
    print(f"\n{loop}: {own / others:.1f} times {tree}; the bar is {DEARER_THAN_A_TREE:g}")
    assert own <= DEARER_THAN_A_TREE * others


def test_certified_rows_of_loops_grow_as_elimination_does() -> None:
    seconds = certified_cost(*(f"four_bar_chain_{loops}" for loops in ROWS_OF_LOOPS))
    bodies = [2 * loops + 1 for loops in ROWS_OF_LOOPS]
    exponent = float(np.polyfit(np.log(bodies), np.log(seconds), 1)[0])
    print(f"\ncertified rows of four-bars of {bodies} bodies: exponent {exponent:.2f}; the bar is {ROWS_EXPONENT:g}")
    assert exponent <= ROWS_EXPONENT


RATIOS = [(name, *bar) for bar in BARS for name in SYSTEMS]


@pytest.mark.parametrize(("name", "slow", "fast"), RATIOS, ids=[f"{name}-{slow} over {fast}" for name, slow, fast in RATIOS])
def test_ratio(name: str, slow: str, fast: str) -> None:
    ratio = seconds_per_state[name, slow] / seconds_per_state[name, fast]
    print(f"\n{name}: {fast} is {ratio:.0f} times as fast as {slow}; the bar is {BARS[slow, fast]:g}")
    assert ratio >= BARS[slow, fast]


def cost_ratio(name: str, first: str, second: str) -> float:
    """Fastest of the first method over fastest of the second, timed in turns, so that both meet the same noise."""
    scene = Scene.of(LIBRARY, name)
    states = generic_sample(scene.mechanism, FEW, seed=0)
    methods = {method.name: method for method in find_methods()}
    calls = [methods[name].prepare(scene, states).compute for name in (first, second)]
    rounds = [[min(costs.measure(call, 1, SECONDS_EACH)) for call in calls] for _ in range(ROUNDS)]
    fastest = np.min(rounds, axis=0)
    return float(fastest[0] / fastest[1])


@pytest.mark.parametrize(("slow", "fast"), FASTER, ids=[" over ".join(pair) for pair in FASTER])
@pytest.mark.parametrize("name", SMALL)
def test_machine_code_is_faster(name: str, slow: str, fast: str) -> None:
    ratio = cost_ratio(name, slow, fast)
    print(f"\n{name}: {fast} is {ratio:.1f} times as fast as {slow}; the bar is {FASTER[slow, fast]:g}")
    assert ratio >= FASTER[slow, fast]


@pytest.mark.parametrize("name", SMALL)
def test_kernel_over_pinocchio_in_a_loop(name: str) -> None:
    """Of one state, on one thread each, timed in turns."""
    import pinocchio

    mechanism = load_mechanism(LIBRARY, name)
    file = read_model(LIBRARY.model_path(name, "urdf"), "urdf")
    # As the harness loads it: Pinocchio's own reader gives a ball joint no place.
    loaded: Any = load_model(LIBRARY, Subject("pinocchio", "urdf"), mechanism, file)
    model, states = loaded.model, generic_sample(mechanism, FEW, seed=0)
    data = model.createData()
    columns = loaded.columns(states.q, states.v, states.tau)
    rows = [tuple(map(np.ascontiguousarray, row)) for row in zip(*(part.T for part in columns), strict=True)]
    kernel = mechanism.float64()
    inputs = kernel.inputs(states.q, states.v, states.tau)

    def loop() -> None:
        for row in rows:
            pinocchio.aba(model, data, *row)

    calls = (
        loop,
        lambda: kernel.compiled.accelerations(inputs),
        lambda: kernel.accelerations(states.q, states.v, states.tau),
    )
    rounds = [[min(costs.measure(call, 1, SECONDS_EACH)) for call in calls] for _ in range(ROUNDS)]
    slow, *fast = np.min(rounds, axis=0)
    bars = FASTER_THAN_A_LOOP, FASTER_WITH_INPUTS.get(name, FASTER_THAN_A_LOOP)
    for what, seconds, bar in zip(("the kernel", "the whole call"), fast, bars, strict=True):
        print(f"\n{name}: {what} is {slow / seconds:.0f} times as fast as pin.aba in a loop; the bar is {bar:g}")
    assert [slow / seconds >= bar for seconds, bar in zip(fast, bars, strict=True)] == [True, True]


@pytest.mark.parametrize(("checked", "bare"), OVERHEAD, ids=[" over ".join(pair) for pair in OVERHEAD])
@pytest.mark.parametrize("name", WITH_URDF)
def test_overhead_of_a_bulk_check(name: str, checked: str, bare: str) -> None:
    """``pinocchio aba`` is the call that is judged: ``abaInParallel`` is another algorithm, and less exact."""
    ratio = cost_ratio(name, checked, bare)
    print(f"\n{name}: {checked} costs {ratio:.2f} times {bare}; the bar is {OVERHEAD[checked, bare]:g}")
    assert ratio <= OVERHEAD[checked, bare]


@pytest.mark.parametrize("name", GROWTH_SECONDS)
def test_deriving_a_long_chain(name: str) -> None:
    started = time.process_time()
    derive_mechanism(LIBRARY.system_path(name), name)
    seconds = time.process_time() - started
    print(f"\n{name}: derived in {seconds:.1f} s; the bar is {GROWTH_SECONDS[name]:g}")
    assert seconds <= GROWTH_SECONDS[name]
