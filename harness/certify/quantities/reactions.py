"""The reactions of joints: what each transmits, force and moment each a block.

The truth is a function of q, v, tau and the numbers of the declared file, through the accelerations that its own equations of motion
have. Of these a reaction feels more than the accelerations do: a mass on an axis, or the weight of what a fixed axis carries.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import replace

import numpy as np

from harness.arrays import Array
from harness.certify.compare import compare
from harness.certify.quantities import Quantity, Question
from harness.certify.quantity import Between, Certified, QuantityKernel
from harness.certify.reference import Reference, ReferenceKernel
from harness.certify.robot_reference import RobotReference
from harness.engines import Model, NotOffered, reactions
from harness.equations.states import States
from harness.errors import InvalidModel
from harness.robots.reactions import have_same_points, reactions_program
from harness.robots.recursion import recursion_program
from harness.robots.robot import robot_of
from harness.verdict import AGREEMENT, Verdict


class ReactionTruth:
    """The certified reactions of one mechanism, at the joints of one file."""

    def __init__(self, question: Question) -> None:
        mechanism, declared = question.mechanism, question.declared
        if mechanism.constraints is not None or declared.constraints:
            raise NotOffered("the reactions of trees alone are certified, and its coordinates are tied by constraints")
        self._question = question
        self._joints = tuple(dict.fromkeys(mechanism.joints))
        robot = replace(robot_of(declared, mechanism.gravity), joints=self._joints)
        in_body = question.linear_velocity_in_body
        read = robot_of(question.read, mechanism.gravity).tree
        # Another point is a number of another file, with roundings of its own.
        points_of = None if have_same_points(robot.tree, read, self._joints) else read
        self.reactions = reactions_program(robot.tree, self._joints, in_body, points_of)
        if not self.reactions.joints:
            raise NotOffered("no joint of the mechanism transmits anything: all are free")
        self.blocks = [f"{kind} of joint {name!r}" for kind in ("force", "moment") for name in self.reactions.joints]
        self._energies = ReferenceKernel(mechanism, in_body)
        self._reference = RobotReference(robot, in_body)
        self._recursion = recursion_program(robot.tree, self._joints, in_body)
        nq, nv = mechanism.nq, mechanism.nv
        self._applied, blocks = slice(nq + nv, nq + 2 * nv), np.arange(6 * len(self.reactions.joints)).reshape(-1, 3)
        self._kernel = QuantityKernel(self.reactions.program, blocks.tolist(), self._applied, self.reactions.sizes)

    @property
    def key(self) -> Hashable:
        """See ``Truth``; the program has the numbers of a second file where that has other points."""
        numbers = tuple(map(float, self.reactions.parameters))
        return self._question.declared.text, self.reactions.program.key, numbers, self._question.linear_velocity_in_body

    def evaluate(self, states: States) -> Certified:
        """Forces of all joints that transmit something, then moments, (n, 2 joints, 3) [N, N m].

        Raises:
            InvalidModel: the accelerations of the declared file are not those of the energies.
        """
        reference = self._reference.evaluate(states)
        self._hold_against_energies(states, reference)
        inputs = np.concatenate([states.q, states.v, reference.high, states.time[:, None]], axis=1)
        numbers = np.broadcast_to([float(value) for value in self.reactions.parameters], (len(states), len(self.reactions.parameters)))
        return self._kernel.evaluate(np.concatenate([inputs, numbers], axis=1), self._accelerations(states, reference))

    def answers(self, model: Model, states: States) -> Array:
        """See ``Truth``; of joints in the order of ``evaluate``."""
        found = reactions(model, self._joints, states)[:, [self._joints.index(name) for name in self.reactions.joints]]
        return np.concatenate([found[:, :, :3], found[:, :, 3:]], axis=1)

    def _hold_against_energies(self, states: States, reference: Reference) -> None:
        """Numbers are no truth for a mechanism that does not move as they say."""
        comparison = compare(self._energies.evaluate(states), np.asarray(reference.high))
        if (comparison.verdicts == Verdict.DISAGREES.value).any():
            worst = f"{comparison.known('backward_error').max():.3g} data roundoffs from those of the energies"
            problem = f"the accelerations of its numbers are {worst}, expected up to {AGREEMENT:g}; check accelerations first"
            raise InvalidModel(self._question.declared.path, None, problem)

    def _shares_of_motion(self, states: States, reference: Reference, inverse: Array) -> Array:
        """What half an ulp of twice the kinetic energy as a torque on each rotating coordinate does to the accelerations; see there."""
        twice_the_energy = (np.einsum("nij,nj->ni", reference.norm_factor, states.v) ** 2).sum(axis=1)
        rotating = np.flatnonzero(self._question.mechanism.rotating)
        columns = np.einsum("nij,nkj->nik", inverse, inverse[:, rotating])
        return np.asarray(twice_the_energy[:, None, None] * columns)

    def _accelerations(self, states: States, reference: Reference) -> Between:
        """The accelerations as values between, with their derivatives."""
        n, nv = states.v.shape
        # |x_i| is at most |x|_M times the root of the diagonal entry of M^-1; twice that covers the rounding of the factor of M.
        inverse = np.linalg.inv(np.where(reference.certified[:, None, None], reference.norm_factor, np.eye(nv)))
        radius = 2.0 * reference.radius[:, None] * np.linalg.norm(inverse, axis=2)
        columns = self._reference.derivatives(states, reference.high)
        slopes = inverse @ (inverse.transpose(0, 2, 1) @ columns)
        # Inputs of the recursion are q, v, tau and time, and then numbers of the file, of which the reactions feel some directly.
        numbers = {value.key: place for place, value in enumerate(self.reactions.parameters)}
        first, own = self._applied.stop + 1, self._applied.stop + 1 + len(numbers)
        felt, further = np.zeros((n, nv, own)), [*range(self._applied.start, self._applied.stop)]
        felt[:, :, : self._applied.start] = slopes[:, :, : self._applied.start]
        felt[:, :, self._applied.stop] = slopes[:, :, self._applied.stop]
        for place, value in enumerate(self._recursion.parameters, start=first):
            if value.key in numbers:
                felt[:, :, first + numbers[value.key]] = slopes[:, :, place]
            else:
                further.append(place)
        values = self._reference.mechanism.inputs(states).T[:, further]
        return Between(
            high=reference.high,
            low=reference.low,
            radius=radius,
            further=values,
            slopes=np.concatenate([felt, slopes[:, :, further]], axis=2),
            shares=self._shares_of_motion(states, reference, inverse),
            certified=reference.certified,
        )


REACTIONS = Quantity("reactions", ReactionTruth)
