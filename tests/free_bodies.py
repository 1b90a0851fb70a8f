"""The equations of motion of bodies that are kept free: six accelerations each, joints as constraints, reactions as unknowns.

Newton's law for the centre of mass and Euler's about it, for every body by itself, with what its joints transmit; and for every
joint, that its two sides accelerate alike across the directions in which it is stiff. The constraints of a file are further rows of
the same kind. Nothing is eliminated, and no inertia is handed from body to body, so that a solution has no step in common with
Lagrange's equations or with a recursion.

Source: Haug, Computer Aided Kinematics and Dynamics of Mechanical Systems, chapter 11 (spatial dynamics, absolute coordinates).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import flint
import numpy as np

from harness.files.equalities import Equality
from harness.files.given import Given
from harness.files.joint_kinds import JointKind
from harness.files.tree import Tree
from harness.programs.kernels import BallKernel
from harness.programs.program import StraightLineProgram, without_unused
from harness.programs.terms import Term, Vector, cross, vector
from harness.trees.bodies.rigid import Spatial
from harness.trees.bodies.spatial import skew
from harness.trees.mechanism import independent_rows
from harness.trees.nodes import kinematics
from harness.trees.recursion import forces_of_joints
from harness.trees.row import jacobian_of
from harness.trees.rows import rows_in, rows_of, untied
from harness.trees.world_motion import Moving, in_world

_BITS = 64


@dataclass(frozen=True)
class Linear:
    """``constant`` plus the sum of unknowns, by their numbers, each times its coefficient."""

    constant: Term
    terms: Mapping[int, Term] = field(default_factory=dict)

    def __add__(self, other: Linear) -> Linear:
        terms = dict(self.terms)
        for number, coefficient in other.terms.items():
            terms[number] = terms[number] + coefficient if number in terms else coefficient
        return Linear(self.constant + other.constant, terms)

    def __rmul__(self, factor: Term) -> Linear:
        return Linear(factor * self.constant, {number: factor * coefficient for number, coefficient in self.terms.items()})

    __mul__ = __rmul__

    def __neg__(self) -> Linear:
        return Linear(-self.constant, {number: -coefficient for number, coefficient in self.terms.items()})


def known(values: Sequence[Term]) -> Vector:
    return vector([Linear(value) for value in values])  # type: ignore[arg-type]


@dataclass(frozen=True)
class FreeBodies:
    """The linear equations A x = b of one tree and its constraints.

    Attributes:
        program: its outputs "matrix" and "right" are the entries of A that are not zero, at ``places``, and b; those called
            "<name> coefficients" and "<name>" give what is read from a solution, each a sum of unknowns at ``read[name]``, and a
            constant: "accelerations" are qdd, "moments" and "forces" (three for each of ``joints``) are what the parent does to the
            child through a joint, along the world's axes, about the point of ``World.points`` [N m, N],
            "constraint forces" are what the file's constraints do along each velocity [N, N m]. "jacobian" are the rows of the
            file's constraints by the velocities.
        parameters: the numbers of the file that are the program's last inputs.
        joints: names of the joints that transmit something: all but free ones. bodies: how many there are; each joint has one, as
            one without mass stands between two joints of one body. rows: of the joints' constraints.
        constraints: the name of the file's constraint for each of its rows, the last equations, whose multipliers are the last
            unknowns.
    """

    program: StraightLineProgram
    parameters: tuple[Given, ...]
    places: tuple[tuple[int, int], ...]
    read: Mapping[str, tuple[tuple[int, ...], ...]]
    joints: tuple[str, ...]
    bodies: int
    rows: int
    constraints: tuple[str, ...] = ()

    @property
    def size(self) -> int:
        """How many equations there are, and unknowns, with all rows of the file's constraints."""
        return 6 * self.bodies + self.rows + len(self.constraints)

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
        """What is read from the solution, as ``arb``, at q, v, tau and time; not finite where A is not certainly regular.

        Of the rows of constraints, those that no velocity changes bear nothing, and of the others as many take part as are
        independent. Where some are left over, what each bears is not determined, nor what joints transmit: "moments" and "forces"
        are missing.
        """
        own, values = self.equations, iter(self.evaluate(*inputs))
        outputs = {name: [next(values) for _ in places] for name, places in own.program.outputs.items()}
        jacobian = np.array([float(ball) for ball in outputs["jacobian"]]).reshape(len(own.constraints), len(own.read["accelerations"]))
        moving, chosen = independent_rows(jacobian)
        first = own.size - len(own.constraints)
        numbers = [*range(first), *(first + row for row in chosen)]
        unknowns = dict(zip(numbers, self._solution(outputs, numbers), strict=True))
        found = {}
        for name, sums in own.read.items():
            coefficients = iter(outputs[f"{name} coefficients"])
            found[name] = [
                sum((next(coefficients) * unknowns.get(number, 0) for number in numbers), constant)
                for numbers, constant in zip(sums, outputs[name], strict=True)
            ]
        return found if len(moving) == len(chosen) else {name: found[name] for name in ("accelerations", "constraint forces")}

    def _solution(self, outputs: Mapping[str, list[Any]], numbers: Sequence[int]) -> list[Any]:
        """The unknowns called ``numbers``, from the equations of these numbers."""
        own, places = self.equations, {number: place for place, number in enumerate(numbers)}
        matrix = flint.arb_mat(len(numbers), len(numbers))
        for (row, column), entry in zip(own.places, outputs["matrix"], strict=True):
            if row in places and column in places:
                matrix[places[row], places[column]] = entry
        try:
            solution = matrix.solve(flint.arb_mat([[outputs["right"][number]] for number in numbers]))
        except ZeroDivisionError:
            return [flint.arb.nan()] * len(numbers)
        return [solution[place, 0] for place in range(len(numbers))]


