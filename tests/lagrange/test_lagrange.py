"""Lagrange's equations for kinetic energies of every form, and declarations that contradict themselves."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from typing import Any

import mpmath
import pytest
import sympy as sp
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from support import energy_function
from sympy.physics.mechanics import LagrangesMethod, dynamicsymbols

from harness.lagrange.equations import derive
from harness.lagrange.system import TIME, System
from harness.programs.states import DEFAULT_RATES

t = TIME
x, y, theta = dynamicsymbols("x y theta")
m, length, g, k, turn, amplitude, frequency, charge = sp.symbols("m length g k turn amplitude frequency charge", positive=True)
VALUES = {
    m: (1.5, "kg"),
    length: (0.7, "m"),
    g: (9.81, "m/s^2"),
    k: (30.0, "N/m"),
    turn: (2.3, "1/s"),
    amplitude: (0.1, "m"),
    frequency: (7.0, "1/s"),
    charge: (0.4, "kg/s"),
}


def make_system(coordinates: dict[Any, str], kinetic: Any, potential: Any = 0, forces: Any = None, gravity: Any = None) -> System:
    used = sp.Tuple(kinetic, potential, m, *(forces or {}).values()).free_symbols
    return System(
        coordinates=coordinates,
        kinetic=kinetic,
        potential=potential,
        generalised_forces=forces or {},
        parameters={symbol: value for symbol, value in VALUES.items() if symbol in used},
        total_mass=m,
        gravity=gravity,
    )


def pendulum_with_moving_pivot(pivot_x: Any, pivot_z: Any) -> System:
    velocity = sp.Matrix([pivot_x + length * sp.sin(theta), pivot_z - length * sp.cos(theta)]).diff(t)
    height = pivot_z - length * sp.cos(theta)
    return make_system({theta: "pin"}, m * velocity.dot(velocity) / 2, m * g * height, gravity=g)


def shaken(motion: Any) -> sp.Expr:
    """The acceleration of a pivot."""
    return (amplitude * motion(frequency * t)).diff(t, 2)


OMEGA = sp.Matrix([0, 0, turn])
# Each with the accelerations of its source, of the coordinates and of their rates.
UNUSUAL: dict[str, tuple[System, Callable[..., Any]]] = {
    # Goldstein, Poole, Safko, chapter 2, problem 18: centrifugal force from the part of T without rates.
    "rotating hoop": (
        make_system(
            {theta: "bead"},
            m * length**2 * (theta.diff(t) ** 2 + turn**2 * sp.sin(theta) ** 2) / 2,
            -m * g * length * sp.cos(theta),
            gravity=g,
        ),
        lambda q, v: [turn**2 * sp.sin(q[0]) * sp.cos(q[0]) - g / length * sp.sin(q[0])],
    ),
    # Goldstein, Poole, Safko, equation 4.91: a = -2 Omega x v - Omega x (Omega x r).
    "rotating frame": (
        make_system({x: "a", y: "b"}, m * ((x.diff(t) - turn * y) ** 2 + (y.diff(t) + turn * x) ** 2) / 2),
        lambda q, v: (-2 * OMEGA.cross(sp.Matrix([*v, 0])) - OMEGA.cross(OMEGA.cross(sp.Matrix([*q, 0]))))[:2],
    ),
    # Landau, Lifshitz, Mechanics, section 5, problem 3: the frame of the pivot adds minus its acceleration to gravity.
    "shaken pendulum": (
        pendulum_with_moving_pivot(0, amplitude * sp.cos(frequency * t)),
        lambda q, v: [-(g + shaken(sp.cos)) / length * sp.sin(q[0])],
    ),
    "pushed pendulum": (
        pendulum_with_moving_pivot(amplitude * sp.cos(frequency * t), 0),
        lambda q, v: [-g / length * sp.sin(q[0]) - shaken(sp.cos) / length * sp.cos(q[0])],
    ),
    # Goldstein, Poole, Safko, section 1.5: m a = q v x B.
    "charged particle": (
        make_system({x: "a", y: "b"}, m * (x.diff(t) ** 2 + y.diff(t) ** 2) / 2 + charge / 2 * (x * y.diff(t) - y * x.diff(t))),
        lambda q, v: [charge / m * v[1], -charge / m * v[0]],
    ),
    # d/dt(m (1 + f t) v + b t) = m (1 + f t) a + m f v + b, by hand.
    "growing mass": (
        make_system({x: "a"}, m * (1 + frequency * t) * x.diff(t) ** 2 / 2 + charge * t * x.diff(t), forces={x: -k * x}),
        lambda q, v: [-(k * q[0] + m * frequency * v[0] + charge) / (m * (1 + frequency * t))],
    ),
}


@pytest.mark.parametrize("name", UNUSUAL)
def test_accelerations_are_those_of_the_textbook(name: str) -> None:
    system, textbook = UNUSUAL[name]
    equations = derive(system)
    found = equations.mass_matrix.LUsolve(equations.right_hand_side)
    assert (found - sp.Matrix(textbook(equations.coordinates, equations.rates))).applyfunc(sp.simplify).is_zero_matrix


def test_a_term_that_is_linear_in_the_velocity_is_no_energy() -> None:
    equations = derive(UNUSUAL["charged particle"][0])
    assert sp.simplify(energy_function(equations) - m * sum(rate**2 for rate in equations.rates) / 2) == 0


def test_explicit_time_in_the_kinetic_energy_is_among_the_velocity_terms() -> None:
    equations = derive(UNUSUAL["growing mass"][0])
    assert sp.simplify(equations.velocity_terms[0] - m * frequency * equations.rates[0] - charge) == 0
    assert sp.simplify(equations.passive_forces[0] + k * equations.coordinates[0]) == 0


def test_gravity_and_springs_are_kept_apart() -> None:
    system = make_system({x: "a"}, m * x.diff(t) ** 2 / 2, m * g * x + k * x**2 / 2, forces={x: -charge * x.diff(t)}, gravity=g)
    equations = derive(system)
    (position,), (rate,) = equations.coordinates, equations.rates
    assert sp.simplify(equations.gravity_terms[0] - m * g) == 0
    assert sp.simplify(equations.passive_forces[0] + k * position + charge * rate) == 0
    assert sp.simplify(equations.generalised_forces[0] + charge * rate) == 0


def brute_force_lagrange(system: System, exact: Any) -> Callable[..., Any]:
    """d/dt(dL/dv) - dL/dq - Q by SymPy's own class, as a function of the flat arguments and the accelerations."""
    coordinates = list(system.coordinates)
    method = LagrangesMethod(system.kinetic - system.potential, coordinates)
    left = method.form_lagranges_equations()
    forces = sp.Matrix([system.generalised_forces.get(q, 0) for q in coordinates])
    accelerations = sp.symbols(f"a:{len(coordinates)}")
    plain: dict[Any, Any] = {q.diff(t, 2): a for q, a in zip(coordinates, accelerations, strict=True)}
    plain |= dict(zip(system.rates, exact.equations.rates, strict=True))
    plain |= dict(zip(coordinates, exact.equations.coordinates, strict=True))
    # Second derivatives hold first ones, which hold coordinates: the order of replacement matters.
    flat = list(left - forces)
    for key in plain:
        flat = [row.xreplace({key: plain[key]}) for row in flat]
    return exact.function(flat, accelerations)


