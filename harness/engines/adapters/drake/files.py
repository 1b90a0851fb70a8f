"""A model file as Drake's parser is given it, what the parser says of it, and the statements that make a plant of it.

The parser warns of elements and attributes that it ignores. Those that the harness reads from the same file and supplies, and those
that no acceleration feels here, are listed below; any other warning refuses the model, as does any constraint: a plant in continuous
time, which alone has accelerations at a state, throws where it has one.

Sources: Drake documentation, "Parsing model files" and drake::multibody::MultibodyPlant; https://github.com/RobotLocomotion/drake/issues/24957.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

from harness.engines import Unsupported
from harness.engines.reading import carriers, document_of, elements_of, is_displaced, parent_of, root_link, text_of
from harness.engines.request import Aid, Refused, Request
from harness.files.document.xml import Document, describe, literal_tag
from harness.files.joint_kinds import JointKind
from harness.files.mjcf.attributes import resolved, resolved_text
from harness.files.model_file import PointSpring
from harness.files.tree import WORLD
from harness.files.urdf.kinds import POINT_SPRING

# Of a plant without a time step.
CONTINUOUS = "MultibodyPlant(0.0)"
FINALIZE = "p.Finalize()"
# Of the warnings, those about what the adapter supplies, and about what changes no acceleration.
_SUPPLIED = (
    r"The tag '(flag|tendon)' ",
    r"The tag 'site' found as a child of '(body|worldbody)'",
    r"The attribute '(stiffness|springref)' found in a 'joint' tag",
    r"The attribute 'fusestatic' found in a 'compiler' tag",
    r"Joint '.*' specified as type floating which is not supported by MultibodyPlant",
)


def text_for_parser(request: Request) -> str | None:
    """The text without springs between points that end at the link ``world``, which Drake takes for the world and then does not find.

    None of a file that is read where it lies.
    """
    if request.format != "urdf" or not springs_at_world(request):
        return request.text
    document = document_of(request)
    lines = {spring.line for spring in springs_at_world(request)}
    for element in list(document.root.iterchildren("*")):
        if literal_tag(element) == POINT_SPRING and document.lines[element] in lines:
            document.root.remove(element)
    return text_of(document.root)


def springs_at_world(request: Request) -> list[PointSpring]:
    return [] if request.aid is None else [one for one in request.aid.springs if WORLD in (one.body_a, one.body_b)]


def floating_bodies(request: Request) -> dict[str, str]:
    """The free joints of a file with the body of each, after which Drake names the joint.

    Raises:
        Unsupported: such a joint floats from another link than the root at the world's origin, or its body has no name.
        Refused: a joint of a user's MJCF has no name.
    """
    document = document_of(request)
    if request.floating_base:
        return {request.floating_base: root_link(document.root)}
    return _floating_in_mjcf(request, document) if request.format == "mjcf" else _floating_in_urdf(request, document)


def _floating_in_mjcf(request: Request, document: Document) -> dict[str, str]:
    free = {joint.name for joint in request.joints if joint.kind == JointKind.FREE}
    written = list(document.root.iterfind("worldbody//*"))
    if unnamed := {joint.name for joint in request.joints} - {one.get("name") for one in written if one.tag in ("joint", "freejoint")}:
        raise Refused(f"the harness asks Drake about no joint without a name in this file, as {', '.join(sorted(unnamed))}")
    found = {}
    for joint in written:
        if joint.tag in ("joint", "freejoint") and joint.get("name") in free:
            body = joint.getparent()
            if not body.get("name"):
                raise Unsupported(
                    f"line {document.lines[body]}: {describe(body)} has no name, by which Drake names its free joint; add one"
                )
            found[str(joint.get("name"))] = str(body.get("name"))
    return found


def _floating_in_urdf(request: Request, document: Document) -> dict[str, str]:
    found, carried = {}, carriers(document.root, ["joint"])
    for joint in document.root.iterfind("joint[@type='floating']") if request.aid is not None else ():
        parent, displaced = parent_of(joint), is_displaced(joint)
        if parent != WORLD or parent in carried or displaced:
            where = "an origin of its own" if displaced else f"link {parent!r}"
            problem = f"floats from {where}, and Drake leaves its link free of the world; float from the link 'world' at its origin"
            raise Unsupported(f"line {document.lines[joint]}: {describe(joint)} {problem}")
        found[str(joint.get("name"))] = str(joint.find("child").get("link"))
    return found


def armatures_passed_over(request: Request) -> dict[str, float]:
    """The reflected inertia of each joint of a mechanism's MJCF that has one, which Drake gives to actuators alone, and drops without them.

    Raises:
        Unsupported: such a joint turns about or moves along several axes, or the file has actuators, which then have it already.
    """
    if request.format == "urdf" or request.text is None:
        return {}
    document, names = document_of(request), {joint.name for joint in request.joints}
    found = {}
    for joint in document.root.iter("joint"):
        written = resolved(joint, "armature") if joint.get("name") in names else None
        value = 0.0 if written is None else float(written.text)
        if value and resolved_text(joint, "type", JointKind.HINGE) not in (JointKind.HINGE, JointKind.SLIDE):
            raise Unsupported(
                f"line {document.lines[joint]}: {describe(joint)} has an armature about several axes, which Drake does not know"
            )
        if value and document.root.find("actuator") is not None:
            raise Unsupported(
                f"line {document.lines[joint]}: {describe(joint)} has an armature beside actuators, to which Drake may give it too"
            )
        if value:
            found[str(joint.get("name"))] = value
    return found


@contextmanager
def refused_warnings() -> Iterator[None]:
    """Raises Unsupported with the warnings that Drake's parser gives meanwhile, but for those about what is supplied."""
    handler, logger = _Keeping(), logging.getLogger("drake")
    before = logger.propagate
    logger.addHandler(handler)
    logger.propagate = False
    try:
        yield
    finally:
        logger.removeHandler(handler)
        logger.propagate = before
    refused = [text for text in handler.texts if not any(re.search(known, text) for known in _SUPPLIED)]
    if refused:
        raise Unsupported("Drake's parser: " + "; ".join(dict.fromkeys(map(_shortened, refused))))


