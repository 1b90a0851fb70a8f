"""The state after one step by a rule, as one program of the state before it, the step length and the numbers of a file.

Linear equations are solved within the program, by elimination without pivots from the last unknown to the first, which on a tree fills
nothing in. Functions of turns are polynomials, which leave nothing out that is felt up to ``LARGEST_TURN``.

Sources: Featherstone, Rigid Body Dynamics Algorithms, section 6.5 (factorisation along branches); Iserles, Munthe-Kaas, Norsett, Zanna,
Lie-group methods, Acta Numerica 9 (2000), sections 3 (Runge-Kutta methods in the coordinates of the exponential map) and B.2 (the
functions of turns in three dimensions).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

from harness.files.rules import ImplicitPart, StepRule
from harness.programs.derivatives import derivative_name, differentiate
from harness.programs.kernels import BallKernel
from harness.programs.program import StraightLineProgram, upper_triangle, without_unused
from harness.programs.terms import Builder, Matrix, Term, Vector, cross, dot, length, symmetric, vector
from harness.trees.bodies.spatial import FileProgram
from harness.trees.recursion import JOINT_DAMPING, JOINT_STIFFNESS, LINE_DAMPING, LINE_STIFFNESS, LINES, StepForces

# Of the cosine of half a turn in a step, and of its sine over it, in the square.
_TERMS = 25
# Of a step [rad], up to which what the polynomials leave out is below 2^-210.
LARGEST_TURN = 2.0

# Of a motion in balls: bits that are tried one after the other, and the radius relative to a number's size, and at least to 1.
_PRECISIONS, _SOUGHT_RADIUS = (128, 256, 512, 1024, 2048, 4096), 2.0**-80

NOTHING = "nothing"
_VELOCITY_TERMS = {ImplicitPart.VELOCITY_TERMS, ImplicitPart.VELOCITY_TERMS_OF_FREE_BODIES}


def velocities(rule: StepRule) -> str:
    """The name of the output that holds the velocities after a step."""
    return f"velocities after a step by {rule.name}"


def positions(rule: StepRule) -> str:
    """The name of the output that holds the positions after a step."""
    return f"positions after a step by {rule.name}"


def steps_program(forces: StepForces, attitudes: Sequence[int], rules: Sequence[StepRule]) -> FileProgram:
    """One step by each of ``rules``; ``attitudes`` are the places in v of what is of a rotation, as of a ``Mechanism``.

    Inputs are q, v, tau, t, the numbers of the file and then the step length of each rule; outputs are ``velocities(rule)`` (nv) and
    ``positions(rule)`` (nq) of each, and a zero, ``NOTHING``.
    """
    nv = len(forces.program.outputs["velocity"])
    # Positions and velocities stand before the applied forces.
    first = forces.program.inputs.index("t") - nv
    slopes = ["velocity"] if any(_VELOCITY_TERMS & rule.implicit for rule in rules) else []
    program = differentiate(forces.program, slopes, range(first - nv, first))
    lengths = tuple(f"h{place}" for place in range(len(rules)))
    program = replace(program, inputs=(*program.inputs, *lengths))
    builder = Builder(program.inputs)
    start = builder.append(program)
    q, v = builder.inputs_at(range(first - nv)), builder.inputs_at(range(first - nv, first))
    stepper = _Stepper(program, forces, attitudes, builder, start, q, v)
    outputs: dict[str, Iterable[Term]] = {}
    for rule, step in zip(rules, builder.inputs[len(builder.inputs) - len(rules) :], strict=True):
        outputs[positions(rule)], outputs[velocities(rule)] = stepper.after(rule, step)
    outputs[NOTHING] = [builder.number(0)]
    return FileProgram(without_unused(builder.program(outputs)), forces.parameters)


def step_by(program: StraightLineProgram, attitudes: Sequence[int], rule: StepRule) -> StraightLineProgram:
    """``steps_program`` of a program whose accelerations are those of a step by ``rule``; inputs are the program's."""
    builder, nv = Builder(program.inputs), len(program.outputs["velocity"])
    first, step = program.inputs.index("t") - nv, builder.number(rule.length)
    q, v = builder.inputs_at(range(first - nv)), builder.inputs_at(range(first - nv, first))
    stepper = _Stepper(program, None, attitudes, builder, builder.append(program), q, v)
    after = _moved(v, step, stepper.acceleration(stepper.outputs))
    outputs = {positions(rule): stepper.turned(step, after), velocities(rule): after, NOTHING: [builder.number(0)]}
    return without_unused(builder.program(outputs))


