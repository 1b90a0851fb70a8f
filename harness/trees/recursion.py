"""The equations of motion of a tree of bodies by recursion over it: M by composite bodies, forces by Newton and Euler.

Everything is written in the frames of the bodies, with motions as (angular velocity, velocity of the frame's origin) and
forces as (moment about it, force). It shares no expression with Lagrange's equations: no energy, no derivative. Beside them stand
springs, dampers and inertias, of joints, between points, and of what couples joints, the forces that carry the weights of bodies with
gravity compensation, and the parts of forces that an integrator takes implicitly.

Sources: Featherstone, Rigid Body Dynamics Algorithms, sections 5.3 (recursive Newton-Euler), 6.2 (composite rigid bodies) and
2.8 to 2.13 (the vectors and their products); MuJoCo documentation, XML reference, joint, body/gravcomp, tendon/fixed and
tendon/spatial;
http://wiki.ros.org/urdf/XML/joint, dynamics.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np

from harness.files.given import Pose
from harness.files.joint_kinds import JointKind
from harness.files.tree import Coupling, Joint, Spring, Tree
from harness.programs.derivatives import along
from harness.programs.program import upper_triangle
from harness.programs.terms import Term, Vector, cross, length, vector
from harness.trees.bodies.rigid import Spatial, power, spatial
from harness.trees.bodies.spatial import FileBuilder, FileProgram, angle, of_quaternion, placed, quaternion_of, rotation_vector, sign_of
from harness.trees.nodes import Kinematics, Node, Point, composite_inertias, kinematics

if TYPE_CHECKING:
    from harness.programs.mechanisms.actuation import Actuation
    from harness.trees.actuators import Driven

JOINT_DAMPING, JOINT_STIFFNESS = "joint damping", "joint stiffness"
LINES, LINE_DAMPING, LINE_STIFFNESS = "lines", "line damping", "line stiffness"


def recursion_program(tree: Tree, joints: Sequence[str], linear_velocity_in_body: bool = False) -> FileProgram:
    """The program of a tree; q, v and tau follow ``joints``, inputs and outputs are those of ``harness.programs.kernels``.

    A rotation stands in q as a quaternion (w, x, y, z) of any length, its velocity in v in the body's frame, both behind the
    position of a free joint, whose velocity is in the frame of the parent, or in that of the body. A planar joint has its position
    in its plane, x and y, and its turn. The parameters are the numbers of the file, but for zeros and the lengths of directions
    along an axis.

    Raises:
        ValueError: the tree has other joints.
    """
    nodes = kinematics(tree, joints, linear_velocity_in_body)
    outputs, _ = equations_of_motion(nodes)
    return nodes.builder.written(outputs)


def actuated_program(tree: Tree, joints: Sequence[str]) -> tuple[FileProgram, Actuation | None]:
    """``recursion_program``, and the parameters of it that each state has of its own; None for a tree without actuators."""
    nodes = kinematics(tree, joints)
    outputs, _ = equations_of_motion(nodes)
    if not tree.actuators:
        return nodes.builder.written(outputs), None
    from harness.trees.actuators import actuation_of

    return nodes.builder.written(outputs), actuation_of(nodes, driven_by_actuators(nodes))


def equations_of_motion(nodes: Kinematics) -> tuple[Mapping[str, Sequence[Term]], list[Line]]:
    """The terms of the equations of motion by their names, and the lengths on which springs and dampers act."""
    velocities, lines = _velocities(nodes), list[Line]()
    passive = _passive_forces(nodes, velocities, lines)
    outputs = {
        "mass": mass_matrix(nodes),
        "velocity": _velocity_terms(nodes, velocities),
        "gravity": _gravity_terms(nodes),
        "passive": passive + driven_by_actuators(nodes).forces if nodes.tree.actuators else passive,
    }
    return outputs, lines


def driven_by_actuators(nodes: Kinematics) -> Driven:
    """The forces of the actuators of a tree, with what these compensate of gravity."""
    # Imported late: most trees have none.
    from harness.trees.actuators import driven

    carried = _carried(nodes, by_actuators=True) if nodes.tree.actuators else nodes.builder.zeros(nodes.nv)
    return driven(nodes, generalised, carried)


def _down(node: Node, motion: Spatial) -> Spatial:
    """A motion of the parent's frame, as one of the node's."""
    (angular, linear), back = motion, node.frame.turn.T
    return spatial(back @ angular, back @ (linear + cross(angular, node.frame.shift)))


def _of_joint(nodes: Kinematics, node: Node) -> Spatial:
    """The motion that the joint's velocities give its frame."""
    found = nodes.still
    for motion, column in node.rates:
        found = found + nodes.coordinates.velocities[column] * motion
    return found


