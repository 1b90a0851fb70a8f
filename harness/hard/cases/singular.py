"""Mass matrices that become singular: carts, rods and links that lose their mass, inertia or length."""

from __future__ import annotations

from harness.hard.cases import Changes, HardCase, Theory, decades, posed
from harness.hard.cases.masses import bar_numbers

_HIGHAM = "Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed., section 10.1 (Cholesky, scaled condition number)"
# Changes of the parameters leave a vanishing pivot its relative accuracy and move the energy norm of the answer by
# sqrt(kappa_s) u; rounding M entry by entry does not, and moves it by kappa_s u. The backward error is the quotient.
# In the end no three digits are left, which no conditioning excuses.
_FACTORISED = Theory("disagrees", growth=-0.5, digits_growth=-1.0)

VANISHING_CART = HardCase(
    name="vanishing_cart",
    title="cart under a bar pendulum whose own mass goes to zero",
    system="cart_pendulum",
    knob=("mass of the cart", "kg"),
    values=decades(-18, 1),
    parameters=lambda mass: {"M": mass},
    changes={"mjcf": {"body cart/inertial@mass": "M"}, "urdf": {"link cart/inertial/mass@value": "M"}},
    source="the bar's own inertia keeps M regular: det M = m^2 L^2 (1/3 - cos^2(theta)/4) at M = 0",
    remedy="give a massless carriage 1e-15 kg, or let the pin's body carry both joints",
)


MASSLESS_KNEE = HardCase(
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
)

_WRIST_INERTIAS = {
    f"I{axis}{i}": value
    for i, row in ((5, (0.03, 0.035, 0.02)), (6, (0.03, 0.025, 0.035)))
    for axis, value in zip(("xx", "yy", "zz"), row, strict=True)
}
_WRIST_MASSES = {"m5": 3.0, "m6": 2.5}


def _wrist_numbers() -> dict[str, Changes]:
    mjcf: dict[str, str] = {}
    urdf: dict[str, str] = {}
    for i in (5, 6):
        mjcf[f"body link{i}/inertial@mass"] = urdf[f"link link{i}/inertial/mass@value"] = f"m{i}"
        for place, axis in enumerate(("xx", "yy", "zz")):
            mjcf[f"body link{i}/inertial@diaginertia[{place}]"] = urdf[f"link link{i}/inertial/inertia@i{axis}"] = f"I{axis}{i}"
    return {"mjcf": mjcf, "urdf": urdf}


VANISHING_WRIST = HardCase(
    name="vanishing_wrist",
    title="seven-joint arm 1 mrad from its wrist singularity, links 5 and 6 without inertia",
    system="arm_7r",
    knob=("share left of masses and inertias of links 5 and 6", "1"),
    values=decades(-12, 0),
    parameters=lambda share: {name: share * value for name, value in {**_WRIST_MASSES, **_WRIST_INERTIAS}.items()},
    changes=_wrist_numbers(),
    states=posed(lambda value: {5: 1e-3}),
    source=_HIGHAM + "; axes 5 and 7 coincide at the singularity, and nothing between them weighs against the second turn",
    remedy="give every joint its rotor's reflected inertia (armature), which the real drive has",
    theory={"lagrange": Theory("unstable"), "mujoco/mjcf": Theory("unstable")},
)


ZERO_LENGTH_LINK = HardCase(
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
)
