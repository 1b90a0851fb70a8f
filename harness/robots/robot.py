"""Any robot's file, URDF or MJCF, as its format's documentation gives it meaning.

Files in the wild hold much that says nothing of the motion, and some that no equation of motion can hold. What is left out is
listed with its lines; nothing that bears on the motion is read past in silence.

Sources: http://wiki.ros.org/urdf/XML; MuJoCo documentation, XML reference; Wensing, Kim, Slotine, IEEE RA-L 3(1), 2018, for the
inertias that bodies can have.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from harness.errors import InvalidModel
from harness.files.equalities import Equality
from harness.files.findings import Impossible, LeftOut
from harness.files.tree import Joint, Tree
from harness.models.formats import BALL_CONSTRAINT
from harness.models.mjcf.meshes import CompileMeshes
from harness.models.model_file import ModelFile
from harness.models.reading import EXPECTED, GRAVITY, read
from harness.models.urdf.reading import FLOATING_BASE
from harness.models.xml import Document, parse_any, read_any
from harness.robots.inertias import impossible_inertias, total_mass
from harness.robots.spring_dampers import with_spring_dampers

__all__ = ["Impossible", "LeftOut", "Robot", "read_robot", "robot_of", "tree_of"]

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
        return sum(kinds[name].velocities for name in self.joints)

    def joint(self, name: str) -> Joint:
        """A joint by its name; raises KeyError where there is none."""
        return {joint.name: joint for joint in self.tree.joints}[name]


def read_robot(path: Path, *, floating_base: bool = False, gravity: float = GRAVITY, compile_meshes: CompileMeshes | None = None) -> Robot:
    """The robot in a file, URDF or MJCF as its root element says.

    ``floating_base`` puts a free joint between the world and the root link of a URDF, which holds no gravity either: ``gravity``
    [m/s^2] points along -z there.

    ``compile_meshes`` gives what meshes of an MJCF weigh, which no file states. It is called for files that need it.

    Raises:
        InvalidModel: the file cannot be read, or something in it has no meaning: a number that is none, a joint without axis, links
            that are no tree, an element that makes bodies by the rules of one engine alone.
    """
    return _robot(read_any(path, EXPECTED), floating_base, gravity, compile_meshes)


def robot_of(model: ModelFile, gravity: float) -> Robot:
    """The robot in a validated model file; ``gravity`` as of ``read_robot``."""
    return _robot(parse_any(model.path, model.text, EXPECTED), False, gravity)


def tree_of(model: ModelFile, gravity: float) -> Tree:
    """The tree of a validated model file; ``gravity`` as of ``read_robot``."""
    return robot_of(model, gravity).tree


def _robot(document: Document, floating_base: bool, gravity: float, compile_meshes: CompileMeshes | None = None) -> Robot:
    reading = read(document, floating_base=floating_base, gravity=gravity, compile_meshes=compile_meshes)
    for one in reading.unread:
        raise InvalidModel(one.place.path, one.place.line, f"{one.what}, which is not read; {one.advice}")
    tree = with_spring_dampers(reading.tree, reading.spring_dampers)
    robot = Robot(
        path=document.path,
        format=reading.format,
        tree=tree,
        joints=tuple(joint.name for joint in reading.moving),
        left_out=reading.left_out,
        impossible=impossible_inertias(tree),
        total_mass=total_mass(tree),
        floating_base=FLOATING_BASE if floating_base else "",
        # No engine's reader reads Drake's constraints, which are among what is left out.
        equalities=tuple(one for one in reading.equalities if one.kind != BALL_CONSTRAINT),
    )
    if robot.degrees_of_freedom > MOST_DEGREES_OF_FREEDOM:
        found = f"has {robot.degrees_of_freedom} degrees of freedom; expected at most {MOST_DEGREES_OF_FREEDOM}"
        raise InvalidModel(document.path, document.lines[document.root], found)
    return robot
