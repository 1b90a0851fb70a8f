"""The lines of two files where the numbers of a cause differ, and what is set there for one to move as the other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path

import numpy as np
from lxml import etree

from harness.arrays import Array
from harness.comparison.robot_library import robot_at
from harness.drifts.plan import HeldSides, MovingSide, Plan
from harness.engines.moving import HeldNumbers, NumberKey
from harness.errors import InvalidModel
from harness.files.document.source import read_any
from harness.files.document.xml import Document
from harness.files.given import Given, every_number_in
from harness.results.cause import DriftCause
from harness.results.drift import SideDifference
from harness.results.table import number_text
from harness.trees.robot import Robot

# How an MJCF writes what an engine calls otherwise; by tag where that matters, the first one that the file has.
_GAINS = {"position": ("kp",), "velocity": ("kv",), "intvelocity": ("kp",), "damper": ("kv",), "general": ("gainprm",)}
_ATTRIBUTES: Mapping[str, Mapping[str, Sequence[str]]] = {
    "actuator_gainprm": _GAINS,
    "actuator_biasprm": {**_GAINS, "general": ("biasprm",)},
    "actuator_biasprm:2": {"general": ("biasprm",), "": ("kv", "dampratio")},
    "actuator_dynprm": {"position": ("timeconst",), "": ("dynprm",)},
    "jnt_actfrcrange": {"": ("actuatorfrcrange",)},
    "jnt_solref": {"": ("solreflimit",)},
    "jnt_solimp": {"": ("solimplimit",)},
    "dof_solref": {"": ("solreffriction",)},
    "dof_solimp": {"": ("solimpfriction",)},
    "body_inertia": {"": ("diaginertia", "fullinertia")},
    "body_ipos": {"": ("pos",)},
}
# A URDF has other words, and one attribute for each end of a range.
_OF_URDF = {"dof_damping": "damping", "dof_frictionloss": "friction", "jnt_range": "lower", "jnt_actfrcrange": "effort"}
_SECTIONS = {"jnt": "joint", "dof": "joint", "qpos": "joint", "qpos0": "joint", "geom": "geom", "body": "body", "eq": "equality"}
# Told by other numbers beside them.
_FOLLOW = ("limited", "aabb", "rbound", "conaffinity")
# Elements of an MJCF that stand below bodies.
_BELOW = {"joint": ("joint", "freejoint"), "geom": ("geom",), "body": ("body",), "site": ("site",)}


def differences_of(sides: tuple[MovingSide, MovingSide], held: HeldSides, plan: Plan) -> dict[DriftCause, list[SideDifference]]:
    """The differences of two sides by cause, with their lines; settings of the sides have values instead of lines."""
    files = tuple(FileLines(side.path) for side in sides)
    found: dict[DriftCause, list[SideDifference]] = {}
    for cause, keys in plan.differing.items():
        own = [_difference(files, (held.first, held.second), cause, key, sides) for key in keys]
        # Several numbers of an element are written as one.
        found[cause] = list(dict.fromkeys(one for one in own if one is not None))
    for cause, values in {
        DriftCause.DELAY: [f"{side.delay:g} s" for side in sides],
        DriftCause.DECIMATION: [f"{side.decimation} steps" for side in sides],
    }.items():
        if cause in plan.differing:
            absent = (not sides[0].delay, not sides[1].delay) if cause == DriftCause.DELAY else (False, False)
            found[cause] = [SideDifference(owner="", what=cause.value, first=values[0], second=values[1], is_absent=absent)]
    return found


class FileLines:
    """A file with the places of what an engine calls by its names."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._document: Document = read_any(path, "a model")

    @cached_property
    def _robot(self) -> Robot | None:
        """The robot of the file; None of one that engines alone read, of which lines are found all the same."""
        try:
            return robot_at(self.path)
        except InvalidModel:
            return None

    @property
    def is_urdf(self) -> bool:
        return str(self._document.root.tag) == "robot"

    def written(self, prefix: str, owner: str, array: str) -> tuple[str, str, str]:
        """The place of what an array holds of an owner, its attribute, and the text there; each "" where the file does not say it."""
        element = self._element(prefix, owner)
        tag = "" if element is None else str(element.tag)
        for attribute in self._attributes(array, tag):
            holder = self._holder(element, attribute)
            if holder is not None:
                return f"line {self._document.lines[holder]}", attribute, " ".join(str(holder.get(attribute)).split())
            numbers = [number for number in self._numbers(prefix, owner) if number.attribute == attribute]
            if numbers:
                ordered = sorted({number.index: number for number in numbers}.values(), key=lambda number: number.index)
                return numbers[0].place.within(self.path), attribute, " ".join(number_text(float(number)) for number in ordered)
        line = "" if element is None else f"line {self._document.lines[element]}"
        return line, self._attributes(array, tag)[0], ""

    def _attributes(self, array: str, tag: str) -> Sequence[str]:
        if self.is_urdf:
            return (_OF_URDF.get(array, array),)
        by_tag: Mapping[str, Sequence[str]] = _ATTRIBUTES.get(array, {})
        return by_tag.get(tag) or by_tag.get("") or (array.partition(":")[0].partition("_")[2] or array,)

    def _numbers(self, prefix: str, owner: str) -> list[Given]:
        """The numbers of the harness's tree that are of an owner; of none where it has no such one."""
        if self._robot is None:
            return []
        tree, name = self._robot.tree, owner.partition("[")[0]
        of_joints = [joint for joint in tree.joints if joint.name == name] if prefix in ("jnt", "dof", "qpos", "qpos0") else []
        of_actuators = [one for one in self._robot.actuators if _called(one.name, "actuator", one.number) == owner]
        parts: Sequence[object] = of_joints or (of_actuators if prefix == "actuator" else [])
        if prefix == "jnt" and self.is_urdf:
            parts = [*parts, *(limits for joint, limits in self._robot.force_limits if joint == name)]
        return [number for part in parts for number in every_number_in(_fields(part))]

    def _element(self, prefix: str, owner: str) -> etree._Element | None:
        root, name = self._document.root, owner.partition("[")[0]
        if prefix in ("opt", "flag"):
            return root.find("option" if prefix == "opt" else "option/flag")
        section = _SECTIONS.get(prefix, prefix)
        if section in _BELOW:
            elements = [one for one in root.iter(*_BELOW[section]) if not any(above.tag == "default" for above in one.iterancestors())]
        else:
            elements = [one for part in root.iterfind(section) for one in part]
        named = [one for one in elements if one.get("name") == name]
        if named:
            return named[0]
        unnamed = [one for number, one in enumerate(elements) if _called("", section, number) == name.partition(" of ")[0]]
        return unnamed[0] if unnamed and not unnamed[0].get("name") else None

    def _holder(self, element: etree._Element | None, attribute: str) -> etree._Element | None:
        """The element that has an attribute: this one, or that of its default class."""
        if element is None or attribute in element.attrib:
            return element
        above = next((one.get("childclass") for one in element.iterancestors() if one.get("childclass")), None)
        wanted = element.get("class") or above
        classes = [one for one in self._document.root.iter("default") if one.get("class") == wanted] if wanted else []
        chain = [*classes, *(one for found in classes for one in found.iterancestors("default"))] or self._document.root.findall("default")
        holders = [holder for one in chain for holder in one.iterfind(str(element.tag))]
        return next((holder for holder in holders if attribute in holder.attrib), None)


