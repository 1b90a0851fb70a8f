"""What the equations of every system must satisfy: each property runs by itself over the whole library.

Derivatives along the motion, and those of M, are those of power series in balls: exact, not differences. A
bound is what the certified reference leaves open, |x|_M <= radius, carried through Cauchy-Schwarz:
|e_i' M x| <= sqrt(M_ii) |x|_M and |v' M x| <= |v|_M |x|_M.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import flint
import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness.lagrange.derivation import load_system
from harness.lagrange.euler_angles import body_rates, sines_and_cosines
from harness.lagrange.expressions import assemble
from harness.lagrange.system import TIME, System
from harness.library import Library
from harness.programs.kernels import Float64Kernel
from harness.programs.mechanisms.constraint_forces import MULTIPLIERS
from harness.programs.mechanisms.mechanism import JACOBIAN, Mechanism
from harness.programs.numbers import UNIT_ROUNDOFF
from harness.programs.program import StraightLineProgram, upper_triangle
from harness.programs.states import States
from harness.truth.reference import Reference, ReferenceKernel
from harness.truth.sampling import generic_sample

COUNT = 6
BITS = 320
# What BITS leave after the cancellations of an identity, relative to its largest term.
AT_ZERO = flint.arb(2) ** -160
# Applied forces with so few bits add without rounding.
FORCE_BITS = 20
OTHER_SEED = 5

_ARITHMETIC: dict[str, Callable[[Any, Any], Any]] = {
    "add": lambda a, b: a + b,
    "sub": lambda a, b: a - b,
    "mul": lambda a, b: a * b,
    "div": lambda a, b: a / b,
    "pow": lambda a, b: a**b,
}


def evaluate(program: StraightLineProgram, inputs: Sequence[Any], names: Sequence[str]) -> dict[str, list[Any]]:
    """The named outputs in any arithmetic that has the program's operations: balls, or power series of balls."""
    needed: set[int] = set()
    pending = [index for name in names for index in program.outputs[name]]
    while pending:
        index = pending.pop()
        if index not in needed:
            needed.add(index)
            operation, *operands = program.instructions[index]
            if operation == "integer_power":
                pending.append(operands[0])
            elif operation not in ("input", "rational", "pi"):
                pending.extend(operands)
    values: dict[int, Any] = {}
    for index in sorted(needed):
        operation, *operands = program.instructions[index]
        if operation == "input":
            values[index] = inputs[operands[0]]
        elif operation == "rational":
            values[index] = flint.arb(flint.fmpq(int(operands[0]), int(operands[1])))
        elif operation == "pi":
            values[index] = flint.arb.pi()
        elif operation == "integer_power":
            values[index] = values[operands[0]] ** operands[1]
        elif operation == "neg":
            values[index] = -values[operands[0]]
        elif operation in _ARITHMETIC:
            values[index] = _ARITHMETIC[operation](*(values[operand] for operand in operands))
        else:
            values[index] = getattr(values[operands[0]], operation)()
    return {name: [values[index] for index in program.outputs[name]] for name in names}


def slope(value: Any) -> flint.arb:
    """First-order coefficient of a power series; a ball has none."""
    return value[1] if isinstance(value, flint.arb_series) else flint.arb(0)


def line(values: Sequence[Any], slopes: Sequence[Any]) -> list[flint.arb_series]:
    """values + s slopes, as series in s."""
    return [flint.arb_series([flint.arb(value), flint.arb(rise)]) for value, rise in zip(values, slopes, strict=True)]


def dot(a: Sequence[Any], b: Sequence[Any]) -> Any:
    return sum((x * y for x, y in zip(a, b, strict=True)), flint.arb(0))


def size(values: Sequence[Any]) -> flint.arb:
    return sum((abs(value) for value in values), flint.arb(0))