@contextmanager
def silent() -> Iterator[None]:
    """Without Drake's warnings: what they say is a reading, or bears on no acceleration. Whoever else reads them does so again after."""
    logger = logging.getLogger("drake")
    before = logger.level
    logger.setLevel(logging.ERROR)
    try:
        yield
    finally:
        logger.setLevel(before)


def _shortened(text: str) -> str:
    """A warning without the places of Drake's own sources."""
    located = re.search(r":(\d+): warning: (.*)", text, re.DOTALL)
    line, said = located.groups() if located else ("", text)
    said = re.sub(r"Failure at \S+ in ", "", " ".join(said.split()))
    return f"line {line}: {said}" if line else said


class _Keeping(logging.Handler):
    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.texts: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.texts.append(record.getMessage())


@dataclass(frozen=True)
class Building:
    """Python text that makes the plant ``p``, of the text ``x`` of a model; ``is_strict`` where warnings refuse the file."""

    text: str
    statements: str
    is_strict: bool

    def replaced(self, part: str, other: str) -> Building:
        """The same with one statement in place of another."""
        return replace(self, statements=self.statements.replace(part, other))


def built(building: Building) -> Any:
    """The plant; raises RuntimeError where Drake refuses the file, and Unsupported for warnings that count."""
    return made(building)["p"]


def made(building: Building) -> dict[str, Any]:
    """All that the statements name, and a context ``c`` of the plant, which is part of the context ``root`` of a diagram ``d``, if any.

    Raises as ``built``.
    """
    names: dict[str, Any] = {"x": building.text}
    with refused_warnings() if building.is_strict else silent():
        # The very text that a reproducer prints: what it shows is what was done.
        exec(building.statements, names)
    names["root"] = names.get("d", names["p"]).CreateDefaultContext()
    names["c"] = names["p"].GetMyMutableContextFromRoot(names["root"]) if "d" in names else names["root"]
    return names


def building(request: Request) -> Building:
    """Builder of the plant of a request: plain as its user does, or with what the parser passes over."""
    text = text_for_parser(request)
    statements = "; ".join([*_reading(request, text), *(() if request.aid is None else _supplying(request, request.aid)), FINALIZE])
    return Building(text or "", statements, is_strict=request.text is not None)


def _reading(request: Request, text: str | None) -> Iterator[str]:
    yield "from pydrake.multibody.plant import MultibodyPlant; from pydrake.multibody.parsing import Parser"
    yield "import pydrake.multibody.tree as t"
    kind = "urdf" if request.format == "urdf" else "xml"
    read = f"AddModels({str(request.path)!r})" if text is None else f"AddModelsFromString(x, {kind!r})"
    yield f"p = {CONTINUOUS}; Parser(p).{read}"
    root = root_link(elements_of(request)) if request.format == "urdf" and not request.floating_base else WORLD
    if root not in ("", WORLD):
        yield f"p.WeldFrames(p.world_frame(), p.GetFrameByName({root!r}))"


def _supplying(request: Request, aid: Aid) -> Iterator[str]:
    for name, inertia in armatures_passed_over(request).items():
        yield f"p.AddJointActuator({name!r}, p.GetJointByName({name!r})).set_default_rotor_inertia({inertia!r})"
    # A file of a user may hold what the parser leaves out with all that hangs on it.
    guard = "" if request.text is not None else "p.HasJointNamed({0!r}) and "
    if request.text is None and aid.armature.any():
        yield "a = {p.get_joint_actuator(i).joint().name(): p.get_joint_actuator(i) for i in p.GetJointActuatorIndices()}"
        for joint in request.joints:
            if (inertia := float(aid.armature[joint.velocities[0]])) and joint.name != request.floating_base:
                found = f"a.get({joint.name!r}) or p.AddJointActuator({f'rotor of {joint.name}'!r}, p.GetJointByName({joint.name!r}))"
                made = f"[(r.set_default_gear_ratio(1.0), r.set_default_rotor_inertia({inertia!r})) for r in [{found}]]"
                yield guard.format(joint.name) + made
    for sprung, _, _ in aid.forces.springs:
        of_drake = f"p.GetJointByName({sprung.joint!r})"
        kinds = f"(t.RevoluteSpring if {of_drake}.type_name() == 'revolute' else t.PrismaticSpring)"
        yield f"{guard.format(sprung.joint)}p.AddForceElement({kinds}({of_drake}, {sprung.reference!r}, {sprung.stiffness!r}))"
    read = set() if request.format == "mjcf" else {id(one) for one in aid.springs} - {id(one) for one in springs_at_world(request)}
    for spring in aid.springs:
        if id(spring) not in read:
            ends = ", ".join(f"p.GetBodyByName({body!r}), {list(point)}" for body, point in spring.ends)
            element = f"t.LinearSpringDamper({ends}, {spring.free_length!r}, {spring.stiffness!r}, {spring.damping!r})"
            bodies = " and ".join(f"p.HasBodyNamed({body!r})" for body, _ in spring.ends) + " and " if guard else ""
            yield f"{bodies}p.AddForceElement({element})"
    yield f"p.mutable_gravity_field().set_gravity_vector({aid.gravity.tolist()})"
