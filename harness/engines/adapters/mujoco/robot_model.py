"""The ``MjModel`` of a robot's file, as its user has it, and aided by what MuJoCo leaves out of it.

Source: MuJoCo documentation, Modeling, URDF extensions; API reference, ``MjSpec``.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from lxml import etree

from harness.engines.adapters.mujoco.urdf import tendon_of
from harness.engines.adapters.mujoco.versions import coefficients
from harness.engines.request import Aid, AskedJoint, BodyInertia, Request
from harness.files.joint_kinds import JointKind

# What MuJoCo says where a file of an asset is missing or cannot be read.
_MISSING = re.compile("opening file|resource|decoder|unknown mesh|mesh file|STL|OBJ|texture|asset", re.IGNORECASE)

# Joints that MuJoCo's reader makes of one, in a row: a planar joint becomes NAME_TX, NAME_TY and NAME_RZ.
PARTS = {JointKind.PLANAR: 3}


def _spec(request: Request, at_the_top: bool = False) -> Any:
    """The model; ``at_the_top`` takes the root link for the world where links float from it, so that these are at the top of the tree."""
    import mujoco

    if request.floating_base:
        return mujoco.MjSpec.from_string(_floating(request))
    if at_the_top and any(joint.kind == JointKind.FREE for joint in request.joints):
        return mujoco.MjSpec.from_string(_from_the_root(request))
    return mujoco.MjSpec.from_file(str(request.path))


def _from_the_root(request: Request) -> str:
    """The text of a URDF whose root link has the name of MuJoCo's world; its inertia moves nothing."""
    root = _elements(request)
    (base, *_) = _roots(root)
    links = [*root.iterfind("link"), *root.iterfind("joint/parent"), *root.iterfind("joint/child")]
    if any(link.get("name") == "world" for link in root.iterfind("link")):
        return str(etree.tostring(root, encoding="unicode"))
    for link in links:
        attribute = "name" if link.tag == "link" else "link"
        if link.get(attribute) == base:
            link.set(attribute, "world")
    return str(etree.tostring(root, encoding="unicode"))


def _elements(request: Request) -> etree._Element:
    return etree.fromstring(request.path.read_bytes(), etree.XMLParser(resolve_entities=False, no_network=True, remove_comments=True))


def _roots(root: etree._Element) -> list[str]:
    carried = {child.get("link") for child in root.iterfind("joint/child")}
    return [str(link.get("name")) for link in root.iterfind("link") if link.get("name") not in carried]


def _floating(request: Request) -> str:
    """The text of a URDF with a link that the root floats from; MuJoCo fixes the root of a URDF to the world."""
    root = _elements(request)
    # A link of this name is MuJoCo's world itself, so that the joint is at the top.
    ground = "world" if root.find("link[@name='world']") is None else f"{request.floating_base} ground"
    etree.SubElement(root, "link", name=ground)
    joint = etree.SubElement(root, "joint", name=request.floating_base, type="floating")
    etree.SubElement(joint, "parent", link=ground)
    etree.SubElement(joint, "child", link=_roots(root)[0])
    return str(etree.tostring(root, encoding="unicode"))


def plain(request: Request) -> tuple[Any, list[str]]:
    """The model as MuJoCo compiles it; without meshes where it finds them not."""
    import mujoco

    try:
        if request.floating_base:
            return _spec(request).compile(), []
        return mujoco.MjModel.from_xml_path(str(request.path)), []
    except ValueError as error:
        if not _MISSING.search(str(error)):
            raise
        spec = _spec(request)
        return (_without_meshes(spec)).compile(), [_note(spec, error)]


def _note(spec: Any, error: ValueError) -> str:
    return f"refused with its meshes, and read without them: {' '.join(str(error).split())}"


def _without_meshes(spec: Any) -> Any:
    import mujoco

    shapes = (mujoco.mjtGeom.mjGEOM_MESH, mujoco.mjtGeom.mjGEOM_SDF)
    for part in [*(geom for geom in spec.geoms if geom.type in shapes or geom.meshname), *spec.meshes, *spec.materials, *spec.textures]:
        spec.delete(part)
    return spec


def aided(request: Request, aid: Aid) -> tuple[Any, list[str]]:
    """The model with the inertias of the file written into it; a URDF's links stay apart and have no geoms."""
    import mujoco

    if request.format == "mjcf":
        model, notes = plain(request)
        model.opt.gravity[:] = aid.gravity
        return model, notes
    spec = _spec(request, at_the_top=True)
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
    _supply_springs(spec, request, aid)
    model = spec.compile()
    for name, (mass, _, moments, _) in principal.items():
        body = model.body(name)
        body.mass[0], body.inertia[:] = mass, moments
    model.opt.gravity[:] = aid.gravity
    for asked, joint in places_of(model, request.joints).items():
        model.dof_armature[joint.dofadr[0]] += aid.armature[next(one.velocities[0] for one in request.joints if one.name == asked)]
    mujoco.mj_setConst(model, mujoco.MjData(model))
    return model, []


def _supply_springs(spec: Any, request: Request, aid: Aid) -> None:
    """The springs of joints and between points, and a ball joint at the root; the reader passes over all of them."""
    import mujoco

    if request.supplied_ball_joint:
        spec.body(_roots(_elements(request))[0]).add_joint(name=request.supplied_ball_joint, type=mujoco.mjtJoint.mjJNT_BALL)
    joints = {joint.velocities[0]: spec.joint(joint.name) for joint in request.joints if len(joint.velocities) == 1}
    for _, velocity, stiffness, relaxed in aid.forces.springs:
        joints[velocity].stiffness, joints[velocity].springref = coefficients(stiffness), relaxed
    bodies = {body.name for body in spec.bodies}
    for number, spring in enumerate(aid.springs):
        # The root link is the world where links float from it.
        body_a, body_b = (body if body in bodies else "world" for body, _ in spring.ends)
        exec("\n".join(tendon_of(replace(spring, body_a=body_a, body_b=body_b), f"spring {number}")), {"mujoco": mujoco, "s": spec})


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


def places_of(model: Any, joints: Sequence[AskedJoint]) -> dict[str, Any]:
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
