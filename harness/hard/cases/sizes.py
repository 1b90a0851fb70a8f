"""Sizes far from one: distances from the origin, mechanisms, units, angles, subnormal numbers, springs and dampers.

Mass matrices become singular where carts, rods and links lose their mass, inertia or length, and a spring may have no length left.
"""

from __future__ import annotations

import math

from harness.hard.cases import KNOB, STATES, HardCase, Theory, decades, inertia_numbers, posed, shares, together, varied
from harness.hard.cases.long_chains import bar_numbers

_SYMMETRY = "Landau, Lifshitz, Mechanics, section 7: space is homogeneous, so no acceleration feels where the origin is"
_SIMILARITY = "Landau, Lifshitz, Mechanics, section 10 (mechanical similarity): other units change no relative error"
_NEARER = "put the origin of the world near the mechanism, and subtract the distance before the engine sees it"
# Lever arms are differences of positions in the world, each of which has half an ulp of the distance.
_IN_WORLD_COORDINATES = Theory("disagrees", growth=1.0, digits_growth=1.0)

_HIGHAM = "Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed., section 10.1 (Cholesky, scaled condition number)"
# Changes of the parameters leave a vanishing pivot its relative accuracy and move the energy norm of the answer by
# sqrt(kappa_s) u; rounding M entry by entry does not, and moves it by kappa_s u. The backward error is the quotient.
# In the end no three digits are left, which no conditioning excuses.
_FACTORISED = Theory("disagrees", growth=-0.5, digits_growth=-1.0)

_WRIST_INERTIAS = {
    f"I{axis}{i}": value
    for i, row in ((5, (0.03, 0.035, 0.02)), (6, (0.03, 0.025, 0.035)))
    for axis, value in zip(("xx", "yy", "zz"), row, strict=True)
}

_WRIST_MASSES = {"m5": 3.0, "m6": 2.5}

_LINEAR = "the force is linear in the stiffness, so its relative error, and the data roundoff, do not depend on it"

