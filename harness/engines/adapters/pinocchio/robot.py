"""Pinocchio as its user calls it: ``pin.buildModelFromUrdf`` or ``pin.buildModelFromMJCF``, then ``pin.aba``.

A continuous joint has two positions there, cosine and sine, and so has the turn of a planar joint; a quaternion ends with w; the linear
velocity of a free or planar joint is in the body's frame. Source: Pinocchio 4 documentation, joints.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cached_property, partial
from typing import Any

import pinocchio

from harness.arrays import Array
from harness.engines import NotOffered
from harness.engines.adapters.pinocchio.forces import ForceElements, places_of
from harness.engines.adapters.pinocchio.quantities import PinocchioQuantities
from harness.engines.adapters.pinocchio.versions import mass_matrix, reasons, set_armature
from harness.engines.coordinates import accelerations_from_body, body_turn, to_body
from harness.engines.loaded_file import EngineRun, LoadedFile
from harness.engines.request import AskedJoint, Refused, Request
from harness.files.facts import ForceElement, JointDamper


def read(request: Request) -> PinocchioFile:
    """A file as its user loads it, or aided; see ``harness.engines.Engine``."""
    return PinocchioFile(model_of(request), request)


def model_of(request: Request) -> Any:
    """The ``pinocchio.Model`` of a file as its user loads it.

    Raises:
        Refused: its reader refuses the file.
    """
    with reasons(lambda words: Refused(" ".join(words.split()))):
        return _read(request)


def _read(request: Request) -> Any:
    path = str(request.path)
    if request.format == "mjcf":
        return pinocchio.buildModelFromMJCF(path)
    if request.floating_base:
        return pinocchio.buildModelFromUrdf(path, pinocchio.JointModelFreeFlyer(), request.floating_base)
    if request.supplied_ball_joint:
        return pinocchio.buildModelFromUrdf(path, pinocchio.JointModelSpherical(), request.supplied_ball_joint)
    return pinocchio.buildModelFromUrdf(path)


class PinocchioFile(LoadedFile):
    """A ``pinocchio.Model`` with the joints of a request."""

    def __init__(self, model: Any, request: Request) -> None:
        places = places_of(model, request.joints)
        super().__init__(request, places)
        self.placed = self._with(ForceElements(model, self.aid.springs, places))
        if request.aid is not None:
            model.gravity.linear = request.aid.gravity
            set_armature(model, self.addresses[1], request.aid.armature[self.v_columns])

    def _with(self, elements: ForceElements) -> PinocchioQuantities:
        return PinocchioQuantities(elements.model, [joint.name for joint in self.found], elements)

    @cached_property
    def quantities(self) -> PinocchioQuantities:
        if floating := [joint.name for joint in self.found if joint.kind.linear > 1]:
            raise NotOffered(f"the linear velocity of joint {floating[0]!r} is in another frame, converted for accelerations alone")
        return self._with(ForceElements(self.model, list(self._elements()), self.placed.force_elements.places))

    def _elements(self) -> Iterator[ForceElement]:
        """The springs and dampers that are supplied."""
        yield from self.aid.springs
        forces, by_velocity = self.aid.forces, {joint.velocities[0]: joint for joint in self.found}
        for velocity, joint in by_velocity.items():
            if damping := float(forces.damping[velocity]):
                yield JointDamper(joint.name, damping, joint.line)
        for spring, _, velocity in forces.springs:
            if velocity in by_velocity:
                if self.placed.force_elements.places[spring.joint].nq != 1:
                    raise NotOffered(f"joint {spring.joint!r} with a spring stands in q as the cosine and sine of its position")
                yield spring

    def prepare(self, q: Array, v: Array, tau: Array) -> EngineRun:
        model, data, asked = self.model, self.model.createData(), {joint.name: joint for joint in self.found}
        tau, own_v = tau + self.supplied(q, v), v.copy()
        for joint in self.found:
            if joint.kind.linear > 1:
                turn, columns = body_turn(joint.kind, q[:, joint.positions]), list(joint.velocities)
                own_v[:, columns], tau[:, columns] = to_body(turn, v[:, columns]), to_body(turn, tau[:, columns])

        def of_leaders(configuration: Array, velocity: Array, force: Array) -> Array:
            # ``aba`` refuses such a model.
            mass = mass_matrix(model, data, configuration)
            return self.of_leaders(mass, force - pinocchio.nonLinearEffects(model, data, configuration, velocity))

        def in_file(joint: AskedJoint, accelerations: Array) -> Array:
            """Those of free and planar joints, given as rates of components in the body's frame, in that of the parent instead."""
            if joint.kind.linear <= 1:
                return accelerations
            q_columns, v_columns = list(asked[joint.name].positions), list(asked[joint.name].velocities)
            return accelerations_from_body(body_turn(joint.kind, q[:, q_columns]), accelerations, v[:, v_columns])

        configuration, velocity, force = (
            part.T for part in self.placed.pulled(q[:, self.q_columns], own_v[:, self.v_columns], tau[:, self.v_columns])
        )
        evaluate = self.accelerating() if self.couplings is None else of_leaders
        return EngineRun(self, (configuration, velocity, force), evaluate, in_file)

    def accelerating(self) -> Callable[..., Array]:
        """Accelerations of the model by its own q, v and tau, (nv,), where no joint's are eliminated."""
        return partial(pinocchio.aba, self.model, self.model.createData())