def free_bodies(
    tree: Tree, joints: Sequence[str], linear_velocity_in_body: bool = False, constraints: Sequence[Equality] = ()
) -> FreeBodies:
    """The equations of a tree, and of its file's constraints; q, v and tau are as ``recursion_program`` takes them.

    A joint that follows another, and that is one of ``joints``, moves by itself, and a row of a constraint couples it.

    Raises:
        ValueError: the tree has other joints, or a constraint couples tendons.
    """
    return _FreeBodies(tree, joints, linear_velocity_in_body, constraints).written()


class _FreeBodies:
    """The equations of one tree."""

    def __init__(self, tree: Tree, joints: Sequence[str], linear_velocity_in_body: bool, constraints: Sequence[Equality]) -> None:
        self._world = world = in_world(kinematics(untied(tree, joints), joints, linear_velocity_in_body))
        self._nodes, self._builder, self._moving = world.kinematics, world.kinematics.builder, world.moving
        self._pulls = world.pulls()
        # Angular and linear, of each node: (2, 3) unknowns.
        self._accelerations = [self._unknown(6 * number, 6).reshape(2, 3) for number in range(len(self._moving))]
        self._stiff = self._stiff_directions()
        # By column, how fast the joint itself accelerates.
        self._rates = self._accelerations_of_joints()
        self._tied = rows_in(world, rows_of(self._nodes.tree, constraints))
        first = 6 * len(self._moving) + sum(len(about) + len(along) for about, along in self._stiff)
        self._multipliers = self._unknown(first, len(self._tied))

    def _unknown(self, first: int, count: int) -> Vector:
        one, zero = self._builder.one, self._builder.zero
        return vector([Linear(zero, {number: one}) for number in range(first, first + count)])  # type: ignore[arg-type]

    def _total(self, parts: Sequence[Any]) -> Any:
        return sum(parts[1:], parts[0]) if len(parts) else Linear(self._builder.zero)

    def written(self) -> FreeBodies:
        """The equations."""
        wrenches = self._wrenches()
        rows = [row for number in range(len(self._moving)) for row in self._balance(number, wrenches)]
        stiff = [row for number in range(len(self._moving)) for row in self._constraints(number)]
        equations = [*rows, *stiff, *self._accelerations_of_rows()]
        names, moments, forces = self._reactions(wrenches)
        jacobian = [jacobian_of(self._world, row) for row in self._tied]
        sums = {
            "accelerations": [self._rates[column] for column in range(self._nodes.nv)],
            "moments": moments,
            "forces": forces,
            "constraint forces": self._constraint_forces(jacobian),
        }
        outputs: dict[str, list[Term]] = {
            "jacobian": [entry for row in jacobian for entry in row],
            "matrix": [term for equation in equations for term in equation.terms.values()],
            "right": [-equation.constant for equation in equations],
        }
        for name, linear in sums.items():
            outputs[f"{name} coefficients"] = [term for one in linear for term in one.terms.values()]
            outputs[name] = [one.constant for one in linear]
        return FreeBodies(
            program=without_unused(self._builder.program(outputs)),
            parameters=self._builder.parameters,
            places=tuple((row, column) for row, equation in enumerate(equations) for column in equation.terms),
            read={name: tuple(tuple(one.terms) for one in linear) for name, linear in sums.items()},
            joints=names,
            bodies=len(self._moving),
            rows=len(stiff),
            constraints=tuple(row.constraint for row in self._tied),
        )

    # Joints.

    def _stiff_directions(self) -> list[tuple[list[Vector], list[Vector]]]:
        """Of each node, the directions about and along which its joint is stiff, along the world's axes.

        A joint that follows another is stiff in all: what it gives way by is said by the other.
        """
        identity, axes = self._builder.identity, iter(self._single_axes())
        found = []
        for one in self._moving:
            own: list[list[Vector]] = []
            for part in range(2):
                free = self._free(one, part)
                if one.node.joint.follows or not free:
                    stiff = list(identity)
                elif len(free) == 1:
                    sizes = next(axes)
                    square = sorted(range(3), key=lambda axis: sizes[axis])[:2]
                    stiff = [cross(free[0], identity[axis]) for axis in square]
                else:
                    stiff = [cross(*free)] if len(free) == 2 else []
                own.append([one.orientation @ direction for direction in stiff])
            found.append((own[0], own[1]))
        return found

    def _free(self, one: Moving, part: int) -> list[Vector]:
        """The directions about (0) or along (1) which a joint gives way, in the axes of its node."""
        return [motion[part] for motion in one.node.motions if any(motion[part] != self._builder.still)]

    def _single_axes(self) -> list[list[float]]:
        """The sizes of the components of axes that stand alone, which no motion changes, in the order in which they are met."""
        frees = [self._free(one, part) for one in self._moving for part in range(2) if not one.node.joint.follows]
        axes = [free[0] for free in frees if len(free) == 1]
        if not axes:
            return []
        inputs = [1.0] * len(self._builder.inputs)
        values = self._builder.evaluated({"axes": [term for axis in axes for term in axis]}, _BITS, inputs)["axes"]
        return np.abs(np.array(values, dtype=float)).reshape(-1, 3).tolist()

    def _relative(self, number: int) -> Vector:
        """The acceleration of a node's frame beyond that of its parent and what turning causes, angular and linear."""
        one = self._moving[number]
        found = self._accelerations[number] + np.array([known(-part) for part in one.bias])
        if one.node.parent < 0:
            return found
        spin, carried = self._accelerations[one.node.parent]
        # What a point at the arm's end has of the spin's change: spin x arm.
        return np.array([found[0] + -spin, (found[1] + -carried) + skew(one.arm) @ spin])

    def _along(self, motion: Spatial, pair: Vector) -> Linear:
        found: Linear = motion[0] @ pair[0] + motion[1] @ pair[1]
        return found

    def _accelerations_of_joints(self) -> dict[int, Linear]:
        return {
            column: self._along(motion, self._relative(number))
            for number, one in enumerate(self._moving)
            if not one.node.joint.follows
            for motion, column in one.rates
        }

    def _constraints(self, number: int) -> list[Linear]:
        """That the two sides of a joint accelerate alike in the directions in which it is stiff."""
        one, relative = self._moving[number], self._relative(number)
        if one.node.joint.follows:
            [(motion, _)] = one.rates
            relative = relative + motion * -self._rates[one.node.columns[0]]
        return [direction @ part for part, stiff in zip(relative, self._stiff[number], strict=True) for direction in stiff]

    # Constraints of the file.

    def _accelerations_of_rows(self) -> list[Linear]:
        """Second derivative of each constraint residual; the equations set it to zero."""
        found = []
        for row in self._tied:
            parts = [Linear(row.known)]
            parts += [self._along(acts, self._accelerations[number]) for number, acts in row.on_nodes]
            parts += [factor * self._rates[column] for column, factor in row.on_columns]
            found.append(self._total(parts))
        return found

    def _constraint_forces(self, jacobian: Sequence[Vector]) -> list[Linear]:
        """What the multipliers of all rows do along each velocity."""
        pairs = list(zip(self._multipliers, jacobian, strict=True))
        return [
            -self._total([Linear(self._builder.zero), *(entries[column] * multiplier for multiplier, entries in pairs)])
            for column in range(self._nodes.nv)
        ]

    # What joints transmit.

    def _wrenches(self) -> list[Vector]:
        """What the parent does to each node through its joint, about the origin of the node's frame: moment and force."""
        first, found = 6 * len(self._moving), list[Vector]()
        for stiff in self._stiff:
            parts = []
            for directions in stiff:
                unknown = self._unknown(first, len(directions))
                first += len(directions)
                along = [direction * one for direction, one in zip(directions, unknown, strict=True)]
                parts.append(self._total([known(self._builder.still), *along]))
            found.append(np.array(parts))
        forces = self._known_forces(found)
        for number, one in enumerate(self._moving):
            for motion, column in one.rates if not one.node.joint.follows else ():
                found[number] = found[number] + motion * forces[column]
        return found

    def _known_forces(self, wrenches: list[Vector]) -> list[Linear]:
        """What acts along each velocity: the applied force, springs and dampers, less what a rotor and joints that follow take."""
        found = []
        for column, force in enumerate(forces_of_joints(self._nodes)):
            total = Linear(self._nodes.coordinates.third[column] + force)
            for unknown, row in zip(self._multipliers, self._tied, strict=True):
                total = self._total([total, *(-factor * unknown for own, factor in row.on_columns if own == column)])
            for number, one in enumerate(self._moving):
                for motion, own in one.rates:
                    if own != column:
                        continue
                    total = total + -one.node.of_velocity("armature") * self._rates[column]
                    if one.node.joint.follows:
                        total = total + -self._along(motion, wrenches[number])
            found.append(total)
        return found

    # Bodies.

    def _balance(self, number: int, wrenches: list[Vector]) -> list[Linear]:
        """Newton's and Euler's equations of what moves with a node, about the origin of its frame."""
        parts = [self._inertia_forces(number, self._moving[number]), -np.array([known(part) for part in self._pulls[number]])]
        parts.append(-wrenches[number])
        for child, other in enumerate(self._moving):
            if other.node.parent == number:
                moment, force = wrenches[child]
                parts.append(np.array([moment + skew(other.arm) @ force, force]))
        for multiplier, row in zip(self._multipliers, self._tied, strict=True):
            parts += [acts * multiplier for node, acts in row.on_nodes if node == number]
        return list(self._total(parts).flat)

    def _inertia_forces(self, number: int, one: Moving) -> Vector:
        """Mass times acceleration less weight, and the change of angular momentum, summed over the lumps: moment and force."""
        spin, acceleration = self._accelerations[number]
        nothing = known(self._builder.still)
        moments, forces = [nothing], [nothing]
        for lump in one.lumps:
            centripetal = cross(one.spin, cross(one.spin, lump.centre))
            of_weight = known(centripetal - self._builder.vector(self._nodes.tree.gravity))
            force = ((acceleration + -(skew(lump.centre) @ spin)) + of_weight) * lump.mass
            gyroscopic = known(cross(one.spin, lump.moments @ one.spin))
            moments += [lump.moments @ spin, gyroscopic, skew(lump.centre) @ force]
            forces.append(force)
        return np.array([self._total(moments), self._total(forces)])

    def _reactions(self, wrenches: list[Vector]) -> tuple[tuple[str, ...], list[Linear], list[Linear]]:
        """Names of the joints that transmit something, with moments about their points, and forces."""
        points = self._world.points
        names, moments, forces = [], list[Linear](), list[Linear]()
        for one, (moment, force) in zip(self._moving, wrenches, strict=True):
            if one.node.joint.kind != JointKind.FREE:
                name = one.node.joint.name
                names.append(name)
                moments += list(moment + skew(one.position - points[name]) @ force)
                forces += list(force)
        return tuple(names), moments, forces
