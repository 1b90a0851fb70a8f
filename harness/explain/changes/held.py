"""Numbers that an engine holds of a file, by the attributes in which the file says them, and changes to what another file says.

An engine calls a number by an array and its owner. A file writes it into an attribute of the owner's element, of a part of that, or of
its default class; several attributes may stand for one number, of which a file writes one.

Source: MuJoCo documentation, XML reference, and API reference, mjModel; http://wiki.ros.org/urdf/XML.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np
from lxml import etree

from harness.arrays import Array
from harness.engines.moving import NamedNumber, NumberKey
from harness.errors import InvalidModel
from harness.explain.changes import Change
from harness.files.document.source import Source, read_any
from harness.files.given import Place
from harness.files.mjcf.attributes import JOINTS, ORIENTATIONS, inside, resolved
from harness.files.mjcf.reading import put_included
from harness.files.reading import FORMATS
from harness.files.text.scan import TextPlace, all_elements, edited
from harness.results.table import number_text

_TURNED = tuple(ORIENTATIONS)
_GAINS = {"position": ("kp",), "velocity": ("kv",), "intvelocity": ("kp",), "damper": ("kv",), "general": ("gainprm",)}
# Attributes of an MJCF that are called otherwise than the array; by tag where that matters. A file writes one of them.
_OF_MJCF: Mapping[str, Mapping[str, Sequence[str]]] = {
    "actuator_gainprm": _GAINS,
    "actuator_biasprm": {**_GAINS, "general": ("biasprm",)},
    "actuator_biasprm:2": {"general": ("biasprm",), "": ("kv", "dampratio")},
    "actuator_dynprm": {"position": ("timeconst",), "": ("dynprm",)},
    "jnt_actfrcrange": {"": ("actuatorfrcrange",)},
    "jnt_solref": {"": ("solreflimit",)},
    "jnt_solimp": {"": ("solimplimit",)},
    "dof_solref": {"": ("solreffriction",)},
    "dof_solimp": {"": ("solimpfriction",)},
    "qpos0": {"": ("ref",)},
    "qpos_spring": {"": ("springref",)},
    "body_inertia": {"": ("diaginertia", "fullinertia")},
    "body_ipos": {"": ("pos",)},
    "body_quat": {"": _TURNED},
    "body_iquat": {"": _TURNED},
    "geom_quat": {"": (*_TURNED, "fromto")},
    "geom_pos": {"": ("pos", "fromto")},
    "geom_size": {"": ("size", "fromto")},
    "site_quat": {"": (*_TURNED, "fromto")},
}
_INERTIAL = ("body_mass", "body_inertia", "body_ipos", "body_iquat")
# Numbers of a link that the joint which places it has in a URDF.
_PLACES = ("body_pos", "body_quat")
# The part of an element of a URDF that has a number, and its attributes, each a number by itself.
_OF_URDF = {
    "dof_damping": ("dynamics", "damping"),
    "dof_frictionloss": ("dynamics", "friction"),
    "jnt_range": ("limit", "lower upper"),
    "jnt_actfrcrange": ("limit", "effort"),
    "jnt_axis": ("axis", "xyz"),
    "body_pos": ("origin", "xyz"),
    "body_quat": ("origin", "rpy"),
    "body_mass": ("inertial/mass", "value"),
    "body_inertia": ("inertial/inertia", "ixx ixy ixz iyy iyz izz"),
    "body_ipos": ("inertial/origin", "xyz"),
    "body_iquat": ("inertial/origin", "rpy"),
}
_SECTIONS = {"jnt": "joint", "dof": "joint", "qpos": "joint", "qpos0": "joint", "eq": "equality"}
# Attributes of the compiler by which angles are read, and what they are without.
_UNITS = (("angle", "degree"), ("eulerseq", "xyz"))
# Elements of an MJCF that stand in bodies.
_IN_BODIES = {"joint": JOINTS, "geom": ("geom",), "site": ("site",)}
_ANGLES = ("range", "ref", "springref", "euler", "axisangle")


@dataclass(frozen=True)
class Said:
    """An attribute that stands for a number of an engine, whether the file writes it or not.

    Attributes:
        attribute: its name. text: what is written, "" for nothing. place: where, of the owner's element where nothing is; None without one.
        own: the element into which it may be written for this owner alone, behind the ``missing`` elements around it; None for none.
        unit: of its angles, "" of one that holds none. otherwise: attributes beside which it may not stand.
        part: the element in that of the owner which has it, as "mass" of a link; "" for the owner's.
        owner: whose it is where that is another element, as a link fixed to the number's owner, of which the engine makes one body; "" for
            the owner itself.
    """

    attribute: str
    text: str = ""
    place: Place | None = None
    own: Place | None = None
    missing: tuple[str, ...] = ()
    unit: str = ""
    otherwise: tuple[str, ...] = ()
    part: str = ""
    owner: str = ""

    @property
    def name(self) -> str:
        """The attribute with the part that has it."""
        return " ".join(filter(None, (self.part, self.attribute)))

    @property
    def is_of_class(self) -> bool:
        return bool(self.text) and self.place != self.own

    def told(self, path: Path) -> str:
        """The place as read in ``path``, as "line 12"; "" for none."""
        return "" if self.place is None else self.place.within(path)


def section_of(array: str) -> str:
    """The kind of element that owns the numbers of an array."""
    prefix = array.partition("_")[0]
    return _SECTIONS.get(prefix, prefix)


def _plain(array: str) -> str:
    """The name of an array without those of its owners and of its columns."""
    return array.partition(":")[0].partition("_")[2] or array


class HeldFile:
    """A file by the names that an engine has for what it says."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._source = Source(read_any(path, "a model"))
        self.is_urdf = FORMATS.get(str(self._source.root.tag)) == "urdf"
        if not self.is_urdf:
            # What cannot be included was refused by the engine.
            with suppress(InvalidModel):
                put_included(self._source)
        self._sections: dict[str, dict[str, etree._Element]] = {}

    def says(self, array: str, owner: str) -> list[Said]:
        """The attributes that make up a number: the one of an MJCF that is written, or would be; all of a URDF."""
        element = self._element(section_of(array), owner)
        if self.is_urdf and array in _PLACES:
            placing = self._placing(owner) or [None]
            return [
                replace(said, owner="" if joint is None else f"joint {joint.get('name')}")
                for joint in placing
                for said in self._in_urdf(array, joint)
            ]
        if self.is_urdf:
            found = list(self._in_urdf(array, element))
            for link in self._fixed_to(owner, {owner}) if section_of(array) == "body" else ():
                found += [replace(said, owner=f"body {link.get('name')}") for said in self._in_urdf(array, link)]
            return found
        own = None if element is None else self._source.place(element)
        said = Said("", place=own, own=own)
        if array in _INERTIAL and element is not None:
            element = element.find("inertial")
            said = replace(said, own=None if element is None else self._source.place(element))
        elif section_of(array) in ("opt", "flag"):
            element, said = self._setting(*array.split("_", 1))
        by_tag = _OF_MJCF.get(array, {})
        names = by_tag.get("" if element is None else str(element.tag)) or by_tag.get("") or (_plain(array),)
        for name in names if element is not None else ():
            if (written := resolved(element, name)) is not None:
                said = replace(said, text=" ".join(written.text.split()), place=self._source.place(written.owner), attribute=name)
                break
        said = said if said.attribute else replace(said, attribute=names[0])
        otherwise = tuple(name for name in names if name != said.attribute)
        return [replace(said, unit=self._unit(said.attribute), otherwise=otherwise)]

    def _in_urdf(self, array: str, element: etree._Element | None) -> Iterator[Said]:
        part, attributes = _OF_URDF.get(array, ("", _plain(array)))
        holder = element if element is None or not part else element.find(part)
        place = None if element is None else self._source.place(element)
        for name in attributes.split():
            said = Said(name, place=place, own=None if "/" in part else place, missing=(part,), part=part.replace("/", " "))
            if holder is not None:
                own = self._source.place(holder)
                said = replace(said, text=" ".join(str(holder.get(name, "")).split()), place=own, own=own, missing=())
            yield said

    def _placing(self, link: str) -> list[etree._Element]:
        """The joint that places a link, and the fixed ones by which its parent stands on other links."""
        joints: dict[str, etree._Element] = {}
        for joint in self._source.root.iterchildren("joint"):
            for child in joint.iterchildren("child"):
                joints.setdefault(str(child.get("link")), joint)
        found: list[etree._Element] = []
        while (joint := joints.get(link)) is not None and joint not in found and (not found or joint.get("type") == "fixed"):
            found.append(joint)
            link = str(joint.find("parent").get("link")) if joint.find("parent") is not None else ""
        return found

    def _fixed_to(self, owner: str, known: set[str]) -> Iterator[etree._Element]:
        """The links that are fixed to a link, and to these."""
        for joint in self._source.root.iterchildren("joint"):
            parent, child = joint.find("parent"), joint.find("child")
            if joint.get("type") == "fixed" and parent is not None and child is not None and parent.get("link") == owner:
                name = str(child.get("link"))
                link = self._element("body", name)
                if link is not None and name not in known:
                    known.add(name)
                    yield link
                    yield from self._fixed_to(name, known)

    def _setting(self, prefix: str, name: str) -> tuple[etree._Element | None, Said]:
        """The last element that has a setting or flag; where none has, a further one may."""
        tags = ("option",) if prefix == "opt" else ("option", "flag")
        holders = list(self._source.root.iterfind("/".join(tags)))
        if not holders:
            return None, Said(name, own=self._source.place(self._source.root), missing=tags)
        holder = ([one for one in holders if name in one.attrib] or holders)[-1]
        place = self._source.place(holder)
        return holder, Said("", place=place, own=place)

    def _unit(self, attribute: str) -> str:
        compilers = [one for one in self._source.root.iterchildren("compiler") if attribute in _ANGLES]
        said = ([one.get(name) for one in compilers if one.get(name)][-1:] or [default] for name, default in _UNITS)
        return " ".join(word for words in said for word in words if word) if attribute in _ANGLES else ""

    def _element(self, section: str, owner: str) -> etree._Element | None:
        if section not in self._sections:
            self._sections[section] = {str(one.get("name") or f"{section} {number}"): one for number, one in self._numbered(section)}
        # Of several positions or velocities, and of an engine that says whose it is.
        names = (owner, owner.partition("[")[0], owner.partition(" of ")[0])
        return next((self._sections[section][name] for name in names if name in self._sections[section]), None)

    def _numbered(self, section: str) -> Iterator[tuple[int, etree._Element]]:
        """The elements of a section as an engine counts them, which is body by body."""
        root = self._source.root
        worlds = list(root.iterchildren("worldbody"))
        bodies = [one for world in worlds for one in world.iter("body")]
        if self.is_urdf:
            yield from enumerate(root.iterchildren("link" if section == "body" else section))
        elif section == "body":
            # The world is the first.
            yield from enumerate(bodies, 1)
        elif section in _IN_BODIES:
            yield from enumerate(one for body in (*worlds, *bodies) for one in inside(body, *_IN_BODIES[section]))
        else:
            yield from enumerate(root.iterfind("contact/pair" if section == "pair" else f"{section}/*"))


