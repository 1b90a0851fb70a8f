"""A robot whose file ties its coordinates by constraints, as a mechanism with the forces of these, at the numbers of the file.

The rows are those of the file, and their program is written from its points; nothing is taken from a system's text but the names of
the coordinates that the rows determine.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from harness.arrays import Array
from harness.equations.constraint_forces import by_multipliers, constrained_program
from harness.equations.constraints import BIAS, JACOBIAN, RATE, RESIDUAL, Constraints
from harness.equations.kernels import BallKernel
from harness.equations.program import StraightLineProgram, without_unused
from harness.equations.states import States
from harness.models.constraints import ModelConstraint
from harness.robots.constraints import ConstraintWriter, untied
from harness.robots.free_body_equations import independent_rows
from harness.robots.mechanism import RobotMechanism, mechanism_of
from harness.robots.recursion import recursion_program
from harness.robots.robot import Robot
from harness.robots.spatial import parameter_name
from harness.robots.tree import Given

_BITS = 64


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
    rows = writer.rows(moving, constraints)
    jacobian = [writer.jacobian(moving, row) for row in rows]
    everything = writer.program({JACOBIAN: [entry for row in jacobian for entry in row]})
    bearing, chosen = _choice(everything, writer.parameters, states, len(rows))
    if len(chosen) != len(declared.independent):
        raise ValueError(f"the file's constraints determine {len(chosen)} coordinates; expected {len(declared.independent)}")
    outputs = {
        RESIDUAL: [rows[number].residual for number in bearing],
        JACOBIAN: [entry for number in bearing for entry in jacobian[number]],
        RATE: [writer.rate(jacobian[number]) for number in bearing],
        BIAS: writer.biases(moving, [rows[number] for number in bearing]),
    }
    recursion = recursion_program(robot.tree, robot.joints)
    numbers = {value.key: value for value in (*recursion.parameters, *writer.parameters)}
    given = tuple(numbers.values())
    tree = _widened(recursion.program, recursion.parameters, given)
    own = Constraints(
        rows=tuple(rows[number].constraint for number in bearing),
        redundant=tuple(number not in chosen for number in bearing),
        holonomic=len(bearing),
        positions=declared.positions,
        rates=declared.rates,
        assembly=declared.assembly,
        program=_widened(without_unused(writer.program(outputs)), writer.parameters, given),
        tree=tree,
    )
    mechanism = replace(
        mechanism_of(robot),
        parameters=tuple((parameter_name(value), float(value), "") for value in given),
        program=constrained_program(own, by_multipliers),
        constraints=own,
    )
    return Tied(mechanism, given, tuple(bearing), len(chosen) == len(bearing))


def _choice(program: StraightLineProgram, parameters: Sequence[Given], states: States, rows: int) -> tuple[list[int], list[int]]:
    """The rows that some velocity changes, and of these as many as are independent, at all states."""
    import flint

    evaluate = BallKernel(without_unused(program), len(parameters)).bind([float(value) for value in parameters])
    found: list[Array] = []
    with flint.ctx.workprec(_BITS):
        for index in range(len(states)):
            given = np.concatenate([states.q[index], states.v[index], states.tau[index], states.time[index : index + 1]])
            found.append(np.array([float(ball) for ball in evaluate(*given.tolist())]).reshape(rows, -1))
    moving = sorted({row for jacobian in found for row in independent_rows(jacobian)[0]})
    _, chosen = max((independent_rows(jacobian) for jacobian in found), key=lambda choice: len(choice[1]))
    return moving, chosen


def _widened(program: StraightLineProgram, parameters: Sequence[Given], given: Sequence[Given]) -> StraightLineProgram:
    """A program with the numbers of the file ``given`` in the place of its own."""
    own = program.inputs[: len(program.inputs) - len(parameters)]
    numbers = {value.key: place for place, value in enumerate(given, start=len(own))}
    places = [*range(len(own)), *(numbers[value.key] for value in parameters)]
    instructions = tuple(
        ("input", places[instruction[1]]) if instruction[0] == "input" else instruction for instruction in program.instructions
    )
    return replace(program, inputs=(*own, *(parameter_name(value) for value in given)), instructions=instructions)