def state_strategy(exact: Any) -> st.SearchStrategy[list[Fraction]]:
    """q, v and acceleration as rationals within the declared ranges, and the time."""

    def within(low: float, high: float) -> st.SearchStrategy[Fraction]:
        return st.fractions(0, 1, max_denominator=1000).map(lambda part: Fraction(low) + (Fraction(high) - Fraction(low)) * part)

    system = exact.system
    positions = [within(*system.ranges.get(q, (-4, 4))) for q in system.coordinates]
    rates = [within(*system.ranges.get(v, DEFAULT_RATES)) for v in system.rates]
    return st.tuples(*positions, *rates, *[within(-10, 10)] * exact.nv, within(0, 10)).map(list)


def in_digits(values: list[Fraction]) -> list[mpmath.mpf]:
    with mpmath.workdps(80):
        return [mpmath.mpf(value.numerator) / value.denominator for value in values]


def check_equations(system: System, exact: Any) -> None:
    # Second derivatives of a long arm's unexpanded energies take SymPy's class minutes.
    sympys = brute_force_lagrange(system, exact) if exact.nv <= 3 else None
    n = exact.nv

    # At eighty digits, equations that are right at one state outside of a few are right at all.
    examples = 4 if exact.nv <= 3 else 2

    @settings(max_examples=examples)
    @given(state_strategy(exact))
    def same_at_every_state(state: list[Fraction]) -> None:
        numbers = in_digits(state)
        arguments = [*numbers[: 2 * n], *[mpmath.mpf(0)] * n, numbers[-1], *exact.parameters]
        accelerations = numbers[2 * n : 3 * n]
        with mpmath.workdps(80):
            mass, force = exact.mass_and_force(arguments)
            assert mass == mass.T
            # Cholesky factors exist for positive definite matrices alone; mpmath raises ValueError for others.
            # The angles of a ball or free joint are singular somewhere, and so is M there.
            assume(not system.attitudes or abs(mpmath.det(mass)) > 0)
            mpmath.cholesky(mass)
            mine = mass * mpmath.matrix(accelerations) - force
            size = 1 + mpmath.mnorm(force) + mpmath.mnorm(mass) * mpmath.fsum(accelerations, absolute=True)
            for row, differences in zip(mine, exact.euler_lagrange(arguments, accelerations), strict=True):
                assert abs(row - differences) <= size * mpmath.mpf(10) ** -28
            if sympys is not None:
                for row, symbolic in zip(mine, sympys(arguments, *accelerations), strict=True):
                    assert abs(row - symbolic) <= size * mpmath.mpf(10) ** -60

    same_at_every_state()