def _velocities(nodes: Kinematics) -> list[Spatial]:
    found: list[Spatial] = []
    for node in nodes.nodes:
        before = found[node.parent] if node.parent >= 0 else nodes.still
        found.append(_down(node, before) + _of_joint(nodes, node))
    return found


def generalised(nodes: Kinematics, forces: Sequence[Spatial]) -> Vector:
    """The generalised forces of the given forces on the nodes."""
    found, carried = nodes.builder.zeros(nodes.nv), list(forces)
    for number in reversed(range(len(nodes.nodes))):
        node = nodes.nodes[number]
        for motion, column in node.rates:
            # A joint and those that mimic it share a column.
            found[column] = found[column] + power(motion, carried[number])
        if node.parent >= 0:
            carried[node.parent] = carried[node.parent] + node.up(carried[number])
    return found


def _velocity_terms(nodes: Kinematics, velocities: Sequence[Spatial]) -> Vector:
    forces = []
    for node, (angular, linear), acceleration in zip(nodes.nodes, velocities, _drawn(nodes, velocities), strict=True):
        moment, momentum = node.rigid.momentum((angular, linear))
        gyroscopic = spatial(cross(angular, moment) + cross(linear, momentum), cross(angular, momentum))
        forces.append(node.rigid.momentum(acceleration) + gyroscopic)
    return generalised(nodes, forces) + of_reflected_inertias(nodes)


def _drawn(nodes: Kinematics, velocities: Sequence[Spatial]) -> list[Spatial]:
    """The acceleration of each node where no velocity of a joint changes."""
    found: list[Spatial] = []
    for node, (angular, linear) in zip(nodes.nodes, velocities, strict=True):
        of_joint = _of_joint(nodes, node)
        before = found[node.parent] if node.parent >= 0 else nodes.still
        turning = spatial(cross(angular, of_joint[0]), cross(angular, of_joint[1]) + cross(linear, of_joint[0]))
        found.append((_down(node, before) + turning) + node.bias)
    return found


def drift(nodes: Kinematics, spring: Spring) -> Term:
    """The second derivative of a spring's length where no velocity changes: J' v, with J the Jacobian of the length.

    With e the direction of the line, u the velocity and a the acceleration of its end beside its start: e . a + (u^2 - (e . u)^2) / length.
    """
    velocities, moved = _velocities(nodes), list[tuple[Vector, Vector, Vector]]()
    accelerations = _drawn(nodes, velocities)
    for point in (nodes.point(body, pose) for body, pose in spring.ends):
        (angular, linear), (turning, drawn) = (
            (own[point.number] if point.number >= 0 else nodes.still) for own in (velocities, accelerations)
        )
        rate = linear + cross(angular, point.arm)
        # Of a point, whose velocity is in axes that turn.
        acceleration = drawn + cross(turning, point.arm) + cross(angular, rate)
        moved.append((point.position, point.orientation @ rate, point.orientation @ acceleration))
    between, relative, apart = (second + -first for first, second in zip(*moved, strict=True))
    distance = length(between)
    along = between / distance
    rate_of_length = along @ relative
    found: Term = along @ apart + (relative @ relative - rate_of_length * rate_of_length) / distance
    return found


