"""MuJoCo as its user calls it: ``mujoco.MjModel.from_xml_path``, then ``mujoco.mj_forward``.

What acts by constraints (limits, contacts, friction loss, and equalities that are not asked for) is off, and so are actuators and the
fluid. Meshes that are not beside the file are taken out with their geoms, and the answer says so. An aided MuJoCo has what it leaves out of
a URDF besides.

Source: MuJoCo documentation, Modeling, URDF extensions; API reference, ``mjtDisableBit`` and ``MjSpec``.
"""

from __future__ import annotations

import math
import re
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
from lxml import etree

from harness.arrays import Array
from harness.engines.adapters.mujoco.acting import let_act
from harness.engines.adapters.mujoco.compiled import compiled
from harness.engines.adapters.mujoco.contacts import found_contacts, shapes_that_touch
from harness.engines.adapters.mujoco.model import MujocoModel, step
from harness.engines.adapters.mujoco.urdf import supplied, turn_of
from harness.engines.adapters.mujoco.versions import compiling, delete, fill_mass_matrix, inputs_in_place, stages_off
from harness.engines.coordinates import multiplied, of_linear, rotations
from harness.engines.interface import CompiledNumber
from harness.engines.loaded_file import EngineRun, LoadedFile
from harness.engines.reading import elements_of, root_link, text_of
from harness.engines.request import Aid, AskedJoint, BodyInertia, Refused, Request
from harness.files.contacts import FoundContact
from harness.files.facts import ForceElement
from harness.files.joint_kinds import JointKind
from harness.files.rules import StepRule

# What MuJoCo says where a file of an asset is missing or cannot be read.
_MISSING = re.compile("opening file|resource|decoder|unknown mesh|mesh file|STL|OBJ|texture|asset", re.IGNORECASE)
# Radius of a geom that stands for one of a mesh [m].
POINT = 1e-3
# Joints that MuJoCo's reader makes of one, in a row: a planar joint becomes NAME_TX, NAME_TY and NAME_RZ.
_PARTS = {JointKind.PLANAR: 3}


def read(request: Request) -> MujocoFile:
    """A file as its user loads it, or aided; see ``harness.engines.Engine``."""
    with refusals():
        model, notes = plain_model(request) if request.aid is None else _aided(request, request.aid)
        if request.held is not None:
            let_act(model, _places(model, request.joints), request.held)
    return MujocoFile(model, request, notes)


def compiled_numbers(request: Request) -> tuple[CompiledNumber, ...]:
    """See ``harness.engines.Engine.compiled``."""
    with refusals():
        return tuple(compiled(plain_model(request)[0], request.driven))


@contextmanager
def refusals() -> Iterator[None]:
    """Raises Refused of what MuJoCo says of a file, and MemoryError as ``versions.compiling``."""
    # The default handler writes a log file into the current directory.
    mujoco.set_mju_user_warning(lambda message: None)
    try:
        with compiling():
            yield
    except ValueError as error:
        raise Refused(" ".join(str(error).split())) from error


def _spec(request: Request, at_the_top: bool = False) -> Any:
    """The model; ``at_the_top`` takes the root link for the world where links float from it, so that these are at the top of the tree."""
    if request.floating_base:
        return mujoco.MjSpec.from_string(_floating(request))
    if at_the_top and any(joint.kind == JointKind.FREE for joint in request.joints):
        return mujoco.MjSpec.from_string(_from_the_root(request))
    return mujoco.MjSpec.from_file(str(request.path))


def _from_the_root(request: Request) -> str:
    """The text of a URDF whose root link has the name of MuJoCo's world; its inertia moves nothing."""
    root = elements_of(request)
    base = root_link(root, ["joint"])
    if root.find("link[@name='world']") is None:
        for link in [*root.iterfind("link"), *root.iterfind("joint/parent"), *root.iterfind("joint/child")]:
            attribute = "name" if link.tag == "link" else "link"
            if link.get(attribute) == base:
                link.set(attribute, "world")
    return text_of(root)