@pytest.mark.ci
def test_built_in_equations_are_those_of_two_other_ways(built_in_system: System, built_in_exact: Any) -> None:
    check_equations(built_in_system, built_in_exact)


@pytest.mark.parametrize("name", UNUSUAL)
def test_unusual_equations_are_those_of_two_other_ways(name: str, exact_of: Callable[[System], Any]) -> None:
    check_equations(UNUSUAL[name][0], exact_of(UNUSUAL[name][0]))


@pytest.mark.parametrize("name", UNUSUAL)
def test_energy_balance_with_explicit_time(name: str, exact_of: Callable[[System], Any]) -> None:
    exact = exact_of(UNUSUAL[name][0])
    with mpmath.workdps(80):
        for step in range(1, 6):
            free = [mpmath.mpf(7 * step + 3 * i) / 11 for i in range(3 * exact.nv + 1)]
            residual, scale = exact.energy_balance([*free, *exact.parameters])
            assert scale > 0
            assert abs(residual) <= scale * mpmath.mpf(10) ** -40


def test_built_in_derivation_is_idle_where_nothing_acts() -> None:
    """A free particle: no velocity terms, no gravity, no passive force, nothing of the other coordinate."""
    equations = derive(make_system({x: "a", y: "b"}, m * (x.diff(t) ** 2 + y.diff(t) ** 2) / 2))
    assert equations.mass_matrix == m * sp.eye(2)
    assert equations.right_hand_side == sp.zeros(2, 1)


def declaration(**changes: Any) -> dict[str, Any]:
    valid: dict[str, Any] = {
        "coordinates": {x: "slide"},
        "kinetic": m * x.diff(t) ** 2 / 2,
        "potential": m * g * x,
        "parameters": {m: (1.0, "kg"), g: (9.81, "m/s^2")},
        "total_mass": m,
        "gravity": g,
    }
    return valid | changes


