"""Motions with contacts whose rigid answers are known, by closed forms or as all that are consistent.

Each is a mechanism of the catalogue with one parameter turned; ``harness.hard.touching`` asks engines.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from harness.arrays import Array
from harness.hard.rigid_case import Edits, Interval, Numbers, RecordedMotion, RigidCase, UrdfChanges
from harness.truth.coulomb import RigidContacts

# Accelerations of that part of gravity are none.
_NOTHING = 1e-12


def _friction(condim: int = 3) -> Callable[[float], Edits]:
    """All shapes rub by a coefficient, of slips or of turns."""
    return lambda mu: {"worldbody//geom": {"friction": f"{mu!r}" if condim == 3 else f"0.5 {mu!r}"}}


def surfaces(system: str, *names: str) -> Callable[[float], Edits]:
    """Numbers of the one material that all surfaces of a stage are of, so that its mean is its own."""
    return lambda value: {f"{system}/surface": {f"float physics:{name}": f"{value!r}" for name in names}}


_RUB = ("staticFriction", "dynamicFriction")


def _accelerations(closed: tuple[str, ...], place: int) -> Callable[..., list[Interval]]:
    """One acceleration of all that are consistent at the start."""

    def consistent(contacts: RigidContacts, q: Sequence[float], v: Sequence[float], own: Numbers) -> list[Interval]:
        found = [answer.accelerations for answer in contacts.answers(q, v, closed)]
        # Of a sum that cancels, what is left of its balls is nothing.
        values = [float(one[place]) if abs(one[place]) > _NOTHING * own["g"] else 0.0 for one in found]
        return [(value, value) for value in values]

    return consistent


def _mean_acceleration(place: int) -> Callable[[RecordedMotion, Numbers], float]:
    """That by which a coordinate comes as far from rest."""
    return lambda motion, own: float(2 * (motion.q[-1, place] - motion.start[0][place]) / motion.times[-1] ** 2)


def _known(value: Callable[[Numbers], Interval]) -> Callable[..., list[Interval]]:
    return lambda contacts, q, v, own: [value(own)]


_EDGES = ("lower edge", "upper edge")
BLOCK = RigidCase(
    name="block on an incline",
    system="block_on_incline",
    knob=("coefficient of friction", "1"),
    values=(0.3, 0.7, 0.8, 1.2),
    changes=lambda mu: {"mu": mu},
    edits=_friction(),
    of_urdf=lambda mu: UrdfChanges({"lateral_friction": mu}),
    of_usd=surfaces("block_on_incline", *_RUB),
    start=lambda own: ([0.0, own["h"], 0.0], [0.0] * 3),
    closed=_EDGES,
    time=lambda own: 1.0,
    measured=("acceleration down the incline", "m/s^2"),
    measure=_mean_acceleration(0),
    rigid=_accelerations(_EDGES, 0),
    scale=lambda own: own["g"],
    source="Greenwood, Principles of Dynamics, 2nd ed., section 3-4: sticks while mu >= tan(alpha) = 3/4",
)

SPHERE = RigidCase(
    name="sphere on an incline",
    system="sphere_on_incline",
    knob=("coefficient of friction", "1"),
    values=(0.1, 0.2, 0.25, 0.5),
    changes=lambda mu: {"mu": mu},
    edits=_friction(),
    of_urdf=lambda mu: UrdfChanges({"lateral_friction": mu}),
    of_usd=surfaces("sphere_on_incline", *_RUB),
    start=lambda own: ([0.0, own["R"], 0.0], [0.0] * 3),
    closed=("incline",),
    time=lambda own: 1.0,
    measured=("acceleration down the incline", "m/s^2"),
    measure=_mean_acceleration(0),
    rigid=_accelerations(("incline",), 0),
    scale=lambda own: own["g"],
    source="Goldstein, Poole, Safko, Classical Mechanics, 3rd ed., section 2.4: rolls while mu >= 2/7 tan(alpha) = 0.214",
)

_THROWN = 2.0
ROLLING = RigidCase(
    name="sliding to rolling",
    system="sliding_to_rolling",
    knob=("coefficient of friction", "1"),
    values=(0.1, 0.3, 0.9),
    changes=lambda mu: {"mu": mu},
    edits=_friction(),
    of_urdf=lambda mu: UrdfChanges({"lateral_friction": mu}),
    of_usd=surfaces("sliding_to_rolling", *_RUB),
    start=lambda own: ([0.0, own["R"], 0.0], [_THROWN, 0.0, 0.0]),
    closed=("floor",),
    time=lambda own: 1.5 * 2 * _THROWN / (7 * own["mu"] * own["g"]),
    measured=("speed at which it rolls, of the first", "1"),
    measure=lambda motion, own: float(motion.v[-1, 0] / _THROWN),
    rigid=_known(lambda own: (5 / 7, 5 / 7)),
    source="Sommerfeld, Mechanics, section 27: rolls at 5/7 of the first speed",
)

_SPUN = 10.0


def _patch(mu: float) -> Edits:
    """PhysX rubs about the normal by the coefficient of slips, 0.5, on a patch of a radius."""
    radius = {"float physxCollision:minTorsionalPatchRadius": f"{mu / 0.5!r}"}
    return {"spinning_disc/floor": radius, "spinning_disc/disc/foot": radius}


DISC = RigidCase(
    name="spinning disc",
    system="spinning_disc",
    knob=("length of friction about the normal", "m"),
    values=(0.005, 0.02, 0.08),
    changes=lambda mu: {"mu": mu},
    edits=_friction(condim=4),
    of_urdf=lambda mu: UrdfChanges({"lateral_friction": 0.5, "spinning_friction": mu}),
    of_usd=_patch,
    start=lambda own: ([own["foot"], 0.0], [0.0, _SPUN]),
    closed=("floor",),
    time=lambda own: _SPUN * own["R"] ** 2 / 2 / (own["mu"] * own["g"]) / 2,
    measured=("spin after half of the time to rest, of the first", "1"),
    measure=lambda motion, own: float(motion.v[-1, 1] / _SPUN),
    rigid=_known(lambda own: (0.5, 0.5)),
    source="Pfeiffer, Glocker, Multibody Dynamics with Unilateral Contacts, section 5.3: slows by mu m g / I",
)

# Speed before the impact [m/s], and half a period of the oscillator that contacts are [s].
_FALLING, _IMPACT = 3.0, 0.02


def _bouncing(restitution: float) -> Edits:
    """Stiffness and damping of the oscillator whose speed after half a period is so much of the first.

    A file of MuJoCo states no restitution, and this is what its user writes.
    """
    damping = -math.log(restitution) / _IMPACT
    return {"worldbody//geom": {"solref": f"{-((math.pi / _IMPACT) ** 2 + damping**2)!r} {-2 * damping!r}"}}


BALL = RigidCase(
    name="bouncing ball",
    system="bouncing_ball",
    knob=("speed after an impact of that before", "1"),
    values=(0.2, 0.5, 0.8, 0.95),
    edits=_bouncing,
    of_urdf=lambda e: UrdfChanges({"restitution": e}),
    of_usd=surfaces("bouncing_ball", "restitution"),
    changes=lambda e: {"restitution": e},
    start=lambda own: ([own["R"] + 1e-9], [-_FALLING]),
    time=lambda own: 0.25,
    measured=("speed after an impact of that before", "1"),
    measure=lambda motion, own: float(motion.v[:, 0].max() / _FALLING),
    rigid=_known(lambda own: (own["restitution"], own["restitution"])),
    only=("as the file stands", "steps of 0.2 ms"),
    source="Brogliato, Nonsmooth Mechanics, 3rd ed., section 1.1: Newton's law of impact",
)

CRADLE = RigidCase(
    name="Newton's cradle",
    system="newtons_cradle",
    knob=("stiffness of contacts", "1/s^2"),
    values=(1e4, 1e5, 1e6),
    edits=lambda k: {"worldbody//geom": {"solref": f"{-k!r} 0"}},
    # Its contacts are rigid, and keep the energy.
    of_urdf=lambda k: UrdfChanges({"restitution": 1.0}),
    of_usd=lambda k: surfaces("newtons_cradle", "restitution")(1.0),
    start=lambda own: ([-0.02, 0.02, 0.0], [1.0, -1.0, 0.0]),
    time=lambda own: 0.2,
    measured=("speed of the last ball, of the first", "1"),
    measure=lambda motion, own: float(motion.v[-1].sum()),
    # With what momentum and energy leave open.
    rigid=_known(lambda own: (2 / 3, 1.0)),
    only=("as the file stands", "steps of 0.2 ms"),
    source="Brogliato, Nonsmooth Mechanics, 3rd ed., section 6.1: momentum and energy leave an arc of outcomes",
)

_BOXES = tuple(f"{edge} edge of the {box}" for box in ("first", "second", "third") for edge in ("left", "right"))
STACK = RigidCase(
    name="stack of boxes",
    system="box_stack",
    knob=("mass of the last box", "kg"),
    values=(1.0, 10.0, 100.0, 1000.0),
    changes=lambda mass: {"m3": mass},
    edits=lambda mass: {"worldbody/body/body/body/inertial": {"mass": f"{mass!r}"}},
    of_urdf=lambda mass: UrdfChanges(edits={"link[@name='third_box']/inertial/mass": {"value": f"{mass!r}"}}),
    of_usd=lambda mass: {"box_stack/third_box": {"float physics:mass": f"{mass!r}"}},
    start=lambda own: ([0.0] * 3, [0.0] * 3),
    closed=_BOXES,
    time=lambda own: 2.0,
    measured=("displacement of the last box, of its height", "1"),
    measure=lambda motion, own: float(motion.q[-1].sum() / 0.2),
    rigid=_accelerations(_BOXES, 2),
    only=("as the file stands", "timeconst of two steps", "steps of 0.2 ms", "solver CG", "solver PGS"),
    gentle_first=True,
    source="Brogliato, Nonsmooth Mechanics, 3rd ed., section 5.1: nothing moves",
)

# Angle of the rod [rad], at which the least friction is enough, and the slip of its end [m/s].
_LEANS, _SLIDING = math.atan(2.0), -1.0


def _rod(turning: float) -> Callable[[Numbers], tuple[Sequence[float], Sequence[float]]]:
    """The rod turns so fast while its end slides to the left along the floor."""

    def start(own: Numbers) -> tuple[Sequence[float], Sequence[float]]:
        height, width = own["l"] * math.sin(_LEANS) + own["r"], own["l"] * math.cos(_LEANS)
        return [0.0, height, _LEANS], [_SLIDING - height * turning, width * turning, turning]

    return start


ROD = RigidCase(
    name="Painleve's rod, turning",
    system="painleve_rod",
    knob=("coefficient of friction", "1"),
    values=(0.8, 1.2, 1.6, 2.4),
    changes=lambda mu: {"mu": mu},
    edits=_friction(),
    of_urdf=lambda mu: UrdfChanges({"lateral_friction": mu}),
    of_usd=surfaces("painleve_rod", *_RUB),
    start=_rod(5.0),
    closed=("end",),
    time=None,
    measured=("angular acceleration", "rad/s^2"),
    measure=lambda motion, own: float((motion.v[0, 2] - motion.start[1][2]) / motion.times[0]),
    rigid=_accelerations(("end",), 2),
    scale=lambda own: own["g"] / own["l"],
    source="Brogliato, Nonsmooth Mechanics, 3rd ed., section 5.6: two accelerations from mu > 4/3 on, or none",
)


ROD_AT_REST = replace(ROD, name="Painleve's rod, not turning", start=_rod(0.0))

# Half of the angle between spokes of the wheel [rad], and the steps that it walks.
_HALF, _STEPS = math.pi / 8, 4


def _walks(own: Numbers) -> float:
    """Speed of the rimless wheel on its limit cycle [rad/s], where its supporting spoke stands along the normal.

    An impact keeps the angular momentum about the foot that strikes, and leaves ``kept`` of the speed. The moment of inertia about a foot
    that stands is the same, ``after``, at both ends of a step, in which gravity adds m g sin(gamma) times the way of the hub.
    """
    mass, length, radius, inertia = (own[name] for name in ("m", "l", "r", "J"))
    height, half = length * math.cos(_HALF) + radius, length * math.sin(_HALF)
    after = inertia + mass * (height**2 + half**2)
    kept = (inertia + mass * (height**2 - half**2)) / after
    # Half of the way of a step, in which the foot rolls too.
    way = half + radius * _HALF
    gained = mass * own["g"] * math.sin(own["gamma"]) * 2 * way
    started = gained * kept**2 / (1 - kept**2)
    climbed = mass * own["g"] * (math.cos(own["gamma"]) * (length + radius - height) - math.sin(own["gamma"]) * way)
    return math.sqrt(2 * (started - climbed) / (inertia + mass * (length + radius) ** 2))


def _stride(motion: RecordedMotion, own: Numbers) -> float:
    """Angular speed at which the wheel stands on the spoke that is so many steps on; the last one where it comes no further."""
    return float(np.interp(2 * _HALF * _STEPS, np.maximum.accumulate(motion.q[:, 2]), motion.v[:, 2]))


WHEEL = RigidCase(
    name="rimless wheel",
    system="rimless_wheel",
    knob=("moment of inertia about the axle", "kg m^2"),
    values=(0.25, 0.5, 1.0),
    changes=lambda inertia: {"J": inertia},
    edits=lambda inertia: {"worldbody/body/body/body/inertial": {"diaginertia": f"{inertia!r} {inertia!r} 1e-15"}},
    of_urdf=lambda inertia: UrdfChanges(
        {"lateral_friction": 0.8}, {"link[@name='wheel']/inertial/inertia": {"ixx": f"{inertia!r}", "iyy": f"{inertia!r}"}}
    ),
    of_usd=lambda inertia: {"rimless_wheel/wheel": {"float3 physics:diagonalInertia": f"({inertia!r}, {inertia!r}, {inertia!r})"}},
    start=lambda own: ([0.0, own["l"] + own["r"], 0.0], [(own["l"] + own["r"]) * _walks(own), 0.0, _walks(own)]),
    closed=("foot 0",),
    # It is slow near the normal, so that steps take less.
    time=lambda own: 1.2 * _STEPS * 2 * _HALF / _walks(own),
    measured=("angular speed over the fourth foot", "rad/s"),
    measure=_stride,
    rigid=_known(lambda own: (_walks(own), _walks(own))),
    source="McGeer, Passive dynamic walking, International Journal of Robotics Research 9 (1990): the limit cycle of the rimless wheel",
)


# Lean of the axis of the tippe top [rad], and its spin about it [rad/s].
_LEAN, _SPIN = 0.3, 40.0


def _jellett(q: Array, v: Array, own: Numbers) -> float:
    """Jellett's integral of the tippe top [kg m^3/s], R L_z - a L_3, from its quaternion and its angular velocity in its own frame."""
    (w, x, y, z), moments = q[3:], np.array([own["I1"], own["I1"], own["I3"]])
    up = np.array([2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z]) / (w * w + x * x + y * y + z * z)
    momentum = moments * v[3:]
    return float(own["R"] * momentum @ up - own["a"] * momentum[2])


