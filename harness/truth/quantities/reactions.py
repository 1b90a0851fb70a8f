"""The reactions of joints: what each transmits, force and moment each a block.

The truth is a function of q, v, tau and the numbers of the declared file, through the accelerations that its own equations of motion
have. Of these a reaction feels more than the accelerations do: a mass on an axis, or the weight of what a fixed axis carries. Where
the file holds constraints, what these bear stands beside the accelerations, by the law that the engine declares or rigid.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import replace

import numpy as np

from harness.arrays import Array
from harness.engines import Call, Calls, Model, NotOffered
from harness.programs.evaluation import jacobians
from harness.programs.mechanisms.constraint_forces import MULTIPLIERS
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.program import without_unused
from harness.programs.states import States
from harness.storage import Kept
from harness.trees.mechanism import RobotMechanism, TiedMechanism, mechanism_of, tied_mechanism
from harness.trees.quantities import forces
from harness.trees.quantities.motion import tree_motion
from harness.trees.robot import Robot
from harness.truth.blocks import Between, QuantityKernel
from harness.truth.compare import Certified
from harness.truth.quantities import Quantity, TruthBasis
from harness.truth.quantities.of_files import TruthOfMotion, hold_against_energies
from harness.truth.reference import Reference, ReferenceKernel
from harness.truth.sampling import sample

# States at which the independent rows of constraints are found.
_STATES, _SEED = 4, 0


class ReactionTruth(TruthOfMotion):
    """The certified reactions of one mechanism, at the joints of one file."""

    def __init__(self, basis: TruthBasis) -> None:
        mechanism, declared = basis.mechanism, basis.declared
        if declared is None or basis.read is None:
            raise NotOffered("reactions are those of a mechanism's file, which is held against energies; a robot's file has none")
        self._declared, robot, in_body = declared, basis.robot_of(declared), basis.linear_velocity_in_body
        # Another point is a number of another file, with roundings of its own.
        points_of = basis.robot_of(basis.read).tree if basis.has_other_points else None
        own, rigid, bearing = _motion(robot, basis)
        self._numbers, self._transmitting = rigid.given, forces.transmitting_joints(robot.tree)
        if not self._transmitting:
            raise NotOffered("no joint of the mechanism transmits anything: all are free")
        nq, nv = mechanism.nq, mechanism.nv
        super().__init__(
            basis,
            tree_motion(robot.tree, basis.joints, in_body, multipliers=len(bearing)),
            lambda motion: forces.reactions(motion, points_of, declared.constraints, bearing),
            slice(nq + nv, nq + 2 * nv + len(bearing)),
        )
        self._energies, self._reference = ReferenceKernel(mechanism, in_body), ReferenceKernel(own, in_body)
        self._rigid = self._reference if rigid is own else ReferenceKernel(rigid, in_body)
        self._bearing: QuantityKernel | None = None
        if bearing:
            outputs = {MULTIPLIERS: own.program.outputs[MULTIPLIERS]}
            self._bearing = QuantityKernel(without_unused(replace(own.program, outputs=outputs)), [[row] for row in range(len(bearing))])

    @property
    def key(self) -> Hashable:
        """See ``Truth``; with the law of constraints."""
        return super().key, self._reference.mechanism.key

    def evaluate(self, states: States) -> Certified:
        """Forces of all joints that transmit something, then moments, (n, 2 joints, 3) [N, N m].

        Raises:
            InvalidModel: the accelerations of the declared file are not those of the energies.
        """
        reference = self._reference.evaluate(states)
        rigid = reference if self._rigid is self._reference else self._rigid.evaluate(states)
        hold_against_energies(self._declared, self._energies, states, rigid)
        between = self._values_between(states, reference)
        return self._evaluated(states, between.high, between)

    def asks(self, model: Model, states: States) -> Calls:
        """See ``Truth``; of joints in the order of ``evaluate``."""
        joints = self._basis.joints

        def formed(answers: Sequence[Array]) -> Array:
            found = answers[0][:, [joints.index(name) for name in self._transmitting]]
            return np.concatenate([found[:, :, :3], found[:, :, 3:]], axis=1)

        return Calls((Call("reactions", (states.q, states.v, states.tau), (len(states), len(joints), 6)),), formed)

    def _values_between(self, states: States, reference: Reference) -> Between:
        """The accelerations and the multipliers as values between, with their derivatives by all inputs of the equations of motion."""
        nv = states.v.shape[1]
        # |x_i| is at most |x|_M times the root of the diagonal entry of M^-1; twice that covers the rounding of the factor of M.
        inverse = reference.inverse_factor()
        radius = 2.0 * reference.radius[:, None] * np.linalg.norm(inverse, axis=2)
        columns = self._reference.derivatives(states, reference.high)
        slopes = inverse @ (inverse.transpose(0, 2, 1) @ columns)
        bearing = self._multipliers(states)
        slopes = np.concatenate([slopes, bearing.slopes], axis=1)
        felt, further = self._as_inputs(states, slopes)
        # What one unit roundoff of twice the kinetic energy as a torque on each rotating coordinate does.
        rotating = states.q.shape[1] + nv + np.flatnonzero(self._basis.mechanism.rotating)
        return Between(
            high=np.concatenate([reference.high, bearing.high], axis=1),
            low=np.concatenate([reference.low, bearing.low], axis=1),
            radius=np.concatenate([radius, bearing.radius], axis=1),
            further=further,
            slopes=felt,
            shares=np.asarray(reference.twice_the_energy(states.v)[:, None, None] * slopes[:, :, rotating]),
            certified=reference.certified & bearing.certified,
        )

    def _multipliers(self, states: States) -> Between:
        """Multipliers of the rows of constraints, with their derivatives by the inputs of the equations of motion; none for a tree."""
        inputs = np.ascontiguousarray(self._reference.mechanism.inputs(states).T)
        none = Between.none(*inputs.shape)
        if self._bearing is None:
            return none
        found = self._bearing.evaluate(inputs)
        slopes = jacobians(self._bearing.program, np.ascontiguousarray(inputs.T))[MULTIPLIERS].transpose(2, 0, 1)
        high, low = found.high[:, :, 0], found.low[:, :, 0]
        return replace(none, high=high, low=low, radius=found.radius, slopes=slopes, certified=found.certified)

    def _as_inputs(self, states: States, slopes: Array) -> tuple[Array, Array]:
        """Derivatives by the inputs of the reactions, and by what else the motion depends on; and the values of the latter."""
        nq, nv = states.q.shape[1], states.v.shape[1]
        # Inputs of the motion are q, v, tau and time, and then numbers of the file, of which the reactions feel some directly.
        numbers = {value.key: place for place, value in enumerate(self._written.parameters, start=self._between.stop + 1)}
        applied, time = range(nq + nv, nq + 2 * nv), nq + 2 * nv
        felt = np.zeros((*slopes.shape[:2], self._between.stop + 1 + len(numbers)))
        felt[:, :, : nq + nv] = slopes[:, :, : nq + nv]
        felt[:, :, self._between.stop] = slopes[:, :, time]
        first, further = time + 1, [*applied]
        for place, value in enumerate(self._numbers, start=first):
            if value.key in numbers:
                felt[:, :, numbers[value.key]] = slopes[:, :, place]
            else:
                further.append(place)
        # Numbers of a law of constraints stand behind those of the tree.
        further += range(first + len(self._numbers), slopes.shape[2])
        values = self._reference.mechanism.inputs(states).T[:, further]
        return np.concatenate([felt, slopes[:, :, further]], axis=2), values


def _motion(robot: Robot, basis: TruthBasis) -> tuple[Mechanism, RobotMechanism, Sequence[int]]:
    """The declared file's mechanism: by its engine's law, and rigid; and the rows of constraints that bear something."""
    mechanism, declared = basis.mechanism, basis.declared
    if mechanism.constraints is None or declared is None:
        tree = mechanism_of(robot)
        return tree, tree, ()
    constraints, rows = mechanism.constraints, declared.constraints

    def write() -> TiedMechanism:
        return tied_mechanism(robot, rows, constraints, sample(mechanism, _STATES, _SEED))

    try:
        # Written once per process, whoever reads which file.
        tied = _TIED.get((declared.text, declared.format, mechanism.key, robot.joints), write)
    except ValueError as problem:
        raise NotOffered(str(problem)) from problem
    if basis.softened is None and not tied.is_determined:
        raise NotOffered("rows of its constraints follow from others, so that nothing says how rigid joints share what they bear")
    return tied.mechanism if basis.softened is None else basis.softened(tied.mechanism), tied.mechanism, tied.bearing


_TIED: Kept[TiedMechanism] = Kept(64)
REACTIONS = Quantity("reactions", ReactionTruth, has_laws=True)
