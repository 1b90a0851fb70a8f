"""Closed loops: towards configurations where rows become dependent, long chains of loops, masses across a loop, and softness.

States are closed at each point's own parameters. MuJoCo is held against what the file declares, the others against rigid truth.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from harness.engines.adapters.pinocchio.solver import Solver
from harness.hard.cases import STATES, HardCase, Theory, anywhere, at_each_seed, decades, of_sizes, posed, shares, with_columns
from harness.hard.cases.long_chains import bar_inertias
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.states import States

if TYPE_CHECKING:
    from harness.engines.adapters.pinocchio.model import PinocchioModel

_HIGHAM = "Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed., sections 7.1 and 10.1"
_HUNT = "Hunt, Kinematic Geometry of Mechanisms, section 2.1; Bayo, Avello, Nonlinear Dynamics 5 (1994), on chains of four-bars"
_PROXIMAL = "Carpentier, Budhiraja, Mansard, Proximal and sparse resolution of constrained dynamic equations, RSS 2021"
_SOLVER = "MuJoCo documentation, Computation, sections Constraint model and Solver parameters"
_PINOCCHIO = ("pinocchio/urdf",)
# Of rigid constraints, as J M^-1 J' has a least eigenvalue of the angle's square and forces grow as one over the angle. Pinocchio's mu is
# then no longer small. MuJoCo's problem stays regular.
_IN_LINE = {"lagrange": Theory(digits_growth=-1.0), "pinocchio/urdf": Theory("disagrees", digits_growth=-1.0)}

_MUJOCO = ("mujoco/mjcf",)

_SLIDE_RATE = 0.5


def _driven_by_slide(mechanism: Mechanism, value: float, seed: int) -> States:
    """The crank an angle away from where the slide turns back, at rates with which the slide passes through there."""
    states = anywhere(mechanism)
    # Near there the slide moves as the angle times the rate.
    spread = shares(STATES)
    return States.at(with_columns(states.q, {0: value}), with_columns(states.v, {0: _SLIDE_RATE * spread / value}), states.tau)


_ACROSS, _ALONG = bar_inertias("m_c", "c")

_BODY, _LINK = "body follower/inertial", "link follower/inertial"


def _opened(states: States, distance: float) -> States:
    """The follower turned so far that its end has left the coupler's, by about the distance [m]."""
    return States.at(with_columns(states.q, {2: states.q[:, 2] + distance * shares(STATES, low=0.5) / 1.3}), states.v, states.tau)


def _solved(solver: Solver, model: PinocchioModel, mu: float) -> PinocchioModel:
    return model.solved_by(replace(solver, mu=mu))


# Beyond some thirty bodies the bounds of double-double no longer suffice, and a state takes a quarter of a second in balls.
SIZES = (2, 3, 4, 5, 6, 7, 8, 10, 12, 24)

