"""A stage in PhysX: its articulations, asked by tensor bindings at one state after the other.

Bindings take angles in radians, where the attributes that replace them take degrees. A base that floats moves by the velocity of the centre
of mass of its link, and turns about the axes of the world. A spherical joint has the components of a rotation vector and of the angular
velocity of its body, along axes of its own. The harness's velocities are those of the base's origin, and about the axes of the parent.

Source: ovphysx documentation, Tensor bindings, and Readable data: whole articulations.
"""

from __future__ import annotations

import math
import tempfile
import warnings
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import ovphysx
import ovstage
from ovphysx.samples.python_samples.schema_support import physx_schema_paths
from ovphysx.types import LogLevel, SimObjectType, TensorType

from harness.arrays import Array
from harness.engines.adapters.physx.anchors import write_anchored
from harness.engines.coordinates import cross_matrix, rotation
from harness.engines.interface import NotOffered
from harness.engines.loaded_file import refuse_joints
from harness.engines.request import AskedJoint, Refused, Request
from harness.engines.state_by_state import StateByState
from harness.files.joint_kinds import JointKind

_ORDINAL = 1
_BASE, _BALL = 6, 3
_AT_ORIGIN = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])


class Articulation:
    """One articulation of a scene, in PhysX's own coordinates.

    Attributes:
        joints: paths of the prims whose axes its degrees of freedom are, in their order. floats: whether nothing fixes its first link.
        columns: of its base and joints among those of all articulations. links: names of its bodies.
        armature, friction: rotor inertias [kg or kg m^2] and viscous friction [N s/m or N m s] that PhysX holds, (joints,).
        centres: of mass of its links, each in the link's frame, (links, 3) [m].
    """

    def __init__(self, physx: Any, path: str, joints: Sequence[str], floats: bool, start: int) -> None:
        self._physx, self._path = physx, path
        self.joints, self.floats = joints, floats
        self.columns = slice(start, start + _BASE * floats + len(joints))
        self._bindings: dict[TensorType, tuple[Any, Array]] = {}
        # The first question of a scene takes a step, before any state is taken.
        self.centres = self.read(TensorType.ARTICULATION_BODY_COM_POSE)[:, :3]
        self.links: Sequence[str] = self._binding(TensorType.ARTICULATION_BODY_COM_POSE)[0].body_names
        self.armature = self.read(TensorType.ARTICULATION_DOF_ARMATURE) if joints else np.empty(0)
        self.friction = self.read(TensorType.ARTICULATION_DOF_FRICTION_PROPERTIES)[:, 2] if joints else np.empty(0)

    def _binding(self, kind: TensorType) -> tuple[Any, Array]:
        if kind not in self._bindings:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", DeprecationWarning)
                made = self._physx.create_tensor_binding(pattern=self._path, tensor_type=kind, raise_if_empty=True)
            self._bindings[kind] = made, np.zeros(made.shape, dtype=np.float32)
        return self._bindings[kind]

    def read(self, kind: TensorType) -> Array:
        binding, values = self._binding(kind)
        binding.read(values)
        return np.asarray(values[0], dtype=float)

    def write(self, kind: TensorType, given: Array) -> None:
        binding, values = self._binding(kind)
        values[0] = given
        binding.write(values)

    def place(self, pose: Array, velocity: Array) -> None:
        """Put the base at a position and (w, x, y, z), with the velocity of its centre of mass and its angular velocity."""
        self.write(TensorType.ARTICULATION_ROOT_POSE, pose[[0, 1, 2, 4, 5, 6, 3]])
        self.write(TensorType.ARTICULATION_ROOT_VELOCITY, velocity)

    def move(self, positions: Array, velocities: Array) -> None:
        if self.joints:
            self.write(TensorType.ARTICULATION_DOF_POSITION, positions)
            self.write(TensorType.ARTICULATION_DOF_VELOCITY, velocities)

    def axes_of(self, joint: str, body: str) -> Array:
        """(3, 3): the axes of a spherical joint in the frame of its body, as columns, by how that turns at a rate of one about each."""
        first, link, found = self.joints.index(joint), self.number_of(body), np.empty((_BALL, _BALL))
        for number in range(_BALL):
            self.move(np.zeros(len(self.joints)), np.eye(len(self.joints))[first + number])
            turn = rotation(self.read(TensorType.ARTICULATION_LINK_POSE)[link, [6, 3, 4, 5]])
            found[:, number] = turn.T @ self.read(TensorType.ARTICULATION_LINK_VELOCITY)[link, 3:]
        return found

    def number_of(self, body: str) -> int:
        """The number of a link; -1 for one of another articulation."""
        name = body.rpartition("/")[2]
        return self.links.index(name) if name in self.links else -1


