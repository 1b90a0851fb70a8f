"""Options of an MJCF that bear on all of it.

Source: MuJoCo documentation, XML reference, ``compiler``, ``option`` and ``option/flag``.
"""

from __future__ import annotations

from lxml import etree

# What MuJoCo takes without an option.
GRAVITY = (0.0, 0.0, -9.81)
# The attributes of which one gives a frame its orientation.
ORIENTATIONS = ("quat", "axisangle", "euler", "xyaxes", "zaxis")


def in_degrees(root: etree._Element) -> bool:
    """True where the file's angles are in degrees, as they are where it does not say."""
    return [compiler.get("angle") for compiler in root.iterfind("compiler[@angle]")][-1:] != ["radian"]


def is_on(root: etree._Element, stage: str) -> bool:
    """False where a stage of MuJoCo's pipeline, like "spring", is switched off."""
    return [flag.get(stage) for flag in root.iterfind("option/flag") if stage in flag.attrib][-1:] != ["disable"]


def gravity(root: etree._Element) -> tuple[float, float, float]:
    """The gravity that an MJCF states, (x, y, z) [m/s^2]; zero where it is switched off."""
    if not is_on(root, "gravity"):
        return 0.0, 0.0, 0.0
    written = [option.get("gravity") for option in root.iterfind("option[@gravity]")]
    x, y, z = map(float, written[-1].split()) if written else GRAVITY
    return x, y, z