@dataclass(frozen=True)
class _Stepper:
    """One tree about to make a step.

    Attributes:
        program: its forces, their derivatives and the step lengths as last inputs; ``outputs`` are its outputs at ``q`` and ``v``.
        forces: parts of them; None where no rule takes some implicitly.
        attitudes: the places in v of what is of a rotation.
    """

    program: StraightLineProgram
    forces: StepForces | None
    attitudes: Sequence[int]
    builder: Builder
    outputs: Mapping[str, Sequence[Term]]
    q: Vector
    v: Vector

    @property
    def nv(self) -> int:
        return len(self.v)

    def after(self, rule: StepRule, step: Term) -> tuple[Vector, Vector]:
        """Positions and velocities after a step of a length."""
        return self._by_stages(rule, step) if rule.stages else self._in_one_stage(rule, step)

    def _in_one_stage(self, rule: StepRule, step: Term) -> tuple[Vector, Vector]:
        stiff = self._stiffness(rule)
        matrix = symmetric(self.outputs["mass"], self.nv)
        for row, (of_rates, of_positions) in enumerate(zip(self._damping(rule), stiff, strict=True)):
            for column in range(self.nv):
                implicit = of_rates[column] + step * of_positions[column]
                matrix[row, column] = matrix[row, column] + step * implicit
        force = self._force(self.outputs)
        ahead = vector([step * (row @ self.v) for row in stiff])
        accelerations = solved(matrix, force - ahead)
        after = _moved(self.v, step, accelerations)
        return self.turned(step, self.v if rule.with_old_velocities else after), after

    def _by_stages(self, rule: StepRule, step: Term) -> tuple[Vector, Vector]:
        # Of the coordinates in which the rotations of a stage are where that of the start is zero.
        slopes, accelerations = [self.v], [self.acceleration(self.outputs)]
        for weights in rule.stages:
            slope = _mixed(weights, slopes)
            rates = _moved(self.v, step, _mixed(weights, accelerations))
            accelerations.append(self.acceleration(self._evaluated(self.turned(step, slope), rates)))
            slopes.append(self._in_coordinates(step, slope, rates))
        after = self.turned(step, _mixed(rule.weights, slopes))
        return after, _moved(self.v, step, _mixed(rule.weights, accelerations))

    # The equations of motion.

    def _evaluated(self, q: Vector, v: Vector) -> Mapping[str, Sequence[Term]]:
        """The outputs at another state, under the same forces."""
        return self.builder.append(self.program, [*q, *v, *self.builder.inputs[len(q) + len(v) :]])

    def _force(self, outputs: Mapping[str, Sequence[Term]]) -> Vector:
        first = len(self.q) + self.nv
        passive, velocity, gravity = (vector(outputs[name]) for name in ("passive", "velocity", "gravity"))
        return self.builder.inputs_at(range(first, first + self.nv)) + passive - (velocity + gravity)

    def acceleration(self, outputs: Mapping[str, Sequence[Term]]) -> Vector:
        return solved(symmetric(outputs["mass"], self.nv), self._force(outputs))

    # What a rule takes implicitly.

    def _damping(self, rule: StepRule) -> Matrix:
        """D: the minus derivative by the velocities of the forces that the rule takes implicitly."""
        found = self._of_springs(rule, (ImplicitPart.LINE_DAMPERS, LINE_DAMPING), (ImplicitPart.JOINT_DAMPERS, JOINT_DAMPING))
        if rule.along_branches and self.forces is not None:
            for i, j in set(upper_triangle(self.nv)) - self.forces.related:
                found[i, j] = found[j, i] = self.builder.number(0)
        slopes = self.outputs.get(derivative_name("velocity"), [])
        for row, column in self._implicit_velocity_terms(rule):
            found[row, column] = found[row, column] + slopes[row * self.nv + column]
        return found

    def _implicit_velocity_terms(self, rule: StepRule) -> list[tuple[int, int]]:
        """Rows and columns of the derivatives of velocity terms that the rule takes; they are zero across branches."""
        everything = range(self.nv)
        if ImplicitPart.VELOCITY_TERMS in rule.implicit:
            return [(row, column) for row in everything for column in everything]
        is_floating = ImplicitPart.VELOCITY_TERMS_OF_FREE_BODIES in rule.implicit
        blocks = self.forces.floating if is_floating and self.forces is not None else ()
        return [(row, column) for first in blocks for row in everything[first : first + 6] for column in everything[first : first + 6]]

    def _stiffness(self, rule: StepRule) -> Matrix:
        """K: the minus derivative by the positions."""
        return self._of_springs(rule, (ImplicitPart.LINE_SPRINGS, LINE_STIFFNESS), (ImplicitPart.JOINT_SPRINGS, JOINT_STIFFNESS))

    def _of_springs(self, rule: StepRule, of_lines: tuple[ImplicitPart, str], of_joints: tuple[ImplicitPart, str]) -> Matrix:
        """The sum over lengths of J' times their coefficient times J, and coefficients of joints, where the rule takes them implicitly."""
        found, slopes = self.builder.zeros(self.nv, self.nv), self.outputs[LINES]
        for number, value in enumerate(self.outputs[of_lines[1]] if of_lines[0] in rule.implicit else ()):
            row = slopes[number * self.nv : (number + 1) * self.nv]
            for i, j in upper_triangle(self.nv):
                found[i, j] = found[j, i] = found[i, j] + value * (row[i] * row[j])
        for place, value in enumerate(self.outputs[of_joints[1]] if of_joints[0] in rule.implicit else ()):
            found[place, place] = found[place, place] + value
        return found

    # Steps of vectors and rotations.

    def turned(self, step: Term, rates: Vector) -> Vector:
        """q + h v, rotations as of ``harness.files.rules``."""
        after: list[Term] = []
        place = 0
        while place < self.nv:
            if place in self.attitudes:
                after += _rotated(self.q[len(after) : len(after) + 4], step, rates[place : place + 3])
                place += 3
            else:
                after.append(self.q[len(after)] + step * rates[place])
                place += 1
        return vector(after)

    def _in_coordinates(self, step: Term, slope: Vector, rates: Vector) -> Vector:
        """The slopes, at h ``slope`` from the start, of coordinates whose motion has the ``rates``."""
        found = rates.copy()
        for first in self.attitudes:
            half, square = _half(step, slope[first : first + 3])
            once = cross(half, rates[first : first + 3])
            factor = _series(square, _DIFFERENCE) / _series(square, _SINE)
            twice = factor * cross(half, once)
            found[first : first + 3] = [(rate + one) + two for rate, one, two in zip(found[first : first + 3], once, twice, strict=True)]
        return found


