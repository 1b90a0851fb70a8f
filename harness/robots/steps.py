"""The state after one step by a rule, as one program of the state before it, the step length and the numbers of a file.

Linear equations are solved within the program, by elimination without pivots from the last unknown to the first, which on a tree fills
nothing in. Functions of turns are polynomials, which leave nothing out that is felt up to ``LARGEST_TURN``.

Sources: Featherstone, Rigid Body Dynamics Algorithms, section 6.5 (factorisation along branches); Iserles, Munthe-Kaas, Norsett, Zanna,
Lie-group methods, Acta Numerica 9 (2000), sections 3 (Runge-Kutta methods in the coordinates of the exponential map) and B.2 (the
functions of turns in three dimensions).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction

from harness.equations.calculus import ProgramWriter
from harness.equations.program import StraightLineProgram, upper_triangle, with_operands, without_unused
from harness.equations.program_derivatives import derivative_name, differentiate
from harness.files.tree import Given
from harness.models.step_rule import Part, StepRule
from harness.robots.step_forces import JOINT_DAMPING, JOINT_STIFFNESS, LINE_DAMPING, LINE_STIFFNESS, LINES, StepForces

# Of the cosine of half a turn in a step, and of its sine over it, in the square.
_TERMS = 25
# Of a step [rad], up to which what the polynomials leave out is below 2^-210.
LARGEST_TURN = 2.0

NOTHING = "nothing"
_VELOCITY_TERMS = {Part.VELOCITY_TERMS, Part.VELOCITY_TERMS_OF_FREE_BODIES}

Matrix = list[list[int]]


@dataclass(frozen=True)
class Steps:
    """The states after one step by each of some rules.

    Attributes:
        program: inputs are q, v, tau, t, ``parameters`` and then the step length of each rule; outputs are ``velocities(rule)`` (nv) and
            ``positions(rule)`` (nq) of each, and a zero, ``NOTHING``.
        parameters: the numbers of the file.
    """

    program: StraightLineProgram
    parameters: tuple[Given, ...]


def velocities(rule: StepRule) -> str:
    """The name of the output that holds the velocities after a step."""
    return f"velocities after a step by {rule.name}"


def positions(rule: StepRule) -> str:
    """The name of the output that holds the positions after a step."""
    return f"positions after a step by {rule.name}"


def steps_program(forces: StepForces, attitudes: Sequence[int], rules: Sequence[StepRule]) -> Steps:
    """One step by each of ``rules``; ``attitudes`` are the places in v of what is of a rotation, as of a ``Mechanism``."""
    nv = len(forces.program.outputs["velocity"])
    first = forces.program.inputs.index("t") - 2 * nv
    slopes = ["velocity"] if any(_VELOCITY_TERMS & rule.implicit for rule in rules) else []
    program = differentiate(forces.program, slopes, range(first, first + nv))
    lengths = tuple(f"h{place}" for place in range(len(rules)))
    program = replace(program, inputs=(*program.inputs, *lengths))
    return _Writer(program, forces, attitudes).written(rules)


class _Writer(ProgramWriter):
    """Writes the steps of one tree; ``program`` holds its forces, their derivatives and the step lengths as last inputs."""

    def __init__(self, program: StraightLineProgram, forces: StepForces, attitudes: Sequence[int]) -> None:
        super().__init__(program)
        self._program, self._forces, self._attitudes = program, forces, attitudes
        self._nv = nv = len(program.outputs["velocity"])
        self._nq = program.inputs.index("t") - 2 * nv
        self._start = [*range(self._nq)], [*range(self._nq, self._nq + nv)]

    def written(self, rules: Sequence[StepRule]) -> Steps:
        outputs: dict[str, list[int]] = {}
        for place, rule in enumerate(rules, start=len(self.inputs) - len(rules)):
            after = self._by_stages(rule, place) if rule.stages else self._in_one_stage(rule, place)
            outputs[positions(rule)], outputs[velocities(rule)] = after
        outputs[NOTHING] = [self.number(0)]
        return Steps(without_unused(self.program(outputs)), self._forces.parameters)

    def _in_one_stage(self, rule: StepRule, length: int) -> tuple[list[int], list[int]]:
        q, v = self._start
        stiff = self._stiffness(rule)
        matrix = self._mass(self.outputs)
        for row, (of_rates, of_positions) in enumerate(zip(self._damping(rule), stiff, strict=True)):
            for column in range(self._nv):
                implicit = self.sum(of_rates[column], self.product(length, of_positions[column]))
                matrix[row][column] = self.sum(matrix[row][column], self.product(length, implicit))
        force = self._force(self.outputs)
        ahead = [self.product(length, self.dot(row, v)) for row in stiff]
        accelerations = self.solved(matrix, [self.difference(*pair) for pair in zip(force, ahead, strict=True)])
        after = self._moved(v, length, accelerations)
        return self._turned(q, length, v if rule.with_old_velocities else after), after

    def _by_stages(self, rule: StepRule, length: int) -> tuple[list[int], list[int]]:
        q, v = self._start
        # Of the coordinates in which the rotations of a stage are where that of the start is zero.
        slopes, accelerations = [v], [self._acceleration(self.outputs)]
        for weights in rule.stages:
            slope = self._mixed(weights, slopes)
            rates = self._moved(v, length, self._mixed(weights, accelerations))
            accelerations.append(self._acceleration(self._evaluated(self._turned(q, length, slope), rates)))
            slopes.append(self._in_coordinates(length, slope, rates))
        return self._turned(q, length, self._mixed(rule.weights, slopes)), self._moved(v, length, self._mixed(rule.weights, accelerations))

    # The equations of motion.

    def _evaluated(self, q: Sequence[int], v: Sequence[int]) -> Mapping[str, Sequence[int]]:
        """The outputs at another state, under the same forces."""
        moved, places = [*q, *v], list[int]()
        moved += range(len(moved), len(self._program.inputs))
        for instruction in self._program.instructions:
            operation, *operands = instruction
            places.append(moved[operands[0]] if operation == "input" else self.again(*with_operands(instruction, places)))
        return {name: [places[index] for index in indices] for name, indices in self._program.outputs.items()}

    def _force(self, outputs: Mapping[str, Sequence[int]]) -> list[int]:
        first = self._nq + self._nv
        passive = [self.sum(first + place, force) for place, force in enumerate(outputs["passive"])]
        held = [self.sum(*pair) for pair in zip(outputs["velocity"], outputs["gravity"], strict=True)]
        return [self.difference(*pair) for pair in zip(passive, held, strict=True)]

    def _acceleration(self, outputs: Mapping[str, Sequence[int]]) -> list[int]:
        return self.solved(self._mass(outputs), self._force(outputs))

    def _mass(self, outputs: Mapping[str, Sequence[int]]) -> Matrix:
        matrix = self._nothing()
        for (i, j), entry in zip(upper_triangle(self._nv), outputs["mass"], strict=True):
            matrix[i][j] = matrix[j][i] = entry
        return matrix

    def _nothing(self) -> Matrix:
        return [[self.number(0)] * self._nv for _ in range(self._nv)]

    # What a rule takes implicitly.

    def _damping(self, rule: StepRule) -> Matrix:
        """D: the minus derivative by the velocities of the forces that the rule takes implicitly."""
        found = self._of_lines(LINE_DAMPING) if Part.LINE_DAMPERS in rule.implicit else self._nothing()
        if Part.JOINT_DAMPERS in rule.implicit:
            for place, damping in enumerate(self.outputs[JOINT_DAMPING]):
                found[place][place] = self.sum(found[place][place], damping)
        if rule.along_branches:
            for i, j in set(upper_triangle(self._nv)) - self._forces.related:
                found[i][j] = found[j][i] = self.number(0)
        slopes = self.outputs.get(derivative_name("velocity"), [])
        for row, column in self._implicit_velocity_terms(rule):
            found[row][column] = self.sum(found[row][column], slopes[row * self._nv + column])
        return found

    def _implicit_velocity_terms(self, rule: StepRule) -> list[tuple[int, int]]:
        """Rows and columns of the derivatives of velocity terms that the rule takes; they are zero across branches."""
        everything = range(self._nv)
        if Part.VELOCITY_TERMS in rule.implicit:
            return [(row, column) for row in everything for column in everything]
        blocks = self._forces.floating if Part.VELOCITY_TERMS_OF_FREE_BODIES in rule.implicit else ()
        return [(row, column) for first in blocks for row in everything[first : first + 6] for column in everything[first : first + 6]]

    def _stiffness(self, rule: StepRule) -> Matrix:
        """K: the minus derivative by the positions."""
        found = self._of_lines(LINE_STIFFNESS) if Part.LINE_SPRINGS in rule.implicit else self._nothing()
        if Part.JOINT_SPRINGS in rule.implicit:
            for place, stiffness in enumerate(self.outputs[JOINT_STIFFNESS]):
                found[place][place] = self.sum(found[place][place], stiffness)
        return found

    def _of_lines(self, coefficient: str) -> Matrix:
        """The sum over all lengths of J' times their coefficient times J."""
        found, slopes = self._nothing(), self.outputs[LINES]
        for number, value in enumerate(self.outputs[coefficient]):
            row = slopes[number * self._nv : (number + 1) * self._nv]
            for i, j in upper_triangle(self._nv):
                found[i][j] = found[j][i] = self.sum(found[i][j], self.product(value, self.product(row[i], row[j])))
        return found

    # Steps of vectors and rotations.

    def _mixed(self, weights: Sequence[Fraction], vectors: Sequence[Sequence[int]]) -> list[int]:
        return [self.dot([self.number(weight) for weight in weights], each) for each in zip(*vectors, strict=True)]

    def _moved(self, values: Sequence[int], length: int, rates: Sequence[int]) -> list[int]:
        return [self.sum(value, self.product(length, rate)) for value, rate in zip(values, rates, strict=True)]

    def _turned(self, q: Sequence[int], length: int, rates: Sequence[int]) -> list[int]:
        """q + h v, rotations as of ``harness.models.step_rule``."""
        after: list[int] = []
        place = 0
        while place < self._nv:
            if place in self._attitudes:
                after += self._rotated(q[len(after) : len(after) + 4], length, rates[place : place + 3])
                place += 3
            else:
                after += self._moved(q[len(after) : len(after) + 1], length, rates[place : place + 1])
                place += 1
        return after

    def _rotated(self, quaternion: Sequence[int], length: int, rate: Sequence[int]) -> list[int]:
        """The quaternion at length 1, followed by the turn h times ``rate`` about the body's axes."""
        size = self.add("sqrt", self.dot(quaternion, quaternion))
        w, *vector = (self.quotient(component, size) for component in quaternion)
        half, square = self._half(length, rate)
        cosine, turn = self._series(square, _COSINE), [self.product(self._series(square, _SINE), component) for component in half]
        along = [self.sum(self.product(w, one), self.product(cosine, other)) for one, other in zip(turn, vector, strict=True)]
        crossed = self.cross(vector, turn)
        return [
            self.difference(self.product(w, cosine), self.dot(vector, turn)),
            *(self.sum(*pair) for pair in zip(along, crossed, strict=True)),
        ]

    def _in_coordinates(self, length: int, slope: Sequence[int], rates: Sequence[int]) -> list[int]:
        """The slopes, at h ``slope`` from the start, of coordinates whose motion has the ``rates``."""
        found = list(rates)
        for first in self._attitudes:
            half, square = self._half(length, slope[first : first + 3])
            once = self.cross(half, rates[first : first + 3])
            factor = self.quotient(self._series(square, _DIFFERENCE), self._series(square, _SINE))
            twice = [self.product(factor, component) for component in self.cross(half, once)]
            found[first : first + 3] = [
                self.sum(self.sum(*three[:2]), three[2]) for three in zip(found[first : first + 3], once, twice, strict=True)
            ]
        return found

    def _half(self, length: int, rate: Sequence[int]) -> tuple[list[int], int]:
        """Half the turn of a step, and its square."""
        half = [self.product(self.product(self.number(Fraction(1, 2)), length), component) for component in rate]
        return half, self.dot(half, half)

    def _series(self, value: int, coefficients: Sequence[Fraction]) -> int:
        """The polynomial by Horner's rule, the constant first."""
        total = self.number(coefficients[-1])
        for coefficient in reversed(coefficients[:-1]):
            total = self.sum(self.product(total, value), self.number(coefficient))
        return total

    def solved(self, matrix: Matrix, right: Sequence[int]) -> list[int]:
        """The solution of linear equations, by elimination without pivots from the last unknown to the first."""
        rows, values, count = [list(row) for row in matrix], list(right), len(right)
        for pivot in reversed(range(count)):
            for row in range(pivot):
                factor = self.quotient(rows[row][pivot], rows[pivot][pivot])
                for column in range(pivot):
                    rows[row][column] = self.difference(rows[row][column], self.product(factor, rows[pivot][column]))
                values[row] = self.difference(values[row], self.product(factor, values[pivot]))
        found: list[int] = []
        for row in range(count):
            known = self.dot(rows[row][:row], found)
            found.append(self.quotient(self.difference(values[row], known), rows[row][row]))
        return found


def _coefficient(power: int) -> Fraction:
    """That of cosine and sine at an even or odd power."""
    return Fraction((-1) ** (power // 2), math.factorial(power))


# In the square x^2 of half a turn: cos x, sin x / x, and (sin x / x - cos x) / x^2.
_COSINE = [_coefficient(2 * power) for power in range(_TERMS)]
_SINE = [_coefficient(2 * power + 1) for power in range(_TERMS)]
_DIFFERENCE = [_coefficient(2 * power + 1) - _coefficient(2 * power) for power in range(1, _TERMS)]