def of_reflected_inertias(nodes: Kinematics) -> Vector:
    """Velocity terms of inertias of what v has no constant share in: tendons between points, and rotors of free joints.

    A rotor is an inertia of components u of the linear velocity, which may be along other axes than v has. Where the axes of v turn at w in
    those of u, the force J u' is J (v' + w x v) along the axes of v.
    """
    builder, coordinates = nodes.builder, nodes.coordinates
    found = builder.zeros(nodes.nv)
    for one in nodes.reflected():
        if one.spring is not None:
            force = one.inertia * drift(nodes, one.spring)
            for column, slope in one.slopes:
                found[column] = found[column] + slope * force
    for node in nodes.nodes:
        joint = node.joint
        if joint.kind != JointKind.FREE or not joint.armature or joint.rotors_in_body is coordinates.is_in_body:
            continue
        linear, spin = np.split(coordinates.velocities[node.columns], 2)
        if joint.rotors_in_body:
            spin = -(of_quaternion(coordinates.positions[joint.name][-4:]) @ spin)
        found[node.columns[:3]] = builder.number(joint.armature) * cross(spin, linear)
    return found


def _upward(nodes: Kinematics) -> list[Spatial]:
    """The acceleration against gravity, in the frame of each node."""
    upward = spatial(nodes.builder.still, -nodes.builder.vector(nodes.tree.gravity))
    found: list[Spatial] = []
    for node in nodes.nodes:
        found.append(_down(node, found[node.parent] if node.parent >= 0 else upward))
    return found


def _gravity_terms(nodes: Kinematics) -> Vector:
    return generalised(nodes, [node.rigid.momentum(one) for node, one in zip(nodes.nodes, _upward(nodes), strict=True)])


def mass_matrix(nodes: Kinematics) -> list[Term]:
    """The upper triangle of M by rows."""

    def carried(number: int, force: Spatial) -> Iterator[tuple[int, Spatial]]:
        for at in nodes.up_from(number):
            yield at, force
            force = nodes.nodes[at].up(force)

    rigids = [node.rigid for node in nodes.nodes]
    entries = composite_inertias(nodes, [node.rates for node in nodes.nodes], rigids, [node.frame for node in nodes.nodes], carried)
    return [entries.get(pair, nodes.builder.zero) for pair in upper_triangle(nodes.nv)]


def _passive_forces(nodes: Kinematics, velocities: Sequence[Spatial], lines: list[Line]) -> Vector:
    """Those of springs and dampers, and what carries weights; what springs and dampers act on is added to ``lines``."""
    builder, found = nodes.builder, forces_of_joints(nodes, lines)
    on_nodes = _upwards(nodes, nodes.compensated())
    for spring in nodes.tree.springs:
        ends = [_end(nodes, body, pose, velocities) for body, pose in spring.ends]
        tension, along, line = tension_between(builder, spring, [(point.position, rate) for point, rate in ends])
        lines.append(line)
        for sign, (point, _) in zip((1, -1), ends, strict=True):
            if point.number >= 0:
                force = point.orientation.T @ ((builder.number(sign) * tension) * along)
                on_nodes[point.number] = on_nodes[point.number] + spatial(cross(point.arm, force), force)
    return found + generalised(nodes, on_nodes)


def _upwards(nodes: Kinematics, compensated: Sequence[tuple[int, Term, Vector]]) -> list[Spatial]:
    """The forces on the nodes that carry weights, as of ``Kinematics.compensated``."""
    found, upward = [nodes.still] * len(nodes.nodes), _upward(nodes) if compensated else []
    for number, mass, centre in compensated:
        force = mass * upward[number][1]
        found[number] = found[number] + spatial(cross(centre, force), force)
    return found


