"""URDF elements that MuJoCo's reader passes over, supplied to its ``MjSpec`` before compilation; MuJoCo then computes them.

The reader gives bodies, joints, inertias and ``<dynamics damping>``. From the same file are added: springs in joints and
between points (as tendons), reflected inertias and a ball joint at the root. The harness gives gravity, switches off the
constraints that joint limits would be, and takes out what the file's decoration has become. MuJoCo's compiler refuses a
moving body without mass or with a principal inertia of zero, which a URDF may have and whose least substitute a light
mechanism feels: such a body is compiled with the least that it accepts, and then has its own mass and inertia written back.

Source: MuJoCo documentation, Modeling, section URDF extensions, and Programming, section Model editing.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from lxml import etree

from harness.engines import Unsupported
from harness.models.formats import LEAST
from harness.models.model_file import ROOT_TAGS, JointSpring, ModelFile, PointSpring
from harness.models.xml import Document, describe, literal_tag, parse_document

# mjEPS: the principal inertia below which MuJoCo refuses the six numbers of an inertia matrix, though not the three principal ones.
LEAST_OF_SIX = 1e-14
# A principal inertia is zero where it is no more than the rounding of the largest.
ROUNDING = 8 * 2.0**-53
_WITHOUT_DECORATION = "[s.delete(part) for part in [*s.geoms, *s.meshes, *s.materials, *s.textures]]"


@dataclass(frozen=True)
class Edit:
    """One change of an ``MjSpec``.

    Attributes:
        kind: "option", "compiler", "joint" or "body", or "" for the whole; name: of the joint or body.
        values: attributes with their values.
        added: "site", "joint" or "tendon" where one with these values is added, "" where they are set.
        wrapped: sites through which an added tendon runs.
    """

    kind: str
    name: str
    values: dict[str, Any]
    added: str = ""
    wrapped: tuple[str, ...] = ()

    def apply(self, spec: Any) -> None:
        """Change ``spec``."""
        target = getattr(spec, self.kind) if self.kind else spec
        target = target(self.name) if self.name else target
        if self.added:
            part = getattr(target, f"add_{self.added}")(**self.values)
            for site in self.wrapped:
                part.wrap_site(site)
        else:
            for name, value in self.values.items():
                setattr(target, name, value)

    def __str__(self) -> str:
        """The same as Python text, for the spec ``s``."""
        target = "s" + (f".{self.kind}" if self.kind else "") + (f"({self.name!r})" if self.name else "")
        if not self.added:
            return "; ".join(f"{target}.{name} = {_text(value)}" for name, value in self.values.items())
        added = f"{target}.add_{self.added}({', '.join(f'{name}={_text(value)}' for name, value in self.values.items())})"
        return f"t = {added}" + "".join(f"; t.wrap_site({site!r})" for site in self.wrapped) if self.wrapped else added


def _text(value: Any) -> str:
    import mujoco

    if isinstance(value, list):
        return f"[{', '.join(map(_text, value))}]"
    if isinstance(value, float):
        return "float('nan')" if math.isnan(value) else repr(value).removesuffix(".0")
    return f"mujoco.{value}" if isinstance(value, mujoco.mjtJoint) else repr(value)


@dataclass(frozen=True)
class WrittenBack:
    """The mass or inertia that the file gives a body which was compiled with more.

    Attributes:
        body: its name. attribute: "mass" [kg], or "inertia" [kg m^2], whose ``place`` is that of the principal axis.
    """

    body: str
    attribute: str
    place: int
    value: float

    def apply(self, model: Any) -> None:
        """Change the compiled ``model``, whose derived constants are then out of date."""
        getattr(model.body(self.body), self.attribute)[self.place] = self.value

    def __str__(self) -> str:
        """The same as Python text, for the model ``m``."""
        return f"m.body({self.body!r}).{self.attribute}[{self.place}] = {_text(self.value)}"


def read(file: ModelFile, gravity: float) -> tuple[Any, str]:
    """The compiled ``mujoco.MjModel``, and Python text that makes it, ``m``, of the ``mujoco.MjSpec`` that the reader gives, ``s``.

    Raises:
        Unsupported: the file holds what the reader takes otherwise than other readers, or the reader refuses it.
    """
    import mujoco

    document = parse_document(file.path, file.text, ROOT_TAGS["urdf"])
    refused = sorted((document.lines[element], f"{describe(element)} {why}") for element, why in _ignored(document.root))
    if refused:
        raise Unsupported("MuJoCo's URDF reader: " + "; ".join(f"line {line}: {what}" for line, what in refused))
    try:
        spec = mujoco.MjSpec.from_string(file.text)
        decoration = [*spec.geoms, *spec.meshes, *spec.materials, *spec.textures]
        for part in decoration:
            spec.delete(part)
        changes = tuple(_changes(spec, file, document, gravity))
        edits = [change for change in changes if isinstance(change, Edit)]
        for edit in edits:
            edit.apply(spec)
        model = spec.compile()
    except ValueError as error:
        raise Unsupported(f"MuJoCo's URDF reader refuses it: {' '.join(str(error).split())}") from error
    written_back = [change for change in changes if isinstance(change, WrittenBack)]
    for change in written_back:
        change.apply(model)
    text = [*([_WITHOUT_DECORATION] if decoration else []), *map(str, edits), "m = s.compile()", *map(str, written_back)]
    if written_back:
        mujoco.mj_setConst(model, mujoco.MjData(model))
        text.append("mujoco.mj_setConst(m, mujoco.MjData(m))")
    return model, "; ".join(text)


def _ignored(root: etree._Element) -> Iterator[tuple[etree._Element, str]]:
    carried = {joint.find("child").get("link"): joint for joint in root.iterfind("joint")}
    if "world" in carried:
        yield carried["world"], "carries the link 'world', which MuJoCo takes for the world itself; give it another name"
    for joint in root.iterfind("joint"):
        if joint.get("type") == "planar":
            yield joint, "is planar, for which MuJoCo makes three joints of other names; write them out"
        if joint.get("type") == "floating":
            above: etree._Element | None = joint
            while above is not None:
                origin = above.find("origin")
                if origin is not None and any(float(word) for text in origin.attrib.values() for word in text.split()):
                    where = "" if above is joint else f" behind {describe(above)}"
                    yield joint, f"floats from another origin than the world's{where}, from which MuJoCo counts its position; remove it"
                    break
                above = carried.get(above.find("parent").get("link"))


def _changes(spec: Any, file: ModelFile, document: Document, gravity: float) -> Iterator[Edit | WrittenBack]:
    import mujoco

    flags = mujoco.mjtDisableBit
    off = (flags.mjDSBL_CONSTRAINT, flags.mjDSBL_CONTACT, flags.mjDSBL_ACTUATION, flags.mjDSBL_SENSOR, flags.mjDSBL_AUTORESET)
    yield Edit("option", "", {"gravity": [0.0, 0.0, -gravity], "disableflags": sum(int(flag) for flag in off)})
    root_of_ball = None
    if file.ball_joint is not None:
        (joint,) = (element for element in document.root.iterchildren("*") if literal_tag(element) == "drake:joint")
        root_of_ball = str(joint.find("child").get("link"))
        yield Edit("body", root_of_ball, {"name": file.ball_joint, "type": mujoco.mjtJoint.mjJNT_BALL}, added="joint")
    written_back: list[WrittenBack] = []
    for body in spec.bodies:
        if body.explicitinertial and body.name != "world":
            for change in _accepted_inertia(body, moves=bool(body.joints) or body.name == root_of_ball):
                written_back += [change] if isinstance(change, WrittenBack) else []
                yield change
    if _has_fixed_child(document.root, {change.body for change in written_back}):
        # Links fused into such a body would be indistinguishable from it.
        yield Edit("compiler", "", {"fusestatic": False})
    for armature in file.armatures:
        yield Edit("joint", armature.joint, {"armature": armature.reflected_inertia})
    for number, element in enumerate(file.force_elements):
        if isinstance(element, JointSpring):
            yield Edit("joint", element.joint, {"stiffness": [element.stiffness, 0.0, 0.0], "springref": element.reference})
        elif isinstance(element, PointSpring):
            yield from _tendon(element, f"spring {number}")


def _tendon(spring: PointSpring, name: str) -> Iterator[Edit]:
    ends = ((f"{name} A", spring.body_a, spring.point_a), (f"{name} B", spring.body_b, spring.point_b))
    for site, body, point in ends:
        yield Edit("body", body, {"name": site, "pos": list(point)}, added="site")
    values = {
        "name": name,
        "stiffness": [spring.stiffness, 0.0, 0.0],
        "damping": [spring.damping, 0.0, 0.0],
        "springlength": [spring.free_length] * 2,
    }
    yield Edit("", "", values, added="tendon", wrapped=tuple(site for site, _, _ in ends))


def _has_fixed_child(root: etree._Element, links: Collection[str]) -> bool:
    return any(joint.get("type") == "fixed" and joint.find("parent").get("link") in links for joint in root.iterfind("joint"))


def _accepted_inertia(body: Any, moves: bool) -> Iterator[Edit | WrittenBack]:
    """Principal inertias for a body whose matrix MuJoCo refuses; where a moving one has too little, the least, to be written back."""
    import mujoco

    mass = float(body.mass)
    xx, yy, zz, xy, xz, yz = (0.0 if np.isnan(body.fullinertia[0]) else float(number) for number in body.fullinertia)
    moments, axes, rounding = np.array([xx, yy, zz]), np.eye(3), 0.0
    if xy or xz or yz:
        moments, axes = np.linalg.eigh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        rounding = ROUNDING * float(moments.max())
    if moments.min() >= LEAST_OF_SIX and not (moves and mass < LEAST):
        return
    own = [0.0 if moment <= rounding else moment for moment in moments.tolist()]
    # The rounding of the axes must not make the two larger moments differ by more than the least one.
    compiled = [max(moment, LEAST, rounding) if moves else moment for moment in own]
    turn, quaternion = np.empty(4), np.empty(4)
    mujoco.mju_mat2Quat(turn, (axes * np.sign(np.linalg.det(axes))).ravel())
    mujoco.mju_mulQuat(quaternion, body.iquat, turn)
    orientation = {"iquat": quaternion.tolist()} if rounding else {}
    least_mass = {"mass": LEAST} if moves and mass < LEAST else {}
    yield Edit("body", body.name, {**least_mass, "fullinertia": [math.nan, *[0.0] * 5], "inertia": compiled, **orientation})
    if least_mass:
        yield WrittenBack(body.name, "mass", 0, mass)
    for place, (moment, given) in enumerate(zip(own, compiled, strict=True)):
        if moment != given:
            yield WrittenBack(body.name, "inertia", place, moment)
