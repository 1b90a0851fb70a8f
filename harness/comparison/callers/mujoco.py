"""MuJoCo as its user calls it: ``mujoco.MjModel.from_xml_path``, then ``mujoco.mj_forward``.

What acts by constraints (limits, contacts, friction loss, equalities) is off, and so are actuators and the fluid. Meshes that are not
beside the file are taken out with their geoms, and the answer says so.

Source: MuJoCo documentation, Modeling, URDF extensions; API reference, ``mjtDisableBit``.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from lxml import etree

from harness.arrays import Array
from harness.comparison.coordinates import multiplied, of_linear, rotations
from harness.comparison.questions import Aid, Answers, Asked, BodyInertia, Question, by_joint, projected

# What MuJoCo says where a file of an asset is missing or cannot be read.
_MISSING = re.compile("opening file|resource|decoder|unknown mesh|mesh file|STL|OBJ|texture|asset", re.IGNORECASE)

_ELEMENT = re.compile(r"Element name '([^']*)'")


class MujocoCaller:
    engine = "mujoco"
    formats = ("urdf", "mjcf")
    takes_inertias_about_tree = True
    call: Mapping[str, str] = dict.fromkeys(
        formats,
        "m = mujoco.MjModel.from_xml_path(PATH); m.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT; mujoco.mj_forward(m, d)",
    )

    def ask(self, question: Question) -> Answers:
        import mujoco

        # The default handler writes a log file into the current directory.
        mujoco.set_mju_user_warning(lambda message: None)
        try:
            model, notes = _plain(question) if question.aid is None else _aided(question, question.aid)
        except ValueError as error:
            words = " ".join(str(error).split())
            named = _ELEMENT.search(words)
            return Answers(refusal=words, element=named[1] if named else "")
        return _asked(model, question, notes)


def _spec(question: Question, at_the_top: bool = False) -> Any:
    """The model; ``at_the_top`` takes the root link for the world where links float from it, so that these are at the top of the tree."""
    import mujoco

    if question.floating_base:
        return mujoco.MjSpec.from_string(_floating(question))
    if at_the_top and any(joint.kind == "free" for joint in question.joints):
        return mujoco.MjSpec.from_string(_from_the_root(question))
    return mujoco.MjSpec.from_file(str(question.path))


def _from_the_root(question: Question) -> str:
    """The text of a URDF whose root link has the name of MuJoCo's world; its inertia moves nothing."""
    root = _elements(question)
    (base, *_) = _roots(root)
    links = [*root.iterfind("link"), *root.iterfind("joint/parent"), *root.iterfind("joint/child")]
    if any(link.get("name") == "world" for link in root.iterfind("link")):
        return str(etree.tostring(root, encoding="unicode"))
    for link in links:
        attribute = "name" if link.tag == "link" else "link"
        if link.get(attribute) == base:
            link.set(attribute, "world")
    return str(etree.tostring(root, encoding="unicode"))


def _elements(question: Question) -> etree._Element:
    return etree.fromstring(question.path.read_bytes(), etree.XMLParser(resolve_entities=False, no_network=True, remove_comments=True))


def _roots(root: etree._Element) -> list[str]:
    carried = {child.get("link") for child in root.iterfind("joint/child")}
    return [str(link.get("name")) for link in root.iterfind("link") if link.get("name") not in carried]


def _floating(question: Question) -> str:
    """The text of a URDF with a link that the root floats from; MuJoCo fixes the root of a URDF to the world."""
    root = _elements(question)
    # A link of this name is MuJoCo's world itself, so that the joint is at the top.
    ground = "world" if root.find("link[@name='world']") is None else f"{question.floating_base} ground"
    etree.SubElement(root, "link", name=ground)
    joint = etree.SubElement(root, "joint", name=question.floating_base, type="floating")
    etree.SubElement(joint, "parent", link=ground)
    etree.SubElement(joint, "child", link=_roots(root)[0])
    return str(etree.tostring(root, encoding="unicode"))


