"""A robot whose file ties its coordinates by constraints: the rows beside the equations of motion of its tree, as plain data.

The rows are those of the file, and their program is written from its points; nothing is taken from a system's text but the names of
the coordinates that the rows determine.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.files.equalities import Equality, Rows
from harness.files.tree import Given, Tree
from harness.programs.mechanisms.constraint_forces import by_multipliers, constrained_program
from harness.programs.mechanisms.mechanism import JACOBIAN, Constraints
from harness.programs.program import StraightLineProgram
from harness.programs.states import States
from harness.trees.bodies.spatial import FileProgram, parameter_name
from harness.trees.constraints.rows import Row, equations_of_rows, rows_in, rows_of, untied
from harness.trees.mechanism import RobotMechanism, mechanism_of, named
from harness.trees.nodes import kinematics
from harness.trees.recursion import recursion_program
from harness.trees.robot import Robot
from harness.trees.world_motion import World, in_world

_BITS = 64
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


def tied_tree(tree: Tree, joints: Sequence[str], equalities: Mapping[str, Rows], determined: Sequence[int] = ()) -> TiedTree:
    """The rows of equalities by their names, over ``joints`` as of ``recursion_program``.

    ``determined`` names, for rigid constraints, the place in v that each row determines; without it all rows are taken for redundant,
    and only a law that softens them has a meaning.

    Raises:
        KeyError: one is about a body or joint that the tree does not have. ValueError: the tree has other joints.
    """
    world = in_world(kinematics(tree, joints))
    rows, places = rows_in(world, equalities), tuple(determined)
    redundant, assembly = (not places,) * len(rows), (0.0,) * world.kinematics.nv
    return _tied(world, joints, rows, redundant=redundant, positions=places, rates=places, assembly=assembly)


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
        robot.joints,
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


def _tied(world: World, joints: Sequence[str], rows: Sequence[Row], **declared: Any) -> TiedTree:
    """Rows that were written, beside the equations of motion of their tree; ``declared`` is what else ``Constraints`` holds."""
    recursion, builder = recursion_program(world.kinematics.tree, joints), world.kinematics.builder
    own = builder.written(equations_of_rows(world, rows))
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
    with flint.ctx.workprec(_BITS):
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
    """Of rows, (m, nv), those that some velocity changes, and a maximal number of these that are independent, found in float64.

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
