"""The rows of equalities besides the equations of motion of their tree, as one program's worth of plain data.

A row is written as the position that it leaves. How fast it moves, and how that changes while velocities stay, are derivatives along
the motion, q' = v of hinges and slides, and half the product of the quaternion and the angular velocity of balls.

Source: Featherstone, Rigid Body Dynamics Algorithms, section 3.2 (constraints on position, and their derivatives).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from harness.equations.constraints import BIAS, JACOBIAN, RATE, RESIDUAL, Constraints
from harness.equations.program import without_unused
from harness.robots.equalities import Equality, Meeting, Sum, TendonLinkage
from harness.robots.recursion import RecursionWriter
from harness.robots.spatial import Three
from harness.robots.tree import WORLD, Given, Pose, Tree


@dataclass(frozen=True)
class TiedTree:
    """Rows and tree, and the numbers of the file that are the last inputs of both programs."""

    constraints: Constraints
    parameters: tuple[Given, ...]


def tied_tree(tree: Tree, joints: Sequence[str], equalities: Mapping[str, Equality], determined: Sequence[int] = ()) -> TiedTree:
    """The rows of equalities by their names, over ``joints`` as of ``recursion_program``.

    ``determined`` names, for rigid constraints, the place in v that each row determines; without it all rows are taken for redundant,
    and only a law that softens them has a meaning.

    Raises:
        KeyError: one is about a body or joint that the tree does not have. ValueError: the tree has other joints.
    """
    return _Rows(tree, joints, False).tied(equalities, tuple(determined))


class _Rows(RecursionWriter):
    """Writes the rows behind the equations of motion."""

    def tied(self, equalities: Mapping[str, Equality], determined: tuple[int, ...]) -> TiedTree:
        motion = self.outputs_of_tree()
        rows = {name: self._rows(one) for name, one in equalities.items()}
        residual = [row for of_one in rows.values() for row in of_one]
        names = tuple(name for name, of_one in rows.items() for _ in of_one)
        rates = self._rates_of_positions()
        moved = self.along(residual, rates)
        first = self._first_rate
        jacobian = [slope for row in moved for slope in self.gradient(row, range(first, first + self.nv))]
        outputs = {RESIDUAL: residual, JACOBIAN: jacobian, RATE: moved, BIAS: self.along(moved, rates)}
        program, own = (without_unused(self.program(one)) for one in (motion, outputs))
        constraints = Constraints(
            rows=names,
            redundant=(not determined,) * len(names),
            holonomic=len(names),
            positions=determined,
            rates=determined,
            assembly=(0.0,) * self.nv,
            program=own,
            tree=program,
        )
        return TiedTree(constraints, self.parameters)

    def _rates_of_positions(self) -> dict[int, int]:
        """The rate of each position by its place."""
        found: dict[int, int] = {}
        for positions, columns in self._places.values():
            rates, positions = [self._first_rate + column for column in columns], list(positions)
            if len(positions) > len(rates):
                w, *vector = quaternion = positions[-4:]
                half = self.times(self.number(Fraction(1, 2)), rates[-3:])
                spun = self.added(self.times(w, half), self.cross(vector, half))
                found |= dict(zip(quaternion, [self.negative(self.dot(vector, half)), *spun], strict=True))
                positions, rates = positions[:-4], rates[:-3]
            found |= dict(zip(positions, rates, strict=True))
        return found

    def _rows(self, equality: Equality) -> Three:
        assert equality.rows is not None, equality.why_not
        if isinstance(equality.rows, Meeting):
            return self._between(equality.rows)
        if isinstance(equality.rows, TendonLinkage):
            follower, *leader = (self._length(tendon) for tendon in equality.rows.tendons)
        else:
            follower, *leader = (self._moved(name) for name in (equality.rows.joint, equality.rows.leader) if name is not None)
        constant, *others = map(self.given, equality.rows.coefficients)
        wanted = self.zero
        # Horner's scheme, of one leader or none.
        for moved in leader:
            for coefficient in reversed(others):
                wanted = self.product(self.sum(wanted, coefficient), moved)
        return [self.difference(follower, self.sum(constant, wanted))]

    def _moved(self, name: str) -> int:
        """The position of a hinge or slide, from its reference."""
        joint = next(joint for joint in self.tree.joints if joint.name == name)
        return self.difference(self._position(joint), self.angle(joint.reference, joint.in_degrees))

    def _length(self, tendon: Sum) -> int:
        return self.dot([self.given(multiple) for _, multiple in tendon.terms], [self._moved(name) for name, _ in tendon.terms])

    def _between(self, meeting: Meeting) -> Three:
        one, other = meeting.bodies
        second = self.placed(self.identity, self.still, meeting.second)[1] if meeting.second is not None else self._covered(meeting)
        first = self.placed(self.identity, self.still, meeting.first)[1]
        return self.added(self._in_world(one, first), self.minus(self._in_world(other, second)))

    def _in_world(self, body: str, point: Three) -> Three:
        at, turn, shift = self.frames[body]
        point = self.added(shift, self.turned(turn, point))
        while at >= 0:
            node = self.nodes[at]
            point, at = self.added(node.shift, self.turned(node.turn, point)), node.parent
        return point

    def _covered(self, meeting: Meeting) -> Three:
        """The point of the second body that the first point covers where all joints stand at their reference."""
        frames, floating = {WORLD: (self.identity, self.still)}, dict(meeting.floating)
        for body in self.tree.bodies:
            pose: Pose = floating.get(body.name, body.pose)
            frames[body.name] = self.placed(*frames[body.parent], pose)
        (turn, shift), (own_turn, own_shift) = (frames[name] for name in meeting.bodies)
        point = self.placed(turn, shift, meeting.first)[1]
        return self.turned_back(own_turn, self.added(point, self.minus(own_shift)))
