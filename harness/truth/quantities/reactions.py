"""The reactions of joints: what each transmits, force and moment each a block.

The truth is a function of q, v, tau and the numbers of the declared file, through the accelerations that its own equations of motion
have. Of these a reaction feels more than the accelerations do: a mass on an axis, or the weight of what a fixed axis carries. Where
the file holds constraints, what these bear stands beside the accelerations, by the law that the engine declares or rigid.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from harness.arrays import Array
from harness.engines import Model, NotOffered, answer_of
from harness.files.tree import Given
from harness.programs.evaluation import jacobians
from harness.programs.mechanisms.constraint_forces import MULTIPLIERS
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.program import without_unused
from harness.programs.states import States
from harness.storage import Kept
from harness.trees.constraints.rows import untied
from harness.trees.constraints.tied import TiedMechanism, tied_mechanism
from harness.trees.mechanism import mechanism_of
from harness.trees.quantities.reactions import reactions_program
from harness.trees.recursion import recursion_program
from harness.trees.robot import Robot
from harness.truth.blocks import Between, QuantityKernel
from harness.truth.compare import Certified, Flags
from harness.truth.quantities import Quantity, Truth, TruthBasis
from harness.truth.quantities._file_truth import hold_against_energies
from harness.truth.reference import Reference, ReferenceKernel
from harness.truth.sampling import sample

# States at which the independent rows of constraints are found.
_STATES, _SEED = 4, 0


class ReactionTruth(Truth):
    """The certified reactions of one mechanism, at the joints of one file."""

    def __init__(self, basis: TruthBasis) -> None:
        mechanism, declared = basis.mechanism, basis.declared
        if declared is None or basis.read is None:
            raise NotOffered("reactions are those of a mechanism's file, which is held against energies; a robot's file has none")
        self._basis, self._declared = basis, declared
        self._joints = tuple(dict.fromkeys(mechanism.joints))
        robot = basis.robot_of(declared)
        robot = replace(robot, joints=self._joints, tree=untied(robot.tree, self._joints))
        in_body = basis.linear_velocity_in_body
        # Another point is a number of another file, with roundings of its own.
        points_of = untied(basis.robot_of(basis.read).tree, self._joints) if basis.has_other_points else None
        own, rigid, self._numbers, bearing = self._motion(robot)
        self.reactions = reactions_program(robot.tree, self._joints, in_body, points_of, declared.constraints, bearing)
        if not self.reactions.joints:
            raise NotOffered("no joint of the mechanism transmits anything: all are free")
        self.blocks = [f"{kind} of joint {name!r}" for kind in ("force", "moment") for name in self.reactions.joints]
        self._energies = ReferenceKernel(mechanism, in_body)
        self._reference = ReferenceKernel(own, in_body)
        self._rigid = self._reference if rigid is own else ReferenceKernel(rigid, in_body)
        self._multipliers = MultiplierKernel(own, len(bearing))
        nq, nv = mechanism.nq, mechanism.nv
        self._between, blocks = slice(nq + nv, nq + 2 * nv + len(bearing)), np.arange(6 * len(self.reactions.joints)).reshape(-1, 3)
        self._kernel = QuantityKernel(self.reactions.program, blocks.tolist(), self._between, self.reactions.sizes)

    def _motion(self, robot: Robot) -> tuple[Mechanism, Mechanism, Sequence[Given], Sequence[int]]:
        """The declared file's mechanism: by its engine's law, and rigid. The numbers of the file that are the first parameters of both,
        and the rows of constraints that bear something."""
        mechanism, softened = self._basis.mechanism, self._basis.softened
        if mechanism.constraints is None:
            in_body = self._basis.linear_velocity_in_body
            tree = mechanism_of(robot)
            return tree, tree, recursion_program(robot.tree, self._joints, in_body).parameters, ()
        tied = _tied(robot, self._basis)
        if softened is not None:
            return softened(tied.mechanism), tied.mechanism, tied.parameters, tied.bearing
        if not tied.is_determined:
            raise NotOffered("rows of its constraints follow from others, so that nothing says how rigid joints share what they bear")
        return tied.mechanism, tied.mechanism, tied.parameters, tied.bearing

    @property
    def key(self) -> Hashable:
        """See ``Truth``; the program has the numbers of a second file where that has other points."""
        numbers = tuple(map(float, self.reactions.parameters))
        law = self._reference.mechanism.key
        return self._declared.text, self.reactions.program.key, numbers, self._basis.linear_velocity_in_body, law

    def evaluate(self, states: States) -> Certified:
        """Forces of all joints that transmit something, then moments, (n, 2 joints, 3) [N, N m].

        Raises:
            InvalidModel: the accelerations of the declared file are not those of the energies.
        """
        reference = self._reference.evaluate(states)
        rigid = reference if self._rigid is self._reference else self._rigid.evaluate(states)
        hold_against_energies(self._declared, self._energies, states, rigid)
        between = self._values_between(states, reference)
        inputs = np.concatenate([states.q, states.v, between.high, states.time[:, None]], axis=1)
        numbers = np.broadcast_to([float(value) for value in self.reactions.parameters], (len(states), len(self.reactions.parameters)))
        return self._kernel.evaluate(np.concatenate([inputs, numbers], axis=1), between)

    def answers(self, model: Model, states: States) -> Array:
        """See ``Truth``; of joints in the order of ``evaluate``."""
        inputs, shape = (states.q, states.v, states.tau), (len(states), len(self._joints), 6)
        found = answer_of(model, "reactions", inputs, shape)[:, [self._joints.index(name) for name in self.reactions.joints]]
        return np.concatenate([found[:, :, :3], found[:, :, 3:]], axis=1)

    def _values_between(self, states: States, reference: Reference) -> Between:
        """The accelerations and the multipliers as values between, with their derivatives by all inputs of the equations of motion."""
        nv = states.v.shape[1]
        # |x_i| is at most |x|_M times the root of the diagonal entry of M^-1; twice that covers the rounding of the factor of M.
        inverse = np.linalg.inv(np.where(reference.certified[:, None, None], reference.norm_factor, np.eye(nv)))
        radius = 2.0 * reference.radius[:, None] * np.linalg.norm(inverse, axis=2)
        columns = self._reference.derivatives(states, reference.high)
        slopes = inverse @ (inverse.transpose(0, 2, 1) @ columns)
        bearing = self._multipliers.evaluate(states)
        slopes = np.concatenate([slopes, bearing.slopes], axis=1)
        felt, further = self._as_inputs(states, slopes)
        # What half an ulp of twice the kinetic energy as a torque on each rotating coordinate does.
        twice_the_energy = (np.einsum("nij,nj->ni", reference.norm_factor, states.v) ** 2).sum(axis=1)
        rotating = states.q.shape[1] + nv + np.flatnonzero(self._basis.mechanism.rotating)
        return Between(
            high=np.concatenate([reference.high, bearing.high], axis=1),
            low=np.concatenate([reference.low, bearing.low], axis=1),
            radius=np.concatenate([radius, bearing.radius], axis=1),
            further=further,
            slopes=felt,
            shares=np.asarray(twice_the_energy[:, None, None] * slopes[:, :, rotating]),
            certified=reference.certified & bearing.certified,
        )

    def _as_inputs(self, states: States, slopes: Array) -> tuple[Array, Array]:
        """Derivatives by the inputs of the reactions, and by what else the motion depends on; and the values of the latter."""
        nq, nv = states.q.shape[1], states.v.shape[1]
        # Inputs of the motion are q, v, tau and time, and then numbers of the file, of which the reactions feel some directly.
        numbers = {value.key: place for place, value in enumerate(self.reactions.parameters, start=self._between.stop + 1)}
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


def _tied(robot: Robot, basis: TruthBasis) -> TiedMechanism:
    """The declared file's mechanism under its constraints; written once per process, whoever reads which file."""
    mechanism, declared = basis.mechanism, basis.declared
    assert mechanism.constraints is not None and declared is not None
    constraints, rows = mechanism.constraints, declared.constraints

    def write() -> TiedMechanism:
        return tied_mechanism(robot, rows, constraints, sample(mechanism, _STATES, _SEED))

    try:
        return _TIED.get((declared.text, declared.format, mechanism.key, robot.joints), write)
    except ValueError as problem:
        raise NotOffered(str(problem)) from problem


