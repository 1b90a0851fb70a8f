"""DART's ``Skeleton.computeForwardDynamics`` on a URDF, with the root link fixed: its articulated-body algorithm.

DART treats joint dampers implicitly, as its time step needs: with the default step of 1 ms an acceleration is that of the end of the
step. The step of an aided DART is zero, which leaves the acceleration of the state. A free joint's position is a rotation vector, then a
place; its velocity is the angular, then the linear one, both along the axes of its parent. Springs, which DART's loader does not
read, are supplied by the harness.

Motions are those of the steps of its world, with contacts, between links of the file too. Its loader drops shapes of a link that is called
world, so that this link has another name, and reads no coefficients of surfaces: those that stand in ``<contact>`` are set. A pair rubs by
the lesser of two coefficients, and the root link, which is the ground, has the largest one. The rest is its default: collisions by FCL,
pyramids for cones, and bodies that come to rest fall asleep.

Source: DART documentation, dart::utils::DartLoader, dart::dynamics::Skeleton and FreeJoint, dart::simulation::World,
dart::constraint::DefaultContactSurfaceHandler; https://github.com/dartsim/dart/issues/1450.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from lxml import etree

from harness.arrays import Array
from harness.engines import Engine, LoadedModel, Unsupported
from harness.engines.coordinates import FREE, rotation
from harness.engines.loaded_file import refuse_joints
from harness.engines.moving import MotionsRequest, Moved, SimulatedFile, moved_as_they_stand
from harness.engines.reading import captured_standard_error, elements_of, links_without_inertia, text_of, without_shapes
from harness.engines.request import Refused, Request
from harness.engines.state_by_state import StateByState
from harness.files.findings import EFFORT, EQUALITIES, FRICTION, LIMITS
from harness.files.joint_kinds import JointKind
from harness.files.model_file import ModelFile
from harness.files.tree import WORLD

# Of its messages in a terminal.
_COLOURS = re.compile("\x1b\\[[0-9;]*m")
# The name of a link that is called world, and what Bullet calls a coefficient of friction in a file.
_GROUND, _FRICTION = "world of the file", "lateral_friction"


class DartModel(StateByState):
    """A ``Skeleton``."""

    rotation_first = True
    applies_dampers = True

    def __init__(self, skeleton: Any, request: Request, notes: tuple[str, ...]) -> None:
        joints = [joint for joint in skeleton.getJoints() if joint.getNumDofs()]
        if unknown := {joint.getType() for joint in joints if joint.getNumDofs() not in (1, FREE[1])}:
            raise Unsupported(f"joints of the kinds {', '.join(sorted(unknown))} are not known to the harness's adapter of DART")
        self._moving = {
            request.floating_base if request.floating_base and joint.getNumDofs() == FREE[1] else joint.getName(): joint for joint in joints
        }
        places = {name: int(joint.getIndexInSkeleton(0)) for name, joint in self._moving.items()}
        super().__init__(request, places, skeleton.getNumDofs())
        self.skeleton, self.notes = skeleton, notes

    def loaded(self) -> LoadedModel:
        mass = sum(body.getMass() for body in self.skeleton.getBodyNodes() if body.getNumDependentGenCoords())
        sizes = {name: (1, 1) if joint.getNumDofs() == 1 else FREE for name, joint in self._moving.items()}
        return LoadedModel(sizes, tuple(map(float, self.skeleton.getGravity())), float(mass))

    def _go_to(self, q: Array, v: Array) -> None:
        import dartpy

        positions = np.zeros(self.width)
        for name, size in self.columns.sizes.items():
            given = q[self.columns.spans(name)[0]]
            if size == FREE:
                pose = dartpy.math.Isometry3()
                pose.set_rotation(rotation(given[3:]))
                pose.set_translation(given[:3])
                given = dartpy.dynamics.FreeJoint.convertToPositions(pose)
            positions[self.places[name] : self.places[name] + len(given)] = given
        self.skeleton.setPositions(positions)
        self.skeleton.setVelocities(v)

    def _accelerations(self, force: Array) -> Array:
        self.skeleton.setForces(force)
        self.skeleton.computeForwardDynamics()
        return np.asarray(self.skeleton.getAccelerations())

    def _mass_matrix(self) -> Array:
        return np.asarray(self.skeleton.getMassMatrix())

    def _bias(self) -> Array:
        return np.asarray(self.skeleton.getCoriolisAndGravityForces() + self._dampers())

    def _dampers(self) -> Array:
        damping = np.array([dof.getDampingCoefficient() for dof in self.skeleton.getDofs()])
        return np.asarray(damping * self.skeleton.getVelocities())

    def _parts_of_bias(self) -> tuple[Array, Array, Array]:
        return np.asarray(self.skeleton.getCoriolisForces()), np.asarray(self.skeleton.getGravityForces()), self._dampers()

    def _link(self, body: str) -> tuple[Array, Array, Array]:
        node = self.skeleton.getBodyNode(body)
        pose = node.getWorldTransform()
        jacobian = np.vstack([self.skeleton.getLinearJacobian(node), self.skeleton.getAngularJacobian(node)])
        return pose.rotation(), pose.translation(), jacobian


class DartEngine(Engine):
    title = "DART"
    requires = ("dartpy", "dartpy")
    formats = ("urdf",)
    optional = True
    supplied: Mapping[str, str] = {
        "urdf": (
            "gravity, springs of joints and springs between points are supplied from the file, and no inertia where a link has none; "
            "dampers are its own, at a time step of 0"
        )
    }
    beside_tau: Mapping[str, str] = {
        EFFORT: "DART bounds commands by effort, and forces that are set by none (DART, dynamics/detail/GenericJoint.hpp, setCommand)"
    }
    why_off: Mapping[str, str] = {
        EQUALITIES: "computeForwardDynamics holds no joints together, which a step of its world does",
        FRICTION: "computeForwardDynamics applies no dry friction, which a step of its world does",
        LIMITS: "computeForwardDynamics knows no joint limits, which a step of its world does",
    }
    call: Mapping[str, str] = {
        "urdf": (
            "loader.setOptions(DartLoaderOptions(defaultRootJointType=DartLoaderRootJointType.FIXED)); "
            "s = loader.parseSkeleton(PATH); s.computeForwardDynamics()"
        )
    }

    def refuse(self, file: ModelFile) -> None:
        refused = [(one.line, f"{one.couples} constraint {one.name!r} is none of what its loader reads") for one in file.constraints]
        refused += [
            (one.places["armature"].line, f"reflected inertia of joint {one.name!r}, which its algorithm does not know")
            for one in file.armatures
        ]
        if file.ball_joint is not None:
            line = file.joint_lines[file.ball_joint]
            refused.append((line, f"ball joint {file.ball_joint!r}, while its loader hangs a root link by a free or a fixed joint alone"))
        if refused:
            raise Unsupported("DART: " + "; ".join(f"line {line}: {what}" for line, what in sorted(refused)))

    def moved(self, request: MotionsRequest) -> Moved:
        """See ``harness.engines.Engine``; of files as they stand."""
        return moved_as_they_stand(self.title, request, _moved)

    def read(self, request: Request) -> DartModel:
        import dartpy

        free = [joint.name for joint in request.joints if joint.kind == JointKind.FREE]
        refuse_joints(request, "DART", [request.floating_base] if request.text is None else free)
        place = request.path.resolve().as_uri() if request.text is None else ""
        skeleton, notes = _read_without_meshes(request, lambda content: _parsed(content, place, floats=bool(request.floating_base)))
        if request.aid is not None:
            if request.aid.armature.any():
                raise Refused("its algorithm knows no rotor inertias of joints, which no force supplies")
            skeleton.setGravity(request.aid.gravity)
            skeleton.setTimeStep(0.0)
            empty = {link.get("name") for link in links_without_inertia(elements_of(request))}
            # It warns of a body without mass, and computes with one.
            with captured_standard_error():
                for body in skeleton.getBodyNodes():
                    if body.getName() in empty:
                        body.setInertia(dartpy.dynamics.Inertia(0.0, np.zeros(3), np.zeros((3, 3))))
        return DartModel(skeleton, request, notes)


def _parsed(content: str, place: str, floats: bool) -> Any:
    """The skeleton of a text whose file is at ``place``. Raises Refused."""
    import dartpy

    loader, kinds = dartpy.utils.DartLoader(), dartpy.utils.DartLoaderRootJointType
    loader.setOptions(dartpy.utils.DartLoaderOptions(defaultRootJointType=kinds.FLOATING if floats else kinds.FIXED))
    # The reasons go to standard error alone.
    with captured_standard_error() as captured:
        skeleton = loader.parseSkeletonString(content, dartpy.common.Uri(place))
        if skeleton is None:
            raise Refused(_COLOURS.sub("", " ".join((captured() or "its loader refuses the file without a reason").split())))
    return skeleton


def _moved(motion: SimulatedFile, request: MotionsRequest) -> tuple[Array, Array]:
    """q and v, (k, joints) each, after the recorded steps of one motion."""
    import dartpy

    root = etree.parse(motion.file.path, etree.XMLParser(resolve_entities=False)).getroot()
    _rename_world(root)
    skeleton = _parsed(text_of(root), motion.file.path.resolve().as_uri(), floats=False)
    _set_surfaces(skeleton, root)
    skeleton.enableSelfCollisionCheck()
    skeleton.enableAdjacentBodyCheck()
    joints = {joint.getName(): joint for joint in skeleton.getJoints()}
    if lacking := [name for name in request.joints if name not in joints]:
        raise Refused(f"it has no joint {lacking[0]!r}")
    places = [int(joints[name].getIndexInSkeleton(0)) for name in request.joints]
    state = np.zeros((2, skeleton.getNumDofs()))
    state[:, places] = request.q, request.v
    skeleton.setPositions(state[0])
    skeleton.setVelocities(state[1])
    world = dartpy.simulation.World()
    world.setTimeStep(motion.file.length)
    world.addSkeleton(skeleton)
    found, done = [], 0
    for until in motion.counts:
        for _ in range(done, until):
            world.step()
        done = until
        found.append((skeleton.getPositions()[places], skeleton.getVelocities()[places]))
    q, v = (np.array([state[part] for state in found]) for part in range(2))
    return q, v


def _rename_world(root: etree._Element) -> None:
    for path, attribute in (("link", "name"), ("joint/parent", "link")):
        for element in root.iterfind(path):
            if element.get(attribute) == WORLD:
                element.set(attribute, _GROUND)


def _set_surfaces(skeleton: Any, root: etree._Element) -> None:
    """Friction and restitution of links from ``<contact>``, where they stand there."""
    numbers = {(link.get("name"), one.tag): float(one.get("value")) for link in root.iterfind("link") for one in link.iterfind("contact/*")}
    own = skeleton.getRootBodyNode().getName()
    most = max((value for (link, what), value in numbers.items() if what == _FRICTION and link != own), default=None)
    if most is not None:
        numbers[own, _FRICTION] = most
    for body in skeleton.getBodyNodes():
        for shape in body.getShapeNodes():
            surface, link = shape.getDynamicsAspect(), body.getName()
            if surface is not None:
                surface.setFrictionCoeff(numbers.get((link, _FRICTION), surface.getFrictionCoeff()))
                surface.setRestitutionCoeff(numbers.get((link, "restitution"), surface.getRestitutionCoeff()))


def _read_without_meshes(request: Request, read: Callable[[str], Any]) -> tuple[Any, tuple[str, ...]]:
    """The result of ``read`` on the file; without its meshes where it refuses it with them, as where they are elsewhere, which a note says.

    Raises:
        Refused: from ``read``, with the meshes, where it refuses the file without them too.
    """
    try:
        return read(request.content.decode()), ()
    except Refused as refusal:
        if elements_of(request).find(".//geometry/mesh") is None:
            raise
        try:
            found = read(text_of(without_shapes(elements_of(request), meshes_alone=True)))
        except Refused:
            raise refusal from None
        return found, (f"refused with its meshes, and read without them: {refusal}",)


ENGINE = DartEngine()
