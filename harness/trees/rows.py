"""The constraints of a model file as rows on the moving bodies of its tree: where each acts, and what it asks of accelerations.

A row is written once, by the moments and forces that its multiplier means on nodes, and the generalised forces on velocities. What it
asks of accelerations follows from these, since both are one Jacobian: of bodies kept free, and of the tree's own velocities.

Source: Goldstein, Poole, Safko, Classical Mechanics, 3rd ed., sections 1.3 (constraints) and 2.4 (multipliers); Featherstone, Rigid
Body Dynamics Algorithms, section 3.2 (constraints on position, and their derivatives).
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from harness.files.equalities import (
    AnyRows,
    DryFriction,
    Equality,
    Limit,
    Linkage,
    Meeting,
    Polygon,
    Rows,
    Sum,
    Tendon,
    TendonLinkage,
    Weld,
)
from harness.files.given import Pose
from harness.files.touching import Touch
from harness.files.tree import WORLD, Tree
from harness.programs.terms import Matrix, Term, Vector, cross, dot, length, sqrt, vector
from harness.trees.bodies.rigid import spatial
from harness.trees.bodies.spatial import Frame, angle, placed
from harness.trees.row import Row, opposed
from harness.trees.world_motion import World

# Joints and the multiples of their positions.
Terms = Sequence[tuple[str, Fraction]]


def untied(tree: Tree, joints: Sequence[str]) -> Tree:
    """A tree in which those of ``joints`` that follow another move by themselves, as rows of constraints couple them."""
    bodies = tuple(
        replace(
            body,
            joints=tuple(
                replace(joint, follows="", multiplier=type(joint).multiplier, offset=type(joint).offset)
                if joint.follows and joint.name in joints
                else joint
                for joint in body.joints
            ),
        )
        for body in tree.bodies
    )
    return replace(tree, bodies=bodies)


def rows_in(world: World, constraints: Mapping[str, AnyRows]) -> list[Row]:
    """The rows of constraints by their names.

    Raises:
        KeyError: one is about a body or joint that the tree does not have.
    """
    return [row for name, one in constraints.items() for row in _rows_of(world, name, one)]


# Kinds.


def _rows_of(world: World, name: str, constraint: AnyRows) -> list[Row]:
    if isinstance(constraint, Meeting):
        return _held(world, name, constraint)
    if isinstance(constraint, DryFriction | Limit):
        return _bounded(world, name, constraint)
    if isinstance(constraint, Touch):
        # Most rows are of no contact.
        from harness.trees.touching_rows import touching_rows

        return touching_rows(world, name, constraint)
    if isinstance(constraint, TendonLinkage):
        sums: list[Terms] = [tendon.terms for tendon in constraint.tendons if isinstance(tendon, Sum)]
    else:
        sums = [((joint, Fraction(1)),) for joint in (constraint.joint, constraint.leader) if joint is not None]
    follower, *leaders = sums
    return [_coupled(world, name, follower, leaders, world.kinematics.builder.vector(constraint.coefficients))]


def _held(world: World, name: str, meeting: Meeting) -> list[Row]:
    """That two points meet; and of frames, that they turn alike."""
    builder, nodes = world.kinematics.builder, world.kinematics
    signs = builder.number(1), builder.number(-1)
    numbers, arms, positions, drawn, turns = [], [], [], [], []
    for body, own in zip(meeting.bodies, _frames_of(world, meeting), strict=True):
        number, frame = nodes.frames[body]
        one = world.moving[number] if number >= 0 else None
        turn, arm = frame.turn @ own.turn, frame.at(own.shift)
        if one is not None:
            turn, arm = one.orientation @ turn, one.orientation @ arm
        spin = world.still if one is None else one.spin
        numbers.append(number)
        arms.append(arm)
        positions.append(arm if one is None else one.position + arm)
        drawn.append(cross(spin, cross(spin, arm)))
        turns.append(turn)
    found = []
    for axis, unit in enumerate(builder.identity):
        acts = [
            (number, spatial(sign * cross(arm, unit), sign * unit))
            for number, arm, sign in zip(numbers, arms, signs, strict=True)
            if number >= 0
        ]
        residual, known = (values[0][axis] - values[1][axis] for values in (positions, drawn))
        found.append(Row(name, residual, known, tuple(acts)))
    return found + (_turned_alike(world, name, meeting, numbers, turns) if isinstance(meeting, Weld) else [])


def _turned_alike(world: World, name: str, weld: Weld, numbers: Sequence[int], turns: Sequence[Matrix]) -> list[Row]:
    """The rows of the orientations of two frames, written along the axes of the second.

    With the quaternion (w, u) between them and the angular velocity s of the first against the second, u' = (w s + s x u) / 2 and
    w' = -s . u / 2.
    """
    builder = world.kinematics.builder
    half = builder.number(Fraction(1, 2))
    between = turns[1].T @ turns[0]
    trace = (between[0, 0] + between[1, 1]) + between[2, 2]
    doubled = sqrt(builder.number(1) + trace)
    across = vector(between[(axis + 2) % 3, (axis + 1) % 3] - between[(axis + 1) % 3, (axis + 2) % 3] for axis in range(3))
    w = half * doubled
    u = vector((half * value) / doubled for value in across)
    first, second = (world.moving[number].spin if number >= 0 else world.still for number in numbers)
    spin = turns[1].T @ (first + -second)

    def rate(of: Vector, real: Term, imaginary: Vector) -> Vector:
        return half * (real * of + cross(of, imaginary))

    # The axes of the second frame turn with it.
    drawn = rate(-cross(turns[1].T @ second, spin), w, u)
    moved = rate(spin, -(half * (spin @ u)), rate(spin, w, u))
    scale, found = builder.number(weld.torque_scale), []
    for axis, unit in enumerate(builder.identity):
        along = w * unit + cross(u, unit)
        moment = turns[1] @ ((scale * half) * along)
        acts = [
            (number, spatial(builder.number(sign) * moment, world.still))
            for number, sign in zip(numbers, (1, -1), strict=True)
            if number >= 0
        ]
        known = scale * (drawn[axis] + moved[axis])
        found.append(Row(name, scale * u[axis], known, tuple(acts)))
    return found


def _frames_of(world: World, meeting: Meeting) -> list[Frame]:
    """Either frame in its body; of a second that is not given, where the first is at the reference."""
    builder = world.kinematics.builder
    first = placed(builder, meeting.first)
    if meeting.second is not None:
        return [first, placed(builder, meeting.second)]
    frames, floating = {WORLD: Frame(builder.identity, builder.still)}, dict(meeting.floating)
    for body in world.kinematics.tree.bodies:
        pose: Pose = floating.get(body.name, body.pose)
        frames[body.name] = placed(builder, pose, frames[body.parent])
    frame, own = (frames[name] for name in meeting.bodies)
    there = placed(builder, meeting.first, frame)
    return [first, Frame(own.turn.T @ there.turn, own.turn.T @ (there.shift + -own.shift))]


def _bounded(world: World, name: str, constraint: DryFriction | Limit) -> list[Row]:
    """That velocities rub; or that a length keeps its distance to a limit."""
    builder = world.kinematics.builder
    if isinstance(constraint, DryFriction) and isinstance(constraint.of, str):
        return [Row(name, builder.zero, builder.zero, on_columns=(one,)) for one in _velocities_of(world, constraint.of)]
    own = _length(world, name, constraint.of)
    if isinstance(constraint, DryFriction):
        return [replace(own, residual=builder.zero)]
    bound = angle(builder, constraint.bound, constraint.in_degrees)
    distance = bound - own.residual if constraint.is_upper else own.residual - bound
    own = replace(own, residual=distance - builder.number(constraint.margin))
    return [opposed(own) if constraint.is_upper else own]


def _length(world: World, name: str, of: str | Tendon) -> Row:
    """A length as a row that leaves all of it: the position of a joint, the angle of a ball joint, or the length of a tendon."""
    builder, zero = world.kinematics.builder, world.kinematics.builder.zero
    if isinstance(of, Polygon):
        return _along_polygon(world, name, of)
    joints = {node.joint.name: node.joint for node in world.kinematics.nodes}
    if isinstance(of, str) and not joints[of].kind.is_single:
        return _turn(world, name, of)
    total, columns = zero, list[tuple[int, Term]]()
    for joint, multiple in ((of, Fraction(1)),) if isinstance(of, str) else of.terms:
        factor = builder.number(multiple)
        total = total + factor * world.kinematics.coordinates.position(joints[joint])
        columns += [(column, factor * own) for column, own in _velocities_of(world, joint)]
    return Row(name, total, zero, on_columns=tuple(columns))


def _turn(world: World, name: str, joint: str) -> Row:
    """The angle of a ball joint, between 0 and half a turn.

    With the quaternion (w, s a) and the velocity v in the body, s >= 0, the angle is 2 atan2(s, |w|), and its rate +-a . v with the sign of
    w; what changes that besides the accelerations is |w| / 2 s (v^2 - (a . v)^2).
    """
    builder, coordinates = world.kinematics.builder, world.kinematics.coordinates
    w, *rest = coordinates.positions[joint]
    sine, cosine, columns = length(vector(rest)), sqrt(w * w), coordinates.columns[joint]
    turn, velocity = builder.number(2) * builder.add("atan2", sine, cosine), coordinates.velocities[columns]
    axis = vector((w / cosine) * (part / sine) for part in rest)
    rate = axis @ velocity
    known = (cosine / (builder.number(2) * sine)) * (velocity @ velocity - rate * rate)
    return Row(name, turn, known, on_columns=tuple(zip(columns, axis, strict=True)))


def _along_polygon(world: World, name: str, polygon: Polygon) -> Row:
    """The length of a polygon, with e the direction of a side and u the velocity along it: known besides is (u^2 - (e . u)^2) / |side|."""
    found = Row(name, world.kinematics.builder.zero, world.kinematics.builder.zero)
    for first, second in itertools.pairwise(_point(world, body, pose) for body, pose in polygon.points):
        between, relative = second.position - first.position, second.velocity - first.velocity
        side = length(between)
        along = between / side
        rate = along @ relative
        drawn = along @ (second.drawn - first.drawn) + (relative @ relative - rate * rate) / side
        acts = [(one.number, spatial(cross(one.arm, force), force)) for one, force in ((first, -along), (second, along)) if one.number >= 0]
        found = replace(found, residual=found.residual + side, known=found.known + drawn, on_nodes=(*found.on_nodes, *acts))
    return found


@dataclass(frozen=True)
class _Point:
    """A point of a body: the number of its node, its arm from there, position and velocity, and its acceleration by the node's spin."""

    number: int
    arm: Vector
    position: Vector
    velocity: Vector
    drawn: Vector


