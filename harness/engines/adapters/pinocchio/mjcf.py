"""The model that Pinocchio's MJCF reader gives, and refusals of what it passes over or reads otherwise than MuJoCo.

Gravity, springs and dampers are supplied by the caller from the file (``harness.files.facts``). Everything else that the
harness lets stand in an MJCF and that this reader does not read as MuJoCo does is refused here by name and line.

Source: Pinocchio 4.1, parsers/mjcf/mjcf-graph; MuJoCo documentation, XML reference.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterator
from typing import Any

import pinocchio
from lxml import etree

from harness.engines import Unsupported
from harness.engines.adapters.pinocchio.versions import reasons
from harness.files.document.xml import Document, describe, shorten
from harness.files.joint_kinds import JointKind
from harness.files.mjcf.attributes import ORIENTATIONS, childclass_of, of_class, resolved
from harness.files.model_file import ModelFile, document_of

# Sections of which the reader takes the first as often as there are some.
_ONCE = ("compiler", "default", "worldbody")
# What it reads of a joint's default classes.
_FROM_DEFAULTS = ("type", "axis", "armature", "ref")
_UNIT = 4 * 2.0**-53


def read(file: ModelFile) -> Any:
    """The ``pinocchio.Model``, without gravity and forces.

    Raises:
        Unsupported: the file holds what the reader passes over or reads otherwise, or the reader refuses it.
    """
    _refuse_ignored(file, document_of(file))
    # The reader wants a path. This one has no name that could outlive a process which the reader aborts.
    refused = "Pinocchio's MJCF reader refuses it: "
    with tempfile.TemporaryFile() as content, reasons(lambda words: Unsupported(refused + " ".join(words.split()))):
        content.write(file.text.encode())
        content.seek(0)
        return pinocchio.buildModelFromMJCF(f"/dev/fd/{content.fileno()}")


def _refuse_ignored(file: ModelFile, document: Document) -> None:
    """Raises Unsupported, with all that this reader does not read as MuJoCo does and nobody supplies."""
    found = [(missing.line, f"{missing.what}, which the harness cannot supply") for missing in file.unexpressed]
    found += [(document.lines[element], f"{_shown(element)} {why}") for element, why in _ignored(document.root)]
    if found:
        raise Unsupported("Pinocchio's MJCF reader: " + "; ".join(f"line {line}: {what}" for line, what in sorted(found)))


def _shown(element: etree._Element) -> str:
    return f"<{element.tag}>" if element.tag in _ONCE else describe(element)


def _ignored(root: etree._Element) -> Iterator[tuple[etree._Element, str]]:
    for tag in _ONCE:
        for again in root.findall(tag)[1:]:
            yield again, f"is a second <{tag}>, which it passes over; write one"
    for world in root.iterfind("worldbody"):
        for late in world.itersiblings("compiler", "default"):
            yield late, "stands behind <worldbody>, which it has read by then; write it before"
        for body in world.findall("body")[1:]:
            yield body, "is a further body in <worldbody>, which it passes over; it reads the first"
        for element in world.iter("frame", "body", "joint"):
            yield from {"frame": _of_frame, "body": _of_body, "joint": _of_joint}[element.tag](element)
        for element in world.iter("body", "inertial"):
            yield from _of_orientation(element)


def _of_frame(frame: etree._Element) -> Iterator[tuple[etree._Element, str]]:
    yield frame, "is passed over with all that it holds; write its pose into what is inside"


def _of_body(body: etree._Element) -> Iterator[tuple[etree._Element, str]]:
    if not body.get("name"):
        yield body, "has no name, by which it tells bodies apart; add one"
    joints = body.findall("joint")
    kinds = [resolved(joint, "type") for joint in joints]
    is_free = body.find("freejoint") is not None or any(kind is not None and kind.text == JointKind.FREE for kind in kinds)
    is_turned = any(name in body.attrib for name in ORIENTATIONS)
    if body.getparent().tag == "worldbody" and not joints and not is_free and (is_turned or _nonzero(body, "pos")):
        yield body, "is fixed to the world in a pose, which it passes over; give the pose to what it holds"
    # Its placement p of a free body turned by R is undone as p - R p.
    if is_free and _nonzero(body, "pos") and is_turned:
        yield body, "has a free joint and a pose both shifted and turned, which it undoes wrongly; leave the pose out, for q replaces it"
    if len(joints) > 1:
        for joint in joints:
            if _nonzero(joint, "ref"):
                yield joint, 'has a "ref" beside other joints of its body, which it takes for none; measure from zero'


def _of_joint(joint: etree._Element) -> Iterator[tuple[etree._Element, str]]:
    for name, why in (("pos", "passes over there"), ("ref", "may read in other units there")):
        written = resolved(joint, name)
        if written is not None and written.owner is not joint and _nonzero(joint, name):
            yield joint, f'takes {name}="{shorten(written.text)}" from a default class, which it {why}; write it into the joint'
    kind = resolved(joint, "type")
    if kind is not None and kind.text in (JointKind.BALL, JointKind.FREE) and _nonzero(joint, "ref"):
        yield joint, f'has a "ref", which a {kind.text} joint does not feel; remove it'
    if kind is not None and kind.text == JointKind.FREE and _nonzero(joint, "armature"):
        yield joint, 'has an "armature", which it adds in the frame of the body and not of the world; remove it'
    chosen, around = joint.get("class"), childclass_of(joint)
    if chosen and around:
        for name in _FROM_DEFAULTS:
            if resolved(joint, name) is None and (other := of_class(joint, around, name)) is not None:
                yield joint, f'has a class of its own, and yet it takes {name}="{shorten(other.text)}" from childclass {around!r}; write it'


def _of_orientation(element: etree._Element) -> Iterator[tuple[etree._Element, str]]:
    compilers = element.getroottree().getroot().findall("compiler")
    if "euler" in element.attrib and any(compiler.get("eulerseq", "xyz").isupper() for compiler in compilers):
        yield element, "is turned about fixed axes by eulerseq in capitals, which it takes for small letters; write a quat"
    if "axisangle" in element.attrib:
        *axis, _ = map(float, str(element.get("axisangle")).split())
        if abs(math.hypot(*axis) - 1) > _UNIT:
            yield element, f'axisangle="{shorten(str(element.get("axisangle")))}" has no unit axis, which it needs; write a quat'
    if "zaxis" in element.attrib:
        x, y, z = map(float, str(element.get("zaxis")).split())
        # Near z and -z the two lose digits, or choose other turns.
        if not x == y == 0 < z:
            yield element, f'zaxis="{shorten(str(element.get("zaxis")))}" is turned by another formula than MuJoCo\'s; write a quat'


def _nonzero(element: etree._Element, name: str) -> bool:
    written = resolved(element, name)
    return written is not None and any(float(word) for word in written.text.split())