def _mixed(weights: Sequence[Fraction], vectors: Sequence[Vector]) -> Vector:
    """A sum of vectors by weights."""
    builder = vectors[0][0].builder
    return vector([builder.vector(weights) @ vector(each) for each in zip(*vectors, strict=True)])


def _moved(values: Vector, step: Term, rates: Vector) -> Vector:
    return vector(value + step * rate for value, rate in zip(values, rates, strict=True))


def _rotated(quaternion: Vector, step: Term, rate: Vector) -> list[Term]:
    """The quaternion at length 1, followed by the turn h times ``rate`` about the body's axes."""
    w, *rest = quaternion / length(quaternion)
    part = vector(rest)
    half, square = _half(step, rate)
    cosine, turn = _series(square, _COSINE), _series(square, _SINE) * half
    along = vector(w * one + cosine * other for one, other in zip(turn, part, strict=True))
    crossed = cross(part, turn)
    return [w * cosine - part @ turn, *(along + crossed)]


def _half(step: Term, rate: Vector) -> tuple[Vector, Term]:
    """Half the turn of a step, and its square."""
    half = (step.builder.number(Fraction(1, 2)) * step) * rate
    return half, half @ half


def _series(value: Term, coefficients: Sequence[Fraction]) -> Term:
    """The polynomial by Horner's rule, the constant first."""
    total = value.builder.number(coefficients[-1])
    for coefficient in reversed(coefficients[:-1]):
        total = total * value + coefficient
    return total


