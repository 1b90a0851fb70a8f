"""Certified references: CPU time of a state, over that of what a state costs otherwise."""

from __future__ import annotations

import importlib.util
import tempfile
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.benchmark import REFERENCE_WORK, Benchmark, Measure, alone, cpu, reference_work
from benchmarks.suites import ARMS, FEW, MANY, MECHANISMS
from benchmarks.suites.kernels import in_a_loop, with_pinocchio

# With data roundoff, of a solution in balls of 128 bits without it; one degree of freedom has no system to solve.
OF_BALLS, OF_MPMATH, OF_ABA = 1 / 10, 1 / 80, 20.0
# 147 entries of three matrices with their data roundoff, of seven accelerations without.
DERIVATIVES_OF_BALLS = 34.0
# A mechanism with closed loops, of a tree of as many bodies. Data roundoff takes derivatives by parameters: seven bodies with one mass
# and one length for all would be no match for seven that have their own.
LOOPS = {"four_bar": "chain_3", "slider_crank": "arm_3r", "parallelogram": "scara", "andrews_squeezer": "arm_7r"}
OF_A_TREE = 5.0
# Rows of four-bars, in bodies: the program grows in proportion, as J M^-1 J' is tridiagonal by blocks; its derivatives for each velocity
# as the square; and the factor of M, which norms take, as the cube.
ROWS_OF_LOOPS, MOST_EXPONENT = (2, 5, 10), 3.0
# A trunk with seven arms of seven joints each, nowhere parallel: 30,000 instructions. A state costs 2 ms at most where the
# reference work costs 1.6.
ARMS_OF_A_TRUNK, FEWEST_INSTRUCTIONS, OF_WORK = 7, 30_000, 1.2
DIGITS = 50
# A humanoid of 27 velocities with 42 rows of limits, of which 21 act at each state, in calls of mj_forward at its file's defaults.
OF_FORWARD, LIMITED_STATES = 30.0, 256
# Legs of three joints each on a free trunk, all of whose feet touch: 30 velocities.
LEGS = 8


def benchmarks() -> Iterator[Benchmark]:
    for name in MECHANISMS:
        yield Benchmark(
            f"certified/of balls/{name}", partial(of_balls, name), "a solution in balls", OF_BALLS if name != "spring_damper" else np.inf
        )
    for name in ARMS:
        yield Benchmark(f"certified/of pin.aba/{name}", partial(of_aba, name), "pin.aba in a loop", OF_ABA)
    for name in ("double_pendulum", "arm_3r", "puma_560"):
        yield Benchmark(f"certified/of mpmath/{name}", partial(of_mpmath, name), f"mpmath with {DIGITS} digits", OF_MPMATH)
    yield Benchmark("certified/derivatives/arm_7r", derivatives, "accelerations in balls", DERIVATIVES_OF_BALLS)
    for loop, tree in LOOPS.items():
        yield Benchmark(f"certified/closed loops/{loop}", partial(of_a_tree, loop, tree), tree, OF_A_TREE)
    if importlib.util.find_spec("dm_control"):
        yield Benchmark("certified/limits/humanoid", of_forward, "mj_forward in a loop", OF_FORWARD, rounds=5)
    for cone in ("pyramidal", "elliptic"):
        yield Benchmark(f"certified/contacts/{cone}", partial(of_contacts, cone), "mj_forward in a loop", OF_FORWARD, rounds=5)
    yield Benchmark("certified/growth with loops", growth, "", MOST_EXPONENT, rounds=5, unit="(exponent of bodies)")
    yield Benchmark("certified/30,000 instructions", large_program, REFERENCE_WORK, OF_WORK)


def _kernel(name: str, states: int) -> tuple[Any, Any, Any]:
    from harness.lagrange.derivation import load_mechanism
    from harness.library import Library
    from harness.truth.reference import ReferenceKernel
    from harness.truth.sampling import generic_sample

    mechanism = load_mechanism(Library.built_in(), name)
    return mechanism, ReferenceKernel(mechanism), generic_sample(mechanism, states, seed=0)


def _in_balls(mechanism: Any, kernel: Any, states: Any) -> Measure:
    from harness.truth.reference import PRECISIONS

    [(chart, _), *_] = kernel.by_chart(states)
    parameters = np.broadcast_to(np.array(mechanism.parameter_values), (len(states), len(mechanism.parameters)))
    return cpu(lambda: chart.balls.solve(states, parameters, PRECISIONS[0]), len(states))


def of_balls(name: str) -> tuple[Measure, Measure]:
    mechanism, kernel, states = _kernel(name, MANY)
    return cpu(lambda: kernel.evaluate(states), MANY), _in_balls(mechanism, kernel, states[:FEW])


