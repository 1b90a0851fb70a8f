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
from harness.files.document.values import Rule
from harness.files.document.xml import Document, describe, literal_tag, shorten
from harness.files.lint import formats, refusals
from harness.library import nearest

# Relative to the largest moment; eigenvalues of an exact inertia are off by a few 1e-16.
INERTIA_SLACK = 1e-12
Item = TypeVar("Item")
_DECLARATION = re.compile(r"\s*decoration:(.*)", re.DOTALL)


def check_elements(document: Document, model_format: str) -> None:
    """Hold ``document`` against the tables of ``harness.files.lint.formats``.

    Raises:
        InvalidModel: at the line of the first element that does not fit.
    """
    root = document.root
    refused = refusals.ELEMENTS[model_format]
    for element in root.iter("*"):
        tag = literal_tag(element)
        if element.tag[0] == "{" and not element.prefix:
            document.refuse(element, f"<{shorten(tag)}> is in a default namespace, which readers take differently; remove xmlns")
        if tag in refused:
            document.refuse(element, f"<{tag}> {refused[tag]}")
    declared = _declared_decoration(document, model_format)
    for element, path in _understood(document, model_format, declared):
        _check_attributes(document, element, model_format, path, declared)
    for element, tags in _of_places(document, formats.AT_MOST_ONE[model_format]):
        found = [child.tag for child in element]
        for tag in tags if len(set(found)) < len(found) else ():
            for repeated in element.findall(tag)[1:]:
                document.refuse(repeated, f"second <{tag}> in {describe(element)}; expected one, keep the right one")
    for element, tags in _of_places(document, formats.REQUIRED[model_format]):
        found = [child.tag for child in element]
        for tag in tags:
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
                reason = refusals.ELEMENTS[model_format].get(f"{context}/{tag}") or _why_not(model_format, tag, known, context)
                document.refuse(child, f"<{shorten(tag)}> in {describe(element)} {reason}")
        # In document order, so that the first thing wrong is named first.
        waiting += reversed(inside)


def _why_not(model_format: str, name: str, known: Iterable[str], context: str) -> str:
    """Why an element or attribute that no table names is refused: a typing error first."""
    if difflib.get_close_matches(name, known, n=1):
        return f"is unknown; {nearest(shorten(name), known)}"
    for prefix, reason in refusals.ELSEWHERE[model_format].items():
        if name.startswith(prefix) or context == prefix:
            return reason
    holders = [holder for holder, children in formats.SUPPORTED[model_format].items() if name in children and not context.endswith("@")]
    if holders:
        return "does not belong there; expected in " + " or ".join(f"<{holder}>" for holder in holders)
    return f"is not understood; {nearest(shorten(name), known)}" if known else "is not understood; expected nothing inside, remove it"


def _check_attributes(document: Document, element: etree._Element, model_format: str, path: list[str], declared: set[str]) -> None:
    tag = path[-1]
    rules: formats.Attributes = formats.SUPPORTED[model_format][formats.context_of(model_format, path[:-1])].get(tag, {})
    refused = refusals.ATTRIBUTES[model_format]
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
