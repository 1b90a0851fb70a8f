"""The equations of motion of bodies that are kept free: six accelerations each, joints as constraints, reactions as unknowns.

Newton's law for the centre of mass and Euler's about it, for every body by itself, with what its joints transmit; and for every
joint, that its two sides accelerate alike across the directions in which it is stiff. The constraints of a file are further rows of
the same kind. Nothing is eliminated, and no inertia is handed from body to body, so that a solution has no step in common with
Lagrange's equations or with a recursion.

Source: Haug, Computer Aided Kinematics and Dynamics of Mechanical Systems, chapter 11 (spatial dynamics, absolute coordinates).
"""

from __future__ import annotations

from collections.abc import Sequence

from harness.equations.kernels import BallKernel
from harness.equations.program import without_unused
from harness.files.constraints import ModelConstraint
from harness.files.tree import Tree
from harness.robots.constraints import ConstraintWriter, rows_of, untied
from harness.robots.free_body_equations import FreeBodies
from harness.robots.linear import Linear, LinearWriter, Vector
from harness.robots.nodes import Pair
from harness.robots.spatial import Three
from harness.robots.world_motion import Moving

# Moment and force, or angular and linear acceleration, in unknowns.
Wrench = tuple[Vector, Vector]
_BITS = 64


def free_bodies(
    tree: Tree, joints: Sequence[str], linear_velocity_in_body: bool = False, constraints: Sequence[ModelConstraint] = ()
) -> FreeBodies:
    """The equations of a tree, and of its file's constraints; q, v and tau are as ``recursion_program`` takes them.

    A joint that follows another, and that is one of ``joints``, moves by itself, and a row of a constraint couples it.

    Raises:
        ValueError: the tree has other joints, or a constraint couples tendons.
    """
    return _FreeBodies(tree, joints, linear_velocity_in_body, constraints).written()


