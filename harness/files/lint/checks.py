"""Hold a model file against the tables of what is understood, and its inertias against physics.

``harness.files.model_file`` says how a file declares decoration.

Sources: for inertia, Featherstone, Rigid Body Dynamics Algorithms, section 2.13, and Wensing, Kim,
Slotine, IEEE RA-L 3(1), 2018.
"""

from __future__ import annotations

import difflib
import functools
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TypeVar

import numpy as np
from lxml import etree

from harness.errors import InvalidModel
from harness.files.document.source import Rule
from harness.files.document.xml import Document, describe, literal_tag, shorten
from harness.files.lint import formats
from harness.library import nearest

# Relative to the largest moment; eigenvalues of an exact inertia are off by a few 1e-16.
INERTIA_SLACK = 1e-12
Item = TypeVar("Item")
_DECLARATION = re.compile(r"\s*decoration:(.*)", re.DOTALL)

# Elements and attributes that are refused, with the reason: each is something that some engine reads and another ignores, that adds forces
# or states of its own, or that no acceleration feels.
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
_ELEMENTS: Mapping[str, Mapping[str, str]] = {
    "mjcf": {
        "include": "reads another file, which some readers ignore in silence; copy its content here",
        **dict.fromkeys(("replicate", "attach", "composite", "flexcomp"), _MAKES_BODIES),
        **dict.fromkeys(("deformable", "flex", "skin"), _DEFORMS),
        **dict.fromkeys(("extension", "plugin"), _CODE),
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
_ATTRIBUTES: Mapping[str, Mapping[str, str]] = {
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
_ELSEWHERE: Mapping[str, Mapping[str, str]] = {
    "mjcf": {"option@": _NOT_FELT, "compiler@": _NOT_FELT},
    "urdf": {"drake:": "is a Drake extension that is not read; remove it", "gazebo": "is a Gazebo extension that is not read; remove it"},
}


def check_elements(document: Document, model_format: str) -> None:
    """Hold ``document`` against the tables of ``harness.files.lint.formats``.

    Raises:
        InvalidModel: at the line of the first element that does not fit.
    """
    root = document.root
    refused = _ELEMENTS[model_format]
    for element in root.iter("*"):
        tag = literal_tag(element)
        if element.tag[0] == "{" and not element.prefix:
            document.refuse(element, f"<{shorten(tag)}> is in a default namespace, which readers take differently; remove xmlns")
        if tag in refused:
            document.refuse(element, f"<{tag}> {refused[tag]}")
    declared = _declared_decoration(document, model_format)
    for element, path in _understood(document, model_format, declared):
        _check_attributes(document, element, model_format, path, declared)
    for element, (single, required) in _of_places(document, formats.CHILDREN[model_format]):
        found = [child.tag for child in element]
        for tag in single if len(set(found)) < len(found) else ():
            for repeated in element.findall(tag)[1:]:
                document.refuse(repeated, f"second <{tag}> in {describe(element)}; expected one, keep the right one")
        for tag in required:
            if tag not in found:
                document.refuse(element, f"{describe(element)} has no <{tag}>; add it")
    for element, rules in _of_places(document, formats.ALSO[model_format]):
        for name, rule in rules.items():
            check_attribute(document, element, name, rule)
    if "geom" in declared:
        _check_that_nothing_touches(document)


def _of_places(document: Document, table: Mapping[str, Item]) -> Iterator[tuple[etree._Element, Item]]:
    """Every element at a place of ``table`` with what the table has for that place."""
    for place, item in table.items():
        for element in document.root.iterfind(place):
            yield element, item


def _declared_decoration(document: Document, model_format: str) -> set[str]:
    """Names of elements and attributes that the file's comments declare as decoration."""
    known = {
        name for table in (formats.DECORATION, formats.DECORATIVE_ATTRIBUTES) for names in table[model_format].values() for name in names
    }
    declared: set[str] = set()
    for line, text in document.comments:
        match = _DECLARATION.fullmatch(text)
        for name in re.split(r"[\s,]+", match[1].strip()) if match else ():
            if name not in known:
                raise InvalidModel(document.path, line, f"declares {shorten(name)!r} as decoration; {nearest(name, sorted(known))}")
            declared.add(name)
    return declared


def _understood(document: Document, model_format: str, declared: set[str]) -> Iterator[tuple[etree._Element, list[str]]]:
    """Every element but decoration, with the tags from the root to it; what is not understood is refused."""
    waiting = [(document.root, [literal_tag(document.root)])]
    while waiting:
        element, path = waiting.pop()
        yield element, path
        context = formats.context_of(model_format, path)
        known, decoration = formats.SUPPORTED[model_format].get(context, {}), formats.DECORATION[model_format].get(context, ())
        inside: list[tuple[etree._Element, list[str]]] = []
        for child in element.iterchildren("*"):
            tag = literal_tag(child)
            if tag in known:
                inside.append((child, [*path, tag]))
            elif tag in decoration:
                if tag not in declared:
                    document.refuse(child, f"<{tag}> is decoration; remove it, or declare it by the comment <!-- decoration: {tag} -->")
            else:
                reason = _ELEMENTS[model_format].get(f"{context}/{tag}") or _why_not(model_format, tag, known, context)
                document.refuse(child, f"<{shorten(tag)}> in {describe(element)} {reason}")
        # In document order, so that the first thing wrong is named first.
        waiting += reversed(inside)


def _why_not(model_format: str, name: str, known: Iterable[str], context: str) -> str:
    """Why an element or attribute that no table names is refused: a typing error first."""
    if difflib.get_close_matches(name, known, n=1):
        return f"is unknown; {nearest(shorten(name), known)}"
    for prefix, reason in _ELSEWHERE[model_format].items():
        if name.startswith(prefix) or context == prefix:
            return reason
    holders = [holder for holder, children in formats.SUPPORTED[model_format].items() if name in children and not context.endswith("@")]
    if holders:
        return "does not belong there; expected in " + " or ".join(f"<{holder}>" for holder in holders)
    return f"is not understood; {nearest(shorten(name), known)}" if known else "is not understood; expected nothing inside, remove it"


def _check_attributes(document: Document, element: etree._Element, model_format: str, path: list[str], declared: set[str]) -> None:
    tag = path[-1]
    rules: formats.Attributes = formats.SUPPORTED[model_format][formats.context_of(model_format, path[:-1])].get(tag, {})
    refused = _ATTRIBUTES[model_format]
    decorative = formats.DECORATIVE_ATTRIBUTES[model_format].get(tag, ())
    # One look at the element: each costs as much as reading a number.
    given = dict(element.attrib)
    for name in given:
        if name in rules:
            continue
        shown = f'{describe(element)} {shorten(name)}="{shorten(element.get(name))}"'
        reason = refused.get(f"{tag}@{name}") or refused.get(f"@{name}")
        if reason is None and name in decorative:
            if name in declared:
                continue
            reason = f"is decoration; remove it, or declare it by the comment <!-- decoration: {name} -->"
        if reason is None:
            reason = _why_not(model_format, name, [known for known in rules if known], f"{tag}@")
        document.refuse(element, f"{shown} {reason}")
    for name, rule in rules.items():
        if name in given or rule.required or not name:
            check_attribute(document, element, name, rule)
    texts = [element.text, *(child.tail for child in element)] if "" not in rules else [child.tail for child in element]
    for text in texts:
        if text and text.strip():
            document.refuse(element, f"{describe(element)} holds the text {shorten(text)!r}, which no reader reads; remove it")


def _check_that_nothing_touches(document: Document) -> None:
    flags = {name: value for flag in document.root.iterfind("option/flag") for name, value in flag.attrib.items()}
    if "disable" not in (flags.get("contact"), flags.get("constraint")):
        geom = next(document.root.iter("geom"), None)
        if geom is not None:
            document.refuse(geom, f'{describe(geom)} can touch, which is no decoration; add <option><flag contact="disable"/></option>')


def check_attribute(document: Document, element: etree._Element, name: str, rule: Rule) -> None:
    """Refuse attribute ``name`` of ``element``, or its text for "", where it is missing but required, or not what ``rule`` expects.

    Raises:
        InvalidModel: at the line of ``element``.
    """
    text = element.get(name) if name else element.text or ""
    if text is None:
        if rule.required:
            document.refuse(element, f"{describe(element)} has no attribute {name!r}; add it")
        return
    try:
        rule.read(text)
    except ValueError as complaint:
        shown = (
            f'{describe(element)} {name}="{shorten(text)}"' if name else f"<{literal_tag(element)}>{shorten(text)}</{literal_tag(element)}>"
        )
        document.refuse(element, f"{shown} {complaint}")


# A diagnosis reads a file a thousand times with one number changed.
@functools.lru_cache(maxsize=4096)
def _principal_moments(moments: tuple[float, ...]) -> tuple[float, float, float]:
    """Eigenvalues of an inertia matrix, ascending."""
    xx, yy, zz, xy, xz, yz = moments
    low, middle, high = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]).tolist()
    return low, middle, high


def check_inertia(document: Document, element: etree._Element, moments: Sequence[float]) -> None:
    """Refuse moments xx, yy, zz, xy, xz, yz [kg m^2] no mass distribution has: the principal ones must be A, B, C >= 0, A + B >= C.

    Raises:
        InvalidModel: at the line of ``element``.
    """
    largest = max(map(abs, moments))
    if largest == 0:
        return
    low, middle, high = _principal_moments(tuple(moment / largest for moment in moments))
    if low < -INERTIA_SLACK:
        expected = "none below zero"
    elif low + middle < high - INERTIA_SLACK:
        expected = "the two smaller to sum to the largest or more"
    else:
        return
    shown = ", ".join(f"{moment * largest:.6g}" for moment in (low, middle, high))
    document.refuse(element, f"{describe(element)} has principal moments of inertia {shown}; expected {expected}")
