"""The woodpecker toy against its text: the linear equations of motion and contact, and Newton and Euler at finite angles.

Source: Glocker, Dynamik von Starrkoerpersystemen mit Reibung und Stoessen, dissertation, TU Muenchen (1995), pages 162 ff.
"""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import sympy as sp
from scipy.optimize import brentq

from harness.arrays import Array
from harness.hard.rigid_case import Numbers
from harness.hard.touching import rigid_contacts
from harness.lagrange.derivation import load_mechanism, load_system
from harness.lagrange.equations import EquationsOfMotion, derive
from harness.lagrange.system import TIME, System
from harness.library import Library
from harness.truth.coulomb import Manner

# Coordinates of the text: the height of the sleeve's centre, and the angles of sleeve and bird, whose rates are called as these.
y, of_sleeve, of_bird = TEXT = sp.symbols("y phi_M phi_S", real=True)
RATES = sp.symbols("y_dot phi_M_dot phi_S_dot", real=True)


@pytest.fixture(scope="module")
def system() -> System:
    return load_system(Library.built_in().system_path("woodpecker"))[0]


@pytest.fixture(scope="module")
def equations(system: System) -> EquationsOfMotion:
    return derive(system)


@pytest.fixture(scope="module")
def s(system: System) -> SimpleNamespace:
    return SimpleNamespace(**{symbol.name: symbol for symbol in system.parameters})


def of_the_text(s: SimpleNamespace) -> sp.Matrix:
    """The harness's coordinates by those of the text, for small angles."""
    return sp.Matrix([y + s.l_M * of_sleeve, of_bird, of_sleeve - of_bird])


def first_order(expression: Any, symbols: Any) -> Any:
    """Up to first order in all symbols."""
    at_zero = dict.fromkeys(symbols, 0)
    return expression.subs(at_zero) + sum(expression.diff(one).subs(at_zero) * one for one in symbols)


def test_small_motions_are_those_of_the_text(equations: EquationsOfMotion, s: SimpleNamespace) -> None:
    turned = of_the_text(s)
    jacobian = turned.jacobian(TEXT)
    at_rest = {**dict.fromkeys(equations.coordinates, 0), **dict.fromkeys(equations.rates, 0)}
    mass = jacobian.T * equations.mass_matrix.subs(at_rest) * jacobian
    total = s.m_M + s.m_S
    expected = sp.Matrix(
        [
            [total, s.m_S * s.l_M, s.m_S * s.l_G],
            [s.m_S * s.l_M, s.J_M + s.m_S * s.l_M**2, s.m_S * s.l_M * s.l_G],
            [s.m_S * s.l_G, s.m_S * s.l_M * s.l_G, s.J_S + s.m_S * s.l_G**2],
        ]
    )
    assert sp.simplify(mass - expected) == sp.zeros(3)

    still = equations.right_hand_side.subs(dict.fromkeys(equations.rates, 0))
    linear = sp.Matrix([first_order(one, equations.coordinates) for one in still])
    force = jacobian.T * linear.subs(dict(zip(equations.coordinates, turned, strict=True)), simultaneous=True)
    applied = force.subs({one: 0 for one in force.free_symbols if one.name.startswith("tau")})
    torque = s.c_phi * (of_sleeve - of_bird)
    assert sp.simplify(applied - sp.Matrix([-total * s.g, -torque - s.m_S * s.g * s.l_M, torque - s.m_S * s.g * s.l_G])) == sp.zeros(3, 1)


def test_small_motions_touch_as_in_the_text(system: System, s: SimpleNamespace) -> None:
    """Gaps and slips, which the balls at the edges leave as they are."""
    turned = of_the_text(s)
    own = dict(zip(system.coordinates, turned, strict=True))
    turning = turned.jacobian(TEXT) * sp.Matrix(RATES)
    own_rates = {one.diff(TIME): rate for one, rate in zip(system.coordinates, turning, strict=True)}
    expected = {
        "beak": (s.l_M + s.l_G - s.l_S - s.r_0 - s.h_S * of_bird, (1, s.l_M, s.l_G - s.l_S)),
        "lower edge": (s.r_M - s.r_0 + s.h_M * of_sleeve, (1, s.r_M, 0)),
        "upper edge": (s.r_M - s.r_0 - s.h_M * of_sleeve, (1, s.r_M, 0)),
    }
    assert set(system.contacts) == set(expected)
    for name, (gap, row) in expected.items():
        contact = system.contacts[name]
        found = first_order(contact.gap, system.coordinates).subs(own, simultaneous=True)
        assert sp.simplify(found - gap) == 0
        [slip] = contact.slips
        found = slip.subs(own_rates, simultaneous=True).subs(dict.fromkeys(system.coordinates, 0))
        assert sp.simplify(found - sum(one * rate for one, rate in zip(row, RATES, strict=True))) == 0