class Energies:
    """T, V, the generalised forces Q and the rows of constraints, straight from the system file, as functions of joint positions and
    velocities.

    Only a ball or free joint needs a change of variables: Euler angles from the quaternion, and their rates from the
    angular velocity in the body's frame.
    """

    def __init__(self, system: System) -> None:
        q = [sp.Symbol(f"q{i}", real=True) for i in range(len(system.coordinates))]
        velocities = [sp.Symbol(f"u{i}", real=True) for i in range(len(system.coordinates))]
        coordinates, positions, transform = list(system.coordinates), [[symbol] for symbol in q], sp.eye(len(q))
        of_angles: dict[sp.Expr, sp.Expr] = {}
        for attitude in system.attitudes:
            first = coordinates.index(attitude.angles[0])
            angles, quaternion = q[first : first + 3], sp.symbols(f"quaternion{first}_0:4", real=True)
            positions[first : first + 3] = [list(quaternion), [], []]
            transform[first : first + 3, first : first + 3] = body_rates(attitude.sequence, angles).inv()
            pairs, _ = sines_and_cosines(attitude.sequence, sp.Quaternion(*quaternion).to_rotation_matrix())
            for angle, (sine, cosine) in zip(angles, pairs, strict=True):
                of_angles |= {sp.sin(angle): sine, sp.cos(angle): cosine}

        rates = [sp.Symbol(f"v{i}", real=True) for i in range(len(q))]
        plain, position = dict(zip(system.rates, rates, strict=True)), dict(zip(coordinates, q, strict=True))
        of_rates = dict(zip(rates, transform * sp.Matrix(velocities), strict=True))

        def in_velocities(expression: Any) -> Any:
            return sp.sympify(expression).xreplace(plain).xreplace(position).xreplace(of_rates).xreplace(of_angles)

        forces = sp.Matrix([system.generalised_forces.get(x, sp.S.Zero) for x in coordinates])
        outputs = {"kinetic": [system.kinetic], "potential": [system.potential], "forces": transform.T * forces}
        for name, rolling in (("holonomic", False), ("rolling", True)):
            constraints = [one for one in system.constraints.values() if one.is_rolling(system.rates) == rolling]
            outputs[name] = [row for one in constraints for number, row in enumerate(one.rows) if number not in one.redundant]
        self.conservative = not any(forces)
        self._parameters = [flint.arb(float(value)) for value, _ in system.parameters.values()]
        self._program = assemble(
            [*(symbol for part in positions for symbol in part), *velocities, TIME, *system.parameters],
            {name: [in_velocities(entry) for entry in entries] for name, entries in outputs.items()},
        )

    def kinetic(self, q: Sequence[Any], v: Sequence[Any], time: Any) -> Any:
        return evaluate(self._program, [*q, *v, time, *self._parameters], ["kinetic"])["kinetic"][0]

    def potential(self, q: Sequence[Any], time: Any) -> Any:
        rest = [flint.arb(0)] * (len(self._program.inputs) - len(q) - 1 - len(self._parameters))
        return evaluate(self._program, [*q, *rest, time, *self._parameters], ["potential"])["potential"][0]

    def rows(self, q: Sequence[Any], v: Sequence[Any]) -> tuple[list[Any], list[Any]]:
        """Those of constraints that are not redundant: holonomic ones, and rolling ones."""
        found = evaluate(self._program, [*q, *v, flint.arb(0), *self._parameters], ["holonomic", "rolling"])
        return found["holonomic"], found["rolling"]

    def forces(self, q: Sequence[Any], v: Sequence[Any], time: Any) -> list[Any]:
        return evaluate(self._program, [*q, *v, time, *self._parameters], ["forces"])["forces"]

    def jacobi(self, q: Sequence[Any], v: Sequence[Any], time: Any) -> Any:
        """h = sum v dL/dv - L = T2 - T0 + V, T2 and T0 the parts of T of second and zeroth degree in the rates."""
        ahead, back = self.kinetic(q, v, time), self.kinetic(q, [-rate for rate in v], time)
        return (ahead + back) / 2 - 2 * self.kinetic(q, [flint.arb(0)] * len(v), time) + self.potential(q, time)