def _point(world: World, body: str, pose: Pose) -> _Point:
    number, frame = world.kinematics.frames[body]
    arm = frame.at(placed(world.kinematics.builder, pose).shift)
    if number < 0:
        return _Point(number, arm, arm, world.still, world.still)
    one = world.moving[number]
    arm = one.orientation @ arm
    return _Point(number, arm, one.position + arm, one.velocity_at(arm), cross(one.spin, cross(one.spin, arm)))


def _velocities_of(world: World, joint: str) -> list[tuple[int, Term]]:
    """The places of the velocities of a joint, and by which it moves with each."""
    node = next(node for node in world.kinematics.nodes if node.joint.name == joint)
    return [(column, world.kinematics.builder.number(node.joint.multiplier)) for column in node.columns]


def _coupled(world: World, name: str, follower: Terms, leaders: Sequence[Terms], coefficients: Vector) -> Row:
    """That a sum of joint positions is a polynomial of another such sum, of one leader or none."""
    builder = world.kinematics.builder
    position, columns = _summed(world, follower)
    constant, *_ = coefficients
    if not leaders:
        return Row(name, position - constant, builder.zero, on_columns=tuple(columns))
    moved, led = _summed(world, leaders[0])
    value = slope = curvature = builder.zero
    # Horner's scheme, with the derivatives by the leader's position.
    for coefficient in reversed(coefficients):
        curved = curvature * moved
        curvature = curved + builder.number(2) * slope
        slope = slope * moved + value
        value = value * moved + coefficient
    rate = dot([factor for _, factor in led], [world.kinematics.coordinates.velocities[column] for column, _ in led], builder.zero)
    columns += [(column, -(factor * slope)) for column, factor in led]
    known = -(curvature * (rate * rate))
    return Row(name, position - value, known, on_columns=tuple(columns))


