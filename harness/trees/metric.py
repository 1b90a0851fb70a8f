"""The equations of motion of a tree in the metric of a step that takes the dampers of joints implicitly.

Source: ``harness.files.rules``, of a law of a step.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from harness.files.tree import Tree
from harness.programs.mechanisms.softened import BEFORE
from harness.programs.program import OUTPUTS, position_count, upper_triangle, without_unused
from harness.programs.terms import Builder, symmetric, vector
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


def started(tree: Tree, joints: Sequence[str], length: float) -> tuple[FileProgram, list[tuple[str, float]]]:
    """``in_metric``, whose accelerations are differences of velocities over the step: half an ulp of these is felt.

    With the names and values of inputs that stand behind the numbers of the file. Raises as ``in_metric``.
    """
    written, names = in_metric(tree, joints, length), (BEFORE,)
    builder = Builder((*written.program.inputs, *names))
    known = builder.append(written.program)
    nv = len(known["velocity"])
    end = position_count(written.program) + nv
    rates, before = vector(builder.inputs[end - nv : end]), builder.inputs[-1]
    # Of the value 0.
    moved = symmetric(known["mass"], nv) @ (before * rates - rates)
    velocity = [one - builder.number(1 / Fraction(length)) * own for one, own in zip(known["velocity"], moved, strict=True)]
    outputs = {name: known[name] for name in OUTPUTS} | {"velocity": velocity}
    return FileProgram(without_unused(builder.program(outputs)), written.parameters), [(BEFORE, 1.0)]