@dataclass(frozen=True)
class Case:
    """A system with its certified accelerations at a few states, each for several rates and applied forces."""

    mechanism: Mechanism
    system: System

    @cached_property
    def energies(self) -> Energies:
        return Energies(self.system)

    @cached_property
    def states(self) -> States:
        states = generic_sample(self.mechanism, COUNT, zlib.crc32(self.mechanism.name.encode()))
        return States(states.q, states.v, few_bits(states.tau), states.time)

    @cached_property
    def other_forces(self) -> Any:
        """A second set of applied forces, (COUNT, nv)."""
        return few_bits(generic_sample(self.mechanism, COUNT, OTHER_SEED).tau)

    @cached_property
    def _variants(self) -> dict[str, States]:
        base = self.states
        return {
            "base": base,
            "reversed": States(base.q, -base.v, base.tau, base.time),
            "free": States(base.q, base.v, 0 * base.tau, base.time),
            "other": States(base.q, base.v, self.other_forces, base.time),
            "both": States(base.q, base.v, base.tau + self.other_forces, base.time),
        }

    @cached_property
    def _references(self) -> dict[str, Reference]:
        reference = ReferenceKernel(self.mechanism).evaluate(States.concatenate(list(self._variants.values())))
        assert reference.certified.all()
        return {name: reference[number * COUNT : (number + 1) * COUNT] for number, name in enumerate(self._variants)}

    def accelerations(self, variant: str, index: int) -> list[flint.arb]:
        reference = self._references[variant]
        pairs = zip(reference.high[index].tolist(), reference.low[index].tolist(), strict=True)
        return [flint.arb(high) + flint.arb(low) for high, low in pairs]

    def uncertainty(self, variant: str, index: int, mass: list[list[flint.arb]]) -> flint.arb:
        """Bound of the error of ``accelerations`` in the energy norm: the radius, and the rounding of the low part."""
        reference = self._references[variant]
        # The radius is a float64 norm, good to a few ulps. Half of the smallest subnormal is what ``low`` can miss.
        radius = flint.arb(float(reference.radius[index])) * (1 + flint.arb(2) ** -40)
        highs = reference.high[index].tolist()
        return radius + dot(
            [mass[i][i].sqrt() for i in range(len(mass))],
            [abs(flint.arb(high)) * flint.arb(2) ** -106 + flint.arb(2) ** -1075 for high in highs],
        )

    def state(self, index: int) -> tuple[list[Any], list[Any], list[Any], Any]:
        """q, v, tau and time of one state."""
        state = self.states[index : index + 1]
        return balls(state.q[0]), balls(state.v[0]), balls(state.tau[0]), flint.arb(float(state.time[0]))

    def constraint_forces(self, variant: str, index: int) -> list[Any]:
        """-J' lambda in one variant: what holds the constraints, and does work only as far as rounded rates leave them open."""
        constraints, nv = self.mechanism.constraints, self.mechanism.nv
        if constraints is None:
            return [flint.arb(0)] * nv
        state = self._variants[variant][index : index + 1]
        inputs = [*balls(state.q[0]), *balls(state.v[0]), *balls(state.tau[0]), flint.arb(float(state.time[0]))]
        inputs += balls(self.mechanism.parameter_values)
        multipliers = evaluate(self.mechanism.program, inputs, [MULTIPLIERS])[MULTIPLIERS]
        jacobian = evaluate(constraints.program, inputs, [JACOBIAN])[JACOBIAN]
        return [-dot(multipliers, [jacobian[row * nv + place] for row in constraints.independent]) for place in range(nv)]

    def velocity_terms(self, index: int, v: Sequence[Any]) -> list[Any]:
        """Those of one state, at other velocities."""
        return evaluate(self.mechanism.program, self._inputs(index, self.state(index)[0], v), ["velocity"])["velocity"]

    def position_rates(self, index: int) -> list[Any]:
        """q' at one state: a quaternion turns with half of its product with the angular velocity in the body's frame."""
        q, v, _, _ = self.state(index)
        rates: list[Any] = []
        for coordinate in range(self.mechanism.nv):
            first = max((place for place in self.mechanism.attitudes if place <= coordinate < place + 3), default=None)
            if first is None:
                rates.append(v[coordinate])
            elif first == coordinate:
                w, x, y, z = q[len(rates) : len(rates) + 4]
                a, b, c = v[first : first + 3]
                doubled = [-x * a - y * b - z * c, w * a + y * c - z * b, w * b + z * a - x * c, w * c + x * b - y * a]
                rates.extend(rate / 2 for rate in doubled)
        return rates

    def gyroscopic_forces(self, index: int) -> list[Any]:
        """dT1/dq - d/dt(dT1/dv) at one state and v, without accelerations and what v = 0 leaves; T1 the part of T linear in v.

        Exact zeros where T is even in the velocities, whatever the joints are.
        """
        q, v, _, time = self.state(index)
        nv = self.mechanism.nv
        axes = [[flint.arb(int(i == j)) for j in range(nv)] for i in range(nv)]

        def linear(position: Sequence[Any], rates: Sequence[Any]) -> Any:
            ahead, back = (self.energies.kinetic(position, [sign * rate for rate in rates], time) for sign in (1, -1))
            return (ahead - back) / 2

        if self.mechanism.attitudes:
            assert abs(linear(q, v)) <= AT_ZERO * self.energies.kinetic(q, v, time)
            return [flint.arb(0)] * nv
        return [slope(linear(line(q, axis), v)) - slope(linear(line(q, v), axis)) for axis in axes]

    def _inputs(self, index: int, q: Sequence[Any], v: Sequence[Any]) -> list[Any]:
        _, _, tau, time = self.state(index)
        return [*q, *v, *tau, time, *balls(self.mechanism.parameter_values)]

    def mass(self, index: int, q: Sequence[Any] | None = None) -> list[list[Any]]:
        """M at one state, or at other positions."""
        position, v, _, _ = self.state(index)
        flat = evaluate(self.mechanism.program, self._inputs(index, q or position, v), ["mass"])["mass"]
        entries = dict(zip(upper_triangle(self.mechanism.nv), flat, strict=True))
        return [[entries[min(i, j), max(i, j)] for j in range(self.mechanism.nv)] for i in range(self.mechanism.nv)]


