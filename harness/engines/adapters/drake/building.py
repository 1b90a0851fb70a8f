"""The statements that make a plant of a file, as a reproducer prints them: what the parser reads, and what is added to it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

from harness.engines.adapters.drake.files import armatures_passed_over, refused_warnings, silent, springs_at_world, text_for_parser
from harness.engines.reading import elements_of, root_link
from harness.engines.request import Aid, Request
from harness.files.tree import WORLD

# Of a plant without a time step.
CONTINUOUS = "MultibodyPlant(0.0)"
FINALIZE = "p.Finalize()"


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
    names: dict[str, Any] = {"x": building.text}
    with refused_warnings() if building.is_strict else silent():
        # The very text that a reproducer prints: what it shows is what was done.
        exec(building.statements, names)
    return names["p"]


def building(request: Request) -> Building:
    """What makes the plant of a request: plain as its user does, or with what the parser passes over."""
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
    by_velocity = {joint.velocities[0]: joint.name for joint in request.joints}
    # A file of a user may hold what the parser leaves out with all that hangs on it.
    guard = "" if request.text is not None else "p.HasJointNamed({0!r}) and "
    if request.text is None and aid.armature.any():
        yield "a = {p.get_joint_actuator(i).joint().name(): p.get_joint_actuator(i) for i in p.GetJointActuatorIndices()}"
        for joint in request.joints:
            if (inertia := float(aid.armature[joint.velocities[0]])) and joint.name != request.floating_base:
                found = f"a.get({joint.name!r}) or p.AddJointActuator({f'rotor of {joint.name}'!r}, p.GetJointByName({joint.name!r}))"
                made = f"[(r.set_default_gear_ratio(1.0), r.set_default_rotor_inertia({inertia!r})) for r in [{found}]]"
                yield guard.format(joint.name) + made
    for _, velocity, stiffness, reference in aid.forces.springs:
        name = by_velocity[velocity]
        sprung = f"p.GetJointByName({name!r})"
        kinds = f"(t.RevoluteSpring if {sprung}.type_name() == 'revolute' else t.PrismaticSpring)"
        yield f"{guard.format(name)}p.AddForceElement({kinds}({sprung}, {reference!r}, {stiffness!r}))"
    read = set() if request.format == "mjcf" else {id(one) for one in aid.springs} - {id(one) for one in springs_at_world(request)}
    for spring in aid.springs:
        if id(spring) not in read:
            ends = ", ".join(f"p.GetBodyByName({body!r}), {list(point)}" for body, point in spring.ends)
            element = f"t.LinearSpringDamper({ends}, {spring.free_length!r}, {spring.stiffness!r}, {spring.damping!r})"
            bodies = " and ".join(f"p.HasBodyNamed({body!r})" for body, _ in spring.ends) + " and " if guard else ""
            yield f"{bodies}p.AddForceElement({element})"
    yield f"p.mutable_gravity_field().set_gravity_vector({aid.gravity.tolist()})"