def change_to(kind: str, statement: str, own: Said, wanted: Said) -> Change | None:
    """The change of a file that says ``own`` to what another one says, ``wanted``; None where no attribute alone makes it.

    A default class is changed where the other file says it in one too. What the other file does not say is taken out.
    """
    is_taken_out, is_alike = not wanted.text, own.attribute == wanted.attribute
    if own.is_of_class and (is_taken_out or not is_alike):
        return None
    place = own.place if own.is_of_class and wanted.is_of_class else own.own
    if place is None or own.unit != wanted.unit or own.text == wanted.text:
        return None
    attribute = own.attribute if is_taken_out else wanted.attribute
    found = TextPlace(place.line, place.tag, attribute, None, own.text)
    return Change(kind, statement, (found,), partial(_rewritten, place, own, wanted), path=place.path)


@dataclass(frozen=True)
class SizedChange:
    """A change of a file to another value of a number, and the text of its attribute at a value."""

    change: Change
    words: Callable[[float], str]


def sized_change(file: HeldFile, number: NamedNumber, row: Callable[[NumberKey], Array]) -> SizedChange | None:
    """The change of a file to other values of a number, of which ``row`` is what an engine holds; None where no attribute alone says it.

    What a default class says is written into the element, for no other one is to change.
    """
    if not number.directions:
        return None
    said = [one for key in number.directions for one in file.says(*key)]
    own, held, direction = said[0], row(number.key), number.directions[number.key]
    element = own.own
    if element is None or any((one.place, one.attribute) != (own.place, own.attribute) for one in said):
        return None
    parts = np.array([float(part) for part in own.text.split()]) if own.text else held
    if len(parts) == 1:
        parts, direction = (np.array([number.value]), np.ones(1)) if not own.text or parts[0] == number.value else (parts, direction)
    count = len(parts)
    if direction[count:].any() or not (np.array_equal(parts, held[:count]) or (count == 1 and parts[0] == number.value)):
        return None
    words = partial(_words, own.text, parts, direction[:count], number.value)
    place = TextPlace(element.line, element.tag, own.attribute, None, own.text)

    def text(value: float) -> str:
        return _rewritten(element, own, replace(own, text=words(value)), value)

    statement = f"{number.what} of {number.owner}"
    return SizedChange(Change(number.cause, statement, (place,), text, number.value, abs(number.value) or 1.0, path=element.path), words)


