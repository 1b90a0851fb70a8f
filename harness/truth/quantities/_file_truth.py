"""The truth of quantities that the numbers of a model file give at positions, velocities and accelerations, of trees and of loops.

The file is held against the energies of its mechanism first: its mass matrix, velocity terms and gravity have to be theirs, at a few
states. A robot has no energies; its file is all there is.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from harness.arrays import Array
from harness.engines import Model
from harness.errors import InvalidModel
from harness.files.model_file import ModelFile
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.states import States
from harness.storage import Kept
from harness.trees.constraints.rows import untied
from harness.trees.mechanism import mechanism_of
from harness.trees.quantities.tree_motion import Block, ComputedQuantity, TreeMotion, computed, tree_motion
from harness.truth.blocks import QuantityKernel
from harness.truth.compare import Certified, compare
from harness.truth.quantities import Truth, TruthBasis
from harness.truth.reference import Reference, ReferenceKernel
from harness.truth.terms import GRAVITY, MASS, VELOCITY, certify_terms, term_errors
from harness.verdict import AGREEMENT, Verdict

# States at which a file is held against the energies.
HELD_AT = 4
# What a joint's applied force at the end of its range gives its coordinate alone [1/s^2]; see ``harness.truth.sampling``.
LARGEST_ACCELERATION = 100.0


@dataclass(frozen=True)
class AskedMotion:
    """What an engine is asked at n states: q (n, nq), v and qdd (n, nv), of these ``joints``; ``zero``, (1, nq), is the position zero."""

    joints: tuple[str, ...]
    q: Array
    v: Array
    qdd: Array
    zero: Array


class FileTruth(Truth):
    """The certified values of a quantity of one mechanism, by the numbers of one file.

    ``blocks_of`` writes the quantity, ``answer`` asks a model for it and gives (n, components of all blocks) in the order of the blocks.
    """

    def __init__(
        self,
        basis: TruthBasis,
        blocks_of: Callable[[TreeMotion], Iterable[Block]],
        answer: Callable[[Model, AskedMotion], Array],
    ) -> None:
        mechanism = basis.mechanism
        self._basis, self._answer = basis, answer
        self._joints = tuple(dict.fromkeys(mechanism.joints))
        robot = basis.robot_of(basis.declared)
        self._robot = replace(robot, joints=self._joints, tree=untied(robot.tree, self._joints))
        read = basis.robot_of(basis.read)
        own = tree_motion(self._robot.tree, self._joints, basis.linear_velocity_in_body, read.tree, basis.has_other_points)
        self._written: ComputedQuantity = computed(own, blocks_of)
        self.blocks: Sequence[str] = self._written.blocks
        places = np.arange(len(self.blocks) * self._written.width).reshape(-1, self._written.width)
        self._kernel = QuantityKernel(self._written.program, places.tolist(), sizes=self._written.sizes)

    @property
    def key(self) -> Hashable:
        """See ``Truth``; the program has the numbers of a second file where that has other points."""
        numbers = tuple(map(float, self._written.parameters))
        return self._basis.mechanism.key, self._text, self._written.program.key, numbers, self._basis.linear_velocity_in_body

    @property
    def _text(self) -> str:
        return "" if self._basis.declared is None else self._basis.declared.text

    def evaluate(self, states: States) -> Certified:
        """Raises InvalidModel where the numbers of the file are not those of the energies."""
        mechanism, in_body = self._basis.mechanism, self._basis.linear_velocity_in_body
        if self._basis.declared is not None:
            _HELD.get((mechanism.key, self._text, in_body), lambda: self._hold_against_energies(states[:HELD_AT]))
        n, numbers = len(states), [float(value) for value in self._written.parameters]
        given = [states.q, states.v, self._accelerations(states), states.time[:, None], np.broadcast_to(numbers, (n, len(numbers)))]
        return self._kernel.evaluate(np.concatenate(given, axis=1))

    def answers(self, model: Model, states: States) -> Array:
        """See ``Truth``."""
        asked = AskedMotion(self._joints, states.q, states.v, self._accelerations(states), zero_position(self._basis.mechanism))
        return self._answer(model, asked).reshape(len(states), len(self.blocks), -1)

    def _accelerations(self, states: States) -> Array:
        """Those that applied forces would give each coordinate alone, about."""
        largest = np.array([max(map(abs, bounds)) for bounds in self._basis.mechanism.force_ranges])
        return np.where(largest > 0, LARGEST_ACCELERATION * states.tau / np.where(largest > 0, largest, 1.0), 0.0)

    def _hold_against_energies(self, states: States) -> None:
        mechanisms, in_body = (self._basis.mechanism, mechanism_of(self._robot)), self._basis.linear_velocity_in_body
        energies, file = (certify_terms(ReferenceKernel(one, in_body), states) for one in mechanisms)
        for name in (MASS, VELOCITY, GRAVITY):
            # By what either grants: where algebra leaves nothing of a term, the energies tell of no roundoff. Low parts do not matter.
            errors = [term_errors(name, one, other.high)[1] for one, other in ((energies, file), (file, energies))]
            worst = float(np.nanmax(np.fmin(*errors), initial=0.0))
            if worst > AGREEMENT:
                apart = f"{worst:.3g} data roundoffs from those of the energies, expected up to {AGREEMENT:g}"
                problem = f"the {name} terms of its numbers are {apart}; check accelerations first"
                raise InvalidModel(self._robot.path, None, problem)


# The files that were held against the energies, by mechanism and frame.
_HELD: Kept[None] = Kept(64)


def zero_position(mechanism: Mechanism) -> Array:
    """(1, nq), where every quaternion is 1."""
    found, first = np.zeros((1, mechanism.nq)), 0
    for positions, velocities in mechanism.joint_sizes.values():
        if positions > velocities:
            found[0, first + positions - 4] = 1.0
        first += positions
    return found


def hold_against_energies(declared: ModelFile, energies: ReferenceKernel, states: States, reference: Reference) -> None:
    """Refuse a file whose accelerations, ``reference``, with constraints held rigid, are not those of the energies at ``states``.

    Raises:
        InvalidModel: they are not.
    """
    comparison = compare(energies.evaluate(states), np.asarray(reference.high))
    if (comparison.verdicts == Verdict.DISAGREES.value).any():
        worst = f"{comparison.known('backward_error').max():.3g} data roundoffs from those of the energies"
        problem = f"the accelerations of its numbers are {worst}, expected up to {AGREEMENT:g}; check accelerations first"
        raise InvalidModel(declared.path, None, problem)
