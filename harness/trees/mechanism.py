"""A robot as a mechanism, for all that works on mechanisms: certified reference, data roundoff, sampling.

The parameters are the numbers of the file, each the float64 that an engine reads, so that data roundoff includes the rounding of
each decimal as it does for the parameters of a system.

Where the file ties its coordinates by constraints, their rows stand beside the equations of motion of its tree, as plain data. The program
of the rows is written from the points of the file; nothing is taken from a system's text but the names of the coordinates that they
determine.
"""

from __future__ import annotations

import functools
import itertools
import math
import time
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.files.equalities import AnyRows, Equality
from harness.files.given import Given
from harness.files.joint_kinds import JointKind
from harness.files.model_file import ModelFile
from harness.files.tree import Joint, Tree
from harness.programs.evaluation import mass_matrix, solved
from harness.programs.mechanisms.applied_forces import forces_of
from harness.programs.mechanisms.constraint_forces import by_multipliers, constrained_program
from harness.programs.mechanisms.mechanism import JACOBIAN, Constraints, Mechanism
from harness.programs.program import StraightLineProgram, right_hand_side
from harness.programs.states import DEFAULT_RATES, States
from harness.trees.bodies.spatial import FileProgram, parameter_name
from harness.trees.nodes import kinematics
from harness.trees.recursion import actuated_program, recursion_program
from harness.trees.robot import Robot, tree_of, with_actuators
from harness.trees.row import Row, equations_of_rows
from harness.trees.rows import rows_in, rows_of, untied
from harness.trees.world_motion import World, in_world

# Of accelerations, and certain ones at least; of the rows of constraints.
BITS, LEAST_BITS, _BITS_OF_ROWS = 192, 80, 64
# Of a joint without limits [m].
_REACH = (-1.0, 1.0)


@dataclass(frozen=True, kw_only=True)
class RobotMechanism(Mechanism):
    """A mechanism with the robot whose equations it has, which engines that read robots' files are handed.

    Attributes:
        given: the numbers of the file that are its parameters.
        digest: of the file's content, which an engine may make more of than its equations hold; "" where no engine reads it.
        request: what an engine that reads the file by itself is to load; None where none does.
        reader: the engine whose reader makes this of a file; "" for the file itself.
    """

    robot: Robot
    given: tuple[Given, ...] = ()
    digest: str = ""
    request: Any = None
    reader: str = ""

    @functools.cached_property
    def smooth(self) -> RobotMechanism:
        """The same with nothing on, for which most quantities are asked."""
        if self.actuation is None and self.held is None:
            return self
        request = None if self.request is None else replace(self.request, held=None)
        tree = self if self.actuation is None else mechanism_of(with_actuators(self.robot, ()))
        return replace(tree, name=self.name, digest=self.digest, request=request)

    @property
    def written(self) -> FileProgram:
        """Its equations of motion, and the numbers of the file in them."""
        return FileProgram(self.program, self.given)

    @property
    def handed_to_engines(self) -> Any:
        return self.request or self

    @property
    def key(self) -> Hashable:
        return super().key, self.digest, self.held

    @property
    def held(self) -> Any:
        """Elements that act beside the tree in an engine that reads the file, as of ``Request``; None for none."""
        return self.request and self.request.held


def named(numbers: Sequence[Given]) -> tuple[tuple[str, float, str], ...]:
    """Numbers of a file as the parameters of a mechanism."""
    return tuple((parameter_name(value), float(value), "") for value in numbers)


def mechanism_of(robot: Robot) -> RobotMechanism:
    """The mechanism whose joints are ``robot.joints`` in this order; positions are sampled within the limits of joints that have some.

    Its q holds a quaternion for each ball or free joint, as of ``recursion_program``; it has no energies and no text.
    """
    started = time.perf_counter()
    joints = [robot.joint(name) for name in robot.joints]
    recursion, actuation = actuated_program(robot.tree, robot.joints)
    has_free = any(joint.kind == JointKind.FREE for joint in joints)
    in_body = (recursion_program(robot.tree, robot.joints, linear_velocity_in_body=True).program,) if has_free else ()
    ranges = [bounds for joint in joints for bounds in _ranges(joint)]
    rates = [DEFAULT_RATES] * len(ranges)
    rotating = [turns for joint in joints for turns in joint.kind.turning]
    firsts = itertools.accumulate((joint.kind.velocities for joint in joints), initial=0)
    attitudes = [first + joint.kind.linear for joint, first in zip(joints, firsts, strict=False) if joint.kind.has_attitude]
    return RobotMechanism(
        name=robot.path.stem,
        description=f"The robot of {robot.path.name}.",
        source="",
        coordinates=tuple(f"{joint.name} {suffix}".rstrip() for joint in joints for suffix in joint.kind.coordinates),
        joints=tuple(joint.name for joint in joints for _ in joint.kind.coordinates),
        parameters=named(recursion.parameters),
        given=recursion.parameters,
        gravity=math.hypot(*map(float, robot.tree.gravity)),
        total_mass=robot.total_mass,
        rotating=tuple(rotating),
        position_ranges=tuple(ranges),
        rate_ranges=tuple(rates),
        **forces_of(recursion.program, recursion.numbers, ranges, rates, attitudes),
        attitudes=tuple(attitudes),
        charts_in_body=in_body,
        program=recursion.program,
        equations_text="",
        equations_mathml="",
        derivation_seconds=time.perf_counter() - started,
        robot=robot,
        actuation=actuation,
    )


