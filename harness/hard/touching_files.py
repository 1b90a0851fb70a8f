"""The formats in which engines are handed a ``RigidCase``: where each has its file, and how its knob is turned there."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lxml import etree

from harness.engines.request import Refused
from harness.files.tree import WORLD
from harness.hard.rigid_case import Edits, RigidCase, UrdfChanges
from harness.library import Library

_DRAKE = "{http://drake.mit.edu}"
# Of the world's surface, of products.
_WORLD = {"lateral_friction": 1.0, "restitution": 1.0}
_STAGES = Path(__file__).parent / "cases" / "usd"
# A stage has these of its strongest layer alone.
_LAYER = '#usda 1.0\n(\n    kilogramsPerUnit = 1\n    metersPerUnit = 1\n    subLayers = [@@@{}@@@]\n    upAxis = "Z"\n)\n'


@dataclass(frozen=True)
class TouchingFormat:
    """One format.

    Attributes:
        source: a case to its file; raises Refused where there is none.
        turned: the file, the case and a value of its knob, and edits of a setting, to the text that an engine reads.
        takes_settings: whether a setting may edit it.
        lacking: of a case, why engines do not move it by such a file, although they read it; "" where they do.
    """

    source: Callable[[RigidCase], Path]
    turned: Callable[[Path, RigidCase, float, Edits], bytes]
    takes_settings: bool = False
    lacking: Callable[[RigidCase], str] = lambda case: ""


def stage_of(case: RigidCase) -> Path:
    """The stage of a case, which is written by hand; raises Refused where it has none."""
    if case.of_usd is None:
        raise Refused("no stage is written of it")
    return _STAGES / f"{case.system}.usda"


def _lacking_in_urdf(case: RigidCase) -> str:
    return f"its reader takes no {case.not_in_urdf} from a URDF" if case.not_in_urdf else ""


def _touching(path: Path, *edits: Edits) -> bytes:
    """An MJCF whose contacts are on, with attributes set, the last word of each first."""
    root = etree.fromstring(path.read_bytes(), etree.XMLParser(resolve_entities=False))
    for flag in root.iterfind("option/flag"):
        for stage in ("contact", "constraint"):
            flag.attrib.pop(stage, None)
    for place, attributes in (item for one in reversed(edits) for item in one.items()):
        for element in root.iterfind(place):
            element.attrib.update(attributes)
    written: bytes = etree.tostring(root)
    return written


def _rubbing(path: Path, changes: UrdfChanges) -> bytes:
    """A URDF that says how links touch: to Bullet by ``<contact>`` of links, to Drake, which takes harmonic means, by their shapes."""
    root = etree.fromstring(path.read_bytes(), etree.XMLParser(resolve_entities=False, remove_comments=True))
    for place, attributes in changes.edits.items():
        for element in root.iterfind(place):
            element.attrib.update(attributes)
    for collision in root.iterfind("link/collision") if "lateral_friction" in changes.surface else ():
        properties = etree.SubElement(collision, f"{_DRAKE}proximity_properties", nsmap={"drake": _DRAKE[1:-1]})
        for name in ("mu_static", "mu_dynamic"):
            etree.SubElement(properties, f"{_DRAKE}{name}", value=f"{changes.surface['lateral_friction']!r}")
    for link in root.iterfind("link"):
        contact = etree.SubElement(link, "contact")
        for name, value in (_WORLD if link.get("name") == WORLD else changes.surface).items():
            etree.SubElement(contact, name, value=f"{value!r}")
    written: bytes = etree.tostring(root)
    return written


def _laid_over(path: Path, edits: Edits) -> bytes:
    """A stronger layer over a stage, which sets attributes of its prims."""
    prims: dict[str, Any] = {}
    for place, attributes in edits.items():
        prim = prims
        for name in place.split("/"):
            prim = prim.setdefault(name, {})
        prim.update(attributes)
    return f"{_LAYER.format(path.resolve())}{_spelt(prims)}".encode()


def _spelt(parts: Mapping[str, Any]) -> str:
    """Prims, and attributes, which are declared with their type, as a layer has them."""
    return "".join(
        f"{name} = {part}\n" if isinstance(part, str) else f'over "{name}"\n{{\n{_spelt(part)}}}\n' for name, part in parts.items()
    )


def _of_usd(case: RigidCase, value: float) -> Edits:
    return case.of_usd(value) if case.of_usd is not None else {}


def _model(model_format: str) -> Callable[[RigidCase], Path]:
    return lambda case: Library.built_in().model_path(case.system, model_format)


# By the name of the format; an engine is handed the first of its own that is here.
FORMATS: Mapping[str, TouchingFormat] = {
    "mjcf": TouchingFormat(_model("mjcf"), lambda path, case, value, edits: _touching(path, case.edits(value), edits), takes_settings=True),
    "urdf": TouchingFormat(_model("urdf"), lambda path, case, value, _: _rubbing(path, case.of_urdf(value)), lacking=_lacking_in_urdf),
    "usd": TouchingFormat(stage_of, lambda path, case, value, _: _laid_over(path, _of_usd(case, value))),
}