TOP = RigidCase(
    name="tippe top",
    system="tippe_top",
    knob=("coefficient of friction", "1"),
    values=(0.0, 0.1, 0.3, 1.0),
    edits=lambda mu: {"worldbody//geom": {"condim": "3", "friction": f"{mu!r}"}},
    of_urdf=lambda mu: UrdfChanges({"lateral_friction": mu}),
    of_usd=surfaces("tippe_top", *_RUB),
    start=lambda own: (
        [0.0, 0.0, own["R"] - own["a"] * math.cos(_LEAN), math.cos(_LEAN / 2), math.sin(_LEAN / 2), 0.0, 0.0],
        [0.0, 0.0, 0.0, 0.0, 0.0, _SPIN],
    ),
    closed=("floor",),
    time=lambda own: 2.0,
    measured=("change of Jellett's integral, of itself", "1"),
    measure=lambda motion, own: _jellett(motion.q[-1], motion.v[-1], own) / _jellett(*motion.start, own) - 1,
    rigid=_known(lambda own: (0.0, 0.0)),
    source="Cohen, The tippe top revisited, American Journal of Physics 45 (1977): kept however the point of the contact rubs",
)


def _steady(own: Numbers, lean: float, yaw: float | None = None) -> tuple[Sequence[float], Sequence[float]]:
    """Euler's disc as it rolls steadily at a lean and a rate of yaw; by default that at which its centre is at rest."""
    radius, at_rest = own["R"], math.sqrt(4 * own["g"] / (own["R"] * math.cos(lean)))
    yaw = at_rest if yaw is None else yaw
    turn = (yaw**2 - at_rest**2) * math.sin(lean) / (6 * yaw)
    return [0.0, 0.0, radius * math.cos(lean), 0.0, lean, 0.0], [radius * turn, 0.0, 0.0, yaw, 0.0, turn - yaw * math.sin(lean)]