def _words(text: str, parts: Array, direction: Array, start: float, value: float) -> str:
    """Numbers with another value along a direction; where it is the file's, the text of the file."""
    return text if text and value == start else " ".join(number_text(part) for part in (parts + (value - start) * direction).tolist())


def _rewritten(place: Place, own: Said, wanted: Said, _value: float) -> str:
    """The text of the file of a place with what is wanted there."""
    document = read_any(place.path, "a model")
    if wanted.text == own.text and wanted.attribute == own.attribute:
        return document.text
    element = all_elements(document.text, FORMATS.get(str(document.root.tag), "mjcf"))[place.element]
    written = f" {wanted.attribute}={quoteattr(wanted.text)}" if wanted.text else ""
    if own.missing and not own.text:
        opening, last = "".join(f"<{tag}>" for tag in own.missing[:-1]), own.missing[-1]
        closing = "".join(f"</{tag}>" for tag in reversed(own.missing[:-1]))
        return edited(document.text, [(element.closed, element.closed, f"{opening}<{last}{written}/>{closing}")])
    leaving = {own.attribute, wanted.attribute, *(wanted.otherwise if wanted.text else ())}
    behind_tag = element.start + 1 + len(element.tag)
    removed = [(one.start, one.end, "") for one in element.attributes if one.name in leaving]
    return edited(document.text, [*removed, (behind_tag, behind_tag, written)])