def solved(matrix: Matrix, right: Vector) -> Vector:
    """The solution of linear equations, by elimination without pivots from the last unknown to the first."""
    rows, values = matrix.copy(), right.copy()
    for pivot in reversed(range(len(values))):
        for row in range(pivot):
            factor = rows[row, pivot] / rows[pivot, pivot]
            for column in range(pivot):
                rows[row, column] = rows[row, column] - factor * rows[pivot, column]
            values[row] = values[row] - factor * values[pivot]
    found: list[Term] = []
    for row, value in enumerate(values):
        known = dot(rows[row, :row], found, value.builder.number(0))
        found.append((value - known) / rows[row, row])
    return vector(found)


def _coefficient(power: int) -> Fraction:
    """That of cosine and sine at an even or odd power."""
    return Fraction((-1) ** (power // 2), math.factorial(power))


# In the square x^2 of half a turn: cos x, sin x / x, and (sin x / x - cos x) / x^2.
_COSINE = [_coefficient(2 * power) for power in range(_TERMS)]
_SINE = [_coefficient(2 * power + 1) for power in range(_TERMS)]
_DIFFERENCE = [_coefficient(2 * power + 1) - _coefficient(2 * power) for power in range(1, _TERMS)]


class DeclaredMotion:
    """The motion that a rule gives over many steps without applied forces, in balls; ``attitudes`` as of ``steps_program``.

    Precision rises until every number of the end is known to ``_SOUGHT_RADIUS``: each step widens the balls by what it does to a
    difference.
    """

    def __init__(self, forces: StepForces, attitudes: Sequence[int], rule: StepRule) -> None:
        self._steps, self._length, self._attitudes = steps_program(forces, attitudes, (rule,)), rule.length, attitudes
        self._kernel = BallKernel(self._steps.program, len(self._steps.parameters) + 1)

    def end(self, q: Sequence[float], v: Sequence[float], steps: int) -> tuple[list[Any], list[Any]]:
        """q and v after so many steps, as ``arb``.

        Raises:
            ValueError: the last precision does not give it, as where the motion breaks down, or a rotation turns by more than
                ``LARGEST_TURN`` in a step.
        """
        import flint

        for precision in _PRECISIONS:
            with flint.ctx.workprec(precision):
                found = self._end([*map(flint.arb, (*q, *v))], len(q), steps)
                if all(ball.is_finite() and ball.rad() <= _SOUGHT_RADIUS * (1 + abs(ball)) for ball in found):
                    return found[: len(q)], found[len(q) :]
        raise ValueError(f"the motion is not certain after {steps} steps of {self._length:g} s, with {_PRECISIONS[-1]} bits either")

    def _end(self, state: list[Any], nq: int, steps: int) -> list[Any]:
        numbers = [*self._steps.numbers, self._length]
        evaluate, still = self._kernel.bind(numbers), [0.0] * (len(state) - nq + 1)
        for _ in range(steps):
            *state, _ = evaluate(*state, *still)
            if not all(ball.is_finite() for ball in state):
                break
            for place in self._attitudes:
                turn = self._length * math.hypot(*map(float, state[nq + place : nq + place + 3]))
                if turn > LARGEST_TURN:
                    raise ValueError(f"a rotation turns by {turn:.3g} rad in a step of {self._length:g} s; expected up to {LARGEST_TURN:g}")
        return state