def _floating(request: Request) -> str:
    """The text of a URDF with a link that the root floats from; MuJoCo fixes the root of a URDF to the world."""
    root = elements_of(request)
    # A link of this name is MuJoCo's world itself, so that the joint is at the top.
    ground = "world" if root.find("link[@name='world']") is None else f"{request.floating_base} ground"
    etree.SubElement(root, "link", name=ground)
    joint = etree.SubElement(root, "joint", name=request.floating_base, type="floating")
    etree.SubElement(joint, "parent", link=ground)
    etree.SubElement(joint, "child", link=root_link(root, ["joint"]))
    return text_of(root)


def plain_model(request: Request) -> tuple[Any, list[str]]:
    """The model as MuJoCo compiles it; without meshes where it finds them not."""
    try:
        with compiling():
            if request.floating_base:
                return _spec(request).compile(), []
            return mujoco.MjModel.from_xml_path(str(request.path)), []
    except ValueError as error:
        if not _MISSING.search(str(error)):
            raise
        spec = _spec(request)
        return _without_files(spec).compile(), [f"refused with its meshes, and read without them: {' '.join(str(error).split())}"]


def _without_files(spec: Any) -> Any:
    """The model without what it has from other files; a geom of a mesh becomes a massless point, which whatever names it finds."""
    shapes = (mujoco.mjtGeom.mjGEOM_MESH, mujoco.mjtGeom.mjGEOM_SDF, mujoco.mjtGeom.mjGEOM_HFIELD)
    for geom in spec.geoms:
        if geom.type in shapes or geom.meshname:
            geom.type, geom.size, geom.mass = mujoco.mjtGeom.mjGEOM_SPHERE, [POINT, 0.0, 0.0], 0.0
            geom.meshname = geom.hfieldname = ""
    for material in spec.materials:
        for role in range(len(material.textures)):
            material.textures[role] = ""
    for part in [*spec.meshes, *spec.hfields, *spec.skins, *spec.textures]:
        delete(spec, part)
    return spec


def _aided(request: Request, aid: Aid) -> tuple[Any, list[str]]:
    """The model with the inertias of the file written into it; a URDF's links stay apart and have no geoms."""
    if request.format == "mjcf":
        model, notes = plain_model(request)
        model.opt.gravity[:] = aid.gravity
        return model, notes
    spec = _spec(request, at_the_top=True)
    for part in [*spec.geoms, *spec.meshes, *spec.materials, *spec.textures]:
        delete(spec, part)
    spec.compiler.fusestatic = False
    own = {body.name: aid.inertias.get(body.name) for body in spec.bodies if body.name != "world"}
    principal = {name: _principal(inertia) for name, inertia in own.items()}
    for name in principal:
        body = spec.body(name)
        # Any inertia that the compiler accepts; those of the file are written into the compiled model, where nothing is refused. With a
        # frame apart from the body's, that does not rely on any other.
        body.explicitinertial, body.mass, body.ipos, body.iquat = True, 1.0, [1.0] * 3, [0.5] * 4
        body.fullinertia, body.inertia = [math.nan, *[0.0] * 5], [1.0, 1.0, 1.0]
    _supply_springs(spec, request, aid)
    model = spec.compile()
    for name, (mass, centre, moments, axes) in principal.items():
        body = model.body(name)
        body.mass[0], body.inertia[:], body.ipos[:], body.iquat[:] = mass, moments, centre, axes
    model.opt.gravity[:] = aid.gravity
    for asked, joint in _places(model, request.joints).items():
        model.dof_armature[joint.dofadr[0]] += aid.armature[next(one.velocities[0] for one in request.joints if one.name == asked)]
    mujoco.mj_setConst(model, mujoco.MjData(model))
    # It takes a frame that is nearly the body's for that.
    model.body_sameframe[:] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE
    return model, []