f = sp.Function("f")
outward = dynamicsymbols("outward", positive=True)
MOVING_OUTWARD = {"coordinates": {outward: "slide"}, "kinetic": m * outward.diff(t) ** 2 / 2, "potential": m * g * sp.sqrt(outward**2)}
BAD_DECLARATIONS: dict[str, tuple[dict[str, Any], str]] = {
    "no coordinates": ({"coordinates": {}}, "coordinates is empty"),
    "coordinate is a symbol": ({"coordinates": {sp.Symbol("x"): "slide"}}, "coordinate x is not a dynamicsymbols"),
    "coordinate of another variable": ({"coordinates": {f(sp.Symbol("s")): "slide"}}, r"coordinate f\(s\) is not a dynamicsymbols"),
    "coordinate is a rate": ({"coordinates": {x.diff(t): "slide"}}, "is not a dynamicsymbols"),
    "empty joint": ({"coordinates": {x: ""}}, r"coordinate x\(t\) has joint ''"),
    "joint is a number": ({"coordinates": {x: 3}}, "has joint 3; expected a joint name"),
    "one joint twice": (
        {"coordinates": {x: "slide", y: "slide"}, "kinetic": m * (x.diff(t) ** 2 + y.diff(t) ** 2) / 2},
        "joint 'slide' carries two coordinates",
    ),
    "force on no coordinate": ({"generalised_forces": {y: m * g}}, r"generalised force on y\(t\), which is no coordinate"),
    "value without unit": ({"parameters": {m: 1.0, g: (9.81, "m/s^2")}}, r"parameter m is 1.0; expected \(value, unit\)"),
    "value is a text": ({"parameters": {m: ("1", "kg"), g: (9.81, "m/s^2")}}, "parameter m has value '1'"),
    "value is a truth": ({"parameters": {m: (True, "kg"), g: (9.81, "m/s^2")}}, "parameter m has value True"),
    "value is not finite": ({"parameters": {m: (float("inf"), "kg"), g: (9.81, "m/s^2")}}, "expected a finite number"),
    "value against its symbol": (
        {"parameters": {m: (-0.5, "kg"), g: (9.81, "m/s^2")}},
        "parameter m holds -0.5, and m is declared positive",
    ),
    "zero against its symbol": ({"parameters": {m: (0.0, "kg"), g: (9.81, "m/s^2")}}, "parameter m holds 0, and m is declared"),
    "range against its coordinate": (
        {**MOVING_OUTWARD, "ranges": {outward: (-1.0, 2.0)}},
        r"the range of outward\(t\) holds -1, and outward\(t\) is declared positive",
    ),
    "no range against its coordinate": (MOVING_OUTWARD, "the range of outward.* is declared positive"),
    "number that SymPy rounds": ({"kinetic": sp.Float(0.1) * m * x.diff(t) ** 2}, "kinetic contains 0.1.*, which SymPy rounds"),
    "two of one name": (
        {"parameters": {m: (1.0, "kg"), g: (9.81, "m/s^2"), sp.Symbol("m"): (1.0, "kg")}},
        "two parameters are named 'm'",
    ),
    "gravity without value": ({"gravity": sp.Symbol("G")}, "gravity is G, which is not among the parameters"),
    "undeclared symbol": ({"kinetic": k * x.diff(t) ** 2 / 2}, "kinetic contains k, which has no value"),
    "undeclared symbol in a force": ({"generalised_forces": {x: -k * x}}, r"generalised force on x\(t\) contains k"),
    "second rate": ({"kinetic": m * x.diff(t, 2) ** 2 / 2}, "only first rates"),
    "rate of no coordinate": ({"kinetic": m * (x.diff(t) ** 2 + y.diff(t) ** 2) / 2}, "only first rates of the coordinates"),
    "another coordinate": ({"potential": m * g * y}, r"potential contains y\(t\), which is no coordinate"),
    "potential with a rate": ({"potential": m * g * x + m * x * x.diff(t)}, "potential contains a rate"),
    "mass of a coordinate": ({"total_mass": m * x}, "total_mass depends on a coordinate"),
    "unused parameter": ({"parameters": {m: (1.0, "kg"), g: (9.81, "m/s^2"), k: (1.0, "N/m")}}, "parameter k enters neither"),
    "start of something else": ({"start": {y: 0.0}}, r"start of y\(t\), which is neither"),
    "start without end": ({"start": {x.diff(t): float("inf")}}, "start of .* is inf; expected a finite number"),
    "start is a tuple": ({"start": (0.1, 0.0)}, r"start is \(0.1, 0.0\); expected a mapping, \{coordinate or rate: value\}"),
    "start of a tuple": ({"start": {x: (0.1, 0.0)}}, r"start of x\(t\) is \(0.1, 0.0\); expected a finite number"),
    "start of a text": ({"start": {x: "0.1"}}, r"start of x\(t\) is '0.1'; expected a finite number"),
    "ranges are a tuple": (
        {"ranges": (0.0, 1.0)},
        r"ranges is \(0.0, 1.0\); expected a mapping, \{coordinate or rate: \(lowest, highest\)\}",
    ),
    "coordinates are a tuple": ({"coordinates": (x,)}, r"coordinates is \(x\(t\),\); expected a mapping, \{coordinate: joint name\}"),
    "range of texts": ({"ranges": {x: ("0", "1")}}, r"range of x\(t\) is \('0', '1'\); expected \(lowest, highest\)"),
    "assembly of a tuple": ({"assembly": {x: (1.0,)}}, r"assembly has x\(t\) at \(1.0,\); expected coordinates and finite numbers"),
    "energy is a matrix": ({"kinetic": sp.Matrix([m * x.diff(t) ** 2 / 2])}, r"kinetic is Matrix\(.*; expected an expression"),
    "force is a tuple": ({"generalised_forces": {x: (m * g,)}}, r"generalised force on x\(t\) is \(g\*m,\); expected an expression"),
    "range of something else": ({"ranges": {y: (0.0, 1.0)}}, r"range of y\(t\), which is neither"),
    "range upside down": ({"ranges": {x: (1.0, 0.0)}}, r"range of x\(t\) is \(1.0, 0.0\); expected \(lowest, highest\)"),
    "range of no extent": ({"ranges": {x: (1.0, 1.0)}}, r"range of x\(t\) is"),
    "range without end": ({"ranges": {x: (0.0, float("inf"))}}, "both finite"),
    "range of three": ({"ranges": {x.diff(t): (0.0, 1.0, 2.0)}}, "expected"),
    "angle that is no coordinate": ({"angles": (y,)}, r"angles has y\(t\); expected coordinates that have a range"),
    "angle without a range": ({"ranges": {}, "angles": (x,)}, r"angles has x\(t\); expected coordinates that have a range"),
}