class PhysxFile(StateByState):
    """A stage that PhysX has loaded; ``places`` are columns of all its articulations, one after the other.

    A base that floats in PhysX and by no joint of the request is at rest in the origin, and free.
    """

    def __init__(self, request: Request, articulations: Sequence[Articulation]) -> None:
        places = {joint.name: column for joint in request.joints for one in articulations for column in _column_of(joint, one)}
        super().__init__(request, places, articulations[-1].columns.stop)
        self._articulations = articulations
        self._axes = {
            joint.name: one.axes_of(joint.tag, joint.body)
            for joint in self.found
            for one in articulations
            if joint.kind == JointKind.BALL and joint.tag in one.joints
        }
        # An aided engine is supplied with these.
        self._armature, self._friction = np.zeros((2, self.width))
        for one in articulations if request.aid is None else ():
            joints = slice(one.columns.start + _BASE * one.floats, one.columns.stop)
            self._armature[joints], self._friction[joints] = one.armature, one.friction
        # Takes the harness's velocities to PhysX's; the accelerations there that velocities alone cause; the latter.
        self._to_own, self._towards, self._velocities = np.eye(self.width), np.zeros(self.width), np.zeros(self.width)

    def _go_to(self, q: Array, v: Array) -> None:
        positions, self._to_own, self._towards = np.zeros(self.width), np.eye(self.width), np.zeros(self.width)
        bases: dict[int, Array] = {}
        for name, (nq, nv) in self.columns.sizes.items():
            own, at = q[self.columns.spans(name)[0]], self.places[name]
            if nq == nv:
                positions[at] = own[0]
            elif name in self._axes:
                axes, places = self._axes[name], slice(at, at + _BALL)
                positions[places], self._to_own[places, places] = axes.T @ _rotation_vector(own), axes.T @ rotation(own).T
            else:
                bases[at] = own
        for one in (one for one in self._articulations if one.columns.start in bases):
            linear, angular = (slice(one.columns.start + start, one.columns.start + start + 3) for start in (0, 3))
            arm = rotation(bases[one.columns.start][3:]) @ one.centres[0]
            self._to_own[linear, angular] = -cross_matrix(arm)
            self._towards[linear] = np.cross(v[angular], np.cross(v[angular], arm))
        self._velocities = self._to_own @ v
        for one in self._articulations:
            own, start = self._velocities[one.columns], _BASE * one.floats
            if one.floats:
                one.place(bases.get(one.columns.start, _AT_ORIGIN), own[:start])
            one.move(positions[one.columns][start:], own[start:])

    def _own_mass_matrix(self) -> Array:
        found = np.diag(self._armature)
        for one in self._articulations:
            found[one.columns, one.columns] += one.read(TensorType.ARTICULATION_MASS_MATRIX)
        return found

    def _mass_matrix(self) -> Array:
        return np.asarray(self._to_own.T @ self._own_mass_matrix() @ self._to_own)

    def _accelerations(self, force: Array) -> Array:
        mass = self._mass_matrix() + self.turn.T @ np.diag(self.armature) @ self.turn
        try:
            return np.asarray(np.linalg.solve(mass, force - self._bias()))
        except np.linalg.LinAlgError:
            return np.full(self.width, np.nan)

    def _bias(self) -> Array:
        velocity, gravity, damping = self._parts_of_bias()
        return velocity + gravity + damping

    def _parts_of_bias(self) -> tuple[Array, Array, Array]:
        kinds = TensorType.ARTICULATION_CORIOLIS_AND_CENTRIFUGAL_FORCE, TensorType.ARTICULATION_GRAVITY_FORCE
        coriolis, gravity = (np.concatenate([one.read(kind) for one in self._articulations]) for kind in kinds)
        velocity = coriolis + self._own_mass_matrix() @ self._towards
        back = self._to_own.T
        return back @ velocity, back @ gravity, back @ (self._friction * self._velocities)

    def _link(self, body: str) -> tuple[Array, Array, Array]:
        one, number = next(((one, found) for one in self._articulations if (found := one.number_of(body)) >= 0), (None, -1))
        if one is None:
            raise NotOffered(f"PhysX has no link {body!r}")
        pose = one.read(TensorType.ARTICULATION_LINK_POSE)[number]
        turn, origin, jacobian = rotation(pose[[6, 3, 4, 5]]), pose[:3], np.zeros((6, self.width))
        # The rows of a base that is fixed are left out.
        row = 6 * (number - (not one.floats))
        if row >= 0:
            jacobian[:, one.columns] = one.read(TensorType.ARTICULATION_JACOBIAN)[row : row + 6]
        jacobian = jacobian @ self._to_own
        # Its velocities are of the centre of mass.
        jacobian[:3] += cross_matrix(turn @ one.centres[number]) @ jacobian[3:]
        return turn, origin, jacobian


