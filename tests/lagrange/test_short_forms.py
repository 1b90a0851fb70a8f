"""Short forms: the same function, in fewer instructions."""

from __future__ import annotations

import flint
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from harness.lagrange import short_forms
from harness.lagrange.derivation import load_atlas
from harness.lagrange.equations import derive
from harness.lagrange.expressions import assemble
from harness.lagrange.short_forms import shortest
from harness.library import Library
from harness.programs.kernels import BallKernel

A, B, C, M, L, OMEGA = SYMBOLS = sp.symbols("a b c m l omega", real=True)

ARGUMENTS = st.tuples(*[st.integers(-2, 2)] * 3).map(lambda multiples: multiples[0] * A + multiples[1] * B + multiples[2] * C / 2)
FACTORS = st.one_of(
    st.sampled_from([M, L, OMEGA, sp.pi, sp.Rational(2, 3), sp.Integer(-1)]),
    st.builds(lambda function, argument: function(argument), st.sampled_from([sp.sin, sp.cos]), ARGUMENTS),
)
SUMS = st.recursive(
    FACTORS,
    lambda inner: st.one_of(
        st.lists(inner, min_size=2, max_size=3).map(lambda terms: sp.Add(*terms)),
        st.lists(inner, min_size=2, max_size=3).map(lambda factors: sp.Mul(*factors)),
        st.tuples(inner, st.integers(2, 3)).map(lambda pair: pair[0] ** pair[1]),
    ),
    max_leaves=6,
)


def differ(first: sp.Expr, second: sp.Expr) -> bool:
    """Whether two expressions differ at a point where no sine, cosine or symbol is a nice number."""
    program = assemble(SYMBOLS, {"first": [first], "second": [second]})
    point = [flint.arb(value) for value in (0.7123, -1.9871, 2.3391, 1.31, 0.773, -3.17)]
    with flint.ctx.workprec(2000):
        values = BallKernel(program, 0).bind([])(*point)
        return not (values[0] - values[1]).contains(0)


@pytest.mark.ci
@settings(max_examples=15)
@given(st.lists(SUMS, min_size=1, max_size=3))
def test_a_short_form_is_the_same_function_and_never_longer(expressions: list[sp.Expr]) -> None:
    short = shortest(expressions)
    assert not [pair for pair in zip(expressions, short, strict=True) if differ(*pair)]
    before, after = (assemble(SYMBOLS, {"all": written}) for written in (expressions, short))
    # A subexpression that two of them share may stand in one alone afterwards.
    assert len(after.instructions) <= len(before.instructions) + len(expressions) - 1


@pytest.mark.parametrize(
    ("written", "expected"),
    [
        (M * L**2 * sp.sin(A) ** 2 + M * L**2 * sp.cos(A) ** 2, M * L**2),
        (sp.cos(A) * sp.cos(B) - sp.sin(A) * sp.sin(B), sp.cos(A + B)),
        (sp.sin(A) ** 2 * sp.cos(B) ** 2 + sp.cos(A) ** 2 * sp.cos(B) ** 2 + sp.sin(B) ** 2, sp.S.One),
        (M * (L**2 - 2 * L * OMEGA + OMEGA**2), M * (L - OMEGA) ** 2),
        ((M + 1) * sp.cos(A / 2) ** 2 - (M + 1) * sp.sin(A / 2) ** 2, (M + 1) * sp.cos(A)),
        (sp.sqrt(sp.sin(A) ** 2 + sp.cos(A) ** 2 + L**2), sp.sqrt(1 + L**2)),
    ],
)
def test_what_a_textbook_would_write_is_found(written: sp.Expr, expected: sp.Expr) -> None:
    assert sp.simplify(shortest([written])[0] - expected) == 0
    assert len(assemble(SYMBOLS, {"all": shortest([written])}).instructions) <= len(assemble(SYMBOLS, {"all": [expected]}).instructions)


def test_a_wrong_identity_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    right = short_forms._harmonics
    monkeypatch.setattr(short_forms, "_harmonics", lambda powers: {harmonic: -share for harmonic, share in right(powers).items()})
    written = M * sp.cos(A) * sp.cos(B) - M * sp.sin(A) * sp.sin(B)
    assert differ(written, shortest([written])[0])


def test_a_long_product_is_left_as_it_is() -> None:
    written = (A + B + C + M + L + OMEGA + 1) ** 40
    assert shortest([written]) == [written]


@pytest.mark.ci
@pytest.mark.parametrize("name", ["furuta_pendulum", "tora"])
def test_equations_are_as_short_as_sympy_makes_them(name: str) -> None:
    (system, *_), _ = load_atlas(Library.built_in().system_path(name))
    equations = derive(system)
    entries = [entry for name in ("mass_matrix", "velocity_terms", "gravity_terms") for entry in getattr(equations, name)]
    symbols = sorted(sp.Matrix(entries).free_symbols, key=str)
    short, of_sympy = (assemble(symbols, {"all": forms}) for forms in (shortest(entries), [sp.simplify(entry) for entry in entries]))
    assert len(short.instructions) <= len(of_sympy.instructions)
