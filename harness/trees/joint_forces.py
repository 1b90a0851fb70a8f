"""Springs and dampers in the joints of a tree, and those that couple joints, as terms of a program.

Sources: MuJoCo documentation, XML reference, joint and tendon/fixed; http://wiki.ros.org/urdf/XML/joint, dynamics.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from harness.files.tree import Coupling, Joint, Spring
from harness.programs.terms import Term, Vector, length
from harness.trees.bodies.spatial import FileBuilder, angle
from harness.trees.nodes import Kinematics


@dataclass(frozen=True)
class Line:
    """A length on which a spring and a damper act, and the rate at which it grows."""

    of: Spring | Coupling
    rate: Term

    def tension(self, builder: FileBuilder, stretch: Term) -> Term:
        """The tension where the length is beyond the free one by ``stretch``."""
        stiffness = builder.number(self.of.stiffness) * stretch
        return stiffness + builder.number(self.of.damping) * self.rate


def tension_between(builder: FileBuilder, spring: Spring, ends: Sequence[tuple[Vector, Vector]]) -> tuple[Term, Vector, Line]:
    """The tension of a spring between two points, whose positions and velocities are ``ends``; its direction, and the length."""
    (first, rate_of_first), (second, rate_of_second) = ends
    between = second + -first
    distance = length(between)
    along = between / distance
    line = Line(spring, along @ (rate_of_second + -rate_of_first))
    return line.tension(builder, distance - spring.free_length), along, line


def forces_of_joints(nodes: Kinematics, lines: list[Line] | None = None) -> Vector:
    """The generalised force [N or N m] of springs, dampers and couplings on each velocity; the couplings' are added to ``lines``."""
    builder, coordinates = nodes.builder, nodes.coordinates
    found = builder.zeros(nodes.nv)
    for node in nodes.nodes:
        joint, multiplier = node.joint, builder.number(node.joint.multiplier)
        for column in node.columns if joint.damping else ():
            rate = multiplier * coordinates.velocities[column]
            found[column] = found[column] - multiplier * (builder.number(joint.damping) * rate)
        if joint.stiffness and joint.kind.is_single:
            (column,) = node.columns
            position, rest = position_and_rest(nodes, joint)
            stretch = position - rest
            found[column] = found[column] - multiplier * (builder.number(joint.stiffness) * stretch)
    for coupling in nodes.tree.couplings:
        total, rest, rate, columns = coupled(nodes, coupling)
        stretch, line = total - rest, Line(coupling, rate)
        tension = line.tension(builder, stretch)
        for column, slope in columns:
            found[column] = found[column] - slope * tension
        if lines is not None:
            lines.append(line)
    return found


def position_and_rest(nodes: Kinematics, joint: Joint) -> tuple[Term, Term]:
    """The position of a hinge or slide, and that in which its spring is relaxed."""
    return nodes.coordinates.position(joint), angle(nodes.builder, joint.spring_reference, joint.in_degrees)


def coupled(nodes: Kinematics, coupling: Coupling) -> tuple[Term, Term, Term, list[tuple[int, Term]]]:
    """The sum that a coupling makes of positions, that in which its spring is relaxed, its rate, and (velocity, its share in that)."""
    builder, joints = nodes.builder, {node.joint.name: node for node in nodes.nodes}
    total, rate, rest, columns = builder.zero, builder.zero, builder.zero, []
    for name, multiple in coupling.joints:
        node, factor = joints[name], builder.number(multiple)
        slope = factor * builder.number(node.joint.multiplier)
        total = total + factor * nodes.coordinates.position(node.joint)
        rate = rate + slope * nodes.coordinates.velocities[node.columns[0]]
        rest = rest + factor * angle(builder, node.joint.spring_reference, node.joint.in_degrees)
        columns.append((node.columns[0], slope))
    return total, rest if coupling.rest is None else builder.number(coupling.rest), rate, columns