def test_coordinates_of_the_joint_nearly_repeat_nothing(equations: EquationsOfMotion, system: System, s: SimpleNamespace) -> None:
    """The condition number of the scaled mass matrix, which in the text's coordinates is nine times that."""
    values = {symbol: value for symbol, (value, _) in system.parameters.items()}
    own = np.array(equations.mass_matrix.subs(dict.fromkeys(equations.coordinates, 0)).subs(values), dtype=float)
    to_text = np.array(of_the_text(s).jacobian(TEXT).subs(values), dtype=float)
    numbers = []
    for mass in (own, to_text.T @ own @ to_text):
        scale = 1 / np.sqrt(np.diag(mass))
        numbers.append(np.linalg.cond(mass * np.outer(scale, scale)))
    assert numbers[0] < 10 < 70 < numbers[1]


def slid(own: Numbers, q: Sequence[float], v: Sequence[float], ball: tuple[str, float, float], up: float) -> tuple[Array, float]:
    """Accelerations of the coordinates, and the normal force, where one ball slides on the pole with friction upward (1) or downward (-1).

    Both bodies are cut free. Unknown are the accelerations of the height and of both angles, the horizontal forces of the pin on bird and
    sleeve, the vertical one on the bird, whose opposite is on the sleeve, and the normal force. ``ball``: the body and where its
    centre is.
    """
    p = SimpleNamespace(**own)
    (_, phi, chi), (_, turn, relative_turn) = q, v
    touching, along, above = ball
    rows, sides = np.zeros((7, 7)), np.zeros(7)
    bodies = (("bird", p.m_S, p.J_S, p.l_G, phi, turn, 1.0), ("sleeve", p.m_M, p.J_M, -p.l_M, phi + chi, turn + relative_turn, -1.0))
    for number, (name, mass, inertia, offset, angle, rate, sign) in enumerate(bodies):
        cosine, sine = np.cos(angle), np.sin(angle)
        # The pin is at (-c, -d) from the centre of mass.
        c, d = offset * cosine, offset * sine
        across, upward, moment = rows[3 * number : 3 * number + 3]
        across[1 + number], across[3 + number] = -mass * d, -1.0
        upward[0], upward[1 + number], upward[5] = mass, mass * c, -sign
        moment[1 + number], moment[3 + number], moment[5] = inertia, -d, sign * c
        sides[3 * number : 3 * number + 3] = mass * c * rate**2, mass * d * rate**2 - mass * p.g, sign * p.c_phi * chi
        if name == touching:
            x, height = along * cosine - above * sine, along * sine + above * cosine
            across[6], upward[6] = -1.0, -up * p.mu
            moment[6] = -((x - p.r - c) * up * p.mu - (height - d))
            # Its centre keeps the distance from the pole.
            rows[6, 1 + number], sides[6] = -height, x * rate**2
    height_rate, of_bird, of_sleeve, *_, normal = np.linalg.solve(rows, sides)
    return np.array([height_rate, of_bird, of_sleeve - of_bird]), float(normal)


@pytest.mark.parametrize("up", [1.0, -1.0])
@pytest.mark.parametrize(
    ("name", "between", "other"), [("lower edge", (-0.3, 0.0), -0.4), ("upper edge", (0.0, 0.3), 0.5), ("beak", (0.0, 0.3), 0.6)]
)
def test_accelerations_are_those_of_bodies_cut_free(name: str, between: tuple[float, float], other: float, up: float) -> None:
    """At finite angles, while the body that does not touch has another one and turns."""
    mechanism = load_mechanism(Library.built_in(), "woodpecker")
    own = {name: value for name, value, _ in mechanism.parameters}
    contacts = rigid_contacts(load_system(Library.built_in().system_path("woodpecker"))[0], mechanism)
    edge, is_beak = own["r_M"] - own["l_M"] + own["r"], name == "beak"
    along, above = {
        "beak": (own["l_G"] - own["l_S"] + own["r"], own["h_S"]),
        "lower edge": (edge, -own["h_M"]),
        "upper edge": (edge, own["h_M"]),
    }[name]
    touching = brentq(
        lambda angle: own["l_M"] + along * np.cos(angle) - above * np.sin(angle) - own["r_0"] - own["r"], *between, xtol=1e-16
    )
    bird, sleeve = (touching, other) if is_beak else (other, touching)
    q, v = [0.3, bird, sleeve - bird], [-up, 0.0, 4.0] if is_beak else [-up, 4.0, -4.0]
    assert contacts.gaps(q)[name] == pytest.approx(0.0, abs=1e-15)
    expected, normal = slid(own, q, v, ("bird" if is_beak else "sleeve", along, above), up)
    [found] = [one for one in contacts.answers(q, v, [name]) if one.manners[name] in (Manner.SLIDES, Manner.SLIDES_BACK)]
    assert normal > 0 and found.normal[name] == pytest.approx(normal, rel=1e-9)
    assert found.accelerations == pytest.approx(expected, rel=1e-9)
