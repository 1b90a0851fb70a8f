"""Motions with contacts at thresholds, which laws that give blur: grazing, sticking and sliding, and steps as long as an impact.

Values go from gentle to hard, so that distances from rigid motions have a law of growth and engines a value that breaks them. Each is a
``RigidCase`` as those of ``harness.hard.cases.rigid``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

from harness.hard.cases.rigid import BALL, BLOCK, surfaces
from harness.hard.rigid_case import Edits, Numbers, RecordedMotion, RigidCase, UrdfChanges

# Gap from which the ball is thrown at what it grazes [m].
_GAP = 0.05


def _thrown(own: Numbers) -> float:
    """Speed of a ball that would come by ``depth`` beyond the surface before gravity turns it back."""
    return math.sqrt(2 * -own["g"] * (_GAP + own["depth"]))


def _impulse(motion: RecordedMotion, own: Numbers) -> float:
    """Impulse of the contact, of that which stops the ball at the surface; steps add gravity's without an error."""
    unhindered = motion.start[1][0] - own["g"] * motion.times[-1]
    return float((motion.v[-1, 0] - unhindered) / math.sqrt(2 * -own["g"] * own["depth"]))


# Gravity points away from the surface, as under a ceiling.
GRAZING = RigidCase(
    name="grazing ball",
    system="bouncing_ball",
    knob=("depth that it would reach", "m"),
    values=(1.0, 0.1, 1e-2, 1e-3, 1e-4),
    changes=lambda depth: {"g": -9.81, "depth": depth},
    edits=lambda depth: {"option": {"gravity": "0 0 9.81"}},
    of_urdf=lambda depth: UrdfChanges(
        {"restitution": 0.0},
        {"joint/axis": {"xyz": "0 0 -1"}, "link[@name='world']/collision/origin": {"xyz": "0 0 0.5"}},
    ),
    of_usd=lambda depth: {
        "bouncing_ball/scene": {"vector3f physics:gravityDirection": "(0, 0, 1)"},
        **surfaces("bouncing_ball", "restitution")(0.0),
    },
    start=lambda own: ([own["R"] + _GAP], [-_thrown(own)]),
    time=lambda own: 2 * _thrown(own) / -own["g"],
    measured=("impulse, of that which stops it", "1"),
    measure=_impulse,
    rigid=lambda contacts, q, v, own: [(1.0, 1.0)],
    only=("as the file stands", "timeconst of two steps", "steps of 0.2 ms"),
    gentle_first=True,
    source="Brogliato, Nonsmooth Mechanics, 3rd ed., section 1.3 (grazing impacts); the impact keeps no speed",
)


def _short_of(side: int) -> Callable[[float], float]:
    """The coefficient of friction of the block that is so much from the threshold, relative, where it slides (-1) or sticks (1)."""
    # The incline is a 3-4-5 triangle.
    return lambda share: 0.75 * (1 + side * share)


def _at_threshold(name: str, side: int) -> RigidCase:
    friction = _short_of(side)
    return replace(
        BLOCK,
        name=name,
        knob=("friction from the threshold, relative", "1"),
        values=(0.3, 0.1, 0.03, 0.01, 1e-3, 1e-4),
        changes=lambda share: BLOCK.changes(friction(share)),
        edits=lambda share: BLOCK.edits(friction(share)),
        of_urdf=lambda share: BLOCK.of_urdf(friction(share)),
        of_usd=lambda share: surfaces("block_on_incline", "staticFriction", "dynamicFriction")(friction(share)),
        # The acceleration that is as far on the other side.
        scale=lambda own: own["g"] * math.sin(own["alpha"]) * abs(own["mu"] / math.tan(own["alpha"]) - 1),
        only=(),
        gentle_first=True,
    )


SLIDES, STICKS = _at_threshold("block that barely slides", -1), _at_threshold("block that barely sticks", 1)

# Speed before the impact [m/s], time constant of the contact [s] and its damping ratio: stiffness is 1 / (timeconst dampratio)^2, damping
# 2 / timeconst.
_FALLING, _TIMECONST, _DAMPRATIO = 3.0, 3e-3, 0.25
_FREQUENCY, _ROOT = 1 / (_TIMECONST * _DAMPRATIO), math.sqrt(1 - _DAMPRATIO**2)
# Angle by which the damped oscillator turns until its force, which does not pull, is none, and the speed that it keeps.
_TURN = math.pi - math.atan(2 * _DAMPRATIO * _ROOT / (1 - 2 * _DAMPRATIO**2))
_IMPACT, _KEPT = _TURN / (_FREQUENCY * _ROOT), math.exp(-_DAMPRATIO / _ROOT * _TURN)


def _sprung(ratio: float) -> Edits:
    """One impedance at all depths, so that the contact is an oscillator."""
    return {"worldbody//geom": {"solref": f"{_TIMECONST!r} {_DAMPRATIO!r}", "solimp": "0.95 0.95 0.001"}}


def _steps(own: Numbers) -> float:
    """Time of the impact, thrice; MuJoCo makes one whose steps are long as long as two of them."""
    return 3 * _IMPACT * max(1.0, 2 * own["ratio"]) + own["ratio"] * _TIMECONST


def _fastest(motion: RecordedMotion, own: Numbers) -> float:
    return float(motion.v[:, 0].max() / _FALLING)


STEPS = RigidCase(
    name="bounce in few steps",
    system="bouncing_ball",
    knob=("length of a step over timeconst", "1"),
    values=(0.01, 0.03, 0.1, 0.3, 0.5, 1.0, 2.0),
    changes=lambda ratio: {"ratio": ratio},
    edits=_sprung,
    of_urdf=lambda ratio: UrdfChanges({"restitution": _KEPT}),
    of_usd=lambda ratio: surfaces("bouncing_ball", "restitution")(_KEPT),
    start=lambda own: ([own["R"] + 1e-9], [-_FALLING]),
    time=_steps,
    measured=BALL.measured,
    measure=_fastest,
    rigid=lambda contacts, q, v, own: [(_KEPT, _KEPT)],
    length=lambda ratio, own: ratio * _TIMECONST,
    only=("as the file stands", "without refsafe"),
    gentle_first=True,
    source="Schwager, Poeschel, Coefficient of restitution and linear-dashpot model revisited, Granular Matter 9 (2007), for what is kept",
)