def _supply_springs(spec: Any, request: Request, aid: Aid) -> None:
    """The springs of joints and between points, and a ball joint at the root; the reader passes over all of them."""
    if request.supplied_ball_joint:
        spec.body(root_link(elements_of(request), ["joint"])).add_joint(name=request.supplied_ball_joint, type=mujoco.mjtJoint.mjJNT_BALL)
    bodies, elements = {body.name for body in spec.bodies}, list[ForceElement](spring for spring, _, _ in aid.forces.springs)
    for spring in aid.springs:
        # The root link is the world where links float from it.
        body_a, body_b = (body if body in bodies else "world" for body, _ in spring.ends)
        elements.append(replace(spring, body_a=body_a, body_b=body_b))
    exec("\n".join(supplied(elements)), {"mujoco": mujoco, "s": spec})


def _principal(inertia: BodyInertia | None) -> tuple[float, Sequence[float], Sequence[float], Sequence[float]]:
    """Mass, centre, principal moments and the quaternion of their axes, of a body without inertia too."""
    if inertia is None:
        return 0.0, [0.0] * 3, [0.0] * 3, [1.0, 0.0, 0.0, 0.0]
    matrix = inertia.matrix
    if not (matrix - np.diag(np.diag(matrix))).any():
        return inertia.mass, inertia.centre.tolist(), np.diag(matrix).tolist(), [1.0, 0.0, 0.0, 0.0]
    moments, axes = np.linalg.eigh(matrix)
    return inertia.mass, inertia.centre.tolist(), moments.tolist(), turn_of(axes).tolist()


def _places(model: Any, joints: Sequence[AskedJoint]) -> dict[str, Any]:
    """MuJoCo's joint for each of the request's by name, the first of several; those that have none there by their place in the file."""
    by_name = {model.joint(number).name: model.joint(number) for number in range(model.njnt)}
    own = {joint.name: f"{joint.name}_TX" if joint.kind == JointKind.PLANAR else joint.name for joint in joints}
    found = {name: by_name[own_name] for name, own_name in own.items() if own_name in by_name}
    if model.njnt == len(joints):
        found |= {
            joint.name: model.joint(number)
            for number, joint in enumerate(joints)
            if joint.name not in found and not model.joint(number).name
        }
    return found