def balls(values: Any) -> list[flint.arb]:
    return [flint.arb(float(value)) for value in values]


def few_bits(forces: Any) -> Any:
    """``forces`` rounded to multiples of a power of two common to the column, FORCE_BITS below its largest."""
    _, exponent = np.frexp(np.abs(forces).max(axis=0))
    unit = np.ldexp(1.0, exponent - FORCE_BITS)
    return np.round(forces / unit) * unit


def summed(*forces: Sequence[Any]) -> list[Any]:
    return [sum(entries, flint.arb(0)) for entries in zip(*forces, strict=True)]


def less(first: Sequence[Any], second: Sequence[Any]) -> list[Any]:
    return [a - b for a, b in zip(first, second, strict=True)]


def times(matrix: list[list[Any]], vector: Sequence[Any]) -> list[Any]:
    return [dot(row, vector) for row in matrix]


@pytest.fixture(autouse=True)
def precision() -> Iterator[None]:
    previous = flint.ctx.prec, flint.ctx.cap
    flint.ctx.prec, flint.ctx.cap = BITS, 2
    yield
    flint.ctx.prec, flint.ctx.cap = previous


@pytest.fixture(scope="session")
def case(built_in_mechanism: Mechanism, built_in_system: System) -> Case:
    return Case(built_in_mechanism, built_in_system)


@pytest.fixture(scope="session")
def plain_case(plain_name: str, plain_mechanism: Mechanism) -> Case:
    return Case(plain_mechanism, load_system(Library.built_in().system_path(plain_name))[0])


def test_mass_matrix_is_positive_definite(case: Case) -> None:
    """Certainly so in balls, by the pivots of L D L'; and within rounding in the compiled kernel."""
    nv = case.mechanism.nv
    compiled = Float64Kernel(case.mechanism.program).terms(case.mechanism.inputs(case.states))["mass"]
    for index in range(COUNT):
        mass = case.mass(index)
        exact = np.array([[float(entry) for entry in row] for row in mass])
        scale = np.sqrt(np.outer(exact.diagonal(), exact.diagonal()))
        rest = [list(row) for row in mass]
        for j in range(nv):
            assert rest[j][j] > 0, case.states.as_json(index)
            for i in range(j + 1, nv):
                factor = rest[i][j] / rest[j][j]
                rest[i] = [entry - factor * above for entry, above in zip(rest[i], rest[j], strict=True)]
        # Every entry is a sum of few products, none larger than its bound by Cauchy-Schwarz.
        assert (np.abs(compiled[index] - exact) <= 64 * nv * UNIT_ROUNDOFF * scale).all()
        assert (compiled[index] == compiled[index].T).all()


