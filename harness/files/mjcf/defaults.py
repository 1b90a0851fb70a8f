"""Attributes of MJCF elements once their default classes are applied.

Source: MuJoCo documentation, Modeling, section Default settings.
"""

from __future__ import annotations

import functools
from collections.abc import Iterator
from dataclasses import dataclass, field
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
    # A free joint takes nothing from the defaults of joints, and most files have none.
    if element.tag != "freejoint" and _classes(element.getroottree().getroot()):
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
    classes = _classes(element.getroottree().getroot())
    key = _default_tag(element), name
    # A class inside another of its name, which MuJoCo refuses, is around itself.
    chain = [name_of_class]
    for one in chain:
        if one in classes:
            yield from classes[one].given.get(key, ())
            chain += [around for around in classes[one].around if around not in chain]


def _default_tag(element: etree._Element) -> str:
    """The tag under which defaults of ``element`` stand: constraints of all kinds share one."""
    parent = element.getparent()
    return "equality" if parent is not None and parent.tag == "equality" else _DEFAULT_TAG.get(element.tag, str(element.tag))


@dataclass
class _Class:
    """A default class: the name of the one ``around`` it, if any, and its writings by (tag, attribute)."""

    around: tuple[str, ...] = ()
    given: dict[tuple[str, str], list[Written]] = field(default_factory=dict)


# Of the last file alone, and once: a file looks as many attributes up as it has elements.
@functools.lru_cache(maxsize=1)
def _classes(root: etree._Element) -> dict[str, _Class]:
    """The default classes of a file by name; a name that stands twice is one class, and what comes later goes first."""
    classes: dict[str, _Class] = {}
    for default in (default for section in root.iterchildren("default") for default in section.iter("default")):
        parts = [(part, *written) for part in default.iterchildren("*") for written in part.attrib.items()]
        for name in _names(default):
            known = classes.setdefault(name, _Class())
            known.around = _names(default.getparent())[-1:]
            for part, attribute, text in parts:
                earlier, words = known.given.get((part.tag, attribute), []), len(text.split())
                longer = [written for written in earlier if len(written.text.split()) > words]
                known.given[part.tag, attribute] = [Written(text, part), *longer]
    return classes


def _names(default: etree._Element) -> tuple[str, ...]:
    """The names of a class, none for what is no class: the outermost one is ``MAIN`` besides."""
    own = default.get("class")
    outermost = default.tag == "default" and default.getparent().tag == "mujoco"
    return (*([MAIN] if outermost else []), *([str(own)] if own else []))