class MujocoFile(LoadedFile):
    """An ``MjModel`` with the joints of a request; ``places`` are MuJoCo's by their names, where they have others there."""

    applies_dampers = True
    applies_springs = True

    def __init__(self, model: Any, request: Request, notes: Sequence[str], places: Mapping[str, Any] | None = None) -> None:
        held = request.held
        acting = (
            {"actuation": held.actuators, "frictionloss": held.rubbing, "limit": held.limited, "contact": held.touches}
            if held is not None
            else {}
        )
        model.opt.disableflags |= stages_off(held is not None, [stage for stage, named in acting.items() if named])
        model.opt.density = model.opt.viscosity = 0.0
        places = _places(model, request.joints) if places is None else places
        super().__init__(request, places)
        self.notes = tuple(notes)
        parts = [range(places[joint.name].id, places[joint.name].id + _PARTS.get(joint.kind, 1)) for joint in self.found]
        self.placed = MujocoModel(model, parts)

    @property
    def quantities(self) -> Any:
        return self.placed

    def advanced(self, q: Array, v: Array, rule: StepRule, steps: int) -> tuple[Array, Array]:
        states = q[self.q_columns][None], v[self.v_columns][None], np.zeros((1, len(self.v_columns)))
        after = step(self.model, self.addresses, states, rule.length, rule.name, steps)[0]
        q, v = q.copy(), v.copy()
        q[self.q_columns], v[self.v_columns] = np.split(after, [len(self.q_columns)])
        return q, v

    def settled(self, v: Array, steps: Sequence[int]) -> tuple[Array, Array]:
        if not all(joint.is_measured_in_the_world for joint in self.found if joint.kind == JointKind.FREE):
            raise Refused("the harness lets it take no steps with a free joint that is not measured in the world")
        model, (positions, velocities) = self.model, self.addresses
        q, settled = np.zeros((len(v), sum(len(joint.positions) for joint in self.request.joints))), np.zeros_like(v)
        for state, count in enumerate(steps):
            data = mujoco.MjData(model)
            data.qvel[velocities] = v[state, self.v_columns]
            for _ in range(count):
                mujoco.mj_step(model, data)
            q[state, self.q_columns], settled[state, self.v_columns] = data.qpos[positions], data.qvel[velocities]
        return q, settled

    def driven_dynamics(self, q: Array, v: Array, tau: Array, *driving: Array) -> Array:
        run = self.prepare(q, v, tau, *driving)
        run.compute()
        return run.accelerations()

    def prepare(self, q: Array, v: Array, tau: Array, *driving: Array) -> EngineRun:
        q, v, tau = _in_the_world(self.request.joints, q, v, tau)
        model, data, is_coupled = self.model, mujoco.MjData(self.model), self.couplings is not None
        # Joints that the request does not name are where they stand by default.
        configuration, (positions, velocities) = np.tile(data.qpos, (len(q), 1)), self.addresses
        velocity, force = np.zeros((2, len(q), model.nv))
        configuration[:, positions], velocity[:, velocities] = q[:, self.q_columns], v[:, self.v_columns]
        force[:, velocities] = tau[:, self.v_columns]
        accelerations: Array = data.qacc
        inputs, touches = inputs_in_place(model, len(q), driving), self.request.held is not None and self.request.held.touches
        contacts = self.contacts = list[tuple[FoundContact, ...]]()
        self.shapes = shapes_that_touch(model) if touches else []
        qpos, qvel, applied, warm_start = data.qpos, data.qvel, data.qfrc_applied, data.qacc_warmstart
        seconds = self.seconds = list[float]()

        def timed(model: Any, data: Any) -> None:
            started = time.perf_counter()
            mujoco.mj_forward(model, data)
            seconds.append(time.perf_counter() - started)

        # A benchmark times all states of a smooth model from without.
        forward = mujoco.mj_forward if self.request.held is None else timed

        def evaluate(q: Array, v: Array, force: Array, control: Array, activation: Array) -> Array:
            # A solver that starts from the last answer would make this one depend on it.
            qpos[:], qvel[:], applied[:], warm_start[:] = q, v, force, 0.0
            data.ctrl[:], data.act[:] = control, activation
            forward(model, data)
            if touches:
                contacts.append(found_contacts(model, data.contact[: data.ncon]))
            if not is_coupled:
                return accelerations
            fill_mass_matrix(model, data, mass := np.empty((model.nv, model.nv)))
            return self.of_leaders(mass, data.qfrc_passive + data.qfrc_applied - data.qfrc_bias)

        return EngineRun(self, (configuration, velocity, force, *inputs), evaluate, _from_the_world)


def _in_the_world(joints: Sequence[AskedJoint], q: Array, v: Array, tau: Array) -> tuple[Array, Array, Array]:
    """q, v and tau with free joints measured in the world, wherever the file measures them from."""
    q, v, tau = q.copy(), v.copy(), tau.copy()
    for joint in joints:
        if joint.kind == JointKind.FREE:
            turn, rotation = np.array(joint.turn), rotations(np.array([joint.turn]))[0]
            position, orientation = joint.positions[:3], joint.positions[3:]
            q[:, position] = np.array(joint.shift) + q[:, position] @ rotation.T
            q[:, orientation] = multiplied(turn, q[:, orientation])
            v[:, joint.velocities], tau[:, joint.velocities] = (of_linear(rotation, x[:, joint.velocities]) for x in (v, tau))
    return q, v, tau


def _from_the_world(joint: AskedJoint, accelerations: Array) -> Array:
    """Accelerations of a joint, those of a free joint measured as its file does."""
    if joint.kind != JointKind.FREE:
        return accelerations
    return np.asarray(of_linear(rotations(np.array([joint.turn]))[0].T, accelerations))
