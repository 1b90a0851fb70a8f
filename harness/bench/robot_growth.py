"""What the certified truth of a robot's file costs by its number of bodies, to about a hundred.

The family is a fixed trunk with arms of seven joints each, no two of whose axes are parallel, so that no part of the equations
vanishes. Its equations are written by recursion over the file; a chain of so many bodies would take Lagrange's way an hour.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from harness.bench.growth import FEWEST_STATES, exponent
from harness.bench.measuring import measure
from harness.certify.reference import ReferenceKernel
from harness.certify.sampling import generic_sample
from harness.results.benchmark import Growth
from harness.robots.mechanism import mechanism_of
from harness.robots.robot import read_robot

FAMILY, METHOD = "arms of seven joints", "certified reference of a robot"
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
    sizes, seconds, fastest, radii = [], [], [], []
    for count in counts:
        note(f"{count} arms")
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "arms.urdf"
            path.write_text(arms(count))
            reference = ReferenceKernel(mechanism_of(read_robot(path)))
        states = generic_sample(reference.mechanism, FEWEST_STATES, seed)
        times = measure(lambda of=reference, at=states: of.evaluate(at), MINIMUM_COUNT, minimum_seconds)  # type: ignore[misc]
        found = reference.evaluate(states)
        sizes.append(count * JOINTS)
        seconds.append(float(np.median(times)) / len(states))
        fastest.append(min(times) / len(states))
        radii.append(float((found.radius / found.data_roundoff).max()) if found.certified.all() else None)
    return Growth(
        family=FAMILY,
        method=METHOD,
        sizes=sizes,
        seconds_per_state=list(seconds),
        backward_errors=radii,
        exponent=exponent(sizes, fastest),
        expected=EXPECTED,
    )
