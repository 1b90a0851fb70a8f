"""The constraints of a model file as rows on the moving bodies of its tree: where each acts, and what it asks of accelerations.

A row is written once, by the moments and forces that its multiplier means on nodes, and the generalised forces on velocities. What it
asks of accelerations follows from these, since both are one Jacobian: of bodies kept free, and of the tree's own velocities.

Source: Goldstein, Poole, Safko, Classical Mechanics, 3rd ed., sections 1.3 (constraints) and 2.4 (multipliers); Featherstone, Rigid
Body Dynamics Algorithms, section 3.2 (constraints on position, and their derivatives).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path

from harness.equations.constraints import BIAS, JACOBIAN, RATE, RESIDUAL
from harness.files.constraints import UNTURNED, End, FrameConstraint, JointConstraint, ModelConstraint, PointConstraint
from harness.files.equalities import Linkage, Meeting, Rows, TendonLinkage, Weld
from harness.files.tree import WORLD, Given, Place, Placement, Pose, Quaternion, Tree, vector
from harness.robots.nodes import Pair
from harness.robots.spatial import Matrix, Three, transposed
from harness.robots.world_motion import Moving, WorldWriter

# Joints and the multiples of their positions.
Terms = Sequence[tuple[str, Fraction]]


@dataclass(frozen=True)
class Row:
    """One row of a constraint; moments and forces are along the world's axes.

    Attributes:
        constraint: its name.
        on_nodes: (number of a node, moment about the origin of its frame, force) of a multiplier of 1.
        on_columns: (place of a velocity, generalised force).
        residual: what the row leaves.
        known: the part of the row's acceleration that is due to neither the accelerations of nodes nor those of velocities.
    """

    constraint: str
    residual: int
    known: int
    on_nodes: tuple[tuple[int, Three, Three], ...] = ()
    on_columns: tuple[tuple[int, int], ...] = ()


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


class ConstraintWriter(WorldWriter):
    """Writes the rows of a file's constraints."""

    def rows(self, moving: list[Moving], constraints: Mapping[str, Rows]) -> list[Row]:
        """The rows of constraints by their names.

        Raises:
            KeyError: one is about a body or joint that the tree does not have.
        """
        return [row for name, one in constraints.items() for row in self._rows_of(moving, name, one)]

    def jacobian(self, moving: list[Moving], row: Row) -> Three:
        """By which each velocity changes a row, (nv,)."""
        found = [self.zero] * self.nv
        for number, moment, force in row.on_nodes:
            at = number
            while at >= 0:
                arm = self.less(moving[number].position, moving[at].position)
                for (about, along), column in zip(moving[at].motions, moving[at].node.columns, strict=True):
                    power = self.sum(self.dot(moment, about), self.dot(force, self.added(along, self.cross(about, arm))))
                    found[column] = self.sum(found[column], power)
                at = moving[at].node.parent
        for column, factor in row.on_columns:
            found[column] = self.sum(found[column], factor)
        return found

    def rate(self, jacobian: Three) -> int:
        """How fast the velocities change a row."""
        return self.dot(jacobian, range(self._first_rate, self._first_rate + self.nv))

    def biases(self, moving: list[Moving], rows: Sequence[Row]) -> Three:
        """The accelerations that rows have where no velocity changes."""
        carried: list[Pair] = []
        for one in moving:
            spin, acceleration = carried[one.node.parent] if one.node.parent >= 0 else (self.still, self.still)
            acceleration = self.added(self.added(acceleration, self.cross(spin, one.arm)), one.bias[1])
            carried.append((self.added(spin, one.bias[0]), acceleration))
        found = []
        for row in rows:
            total = row.known
            for number, moment, force in row.on_nodes:
                spin, acceleration = carried[number]
                total = self.sum(total, self.sum(self.dot(moment, spin), self.dot(force, acceleration)))
            found.append(total)
        return found

    def equations(self, moving: list[Moving], rows: Sequence[Row]) -> dict[str, Three]:
        """The outputs of ``harness.equations.constraints`` for rows."""
        jacobian = [self.jacobian(moving, row) for row in rows]
        return {
            RESIDUAL: [row.residual for row in rows],
            JACOBIAN: [entry for row in jacobian for entry in row],
            RATE: [self.rate(row) for row in jacobian],
            BIAS: self.biases(moving, rows),
        }

    # Kinds.

    def _rows_of(self, moving: list[Moving], name: str, constraint: Rows) -> list[Row]:
        if isinstance(constraint, Meeting):
            return self._held(moving, name, constraint)
        if isinstance(constraint, TendonLinkage):
            sums: list[Terms] = [tendon.terms for tendon in constraint.tendons]
        else:
            sums = [((joint, Fraction(1)),) for joint in (constraint.joint, constraint.leader) if joint is not None]
        follower, *leaders = sums
        return [self._coupled(name, follower, leaders, self.numbers(constraint.coefficients))]

    def _held(self, moving: list[Moving], name: str, meeting: Meeting) -> list[Row]:
        """That two points meet; and of frames, that they turn alike."""
        signs = self.number(1), self.number(-1)
        numbers, arms, positions, drawn, turns = [], [], [], [], []
        for body, (own_turn, point) in zip(meeting.bodies, self._frames_of(meeting), strict=True):
            number, turn, shift = self.frames[body]
            one = moving[number] if number >= 0 else None
            turn, arm = self.multiplied(turn, own_turn), self.added(shift, self.turned(turn, point))
            if one is not None:
                turn, arm = self.multiplied(one.orientation, turn), self.turned(one.orientation, arm)
            spin = self.still if one is None else one.spin
            numbers.append(number)
            arms.append(arm)
            positions.append(arm if one is None else self.added(one.position, arm))
            drawn.append(self.cross(spin, self.cross(spin, arm)))
            turns.append(turn)
        found = []
        for axis, unit in enumerate(self.identity):
            acts = [
                (number, self.times(sign, self.cross(arm, unit)), self.times(sign, unit))
                for number, arm, sign in zip(numbers, arms, signs, strict=True)
                if number >= 0
            ]
            residual, known = (self.difference(values[0][axis], values[1][axis]) for values in (positions, drawn))
            found.append(Row(name, residual, known, tuple(acts)))
        return found + (self._turned_alike(moving, name, meeting, numbers, turns) if isinstance(meeting, Weld) else [])

    def _turned_alike(self, moving: list[Moving], name: str, weld: Weld, numbers: Sequence[int], turns: Sequence[Matrix]) -> list[Row]:
        """The rows of the orientations of two frames, written along the axes of the second.

        With the quaternion (w, u) between them and the angular velocity s of the first against the second, u' = (w s + s x u) / 2 and
        w' = -s . u / 2.
        """
        half = self.number(Fraction(1, 2))
        between = self.multiplied(transposed(turns[1]), turns[0])
        trace = self.sum(self.sum(between[0][0], between[1][1]), between[2][2])
        doubled = self.add("sqrt", self.sum(self.number(1), trace))
        across = [self.difference(between[(axis + 2) % 3][(axis + 1) % 3], between[(axis + 1) % 3][(axis + 2) % 3]) for axis in range(3)]
        w = self.product(half, doubled)
        u = [self.quotient(self.product(half, value), doubled) for value in across]
        first, second = (moving[number].spin if number >= 0 else self.still for number in numbers)
        spin = self.turned_back(turns[1], self.less(first, second))

        def rate(of: Three, real: int, imaginary: Three) -> Three:
            return self.times(half, self.added(self.times(real, of), self.cross(of, imaginary)))

        # The axes of the second frame turn with it.
        drawn = rate(self.minus(self.cross(self.turned_back(turns[1], second), spin)), w, u)
        moved = rate(spin, self.negative(self.product(half, self.dot(spin, u))), rate(spin, w, u))
        scale, found = self.given(weld.torque_scale), []
        for axis, unit in enumerate(self.identity):
            along = self.added(self.times(w, unit), self.cross(u, unit))
            moment = self.turned(turns[1], self.times(self.product(scale, half), along))
            acts = [
                (number, self.times(self.number(sign), moment), self.still)
                for number, sign in zip(numbers, (1, -1), strict=True)
                if number >= 0
            ]
            known = self.product(scale, self.sum(drawn[axis], moved[axis]))
            found.append(Row(name, self.product(scale, u[axis]), known, tuple(acts)))
        return found

    def _frames_of(self, meeting: Meeting) -> list[tuple[Matrix, Three]]:
        """The orientation and place of either frame in its body; of a second that is not given, where the first is at the reference."""
        first = self.placed(self.identity, self.still, meeting.first)
        if meeting.second is not None:
            return [first, self.placed(self.identity, self.still, meeting.second)]
        frames, floating = {WORLD: (self.identity, self.still)}, dict(meeting.floating)
        for body in self.tree.bodies:
            pose: Pose = floating.get(body.name, body.pose)
            frames[body.name] = self.placed(*frames[body.parent], pose)
        (turn, shift), (own_turn, own_shift) = (frames[name] for name in meeting.bodies)
        there, at = self.placed(turn, shift, meeting.first)
        return [first, (self.multiplied(transposed(own_turn), there), self.turned_back(own_turn, self.less(at, own_shift)))]

    def _coupled(self, name: str, follower: Terms, leaders: Sequence[Terms], coefficients: Three) -> Row:
        """That a sum of joint positions is a polynomial of another such sum, of one leader or none."""
        position, columns = self._summed(follower)
        constant, *_ = coefficients
        if not leaders:
            return Row(name, self.difference(position, constant), self.zero, on_columns=tuple(columns))
        moved, led = self._summed(leaders[0])
        value, slope, curvature = self.zero, self.zero, self.zero
        # Horner's scheme, with the derivatives by the leader's position.
        for coefficient in reversed(coefficients):
            curvature = self.sum(self.product(curvature, moved), self.product(self.number(2), slope))
            slope = self.sum(self.product(slope, moved), value)
            value = self.sum(self.product(value, moved), coefficient)
        rate = self.dot([factor for _, factor in led], [self._first_rate + column for column, _ in led])
        columns += [(column, self.negative(self.product(factor, slope))) for column, factor in led]
        known = self.negative(self.product(curvature, self.product(rate, rate)))
        return Row(name, self.difference(position, value), known, on_columns=tuple(columns))

    def _summed(self, terms: Terms) -> tuple[int, list[tuple[int, int]]]:
        """A sum of multiples of positions, each from its reference, and by which each velocity changes it."""
        nodes = {node.joint.name: node for node in self.nodes}
        total, columns = self.zero, []
        for name, multiple in terms:
            joint, factor = nodes[name].joint, self.given(multiple)
            moved = self.difference(self._position(joint), self.angle(joint.reference, joint.in_degrees))
            total = self.sum(total, self.product(factor, moved))
            columns.append((nodes[name].columns[0], self.product(factor, self.given(joint.multiplier))))
        return total, columns


