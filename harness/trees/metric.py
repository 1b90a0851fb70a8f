"""The equations of motion of a tree in the metric of a step that takes the dampers of joints implicitly.

Source: ``harness.files.rules``, of a law of a step.
"""

from __future__ import annotations

from collections.abc import Sequence

from harness.files.tree import Tree
from harness.programs.program import OUTPUTS, upper_triangle, without_unused
from harness.programs.terms import Builder
from harness.trees.bodies.spatial import FileProgram
from harness.trees.recursion import JOINT_DAMPING, step_forces


def in_metric(tree: Tree, joints: Sequence[str], length: float) -> FileProgram:
    """``recursion_program`` with A = M + h D for its mass matrix, ``length`` being h [s] and D the dampers of joints.

    Raises:
        ValueError: the tree has other joints.
    """
    forces = step_forces(tree, joints)
    builder = Builder(forces.program.inputs)
    known = builder.append(forces.program)
    damping, step = known[JOINT_DAMPING], builder.number(length)
    places = upper_triangle(len(damping))
    mass = [entry + step * damping[i] if i == j else entry for entry, (i, j) in zip(known["mass"], places, strict=True)]
    outputs = {name: known[name] for name in OUTPUTS} | {"mass": mass}
    return FileProgram(without_unused(builder.program(outputs)), forces.parameters)
