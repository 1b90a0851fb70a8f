"""Equations derived in coordinates measured from the world are those derived in the positions of the joints."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import flint
import numpy as np
import pytest
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness.lagrange.assembly import energy_program_of, program_of
from harness.lagrange.equations import derive
from harness.lagrange.system import TIME, System
from harness.programs.kernels import BallKernel, Float64Kernel
from harness.programs.program import StraightLineProgram

A, B, C, D = COORDINATES = dynamicsymbols("a b c d")
m, g, k, damping = sp.symbols("m g k mu", positive=True)


def branched(**changes: Any) -> System:
    """Masses on bars in absolute angles; b and c turn against a, and d against c. With a driven pin, springs and dampers."""
    rates = [q.diff(TIME) for q in COORDINATES]
    tip = {A: [A], B: [A, B], C: [A, C], D: [A, C, D]}
    kinetic, height = sp.S.Zero, sp.S.Zero
    for links in tip.values():
        x, z = sum(map(sp.sin, links)) + sp.sin(TIME) / 3, -sum(map(sp.cos, links))
        kinetic += m * (x.diff(TIME) ** 2 + z.diff(TIME) ** 2) / 2
        height += z
    declaration = {
        "coordinates": dict(zip(COORDINATES, ("root", "left", "right", "tip"), strict=True)),
        "measured_from": {B: A, C: A, D: C},
        "kinetic": kinetic,
        "potential": m * g * height + k * (B - D) ** 2 / 2,
        "generalised_forces": {B: -damping * rates[1], D: -damping * (rates[3] - rates[2]), C: damping * (rates[3] - rates[2])},
        "parameters": {m: (1.5, "kg"), g: (9.81, "m/s^2"), k: (3.0, "N m"), damping: (0.25, "N m s")},
        "total_mass": 4 * m,
        "gravity": g,
    }
    return System(**(declaration | changes))


PROGRAMS: dict[str, Callable[..., StraightLineProgram]] = {"equations": program_of, "energies": energy_program_of}


def values_of(program: StraightLineProgram, inputs: list[float]) -> list[flint.arb]:
    with flint.ctx.workprec(200):
        return list(BallKernel(program, 4).bind(inputs[-4:])(*inputs[:-4]))


@pytest.mark.parametrize("kind", PROGRAMS)
def test_both_derivations_agree(kind: str) -> None:
    system = branched()
    relative = system.in_joint_positions()
    assert not relative.measured_from
    programs = [PROGRAMS[kind](described, derive(described)) for described in (system, relative)]
    for inputs in np.random.default_rng(0).uniform(0.5, 2.0, (5, len(programs[0].inputs))).tolist():
        for found, expected in zip(*(values_of(program, inputs) for program in programs), strict=True):
            assert found.overlaps(expected) and float(found.rad()) < 1e-40


def test_many_degrees_of_freedom_are_solved_as_few_are(monkeypatch: pytest.MonkeyPatch) -> None:
    kernel = Float64Kernel(program_of(branched(), derive(branched())))
    inputs = np.random.default_rng(2).uniform(0.5, 2.0, (len(kernel.program.inputs), 7))
    unrolled = kernel.accelerations(inputs)
    monkeypatch.setattr("harness.programs.kernels.MOST_UNROLLED", 0)
    assert np.abs(kernel.accelerations(inputs) - unrolled).max() <= 1e-13 * np.abs(unrolled).max()


@pytest.mark.parametrize("measured_from", [{A: B}, {B: sp.Symbol("z")}, {sp.Symbol("z"): A}, {B: B}])
def test_a_contradiction_is_refused(measured_from: Any) -> None:
    with pytest.raises(ValueError, match="an earlier one"):
        branched(measured_from=measured_from)
