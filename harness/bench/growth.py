"""Growth of cost and error over the sizes of a family: of each way of computing accelerations, and of a robot's certified truth.

The robot is a fixed trunk with arms of seven joints each, no two of whose axes are parallel, so that no part of the equations
vanishes. Its equations are written by recursion over the file; a chain of so many bodies would take Lagrange's way an hour.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from harness.bench.costs import Effort, acceleration_costs, measure
from harness.bench.methods import Method
from harness.crosscheck.scene import Scene
from harness.library import Library
from harness.results.benchmark import Growth
from harness.study import Note
from harness.trees.mechanism import mechanism_of
from harness.trees.robot import read_robot
from harness.truth.reference import ReferenceKernel
from harness.truth.sampling import generic_sample

FAMILY = "chain"
# Where a state costs this many times what the cheapest costs, at most half is the call's own.
HIDDEN_BELOW = 2.0
FEWEST_SIZES = 2
FEWEST_STATES = 64


def growth(library: Library, methods: Sequence[Method], sizes: Sequence[int], effort: Effort, note: Note) -> list[Growth]:
    """Cost and error of each method over ``sizes`` of ``FAMILY``, in one process; ``effort`` is for size 1, larger members take less."""
    measured = []
    for size in sizes:
        note(f"{FAMILY}_{size}: derivation")
        scene = Scene.of(library, f"{FAMILY}_{size}")
        count = max(FEWEST_STATES, effort.most // size)
        measured.append(acceleration_costs(scene, methods, replace(effort, counts=(count,), judged=count), note)[0])
        if failed := next((cost for cost in measured[-1] if cost.failed), None):
            raise RuntimeError(f"{failed.method}: {failed.note}")
    return [
        Growth(
            family=FAMILY,
            method=method.name,
            sizes=list(sizes),
            seconds_per_state=[cost.seconds_per_state for cost in costs],
            backward_errors=[cost.backward_error for cost in costs],
            # The noise of a machine only adds, and at a few sizes one outlier would decide.
            exponent=exponent(sizes, [cost.fastest for cost in costs]),
            expected=method.growth,
        )
        for method, costs in zip(methods, zip(*measured, strict=True), strict=True)
    ]


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


ROBOTS, METHOD = "arms of seven joints", "certified reference of a robot"
JOINTS = 7
# Every body's inertia is added to those below it, and M's entries are formed between all pairs of joints on a way to the trunk.
EXPECTED = "up to 3"
MINIMUM_COUNT = 3
_INERTIAL = """<inertial><origin xyz="0.1 0.02 0.03" rpy="0.1 0.2 0.3"/><mass value="1.5"/>
  <inertia ixx="0.02" iyy="0.03" izz="0.04" ixy="0.001" ixz="0.002" iyz="0.003"/></inertial>"""
_AXES = ("1 0 0", "0 1 0", "0 0 1")


def arms(count: int) -> str:
    """The URDF of ``count`` arms."""
    names = [[f"arm_{arm}_{joint}" for joint in range(JOINTS)] for arm in range(count)]
    links = "".join(f'<link name="{name}">{_INERTIAL}</link>' for arm in names for name in arm)
    joints = "".join(
        f"""<joint name="to_{child}" type="continuous"><parent link="{parent}"/><child link="{child}"/>
        <origin xyz="0.3 0.1 0.{number}" rpy="0.4 0.5 0.6"/><axis xyz="{_AXES[place % 3]}"/></joint>"""
        for number, arm in enumerate(names)
        for place, (parent, child) in enumerate(zip(["trunk", *arm], arm, strict=False))
    )
    return f'<robot name="arms"><link name="trunk"/>{links}{joints}</robot>'


def robot_growth(counts: Sequence[int], seed: int, minimum_seconds: float, note: Callable[[str], None]) -> Growth:
    """Cost per certified state with its data roundoff [s], and largest radius [data roundoffs], of each number of arms."""
    measured: list[tuple[float, float, float | None]] = []
    for count in counts:
        note(f"{count} arms")
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "arms.urdf"
            path.write_text(arms(count))
            reference = ReferenceKernel(mechanism_of(read_robot(path)))
        states = generic_sample(reference.mechanism, FEWEST_STATES, seed)
        times = np.array(measure(partial(reference.evaluate, states), MINIMUM_COUNT, minimum_seconds)) / len(states)
        found = reference.evaluate(states)
        radius = float((found.radius / found.data_roundoff).max()) if found.certified.all() else None
        measured.append((float(np.median(times)), float(times.min()), radius))
    seconds, fastest, radii = zip(*measured, strict=True)
    sizes = [count * JOINTS for count in counts]
    return Growth(
        family=ROBOTS,
        method=METHOD,
        sizes=sizes,
        seconds_per_state=list(seconds),
        backward_errors=list(radii),
        exponent=exponent(sizes, fastest),
        expected=EXPECTED,
    )