class _FreeBodies(ConstraintWriter):
    """Writes the equations of one tree."""

    def __init__(self, tree: Tree, joints: Sequence[str], linear_velocity_in_body: bool, constraints: Sequence[ModelConstraint]) -> None:
        super().__init__(untied(tree, joints), joints, linear_velocity_in_body)
        self._linear = LinearWriter(self)
        self._moving = self.moving()
        self._pulls = self.pulls(self._moving)
        self._accelerations: list[Wrench] = [
            (self._linear.unknown(range(6 * number, 6 * number + 3)), self._linear.unknown(range(6 * number + 3, 6 * number + 6)))
            for number in range(len(self.nodes))
        ]
        self._stiff = self._stiff_directions()
        # By column, how fast the joint itself accelerates.
        self._rates = self._accelerations_of_joints()
        self._tied = self.rows(self._moving, rows_of(self.tree, constraints))
        first = 6 * len(self.nodes) + sum(len(about) + len(along) for about, along in self._stiff)
        self._multipliers = self._linear.unknown(range(first, first + len(self._tied)))

    def written(self) -> FreeBodies:
        """The equations."""
        wrenches = self._wrenches()
        rows = [row for number in range(len(self.nodes)) for row in self._balance(number, wrenches)]
        stiff = [row for number in range(len(self.nodes)) for row in self._constraints(number)]
        equations = [*rows, *stiff, *self._accelerations_of_rows()]
        names, moments, forces = self._reactions(wrenches)
        jacobian = [self.jacobian(self._moving, row) for row in self._tied]
        sums = {
            "accelerations": [self._rates[column] for column in range(self.nv)],
            "moments": moments,
            "forces": forces,
            "constraint forces": self._constraint_forces(jacobian),
        }
        outputs: dict[str, Three] = {
            "jacobian": [entry for row in jacobian for entry in row],
            "matrix": [place for equation in equations for place in equation.terms.values()],
            "right": [self.negative(equation.constant) for equation in equations],
        }
        for name, linear in sums.items():
            outputs[f"{name} coefficients"] = [place for one in linear for place in one.terms.values()]
            outputs[name] = [one.constant for one in linear]
        return FreeBodies(
            program=without_unused(self.program(outputs)),
            parameters=self.parameters,
            places=tuple((row, column) for row, equation in enumerate(equations) for column in equation.terms),
            read={name: tuple(tuple(one.terms) for one in linear) for name, linear in sums.items()},
            joints=names,
            bodies=len(self.nodes),
            rows=len(stiff),
            constraints=tuple(row.constraint for row in self._tied),
        )

    # Joints.

    def _stiff_directions(self) -> list[tuple[list[Three], list[Three]]]:
        """Of each node, the directions about and along which its joint is stiff, along the world's axes.

        A joint that follows another is stiff in all: what it gives way by is said by the other.
        """
        axes = iter(self._single_axes())
        found = []
        for one in self._moving:
            own: list[list[Three]] = []
            for part in range(2):
                free = [motion[part] for motion in one.node.motions if motion[part] != self.still]
                if one.node.joint.follows or not free:
                    stiff = self.identity
                elif len(free) == 1:
                    sizes = next(axes)
                    square = sorted(range(3), key=lambda axis: sizes[axis])[:2]
                    stiff = [self.cross(free[0], self.identity[axis]) for axis in square]
                else:
                    stiff = [self.cross(*free)] if len(free) == 2 else []
                own.append([self.turned(one.orientation, direction) for direction in stiff])
            found.append((own[0], own[1]))
        return found

    def _single_axes(self) -> list[list[float]]:
        """The sizes of the components of axes that stand alone, which no motion changes, in the order in which they are met."""
        places = [
            free[0]
            for node in self.nodes
            for part in range(2)
            if not node.joint.follows and len(free := [motion[part] for motion in node.motions if motion[part] != self.still]) == 1
        ]
        if not places:
            return []
        import flint

        program = without_unused(self.program({"axes": [place for axis in places for place in axis]}))
        count = len(self.parameters)
        with flint.ctx.workprec(_BITS):
            evaluate = BallKernel(program, count).bind([float(value) for value in self.parameters])
            values = [abs(float(value)) for value in evaluate(*[1.0] * (len(program.inputs) - count))]
        return [values[3 * number : 3 * number + 3] for number in range(len(places))]

    def _relative(self, number: int) -> Wrench:
        """The acceleration of a node's frame beyond that of its parent and what turning causes."""
        linear, one = self._linear, self._moving[number]
        angular, along = self._accelerations[number]
        angular = linear.added(angular, linear.known(self.minus(one.bias[0])))
        along = linear.added(along, linear.known(self.minus(one.bias[1])))
        if one.node.parent < 0:
            return angular, along
        spin, carried = self._accelerations[one.node.parent]
        # What a point at the arm's end has of the spin's change: spin x arm.
        return linear.added(angular, linear.minus(spin)), linear.added(along, linear.minus(carried), linear.cross(one.arm, spin))

    def _along(self, motion: Pair, pair: Wrench) -> Linear:
        return self._linear.sum(self._linear.dot(motion[0], pair[0]), self._linear.dot(motion[1], pair[1]))

    def _accelerations_of_joints(self) -> dict[int, Linear]:
        return {
            column: self._along(motion, self._relative(number))
            for number, one in enumerate(self._moving)
            if not one.node.joint.follows
            for motion, column in zip(one.motions, one.node.columns, strict=True)
        }

    def _constraints(self, number: int) -> list[Linear]:
        """That the two sides of a joint accelerate alike in the directions in which it is stiff."""
        one, linear = self._moving[number], self._linear
        angular, along = self._relative(number)
        if one.node.joint.follows:
            rate = linear.negative(self._rates[one.node.columns[0]])
            [(about, shift)] = one.motions
            angular, along = linear.added(angular, linear.along(rate, about)), linear.added(along, linear.along(rate, shift))
        return [
            linear.dot(direction, part) for part, stiff in zip((angular, along), self._stiff[number], strict=True) for direction in stiff
        ]

    # Constraints of the file.

    def _accelerations_of_rows(self) -> list[Linear]:
        """How fast what each row leaves accelerates, which is not at all."""
        linear, found = self._linear, []
        for row in self._tied:
            parts = [Linear(row.known)]
            for number, moment, force in row.on_nodes:
                spin, acceleration = self._accelerations[number]
                parts += [linear.dot(moment, spin), linear.dot(force, acceleration)]
            parts += [linear.times(factor, self._rates[column]) for column, factor in row.on_columns]
            found.append(linear.sum(*parts))
        return found

    def _constraint_forces(self, jacobian: Sequence[Three]) -> list[Linear]:
        """What the multipliers of all rows do along each velocity."""
        linear = self._linear
        pairs = list(zip(self._multipliers, jacobian, strict=True))
        return [
            linear.negative(linear.sum(linear.nothing, *(linear.times(entries[column], multiplier) for multiplier, entries in pairs)))
            for column in range(self.nv)
        ]

    # What joints transmit.

    def _wrenches(self) -> list[Wrench]:
        """What the parent does to each node through its joint, about the origin of the node's frame."""
        linear, first = self._linear, 6 * len(self.nodes)
        found: list[Wrench] = []
        for stiff in self._stiff:
            parts = []
            for directions in stiff:
                unknown = linear.unknown(range(first, first + len(directions)))
                first += len(directions)
                parts.append(linear.added(linear.known(self.still), *map(linear.along, unknown, directions)))
            found.append((parts[0], parts[1]))
        known = self._known_forces(found)
        for number, one in enumerate(self._moving):
            for motion, column in zip(one.motions, one.node.columns, strict=True) if not one.node.joint.follows else ():
                moment, force = found[number]
                found[number] = (
                    linear.added(moment, linear.along(known[column], motion[0])),
                    linear.added(force, linear.along(known[column], motion[1])),
                )
        return found

    def _known_forces(self, wrenches: list[Wrench]) -> list[Linear]:
        """What acts along each velocity: the applied force, springs and dampers, less what a rotor and joints that follow take."""
        linear = self._linear
        found = []
        for column, force in enumerate(self.forces_of_joints()):
            applied = self._first_rate + self.nv + column
            total = Linear(self.sum(applied, force))
            for unknown, row in zip(self._multipliers, self._tied, strict=True):
                pulls = [linear.times(self.negative(factor), unknown) for own, factor in row.on_columns if own == column]
                total = linear.sum(total, *pulls)
            for number, one in enumerate(self._moving):
                for motion, own in zip(one.motions, one.node.columns, strict=True):
                    if own != column:
                        continue
                    multiplier = self.given(one.node.joint.multiplier)
                    rotor = self.product(self.product(multiplier, multiplier), self.given(one.node.joint.armature))
                    total = linear.sum(total, linear.times(self.negative(rotor), self._rates[column]))
                    if one.node.joint.follows:
                        total = linear.sum(total, linear.negative(self._along(motion, wrenches[number])))
            found.append(total)
        return found

    # Bodies.

    def _balance(self, number: int, wrenches: list[Wrench]) -> list[Linear]:
        """Newton's and Euler's equations of what moves with a node, about the origin of its frame."""
        linear, one = self._linear, self._moving[number]
        moment, force = self._inertia_forces(number, one)
        pull_moment, pull = self._pulls[number]
        moments = [moment, linear.known(self.minus(pull_moment)), linear.minus(wrenches[number][0])]
        forces = [force, linear.known(self.minus(pull)), linear.minus(wrenches[number][1])]
        for child, other in enumerate(self._moving):
            if other.node.parent == number:
                moments += [wrenches[child][0], linear.cross(other.arm, wrenches[child][1])]
                forces.append(wrenches[child][1])
        for multiplier, row in zip(self._multipliers, self._tied, strict=True):
            acting = [(moment, force) for node, moment, force in row.on_nodes if node == number]
            moments += [linear.along(multiplier, moment) for moment, _ in acting]
            forces += [linear.along(multiplier, force) for _, force in acting]
        return [*linear.added(*moments), *linear.added(*forces)]

    def _inertia_forces(self, number: int, one: Moving) -> Wrench:
        """Mass times acceleration less weight, and the change of angular momentum, summed over the lumps."""
        linear = self._linear
        spin, acceleration = self._accelerations[number]
        moments, forces = [linear.known(self.still)], [linear.known(self.still)]
        for lump in one.lumps:
            centripetal = self.cross(one.spin, self.cross(one.spin, lump.centre))
            known = self.less(centripetal, self.numbers(self.tree.gravity))
            of_centre = linear.added(acceleration, linear.minus(linear.cross(lump.centre, spin)), linear.known(known))
            force = [linear.times(lump.mass, component) for component in of_centre]
            gyroscopic = self.cross(one.spin, self.turned(lump.moments, one.spin))
            moments += [linear.turned(lump.moments, spin), linear.known(gyroscopic), linear.cross(lump.centre, force)]
            forces.append(force)
        return linear.added(*moments), linear.added(*forces)

    def _reactions(self, wrenches: list[Wrench]) -> tuple[tuple[str, ...], Vector, Vector]:
        """Names of the joints that transmit something, with moments about their points, and forces."""
        linear, points = self._linear, self.points(self._moving)
        names, moments, forces = [], [], []
        for one, (moment, force) in zip(self._moving, wrenches, strict=True):
            if one.node.joint.kind != "free":
                name = one.node.joint.name
                names.append(name)
                moments += linear.added(moment, linear.cross(self.less(one.position, points[name]), force))
                forces += force
        return tuple(names), moments, forces
