"""What the elements of a model file may hold, as data: attribute tables for MJCF and URDF.

Element paths are lxml's ElementPath, from the root. Numbers are decimal and finite: what strtod reads
beyond that (hexadecimal, nan, inf) engines take in silence and answer with NaN.

Sources: MuJoCo 4 XML schema (mj_printSchema); http://wiki.ros.org/urdf/XML; for inertia, Featherstone,
Rigid Body Dynamics Algorithms, section 2.13, and Wensing, Kim, Slotine, IEEE RA-L 3(1), 2018.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from lxml import etree

from harness.library import nearest
from harness.model_xml import Document, describe, literal_tag, shorten

UNIT_TOLERANCE = 1e-6
# Relative to the largest moment; eigenvalues of an exact inertia are off by a few 1e-16.
INERTIA_SLACK = 1e-12
_NUMBER = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_SPACE = re.compile(r"[ \t\r\n]+")

Check = Callable[[tuple[float, ...]], str | None]


def not_negative(values: tuple[float, ...]) -> str | None:
    """A check: zero or more."""
    return "is negative; expected zero or more" if min(values) < 0 else None


def positive(values: tuple[float, ...]) -> str | None:
    """A check: more than zero."""
    return "is not positive; expected more than zero" if min(values) <= 0 else None


def _not_zero(values: tuple[float, ...]) -> str | None:
    return None if any(values) else "is zero; expected a direction or rotation"


def _unit(values: tuple[float, ...]) -> str | None:
    length = math.hypot(*values)
    if length == 0:
        return "is zero; expected a unit vector"
    return None if abs(length - 1) <= UNIT_TOLERANCE else f"has length {length:.6g}; expected a unit vector"


def _no_dry_friction(values: tuple[float, ...]) -> str | None:
    return "is dry friction, which the smooth equations of motion cannot hold; remove it" if any(values) else None


@dataclass(frozen=True)
class Numbers:
    """A list of ``fewest`` to ``most`` (default: ``fewest``) finite numbers that passes ``check``."""

    fewest: int = 1
    most: int | None = None
    check: Check | None = None
    required: bool = False

    def read(self, text: str) -> tuple[float, ...]:
        """The numbers in ``text``; ValueError says what is wrong and what was expected."""
        words = _SPACE.split(text.strip(" \t\r\n")) if text.strip(" \t\r\n") else []
        values = []
        for word in words:
            value = float(word) if _NUMBER.fullmatch(word) else math.nan
            if not math.isfinite(value):
                raise ValueError(f"contains {shorten(word)!r}; expected a finite decimal number")
            values.append(value)
        most = self.fewest if self.most is None else self.most
        if not self.fewest <= len(values) <= most:
            expected = f"{self.fewest}" if most == self.fewest else f"{self.fewest} to {most}"
            raise ValueError(f"holds {len(values)} numbers; expected {expected}")
        complaint = self.check(tuple(values)) if self.check else None
        if complaint:
            raise ValueError(complaint)
        return tuple(values)


@dataclass(frozen=True)
class Choice:
    """One word out of ``options``."""

    options: tuple[str, ...]
    required: bool = False

    def read(self, text: str) -> str:
        """``text`` itself; ValueError names the nearest option."""
        if text not in self.options:
            raise ValueError(f"is unknown; {nearest(shorten(text), self.options)}")
        return text


Attributes = Mapping[str, Numbers | Choice]
_SCALAR, _VECTOR = Numbers(), Numbers(3)
_AXIS = Numbers(3, check=_unit)
_MASS = Numbers(check=not_negative, required=True)
_POSE: Attributes = MappingProxyType(
    {
        "pos": _VECTOR,
        "quat": Numbers(4, check=_not_zero),
        "axisangle": Numbers(4),
        "euler": _VECTOR,
        "xyaxes": Numbers(6),
        "zaxis": Numbers(3, check=_not_zero),
    }
)
_TENDON: Attributes = MappingProxyType(
    {
        "stiffness": Numbers(1, 3),
        "damping": Numbers(1, 3),
        "springlength": Numbers(1, 2),
        "armature": Numbers(check=not_negative),
        "frictionloss": Numbers(check=_no_dry_friction),
    }
)
_INERTIA = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")

# format -> element path -> attribute -> what it holds
ATTRIBUTES: Mapping[str, Mapping[str, Attributes]] = {
    "mjcf": {
        "compiler": {
            "angle": Choice(("radian", "degree")),
            "boundmass": _SCALAR,
            "boundinertia": _SCALAR,
            "settotalmass": _SCALAR,
        },
        "option": {
            "gravity": _VECTOR,
            "wind": _VECTOR,
            "magnetic": _VECTOR,
            "density": Numbers(check=not_negative),
            "viscosity": Numbers(check=not_negative),
            "timestep": Numbers(check=positive),
        },
        ".//body": {**_POSE, "gravcomp": _SCALAR},
        ".//frame": _POSE,
        ".//site": _POSE,
        ".//inertial": {**_POSE, "pos": Numbers(3, required=True), "mass": _MASS, "diaginertia": _VECTOR, "fullinertia": Numbers(6)},
        ".//joint": {
            "type": Choice(("hinge", "slide", "ball", "free")),
            "pos": _VECTOR,
            "axis": _AXIS,
            "stiffness": Numbers(1, 3),
            "damping": Numbers(1, 3),
            "springref": _SCALAR,
            "springdamper": Numbers(2),
            "ref": _SCALAR,
            "range": Numbers(2),
            "armature": Numbers(check=not_negative),
            "frictionloss": Numbers(check=_no_dry_friction),
        },
        ".//spatial": _TENDON,
        ".//fixed": _TENDON,
        ".//default/tendon": _TENDON,
        ".//fixed/joint": {"coef": _SCALAR},
    },
    "urdf": {
        "link/inertial/origin": {"xyz": _VECTOR, "rpy": _VECTOR},
        "link/inertial/mass": {"value": _MASS},
        "link/inertial/inertia": {name: Numbers(required=True) for name in _INERTIA},
        "joint": {"type": Choice(("revolute", "prismatic", "continuous", "fixed", "floating", "planar"), required=True)},
        "joint/origin": {"xyz": _VECTOR, "rpy": _VECTOR},
        "joint/axis": {"xyz": Numbers(3, required=True)},
        # Exporters write a zero axis into fixed joints, where it means nothing.
        **{f"joint[@type='{kind}']/axis": {"xyz": _AXIS} for kind in ("revolute", "prismatic", "continuous", "planar")},
        "joint/limit": {
            "lower": _SCALAR,
            "upper": _SCALAR,
            "effort": Numbers(check=not_negative, required=True),
            "velocity": Numbers(check=not_negative, required=True),
        },
        "joint/dynamics": {"damping": Numbers(check=not_negative), "friction": Numbers(check=_no_dry_friction)},
    },
}

# format -> element path -> children it cannot do without
REQUIRED: Mapping[str, Mapping[str, tuple[str, ...]]] = {
    "mjcf": {},
    "urdf": {
        "joint": ("parent", "child"),
        "joint[@type='revolute']": ("limit",),
        "joint[@type='prismatic']": ("limit",),
        "link/inertial": ("mass", "inertia"),
    },
}

# format -> element path -> children of which readers silently take one
AT_MOST_ONE: Mapping[str, Mapping[str, tuple[str, ...]]] = {
    "mjcf": {".//body": ("inertial",)},
    "urdf": {
        "link": ("inertial",),
        "link/inertial": ("origin", "mass", "inertia"),
        "joint": ("parent", "child", "origin", "axis", "limit", "dynamics"),
        "gazebo": ("springStiffness", "springReference"),
    },
}

_MAKES_BODIES = "makes bodies and joints that this file does not spell out; write them out"
# format -> tag as written -> why it is refused wherever it stands
REFUSED: Mapping[str, Mapping[str, str]] = {
    "mjcf": {
        "include": "reads another file, which some readers ignore in silence; copy its content here",
        "replicate": _MAKES_BODIES,
        "attach": _MAKES_BODIES,
        "composite": _MAKES_BODIES,
        "flexcomp": _MAKES_BODIES,
    },
    "urdf": {"drake:linear_bushing_rpy": "is a force element that is not read; use joint springs and drake:linear_spring_damper"},
}


def check_elements(document: Document, model_format: str) -> None:
    """Hold ``document`` against the tables above.

    Raises:
        InvalidModel: at the line of the first element that does not fit.
    """
    root = document.root
    reasons = REFUSED[model_format]
    for element in root.iter("*"):
        if literal_tag(element) in reasons:
            document.refuse(element, f"<{literal_tag(element)}> {reasons[literal_tag(element)]}")
    for path, children in AT_MOST_ONE[model_format].items():
        for element in root.iterfind(path):
            for tag in children:
                for repeated in element.findall(tag)[1:]:
                    document.refuse(repeated, f"second <{tag}> in {describe(element)}; expected one, keep the right one")
    for path, children in REQUIRED[model_format].items():
        for element in root.iterfind(path):
            for tag in children:
                if element.find(tag) is None:
                    document.refuse(element, f"{describe(element)} has no <{tag}>; add it")
    for path, attributes in ATTRIBUTES[model_format].items():
        for element in root.iterfind(path):
            for name, rule in attributes.items():
                check_attribute(document, element, name, rule)


def check_attribute(document: Document, element: etree._Element, name: str, rule: Numbers | Choice) -> None:
    """Refuse attribute ``name`` of ``element`` where it is missing but required, or not what ``rule`` expects.

    Raises:
        InvalidModel: at the line of ``element``.
    """
    text = element.get(name)
    if text is None:
        if rule.required:
            document.refuse(element, f"{describe(element)} has no attribute {name!r}; add it")
        return
    try:
        rule.read(text)
    except ValueError as complaint:
        document.refuse(element, f'{describe(element)} {name}="{shorten(text)}" {complaint}')


def numbers(document: Document, element: etree._Element, name: str, rule: Numbers) -> tuple[float, ...]:
    """The numbers of an attribute that must be there; raises InvalidModel where they are not."""
    check_attribute(document, element, name, replace(rule, required=True))
    return rule.read(element.get(name))


def check_inertia(document: Document, element: etree._Element, ixx: float, iyy: float, izz: float, *products: float) -> None:
    """Refuse moments of inertia no mass distribution has: the principal ones must be A, B, C >= 0, A + B >= C.

    ``products`` are the off-diagonal elements Ixy, Ixz, Iyz [kg m^2] of the inertia matrix, 0 if left out.

    Raises:
        InvalidModel: at the line of ``element``.
    """
    ixy, ixz, iyz = products or (0.0, 0.0, 0.0)
    matrix = np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]])
    largest = float(np.abs(matrix).max())
    if largest == 0:
        return
    low, middle, high = (float(moment) for moment in np.linalg.eigvalsh(matrix / largest))
    shown = ", ".join(f"{moment * largest:.6g}" for moment in (low, middle, high))
    if low < -INERTIA_SLACK:
        document.refuse(element, f"{describe(element)} has principal moments of inertia {shown}; expected none below zero")
    if low + middle < high - INERTIA_SLACK:
        document.refuse(
            element, f"{describe(element)} has principal moments of inertia {shown}; expected the two smaller to sum to the largest or more"
        )
