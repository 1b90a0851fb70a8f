"""Any robot's file, URDF or MJCF, as its format's documentation gives it meaning.

Files in the wild hold much that says nothing of the motion, and some that no equation of motion can hold. What is left out is
listed with its lines; nothing that bears on the motion is read past in silence.

Joints may give time constant and damping ratio, from which stiffness and damping follow. The inertia that they are for is the joint's
own in the reference configuration with all other joints free: 1 / (M^-1)_jj. The documentation speaks of the joint's inertia there;
that other joints are free is MuJoCo 4.0, user/user_model.cc, AutoSpringDamper.

Sources: http://wiki.ros.org/urdf/XML; MuJoCo documentation, XML reference, also ``body/joint/springdamper``; Modeling, section Solver
parameters, ``solref``; Wensing, Kim, Slotine, IEEE RA-L 3(1), 2018, for the inertias that bodies can have.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from harness.errors import InvalidModel
from harness.files.document.source import read_any
from harness.files.document.xml import Document
from harness.files.equalities import Equality
from harness.files.findings import Impossible, LeftOut
from harness.files.given import Given
from harness.files.joint_kinds import JointKind
from harness.files.left_out import Declared
from harness.files.mjcf.inertias import CompileMeshes
from harness.files.model_file import ModelFile, meaning_of
from harness.files.reading import EXPECTED, Meaning, read
from harness.files.tree import WORLD, Actuator, ForceLimits, Joint, SpringDampers, Tree
from harness.files.urdf.kinds import BALL_CONSTRAINT
from harness.programs.evaluation import mass_matrix
from harness.trees import recursion
from harness.trees.bodies.inertias import impossible_inertias, total_mass
from harness.trees.nodes import standing

if TYPE_CHECKING:
    from harness.files.shapes import Shapes

__all__ = ["Impossible", "LeftOut", "Robot", "read_robot", "robot_of", "tree_of"]

# M of more has some hundred thousand entries, and its inverse takes minutes to certify.
MOST_DEGREES_OF_FREEDOM = 500
_BITS = 192
# mjMINVAL, of the square of what an actuator of force 1 does to a coordinate.
_LEAST_MOMENT = 1e-15
# What bodies of robots that float are called, and how many limbs such a robot has at least.
_FOOT = re.compile(r"(foot|feet|toe|ankle|sole|calf|shank)(?![a-z])", re.IGNORECASE)
_FINGER = re.compile(r"finger|thumb|gripper", re.IGNORECASE)
_ROTOR = re.compile(r"rotor|propeller|prop_", re.IGNORECASE)
_TRUNK = re.compile(r"base(?!ment)|trunk|pelvis|torso|(^|_)body|waist", re.IGNORECASE)
_LIMBS = 3


@dataclass(frozen=True)
class Robot:
    """One file and what it means.

    Attributes:
        format: "urdf", "mjcf" or "usd".
        joints: names of the joints that move by themselves, in the order of the file.
        total_mass: of all bodies but the world [kg].
        floating_base: name of the free joint that was put under the root of a URDF; "" for none.
        equalities: points that meet and joints that are coupled, as engines may hold them besides the tree; a joint that mimics another
            is one, and follows the other in the tree.
        declared: elements that no equation of motion holds and that bear on the motion, but limits, friction and equalities.
        actuators: of the file, none of which acts in the tree. force_limits: as of ``Tree``.
        shapes, unit_roundoff: as of ``Meaning``.
    """

    path: Path
    format: str
    tree: Tree
    joints: tuple[str, ...]
    left_out: tuple[LeftOut, ...]
    impossible: tuple[Impossible, ...]
    total_mass: float
    floating_base: str
    equalities: tuple[Equality, ...]
    declared: tuple[Declared, ...]
    actuators: tuple[Actuator, ...]
    force_limits: ForceLimits
    shapes: Shapes | None
    unit_roundoff: float

    @property
    def bodies(self) -> int:
        """Number of bodies."""
        return len(self.tree.bodies)

    @property
    def meshes(self) -> tuple[int, ...]:
        """The lines of geoms whose inertia is that of a mesh as an engine compiled it, of each once."""
        solids = [solid for body in self.tree.bodies for solid in body.solids if solid.kind == "mesh" and not solid.is_massless]
        return tuple(dict.fromkeys(solid.place.line for solid in solids if solid.place))

    @property
    def degrees_of_freedom(self) -> int:
        """Number of velocities."""
        kinds = {joint.name: joint.kind for joint in self.tree.joints}
        return sum(kinds[name].velocities for name in self.joints)

    @property
    def trunk_on_the_world(self) -> str:
        """Name of the body that hangs on the world without a joint though its limbs speak of one that floats; "" for none.

        Feet at two limbs, three rotors, or three limbs of a body that is called as trunks are; hands are called so too.
        """
        before, first, carried = self.tree.joints_before, dict[str, str](), {WORLD: ""}
        for name, above in before.items():
            first[name] = first[above] if above else name
        for body in self.tree.bodies:
            carried[body.name] = body.joints[-1].name if body.joints else carried[body.parent]
        if any(joint.kind is JointKind.FREE for joint in self.tree.joints):
            return ""
        limbs: dict[str, list[str]] = {}
        for name, joint in carried.items():
            limbs.setdefault(first.get(joint, ""), []).append(name)
        standing = [name for name in limbs.pop("", []) if name != WORLD]
        lengths = Counter(first.values())
        feet = sum(any(map(_FOOT.search, names)) for names in limbs.values())
        fingers = sum(any(map(_FINGER.search, names)) for names in limbs.values())
        rotors = sum(bool(_ROTOR.search(name)) for name in carried)
        is_trunk = any(map(_TRUNK.search, standing)) and sum(lengths[limb] > 1 for limb in limbs) > _LIMBS - 1 and 2 * fingers < len(limbs)
        floats = bool(standing) and (feet > 1 or rotors >= _LIMBS or is_trunk)
        return next((name for name in standing if _TRUNK.search(name)), standing[0]) if floats else ""

    def joint(self, name: str) -> Joint:
        """A joint by its name; raises KeyError where there is none."""
        return {joint.name: joint for joint in self.tree.joints}[name]


def read_robot(path: Path, *, floating_base: bool = False, compile_meshes: CompileMeshes | None = None) -> Robot:
    """The robot in a file, URDF or MJCF as its root element says.

    ``floating_base`` puts a free joint between the world and the root link of a URDF.

    ``compile_meshes`` gives what meshes of an MJCF weigh, which no file states. It is called for files that need it.

    Raises:
        InvalidModel: the file cannot be read, or something in it has no meaning: a number that is none, a joint without axis, links
            that are no tree, an element that makes bodies by the rules of one engine alone.
    """
    return robot_in(read_any(path, EXPECTED), floating_base=floating_base, compile_meshes=compile_meshes)


def robot_in(document: Document, *, floating_base: bool = False, compile_meshes: CompileMeshes | None = None) -> Robot:
    """``read_robot`` of a file's elements, which the caller may have changed; raises the same."""
    return _robot(document.path, read(document, floating_base=floating_base, compile_meshes=compile_meshes))