def _ranges(joint: Joint) -> tuple[tuple[float, float] | None, ...]:
    """The range of each coordinate; None for an angle without limits."""
    if joint.limits is not None and joint.kind.is_single:
        low, high = map(float, joint.limits)
        return ((math.radians(low), math.radians(high)) if joint.in_degrees else (low, high),)
    return tuple(None if turns else _REACH for turns in joint.kind.turning)


def accelerations(model: ModelFile, joints: Sequence[str], gravity: float, states: States) -> Array:
    """qdd, (n, nv), at states as ``recursion_program`` takes them; NaN where fewer than ``LEAST_BITS`` bits of one are certain.

    ``gravity`` [m/s^2, along -z] is for a URDF, which holds none. No float64 kernel is compiled.

    Raises:
        InvalidModel: as ``read_robot``. ValueError: the model has other joints.
    """
    return accelerations_of(recursion_program(tree_of(model, gravity), joints), states)


def accelerations_of(recursion: FileProgram, states: States) -> Array:
    """``accelerations`` of a tree's program."""
    import flint

    nv, found = states.v.shape[1], np.full_like(states.v, np.nan)
    with flint.ctx.workprec(BITS):
        evaluate = recursion.in_balls()
        for row, (q, v, tau, time) in enumerate(zip(states.q, states.v, states.tau, states.time, strict=True)):
            outputs = evaluate(*q.tolist(), *v.tolist(), *tau.tolist(), float(time))
            force = right_hand_side(outputs, [flint.arb(applied) for applied in tau.tolist()])
            solution = solved(mass_matrix(outputs["mass"], nv), force)
            if all(ball.rel_accuracy_bits() >= LEAST_BITS for ball in solution):
                found[row] = [float(ball) for ball in solution]
    return found


# Of the length of the longest row, and of what is left of a row of length 1 beside those before.
_NO_MOTION, _DEPENDENT = 1e-12, 1e-9


@dataclass(frozen=True)
class TiedTree:
    """Rows and tree, and the numbers of the file that are the last inputs of both programs."""

    constraints: Constraints
    parameters: tuple[Given, ...]


@dataclass(frozen=True)
class TiedMechanism:
    """A mechanism under the constraints of its file.

    Attributes:
        mechanism: its constraints are those rows of the file that some velocity changes.
        bearing: the numbers of its rows among all of the file.
        is_determined: whether none of its rows follows from others, so that what each bears is known.
    """

    mechanism: RobotMechanism
    bearing: tuple[int, ...]
    is_determined: bool


def tied_tree(
    tree: Tree,
    joints: Sequence[str],
    constraints: Mapping[str, AnyRows],
    determined: Sequence[int] = (),
    written: FileProgram | None = None,
) -> TiedTree:
    """The rows of constraints by their names, over ``joints`` as of ``recursion_program``; that of the tree may be ``written``.

    ``determined`` names, for rigid constraints, the place in v that each row determines; without it all rows are taken for redundant,
    and only a law that softens them has a meaning.

    Raises:
        KeyError: one is about a body or joint that the tree does not have. ValueError: the tree has other joints.
    """
    world = in_world(kinematics(tree, joints))
    rows, places = rows_in(world, constraints), tuple(determined)
    redundant, assembly = (not places,) * len(rows), (0.0,) * world.kinematics.nv
    recursion = written or recursion_program(tree, joints)
    return _tied(world, recursion, rows, redundant=redundant, positions=places, rates=places, assembly=assembly)


