"""Quantities that the numbers of a model file give at positions, velocities and accelerations, of trees and of loops.

They are the mass matrix and generalised forces, which controllers take from an engine, the joint torque regressor, energies, momenta,
and where the bodies are and how they move.

The file is held against the energies of its mechanism first: its mass matrix, velocity terms and gravity have to be theirs, at a few
states. A robot has no energies; its file is all there is.

The mass matrix, bias and gravity of a loop are those of the tree that is left without its constraints. Its inverse dynamics are
not one vector: any force that the constraints bear may be added to the applied ones.

The regressor is the derivatives of inverse dynamics by ten inertial parameters of each body. It holds no inertia: geometry, positions and
motion are all that it takes. The parameters are those of the file that the engine reads, about its own anchors and along its own axes, so
that each reader is asked about the numbers of its file.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from harness.arrays import Array
from harness.engines import Call, Calls, Model, NotOffered
from harness.errors import InvalidModel
from harness.files.model_file import ModelFile
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.states import States
from harness.storage import Kept
from harness.trees.mechanism import mechanism_of
from harness.trees.quantities import forces, motion
from harness.trees.quantities.motion import Block, TreeMotion, computed, tree_motion
from harness.truth.blocks import Between, QuantityKernel, inputs_of
from harness.truth.compare import Certified, compare
from harness.truth.quantities import Quantity, Truth, TruthBasis
from harness.truth.reference import Reference, ReferenceKernel, rounded
from harness.truth.terms import GRAVITY as GRAVITY_TERMS
from harness.truth.terms import MASS, certify_terms, term_errors
from harness.truth.terms import VELOCITY as VELOCITY_TERMS
from harness.verdict import AGREEMENT, Verdict

# States at which a file is held against the energies.
HELD_AT = 4
# What a joint's applied force at the end of its range gives its coordinate alone [1/s^2]; see ``harness.truth.sampling``.
LARGEST_ACCELERATION = 100.0


@dataclass(frozen=True)
class AskedMotion:
    """Arguments for an engine at n states: q (n, nq), v and qdd (n, nv), of these ``joints``; ``zero``, (1, nq), is the position zero."""

    joints: tuple[str, ...]
    q: Array
    v: Array
    qdd: Array
    zero: Array


# What a model is asked there, whose answers are formed into (n, components of all blocks) in the order of the blocks.
Question = Callable[[Model, AskedMotion], Calls]


class TruthOfMotion(Truth):
    """The certified values of what ``blocks_of`` writes of the motion of a tree, whose inputs ``between`` are values between."""

    def __init__(
        self, basis: TruthBasis, of_tree: TreeMotion, blocks_of: Callable[[TreeMotion], Iterable[Block]], between: slice = slice(0)
    ) -> None:
        self._basis, self._between, self._written = basis, between, computed(of_tree, blocks_of)
        self.blocks: Sequence[str] = self._written.blocks
        places = np.arange(len(self.blocks) * self._written.width).reshape(-1, self._written.width)
        self._kernel = QuantityKernel(self._written.program, places.tolist(), between, self._written.sizes)

    @property
    def key(self) -> Hashable:
        """See ``Truth``; the program has the numbers of a second file where that has other points."""
        numbers = tuple(self._written.numbers)
        return self._basis.mechanism.key, self._text, self._written.program.key, numbers, self._basis.linear_velocity_in_body

    @property
    def _text(self) -> str:
        return "" if self._basis.declared is None else self._basis.declared.text

    def _evaluated(self, states: States, third: Array, between: Between | None = None) -> Certified:
        return self._kernel.evaluate(inputs_of(states, third, self._written.numbers), between)


class FileTruth(TruthOfMotion):
    """The certified values of a quantity of one mechanism, by the numbers of one file; ``question`` is what a model is asked for it."""

    def __init__(self, basis: TruthBasis, blocks_of: Callable[[TreeMotion], Iterable[Block]], question: Question) -> None:
        self._question, self._robot = question, basis.robot_of(basis.declared)
        read = basis.robot_of(basis.read)
        of_tree = tree_motion(self._robot.tree, basis.joints, basis.linear_velocity_in_body, read.tree, basis.has_other_points)
        super().__init__(basis, of_tree, blocks_of)

    def evaluate(self, states: States) -> Certified:
        """Raises InvalidModel where the numbers of the file are not those of the energies."""
        mechanism, in_body = self._basis.mechanism, self._basis.linear_velocity_in_body
        if self._basis.declared is not None:
            _HELD.get((mechanism.key, self._text, in_body), lambda: self._hold_against_energies(states[:HELD_AT]))
        return self._evaluated(states, self._accelerations(states))

    def asks(self, model: Model, states: States) -> Calls:
        """See ``Truth``."""
        motion = AskedMotion(self._basis.joints, states.q, states.v, self._accelerations(states), _zero_position(self._basis.mechanism))
        own = self._question(model, motion)
        return Calls(own.each, lambda answers: own.formed(answers).reshape(len(states), len(self.blocks), -1))

    def _accelerations(self, states: States) -> Array:
        """Those that applied forces would give each coordinate alone, about."""
        largest = np.array([max(map(abs, bounds)) for bounds in self._basis.mechanism.force_ranges])
        found = np.where(largest > 0, LARGEST_ACCELERATION * states.tau / np.where(largest > 0, largest, 1.0), 0.0)
        return rounded(found, self._basis.unit_roundoff)

    def _hold_against_energies(self, states: States) -> None:
        mechanisms, in_body = (self._basis.mechanism, mechanism_of(self._robot)), self._basis.linear_velocity_in_body
        energies, file = (certify_terms(ReferenceKernel(one, in_body), states) for one in mechanisms)
        for name in (MASS, VELOCITY_TERMS, GRAVITY_TERMS):
            # By what either grants: where algebra leaves nothing of a term, the energies tell of no roundoff. Low parts do not matter.
            errors = [term_errors(name, one, other.high)[1] for one, other in ((energies, file), (file, energies))]
            worst = float(np.nanmax(np.fmin(*errors), initial=0.0))
            if worst > AGREEMENT:
                apart = f"{worst:.3g} data roundoffs from those of the energies, expected up to {AGREEMENT:g}"
                problem = f"the {name} terms of its numbers are {apart}; check accelerations first"
                raise InvalidModel(self._robot.path, None, problem)


# The files that were held against the energies, by mechanism and frame.
_HELD: Kept[None] = Kept(64)


def _zero_position(mechanism: Mechanism) -> Array:
    """(1, nq), where every quaternion is 1."""
    found = np.zeros((1, mechanism.nq))
    found[0, [first + number for number, first in enumerate(mechanism.attitudes)]] = 1.0
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


# What engines are asked.


def _call(method: str, takes: Sequence[str], *shape: int | str) -> Callable[[AskedMotion], Call]:
    """The call of a method that takes parts of the motion; sizes of its shape are numbers, or are named."""

    def call(motion: AskedMotion) -> Call:
        sizes = {"n": len(motion.q), "joints": len(motion.joints), "nv": motion.v.shape[1]}
        given = tuple(getattr(motion, name) for name in takes)
        return Call(method, given, tuple(size if isinstance(size, int) else sizes[size] for size in shape))

    return call


def _asks(method: str, takes: Sequence[str], *shape: int | str) -> Question:
    """The answer of such a method as it is."""
    call = _call(method, takes, *shape)
    return lambda model, motion: Calls((call(motion),))


def _or_term(method: str, term: str, *shape: int | str) -> Question:
    """The answer of a method that takes q, or the term of a model that gives terms alone."""
    call = _call(method, "q", *shape)

    def asks(model: Model, motion: AskedMotion) -> Calls:
        own = call(motion)
        if hasattr(model, method) or not hasattr(model, "terms"):
            return Calls((own,))
        still = np.zeros_like(motion.v)
        return Calls((Call("terms", (motion.q, still, still), own.shape, part=term),))

    return asks


_inverse_dynamics = _call("inverse_dynamics", ("q", "v", "qdd"), "n", "nv")
_jacobian = _call("jacobians", "q", "n", "joints", 6, "nv")
_in_regressor = _call("regressor", ("q", "v", "qdd"), "n", "nv", "joints", len(forces.PARAMETERS))


def _power(model: Model, motion: AskedMotion) -> Calls:
    """Power of the applied forces that the engine's inverse dynamics ask for, beside that of springs and dampers."""
    return Calls((_inverse_dynamics(motion),), lambda answers: np.asarray(np.einsum("nv,nv->n", motion.v, answers[0]))[:, None])