def robot_of(model: ModelFile, gravity: float) -> Robot:
    """The robot in a validated model file; ``gravity`` [m/s^2, along -z] is that of a URDF, which holds none."""
    return _robot(model.path, replace(meaning_of(model), tree=tree_of(model, gravity), spring_dampers=SpringDampers()))


def tree_of(model: ModelFile, gravity: float) -> Tree:
    """The tree of a validated model file; ``gravity`` as of ``robot_of``."""
    meaning = meaning_of(model)
    tree = _whole(meaning)
    if meaning.format == "mjcf":
        return tree
    # The format holds none.
    x, y, down = tree.gravity
    assert isinstance(down, Given)
    return replace(tree, gravity=(x, y, Given(-gravity, down.place, down.attribute, down.index)))


def _whole(meaning: Meaning) -> Tree:
    """The tree with all that its file says of forces; raises InvalidModel where some of that is in no tree."""
    for one in meaning.unread:
        raise InvalidModel(one.place.path, one.place.line, f"{one.what}, which is not read; {one.advice}")
    return with_spring_dampers(meaning.tree, meaning.spring_dampers)


def _robot(path: Path, meaning: Meaning) -> Robot:
    tree = _whole(meaning)
    robot = Robot(
        path=path,
        format=meaning.format,
        tree=tree,
        joints=tuple(joint.name for joint in meaning.moving),
        left_out=meaning.left_out,
        impossible=impossible_inertias(tree),
        total_mass=total_mass(tree),
        floating_base=meaning.floating_base,
        # No engine's reader reads Drake's constraints, which are among what is left out.
        declared=meaning.declared,
        actuators=meaning.actuators,
        force_limits=meaning.force_limits,
        shapes=meaning.shapes,
        unit_roundoff=meaning.unit_roundoff,
        equalities=tuple(one for one in meaning.equalities if one.kind != BALL_CONSTRAINT),
    )
    if robot.degrees_of_freedom > MOST_DEGREES_OF_FREEDOM:
        found = f"has {robot.degrees_of_freedom} degrees of freedom; expected at most {MOST_DEGREES_OF_FREEDOM}"
        raise InvalidModel(path, tree.place.line if tree.place else None, found)
    return robot