def tied_mechanism(robot: Robot, constraints: Sequence[Equality], declared: Constraints, states: States) -> TiedMechanism:
    """The mechanism of a robot whose coordinates, those of single axes, are tied as ``declared`` of the same coordinates says.

    ``states`` close the constraints; which rows are independent is found there.

    Raises:
        ValueError: the rows of the file do not determine as many coordinates as ``declared``, a joint has several coordinates, or a
            constraint couples tendons.
    """
    robot = replace(robot, tree=untied(robot.tree, robot.joints))
    if robot.degrees_of_freedom != len(robot.joints):
        raise ValueError("a joint of several degrees of freedom stands beside constraints; expected hinges and slides")
    world = in_world(kinematics(robot.tree, robot.joints))
    rows = rows_in(world, rows_of(robot.tree, constraints))
    bearing, chosen = _choice(world, rows, states)
    if len(chosen) != len(declared.independent):
        raise ValueError(f"the file's constraints determine {len(chosen)} coordinates; expected {len(declared.independent)}")
    tied = _tied(
        world,
        recursion_program(robot.tree, robot.joints),
        [rows[number] for number in bearing],
        redundant=tuple(number not in chosen for number in bearing),
        positions=declared.positions,
        rates=declared.rates,
        assembly=declared.assembly,
    )
    mechanism = replace(
        mechanism_of(robot),
        parameters=named(tied.parameters),
        given=tied.parameters,
        program=constrained_program(tied.constraints, by_multipliers),
        constraints=tied.constraints,
    )
    return TiedMechanism(mechanism, tuple(bearing), len(chosen) == len(bearing))


def _tied(world: World, recursion: FileProgram, rows: Sequence[Row], **declared: Any) -> TiedTree:
    """Rows that were written, beside the equations of motion of their tree; ``declared`` is what else ``Constraints`` holds."""
    own = world.kinematics.builder.written(equations_of_rows(world, rows))
    given = tuple({value.key: value for value in (*recursion.parameters, *own.parameters)}.values())
    constraints = Constraints(
        rows=tuple(row.constraint for row in rows),
        holonomic=len(rows),
        program=_widened(own, given),
        tree=_widened(recursion, given),
        **declared,
    )
    return TiedTree(constraints, given)


def _choice(world: World, rows: Sequence[Row], states: States) -> tuple[list[int], list[int]]:
    """The rows that some velocity changes, and of these as many as are independent, at all states."""
    import flint

    program = world.kinematics.builder.written({JACOBIAN: equations_of_rows(world, rows)[JACOBIAN]})
    given = np.hstack([states.q, states.v, states.tau, states.time[:, None]])
    with flint.ctx.workprec(_BITS_OF_ROWS):
        evaluate = program.in_balls()
        entries = [evaluate(*one)[JACOBIAN] for one in given.tolist()]
    found = [np.array([float(ball) for ball in own]).reshape(len(rows), -1) for own in entries]
    bearing = sorted({row for jacobian in found for row in independent_rows(jacobian)[0]})
    _, chosen = max((independent_rows(jacobian) for jacobian in found), key=lambda choice: len(choice[1]))
    return bearing, chosen


def _widened(written: FileProgram, given: Sequence[Given]) -> StraightLineProgram:
    """A program with the numbers of the file ``given`` in the place of its own."""
    program, parameters = written.program, written.parameters
    own = program.inputs[: len(program.inputs) - len(parameters)]
    numbers = {value.key: place for place, value in enumerate(given, start=len(own))}
    places = [*range(len(own)), *(numbers[value.key] for value in parameters)]
    instructions = tuple(
        ("input", places[instruction[1]]) if instruction[0] == "input" else instruction for instruction in program.instructions
    )
    return replace(program, inputs=(*own, *(parameter_name(value) for value in given)), instructions=instructions)


def independent_rows(jacobian: Array) -> tuple[list[int], list[int]]:
    """Rows of (m, nv) that some velocity changes, and a maximal number of these that are independent, found in float64.

    That the chosen ones are independent is for a solution in balls to prove.
    """
    lengths = np.linalg.norm(jacobian, axis=1)
    if not np.isfinite(lengths).all():
        return list(range(len(jacobian))), list(range(len(jacobian)))
    moving = np.flatnonzero(lengths > _NO_MOTION * lengths.max(initial=0.0))
    left = jacobian[moving] / lengths[moving, None]
    chosen: list[int] = []
    while len(chosen) < len(moving):
        sizes = np.linalg.norm(left, axis=1)
        pivot = int(sizes.argmax())
        if sizes[pivot] <= _DEPENDENT:
            break
        chosen.append(pivot)
        along = left[pivot] / sizes[pivot]
        left = left - np.outer(left @ along, along)
        left[chosen] = 0.0
    return moving.tolist(), sorted(moving[chosen].tolist())