def _column_of(joint: AskedJoint, one: Articulation) -> Sequence[int]:
    """The first column of a joint in an articulation; none of one that is not there."""
    if joint.kind == JointKind.FREE:
        return [one.columns.start] if one.floats and one.number_of(joint.tag) == 0 else []
    return [one.columns.start + _BASE * one.floats + one.joints.index(joint.tag)] if joint.tag in one.joints else []


def _rotation_vector(quaternion: Array) -> Array:
    """(3,) of a unit quaternion (w, x, y, z), of an angle up to half a turn."""
    quaternion = quaternion if quaternion[0] >= 0 else -quaternion
    sine = float(np.linalg.norm(quaternion[1:]))
    return np.asarray(quaternion[1:] * (2 * math.atan2(sine, quaternion[0]) / sine if sine else 2.0))


def read(request: Request) -> PhysxFile:
    """The stage of a request in a scene of PhysX of its own; raises Refused, in the engine's words where it has any."""
    refuse_joints(request, "PhysX", [joint.name for joint in request.joints if joint.kind.has_attitude])
    joints = Counter(joint.body for joint in request.joints)
    if request.aid is None and (several := [body for body, count in joints.items() if count > 1]):
        raise Refused(f"a link of PhysX hangs by one joint, and {several[0]!r} has {joints[several[0]]}; give each a body of its own")
    with tempfile.TemporaryDirectory() as folder:
        path = request.path.resolve()
        if request.aid is not None:
            over = Path(folder) / "anchored.usda"
            write_anchored(
                path, over, [joint.tag for joint in request.joints if joint.kind == JointKind.FREE], bool(request.aid.gravity.any())
            )
            path = over
        physx = physx_at(path)
    if not (found := articulations_of(physx)):
        raise Refused("it finds no articulation in the stage; apply PhysicsArticulationRootAPI to the root of the robot")
    return PhysxFile(request, found)


def physx_at(path: Path) -> Any:
    """An instance of PhysX with the stage at a path; raises Refused."""
    ovphysx.PhysX.set_cpu_mode(True)
    ovphysx.set_log_level(LogLevel.ERROR)
    # Tasks of small scenes are done sooner in the thread that calls.
    ovphysx.set_global_config(ovphysx.GlobalConfigKey.NUM_THREADS, 0)
    physx, stage = ovphysx.PhysX(), ovstage.Stage(str(path))
    # Attributes of schemas that are not registered are lost.
    ovstage.population.register_usd_schemas([*map(str, physx_schema_paths()), str(ovphysx.newton_schema_root())])
    try:
        ovstage.population.open_usd(stage, str(path), ordinal=_ORDINAL, domains=ovstage.PopulationDomain.ALL)
        stage.advance_write_floor(ordinal=_ORDINAL).wait()
        physx.wait_task(physx.attach_ovstage(stage, read_ordinal=_ORDINAL))
    except (ovstage.OvstageError, RuntimeError) as error:
        raise Refused(str(error)) from error
    return physx


def articulations_of(physx: Any) -> list[Articulation]:
    """The articulations of a scene, by what PhysX says of their degrees of freedom."""
    found: list[Articulation] = []
    told: dict[str, dict[str, Any]] = {}
    with physx.read_sync(SimObjectType.ARTICULATION, ["dofJointPath", "isFixedBase"]) as result:
        words = result.dictionary
        for group in result.groups:
            rows = group.tensors[0].numpy()
            for path, row in zip(words.get_path_strings(group.prim_list), rows, strict=True):
                told.setdefault(path, {})[words.token_to_string(group.attribute)] = np.atleast_1d(row)
        for path, about in told.items():
            joints = [words.path_to_string(int(one)) for one in about.get("dofJointPath", ()) if one]
            start = found[-1].columns.stop if found else 0
            found.append(Articulation(physx, path, joints, not int(about["isFixedBase"][0]), start))
    return found