def with_spring_dampers(tree: Tree, asked: SpringDampers) -> Tree:
    """The tree whose joints that ask for it have the stiffness and damping that follow from their inertia, rounded to float64."""
    import flint

    if not asked.given:
        return tree
    with flint.ctx.workprec(_BITS):
        inertias = _inertias(tree)

    def changed(joint: Joint) -> Joint:
        if joint.name not in asked.given or joint.place is None:
            return joint
        time, ratio = (flint.arb(float(number)) for number in asked.given[joint.name])
        stiffness = float(inertias[joint.name] / (time * ratio) ** 2) if asked.springs else 0.0
        damping = float(2 * inertias[joint.name] / time) if asked.dampers else 0.0
        # At the joint, for those of a class are other numbers at each.
        return replace(
            joint,
            stiffness=Given(stiffness, joint.place, "stiffness by springdamper"),
            damping=Given(damping, joint.place, "damping by springdamper"),
        )

    return replace(tree, bodies=tuple(replace(body, joints=tuple(map(changed, body.joints))) for body in tree.bodies))


def with_actuators(robot: Robot, numbers: Iterable[int]) -> Robot:
    """The robot on which the actuators of these numbers act, servos with a ratio of damping by ``inertia_at_actuator``."""
    chosen = [robot.actuators[number] for number in numbers]
    acting = tuple(damped_by_ratio(robot.tree, one, inertia_at_actuator) if one.damping_ratio else one for one in chosen)
    return replace(robot, tree=replace(robot.tree, actuators=acting, force_limits=robot.force_limits if acting else ()))


def damped_by_ratio(tree: Tree, actuator: Actuator, inertia: Callable[[Any, Any], Any]) -> Actuator:
    """A servo of ratio z with the damping 2 z sqrt(kp m), rounded to float64, m by ``inertia`` of M and J (nv, 1), balls at the reference.

    Source: MuJoCo documentation, XML reference, ``actuator/position``, dampratio.
    """
    import flint

    from harness.trees.actuators import moment_of

    with flint.ctx.workprec(_BITS):
        nodes = standing(tree)
        outputs = {"mass": recursion.mass_matrix(nodes), "moment": moment_of(nodes, actuator, recursion.generalised)}
        values = nodes.builder.evaluated(outputs, _BITS)
        moment = flint.arb_mat([[value] for value in values["moment"]])
        (sign, stiffness), ratio = actuator.gain[0], flint.arb(float(actuator.damping_ratio))
        damping = 2 * ratio * (sign * float(stiffness) * inertia(mass_matrix(values["mass"], nodes.nv), moment)).sqrt()
    assert actuator.place is not None
    own = Given(float(damping), actuator.place, f"damping of actuator {actuator.number} by dampratio")
    return replace(actuator, bias=(*actuator.bias[:2], (-1, own)))


def inertia_at_actuator(mass: Any, moment: Any) -> Any:
    """1 / (J M^-1 J'); 0 of what drives nothing, which needs no damping."""
    mobility = (moment.transpose() * mass.inv() * moment)[0, 0]
    return 1 / mobility if mobility != 0 else mobility


def inertia_by_coordinates(mass: Any, moment: Any) -> Any:
    """sum M_jj / J_j^2 over the coordinates that are driven."""
    import flint

    driven = [column for column in range(mass.nrows()) if moment[column, 0] ** 2 > _LEAST_MOMENT]
    return sum((mass[column, column] / moment[column, 0] ** 2 for column in driven), flint.arb(0))


def _inertias(tree: Tree) -> dict[str, Any]:
    """1 / (M^-1)_jj of the joints of one axis at the reference, in balls."""
    nodes = standing(tree)
    inverse = mass_matrix(nodes.builder.evaluated({"mass": recursion.mass_matrix(nodes)}, _BITS)["mass"], nodes.nv).inv()
    columns = {name: column for name, (column, *_) in nodes.coordinates.columns.items()}
    return {name: 1 / inverse[column, column] for name, column in columns.items()}
