"""Far from the origin, very small and very large mechanisms, other units, huge angles and subnormal numbers."""

from __future__ import annotations

from harness.hard.cases import KNOB, HardCase, Theory, decades, posed, shares, varied
from harness.hard.cases.masses import bar_numbers

_SYMMETRY = "Landau, Lifshitz, Mechanics, section 7: space is homogeneous, so no acceleration feels where the origin is"
_SIMILARITY = "Landau, Lifshitz, Mechanics, section 10 (mechanical similarity): other units change no relative error"
_NEARER = "put the origin of the world near the mechanism, and subtract the distance before the engine sees it"
# Lever arms are differences of positions in the world, each of which has half an ulp of the distance.
_IN_WORLD_COORDINATES = Theory("disagrees", growth=1.0, digits_growth=1.0)

FAR_BASE = HardCase(
    name="far_base",
    title="three bars on a pin far from the world's origin",
    system="bar_chain_3",
    knob=("distance of the pin from the origin", "m"),
    values=decades(-1, 10),
    changes={"mjcf": {"body bar_1@pos[0]": KNOB}, "urdf": {"joint joint_1/origin@xyz[0]": KNOB}},
    source=_SYMMETRY,
    remedy=_NEARER,
    theory={"mujoco/mjcf": _IN_WORLD_COORDINATES},
)


FAR_CART = HardCase(
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
)

FAR_FREE_BODY = HardCase(
    name="far_free_body",
    title="free body far from the world's origin",
    system="free_body",
    knob=("distance from the origin", "m"),
    values=decades(-1, 10),
    states=posed(lambda distance: {0: distance}),
    source=_SYMMETRY,
    remedy=_NEARER,
)

LENGTH_SCALE = HardCase(
    name="length_scale",
    title="three bars of one density from micrometres to hundreds of kilometres",
    system="bar_chain_3",
    knob=("length of a bar", "m"),
    values=decades(-6, 6),
    parameters=lambda length: {f"{name}{i}": length if name == "L" else 8 * length**3 for name in "mL" for i in (1, 2, 3)},
    changes=bar_numbers(3),
    source=_SIMILARITY,
    remedy="write small mechanisms in millimetres and grams, with gravity in the same units",
)

MASS_UNIT = HardCase(
    name="mass_unit",
    title="three bars weighed in units from femtograms to gigatonnes",
    system="bar_chain_3",
    knob=("mass of a bar", "kg"),
    values=decades(-18, 12),
    parameters=lambda mass: {f"m{i}": mass for i in (1, 2, 3)},
    changes=bar_numbers(3),
    source=_SIMILARITY,
    remedy="write light mechanisms in grams",
)


HUGE_ANGLES = HardCase(
    name="huge_angles",
    title="double pendulum after very many turns",
    system="double_pendulum",
    knob=("largest angle", "rad"),
    values=decades(0, 15),
    states=varied(lambda states, angle: {"q": angle * shares(*states.q.shape)}),
    source="Payne, Hanek, Radian reduction for trigonometric functions, SIGNUM Newsletter 18 (1983): a good sine is exact at any angle",
    remedy="take whole turns off angles before they lose the digits in which the phase stands",
)


SUBNORMAL = HardCase(
    name="subnormal",
    title="double pendulum whose positions, rates and forces sink into the subnormal numbers",
    system="double_pendulum",
    knob=("largest position, rate and force", "SI"),
    values=(*decades(-322, -290, 29), 5e-324),
    states=varied(lambda states, size: dict(zip(("q", "v", "tau"), shares(3, *states.q.shape) * size, strict=True))),
    source="Demmel, Underflow and the reliability of numerical software, SIAM J. Sci. Stat. Comput. 5 (1984)",
    remedy="nothing; keep flush-to-zero off",
)


HIGH_COUNTERWEIGHT = HardCase(
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
)
