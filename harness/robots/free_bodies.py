"""The equations of motion of a tree whose bodies are kept free: six accelerations each, joints as constraints, reactions as unknowns.

Newton's law for the centre of mass and Euler's about it, for every body by itself, with what its joints transmit; and for every
joint, that its two sides accelerate alike across the directions in which it is stiff. Nothing is eliminated, and no inertia is
handed from body to body, so that a solution has no step in common with Lagrange's equations or with a recursion.

Source: Haug, Computer Aided Kinematics and Dynamics of Mechanical Systems, chapter 11 (spatial dynamics, absolute coordinates).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from harness.equations.kernels import BallKernel
from harness.equations.program import StraightLineProgram, without_unused
from harness.robots.linear import Linear, LinearWriter, Vector
from harness.robots.nodes import Pair
from harness.robots.spatial import Three
from harness.robots.tree import Given, Tree
from harness.robots.world_motion import Moving, WorldWriter

# Moment and force, or angular and linear acceleration, in unknowns.
Wrench = tuple[Vector, Vector]
_BITS = 64


@dataclass(frozen=True)
class FreeBodies:
    """The linear equations A x = b of one tree.

    Attributes:
        program: its outputs "matrix" and "right" are the entries of A that are not zero, at ``places``, and b; those called
            "<name> coefficients" and "<name>" give what is read from a solution, each a sum of unknowns at ``read[name]``, and a
            constant: "accelerations" are qdd, "moments" and "forces" (three for each of ``joints``) are what the parent does to the
            child through a joint, along the world's axes, about the point of ``world_motion.WorldWriter.points`` [N m, N].
        parameters: the numbers of the file that are the program's last inputs.
        joints: names of the joints that transmit something: all but free ones. bodies: how many there are; each joint has one, as
            one without mass stands between two joints of one body. rows: of the joints' constraints.
    """

    program: StraightLineProgram
    parameters: tuple[Given, ...]
    places: tuple[tuple[int, int], ...]
    read: Mapping[str, tuple[tuple[int, ...], ...]]
    joints: tuple[str, ...]
    bodies: int
    rows: int

    @property
    def size(self) -> int:
        """How many equations there are, and unknowns."""
        return 6 * self.bodies + self.rows

    def bind(self, numbers: Sequence[float] | None = None) -> BoundFreeBodies:
        """The equations with the numbers of the file, or others in their place, at the working precision of flint in force."""
        kernel = BallKernel(self.program, len(self.parameters))
        return BoundFreeBodies(self, kernel.bind([float(value) for value in self.parameters] if numbers is None else numbers))


@dataclass(frozen=True)
class BoundFreeBodies:
    """Equations whose parameters have values."""

    equations: FreeBodies
    evaluate: Any

    def solve(self, inputs: Sequence[float]) -> Mapping[str, list[Any]]:
        """What is read from the solution, as ``arb``, at q, v, tau and time; not finite where A is not certainly regular."""
        import flint

        own, values = self.equations, iter(self.evaluate(*inputs))
        outputs = {name: [next(values) for _ in places] for name, places in own.program.outputs.items()}
        matrix = flint.arb_mat(own.size, own.size)
        for (row, column), entry in zip(own.places, outputs["matrix"], strict=True):
            matrix[row, column] = entry
        try:
            solution = matrix.solve(flint.arb_mat([[entry] for entry in outputs["right"]]))
        except ZeroDivisionError:
            solution = flint.arb_mat(own.size, 1, [flint.arb.nan()] * own.size)
        found = {}
        for name, sums in own.read.items():
            coefficients = iter(outputs[f"{name} coefficients"])
            found[name] = [
                sum((next(coefficients) * solution[number, 0] for number in numbers), constant)
                for numbers, constant in zip(sums, outputs[name], strict=True)
            ]
        return found


def free_bodies(tree: Tree, joints: Sequence[str], linear_velocity_in_body: bool = False) -> FreeBodies:
    """The equations of a tree; q, v and tau are as ``recursion_program`` takes them.

    Raises:
        ValueError: the tree has other joints.
    """
    return _FreeBodies(tree, joints, linear_velocity_in_body).written()


class _FreeBodies(WorldWriter):
    """Writes the equations of one tree."""

    def __init__(self, tree: Tree, joints: Sequence[str], linear_velocity_in_body: bool) -> None:
        super().__init__(tree, joints, linear_velocity_in_body)
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

    def written(self) -> FreeBodies:
        """The equations."""
        wrenches = self._wrenches()
        rows = [row for number in range(len(self.nodes)) for row in self._balance(number, wrenches)]
        constraints = [row for number in range(len(self.nodes)) for row in self._constraints(number)]
        equations = [*rows, *constraints]
        names, moments, forces = self._reactions(wrenches)
        sums = {"accelerations": [self._rates[column] for column in range(self.nv)], "moments": moments, "forces": forces}
        outputs: dict[str, Three] = {
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
            rows=len(constraints),
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
