"""Springs and dampers in the joints of a tree, and those that couple joints, as instructions of a program.

Sources: MuJoCo documentation, XML reference, joint and tendon/fixed; http://wiki.ros.org/urdf/XML/joint, dynamics.
"""

from __future__ import annotations

from harness.files.tree import Coupling, Joint
from harness.robots.nodes import NodeWriter
from harness.robots.spatial import Three


class JointForceWriter(NodeWriter):
    """Writes the generalised forces that joints apply by themselves."""

    def forces_of_joints(self) -> Three:
        """The generalised force [N or N m] of springs, dampers and couplings on each velocity."""
        found = [self.zero] * self.nv
        for node in self.nodes:
            joint, multiplier = node.joint, self.given(node.joint.multiplier)
            for column in node.columns if joint.damping else ():
                rate = self.product(multiplier, self._first_rate + column)
                force = self.product(multiplier, self.product(self.given(joint.damping), rate))
                found[column] = self.difference(found[column], force)
            if joint.stiffness and joint.kind in ("hinge", "slide"):
                (column,) = node.columns
                stretch = self.difference(*self.position_and_rest(joint))
                force = self.product(multiplier, self.product(self.given(joint.stiffness), stretch))
                found[column] = self.difference(found[column], force)
        for coupling in self.tree.couplings:
            self._couple(coupling, found)
        return found

    def position_and_rest(self, joint: Joint) -> tuple[int, int]:
        """The position of a hinge or slide, and that in which its spring is relaxed."""
        return self._position(joint), self.angle(joint.spring_reference, joint.in_degrees)

    def coupled(self, coupling: Coupling) -> tuple[int, int, int, list[tuple[int, int]]]:
        """The sum that a coupling makes of positions, that in which its spring is relaxed, its rate, and (velocity, its share in that)."""
        joints = {node.joint.name: node for node in self.nodes}
        total, rate, rest, columns = self.zero, self.zero, self.zero, []
        for name, multiple in coupling.joints:
            node, factor = joints[name], self.given(multiple)
            slope = self.product(factor, self.given(node.joint.multiplier))
            total = self.sum(total, self.product(factor, self._position(node.joint)))
            rate = self.sum(rate, self.product(slope, self._first_rate + node.columns[0]))
            rest = self.sum(rest, self.product(factor, self.angle(node.joint.spring_reference, node.joint.in_degrees)))
            columns.append((node.columns[0], slope))
        return total, rest if coupling.rest is None else self.given(coupling.rest), rate, columns

    def _couple(self, coupling: Coupling, found: Three) -> None:
        """Add the forces of a coupling to the generalised forces ``found``."""
        total, rest, rate, columns = self.coupled(coupling)
        stretch = self.difference(total, rest)
        tension = self._tension(coupling, stretch, rate)
        for column, slope in columns:
            found[column] = self.difference(found[column], self.product(slope, tension))