def _energies(model: Model, motion: AskedMotion) -> Calls:
    """The potential energy beyond that at zero."""

    def formed(answers: Sequence[Array]) -> Array:
        found, at_zero = answers
        return np.asarray(found - [0.0, at_zero[0, 1]])

    at_rest = motion.zero, np.zeros((1, motion.v.shape[1]))
    return Calls((Call("energies", (motion.q, motion.v), (len(motion.q), 2)), Call("energies", at_rest, (1, 2))), formed)


def _positions(model: Model, motion: AskedMotion) -> Calls:
    """Anchors, and the columns of how the bodies are turned from where they stand at zero."""
    count = len(motion.joints)

    def formed(answers: Sequence[Array]) -> Array:
        found, (at_zero,) = answers
        turned = np.einsum("njab,jcb->njca", found[:, :, 3:].reshape(-1, count, 3, 3), at_zero[:, 3:].reshape(-1, 3, 3))
        return np.concatenate([found[:, :, :3], turned.reshape(-1, count, 9)], axis=2)

    return Calls(tuple(Call("positions", (q,), (len(q), count, 12)) for q in (motion.q, motion.zero)), formed)


def _jacobians(model: Model, motion: AskedMotion) -> Calls:
    """By joint and velocity, linear before angular."""
    return Calls((_jacobian(motion),), lambda answers: np.ascontiguousarray(answers[0].transpose(0, 1, 3, 2)))