CASES = (
    HardCase(
        name="dead_point",
        title="slider-crank driven by its slide, towards the dead point",
        system="slider_crank",
        knob=("angle of the crank from the slide's line", "rad"),
        values=decades(-8, 0),
        states=_driven_by_slide,
        source="Norton, Design of Machinery, 5th ed., section 3.3 (toggle positions); rates grow as 1/angle, and J keeps its rank: the "
        "dead point is one of the slide as a coordinate, not of the constraint",
        remedy="take the crank's angle for the independent coordinate; accelerations are safe",
    ),
    HardCase(
        name="grashof_limit",
        title="four-bar whose shortest and longest bar are as long as the others, towards all bars in line",
        system="four_bar",
        knob=("angle of the crank from the line", "rad"),
        values=decades(-7, -0.5),
        parameters=lambda angle: {"d": 2.2},
        changes={"mjcf": {"body follower@pos[0]": "d"}, "urdf": {"joint follower/origin@xyz[0]": "d"}},
        states=posed(lambda angle: {0: math.pi - angle}),
        theory=_IN_LINE,
        source="Norton, Design of Machinery, 5th ed., section 2.12 (change points); there the rows of J depend on one another, "
        "and J M^-1 J' has a least eigenvalue of the angle's square",
        remedy="keep bars of Grashof's limit out of a mechanism that passes the line, or add the bar that decides the way",
    ),
    *(
        HardCase(
            name=name,
            title=f"{title}, towards all bars in line",
            system=system,
            knob=(f"angle of the cranks from the {coupler}", "rad"),
            values=decades(-7, -0.5),
            states=posed(lambda angle: {0: angle}),
            theory=_IN_LINE,
            source=_HUNT,
            remedy="add a crank at an angle to the others, as locomotives have",
        )
        for name, title, system, coupler in (
            ("parallelogram_in_line", "parallelogram of three cranks", "parallelogram", "coupler"),
            ("four_bars_in_line", "two four-bars side by side (A02)", "four_bar_chain_2", "couplers"),
        )
    ),
    *(
        HardCase(
            name=f"loop_{weight}_follower",
            title=f"four-bar whose follower is up to nine orders of magnitude {heavier} than its crank",
            system="four_bar",
            knob=("mass of the follower over the crank's", "1"),
            values=values,
            parameters=lambda ratio: {"m_c": 0.5 * ratio},
            changes={
                "mjcf": {f"{_BODY}@mass": "m_c"} | {f"{_BODY}@diaginertia[{i}]": rule for i, rule in enumerate((_ALONG, _ACROSS, _ACROSS))},
                "urdf": {f"{_LINK}/mass@value": "m_c"} | {f"{_LINK}/inertia@{moment}": _ACROSS for moment in ("iyy", "izz")},
            },
            theory=theory,
            source=f"{_HIGHAM}; {source}",
            remedy=remedy,
        )
        for weight, heavier, values, source, remedy, theory in (
            (
                "light",
                "lighter",
                decades(-9, 0),
                "a light bar's mobility 1/m is one eigenvalue of J M^-1 J', whose rounding, u/m, hides what the heavy bars add to it",
                "solve the reduced equations, of independent coordinates alone, or give the bar the inertia that it has",
                dict.fromkeys(("lagrange", "pinocchio/urdf"), Theory("unstable", growth=-0.5, digits_growth=-1.0)),
            ),
            (
                "heavy",
                "heavier",
                decades(0, 9),
                "the heavy bar's mobility is nothing beside the light ones', which stay exact",
                "accelerations are safe",
                {},
            ),
        )
    ),
    HardCase(
        name="loop_impedance",
        title="four-bar whose loop MuJoCo closes ever more stiffly",
        system="four_bar",
        knob=("one minus impedance", "1"),
        values=decades(-4, -0.1),
        attributes={"mjcf": lambda gap: {"equality/connect": {"solimp": f"{1 - gap!r} {1 - gap!r}"}}},
        subjects=_MUJOCO,
        theory=dict.fromkeys(_MUJOCO, Theory("disagrees", growth=-1.0, digits_growth=-1.0)),
        source=_SOLVER + "; Newton's matrix M + J' D J has D = d / ((1 - d) A), whose condition number grows as 1/(1 - d)",
        remedy='set <option tolerance="0"/>, with which Newton\'s method takes the second step that refines the first',
    ),
    HardCase(
        name="unequal_impedance",
        title="parallelogram whose redundant pin MuJoCo holds ever less stiffly than the other",
        system="parallelogram",
        knob=("impedance of the middle pin", "1"),
        values=decades(-4, -0.0005),
        attributes={"mjcf": lambda impedance: {"equality/connect[@name='middle_pin']": {"solimp": f"{impedance!r} {impedance!r}"}}},
        subjects=_MUJOCO,
        source=_SOLVER + "; redundant rows share their force by their impedances, and the sum of both is regular",
        remedy="accelerations are safe; reactions of redundant rows are those of the softness, not of the mechanism",
    ),
    HardCase(
        name="loop_drift",
        title="four-bar whose loop has drifted open",
        system="four_bar",
        knob=("distance of the bars' ends", "m"),
        values=decades(-9, -1),
        opened=_opened,
        subjects=_MUJOCO,
        source=_SOLVER + "; the impedance follows the distance up to the width of solimp, and the pull back is linear in it",
        remedy="accelerations are those of the declared softness; rigid ones do not exist off the manifold",
    ),
    *(
        HardCase(
            name=name,
            title=f"four-bar by Pinocchio's {title}",
            system="four_bar",
            knob=("proximal parameter mu", "1"),
            values=decades(-14, -1),
            configured=partial(_solved, solver),
            subjects=_PINOCCHIO,
            theory=dict.fromkeys(_PINOCCHIO, Theory() if growth is None else Theory("disagrees", growth=growth, digits_growth=growth)),
            source=source,
            remedy=remedy,
        )
        for name, title, solver, growth, source, remedy in (
            (
                "proximal_limit",
                "constraintDynamics, iterated to its end",
                Solver(iterations=100),
                None,
                f"{_PROXIMAL}; the limit of the iterations does not depend on mu",
                "any mu above 0 with accuracy 0 and 100 iterations",
            ),
            (
                "proximal_once",
                "constraintDynamics with one iteration",
                Solver(iterations=1),
                1.0,
                f"{_PROXIMAL}; one iteration leaves an error in proportion to mu",
                "give ProximalSettings more iterations; the default is one",
            ),
            (
                "lcaba_mu",
                "lcaba, twenty iterations",
                Solver("lcaba", iterations=20),
                -1.0,
                "Sathya, Carpentier, Constrained articulated body dynamics algorithms, IEEE Transactions on Robotics, 2024; rounding "
                "leaves u / mu of M + J' J / mu",
                "take constraintDynamics, or a mu near 1e-2 with many iterations",
            ),
        )
    ),
    HardCase(
        name="long_closed_chain",
        title="row of n four-bars, of up to 49 bodies",
        system=lambda bodies: f"four_bar_chain_{(bodies - 1) / 2:.0f}",
        knob=("number of bodies", "1"),
        values=of_sizes([2 * size + 1 for size in SIZES]),
        states=at_each_seed,
        source="Bayo, Avello, Singularity-free augmented Lagrangian algorithms, Nonlinear Dynamics 5 (1994); J M^-1 J' is tridiagonal by "
        "blocks, and regular away from the line",
        remedy="accelerations are safe away from configurations in which all bars are in line",
    ),
)
