"""Every element and attribute of MJCF and URDF that is understood, as data.

Whatever is not in these tables is refused by name, because engines ignore much of it in silence or read
it differently. Decoration is accepted where the file declares it.

Sources: MuJoCo 4 XML schema (mj_printSchema); http://wiki.ros.org/urdf/XML; Drake, "Parsing model
files", for the drake: tags.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from types import MappingProxyType

from harness.files.document.source import (
    Choice,
    Numbers,
    Rule,
    Text,
    no_dry_friction,
    not_negative,
    not_zero,
    one_sign,
    positive,
    unit,
    whole,
)
from harness.files.mjcf.attributes import KINDS
from harness.files.urdf.kinds import BALL_CONSTRAINT, DRAKE_KINDS, OF_AXIS, POINT_SPRING, TYPES

# Name of an attribute to what it holds; "" is the text between the tags.
Attributes = Mapping[str, Rule]
NOTHING: Attributes = MappingProxyType({})

_NAME, _SCALAR, _VECTOR = Text(), Numbers(), Numbers(3)
_NOT_NEGATIVE, _LIMIT = Numbers(check=not_negative), Numbers(check=not_negative, required=True)
_AXIS = Numbers(3, check=unit)
_MASS = Numbers(check=not_negative, required=True)
_SWITCH = Choice(("true", "false", "auto"))
_POSE: Attributes = {
    "pos": _VECTOR,
    "quat": Numbers(4, check=not_zero),
    "axisangle": Numbers(4),
    "euler": _VECTOR,
    "xyaxes": Numbers(6),
    "zaxis": Numbers(3, check=not_zero),
}
_JOINT: Attributes = {
    "class": _NAME,
    "type": Choice(tuple(KINDS)),
    "pos": _VECTOR,
    "axis": _AXIS,
    "stiffness": Numbers(1, 3),
    "damping": Numbers(1, 3),
    "springref": _SCALAR,
    "ref": _SCALAR,
    "armature": _NOT_NEGATIVE,
    "frictionloss": _NOT_NEGATIVE,
    "solreffriction": Numbers(1, 2, check=one_sign),
    "solimpfriction": Numbers(1, 5),
    "limited": _SWITCH,
    "range": Numbers(2),
    "solreflimit": Numbers(1, 2, check=one_sign),
    "solimplimit": Numbers(1, 5),
}
_TENDON: Attributes = {
    "class": _NAME,
    "stiffness": Numbers(1, 3),
    "damping": Numbers(1, 3),
    "springlength": Numbers(1, 2),
    "armature": _NOT_NEGATIVE,
    "frictionloss": Numbers(check=no_dry_friction),
}
_SOFTNESS: Attributes = {
    "class": _NAME,
    "active": Choice(("true", "false")),
    "solref": Numbers(1, 2, check=one_sign),
    "solimp": Numbers(1, 5),
}
_EQUALITY: Mapping[str, Attributes] = {
    "connect": {"site1": Text(required=True), "site2": Text(required=True)},
    "weld": {"site1": Text(required=True), "site2": Text(required=True), "torquescale": Numbers(check=positive)},
    "joint": {"joint1": Text(required=True), "joint2": _NAME, "polycoef": Numbers(1, 5)},
    "tendon": {"tendon1": Text(required=True), "tendon2": _NAME, "polycoef": Numbers(1, 5)},
}
# Of those that drive a hinge, a slide, or a fixed tendon of these.
_ACTUATOR: Attributes = {
    "name": Text(required=True),
    "joint": _NAME,
    "tendon": _NAME,
    "gear": _SCALAR,
    **dict.fromkeys(("ctrllimited", "forcelimited"), _SWITCH),
    **dict.fromkeys(("ctrlrange", "forcerange"), Numbers(2)),
}
_ACTUATORS: Mapping[str, Attributes] = {"motor": {}, "position": {"kp": _SCALAR, "kv": _NOT_NEGATIVE}, "velocity": {"kv": _SCALAR}}
# Attributes of an option that bear on constraints alone.
SOLVER_OPTIONS: Attributes = {
    "timestep": Numbers(check=positive),
    "solver": Choice(("PGS", "CG", "Newton")),
    "iterations": Numbers(check=whole),
    "tolerance": Numbers(check=not_negative),
}
_IN_BODY: Mapping[str, Attributes] = {
    "body": {"name": _NAME, "childclass": _NAME, **_POSE},
    "frame": {"name": _NAME, "childclass": _NAME, **_POSE},
    "inertial": {**_POSE, "pos": Numbers(3, required=True), "mass": _MASS, "diaginertia": _VECTOR, "fullinertia": Numbers(6)},
    "joint": {"name": _NAME, **_JOINT},
    "freejoint": {"name": _NAME},
    "site": {"name": _NAME, "class": _NAME, **_POSE},
}

# mjMINVAL: MuJoCo refuses a moving body with less mass or principal inertia [kg, kg m^2], so an MJCF writes it where a URDF has 0.
LEAST = 1e-15

# format -> parts of its pipeline that can be switched off; the engine spends time on each
STAGES: Mapping[str, tuple[str, ...]] = {
    "mjcf": ("constraint", "contact", "actuation", "sensor", "gravity", "spring", "damper"),
    "urdf": (),
}
_FLAGS = (
    "autoreset clampctrl diagexact equality eulerdamp filterparent frictionloss island limit midphase multiccd nativeccd refsafe warmstart"
)

# format -> element that holds, as its tag or as its parent's and its own -> element held -> attributes
SUPPORTED: Mapping[str, Mapping[str, Mapping[str, Attributes]]] = {
    "mjcf": {
        "": {"mujoco": {"model": _NAME}},
        "mujoco": {
            "compiler": {
                "angle": Choice(("radian", "degree")),
                "eulerseq": Choice(
                    tuple(map("".join, itertools.chain(itertools.product("xyz", repeat=3), itertools.product("XYZ", repeat=3))))
                ),
                "fusestatic": Choice(("true", "false")),
            },
            "option": {"gravity": _VECTOR, **SOLVER_OPTIONS},
            "default": {"class": _NAME},
            "worldbody": NOTHING,
            "tendon": NOTHING,
            "equality": NOTHING,
            "actuator": NOTHING,
        },
        "option": {"flag": dict.fromkeys([*STAGES["mjcf"], *_FLAGS.split()], Choice(("enable", "disable")))},
        "worldbody": {tag: _IN_BODY[tag] for tag in ("body", "frame", "site")},
        "body": _IN_BODY,
        "frame": {tag: _IN_BODY[tag] for tag in ("body", "frame", "joint", "freejoint", "site")},
        "default": {"default": {"class": _NAME}, "joint": _JOINT, "site": _POSE, "tendon": _TENDON, "equality": _SOFTNESS},
        "default/tendon": {},
        "default/equality": {},
        "equality": {tag: {"name": _NAME, **_SOFTNESS, **own} for tag, own in _EQUALITY.items()},
        "equality/tendon": {},
        "actuator": {tag: {**_ACTUATOR, **own} for tag, own in _ACTUATORS.items()},
        "tendon": {"spatial": {"name": _NAME, **_TENDON}, "fixed": {"name": _NAME, **_TENDON}},
        "spatial": {"site": {"site": Text(required=True)}, "pulley": {"divisor": Numbers(check=positive, required=True)}},
        "fixed": {"joint": {"joint": Text(required=True), "coef": Numbers(required=True)}},
    },
    "urdf": {
        "": {"robot": {"name": _NAME, "version": _NAME}},
        "robot": {
            "link": {"name": _NAME},
            "joint": {
                "name": _NAME,
                "type": Choice(TYPES, required=True),
            },
            "gazebo": {"reference": _NAME},
            "transmission": {"name": _NAME, "type": _NAME},
            POINT_SPRING: NOTHING,
            BALL_CONSTRAINT: {"name": _NAME},
            "drake:joint": {"name": _NAME, "type": Choice(tuple(DRAKE_KINDS), required=True)},
        },
        "drake:joint": {"parent": {"link": _NAME}, "child": {"link": _NAME}},
        "link": {"inertial": NOTHING},
        "inertial": {
            "origin": {"xyz": _VECTOR, "rpy": _VECTOR},
            "mass": {"value": _MASS},
            "inertia": {name: Numbers(required=True) for name in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")},
        },
        "joint": {
            "parent": {"link": _NAME},
            "child": {"link": _NAME},
            "origin": {"xyz": _VECTOR, "rpy": _VECTOR},
            "axis": {"xyz": Numbers(3, required=True)},
            "limit": {"lower": _SCALAR, "upper": _SCALAR, "effort": _LIMIT, "velocity": _LIMIT},
            "dynamics": {"damping": _NOT_NEGATIVE, "friction": _NOT_NEGATIVE},
            "mimic": {"joint": Text(required=True), "multiplier": _SCALAR, "offset": _SCALAR},
        },
        "gazebo": {"springStiffness": {"": Numbers(required=True)}, "springReference": {"": Numbers(required=True)}},
        "transmission": {"type": {"": Text(required=True)}, "joint": {"name": _NAME}, "actuator": {"name": Text(required=True)}},
        "transmission/joint": {},
        "actuator": {tag: {"value": _LIMIT} for tag in ("drake:rotor_inertia", "drake:gear_ratio")},
        POINT_SPRING: {
            f"{POINT_SPRING}_body_A": {"name": _NAME},
            f"{POINT_SPRING}_p_AP": {"value": Numbers(3, required=True)},
            f"{POINT_SPRING}_body_B": {"name": _NAME},
            f"{POINT_SPRING}_p_BQ": {"value": Numbers(3, required=True)},
            f"{POINT_SPRING}_free_length": {"value": Numbers(check=positive, required=True)},
            f"{POINT_SPRING}_stiffness": {"value": _LIMIT},
            f"{POINT_SPRING}_damping": {"value": _LIMIT},
        },
        BALL_CONSTRAINT: {
            f"{BALL_CONSTRAINT}_body_A": {"name": _NAME},
            f"{BALL_CONSTRAINT}_p_AP": {"value": Numbers(3, required=True)},
            f"{BALL_CONSTRAINT}_body_B": {"name": _NAME},
            f"{BALL_CONSTRAINT}_p_BQ": {"value": Numbers(3, required=True)},
        },
    },
}

# format -> element path -> attributes that hold more than the table above can say
# Exporters write a zero axis into fixed joints, where it means nothing. A class inside another needs a name to be chosen by.
ALSO: Mapping[str, Mapping[str, Attributes]] = {
    "mjcf": {"default//default": {"class": Text(required=True)}},
    "urdf": {f"joint[@type='{kind}']/axis": {"xyz": _AXIS} for kind in OF_AXIS},
}

_SEEN = ("geom", "camera", "light")
_LOOKS = ("rgba", "material", "group", "width", "size", "user")
# format -> element that holds -> elements that are decoration in it
DECORATION: Mapping[str, Mapping[str, tuple[str, ...]]] = {
    "mjcf": {
        "mujoco": ("visual", "statistic", "asset", "custom"),
        "worldbody": _SEEN,
        "body": _SEEN,
        "frame": _SEEN,
        "default": (*_SEEN, "mesh", "material", "texture"),
    },
    "urdf": {
        "robot": ("material",),
        "link": ("visual", "collision"),
        "transmission/joint": ("hardwareInterface",),
        "actuator": ("hardwareInterface",),
    },
}
# format -> element -> attributes that are decoration
DECORATIVE_ATTRIBUTES: Mapping[str, Mapping[str, tuple[str, ...]]] = {
    "mjcf": dict.fromkeys(("site", "spatial", "fixed", "joint", "freejoint", "body", "tendon"), _LOOKS),
    "urdf": {},
}

_OF_GAZEBO, _OF_TRANSMISSION = ("springStiffness", "springReference"), ("joint", "actuator")
# format -> element path -> children of which readers silently take one, and children it cannot do without
CHILDREN: Mapping[str, Mapping[str, tuple[tuple[str, ...], tuple[str, ...]]]] = {
    "mjcf": {".//body": (("inertial",), ())},
    "urdf": {
        "link": (("inertial",), ()),
        "link/inertial": (("origin", "mass", "inertia"), ("mass", "inertia")),
        "joint": (("parent", "child", "origin", "axis", "limit", "dynamics", "mimic"), ("parent", "child")),
        "joint[@type='revolute']": ((), ("limit",)),
        "joint[@type='prismatic']": ((), ("limit",)),
        "gazebo": (_OF_GAZEBO, _OF_GAZEBO),
        "transmission": (("type", *_OF_TRANSMISSION), _OF_TRANSMISSION),
    },
}


def context_of(model_format: str, path: Sequence[str]) -> str:
    """The key of ``SUPPORTED`` for the element at ``path``, tags from the root down."""
    if not path:
        return ""
    pair = "/".join(path[-2:])
    return pair if pair in SUPPORTED[model_format] else path[-1]


def rules_at(model_format: str, path: Sequence[str]) -> Attributes | None:
    """Attributes of the element at ``path``, tags from the root down; None where it is not understood."""
    holders = ((SUPPORTED[model_format].get(context_of(model_format, path[:depth]), {}), tag) for depth, tag in enumerate(path))
    if any(tag not in known for known, tag in holders):
        return None
    return SUPPORTED[model_format][context_of(model_format, path[:-1])][path[-1]]