def _plain(question: Question) -> tuple[Any, list[str]]:
    """The model as MuJoCo compiles it; without meshes where it finds them not."""
    import mujoco

    try:
        if question.floating_base:
            return _spec(question).compile(), []
        return mujoco.MjModel.from_xml_path(str(question.path)), []
    except ValueError as error:
        if not _MISSING.search(str(error)):
            raise
        spec = _spec(question)
        return (_without_meshes(spec)).compile(), [_note(spec, error)]


def _note(spec: Any, error: ValueError) -> str:
    return f"refused with its meshes, and read without them: {' '.join(str(error).split())}"


def _without_meshes(spec: Any) -> Any:
    import mujoco

    shapes = (mujoco.mjtGeom.mjGEOM_MESH, mujoco.mjtGeom.mjGEOM_SDF)
    for part in [*(geom for geom in spec.geoms if geom.type in shapes or geom.meshname), *spec.meshes, *spec.materials, *spec.textures]:
        spec.delete(part)
    return spec


def _aided(question: Question, aid: Aid) -> tuple[Any, list[str]]:
    """The model with the inertias of the file written into it; a URDF's links stay apart and have no geoms."""
    import mujoco

    if question.format == "mjcf":
        model, notes = _plain(question)
        model.opt.gravity[:] = aid.gravity
        return model, notes
    spec = _spec(question, at_the_top=True)
    for part in [*spec.geoms, *spec.meshes, *spec.materials, *spec.textures]:
        spec.delete(part)
    spec.compiler.fusestatic = False
    own = {body.name: aid.inertias.get(body.name) for body in spec.bodies if body.name != "world"}
    principal = {name: _principal(inertia) for name, inertia in own.items()}
    for name, (_, centre, _, axes) in principal.items():
        body = spec.body(name)
        # Any inertia that the compiler accepts; those of the file are written into the compiled model, where nothing is refused.
        body.explicitinertial, body.mass, body.ipos, body.iquat = True, 1.0, centre, axes
        body.fullinertia, body.inertia = [math.nan, *[0.0] * 5], [1.0, 1.0, 1.0]
    model = spec.compile()
    for name, (mass, _, moments, _) in principal.items():
        body = model.body(name)
        body.mass[0], body.inertia[:] = mass, moments
    model.opt.gravity[:] = aid.gravity
    for asked, joint in _places(model, question.joints).items():
        model.dof_armature[joint.dofadr[0]] += aid.armature[next(one.velocities[0] for one in question.joints if one.name == asked)]
    mujoco.mj_setConst(model, mujoco.MjData(model))
    return model, []


def _principal(inertia: BodyInertia | None) -> tuple[float, Sequence[float], Sequence[float], Sequence[float]]:
    """Mass, centre, principal moments and the quaternion of their axes, of a body without inertia too."""
    import mujoco

    if inertia is None:
        return 0.0, [0.0] * 3, [0.0] * 3, [1.0, 0.0, 0.0, 0.0]
    matrix = inertia.matrix
    if not (matrix - np.diag(np.diag(matrix))).any():
        return inertia.mass, inertia.centre.tolist(), np.diag(matrix).tolist(), [1.0, 0.0, 0.0, 0.0]
    moments, axes = np.linalg.eigh(matrix)
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, (axes * np.sign(np.linalg.det(axes))).ravel())
    return inertia.mass, inertia.centre.tolist(), moments.tolist(), quaternion.tolist()