def of_aba(name: str) -> tuple[Measure, Measure]:
    _, kernel, states = _kernel(name, MANY)
    _, _, model, rows = with_pinocchio(name)
    return cpu(lambda: kernel.evaluate(states), MANY), cpu(in_a_loop("aba", model, rows), MANY)


def of_forward() -> tuple[Measure, Measure]:
    """The optimum that MuJoCo documents for the limits of dm_control's humanoid, at states beyond the limits of all its joints."""
    import mujoco

    from harness.comparison.robot_library import engine_of
    from harness.explain.changes.readings import element_at
    from harness.files.equalities import limits_of
    from harness.trees.mechanism import mechanism_of
    from harness.trees.robot import read_robot
    from harness.truth.optimum import optimum
    from harness.truth.reference import ReferenceKernel
    from harness.truth.sampling import generic_sample

    spec = importlib.util.find_spec("dm_control")
    assert spec is not None and spec.submodule_search_locations is not None
    robot, engine = read_robot(path := Path(spec.submodule_search_locations[0]) / "suite" / "humanoid.xml"), engine_of("mujoco")
    root, limits = element_at(robot.tree.place), limits_of(robot.tree)
    tree = mechanism_of(robot)
    mechanism = optimum(tree, robot, limits, engine.laws(root, robot.format, limits), engine.fuses(root, robot.format))
    states, model = generic_sample(tree, LIMITED_STATES, seed=0), mujoco.MjModel.from_xml_path(str(path))
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_ACTUATION)
    random = np.random.default_rng(0)
    for joint in np.flatnonzero(model.jnt_limited):
        low, high = model.jnt_range[joint]
        beyond = random.uniform(0.0, (high - low) / 2, LIMITED_STATES)
        states.q[:, model.jnt_qposadr[joint]] = np.where(random.random(LIMITED_STATES) < 0.5, low - beyond, high + beyond)
    kernel, data = ReferenceKernel(mechanism), mujoco.MjData(model)

    def forward() -> None:
        for q, v, tau in zip(states.q, states.v, states.tau, strict=True):
            data.qpos[:], data.qvel[:], data.qfrc_applied[:] = q, v, tau
            mujoco.mj_forward(model, data)

    return cpu(lambda: kernel.evaluate(states), LIMITED_STATES), cpu(forward, LIMITED_STATES)


def legs(cone: str) -> str:
    """An MJCF of a trunk on ``LEGS`` legs, which stand on the ground."""
    written = []
    for number in range(LEGS):
        angle = 2 * np.pi * number / LEGS
        inertial = '<inertial pos="0.08 0 0" mass="0.3" diaginertia="0.001 0.002 0.003"/>'
        foot = '<geom size="0.02" pos="0 0 -0.2"/>'
        place = f'pos="{0.2 * np.cos(angle):.6f} {0.2 * np.sin(angle):.6f} 0" euler="0 0 {np.degrees(angle):.6f}"'
        written.append(
            f'<body {place}><joint name="hip{number}" axis="0 0 1"/>{inertial}'
            f'<body pos="0.1 0 0"><joint name="thigh{number}" axis="0 1 0"/>{inertial}'
            f'<body pos="0.2 0 0"><joint name="shin{number}" axis="0 1 0"/>{inertial}{foot}</body></body></body>'
        )
    trunk = '<freejoint/><inertial pos="0 0 0" mass="3" diaginertia="0.05 0.05 0.09"/>'
    floor = '<geom type="plane" size="2 2 1"/>'
    body = f'<body name="trunk" pos="0 0 0.21">{trunk}{"".join(written)}</body>'
    return f'<mujoco><option cone="{cone}"/><worldbody>{floor}{body}</worldbody></mujoco>'