def test_mass_matrix_is_that_of_the_kinetic_energy(case: Case) -> None:
    """T2 = v' M v / 2, T from the system file."""
    for index in range(COUNT):
        q, v, _, time = case.state(index)
        ahead, back, rest = (case.energies.kinetic(q, rates, time) for rates in (v, [-rate for rate in v], [0 * rate for rate in v]))
        twice = dot(v, times(case.mass(index), v))
        assert abs(ahead + back - 2 * rest - twice) <= AT_ZERO * (abs(ahead) + abs(back) + abs(rest))


def test_power_balance_of_the_certified_acceleration(case: Case) -> None:
    """dh/dt = sum (Q + tau - J' lambda) v - dL/dt along the motion with v' = the certified qdd.

    h is Jacobi's energy function, T + V where T is quadratic in the rates. An error of qdd does the power v' M dqdd.
    """
    energies = case.energies
    for index in range(COUNT):
        q, v, tau, time = case.state(index)
        mass = case.mass(index)
        passing = flint.arb_series([time, 1])
        growth = slope(energies.jacobi(line(q, case.position_rates(index)), line(v, case.accelerations("base", index)), passing))
        lagrangian = slope(energies.kinetic(q, v, passing)) - slope(energies.potential(q, passing))
        power = dot(summed(energies.forces(q, v, time), tau, case.constraint_forces("base", index)), v)
        allowed = dot(v, times(mass, v)).sqrt() * case.uncertainty("base", index, mass)
        # The second summand is for the radius of the left-hand side alone, which the precision makes tiny.
        assert abs(growth - power + lagrangian) <= allowed + AT_ZERO * (abs(growth) + abs(power)), case.states.as_json(index)