CASES = (
    HardCase(
        name="far_base",
        title="three bars on a pin far from the world's origin",
        system="bar_chain_3",
        knob=("distance of the pin from the origin", "m"),
        values=decades(-1, 10),
        changes={"mjcf": {"body bar_1@pos[0]": KNOB}, "urdf": {"joint joint_1/origin@xyz[0]": KNOB}},
        source=_SYMMETRY,
        remedy=_NEARER,
        theory={"mujoco/mjcf": _IN_WORLD_COORDINATES},
    ),
    HardCase(
        name="far_cart",
        title="double pendulum on a cart that has rolled far away, on a spring too weak to feel",
        system="cart_double_pendulum",
        knob=("distance from the origin", "m"),
        values=decades(-1, 10),
        parameters=lambda distance: {"k": 1e-30},
        changes={"mjcf": {"joint slide@stiffness": "k"}, "urdf": {"gazebo slide/springStiffness@": "k"}},
        states=posed(lambda distance: {0: distance}),
        source=_SYMMETRY,
        remedy=_NEARER,
        theory={"mujoco/mjcf": _IN_WORLD_COORDINATES},
    ),
    HardCase(
        name="far_free_body",
        title="free body far from the world's origin",
        system="free_body",
        knob=("distance from the origin", "m"),
        values=decades(-1, 10),
        states=posed(lambda distance: {0: distance}),
        source=_SYMMETRY,
        remedy=_NEARER,
    ),
    HardCase(
        name="length_scale",
        title="three bars of one density from micrometres to hundreds of kilometres",
        system="bar_chain_3",
        knob=("length of a bar", "m"),
        values=decades(-6, 6),
        parameters=lambda length: {f"{name}{i}": length if name == "L" else 8 * length**3 for name in "mL" for i in (1, 2, 3)},
        changes=bar_numbers(3),
        source=_SIMILARITY,
        remedy="write small mechanisms in millimetres and grams, with gravity in the same units",
    ),
    HardCase(
        name="mass_unit",
        title="three bars weighed in units from femtograms to gigatonnes",
        system="bar_chain_3",
        knob=("mass of a bar", "kg"),
        values=decades(-18, 12),
        parameters=lambda mass: {f"m{i}": mass for i in (1, 2, 3)},
        changes=bar_numbers(3),
        source=_SIMILARITY,
        remedy="write light mechanisms in grams",
    ),
    HardCase(
        name="huge_angles",
        title="double pendulum after very many turns",
        system="double_pendulum",
        knob=("largest angle", "rad"),
        values=decades(0, 15),
        states=varied(lambda states, angle: {"q": angle * shares(*states.q.shape)}),
        source="Payne, Hanek, Radian reduction for trigonometric functions, SIGNUM Newsletter 18 (1983): a good sine is exact at any angle",
        remedy="take whole turns off angles before they lose the digits in which the phase stands",
    ),
    HardCase(
        name="subnormal",
        title="double pendulum whose positions, rates and forces sink into the subnormal numbers",
        system="double_pendulum",
        knob=("largest position, rate and force", "SI"),
        values=(*decades(-322, -290, 29), 5e-324),
        states=varied(lambda states, size: dict(zip(("q", "v", "tau"), shares(3, *states.q.shape) * size, strict=True))),
        source="Demmel, Underflow and the reliability of numerical software, SIAM J. Sci. Stat. Comput. 5 (1984)",
        remedy="nothing; keep flush-to-zero off",
    ),
    HardCase(
        name="high_counterweight",
        title="arm with a light wrist, and a tonne on the axis of its waist",
        system="puma_560",
        knob=("height of the tonne above the shoulder", "m"),
        values=decades(-1, 3),
        changes={
            "mjcf": {"body link1/inertial@mass": lambda values: 1000.0, "body link1/inertial@pos[2]": KNOB},
            "urdf": {"link link1/inertial/mass@value": lambda values: 1000.0},
        },
        source="Featherstone, Rigid Body Dynamics Algorithms, section 2.13 (parallel axes): about a point at the distance d from a light"
        " body's centre its own moments stand beside m d^2; what stands on the axis of the waist is not felt",
        remedy="give the wrist its rotors' reflected inertia (armature); weld to the world what does not move",
        # The wrist's entry of M loses m d^2 / M_55, of which no scaling of M knows.
        theory={"mujoco/mjcf": Theory("disagrees", growth=2.0)},
    ),
    HardCase(
        name="vanishing_cart",
        title="cart under a bar pendulum whose own mass goes to zero",
        system="cart_pendulum",
        knob=("mass of the cart", "kg"),
        values=decades(-18, 1),
        parameters=lambda mass: {"M": mass},
        changes={"mjcf": {"body cart/inertial@mass": "M"}, "urdf": {"link cart/inertial/mass@value": "M"}},
        source="the bar's own inertia keeps M regular: det M = m^2 L^2 (1/3 - cos^2(theta)/4) at M = 0",
        remedy="give a massless carriage 1e-15 kg, or let the pin's body carry both joints",
    ),
    HardCase(
        name="massless_knee",
        title="straight double pendulum whose middle mass goes to zero",
        system="double_pendulum",
        knob=("mass at the knee", "kg"),
        values=decades(-14, 0.4),
        parameters=lambda mass: {"m1": mass},
        changes={"mjcf": {"body mass_1/inertial@mass": "m1"}, "urdf": {"link mass_1/inertial/mass@value": "m1"}},
        states=posed(lambda value: {1: 0.0}),
        source=_HIGHAM + "; the knee moves freely where it weighs nothing, so that kappa_s grows as 1/m1",
        remedy="give the knee an inertia, or make the two rods one where the knee carries nothing",
        theory=dict.fromkeys(("lagrange", "mujoco/mjcf"), _FACTORISED),
    ),
    HardCase(
        name="vanishing_wrist",
        title="seven-joint arm 1 mrad from its wrist singularity, links 5 and 6 without inertia",
        system="arm_7r",
        knob=("share left of masses and inertias of links 5 and 6", "1"),
        values=decades(-12, 0),
        parameters=lambda share: {name: share * value for name, value in {**_WRIST_MASSES, **_WRIST_INERTIAS}.items()},
        changes=together([inertia_numbers(f"link{i}", f"link{i}", {axis: f"I{axis}{axis}{i}" for axis in "xyz"}, f"m{i}") for i in (5, 6)]),
        states=posed(lambda value: {5: 1e-3}),
        source=_HIGHAM + "; axes 5 and 7 coincide at the singularity, and nothing between them weighs against the second turn",
        remedy="give every joint its rotor's reflected inertia (armature), which the real drive has",
        theory={"lagrange": Theory("unstable"), "mujoco/mjcf": Theory("unstable")},
    ),
    HardCase(
        name="zero_length_link",
        title="middle bar of three whose length goes to zero",
        system="bar_chain_3",
        knob=("length of the middle bar", "m"),
        values=decades(-9, 0),
        parameters=lambda length: {"L2": length},
        changes=bar_numbers(3),
        source=_HIGHAM + "; two hinges meet in one point and the bar between them has no inertia left: kappa_s grows as 1/L2^2",
        remedy="make two hinges in one point one hinge, or give the link between them its real inertia",
        # The data stay well conditioned here, and rounding M entry by entry costs kappa_s u.
        theory=dict.fromkeys(("lagrange", "mujoco/mjcf"), Theory("disagrees", growth=-2.0, digits_growth=-2.0)),
    ),
    HardCase(
        name="stiff_spring",
        title="elastic pendulum with a spring as stiff as a steel rod and stiffer",
        system="spring_pendulum",
        knob=("stiffness", "N/m"),
        values=decades(0, 12),
        parameters=lambda stiffness: {"k": stiffness},
        changes={"mjcf": {"joint spring@stiffness": "k"}, "urdf": {"gazebo spring/springStiffness@": "k"}},
        source=_LINEAR,
        remedy="accelerations are safe; a step must resolve sqrt(m/k), or the spring be replaced by a rod",
    ),
    HardCase(
        name="stiff_damper",
        title="pendulum on a cart with a damper in the pin as hard as a seized bearing",
        system="cart_pendulum",
        knob=("damping", "N m s"),
        values=decades(-1, 9),
        parameters=lambda damping: {"c": damping},
        changes={"mjcf": {"joint pin@damping": "c"}, "urdf": {"joint pin/dynamics@damping": "c"}},
        source=_LINEAR,
        remedy="accelerations are safe; integrate implicitly in the velocity, or fix the joint",
    ),
    HardCase(
        name="collapsed_spring",
        title="collar on a circle through its spring's anchor, close to the anchor",
        system="collar",
        knob=("angle from the anchor", "rad"),
        values=decades(-8, 0),
        parameters=lambda angle: {"d": 1.5},
        changes={
            "mjcf": {"site anchor@pos[0]": lambda values: -values["d"], "spatial spring@springlength": "d"},
            "urdf": {
                "drake:linear_spring_damper/drake:linear_spring_damper_p_AP@value[0]": lambda values: -values["d"],
                "drake:linear_spring_damper/drake:linear_spring_damper_free_length@value": "d",
            },
        },
        states=posed(lambda angle: {0: math.pi - angle * shares(STATES, low=0.5)}),
        source="by the law of cosines the length is the root of a difference of squares: half an ulp of r^2 over length^2 is lost; "
        "points in space lose half an ulp of r across the circle, where the force does no work",
        theory={"lagrange": Theory("disagrees", digits_growth=-2.0)},
        remedy="keep the spring's ends apart, or write the force of a spring between close points in the joint's own angle",
    ),
    HardCase(
        name="stiff_mode",
        title="undamped mass on a spring whose frequency grows",
        system="spring_damper",
        knob=("stiffness", "N/m"),
        values=decades(0, 12),
        parameters=lambda stiffness: {"k": stiffness, "c": 0.0},
        changes={
            "mjcf": {"joint slide@stiffness": "k", "joint slide@damping": "c"},
            "urdf": {"gazebo slide/springStiffness@": "k", "joint slide/dynamics@damping": "c"},
        },
        source=_LINEAR,
        remedy="accelerations are safe; a step must stay below the integrator's limit over sqrt(k/m)",
    ),
)