def of_contacts(cone: str) -> tuple[Measure, Measure]:
    """The optimum that MuJoCo documents where all feet of a robot touch, at states that differ in all joints."""
    import mujoco

    from harness.comparison.robot_library import engine_of
    from harness.engines.adapters.mujoco.contacts import found_contacts
    from harness.explain import touching
    from harness.explain.changes.readings import element_at
    from harness.explain.documented import documented
    from harness.explain.switches import switches_of
    from harness.files.findings import CONTACTS
    from harness.trees.mechanism import mechanism_of
    from harness.trees.robot import read_robot
    from harness.truth.sampling import generic_sample

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "legs.xml")
        path.write_text(legs(cone), encoding="utf-8")
        robot, model, caller = read_robot(path), mujoco.MjModel.from_xml_path(str(path)), engine_of("mujoco")
        root = element_at(robot.tree.place)
        states, data, random = generic_sample(mechanism_of(robot), LIMITED_STATES, seed=0), mujoco.MjData(model), np.random.default_rng(0)
        states.tau[:], found = 0.0, []
        for state in range(LIMITED_STATES):
            mujoco.mj_resetData(model, data)
            data.qpos[7:], data.qvel[:] = random.normal(size=model.nv - 6) * 0.002, random.normal(size=model.nv) * 0.1
            mujoco.mj_forward(model, data)
            states.q[state], states.v[state] = data.qpos, data.qvel
            found.append(found_contacts(model, data.contact[: data.ncon]))
        assert caller.contacts is not None
        touching.MOST_WORK = 10**12
        own = touching.Touching.of(found, robot, caller.contacts(root, robot.format)[0])
        assert {len(one) for one in own.contacts} == {LEGS}
        switches = [one for one in switches_of(robot, robot, caller) if one.group.what == CONTACTS]
        # All states have one structure, for which a program is written once.
        mechanism = documented(robot, caller, switches, (), own.contacts[0])

    def forward() -> None:
        for q, v in zip(states.q, states.v, strict=True):
            data.qpos[:], data.qvel[:] = q, v
            mujoco.mj_forward(model, data)

    return cpu(lambda: own.truth(states, lambda _: mechanism), LIMITED_STATES), cpu(forward, LIMITED_STATES)


def of_mpmath(name: str) -> tuple[Measure, Measure]:
    """What somebody would write: SymPy's expressions, evaluated in many digits without a bound."""
    import mpmath
    import sympy as sp

    from harness.lagrange.derivation import load_system
    from harness.lagrange.equations import derive
    from harness.lagrange.system import TIME
    from harness.library import Library

    mechanism, kernel, states = _kernel(name, MANY)
    system, _ = load_system(Library.built_in().system_path(name))
    equations = derive(system)
    forces = sp.symbols(f"tau:{mechanism.nv}", seq=True)
    inputs = [*equations.coordinates, *equations.rates, *forces, TIME, *system.parameters]
    right_hand_side = sp.Matrix(forces) + equations.right_hand_side
    evaluate = sp.lambdify(inputs, [equations.mass_matrix, right_hand_side], modules="mpmath", cse=True)
    columns = mechanism.inputs(states[:FEW]).T.tolist()

    def loop() -> None:
        with mpmath.workdps(DIGITS):
            for column in columns:
                mass, force = evaluate(*map(mpmath.mpf, column))
                mpmath.lu_solve(mass, force)

    return cpu(lambda: kernel.evaluate(states), MANY), cpu(loop, FEW)


def derivatives() -> tuple[Measure, Measure]:
    from harness.truth.quantities.derivatives import FORWARD, DerivativeTruth

    mechanism, kernel, states = _kernel("arm_7r", FEW)
    truth = DerivativeTruth(FORWARD, mechanism, linear_velocity_in_body=False)
    return cpu(lambda: truth.evaluate(states), FEW), _in_balls(mechanism, kernel, states)


def _closed(name: str) -> Measure:
    """From the coordinates that no row determines to the truth: the state is closed, which a tree's is as it comes."""
    from harness.truth.manifold import closed

    mechanism, kernel, states = _kernel(name, MANY)
    return cpu(lambda: kernel.evaluate(closed(mechanism, states)), MANY)


def of_a_tree(loop: str, tree: str) -> tuple[Measure, Measure]:
    return _closed(loop), _closed(tree)


def growth() -> tuple[Measure, Measure]:
    measures: Sequence[Measure] = [_closed(f"four_bar_chain_{loops}") for loops in ROWS_OF_LOOPS]
    bodies = [2 * loops + 1 for loops in ROWS_OF_LOOPS]
    return lambda: float(np.polyfit(np.log(bodies), np.log([measure() for measure in measures]), 1)[0]), alone


def large_program() -> tuple[Measure, Measure]:
    from harness.bench.further_costs import arms
    from harness.trees.mechanism import mechanism_of
    from harness.trees.robot import read_robot
    from harness.truth.reference import ReferenceKernel
    from harness.truth.sampling import generic_sample

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "arms.urdf")
        path.write_text(arms(ARMS_OF_A_TRUNK), encoding="utf-8")
        mechanism = mechanism_of(read_robot(path))
    kernel, states = ReferenceKernel(mechanism), generic_sample(mechanism, FEW, seed=0)
    assert not kernel.evaluate(states).in_balls.any()
    return cpu(lambda: kernel.evaluate(states), FEW), cpu(reference_work())
