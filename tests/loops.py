"""Mechanisms with constraints that tests share: small enough to be checked by hand."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import sympy as sp
from sympy.physics.mechanics import dynamicsymbols

from harness.lagrange.constraint import Constraint
from harness.lagrange.system import TIME, System

crank, coupler, follower = dynamicsymbols("crank coupler follower")
x, y, yaw, spin = dynamicsymbols("x y yaw spin")
a, b, c, d, m, R, g = sp.symbols("a b c d m R g", positive=True)
CRANK_ROCKER = {a: (0.3, "m"), b: (0.8, "m"), c: (0.6, "m"), d: (0.9, "m"), m: (1.5, "kg"), g: (9.81, "m/s^2")}


def _along(angle: sp.Expr) -> sp.Matrix:
    return sp.Matrix([sp.cos(angle), sp.sin(angle)])


def four_bar(assembly: Mapping[sp.Expr, float] | None = None, more: tuple[sp.Expr, ...] = (), **changes: Any) -> System:
    """A crank rocker of three equal point masses, at the middle of its bars; ``more`` are redundant rows of the closure."""
    tip = a * _along(crank)
    middles = [tip / 2, tip + b / 2 * _along(coupler), sp.Matrix([d, 0]) + c / 2 * _along(follower)]
    gap = tip + b * _along(coupler) - sp.Matrix([d, 0]) - c * _along(follower)
    closure = Constraint(rows=(*gap, *more), determines=(coupler, follower), redundant=tuple(range(2, 2 + len(more))))
    return System(
        **{
            "coordinates": {crank: "crank", coupler: "coupler", follower: "follower"},
            "kinetic": sum(m * middle.diff(TIME).dot(middle.diff(TIME)) / 2 for middle in middles),
            "potential": sum(m * g * middle[1] for middle in middles),
            "parameters": CRANK_ROCKER,
            "total_mass": 3 * m,
            "gravity": g,
            "constraints": {"closure": closure},
            # The coupler's end above the line of the pins; below it is the other branch.
            "assembly": assembly or {coupler: 0.82, follower: 1.77},
            **changes,
        }
    )


def upright_disc(**changes: Any) -> System:
    """A disc that rolls upright on a plane: its point of contact stands still, which ties rates and no positions."""
    u, w = x.diff(TIME), y.diff(TIME)
    rolled = R * spin.diff(TIME) * _along(yaw)
    return System(
        **{
            "coordinates": {x: "x", y: "y", yaw: "yaw", spin: "spin"},
            "kinetic": m * (u**2 + w**2) / 2 + m * R**2 / 8 * yaw.diff(TIME) ** 2 + m * R**2 / 4 * spin.diff(TIME) ** 2,
            "potential": sp.S.Zero,
            "parameters": {m: (2.0, "kg"), R: (0.5, "m")},
            "total_mass": m,
            "ranges": {x: (-1.0, 1.0), y: (-1.0, 1.0)},
            "constraints": {"contact": Constraint(rows=(u - rolled[0], w - rolled[1]), determines=(x, y))},
            **changes,
        }
    )