# Leans of Euler's disc [rad] at which its centre is at rest, nearly upright and nearly flat, and another with a rate of yaw [rad/s]. There
# it rolls in a circle, for which it takes a coefficient of friction of R W |w| / g = 0.445.
_STEEP, _FLAT, _CIRCLING = 0.4, 1.2, (0.6, 1.5)
EULER = RigidCase(
    name="Euler's disc",
    system="euler_disc",
    knob=("lean", "rad"),
    values=(_STEEP, _FLAT),
    changes=lambda lean: {"lean": lean},
    of_urdf=lambda lean: UrdfChanges({"lateral_friction": 0.5}),
    of_usd=lambda lean: {},
    start=lambda own: _steady(own, own["lean"]),
    closed=("rim",),
    # Two turns of the point of contact.
    time=lambda own: 4 * math.pi / _steady(own, own["lean"])[1][3],
    measured=("angular speed of the precession, of the steady one", "1"),
    measure=lambda motion, own: float((motion.q[-1, 3] - motion.start[0][3]) / motion.times[-1] / motion.start[1][3]),
    rigid=_known(lambda own: (1.0, 1.0)),
    source="Moffatt, Euler's disk and its finite-time singularity, Nature 404 (2000): precesses at sqrt(4 g / (R sin(alpha)))",
)

CIRCLE = RigidCase(
    name="Euler's disc on a circle",
    system="euler_disc",
    knob=("coefficient of friction", "1"),
    values=(0.5, 1.0),
    changes=lambda mu: {"mu": mu},
    edits=_friction(),
    of_urdf=lambda mu: UrdfChanges({"lateral_friction": mu}),
    of_usd=surfaces("euler_disc", *_RUB),
    start=lambda own: _steady(own, *_CIRCLING),
    closed=("rim",),
    time=lambda own: math.pi / _CIRCLING[1],
    measured=("way of the centre in half a turn, of the diameter", "1"),
    measure=lambda motion, own: float(math.hypot(*(motion.q[-1, :2] - motion.start[0][:2])) * _CIRCLING[1] / (2 * abs(motion.start[1][0]))),
    rigid=_known(lambda own: (1.0, 1.0)),
    source="Routh, Advanced Rigid Dynamics, 6th ed., articles 241 to 244: the steady motions of a disc that rolls",
)
