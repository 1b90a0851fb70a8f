"""URDF elements that MuJoCo's reader passes over, supplied to its ``MjSpec`` before compilation; MuJoCo then computes them.

The reader gives bodies, joints, inertias, ``<dynamics damping>``, and couples a joint that mimics another to it. From the same file
are added: springs in joints and between points (as tendons), reflected inertias, a ball joint at the root, and Drake's ball
constraints (as connected sites, soft as MuJoCo's defaults have it). The harness gives gravity, switches off joint limits, and takes
out what the file's decoration has become. MuJoCo's compiler refuses a moving body without mass or with a principal inertia of zero,
which a URDF may have and whose least substitute a light mechanism feels: such a body is compiled with the least that it accepts,
and then has its own mass and inertia written back.

Source: MuJoCo documentation, Modeling, section URDF extensions, and Programming, section Model editing.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import Any

import mujoco
import numpy as np
from lxml import etree

from harness.arrays import Array
from harness.engines import Unsupported
from harness.engines.adapters.mujoco.acting import stages_of
from harness.engines.adapters.mujoco.versions import coefficients, compiling, stages_off
from harness.engines.reading import carriers, is_displaced, parent_of
from harness.files.document.xml import Document, describe, literal_tag
from harness.files.equalities import Meeting
from harness.files.facts import point_of
from harness.files.joint_kinds import JointKind
from harness.files.lint.formats import LEAST
from harness.files.model_file import ForceElement, JointSpring, ModelFile, PointSpring, document_of

# Of a solver that goes to the end: Newton's method needs two or three. At the end each further one may move it by an ulp.
MOST_ITERATIONS = 20
# mjEPS: the principal inertia below which MuJoCo refuses the six numbers of an inertia matrix, though not the three principal ones.
LEAST_OF_SIX = 1e-14
# A principal inertia is zero where it is no more than the rounding of the largest.
ROUNDING = 8 * 2.0**-53
# Parts deleted themselves before the spec did, as of ``versions.delete``.
_DELETES = "s.delete(part)" if hasattr(mujoco.MjSpec, "delete") else "part.delete()"
_WITHOUT_DECORATION = f"[{_DELETES} for part in [*s.geoms, *s.meshes, *s.materials, *s.textures]]"


def _text(value: Any) -> str:
    if isinstance(value, list):
        return f"[{', '.join(map(_text, value))}]"
    if isinstance(value, float):
        return "float('nan')" if math.isnan(value) else repr(value).removesuffix(".0")
    return f"mujoco.{value}" if isinstance(value, mujoco.mjtJoint | mujoco.mjtEq | mujoco.mjtObj) else repr(value)


def _set(target: str, values: Mapping[str, Any]) -> str:
    return "; ".join(f"{target}.{name} = {_text(value)}" for name, value in values.items())


def _add(target: str, part: str, values: Mapping[str, Any]) -> str:
    return f"{target}.add_{part}({', '.join(f'{name}={_text(value)}' for name, value in values.items())})"


def read(file: ModelFile, gravity: float, joints: Collection[str] = ()) -> tuple[Any, str]:
    """The compiled ``mujoco.MjModel``, and Python text that makes it, ``m``, of the ``mujoco.MjSpec`` that the reader gives, ``s``.

    ``joints`` are those that the caller asks accelerations of.

    Raises:
        Unsupported: the file holds what the reader takes otherwise than other readers, or the reader refuses it.
    """
    document = document_of(file)
    refused = sorted((document.lines[element], f"{describe(element)} {why}") for element, why in _ignored(document.root, joints))
    if refused:
        raise Unsupported("MuJoCo's URDF reader: " + "; ".join(f"line {line}: {what}" for line, what in refused))
    try:
        spec = mujoco.MjSpec.from_string(file.text)
        edits, written_back = _changes(spec, file, document, gravity)
        decoration = [_WITHOUT_DECORATION] if [*spec.geoms, *spec.meshes, *spec.materials, *spec.textures] else []
        constants = ["mujoco.mj_setConst(m, mujoco.MjData(m))"] if written_back else []
        building = "; ".join([*decoration, *edits, "m = s.compile()", *written_back, *constants])
        names: dict[str, Any] = {"mujoco": mujoco, "s": spec}
        # The very text that a reproducer prints: what it shows is what was done.
        with compiling():
            exec(building, names)
    except ValueError as error:
        raise Unsupported(f"MuJoCo's URDF reader refuses it: {' '.join(str(error).split())}") from error
    return names["m"], building


def _ignored(root: etree._Element, joints: Collection[str]) -> Iterator[tuple[etree._Element, str]]:
    carried = carriers(root, ["joint"])
    if "world" in carried:
        yield carried["world"], "carries the link 'world', which MuJoCo takes for the world itself; give it another name"
    for joint in root.iterfind("joint"):
        if joint.get("type") == JointKind.PLANAR:
            yield joint, "is planar, for which MuJoCo makes three joints of other names; write them out"
        if joint.find("mimic") is not None and joint.get("name") not in joints:
            yield joint, "mimics another, of which MuJoCo makes an equality constraint, and that is soft"
        if joint.get("type") == "floating":
            above: etree._Element | None = joint
            while above is not None:
                if is_displaced(above):
                    where = "" if above is joint else f" behind {describe(above)}"
                    yield joint, f"floats from another origin than the world's{where}, from which MuJoCo counts its position; remove it"
                    break
                above = carried.get(parent_of(above))


def _changes(spec: Any, file: ModelFile, document: Document, gravity: float) -> tuple[list[str], list[str]]:
    """Statements that change the spec ``s``, and those that then write masses and inertias back into the model ``m``."""
    # What is left of the constraints are those of the file, and the friction and limits that are to act.
    off = stages_off(bool(file.constraints or file.acting), stages_of(file.acting))
    # A URDF says nothing of the solver, and by its default tolerance MuJoCo leaves small forces at rest as they are.
    to_the_end = {"iterations": MOST_ITERATIONS, "tolerance": 0.0} if file.acting else {}
    edits = [_set("s.option", {"gravity": [0.0, 0.0, -gravity], "disableflags": off, **to_the_end})]
    root_of_ball = None
    if file.ball_joint is not None:
        (joint,) = (element for element in document.root.iterchildren("*") if literal_tag(element) == "drake:joint")
        root_of_ball = str(joint.find("child").get("link"))
        edits.append(_add(f"s.body({root_of_ball!r})", "joint", {"name": file.ball_joint, "type": mujoco.mjtJoint.mjJNT_BALL}))
    written_back: dict[str, list[str]] = {}
    for body in spec.bodies:
        if body.explicitinertial and body.name != "world":
            orientation = _orientation(document, body.name)
            compiled, own = _accepted_inertia(body, orientation, moves=bool(body.joints) or body.name == root_of_ball)
            edits += [_set(f"s.body({body.name!r})", compiled)] if compiled else []
            written_back |= {body.name: [f"m.body({body.name!r}).{part} = {_text(value)}" for part, value in own.items()]} if own else {}
    fixed_to = {joint.find("parent").get("link") for joint in document.root.iterfind("joint[@type='fixed']")}
    if file.constraints or file.acting or fixed_to & set(written_back):
        # Links fused into such a body would be indistinguishable from it, and constraints are scaled by what each link weighs.
        edits.append(_set("s.compiler", {"fusestatic": False}))
    for joint in file.armatures:
        edits.append(_set(f"s.joint({joint.name!r})", {"armature": float(joint.armature)}))
    edits += supplied(file.force_elements)
    if len(spec.equalities) < len(file.mimics):
        named = ", ".join(f"line {one.line}: joint {one.name!r}" for one in file.mimics)
        raise Unsupported(f"MuJoCo {mujoco.mj_versionString()} passes over <mimic>: {named}")
    # The reader names the coupling of a joint that mimics another by nothing.
    edits += [f"s.equalities[{number}].name = {equality.name1!r}" for number, equality in enumerate(spec.equalities)]
    for constraint in file.constraints:
        if isinstance(constraint.says, Meeting):
            edits += _connect(constraint.name, constraint.says)
    return edits, [statement for statements in written_back.values() for statement in statements]


def supplied(elements: Iterable[ForceElement]) -> Iterator[str]:
    """Statements that add the springs of joints to the spec ``s``, and those between points as tendons; the reader has the dampers."""
    for number, element in enumerate(elements):
        if isinstance(element, JointSpring):
            yield _set(f"s.joint({element.joint!r})", {"stiffness": coefficients(element.stiffness), "springref": element.reference})
        elif isinstance(element, PointSpring):
            yield from _tendon(element, f"spring {number}")


def _sites(name: str, ends: Iterable[tuple[str, Sequence[float]]]) -> Iterator[str]:
    """Statements that make a site of each of two points of bodies, called after ``name``."""
    for letter, (body, point) in zip("AB", ends, strict=True):
        yield _add(f"s.body({body!r})", "site", {"name": f"{name} {letter}", "pos": list(point)})


def _tendon(spring: PointSpring, name: str) -> Iterator[str]:
    yield from _sites(name, spring.ends)
    values = {
        "name": name,
        "stiffness": coefficients(spring.stiffness),
        "damping": coefficients(spring.damping),
        "springlength": [spring.free_length] * 2,
    }
    yield f"t = {_add('s', 'tendon', values)}"
    yield from (f"t.wrap_site({f'{name} {letter}'!r})" for letter in "AB")


def _connect(name: str, meeting: Meeting) -> Iterator[str]:
    yield from _sites(name, [(body, point_of(pose)) for body, pose in meeting.ends])
    values = {
        "name": name,
        "type": mujoco.mjtEq.mjEQ_CONNECT,
        "objtype": mujoco.mjtObj.mjOBJ_SITE,
        "name1": f"{name} A",
        "name2": f"{name} B",
    }
    yield _add("s", "equality", values)


def _orientation(document: Document, link: str) -> Array:
    """Quaternion of a link's inertial frame in the link's, as the file has it; older readers leave that of the principal axes."""
    quaternion = np.empty(4)
    origins = (origin for one in document.root.iterfind("link") if one.get("name") == link for origin in one.iterfind("inertial/origin"))
    turns = [float(word) for origin in origins for word in origin.get("rpy", "0 0 0").split()] or [0.0] * 3
    mujoco.mju_euler2Quat(quaternion, np.array(turns), "XYZ")
    return quaternion


def _accepted_inertia(body: Any, file_orientation: Array, moves: bool) -> tuple[dict[str, Any], dict[str, float]]:
    """The inertia that a body is compiled with whose matrix MuJoCo refuses, and that of the file for a moving one that has too little.

    The former are attributes in the spec, with principal inertias; the latter, numbers of the compiled body to be written back.
    """
    mass = float(body.mass)
    xx, yy, zz, xy, xz, yz = (0.0 if np.isnan(body.fullinertia[0]) else float(number) for number in body.fullinertia)
    moments, axes, rounding = np.array([xx, yy, zz]), np.eye(3), 0.0
    if xy or xz or yz:
        moments, axes = np.linalg.eigh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        rounding = ROUNDING * float(moments.max())
    if moments.min() >= LEAST_OF_SIX and not (moves and mass < LEAST):
        return {}, {}
    own = [0.0 if moment <= rounding else moment for moment in moments.tolist()]
    # The rounding of the axes must not make the two larger moments differ by more than the least one.
    compiled = [max(moment, LEAST, rounding) if moves else moment for moment in own]
    quaternion = np.empty(4)
    mujoco.mju_mulQuat(quaternion, file_orientation, turn_of(axes))
    written = {"iquat": quaternion.tolist()} if (quaternion != body.iquat).any() else {}
    least_mass = {"mass": LEAST} if moves and mass < LEAST else {}
    written_back = {"mass[0]": mass} if least_mass else {}
    written_back |= {f"inertia[{axis}]": moment for axis, moment in enumerate(own) if moment != compiled[axis]}
    return {**least_mass, "fullinertia": [math.nan, *[0.0] * 5], "inertia": compiled, **written}, written_back


def turn_of(axes: Array) -> Array:
    """Quaternion of principal axes, by columns, of which one is reversed where they are left-handed."""
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, (axes * np.sign(np.linalg.det(axes))).ravel())
    return quaternion
