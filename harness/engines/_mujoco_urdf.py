"""What MuJoCo's URDF reader passes over, supplied to its ``MjSpec`` before compilation; MuJoCo then computes it.

The reader gives bodies, joints, inertias and ``<dynamics damping>``. From the same file are added: springs in joints and
between points (as tendons), reflected inertias and a ball joint at the root. The harness gives gravity, switches off the
constraints that joint limits would be, and takes out what the file's decoration has become. MuJoCo refuses a moving body
without mass or with a principal inertia of zero, which a URDF may have: such a body gets the least that it accepts.

Source: MuJoCo documentation, Modeling, section URDF extensions, and Programming, section Model editing.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from lxml import etree

from harness.engines import Unsupported
from harness.model_xml import Document, describe, literal_tag, parse_document
from harness.models import ROOT_TAGS, JointSpring, ModelFile, PointSpring

# mjMINVAL: MuJoCo refuses a moving body with less mass or inertia.
LEAST = 1e-15
# mjEPS: the principal inertia below which it refuses the six numbers of an inertia matrix, though not the three principal ones.
LEAST_OF_SIX = 1e-14
# A principal inertia is zero where it is no more than the rounding of the largest.
ROUNDING = 8 * 2.0**-53
WITHOUT_DECORATION = "[s.delete(part) for part in [*s.geoms, *s.meshes, *s.materials, *s.textures]]"


@dataclass(frozen=True)
class Edit:
    """One change of an ``MjSpec``.

    Attributes:
        kind: "option", "joint" or "body", or "" for the whole; name: of the joint or body.
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

    return f"mujoco.{value}" if isinstance(value, mujoco.mjtJoint) else repr(value).replace("nan", "float('nan')")


def read(file: ModelFile, gravity: float) -> tuple[Any, tuple[Edit, ...]]:
    """The compiled ``mujoco.MjModel``, and what was changed in the spec that the reader gave, beside ``WITHOUT_DECORATION``.

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
        for part in [*spec.geoms, *spec.meshes, *spec.materials, *spec.textures]:
            spec.delete(part)
        edits = tuple(_edits(spec, file, document, gravity))
        for edit in edits:
            edit.apply(spec)
        return spec.compile(), edits
    except ValueError as error:
        raise Unsupported(f"MuJoCo's URDF reader refuses it: {' '.join(str(error).split())}") from error


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


def _edits(spec: Any, file: ModelFile, document: Document, gravity: float) -> Iterator[Edit]:
    import mujoco

    flags = mujoco.mjtDisableBit
    off = (flags.mjDSBL_CONSTRAINT, flags.mjDSBL_CONTACT, flags.mjDSBL_ACTUATION, flags.mjDSBL_SENSOR, flags.mjDSBL_AUTORESET)
    yield Edit("option", "", {"gravity": [0.0, 0.0, -gravity], "disableflags": sum(int(flag) for flag in off)})
    if file.ball_joint is not None:
        (joint,) = (element for element in document.root.iterchildren("*") if literal_tag(element) == "drake:joint")
        values = {"name": file.ball_joint, "type": mujoco.mjtJoint.mjJNT_BALL}
        yield Edit("body", str(joint.find("child").get("link")), values, added="joint")
    for body in spec.bodies:
        if body.explicitinertial and body.name != "world":
            yield from _least_inertia(body, document, moves=bool(body.joints) or body.name == _root_of_ball(file, document))
    for armature in file.armatures:
        yield Edit("joint", armature.joint, {"armature": armature.reflected_inertia})
    for number, element in enumerate(file.force_elements):
        if isinstance(element, JointSpring):
            yield Edit("joint", element.joint, {"stiffness": [element.stiffness, 0.0, 0.0], "springref": element.reference})
        elif isinstance(element, PointSpring):
            yield from _tendon(element, f"spring {number}")


def _root_of_ball(file: ModelFile, document: Document) -> str | None:
    if file.ball_joint is None:
        return None
    (joint,) = (element for element in document.root.iterchildren("*") if literal_tag(element) == "drake:joint")
    return str(joint.find("child").get("link"))


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


def _least_inertia(body: Any, document: Document, moves: bool) -> Iterator[Edit]:
    """Principal inertias for a body whose matrix MuJoCo refuses, and the least mass and inertia where a moving one has none."""
    import mujoco

    if moves and body.mass < LEAST:
        _refuse_unless_zero(body.mass, body.name, "mass", document)
        yield Edit("body", body.name, {"mass": LEAST})
    xx, yy, zz, xy, xz, yz = (0.0 if np.isnan(body.fullinertia[0]) else float(number) for number in body.fullinertia)
    moments, axes = np.array([xx, yy, zz]), np.eye(3)
    if xy or xz or yz:
        moments, axes = np.linalg.eigh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    if moments.min() >= LEAST_OF_SIX:
        return
    largest, found = float(moments.max()), moments.tolist()
    for place, moment in enumerate(found):
        if moment <= ROUNDING * largest:
            # The rounding of the axes must not make the two larger moments differ by more than the least one.
            found[place] = max(LEAST, ROUNDING * largest if xy or xz or yz else 0.0) if moves else 0.0
        elif moves and moment < LEAST:
            _refuse_unless_zero(moment, body.name, "inertia", document)
    turn, quaternion = np.empty(4), np.empty(4)
    mujoco.mju_mat2Quat(turn, (axes * np.sign(np.linalg.det(axes))).ravel())
    mujoco.mju_mulQuat(quaternion, body.iquat, turn)
    orientation = {"iquat": quaternion.tolist()} if xy or xz or yz else {}
    yield Edit("body", body.name, {"fullinertia": [float("nan"), 0.0, 0.0, 0.0, 0.0, 0.0], "inertia": found, **orientation})


def _refuse_unless_zero(value: float, link: str, what: str, document: Document) -> None:
    if value == 0:
        return
    (element,) = (part for part in document.root.iterfind(f"link/inertial/{what}") if part.getparent().getparent().get("name") == link)
    line = document.lines[element]
    raise Unsupported(f"line {line}: link {link!r} has a principal {what} of {value:.3g}; MuJoCo takes none between 0 and {LEAST:g}")
