"""Attributes of MJCF elements once their default classes are applied.

Source: MuJoCo documentation, Modeling, section Default settings.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from lxml import etree

# Name of the outermost class where its author gave it none.
MAIN = "main"
# Where the defaults of an element stand under another tag than its own.
_DEFAULT_TAG = {"spatial": "tendon", "fixed": "tendon"}


class Written(NamedTuple):
    """The text of an attribute, and the element in which it is written."""

    text: str
    owner: etree._Element


def resolved(element: etree._Element, name: str) -> Written | None:
    """An attribute as MuJoCo resolves it: the element's own, else that of its class or of a class around that; None where nobody gives it.

    An element without a class of its own has the childclass of the innermost body or frame around it that names one.
    """
    return next(writings(element, name), None)


def resolved_text(element: etree._Element, name: str, default: str = "") -> str:
    """The text of ``resolved``; ``default`` where nobody gives the attribute."""
    written = resolved(element, name)
    return default if written is None else written.text


def writings(element: etree._Element, name: str) -> Iterator[Written]:
    """Wherever an attribute of ``element`` is written: in itself, in its class, in the classes around that.

    Of a list MuJoCo takes each number from the first of them that is long enough to hold it.
    """
    if name in element.attrib:
        yield Written(str(element.get(name)), element)
    # A free joint takes nothing from the defaults of joints.
    if element.tag != "freejoint":
        yield from _in_class(element, class_of(element), name)


def class_of(element: etree._Element) -> str:
    """Name of the default class that holds for ``element``."""
    return str(element.get("class") or childclass_of(element) or MAIN)


def childclass_of(element: etree._Element) -> str | None:
    """The childclass of the innermost ancestor that names one."""
    return next((name for ancestor in element.iterancestors() if (name := ancestor.get("childclass"))), None)


def of_class(element: etree._Element, name_of_class: str, name: str) -> Written | None:
    """An attribute that a default class, or one around it, gives elements like ``element``; None where none does."""
    return next(_in_class(element, name_of_class, name), None)


def _in_class(element: etree._Element, name_of_class: str, name: str) -> Iterator[Written]:
    tag = _DEFAULT_TAG.get(element.tag, element.tag)
    sections = element.getroottree().getroot().iterchildren("default")
    classes = [default for section in sections for default in section.iter("default") if name_of_class in _names(default)]
    given = [part for default in classes for part in default.iterchildren(tag) if name in part.attrib]
    yield from (Written(str(part.get(name)), part) for part in reversed(given))
    if classes and classes[-1].getparent().tag == "default":
        yield from _in_class(element, _names(classes[-1].getparent())[-1], name)


def _names(default: etree._Element) -> tuple[str, ...]:
    """The names of a class: the outermost one is ``MAIN`` besides."""
    own = default.get("class")
    return (*([MAIN] if default.getparent().tag == "mujoco" else []), *([str(own)] if own else []))
