"""The equations of motion of a tree, and the parts of its forces that an integrator may take implicitly.

Sources: those of ``harness.trees.recursion`` and ``harness.trees.joint_forces``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from harness.files.joint_kinds import JointKind
from harness.files.tree import Given, Tree
from harness.programs.derivatives import along
from harness.programs.program import StraightLineProgram, without_unused
from harness.programs.terms import Vector
from harness.trees.nodes import Kinematics, kinematics
from harness.trees.recursion import equations_of_motion

JOINT_DAMPING, JOINT_STIFFNESS = "joint damping", "joint stiffness"
LINES, LINE_DAMPING, LINE_STIFFNESS = "lines", "line damping", "line stiffness"


@dataclass(frozen=True)
class StepForces:
    """The forces of one tree.

    Attributes:
        program: that of ``harness.trees.recursion``, with further outputs: "joint damping" and "joint stiffness" (nv each), the minus
            derivatives of what springs and dampers in joints do; "lines" (m, nv) by rows, the derivatives by the velocities of the rates
            of the lengths that springs and dampers act on; "line damping" and "line stiffness" (m each).
        parameters: the numbers of the file, its last inputs.
        related: pairs (i, j), i <= j, of velocities one of which moves all that the other moves.
        floating: the first places in v of the free joints of bodies that carry no other joint.
    """

    program: StraightLineProgram
    parameters: tuple[Given, ...]
    related: frozenset[tuple[int, int]]
    floating: tuple[int, ...]


def step_forces(tree: Tree, joints: Sequence[str]) -> StepForces:
    """The forces of a tree; inputs as ``recursion_program`` has them, the velocity of a free joint in the frame of the parent.

    Raises:
        ValueError: the tree has other joints.
    """
    nodes = kinematics(tree, joints)
    equations, lines = equations_of_motion(nodes)
    builder, velocities = nodes.builder, nodes.coordinates.velocities
    slopes = [along([line.rate], {velocity: builder.one})[0] for line in lines for velocity in velocities]
    outputs = {
        **equations,
        JOINT_DAMPING: _of_joints(nodes, "damping"),
        JOINT_STIFFNESS: _of_joints(nodes, "stiffness"),
        LINES: slopes,
        LINE_DAMPING: builder.vector([line.of.damping for line in lines]),
        LINE_STIFFNESS: builder.vector([line.of.stiffness for line in lines]),
    }
    carrying = {node.parent for node in nodes.nodes}
    alone = [node for number, node in enumerate(nodes.nodes) if node.joint.kind == JointKind.FREE and number not in carrying]
    floating = tuple(node.columns[0] for node in alone)
    return StepForces(without_unused(builder.program(outputs)), builder.parameters, frozenset(_related(nodes)), floating)


def _of_joints(nodes: Kinematics, coefficient: str) -> Vector:
    found = nodes.builder.zeros(nodes.nv)
    for node in nodes.nodes:
        value = node.of_velocity(coefficient)
        for column in node.columns:
            found[column] = found[column] + value
    return found


def _related(nodes: Kinematics) -> set[tuple[int, int]]:
    found: set[tuple[int, int]] = set()
    for number, node in enumerate(nodes.nodes):
        at = number
        while at >= 0:
            found |= {(min(i, j), max(i, j)) for i in node.columns for j in nodes.nodes[at].columns}
            at = nodes.nodes[at].parent
    return found