def rows_of(tree: Tree, constraints: Iterable[ModelConstraint]) -> dict[str, Rows]:
    """What constraints of a model say of its tree, by name, without those that the tree holds by itself, whose joint follows another.

    Raises:
        ValueError: one couples tendons.
    """
    followers = {joint.name for joint in tree.joints if joint.follows}
    path = Path() if tree.place is None else tree.place.path
    found: dict[str, Rows] = {}
    for constraint in constraints:
        # The points may stand elsewhere.
        place = Place(path, constraint.line, tag=f"constraint {constraint.name!r}")
        if isinstance(constraint, JointConstraint):
            if constraint.joint not in followers:
                coefficients = _numbers(place, "polycoef", constraint.coefficients)
                found[constraint.name] = Linkage(constraint.joint, constraint.leader, coefficients)
        elif isinstance(constraint, PointConstraint | FrameConstraint):
            bodies = constraint.ends[0].body, constraint.ends[1].body
            first, second = (_pose(place, number, end) for number, end in enumerate(constraint.ends))
            if isinstance(constraint, FrameConstraint):
                (scale,) = _numbers(place, "torquescale", [constraint.torque_scale])
                found[constraint.name] = Weld(bodies, first, second, torque_scale=scale)
            else:
                found[constraint.name] = Meeting(bodies, first, second)
        else:
            raise ValueError(f"line {constraint.line}: constraint {constraint.name!r} couples {constraint.kind}s, which have no rows here")
    return found


def _pose(place: Place, number: int, end: End) -> Pose:
    turn = (Quaternion(_numbers(place, f"orientation {number}", end.turn)),) if end.turn != UNTURNED else ()
    return (Placement(position=vector(_numbers(place, f"point {number}", end.point)), rotation=turn),)


def _numbers(place: Place, attribute: str, values: Sequence[float]) -> tuple[Given, ...]:
    return tuple(Given(value, place, attribute, index) for index, value in enumerate(values))