def _called(name: str, section: str, number: int) -> str:
    return name or f"{section} {number}"


def _fields(part: object) -> object:
    return part if isinstance(part, tuple) else tuple(vars(part).values())


def _difference(
    files: Sequence[FileLines],
    held: tuple[HeldNumbers, HeldNumbers],
    cause: DriftCause,
    key: NumberKey,
    sides: tuple[MovingSide, MovingSide],
) -> SideDifference | None:
    array, owner = key
    prefix, _, name = array.partition("_")
    if name in _FOLLOW:
        return None
    values = [numbers[cause].get(key) if cause in numbers.by_cause else None for numbers in held]
    if any(value is None for value in values):
        if name != _FIRST.get(prefix):
            return None
        has = [any(key in numbers for numbers in one.by_cause.values()) for one in held]
        texts = ["present" if there else "absent" for there in has]
        lines = [file.written(prefix, owner, array)[0] if there else "" for file, there in zip(files, has, strict=True)]
        return SideDifference(
            owner="", what=_named(prefix, owner), first=texts[0], second=texts[1], first_place=lines[0], second_place=lines[1]
        )
    places = [file.written(prefix, owner, array) for file in files]
    compiled = [_compiled(array, value, numbers) for value, numbers in zip(values, held, strict=True)]
    texts = [text or own for (_, _, text), own in zip(places, compiled, strict=True)]
    if texts[0] == texts[1]:
        # The files say the same, of which engines make other numbers.
        says = [text if prefix not in ("opt", "flag") else "" for text in texts]
        texts = [f"{text}, compiled as {own}" if text and text != own else own for text, own in zip(says, compiled, strict=True)]
    attributes = [attribute for _, attribute, text in places if text]
    what = attributes[0] if attributes else places[0][1]
    is_set_by_side = prefix == "opt" and any(getattr(side, {"timestep": "length"}.get(name, name), None) for side in sides)
    # A switch that no file says is the engine's, which applies no more.
    can_be_said = bool(places[0][2]) or not places[1][2] if prefix != "flag" else bool(places[1][2])
    remedy = "" if is_set_by_side or sides[0].path == sides[1].path or not can_be_said else f'{what}="{texts[0]}"'
    return SideDifference(
        owner=_named(prefix, owner),
        what=what,
        first=texts[0],
        second=texts[1],
        first_place="" if is_set_by_side else places[0][0],
        second_place="" if is_set_by_side else places[1][0],
        is_absent=(_is_absent(array, values[0]), _is_absent(array, values[1])),
        remedy=remedy,
    )


# The number by which an owner that one file alone has is told once.
_FIRST = {"body": "mass", "jnt": "type", "geom": "type", "actuator": "gear", "eq": "type", "tendon": "range", "site": "pos"}


def _named(prefix: str, owner: str) -> str:
    section = _SECTIONS.get(prefix, prefix)
    return "" if not owner else owner if owner.startswith(f"{section} ") else f"{section} {owner}"


def _is_absent(array: str, value: Array | None) -> bool:
    """True for a number that acts by its size, or a switch, that is off."""
    grows = array.partition(":")[0].endswith(("damping", "frictionloss", "armature", "stiffness", "biasprm", "gainprm"))
    return value is not None and not np.any(value) and (grows or array.startswith("flag"))


def _compiled(array: str, value: Array | None, numbers: HeldNumbers) -> str:
    assert value is not None
    if array in numbers.words:
        return numbers.words[array].get(int(value[0]), str(int(value[0])))
    if array.startswith("flag"):
        return "on" if value[0] else "off"
    if array == "actuator_biasprm:2":
        return number_text(-float(value[0]) + 0.0)
    last = np.flatnonzero(value)
    shown = value if array.startswith(("opt", "jnt", "body", "geom")) else value[: int(last[-1]) + 1 if len(last) else 1]
    return " ".join(number_text(float(number)) for number in shown)