def _of_trees(basis: TruthBasis) -> None:
    if basis.mechanism.constraints is not None:
        raise NotOffered("the applied forces of a mechanism under constraints are not determined by its accelerations")


def _regressor(basis: TruthBasis) -> Truth:
    _of_trees(basis)
    carrying = forces.carrying_joints(basis.robot_of(basis.read).tree, basis.joints)

    def asks(model: Model, motion: AskedMotion) -> Calls:
        places = [motion.joints.index(name) for name in carrying]
        return Calls((_in_regressor(motion),), lambda answers: np.ascontiguousarray(answers[0][:, :, places].transpose(0, 2, 3, 1)))

    return FileTruth(replace(basis, declared=basis.read), forces.regressor, asks)


def _quantity(name: str, blocks_of: Callable[[TreeMotion], Iterable[Block]], question: Question, of_trees: bool = False) -> Quantity:
    def truth(basis: TruthBasis) -> Truth:
        if of_trees:
            _of_trees(basis)
        return FileTruth(basis, blocks_of, question)

    return Quantity(name, truth)


MASS_MATRIX = _quantity("mass_matrix", forces.mass_matrix, _or_term("mass_matrix", "mass", "n", "nv", "nv"))
BIAS = _quantity("bias", forces.bias, _asks("bias", ("q", "v"), "n", "nv"))
GRAVITY = _quantity("gravity", forces.gravity, _or_term("gravity", "gravity", "n", "nv"))
INVERSE_DYNAMICS = _quantity(
    "inverse_dynamics", forces.inverse_dynamics, lambda model, motion: Calls((_inverse_dynamics(motion),)), of_trees=True
)
POWER = _quantity("power", forces.power_of_forces, _power, of_trees=True)
ENERGY = _quantity("energy", motion.energy, _energies)
MOMENTUM = _quantity("momentum", motion.momentum, _asks("momenta", ("q", "v"), "n", 9))
POSITION = _quantity("position", motion.positions, _positions)
VELOCITY = _quantity("velocity", motion.velocities, _asks("velocities", ("q", "v"), "n", "joints", 6))
JACOBIAN = _quantity("jacobian", motion.jacobians, _jacobians)
# To write and to compile its programs takes seconds.
REGRESSOR = Quantity("regressor", _regressor, is_quick=False)
