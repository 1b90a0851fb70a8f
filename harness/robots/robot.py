"""Any robot's file, URDF or MJCF, as its format's documentation gives it meaning.

Files in the wild hold much that says nothing of the motion, and some that no equation of motion can hold. What is left out is
listed with its lines; nothing that bears on the motion is read past in silence.

Sources: http://wiki.ros.org/urdf/XML; MuJoCo documentation, XML reference; Wensing, Kim, Slotine, IEEE RA-L 3(1), 2018, for the
inertias that bodies can have.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from harness.errors import InvalidModel
from harness.files.equalities import Equality
from harness.files.findings import Impossible, LeftOut
from harness.files.tree import Joint, Tree
from harness.models.mjcf import left_out as mjcf_left_out
from harness.models.mjcf import reading as mjcf
from harness.models.mjcf.expansion import expand
from harness.models.mjcf.meshes import CompileMeshes, Meshes
from harness.models.model_file import ModelFile
from harness.models.source import Source
from harness.models.urdf import left_out as urdf_left_out
from harness.models.urdf import mimics as urdf_mimics
from harness.models.urdf import reading as urdf
from harness.models.xml import Document, describe, parse_any, read_any
from harness.robots.inertias import impossible_inertias, total_mass
from harness.robots.nodes import SIZES
from harness.robots.spring_dampers import with_spring_dampers

if TYPE_CHECKING:
    from lxml import etree

__all__ = ["Impossible", "LeftOut", "Robot", "read_robot", "robot_of", "tree_of"]

# What an empty file should have been.
_EXPECTED = "a robot: a URDF, whose root element is <robot>, or an MJCF, whose root element is <mujoco>"
_FORMATS = {"robot": "urdf", "mujoco": "mjcf"}
# M of more has some hundred thousand entries, and its inverse takes minutes to certify.
MOST_DEGREES_OF_FREEDOM = 500


@dataclass(frozen=True)
class Robot:
    """One file and what it means.

    Attributes:
        format: "urdf" or "mjcf", as its root element says.
        joints: names of the joints that move by themselves, in the order of the file.
        total_mass: of all bodies but the world [kg].
        floating_base: name of the free joint that was put under the root of a URDF; "" for none.
        equalities: points that meet and joints that are coupled, as engines may hold them besides the tree; a joint that mimics another
            is one, and follows the other in the tree.
    """

    path: Path
    format: str
    tree: Tree
    joints: tuple[str, ...]
    left_out: tuple[LeftOut, ...]
    impossible: tuple[Impossible, ...]
    total_mass: float
    floating_base: str = ""
    equalities: tuple[Equality, ...] = ()

    @property
    def bodies(self) -> int:
        """Number of bodies."""
        return len(self.tree.bodies)

    @property
    def meshes(self) -> tuple[int, ...]:
        """The lines of geoms whose inertia is that of a mesh as an engine compiled it, of each once."""
        solids = [solid for body in self.tree.bodies for solid in body.solids if solid.kind == "mesh"]
        return tuple(dict.fromkeys(solid.place.line for solid in solids if solid.place))

    @property
    def degrees_of_freedom(self) -> int:
        """Number of velocities."""
        kinds = {joint.name: joint.kind for joint in self.tree.joints}
        return sum(SIZES[kinds[name]][1] for name in self.joints)

    def joint(self, name: str) -> Joint:
        """A joint by its name; raises KeyError where there is none."""
        return {joint.name: joint for joint in self.tree.joints}[name]


def read_robot(path: Path, *, floating_base: bool = False, gravity: float = 9.81, compile_meshes: CompileMeshes | None = None) -> Robot:
    """The robot in a file, URDF or MJCF as its root element says.

    ``floating_base`` puts a free joint between the world and the root link of a URDF, which holds no gravity either: ``gravity``
    [m/s^2] points along -z there.

    ``compile_meshes`` gives what meshes of an MJCF weigh, which no file states. It is called for files that need it.

    Raises:
        InvalidModel: the file cannot be read, or something in it has no meaning: a number that is none, a joint without axis, links
            that are no tree, an element that makes bodies by the rules of one engine alone.
    """
    return _read(read_any(path, _EXPECTED), floating_base, gravity, compile_meshes)


def format_of(path: Path) -> str:
    """The format of a robot's file, "urdf" or "mjcf", by its root element.

    Raises:
        InvalidModel: the file cannot be read, or is no robot.
    """
    source = Source()
    return _format(source, source.add(read_any(path, _EXPECTED)))


def _format(source: Source, root: etree._Element) -> str:
    if root.tag not in _FORMATS:
        source.refuse(root, f"the root element is {describe(root)}; expected {_EXPECTED}")
    return _FORMATS[root.tag]


def robot_of(model: ModelFile, gravity: float) -> Robot:
    """The robot in a validated model file; ``gravity`` as of ``read_robot``."""
    return _read(parse_any(model.path, model.text, _EXPECTED), False, gravity)


def tree_of(model: ModelFile, gravity: float) -> Tree:
    """The tree of a validated model file; ``gravity`` as of ``read_robot``."""
    return robot_of(model, gravity).tree


def _read(document: Document, floating_base: bool, gravity: float, compile_meshes: CompileMeshes | None = None) -> Robot:
    source = Source()
    root = source.add(document)
    model_format = _format(source, root)
    if model_format == "urdf":
        tree, left_out = urdf.read_tree(source, root, gravity, floating_base), urdf_left_out.left_out(source, root)
        equalities = urdf_mimics.equalities(source, root, tree)
    elif floating_base:
        source.refuse(root, "is an MJCF, which says itself which body floats; leave the floating base out, or write a <freejoint/>")
    else:
        expand(source, root, document.path)
        meshes = None if compile_meshes is None else Meshes(document.path, compile_meshes)
        tree, equalities, spring_dampers = mjcf.read_tree(source, root, meshes)
        tree = with_spring_dampers(tree, spring_dampers)
        left_out = mjcf_left_out.left_out(source, root, tree)
    robot = Robot(
        path=document.path,
        format=model_format,
        tree=tree,
        joints=_moving(tree, model_format),
        left_out=left_out,
        impossible=impossible_inertias(tree),
        total_mass=total_mass(tree),
        floating_base=urdf.FLOATING_BASE if floating_base else "",
        equalities=equalities,
    )
    if robot.degrees_of_freedom > MOST_DEGREES_OF_FREEDOM:
        found = f"has {robot.degrees_of_freedom} degrees of freedom; expected at most {MOST_DEGREES_OF_FREEDOM}"
        raise InvalidModel(document.path, source.place(root).line, found)
    return robot


def _moving(tree: Tree, model_format: str) -> tuple[str, ...]:
    """The joints that move by themselves in the order of the file, behind a floating base that is none of its own."""
    moving = [joint for joint in tree.joints if not joint.follows]
    if model_format == "urdf":
        # A tree has them by depth.
        moving.sort(key=lambda joint: (joint.name != urdf.FLOATING_BASE, joint.place.element if joint.place else 0))
    return tuple(joint.name for joint in moving)