def _asked(model: Any, question: Question, notes: list[str]) -> Answers:
    import mujoco

    flags = mujoco.mjtDisableBit
    for flag in (flags.mjDSBL_CONSTRAINT, flags.mjDSBL_CONTACT, flags.mjDSBL_ACTUATION, flags.mjDSBL_SENSOR, flags.mjDSBL_AUTORESET):
        model.opt.disableflags |= flag
    model.opt.density = model.opt.viscosity = 0.0
    places = _places(model, question.joints)
    found = [joint for joint in question.joints if joint.name in places]
    own = [(joint, int(places[joint.name].qposadr[0]), int(places[joint.name].dofadr[0])) for joint in found]
    positions = [place + k for joint, place, _ in own for k in range(len(joint.positions))]
    velocities = [place + k for joint, _, place in own for k in range(len(joint.velocities))]
    q_columns = [column for joint in found for column in joint.positions]
    v_columns = [column for joint in found for column in joint.velocities]
    q, v, tau = _in_the_world(question)
    data, couplings = mujoco.MjData(model), None if question.aid is None else question.aid.couplings
    accelerations = np.empty((len(q), len(v_columns) if couplings is None else couplings.shape[1]))
    for state in range(len(q)):
        mujoco.mj_resetData(model, data)
        data.qpos[positions], data.qvel[velocities] = q[state, q_columns], v[state, v_columns]
        data.qfrc_applied[velocities] = tau[state, v_columns]
        mujoco.mj_forward(model, data)
        if couplings is None:
            accelerations[state] = data.qacc[velocities]
        else:
            accelerations[state] = _coupled(model, data, velocities, couplings[v_columns])
    known = {places[joint.name].id + k for joint in found for k in range(len(joint.velocities) if joint.kind == "planar" else 1)}
    further = [f"joint {number}" for number in range(model.njnt) if number not in known]
    answered = found if question.aid is None or couplings is None else question.aid.leaders
    own_accelerations = by_joint(answered, accelerations)
    return Answers(
        {joint.name: _from_the_world(joint, own_accelerations[joint.name]) for joint in answered},
        notes=tuple(notes),
        further=tuple(further),
    )


def _in_the_world(question: Question) -> tuple[Array, Array, Array]:
    """q, v and tau with free joints measured in the world, wherever the file measures them from."""
    q, v, tau = question.q.copy(), question.v.copy(), question.tau.copy()
    if question.aid is not None and question.format == "urdf":
        tau += question.aid.forces["stiffness"]
    for joint in question.joints:
        if joint.kind == "free":
            turn, rotation = np.array(joint.turn), rotations(np.array([joint.turn]))[0]
            position, orientation = joint.positions[:3], joint.positions[3:]
            q[:, position] = np.array(joint.shift) + q[:, position] @ rotation.T
            q[:, orientation] = multiplied(turn, q[:, orientation])
            v[:, joint.velocities], tau[:, joint.velocities] = (of_linear(rotation, x[:, joint.velocities]) for x in (v, tau))
    return q, v, tau


def _from_the_world(joint: Asked, accelerations: Array) -> Array:
    """Accelerations of a joint, those of a free joint measured as its file does."""
    return of_linear(rotations(np.array([joint.turn]))[0].T, accelerations) if joint.kind == "free" else accelerations


def _coupled(model: Any, data: Any, velocities: Sequence[int], couplings: Array) -> Array:
    """Accelerations of the joints that move by themselves, from MuJoCo's own M and forces."""
    import mujoco

    mass = np.empty((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    force = data.qfrc_passive + data.qfrc_applied - data.qfrc_bias
    return projected(mass[np.ix_(velocities, velocities)], force[velocities], couplings)


def _places(model: Any, joints: Sequence[Asked]) -> dict[str, Any]:
    """MuJoCo's joint for each of the question's by name; those that have none there by their place in the file."""
    by_name = {model.joint(number).name: model.joint(number) for number in range(model.njnt)}
    # Of a planar joint, MuJoCo makes two slides and a hinge.
    names = {joint.name: f"{joint.name}_TX" if joint.kind == "planar" else joint.name for joint in joints}
    found = {own: by_name[name] for own, name in names.items() if name in by_name}
    if model.njnt == len(joints):
        found |= {
            joint.name: model.joint(number)
            for number, joint in enumerate(joints)
            if joint.name not in found and not model.joint(number).name
        }
    return found


CALLER = MujocoCaller()