_TIED: Kept[TiedMechanism] = Kept(64)
REACTIONS = Quantity("reactions", ReactionTruth, has_laws=True)


@dataclass(frozen=True)
class Multipliers:
    """What m rows bear at n states [N or N m].

    Attributes:
        high, low, radius: (n, m). slopes: (n, m, inputs of the mechanism's program), in float64. certified: (n,).
    """

    high: Array
    low: Array
    radius: Array
    slopes: Array
    certified: Flags


class MultiplierKernel:
    """The multipliers of a mechanism with ``rows`` rows, none of them for a tree; write once, evaluate many batches."""

    def __init__(self, mechanism: Mechanism, rows: int) -> None:
        self._mechanism, self._rows = mechanism, rows
        if rows:
            program = mechanism.program
            self._program = without_unused(replace(program, outputs={MULTIPLIERS: program.outputs[MULTIPLIERS]}))
            self._kernel = QuantityKernel(self._program, [[row] for row in range(rows)])

    def evaluate(self, states: States) -> Multipliers:
        """What the rows bear at ``states``."""
        inputs = np.ascontiguousarray(self._mechanism.inputs(states).T)
        n, count = inputs.shape
        none = np.zeros((n, 0))
        if not self._rows:
            return Multipliers(none, none, none, np.zeros((n, 0, count)), np.ones(n, dtype=np.bool_))
        found = self._kernel.evaluate(inputs)
        slopes = jacobians(self._program, np.ascontiguousarray(inputs.T))[MULTIPLIERS].transpose(2, 0, 1)
        return Multipliers(found.high[:, :, 0], found.low[:, :, 0], found.radius, slopes, found.certified)