def _summed(world: World, terms: Terms) -> tuple[Term, list[tuple[int, Term]]]:
    """A sum of multiples of positions, each from its reference, and by which each velocity changes it."""
    builder, nodes = world.kinematics.builder, {node.joint.name: node for node in world.kinematics.nodes}
    total, columns = builder.zero, []
    for name, multiple in terms:
        joint, factor = nodes[name].joint, builder.number(multiple)
        moved = world.kinematics.coordinates.position(joint) - angle(builder, joint.reference, joint.in_degrees)
        total = total + factor * moved
        columns.append((nodes[name].columns[0], factor * builder.number(joint.multiplier)))
    return total, columns


def rows_of(tree: Tree, constraints: Iterable[Equality]) -> dict[str, Rows]:
    """Rows that constraints of a model give of its tree, by name, without those that the tree holds by itself, whose joint follows another.

    Raises:
        ValueError: one couples tendons.
    """
    followers = {joint.name for joint in tree.joints if joint.follows}
    found: dict[str, Rows] = {}
    for one in constraints:
        if one.says is None or isinstance(one.says, TendonLinkage):
            raise ValueError(f"line {one.line}: constraint {one.name!r} couples {one.couples}s, which have no rows here")
        if not (isinstance(one.says, Linkage) and one.says.joint in followers):
            found[one.name] = one.says
    return found
