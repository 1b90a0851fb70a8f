"""The constraints of a model file as rows on the moving bodies of its tree: where each acts, and what it asks of accelerations.

A row is written once, by the moments and forces that its multiplier means on nodes, and the generalised forces on velocities. What it
asks of accelerations follows from these, since both are one Jacobian: of bodies kept free, and of the tree's own velocities.

Source: Goldstein, Poole, Safko, Classical Mechanics, 3rd ed., sections 1.3 (constraints) and 2.4 (multipliers).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from harness.models.constraints import UNTURNED, End, FrameConstraint, JointConstraint, ModelConstraint, PointConstraint
from harness.robots.nodes import Pair
from harness.robots.spatial import Matrix, Three, transposed
from harness.robots.tree import Given, Place, Placement, Quaternion, Tree, vector
from harness.robots.world_motion import Moving, WorldWriter


@dataclass(frozen=True)
class Row:
    """One row of a constraint, along the world's axes.

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

    def rows(self, moving: list[Moving], constraints: Sequence[ModelConstraint]) -> list[Row]:
        """The rows of all constraints but those that the tree holds by itself, whose joint follows another there.

        Raises:
            ValueError: one couples tendons.
        """
        found: list[Row] = []
        followers = {joint.name for joint in self.tree.joints if joint.follows}
        for constraint in constraints:
            if isinstance(constraint, JointConstraint):
                found += [self._coupled(constraint)] if constraint.joint not in followers else []
            elif isinstance(constraint, PointConstraint | FrameConstraint):
                found += self._held(moving, constraint)
            else:
                raise ValueError(
                    f"line {constraint.line}: constraint {constraint.name!r} couples {constraint.kind}s, which have no rows here"
                )
        return found

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

    # Kinds.

    def _held(self, moving: list[Moving], constraint: PointConstraint | FrameConstraint) -> list[Row]:
        """That two points meet; and of frames, that they turn alike."""
        signs = self.number(1), self.number(-1)
        numbers, arms, positions, drawn, turns = [], [], [], [], []
        for place, end in enumerate(constraint.ends):
            pose = self._pose(constraint, end, place)
            number, arm, position, _ = self._end(moving, end.body, pose)
            spin = moving[number].spin if number >= 0 else self.still
            numbers.append(number)
            arms.append(arm)
            positions.append(position)
            drawn.append(self.cross(spin, self.cross(spin, arm)))
            _, turn, _ = self.frames[end.body]
            own, _ = self.placed(turn, self.still, pose)
            turns.append(own if number < 0 else self.multiplied(moving[number].orientation, own))
        found = []
        for axis, unit in enumerate(self.identity):
            acts = [
                (number, self.times(sign, self.cross(arm, unit)), self.times(sign, unit))
                for number, arm, sign in zip(numbers, arms, signs, strict=True)
                if number >= 0
            ]
            residual, known = (self.difference(values[0][axis], values[1][axis]) for values in (positions, drawn))
            found.append(Row(constraint.name, residual, known, tuple(acts)))
        if isinstance(constraint, FrameConstraint):
            found += self._turned_alike(constraint, numbers, turns)
        return found

    def _turned_alike(self, constraint: FrameConstraint, numbers: Sequence[int], turns: Sequence[Matrix]) -> list[Row]:
        """The rows of the orientations of two frames, which are half the sine of the angle between them about each axis."""
        between = self.multiplied(turns[0], transposed(turns[1]))
        scale = self.quotient(self._of(constraint, "torquescale", [constraint.torque_scale])[0], self.number(2))
        found = []
        for axis, unit in enumerate(self.identity):
            one, other = (axis + 1) % 3, (axis + 2) % 3
            sine = self.quotient(self.difference(between[other][one], between[one][other]), self.number(2))
            acts = [
                (number, self.times(self.product(self.number(sign), scale), unit), self.still)
                for number, sign in zip(numbers, (1, -1), strict=True)
                if number >= 0
            ]
            found.append(Row(constraint.name, self.product(scale, sine), self.zero, tuple(acts)))
        return found

    def _coupled(self, constraint: JointConstraint) -> Row:
        """That the position of a joint is a polynomial of that of its leader."""
        nodes = {node.joint.name: node for node in self.nodes}
        own, own_reference = nodes[constraint.joint], self._of(constraint, "reference", constraint.references)[0]
        coefficients = self._of(constraint, "polycoef", constraint.coefficients)
        position = self.difference(self._position(own.joint), own_reference)
        columns = [(own.columns[0], self.number(1))]
        if constraint.leader is None:
            return Row(constraint.name, self.difference(position, coefficients[0]), self.zero, on_columns=tuple(columns))
        leader, reference = nodes[constraint.leader], self._of(constraint, "reference", constraint.references)[1]
        moved = self.difference(self._position(leader.joint), reference)
        value, slope, curvature = self.zero, self.zero, self.zero
        # Horner's scheme, with the derivatives by the leader's position.
        for coefficient in reversed(coefficients):
            curvature = self.sum(self.product(curvature, moved), self.product(self.number(2), slope))
            slope = self.sum(self.product(slope, moved), value)
            value = self.sum(self.product(value, moved), coefficient)
        multiplier = self.given(leader.joint.multiplier)
        rate = self.product(multiplier, self._first_rate + leader.columns[0])
        columns.append((leader.columns[0], self.negative(self.product(multiplier, slope))))
        known = self.negative(self.product(curvature, self.product(rate, rate)))
        return Row(constraint.name, self.difference(position, value), known, on_columns=tuple(columns))

    def _pose(self, constraint: ModelConstraint, end: End, place: int) -> tuple[Placement, ...]:
        turn = (Quaternion(tuple(self._numbers(constraint, f"orientation {place}", end.turn))),) if end.turn != UNTURNED else ()
        return (Placement(position=vector(self._numbers(constraint, f"point {place}", end.point)), rotation=turn),)

    def _of(self, constraint: ModelConstraint, attribute: str, values: Sequence[float]) -> Three:
        return self.numbers(self._numbers(constraint, attribute, values))

    def _numbers(self, constraint: ModelConstraint, attribute: str, values: Sequence[float]) -> list[Given]:
        """The numbers of a constraint, by the line of its element, although the points may stand elsewhere."""
        path = Path() if self.tree.place is None else self.tree.place.path
        place = Place(path, constraint.line, tag=f"constraint {constraint.name!r}")
        return [Given(value, place, attribute, index) for index, value in enumerate(values)]