def test_christoffel_matrix_is_passive_and_gives_the_velocity_terms(plain_case: Case) -> None:
    """M' - 2C is skew, and C v is the part of the velocity terms that is quadratic in v.

    C is made here, from exact derivatives of M, and M' is one along v: neither is the derivation's own.
    Christoffel symbols belong to velocities that are rates of coordinates, which angular velocities are not.
    Source: Spong, Hutchinson, Vidyasagar, Robot Modeling and Control, section 7.3.
    """
    case, nv = plain_case, plain_case.mechanism.nv
    for index in range(COUNT // 2):
        q, v, _, _ = case.state(index)
        slopes = [[[slope(entry) for entry in row] for row in case.mass(index, line(q, [i == j for j in range(nv)]))] for i in range(nv)]
        matrix = [
            [sum(((slopes[i][k][j] + slopes[j][k][i] - slopes[k][i][j]) * v[i] for i in range(nv)), flint.arb(0)) / 2 for j in range(nv)]
            for k in range(nv)
        ]
        growth = [[slope(entry) for entry in row] for row in case.mass(index, line(q, v))]
        skew = [[growth[i][j] - 2 * matrix[i][j] for j in range(nv)] for i in range(nv)]
        largest = size([entry for row in (*matrix, *growth) for entry in row])
        assert all(abs(skew[i][j] + skew[j][i]) <= AT_ZERO * largest for i in range(nv) for j in range(nv))

        ahead, back, rest = (case.velocity_terms(index, rates) for rates in (v, [-rate for rate in v], [0 * rate for rate in v]))
        for given, *parts in zip(times(matrix, v), ahead, back, rest, strict=True):
            assert abs(given - (parts[0] + parts[1]) / 2 + parts[2]) <= AT_ZERO * (size(parts) + largest * size(v))


def test_time_reversal(case: Case) -> None:
    """M (qdd(q, v) - qdd(q, -v)) = F(q, v) - F(q, -v), F = Q - J' lambda, which is zero for a conservative system: it runs back
    as it came.

    Unless T has terms linear in the rates, as in a magnetic field, whose gyroscopic forces turn round with them.
    """
    check_time_reversal(case)


def test_time_reversal_in_a_magnetic_field(mechanism_of: Callable[[System], Mechanism]) -> None:
    x, y = dynamicsymbols("x y")
    m, field = sp.symbols("m B", positive=True)
    u, v = x.diff(TIME), y.diff(TIME)
    ranges = {x: (-1.0, 1.0), y: (-1.0, 1.0)}
    charge = System(
        coordinates={x: "along", y: "across"},
        kinetic=m * (u**2 + v**2) / 2 + field * sp.cos(TIME) * (x * v - y**3 * u) / 2,
        potential=sp.S.Zero,
        parameters={m: (2.0, "kg"), field: (3.0, "kg/s")},
        total_mass=m,
        ranges=ranges,
    )
    case = Case(mechanism_of(charge), charge)
    check_time_reversal(case)
    assert all(any(abs(force) > 0 for force in case.gyroscopic_forces(index)) for index in range(COUNT))


def check_time_reversal(case: Case) -> None:
    for index in range(COUNT):
        q, v, _, time = case.state(index)
        back, mass = [-rate for rate in v], case.mass(index)
        forces = less(case.energies.forces(q, v, time), case.energies.forces(q, back, time))
        held = less(case.constraint_forces("base", index), case.constraint_forces("reversed", index))
        assert not case.energies.conservative or all(force == 0 for force in forces)
        forces = [force + 2 * turning for force, turning in zip(summed(forces, held), case.gyroscopic_forces(index), strict=True)]
        change = less(case.accelerations("base", index), case.accelerations("reversed", index))
        allowed = case.uncertainty("base", index, mass) + case.uncertainty("reversed", index, mass)
        for i, (found, expected) in enumerate(zip(times(mass, change), forces, strict=True)):
            assert abs(found - expected) <= mass[i][i].sqrt() * allowed + AT_ZERO * abs(expected), case.states.as_json(index)


def test_accelerations_are_linear_in_the_applied_forces(case: Case) -> None:
    """qdd(tau1 + tau2) - qdd(tau1) - qdd(tau2) + qdd(0) = 0 and M (qdd(tau) - qdd(0)) = tau, and what it changes in -J' lambda."""
    for index in range(COUNT):
        mass = case.mass(index)
        base, other, both, free = (case.accelerations(name, index) for name in ("base", "other", "both", "free"))
        unknown = {name: case.uncertainty(name, index, mass) for name in ("base", "other", "both", "free")}
        superposed = times(mass, [sum_ - a - b + c for sum_, a, b, c in zip(both, base, other, free, strict=True)])
        forces = {"base": case.states.tau[index], "other": case.other_forces[index]}
        for i, rest in enumerate(superposed):
            assert abs(rest) <= mass[i][i].sqrt() * sum(unknown.values(), flint.arb(0))
        for name, moved in (("base", base), ("other", other)):
            felt = times(mass, less(moved, free))
            held = less(case.constraint_forces(name, index), case.constraint_forces("free", index))
            for i, force in enumerate(summed(balls(forces[name]), held)):
                assert abs(felt[i] - force) <= mass[i][i].sqrt() * (unknown[name] + unknown["free"]) + AT_ZERO * abs(force)


def test_accelerations_keep_the_constraints(case: Case) -> None:
    """The second derivative of holonomic rows, and the first of rolling ones, is zero along the motion with v' = the certified qdd.

    All derivatives are those of power series of the rows in the system file.
    """
    flint.ctx.cap = 3
    energies, nv = case.energies, case.mechanism.nv
    axes = [[int(i == j) for j in range(nv)] for i in range(nv)]
    for index in range(COUNT if case.system.constraints else 0):
        q, v, _, _ = case.state(index)
        a = case.accelerations("base", index)
        moved = [flint.arb_series([x, rate, acceleration / 2]) for x, rate, acceleration in zip(q, v, a, strict=True)]
        holonomic, rolling = energies.rows(moved, line(v, a))
        left = [2 * row[2] for row in holonomic] + [row[1] for row in rolling]
        columns = [(energies.rows(line(q, axis), v)[0], energies.rows(q, line(v, axis))[1]) for axis in axes]
        jacobian = [[slope(entry) for entry in row] for part in zip(*columns, strict=True) for row in zip(*part, strict=True)]
        mass = case.mass(index)
        allowed = case.uncertainty("base", index, mass)
        for row, rest in zip(jacobian, left, strict=True):
            compliance = flint.arb_mat(mass).solve(flint.arb_mat(nv, 1, row))
            felt = dot(row, [compliance[place, 0] for place in range(nv)]).sqrt()
            assert abs(rest) <= felt * allowed, case.states.as_json(index)