@pytest.mark.parametrize("changes", [{}, {**MOVING_OUTWARD, "ranges": {outward: (0.5, 2.0)}}], ids=["valid", "a value as it is declared"])
def test_the_declarations_that_the_errors_vary_are_valid(changes: dict[str, Any]) -> None:
    derive(System(**declaration(**changes)))


@pytest.mark.parametrize("case", BAD_DECLARATIONS)
def test_a_contradiction_is_refused_with_its_place(case: str) -> None:
    changes, message = BAD_DECLARATIONS[case]
    with pytest.raises(ValueError, match=message):
        System(**declaration(**changes))


BAD_DERIVATIONS: dict[str, tuple[dict[str, Any], str]] = {
    "cubic kinetic energy": ({"kinetic": m * x.diff(t) ** 3}, "kinetic is not of second degree in the rates.*x_dot"),
    "cubic coupling": (
        {"coordinates": {x: "a", y: "b"}, "kinetic": m * (x.diff(t) ** 2 + x.diff(t) * y.diff(t) ** 2) / 2},
        "kinetic is not of second degree",
    ),
    "root of the rates": ({"kinetic": m * sp.sqrt(1 + x.diff(t) ** 2)}, "kinetic is not of second degree"),
    "quadratic gravity": ({"potential": m * g**2 * x}, "potential is not linear in gravity g"),
    "gravity in a root": ({"potential": m * sp.sqrt(g) * x}, "potential is not linear in gravity g"),
    "parameter named as a coordinate": (
        {"parameters": {m: (1.0, "kg"), g: (9.81, "m/s^2"), sp.Symbol("x"): (1.0, "m")}, "potential": m * g * (x + sp.Symbol("x"))},
        r"\['x'\] name both a parameter and a coordinate",
    ),
    "parameter named as a rate": (
        {"parameters": {m: (1.0, "kg"), g: (9.81, "m/s^2"), sp.Symbol("x_dot"): (1.0, "m")}, "total_mass": m + sp.Symbol("x_dot")},
        r"\['x_dot'\] name both a parameter and a coordinate",
    ),
    "time as a parameter": (
        {"parameters": {m: (1.0, "kg"), g: (9.81, "m/s^2"), sp.Symbol("t"): (1.0, "s")}, "kinetic": m * t * x.diff(t) ** 2},
        "parameter t is time itself",
    ),
}


@pytest.mark.parametrize("case", BAD_DERIVATIONS)
def test_energies_outside_the_method_are_refused(case: str) -> None:
    changes, message = BAD_DERIVATIONS[case]
    system = System(**declaration(**changes))
    with pytest.raises(ValueError, match=message):
        derive(system)


def test_rates_that_cancel_in_the_mass_matrix_are_no_error() -> None:
    """A quadratic form, written so that d2T/dv2 still shows the rates until it is simplified."""
    rate = x.diff(t)
    kinetic = m * ((rate**2 + rate) ** 2 - rate**4 - 2 * rate**3) / 2
    assert derive(System(**declaration(kinetic=kinetic))).mass_matrix == sp.Matrix([[m]])
