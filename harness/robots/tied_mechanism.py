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
from harness.equations.constraint_forces import by_multipliers, constrained_program
from harness.equations.constraints import JACOBIAN, Constraints
from harness.equations.kernels import BallKernel
from harness.equations.program import StraightLineProgram, without_unused
from harness.equations.states import States
from harness.files.constraints import ModelConstraint
from harness.files.equalities import Rows
from harness.files.tree import Given, Tree
from harness.robots.constraints import ConstraintWriter, Row, rows_of, untied
from harness.robots.free_body_equations import independent_rows
from harness.robots.mechanism import RobotMechanism, mechanism_of
from harness.robots.recursion import recursion_program
from harness.robots.robot import Robot
from harness.robots.spatial import parameter_name
from harness.robots.world_motion import Moving

_BITS = 64


@dataclass(frozen=True)
class TiedTree:
    """Rows and tree, and the numbers of the file that are the last inputs of both programs."""

    constraints: Constraints
    parameters: tuple[Given, ...]


@dataclass(frozen=True)
class Tied:
    """A mechanism under the constraints of its file.

    Attributes:
        mechanism: its constraints are those rows of the file that some velocity changes.
        parameters: the numbers of the file that are its parameters.
        bearing: the numbers of its rows among all of the file.
        is_determined: whether none of its rows follows from others, so that what each bears is known.
    """

    mechanism: RobotMechanism
    parameters: tuple[Given, ...]
    bearing: tuple[int, ...]
    is_determined: bool


def tied_tree(tree: Tree, joints: Sequence[str], equalities: Mapping[str, Rows], determined: Sequence[int] = ()) -> TiedTree:
    """The rows of equalities by their names, over ``joints`` as of ``recursion_program``.

    ``determined`` names, for rigid constraints, the place in v that each row determines; without it all rows are taken for redundant,
    and only a law that softens them has a meaning.

    Raises:
        KeyError: one is about a body or joint that the tree does not have. ValueError: the tree has other joints.
    """
    writer = ConstraintWriter(tree, joints, False)
    moving = writer.moving()
    rows, places = writer.rows(moving, equalities), tuple(determined)
    redundant, assembly = (not places,) * len(rows), (0.0,) * writer.nv
    return _tied(writer, joints, moving, rows, redundant=redundant, positions=places, rates=places, assembly=assembly)


def tied_mechanism(robot: Robot, constraints: Sequence[ModelConstraint], declared: Constraints, states: States) -> Tied:
    """The mechanism of a robot whose coordinates, those of single axes, are tied as ``declared`` of the same coordinates says.

    ``states`` close the constraints; which rows are independent is found there.

    Raises:
        ValueError: the rows of the file do not determine as many coordinates as ``declared``, a joint has several coordinates, or a
            constraint couples tendons.
    """
    robot = replace(robot, tree=untied(robot.tree, robot.joints))
    if robot.degrees_of_freedom != len(robot.joints):
        raise ValueError("a joint of several degrees of freedom stands beside constraints; expected hinges and slides")
    writer = ConstraintWriter(robot.tree, robot.joints, False)
    moving = writer.moving()
    rows = writer.rows(moving, rows_of(robot.tree, constraints))
    bearing, chosen = _choice(writer, moving, rows, states)
    if len(chosen) != len(declared.independent):
        raise ValueError(f"the file's constraints determine {len(chosen)} coordinates; expected {len(declared.independent)}")
    tied = _tied(
        writer,
        robot.joints,
        moving,
        [rows[number] for number in bearing],
        redundant=tuple(number not in chosen for number in bearing),
        positions=declared.positions,
        rates=declared.rates,
        assembly=declared.assembly,
    )
    mechanism = replace(
        mechanism_of(robot),
        parameters=tuple((parameter_name(value), float(value), "") for value in tied.parameters),
        program=constrained_program(tied.constraints, by_multipliers),
        constraints=tied.constraints,
    )
    return Tied(mechanism, tied.parameters, tuple(bearing), len(chosen) == len(bearing))


def _tied(writer: ConstraintWriter, joints: Sequence[str], moving: list[Moving], rows: Sequence[Row], **declared: Any) -> TiedTree:
    """Rows that were written, beside the equations of motion of their tree; ``declared`` is what else ``Constraints`` holds."""
    recursion = recursion_program(writer.tree, joints)
    own = without_unused(writer.program(writer.equations(moving, rows)))
    given = tuple({value.key: value for value in (*recursion.parameters, *writer.parameters)}.values())
    constraints = Constraints(
        rows=tuple(row.constraint for row in rows),
        holonomic=len(rows),
        program=_widened(own, writer.parameters, given),
        tree=_widened(recursion.program, recursion.parameters, given),
        **declared,
    )
    return TiedTree(constraints, given)


def _choice(writer: ConstraintWriter, moving: list[Moving], rows: Sequence[Row], states: States) -> tuple[list[int], list[int]]:
    """The rows that some velocity changes, and of these as many as are independent, at all states."""
    import flint

    program = writer.program({JACOBIAN: writer.equations(moving, rows)[JACOBIAN]})
    numbers = [float(value) for value in writer.parameters]
    evaluate = BallKernel(without_unused(program), len(numbers)).bind(numbers)
    found: list[Array] = []
    with flint.ctx.workprec(_BITS):
        for index in range(len(states)):
            given = np.concatenate([states.q[index], states.v[index], states.tau[index], states.time[index : index + 1]])
            found.append(np.array([float(ball) for ball in evaluate(*given.tolist())]).reshape(len(rows), -1))
    bearing = sorted({row for jacobian in found for row in independent_rows(jacobian)[0]})
    _, chosen = max((independent_rows(jacobian) for jacobian in found), key=lambda choice: len(choice[1]))
    return bearing, chosen


def _widened(program: StraightLineProgram, parameters: Sequence[Given], given: Sequence[Given]) -> StraightLineProgram:
    """A program with the numbers of the file ``given`` in the place of its own."""
    own = program.inputs[: len(program.inputs) - len(parameters)]
    numbers = {value.key: place for place, value in enumerate(given, start=len(own))}
    places = [*range(len(own)), *(numbers[value.key] for value in parameters)]
    instructions = tuple(
        ("input", places[instruction[1]]) if instruction[0] == "input" else instruction for instruction in program.instructions
    )
    return replace(program, inputs=(*own, *(parameter_name(value) for value in given)), instructions=instructions)