def _carried(nodes: Kinematics, by_actuators: bool) -> Vector:
    """The generalised forces that carry weights which actuators of some joints carry: on these joints, or on the others."""
    found, compensated = nodes.builder.zeros(nodes.nv), nodes.compensated(by_actuators=True)
    forces = generalised(nodes, _upwards(nodes, compensated)) if compensated else found
    for node in nodes.nodes:
        if node.joint.compensated_by_actuators is by_actuators:
            found[node.columns] = forces[node.columns]
    return found


def _end(nodes: Kinematics, body: str, pose: Pose, velocities: Sequence[Spatial]) -> tuple[Point, Vector]:
    """A point of a body, and its velocity in the world."""
    point = nodes.point(body, pose)
    if point.number < 0:
        return point, nodes.builder.still
    angular, linear = velocities[point.number]
    return point, point.orientation @ (linear + cross(angular, point.arm))


# Steps.


@dataclass(frozen=True)
class StepForces(FileProgram):
    """The equations of motion of a tree, and the parts of its forces that an integrator may take implicitly.

    The program is that of ``recursion_program`` with further outputs: "joint damping" and "joint stiffness" (nv each), the minus
    derivatives of what springs and dampers in joints do; "lines" (m, nv) by rows, the derivatives by the velocities of the rates of
    the lengths that springs and dampers act on; "line damping" and "line stiffness" (m each).

    Attributes:
        related: pairs (i, j), i <= j, of velocities one of which moves all that the other moves.
        floating: the first places in v of the free joints of bodies that carry no other joint.
    """

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
        LINE_DAMPING: vector([line.damping for line in lines]),
        LINE_STIFFNESS: vector([line.stiffness for line in lines]),
    }
    carrying = {node.parent for node in nodes.nodes}
    alone = [node for number, node in enumerate(nodes.nodes) if node.joint.kind == JointKind.FREE and number not in carrying]
    floating = tuple(node.columns[0] for node in alone)
    own = builder.written(outputs)
    return StepForces(own.program, own.parameters, nodes.related, floating)


def _of_joints(nodes: Kinematics, coefficient: str) -> Vector:
    found = nodes.builder.zeros(nodes.nv)
    for node in nodes.nodes:
        value = node.of_velocity(coefficient)
        for column in node.columns:
            found[column] = found[column] + value
    for coupling in nodes.tree.couplings if coefficient == "damping" else ():
        for column, slope in nodes.slopes(coupling) if coupling.in_joint else ():
            found[column] = found[column] + (slope * slope) * nodes.of_gear(coupling, coupling.damping)
    return found


@dataclass(frozen=True)
class Line:
    """A length on which a spring and a damper act, and the rate at which it grows."""

    stiffness: Term
    damping: Term
    rate: Term

    def tension(self, stretch: Term) -> Term:
        """The tension where the length is beyond the free one by ``stretch``."""
        return self.stiffness * stretch + self.damping * self.rate


def tension_between(builder: FileBuilder, spring: Spring, ends: Sequence[tuple[Vector, Vector]]) -> tuple[Term, Vector, Line]:
    """The tension of a spring between two points, whose positions and velocities are ``ends``; its direction, and the length."""
    (first, rate_of_first), (second, rate_of_second) = ends
    between = second + -first
    distance = length(between)
    along = between / distance
    stretch, share = taut(distance, builder.number(spring.free_length), spring.slack_to)
    line = Line(share * builder.number(spring.stiffness), builder.number(spring.damping), along @ (rate_of_second + -rate_of_first))
    return line.tension(stretch), along, line


