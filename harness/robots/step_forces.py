"""The equations of motion of a tree, and the parts of its forces that an integrator may take implicitly.

Sources: those of ``harness.robots.recursion`` and ``harness.robots.joint_forces``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from harness.equations.program import StraightLineProgram, without_unused
from harness.files.tree import Coupling, Given, Spring, Tree
from harness.robots.recursion import RecursionWriter

JOINT_DAMPING, JOINT_STIFFNESS = "joint damping", "joint stiffness"
LINES, LINE_DAMPING, LINE_STIFFNESS = "lines", "line damping", "line stiffness"


@dataclass(frozen=True)
class StepForces:
    """The forces of one tree.

    Attributes:
        program: that of ``harness.robots.recursion``, with further outputs: "joint damping" and "joint stiffness" (nv each), the minus
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
    return _Writer(tree, joints, False).step_forces()


class _Writer(RecursionWriter):
    """Writes the forces of one tree."""

    def step_forces(self) -> StepForces:
        self._lines: list[tuple[Spring | Coupling, int]] = []
        outputs = dict(self.outputs_of_tree())
        rates = range(self._first_rate, self._first_rate + self.nv)
        unit = self.number(1)
        slopes = [[self.along([rate], {place: unit})[0] for place in rates] for _, rate in self._lines]
        outputs |= {
            JOINT_DAMPING: self._of_joints("damping"),
            JOINT_STIFFNESS: self._of_joints("stiffness"),
            LINES: [slope for row in slopes for slope in row],
            LINE_DAMPING: [self.given(line.damping) for line, _ in self._lines],
            LINE_STIFFNESS: [self.given(line.stiffness) for line, _ in self._lines],
        }
        carrying = {node.parent for node in self.nodes}
        floating = tuple(node.columns[0] for number, node in enumerate(self.nodes) if node.joint.kind == "free" and number not in carrying)
        return StepForces(without_unused(self.program(outputs)), self.parameters, frozenset(self._related()), floating)

    def _tension(self, line: Spring | Coupling, stretch: int, rate: int) -> int:
        self._lines.append((line, rate))
        return super()._tension(line, stretch, rate)

    def _of_joints(self, coefficient: str) -> list[int]:
        found = [self.zero] * self.nv
        for node in self.nodes:
            multiplier = self.given(node.joint.multiplier)
            value = self.product(self.product(multiplier, multiplier), self.given(getattr(node.joint, coefficient)))
            for column in node.columns:
                found[column] = self.sum(found[column], value)
        return found

    def _related(self) -> set[tuple[int, int]]:
        found: set[tuple[int, int]] = set()
        for number, node in enumerate(self.nodes):
            at = number
            while at >= 0:
                found |= {(min(i, j), max(i, j)) for i in node.columns for j in self.nodes[at].columns}
                at = self.nodes[at].parent
        return found
