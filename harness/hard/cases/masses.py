"""Masses that grow or shrink along a chain by up to twelve orders of magnitude."""

from __future__ import annotations

from collections.abc import Callable

from harness.hard.cases import Changes, HardCase, Theory, Values, decades

# What MuJoCo accepts [kg m^2].
LEAST_INERTIA = 1e-15

Rule = str | Callable[[Values], float]

_SOURCE = (
    "Featherstone, An empirical study of the joint space inertia matrix, IJRR 23 (2004), section 5; "
    "Ascher, Pai, Cloutier, Forward dynamics, elimination methods, and formulation stiffness, IJRR 16 (1997)"
)
_REMEDY = (
    "solve by the articulated-body algorithm, or root the tree at the heavy end; a reduced model without the light "
    "links loses less than they weigh"
)


def bar_numbers(n: int) -> dict[str, Changes]:
    """The numbers of both models of a chain of ``n`` bars that masses m1.. and lengths L1.. decide."""

    def minus(name: str, share: float) -> Rule:
        return lambda values: -share * values[name]

    def across(i: int) -> Rule:
        return lambda values: values[f"m{i}"] * values[f"L{i}"] ** 2 / 12

    def along(i: int) -> Rule:
        return lambda values: min(LEAST_INERTIA, values[f"m{i}"] * values[f"L{i}"] ** 2 / 12)

    mjcf: dict[str, Rule] = {}
    urdf: dict[str, Rule] = {}
    for i in range(1, n + 1):
        body, link = f"body bar_{i}", f"link link_{i}/inertial"
        mjcf |= {f"{body}/inertial@mass": f"m{i}", f"{body}/inertial@pos[2]": minus(f"L{i}", 0.5)}
        mjcf |= {f"{body}/inertial@diaginertia[{axis}]": across(i) for axis in (0, 1)}
        # Never more than the two others together, which no body in space has.
        mjcf[f"{body}/inertial@diaginertia[2]"] = along(i)
        urdf |= {f"{link}/mass@value": f"m{i}", f"{link}/origin@xyz[2]": minus(f"L{i}", 0.5)}
        urdf |= {f"{link}/inertia@{moment}": across(i) for moment in ("ixx", "iyy")}
        if i > 1:
            mjcf[f"{body}@pos[2]"] = urdf[f"joint joint_{i}/origin@xyz[2]"] = minus(f"L{i - 1}", 1.0)
    return {"mjcf": mjcf, "urdf": urdf}


def _case(n: int) -> HardCase:
    def masses(ratio: float) -> Values:
        return {f"m{i + 1}": ratio ** (i / (n - 1)) for i in range(n)}

    return HardCase(
        name=f"mass_ratio_{n}",
        title=f"chain of {n} bars whose masses form a geometric progression",
        system=f"bar_chain_{n}",
        knob=("mass of the last bar over the first's", "1"),
        values=decades(-12, 12),
        parameters=masses,
        changes=bar_numbers(n),
        source=_SOURCE,
        remedy=_REMEDY,
        theory={"lagrange": Theory("unstable"), "mujoco/mjcf": Theory("unstable")} if n == 10 else {},
    )


MASS_RATIO_2, MASS_RATIO_3, MASS_RATIO_10 = (_case(n) for n in (2, 3, 10))