def taut(length_now: Term, rest: Term, slack_to: Fraction | None) -> tuple[Term, Term]:
    """The stretch of a spring of a length, which is slack from ``rest`` to ``slack_to``, and 1 where it acts, 0 where it is slack."""
    if slack_to is None:
        return length_now - rest, length_now.builder.number(1)
    one, half = length_now.builder.number(1), length_now.builder.number(Fraction(1, 2))
    beyond, short = length_now - length_now.builder.number(slack_to), rest - length_now
    # Both are 1 at their ends, where half an ulp more has the larger derivative.
    is_long, is_short = (half * (one + sign_of(part)) for part in (beyond, short))
    return is_long * beyond - is_short * short, is_long + is_short


def forces_of_joints(nodes: Kinematics, lines: list[Line] | None = None) -> Vector:
    """The generalised force [N or N m] of springs, dampers and couplings on each velocity; the couplings' are added to ``lines``.

    With what compensates gravity on joints beside those on which actuators do.
    """
    builder, coordinates = nodes.builder, nodes.coordinates
    found = _carried(nodes, by_actuators=False)
    for node in nodes.nodes:
        joint, multiplier = node.joint, builder.number(node.joint.multiplier)
        for column in node.columns if joint.damping else ():
            rate = multiplier * coordinates.velocities[column]
            found[column] = found[column] - multiplier * (builder.number(joint.damping) * rate)
        for column, stretch in zip(node.columns, stretched(nodes, joint), strict=True) if joint.stiffness else ():
            found[column] = found[column] - multiplier * (builder.number(joint.stiffness) * stretch)
    for coupling in nodes.tree.couplings:
        total, rest, rate, columns = coupled(nodes, coupling)
        stretch, share = taut(total, rest, coupling.slack_to)
        line = Line(share * builder.number(coupling.stiffness), nodes.of_gear(coupling, coupling.damping), rate)
        tension = line.tension(stretch)
        for column, slope in columns:
            found[column] = found[column] - slope * tension
        if lines is not None and not coupling.in_joint:
            lines.append(line)
    return found


def position_and_rest(nodes: Kinematics, joint: Joint) -> tuple[Term, Term]:
    """The position of a hinge or slide, and that in which its spring is relaxed."""
    return nodes.coordinates.position(joint), angle(nodes.builder, joint.spring_reference, joint.in_degrees)


def stretched(nodes: Kinematics, joint: Joint) -> Vector:
    """The position of a joint against that in which its spring is relaxed, along each of its velocities [m or rad].

    Of a ball joint that is its zero, of a free one where the file has its body start; a rotation is a vector along its axis.
    """
    builder, coordinates = nodes.builder, nodes.coordinates
    if joint.kind.is_single:
        position, rest = position_and_rest(nodes, joint)
        return vector([position - rest])
    start = next(body.start for body in nodes.tree.bodies if joint in body.joints)
    at_rest, positions = placed(builder, start), coordinates.positions[joint.name]
    is_turned, turn = any(one.rotation for one in start), of_quaternion(positions[-4:])
    rotation = rotation_vector(quaternion_of(at_rest.turn.T @ turn) if is_turned else positions[-4:])
    if not joint.kind.linear:
        return rotation
    shift = positions[:3] + -at_rest.shift
    return np.concatenate([turn.T @ shift if coordinates.is_in_body else shift, rotation])


def coupled(nodes: Kinematics, coupling: Coupling) -> tuple[Term, Term, Term, list[tuple[int, Term]]]:
    """The sum that a coupling makes of positions, that in which its spring is relaxed, its rate, and (velocity, its share in that)."""
    builder, joints = nodes.builder, {node.joint.name: node.joint for node in nodes.nodes}
    total, rate, rest, columns = builder.zero, builder.zero, builder.zero, nodes.slopes(coupling)
    for name, multiple in coupling.joints:
        joint, factor = joints[name], builder.number(multiple)
        total = total + factor * nodes.coordinates.position(joint)
        rest = rest + factor * angle(builder, joint.spring_reference, joint.in_degrees)
    for column, slope in columns:
        rate = rate + slope * nodes.coordinates.velocities[column]
    return total, rest if coupling.rest is None else builder.number(coupling.rest), rate, columns
