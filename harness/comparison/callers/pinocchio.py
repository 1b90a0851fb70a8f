"""Pinocchio as its user calls it: ``pin.buildModelFromUrdf`` or ``pin.buildModelFromMJCF``, then ``pin.aba``.

A continuous joint has two positions there, cosine and sine, and so has the turn of a planar joint; a quaternion ends with w; the linear
velocity of a free or planar joint is in the body's frame. Source: Pinocchio 4 documentation, joints.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.comparison.coordinates import LINEAR, accelerations_from_body, body_turn, to_body
from harness.comparison.questions import Answers, Asked, Question, by_joint, projected
from harness.engines._standard_error import captured_standard_error

# Several joints of one body; its first gives the name. A joint without name, as the tree names it.
_COMPOSITE, _UNNAMED = "Composite_", re.compile(r"\(joint (\d+) of (.+)\)")


class PinocchioCaller:
    engine = "pinocchio"
    formats = ("urdf", "mjcf")
    takes_inertias_about_tree = False
    call: Mapping[str, str] = {
        "urdf": "pin.aba(m := pin.buildModelFromUrdf(PATH), m.createData(), q, v, tau)",
        "mjcf": "pin.aba(m := pin.buildModelFromMJCF(PATH), m.createData(), q, v, tau)",
    }

    def ask(self, question: Question) -> Answers:
        # The reader's reasons go to file descriptor 2 alone; its exceptions do not hold them.
        with captured_standard_error() as captured:
            try:
                model = _read(question)
            except Exception as error:
                return Answers(refusal=" ".join((captured() or str(error)).split()))
        if question.aid is not None:
            model.gravity.linear = question.aid.gravity
        return _Asked(model, question).answers()


def _read(question: Question) -> Any:
    import pinocchio

    path = str(question.path)
    if question.format == "mjcf":
        return pinocchio.buildModelFromMJCF(path)
    if question.floating_base:
        return pinocchio.buildModelFromUrdf(path, pinocchio.JointModelFreeFlyer(), question.floating_base)
    return pinocchio.buildModelFromUrdf(path)


class _Asked:
    """A loaded model with the joints of a question."""

    def __init__(self, model: Any, question: Question) -> None:
        self.model, self.question = model, question
        self.places = _places(model, question.joints)
        self.found = [joint for joint in question.joints if joint.name in self.places]

    def answers(self) -> Answers:
        import pinocchio

        model, question, aid = self.model, self.question, self.question.aid
        configuration, velocity, force = self._columns()
        own = [number for joint in self.found for number in self.places[joint.name][1]]
        known = [column for joint in self.found for column in joint.velocities]
        if aid is not None:
            force[:, own] += sum(aid.forces.values(), np.zeros_like(question.tau))[:, known]
            model.armature[own] = aid.armature[known]
        data, found = model.createData(), np.empty((len(question.q), model.nv))
        if aid is None or aid.couplings is None:
            for state, inputs in enumerate(zip(configuration, velocity, force, strict=True)):
                found[state] = pinocchio.aba(model, data, *inputs)
            answered, accelerations = self.found, found[:, own]
        else:
            answered, accelerations = [*aid.leaders], np.empty((len(question.q), aid.couplings.shape[1]))
            for state, (position, rate, applied) in enumerate(zip(configuration, velocity, force, strict=True)):
                upper = np.triu(pinocchio.crba(model, data, position))
                mass = (upper + np.triu(upper, 1).T)[np.ix_(own, own)]
                terms = applied[own] - pinocchio.nonLinearEffects(model, data, position, rate)[own]
                accelerations[state] = projected(mass, terms, aid.couplings[known])
        self._to_frame_of_parent(answered, accelerations)
        further = [name for number, name in enumerate(model.names) if number and name not in _names(self.places)]
        return Answers(by_joint(answered, accelerations), further=tuple(further))

    def _columns(self) -> tuple[Array, Array, Array]:
        """Pinocchio's own q, v and tau, one row a state."""
        import pinocchio

        question, n = self.question, len(self.question.q)
        configuration = np.tile(pinocchio.neutral(self.model), (n, 1))
        velocity, force = np.zeros((n, self.model.nv)), np.zeros((n, self.model.nv))
        for joint in self.found:
            positions, velocities, _ = self.places[joint.name]
            q, v, tau = question.q[:, joint.positions], question.v[:, joint.velocities], question.tau[:, joint.velocities]
            if joint.kind in LINEAR:
                turn = body_turn(joint.kind, q)
                v, tau = to_body(turn, v), to_body(turn, tau)
            if joint.kind == "planar":
                q = np.hstack([q[:, :2], np.cos(q[:, 2:]), np.sin(q[:, 2:])])
            elif joint.kind in ("ball", "free"):
                q = np.hstack([q[:, :-4], q[:, -3:], q[:, -4:-3]])
            elif len(positions) == 2:
                q = np.hstack([np.cos(q), np.sin(q)])
            configuration[:, positions], velocity[:, velocities], force[:, velocities] = q, v, tau
        return configuration, velocity, force

    def _to_frame_of_parent(self, joints: Sequence[Asked], accelerations: Array) -> None:
        """Accelerations of free and planar joints, given as rates of components in the body's frame, in that of the parent instead."""
        start, own = 0, {joint.name: joint for joint in self.found}
        for joint in joints:
            end = start + len(joint.velocities)
            if joint.kind in LINEAR:
                asked = own[joint.name]
                turn, v = body_turn(joint.kind, self.question.q[:, asked.positions]), self.question.v[:, asked.velocities]
                accelerations[:, start:end] = accelerations_from_body(turn, accelerations[:, start:end], v)
            start = end


def _places(model: Any, joints: Sequence[Asked]) -> dict[str, tuple[list[int], list[int], str]]:
    """Positions, velocities and Pinocchio's name of each joint that the model has; one of several in a body is part of a composite."""
    places, names = {}, _names_of_reader(joints)
    for number in range(1, model.njoints):
        joint, name = model.joints[number], model.names[number]
        parts = _parts(joint, names.get(name.removeprefix(_COMPOSITE), name), name.startswith(_COMPOSITE), joints)
        q, v = joint.idx_q, joint.idx_v
        for part, nq, nv in parts:
            places[part] = list(range(q, q + nq)), list(range(v, v + nv)), name
            q, v = q + nq, v + nv
    return {joint.name: places[joint.name] for joint in joints if joint.name in places}


def _names_of_reader(joints: Sequence[Asked]) -> dict[str, str]:
    """Names of joints by those that the MJCF reader gives them: a joint without one is called after its body."""
    found: dict[str, str] = {}
    for joint in joints:
        names = [joint.name]
        if unnamed := _UNNAMED.fullmatch(joint.name):
            number, body = unnamed.groups()
            names = [f"{body}Joint_{int(number) - 1}", f"{body}_free"]
        found |= dict.fromkeys(names, joint.name)
    return found


def _parts(joint: Any, name: str, is_composite: bool, joints: Sequence[Asked]) -> list[tuple[str, int, int]]:
    """Name, positions and velocities of a joint, or of those that a composite of the MJCF reader is made of, in their order."""
    names = [one.name for one in joints]
    if not is_composite or name not in names:
        return [(name, joint.nq, joint.nv)]
    found: list[tuple[str, int, int]] = []
    for one in joints[names.index(name) :]:
        if sum(nv for _, _, nv in found) < joint.nv:
            found.append((one.name, len(one.positions), len(one.velocities)))
    return found


def _names(places: Mapping[str, tuple[list[int], list[int], str]]) -> set[str]:
    return {name for _, _, name in places.values()}


CALLER = PinocchioCaller()
