"""Equations of motion of any ``System`` by Euler-Lagrange with generalised forces, and as people write them: text and MathML.

With L = T - V and applied forces tau, d/dt(dL/dv) - dL/dq = Q + tau is collected as

    M(q) qdd + c(q, v) + g(q) = p(q, v) + tau

M is the mass matrix, c the velocity terms, g the gravity terms, p the passive forces of springs and
dampers. Rates are replaced by plain symbols before any differentiation and nothing is expanded, which
keeps the derivation of a long arm in seconds.

Source: Goldstein, Poole, Safko, Classical Mechanics, 3rd ed., equations 1.57 and 2.53; chapter 6.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import sympy as sp
from sympy.printing.mathml import mathml

from harness.lagrange.expressions import SymbolicDerivatives
from harness.lagrange.short_forms import shortest
from harness.lagrange.system import TIME, System
from harness.programs.program import right_hand_side

_ACCENTS = {"dot": ("'", "\u02d9"), "ddot": ("''", "\u00a8")}
# Operations of an expression whose brackets are multiplied out.
_MOST_EXPANDED = 2000
_ACCENTED = re.compile(r"\\(d?dot)\{(\w+)\}")
_ACCENTED_MATHML = re.compile(r"<mi>\\(d?dot)\{(\w+)\}</mi>")


@dataclass(frozen=True, kw_only=True)
class EnergiesInSymbols:
    """The energies of a system over plain symbols.

    Attributes:
        coordinates, rates: symbols of q and v (nv each).
        kinetic, potential: T and V [J].
        generalised_forces: Q, (nv, 1), the non-conservative part of the passive forces.
        constraint_rows: the name of its constraint and the expression that stays zero, of each row that is not redundant.
    """

    coordinates: tuple[sp.Symbol, ...]
    rates: tuple[sp.Symbol, ...]
    kinetic: sp.Expr
    potential: sp.Expr
    generalised_forces: sp.Matrix
    constraint_rows: tuple[tuple[str, sp.Expr], ...] = ()

    @property
    def constraint_jacobian(self) -> sp.Matrix:
        """J, (rows, nv), by which the rates change what stays zero, or, of a row of rates, the row itself."""
        rows = [row for _, row in self.constraint_rows]
        by = [self.rates if row.has(*self.rates) else self.coordinates for row in rows]
        return sp.Matrix(len(rows), len(self.rates), lambda i, j: rows[i].diff(by[i][j]))


@dataclass(frozen=True, kw_only=True)
class EquationsOfMotion(EnergiesInSymbols):
    """SymPy equations M qdd + c + g = p + tau over plain symbols, beside the energies they come from.

    Under constraints they are those of the tree, to which -J' lambda is added on the right.

    Attributes:
        mass_matrix: M, (nv, nv), symmetric.
        velocity_terms: c, (nv, 1): every term of d/dt(dT/dv) - dT/dq that holds no acceleration.
        gravity_terms: g, (nv, 1): dV/dq of the potential that is proportional to gravity.
        passive_forces: p, (nv, 1): -dV/dq of the rest of the potential, plus Q.
    """

    mass_matrix: sp.Matrix
    velocity_terms: sp.Matrix
    gravity_terms: sp.Matrix
    passive_forces: sp.Matrix

    @property
    def right_hand_side(self) -> sp.Matrix:
        """p - c - g, (nv, 1): what M qdd equals when no force is applied."""
        return sp.Matrix(right_hand_side({"passive": self.passive_forces, "velocity": self.velocity_terms, "gravity": self.gravity_terms}))

    def christoffel_matrix(self) -> sp.Matrix:
        """C(q, v), (nv, nv), from Christoffel symbols of the first kind: M' - 2C is skew.

        Source: Spong, Hutchinson, Vidyasagar, Robot Modeling and Control, section 7.3.
        """
        q, v, mass = self.coordinates, self.rates, self.mass_matrix
        n = len(q)

        def symbol(i: int, j: int, k: int) -> sp.Expr:
            return (mass[k, j].diff(q[i]) + mass[k, i].diff(q[j]) - mass[i, j].diff(q[k])) / 2

        return sp.Matrix(n, n, lambda k, j: sum(symbol(i, j, k) * v[i] for i in range(n)))

    def simplified(self) -> EquationsOfMotion:
        """The same equations with every entry in a short form, which has fewer roundings in float64."""
        names = ("mass_matrix", "velocity_terms", "gravity_terms", "passive_forces")
        # A mass matrix is symmetric: most of its entries stand there twice.
        entries = list(dict.fromkeys(entry for name in names for entry in getattr(self, name)))
        short = dict(zip(entries, shortest(entries), strict=True))
        return replace(self, **{name: getattr(self, name).applyfunc(short.__getitem__) for name in names})


def in_symbols(system: System) -> EnergiesInSymbols:
    """The energies and forces of ``system``, its coordinates and rates replaced by plain symbols.

    Raises:
        ValueError: a name stands for two things.
    """
    q = tuple(sp.Symbol(f.func.__name__, real=True) for f in system.coordinates)
    v = tuple(sp.Symbol(f"{f.func.__name__}_dot", real=True) for f in system.coordinates)
    if TIME in system.parameters:
        raise ValueError(f"parameter {TIME} is time itself; give it another name")
    taken = {symbol.name for symbol in system.parameters} & {symbol.name for symbol in (*q, *v)}
    if taken:
        raise ValueError(f"{sorted(taken)} name both a parameter and a coordinate or its rate; rename one")
    plain = dict(zip(system.rates, v, strict=True))
    position = dict(zip(system.coordinates, q, strict=True))
    expressions = (system.kinetic, system.potential, *(system.generalised_forces.get(f, sp.S.Zero) for f in system.coordinates))
    kinetic, potential, *forces = (expression.xreplace(plain).xreplace(position) for expression in expressions)
    rows = [
        (name, row.xreplace(plain).xreplace(position))
        for name, constraint in system.constraints.items()
        for number, row in enumerate(constraint.rows)
        if number not in constraint.redundant
    ]
    return EnergiesInSymbols(
        coordinates=q, rates=v, kinetic=kinetic, potential=potential, generalised_forces=sp.Matrix(forces), constraint_rows=tuple(rows)
    )


def derive(system: System) -> EquationsOfMotion:
    """The equations of motion of ``system``.

    Raises:
        ValueError: T is of higher than second degree in the rates, so that M would depend on v, or V
            is not linear in gravity.
    """
    energies = in_symbols(system)
    q, v = energies.coordinates, energies.rates
    by_state = SymbolicDerivatives.by((*q, *v))
    # d/dt p(q, v, t) = M qdd + (dp/dq) v + dp/dt
    at_constant_rates = SymbolicDerivatives({TIME: {TIME: sp.S.One}} | {x: {TIME: rate} for x, rate in zip(q, v, strict=True)})
    of_kinetic = by_state.of(energies.kinetic)
    momenta = [of_kinetic.get(rate, sp.S.Zero) for rate in v]
    mass = _mass_matrix(momenta, v, by_state)
    velocity = sp.Matrix(
        [
            at_constant_rates.of(momentum).get(TIME, sp.S.Zero) - of_kinetic.get(coordinate, sp.S.Zero)
            for momentum, coordinate in zip(momenta, q, strict=True)
        ]
    )
    of_gravity, of_springs = split_potential(energies.potential, system.gravity)
    gravity, springs = (sp.Matrix([by_state.of(part).get(x, sp.S.Zero) for x in q]) for part in (of_gravity, of_springs))
    return EquationsOfMotion(
        **vars(energies),
        mass_matrix=mass,
        velocity_terms=velocity,
        gravity_terms=gravity,
        passive_forces=energies.generalised_forces - springs,
    )


def _mass_matrix(momenta: Sequence[sp.Expr], rates: tuple[sp.Symbol, ...], by_state: SymbolicDerivatives) -> sp.Matrix:
    n = len(rates)
    mass = sp.zeros(n, n)
    # A rate left over cancels identically; removing it keeps M a function of q alone.
    at_rest = dict.fromkeys(rates, sp.S.Zero)
    for i in range(n):
        of_momentum = by_state.of(momenta[i])
        for j in range(i, n):
            entry = of_momentum.get(rates[j], sp.S.Zero)
            left_over = [(rate, slope) for rate, slope in by_state.of(entry).items() if rate in at_rest]
            for rate, slope in left_over:
                if sp.simplify(slope) != 0:
                    raise ValueError(f"kinetic is not of second degree in the rates: d2T/dv{i}dv{j} depends on {rate}")
            mass[i, j] = mass[j, i] = entry.subs(at_rest) if left_over else entry
    return mass


def split_potential(potential: sp.Expr, gravity: sp.Symbol | None) -> tuple[sp.Expr, sp.Expr]:
    """V as the part that is proportional to gravity and the rest.

    Raises:
        ValueError: V is not linear in gravity.
    """
    if gravity is None:
        return sp.S.Zero, potential
    slope = potential.diff(gravity)
    if slope.has(gravity) and sp.simplify(slope.diff(gravity)) != 0:
        raise ValueError(f"potential is not linear in gravity {gravity}")
    return slope.subs(gravity, 0) * gravity, potential.subs(gravity, 0)


def printed(equations: EquationsOfMotion) -> tuple[str, str]:
    """The equations as plain text, a line each, and as one ``<math>`` element each.

    ``q'`` is a rate and ``q''`` an acceleration; inertia comes first, the applied force tau stands on the
    right. Behind them stand the rows that constraints keep at zero, each with its multiplier lambda in the others.
    """
    written = list(rows(equations))
    text = "\n".join(f"{sp.sstr(row.lhs, order='none')} = {sp.sstr(row.rhs)}" for row in written)
    blocks = (_accented(mathml(row, printer="presentation")) for row in written)
    elements = (f'<math xmlns="http://www.w3.org/1998/Math/MathML" display="block">{block}</math>' for block in blocks)
    return _ACCENTED.sub(lambda match: match[2] + _ACCENTS[match[1]][0], text), "\n".join(elements)


def latex(equations: EquationsOfMotion) -> str:
    """The equations as one ``aligned`` block of LaTeX, a line each; terms stand in the order of ``printed``."""
    names = [q.name for q in equations.coordinates]
    written = {sp.Symbol(rf"\{accent}{{{name}}}"): _under_accent(accent, name) for name in names for accent in _ACCENTS}
    written |= {sp.Symbol(f"tau_{name}"): rf"\tau_{{{sp.latex(sp.Symbol(name))}}}" for name in names}
    sides = ((sp.latex(side, symbol_names=written, order="none") for side in row.args) for row in rows(equations))
    return "\\begin{aligned}\n" + " \\\\\n".join(" &= ".join(pair) for pair in sides) + "\n\\end{aligned}"


def _under_accent(accent: str, name: str) -> str:
    """The letter of a name under an accent, and its index behind."""
    letter, sign, index = sp.latex(sp.Symbol(name)).partition("_")
    return rf"\{accent}{{{letter}}}{sign}{index}"


def rows(equations: EquationsOfMotion) -> Iterator[sp.Eq]:
    """The equations as SymPy equalities, one per coordinate: inertia and the rest on the left, the applied force on the right.

    Then one per row of a constraint that is not redundant.
    """
    names = [q.name for q in equations.coordinates]
    dotted = dict(zip(equations.rates, (sp.Symbol(rf"\dot{{{name}}}") for name in names), strict=True))
    accelerations = [sp.Symbol(rf"\ddot{{{name}}}") for name in names]
    owners = [owner for owner, _ in equations.constraint_rows]
    multipliers = [sp.Symbol(f"lambda_{owner}_{owners[:place].count(owner) + 1}") for place, owner in enumerate(owners)]
    jacobian = equations.constraint_jacobian
    for i, name in enumerate(names):
        inertia = [equations.mass_matrix[i, j] * acceleration for j, acceleration in enumerate(accelerations)]
        rest = sp.Add.make_args(_in_terms(-equations.right_hand_side[i]).xreplace(dotted))
        held = [jacobian[row, i].xreplace(dotted) * multiplier for row, multiplier in enumerate(multipliers)]
        terms = [term for term in (*inertia, *rest, *held) if term != 0]
        yield sp.Eq(sp.Add(*terms, evaluate=False), sp.Symbol(f"tau_{name}"), evaluate=False)
    for _, row in equations.constraint_rows:
        yield sp.Eq(row.xreplace(dotted), sp.S.Zero, evaluate=False)


def _in_terms(expression: sp.Expr) -> sp.Expr:
    """An expression without brackets; one so long that it would only grow by that stays as it is."""
    return sp.expand(expression) if expression.count_ops() <= _MOST_EXPANDED else expression


def _accented(text: str) -> str:
    def replace(match: re.Match[str]) -> str:
        base = mathml(sp.Symbol(match[2]), printer="presentation")
        return f"<mover>{base}<mo>{_ACCENTS[match[1]][1]}</mo></mover>"

    return _ACCENTED_MATHML.sub(replace, text)
