"""Elements and attributes that are refused, with the reason: data for ``harness.files.lint.checks``.

Each is something that some engine reads and another ignores, that adds forces or states of its own, or
that no acceleration feels.
"""

from __future__ import annotations

from collections.abc import Mapping

_MAKES_BODIES = "makes bodies and joints that this file does not spell out; write them out"
_CONSTRAINT = "is a constraint, which the smooth equations of motion cannot hold; remove it"
_LIMIT = "is a limit: a constraint the smooth equations cannot hold, and without constraints nothing feels it; remove it"
_NOT_FELT = "is not felt by any acceleration; remove it"
_FLUID = "is a fluid around the mechanism, which the equations of motion do not hold; remove it"
_DEFORMS = "is deformable; the harness compares rigid bodies"
_OF_ACTUATORS = "belongs to actuators, which the harness does not use; remove it"
_CHANGES_MASS = "changes masses or inertias behind the <inertial> elements; remove it and write them there"
_MESHES = "is for meshes; write their paths out in full"
_CODE = "runs code that this file does not spell out; remove it"
_AT_ZERO = "takes one of its points from the zero position, where a loop need not be closed; write site1 and site2"
_NO_PART = "computes what no acceleration needs, or changes what is computed; remove it"

# format -> element, or parent/element -> why it is refused
ELEMENTS: Mapping[str, Mapping[str, str]] = {
    "mjcf": {
        "include": "reads another file, which some readers ignore in silence; copy its content here",
        **dict.fromkeys(("replicate", "attach", "composite", "flexcomp"), _MAKES_BODIES),
        **dict.fromkeys(("deformable", "flex", "skin"), _DEFORMS),
        **dict.fromkeys(("extension", "plugin"), _CODE),
        "actuator": "adds forces of its own; the harness applies tau at the joints, remove it",
        **dict.fromkeys(("sensor", "size", "lengthrange"), _NOT_FELT),
        **dict.fromkeys(("flexvert", "flexstrain"), _DEFORMS),
        "distance": "is a constraint that MuJoCo knows no more; write a <spatial> tendon between the sites, and <tendon> in <equality>",
        "contact": _CONSTRAINT,
        "keyframe": "holds states, which the harness chooses; remove it",
        "spatial/geom": "wraps the tendon around a geom, which is not understood; lead it through sites",
    },
    "urdf": {
        "drake:linear_bushing_rpy": "is a force element that is not read; use joint springs and drake:linear_spring_damper",
        **dict.fromkeys(("safety_controller", "calibration"), _NOT_FELT),
        "mechanicalReduction": "is not read as a reflected inertia; write the ratio as <drake:gear_ratio>",
        "sensor": _NOT_FELT,
    },
}
# format -> element@attribute, or @attribute for every element -> why it is refused
ATTRIBUTES: Mapping[str, Mapping[str, str]] = {
    "mjcf": {
        **dict.fromkeys(("option@density", "option@viscosity", "option@wind"), _FLUID),
        **dict.fromkeys(("joint@range", "joint@limited", "joint@margin", "joint@solreflimit", "joint@solimplimit"), _LIMIT),
        **dict.fromkeys((f"{tag}@{name}" for tag in ("spatial", "fixed", "tendon") for name in ("range", "limited", "margin")), _LIMIT),
        **dict.fromkeys(("joint@actuatorfrcrange", "joint@actuatorfrclimited", "joint@actuatorgravcomp"), _OF_ACTUATORS),
        "option@integrator": _NOT_FELT,
        **dict.fromkeys((f"{tag}@{name}" for tag in ("connect", "weld") for name in ("body1", "body2", "anchor")), _AT_ZERO),
        "weld@relpose": _AT_ZERO,
        "joint@springdamper": "makes a stiffness and a damping that this file does not spell out; write those",
        "@springyield": "lets a spring yield, which the equations of motion do not hold; remove it",
        "body@gravcomp": "takes gravity away from one body, which other readers ignore; remove it",
        "body@mocap": "lets the body be moved from outside; remove it",
        "body@sleep": "stops the body by itself; remove it",
        **dict.fromkeys(
            (f"compiler@{name}" for name in ("boundmass", "boundinertia", "balanceinertia", "settotalmass", "inertiafromgeom")),
            _CHANGES_MASS,
        ),
        **dict.fromkeys(("compiler@alignfree", "freejoint@align"), "turns the frame of a free body; remove it"),
        **dict.fromkeys(("compiler@meshdir", "compiler@texturedir", "compiler@assetdir", "compiler@strippath"), _MESHES),
        **dict.fromkeys(
            (f"flag@{name}" for name in ("energy", "fwdinv", "invdiscrete", "ipc", "override", "sleep", "speculative")),
            _NO_PART,
        ),
    },
    "urdf": {},
}
# What nothing above names: why it is refused, by the element that holds it or by its prefix.
ELSEWHERE: Mapping[str, Mapping[str, str]] = {
    "mjcf": {"option@": _NOT_FELT, "compiler@": _NOT_FELT},
    "urdf": {"drake:": "is a Drake extension that is not read; remove it", "gazebo": "is a Gazebo extension that is not read; remove it"},
}
