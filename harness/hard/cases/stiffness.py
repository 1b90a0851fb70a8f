"""Springs and dampers beside which inertia is nothing, and a spring that has no length left."""

from __future__ import annotations

import math

from harness.hard.cases import STATES, HardCase, Theory, decades, posed, shares

_LINEAR = "the force is linear in the stiffness, so its relative error, and the data roundoff, do not depend on it"

STIFF_SPRING = HardCase(
    name="stiff_spring",
    title="elastic pendulum with a spring as stiff as a steel rod and stiffer",
    system="spring_pendulum",
    knob=("stiffness", "N/m"),
    values=decades(0, 12),
    parameters=lambda stiffness: {"k": stiffness},
    changes={"mjcf": {"joint spring@stiffness": "k"}, "urdf": {"gazebo spring/springStiffness@": "k"}},
    source=_LINEAR,
    remedy="accelerations are safe; a step must resolve sqrt(m/k), or the spring be replaced by a rod",
)

STIFF_DAMPER = HardCase(
    name="stiff_damper",
    title="pendulum on a cart with a damper in the pin as hard as a seized bearing",
    system="cart_pendulum",
    knob=("damping", "N m s"),
    values=decades(-1, 9),
    parameters=lambda damping: {"c": damping},
    changes={"mjcf": {"joint pin@damping": "c"}, "urdf": {"joint pin/dynamics@damping": "c"}},
    source=_LINEAR,
    remedy="accelerations are safe; integrate implicitly in the velocity, or fix the joint",
)


COLLAPSED_SPRING = HardCase(
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
)

STIFF_MODE = HardCase(
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
)
