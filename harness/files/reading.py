"""The one reading of a model file, whoever asks: the tree, what is tied beside it, and what the file says besides.

Files in the wild hold much that says nothing of the motion, and some that no equation of motion can hold. What is left out is
listed with its lines; nothing that bears on the motion is read past in silence.

Sources: http://wiki.ros.org/urdf/XML; MuJoCo documentation, XML reference.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING

from lxml import etree

from harness.files.document.source import PassedOver, Source, Unread, read_any, refuse_irregular_files
from harness.files.document.xml import Document, describe, literal_tag
from harness.files.equalities import Equality
from harness.files.findings import LeftOut
from harness.files.left_out import Declared, left_out_of_mjcf, left_out_of_urdf
from harness.files.mjcf.inertias import CompileMeshes
from harness.files.mjcf.reading import read_tree as read_mjcf
from harness.files.tree import Actuator, ForceLimits, Joint, SpringDampers, Tree
from harness.files.urdf.reading import UrdfReader
from harness.library import TEMPLATE_SUFFIX

if TYPE_CHECKING:
    from harness.files.shapes import Shapes

FORMATS = {"robot": "urdf", "mujoco": "mjcf", "usd": "usd"}
# What an empty file should have been.
EXPECTED = "a robot: a URDF, whose root element is <robot>, an MJCF, whose root element is <mujoco>, or a USD file"
# Of the numbers of a format, where it is not that of float64.
_FLOAT32 = 2.0**-24
# [m/s^2, along -z], of a URDF, which holds none.
GRAVITY = 9.81


@dataclass(frozen=True)
class Meaning:
    """A model file as its format's documentation gives it meaning.

    Attributes:
        format: as its root element says, or its name.
        tree: without the forces and inertias of ``unread``, and without those of ``spring_dampers``.
        equalities: what is tied beside the tree; a joint that mimics another is one, and follows the other in the tree.
        passed_over: what no model of a mechanism may say, in the order in which it was found.
        floating_base: name of the free joint that was put under the root of a URDF; "" for none.
        declared: elements that are left out and bear on the motion, but limits, friction and equalities.
        actuators: of the file, which the tree leaves out. force_limits: as of ``Tree``.
        shapes: of an MJCF, that may touch; None of a file without such.
        unit_roundoff: of the numbers that the format holds.
    """

    format: str
    tree: Tree
    equalities: tuple[Equality, ...]
    left_out: tuple[LeftOut, ...]
    passed_over: tuple[PassedOver, ...]
    unread: tuple[Unread, ...]
    spring_dampers: SpringDampers
    floating_base: str = ""
    declared: tuple[Declared, ...] = ()
    actuators: tuple[Actuator, ...] = ()
    force_limits: ForceLimits = ()
    shapes: Shapes | None = None
    unit_roundoff: float = 2.0**-53

    @cached_property
    def moving(self) -> tuple[Joint, ...]:
        """The joints that move by themselves in the order of the file, behind a floating base that is none of its own."""
        moving = [joint for joint in self.tree.joints if not joint.follows]
        if self.format == "urdf":
            # A tree has them by depth.
            moving.sort(key=lambda joint: (joint.name != self.floating_base, joint.place.element if joint.place else 0))
        return tuple(moving)


def format_of(path: Path) -> str:
    """The format of a model file, "urdf" or "mjcf", by its root element.

    Raises:
        InvalidModel: the file cannot be read, or has another root.
    """
    return _format(Source(read_any(path, EXPECTED)))


def _format(source: Source) -> str:
    if (template := next(filter(_is_expanded, source.root.iter("*")), None)) is not None:
        path = source.document.path
        plain = path.with_suffix("") if path.suffix == TEMPLATE_SUFFIX else path.with_suffix(f".expanded{path.suffix}")
        plain = plain if plain.suffix else plain.with_suffix(".urdf")
        source.refuse(template, f"is a xacro template: run `xacro {quote(str(path))} > {quote(str(plain))}`, and name {plain}")
    if source.root.tag not in FORMATS:
        source.refuse(source.root, f"the root element is {describe(source.root)}; expected {EXPECTED}")
    return FORMATS[source.root.tag]


def _is_expanded(element: etree._Element) -> bool:
    """True for what xacro writes otherwise: calls, macros, conditions, includes, expressions. A property alone is a leftover."""
    tag = literal_tag(element)
    is_call = tag.startswith("xacro:") and tag not in ("xacro:property", "xacro:arg")
    return is_call or (not tag.startswith("xacro:") and any("${" in value for value in element.attrib.values()))


def read(document: Document, *, floating_base: bool = False, compile_meshes: CompileMeshes | None = None) -> Meaning:
    """Meaning of a document; an MJCF that includes files or makes replicas is changed in place, by having them.

    ``floating_base`` puts a free joint between the world and the root link of a URDF. ``compile_meshes`` gives what meshes of an MJCF
    weigh, which no file states; it is called for files that need it.

    Raises:
        InvalidModel: something in it has no meaning: a number that is none, a joint without axis, links that are no tree, an element
            that makes bodies by the rules of one engine alone.
    """
    source, base = Source(document), ""
    actuators: tuple[Actuator, ...] = ()
    force_limits: ForceLimits = ()
    shapes: Shapes | None = None
    format = _format(source)
    if format == "usd":
        if floating_base:
            source.refuse(source.root, "is a USD file, which says itself which body floats; leave the floating base out")
        # A check of a mechanism needs none of that.
        from harness.files.usd.reading import meaning_of_stage

        stage = meaning_of_stage(document)
        return Meaning(
            format,
            stage.tree,
            stage.equalities,
            stage.left_out,
            passed_over=(),
            unread=stage.unread,
            spring_dampers=stage.spring_dampers,
            declared=stage.declared,
            actuators=stage.actuators,
            force_limits=stage.force_limits,
            unit_roundoff=_FLOAT32,
        )
    if format == "urdf":
        refuse_irregular_files(source)
        reader = UrdfReader(source)
        tree, equalities = reader.read(GRAVITY, floating_base)
        base = reader.floating_base
        (left_out, declared), spring_dampers = left_out_of_urdf(source), SpringDampers()
    elif floating_base:
        source.refuse(source.root, "is an MJCF, which says itself which body floats; leave the floating base out, or write a <freejoint/>")
    else:
        read_file = read_mjcf(source, compile_meshes)
        tree, equalities, spring_dampers = read_file.tree, read_file.equalities, read_file.spring_dampers
        actuators, force_limits = read_file.actuators, read_file.force_limits
        left_out, declared = left_out_of_mjcf(source, tree)
        if source.root.find("worldbody//geom") is not None:
            # Mechanisms have none.
            from harness.files.mjcf.shapes import shapes_in

            shapes = shapes_in(source, tree)
    passed_over, unread = tuple(source.passed_over), tuple(source.unread)
    return Meaning(format, tree, equalities, left_out, passed_over, unread, spring_dampers, base, declared, actuators, force_limits, shapes)
