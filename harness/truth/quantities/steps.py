"""The state after one step of each integrator that an engine documents, velocities and positions each a block.

The truth is the rule that the engine declares for the file it reads, on the equations of motion that the numbers of the declared file
have: one program of q, v, tau, those numbers and the step length. Its data roundoff is what one unit roundoff of each of them does.

Lengths are kinetic-energy norms with M at the start: of differences of velocities, and of the tangent vectors of differences of
positions, which for a rotation is twice the vector part of the difference as a quaternion in the body's frame. How far a quaternion is
off length 1 counts for nothing, as no reader of one feels it.

A wrong step is explained by the mistake that undone makes it right: by another rule, which the answers then follow, or by a convention
undone, after which they follow their own.

Source: that of ``harness.files.rules``.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from harness.arrays import Array
from harness.engines import Call, Calls, Model, NotOffered
from harness.engines.coordinates import multiplied
from harness.files.rules import ImplicitPart, StepRule
from harness.programs.evaluation import values
from harness.programs.mechanisms.mechanism import Mechanism, smooth
from harness.programs.numbers import UNIT_ROUNDOFF
from harness.programs.states import States
from harness.trees.bodies.spatial import FileProgram
from harness.trees.mechanism import mechanism_of
from harness.trees.recursion import step_forces
from harness.trees.robot import Robot
from harness.trees.steps import LARGEST_TURN, positions, steps_program, velocities
from harness.truth.blocks import QuantityKernel, inputs_of
from harness.truth.compare import Certified, Flags, farthest_block
from harness.truth.quantities import ASKED_ELSEWHERE, Quantity, Truth, TruthBasis
from harness.truth.quantities.of_files import hold_against_energies
from harness.truth.reference import Reference, ReferenceKernel
from harness.verdict import AGREEMENT

if TYPE_CHECKING:
    from harness.truth.limited_steps import LimitedSteps


class StepTruth(Truth):
    """The certified steps of one mechanism by the rules of one engine."""

    def __init__(self, basis: TruthBasis) -> None:
        mechanism, declared = basis.mechanism, basis.declared
        if declared is None:
            raise NotOffered("motions of a robot's file are compared by harness compare --steps")
        if not basis.step_rules:
            raise NotOffered("the engine documents no integrator")
        if mechanism.constraints is not None:
            raise NotOffered("steps under constraints have no declared map here")
        if basis.linear_velocity_in_body and mechanism.charts_in_body:
            raise NotOffered("the linear velocity of a free joint is in the body's frame, in which no rule is written")
        self.basis, self.rules, self._declared = basis, basis.step_rules, declared
        robot = basis.robot_of(declared)
        self._forces = step_forces(robot.tree, robot.joints)
        self._steps = steps_program(self._forces, mechanism.attitudes, self.rules)
        self._limited, program = _limited(mechanism, robot, self.rules), self._steps.program
        if self._limited is not None:
            program = self._limited.program
        self._energies, self._reference = ReferenceKernel(smooth(mechanism)), ReferenceKernel(mechanism_of(robot))
        self.blocks = [name(rule) for rule in self.rules for name in (velocities, positions)]
        nv, nq = mechanism.nv, mechanism.nq
        # A block holds velocities and then positions, of which it has either, and zeros in place of the other.
        nothing, blocks = len(self.rules) * (nq + nv), list[list[int]]()
        for number in range(len(self.rules)):
            first = number * (nq + nv)
            blocks += [[*range(first + nq, first + nq + nv), *[nothing] * nq], [*[nothing] * nv, *range(first, first + nq)]]
        self._program, self._kernel = program, QuantityKernel(program, blocks)

    @property
    def key(self) -> Hashable:
        """See ``Truth``."""
        return self._declared.text, self._program.key, self.rules

    def asked_at(self, states: States, share: float = ASKED_ELSEWHERE) -> States:
        """See ``Truth``; a share is where limits are felt, if steps have them on."""
        return states if self._limited is None or not share else self._limited.pressed(states, share)

    def evaluate(self, states: States) -> Certified:
        """The states after each step, (n, 2 rules, nv + nq): velocities and then zeros, zeros and then positions.

        Raises:
            InvalidModel: the accelerations of the declared file are not those of the energies.
        """
        reference = self._reference.evaluate(states)
        hold_against_energies(self._declared, self._energies, states, reference)
        inputs = _inputs(self._steps, self.rules, states) if self._limited is None else self._limited.inputs(states)
        after = values(self._program, np.ascontiguousarray(inputs.T))
        # All rules lead to nearly the same positions.
        tangents = self._tangents(after[positions(self.rules[0])].T)
        norm_factor = np.concatenate([reference.norm_factor, reference.norm_factor @ tangents], axis=2)
        certified = self._kernel.evaluate(inputs, norm_factor=norm_factor)
        known = certified.certified & reference.certified & self._turn_little(states, after)
        return replace(certified, share=self._share_of_the_motion(states, reference), certified=known)

    def asks(self, model: Model, states: States) -> Calls:
        """See ``Truth``."""
        n, nv, nq = len(states), states.v.shape[1], states.q.shape[1]

        def formed(answers: Sequence[Array]) -> Array:
            found = np.zeros((n, 2 * len(self.rules), nv + nq))
            for number, after in enumerate(answers):
                found[:, 2 * number + 1, nv:], found[:, 2 * number, :nv] = after[:, :nq], after[:, nq:]
            return found

        given = ((states.q, states.v, states.tau, rule.length, rule.name) for rule in self.rules)
        return Calls(tuple(Call("step", arguments, (n, nq + nv)) for arguments in given), formed)

    def describe(self, certified: Certified, states: States, answers: Array, model: Model) -> str:
        """The block that is farthest off, and the mistake that explains both blocks of its rule, where one does."""
        block = farthest_block(certified, answers)
        number = block // 2
        rule, own = self.rules[number], slice(2 * number, 2 * number + 2)
        found = answers[:, own]
        allowed = AGREEMENT * certified.roundoff_with_share[:, own]

        def explains(expected: Array, found: Array) -> bool:
            lengths = np.linalg.norm((found - expected) @ certified.norm_factor.transpose(0, 2, 1), axis=2)
            return bool((lengths <= allowed)[certified.certified].all())

        sentence = f"Farthest off are the {self.blocks[block]}"
        if (finish := getattr(model, "to_the_end", None)) is not None:
            # By a tolerance of 0 a solver may go on until it divides zero by zero.
            ended, setting = finish(UNIT_ROUNDOFF)
            if explains(certified.high[:, own], self.answers(ended, states)[:, own]):
                return f"{sentence}; the engine stops its solver early: with {setting} it ends where its rule does"
        of_others = ((one.name, certified.high[:, 2 * other : 2 * other + 2]) for other, one in enumerate(self.rules) if other != number)
        if names := [name for name, expected in of_others if explains(expected, found)]:
            return f"{sentence}; the step is that by {' and '.join(names)}"
        for mistake, changed in _other_rules(rule):
            if explains(self.by(changed, states), found):
                return f"{sentence}; {mistake}"
        for mistake, undo in CONVENTIONS.items():
            if explains(certified.high[:, own], self._with_rotations(states, found, undo)):
                return f"{sentence}; {mistake}"
        return sentence

    def by(self, rule: StepRule, states: States) -> Array:
        """The state after a step by another rule, in float64, (n, 2, nv + nq), as of ``evaluate``."""
        steps = steps_program(self._forces, self.basis.mechanism.attitudes, (rule,))
        after = values(steps.program, np.ascontiguousarray(_inputs(steps, (rule,), states).T))
        nv, found = states.v.shape[1], np.zeros((len(states), 2, states.v.shape[1] + states.q.shape[1]))
        found[:, 0, :nv], found[:, 1, nv:] = after[velocities(rule)].T, after[positions(rule)].T
        return found

    def _with_rotations(self, states: States, answers: Array, undo: Undone) -> Array:
        """Answers, (n, 2, nv + nq), with each of their quaternions undone."""
        mechanism, found = self.basis.mechanism, answers.copy()
        for number, place in enumerate(mechanism.attitudes):
            first = place + number
            before = states.q[:, first : first + 4]
            found[:, 1, mechanism.nv + first : mechanism.nv + first + 4] = undo(answers[:, 1, mechanism.nv + first :][:, :4], before)
        return found

    def _tangents(self, q: Array) -> Array:
        """(n, nv, nq), from differences of positions at q, (n, nq), to the velocities that make them in a second."""
        mechanism = self.basis.mechanism
        found = np.zeros((len(q), mechanism.nv, mechanism.nq))
        turning = {first: first + number for number, first in enumerate(mechanism.attitudes)}
        rows, columns = set(range(mechanism.nv)), set(range(mechanism.nq))
        for row, column in turning.items():
            rows, columns = rows - {*range(row, row + 3)}, columns - {*range(column, column + 4)}
            w, x, y, z = q[:, column : column + 4].T
            tangents = [[-x, w, z, -y], [-y, -z, w, x], [-z, y, -x, w]]
            found[:, row : row + 3, column : column + 4] = 2.0 * np.array(tangents).transpose(2, 0, 1)
        found[:, sorted(rows), sorted(columns)] = 1.0
        return found

    def _turn_little(self, states: States, after: Mapping[str, Array]) -> Flags:
        """(n,), whether no rotation turns by more than ``LARGEST_TURN`` in a step, before it and after."""
        turns = [np.zeros(len(states))]
        for rule in self.rules:
            for rates in (states.v, after[velocities(rule)].T):
                turns += [rule.length * np.linalg.norm(rates[:, place : place + 3], axis=1) for place in self.basis.mechanism.attitudes]
        return np.asarray(np.max(turns, axis=0) <= LARGEST_TURN)

    def _share_of_the_motion(self, states: States, reference: Reference) -> Array:
        """(n, 2 rules), what twice the kinetic energy as a torque on each rotating coordinate does in a step."""
        rotating = np.array(self.basis.mechanism.rotating)
        # |M^-1 e|_M of a unit torque e is the length of a row of the inverse of the factor.
        of_torques = np.linalg.norm(reference.inverse_factor(), axis=2)[:, rotating].sum(axis=1)
        share = reference.twice_the_energy(states.v) * of_torques
        lengths = np.array([power for rule in self.rules for power in (rule.length, rule.length**2)])
        return np.asarray(share[:, None] * lengths)


def _limited(mechanism: Mechanism, robot: Robot, rules: Sequence[StepRule]) -> LimitedSteps | None:
    """Steps with the limits of a mechanism, where an engine has them on; None elsewhere."""
    names = [] if mechanism.bounded is None else [name for name in mechanism.bounded.names if name not in dict(mechanism.dry_friction)]
    if not names or rules[0].limited is None:
        return None
    # Most mechanisms have no limits.
    from harness.truth.limited_steps import LimitedSteps

    return LimitedSteps(robot, names, mechanism.attitudes, rules[0])


def _inputs(steps: FileProgram, rules: Sequence[StepRule], states: States) -> Array:
    """Inputs of the program, (n, inputs)."""
    return inputs_of(states, states.tau, [*steps.numbers, *(rule.length for rule in rules)])


STEPS = Quantity("steps", StepTruth, has_step_rules=True)


# What was done to a quaternion (n, 4), with what undoes it, by the quaternion before the step.
Undone = Callable[[Array, Array], Array]


def _other_rules(rule: StepRule) -> Iterator[tuple[str, StepRule]]:
    """Rules that differ in one thing, each with the mistake that makes it."""
    if rule.stages:
        return
    yield "positions follow with the velocities before the step", replace(rule, with_old_velocities=not rule.with_old_velocities)
    for part in ImplicitPart:
        how = "explicitly, which are implicit" if part in rule.implicit else "implicitly, which are explicit"
        yield f"it takes {part} {how}", replace(rule, implicit=rule.implicit ^ {part})
    yield "dampers act across branches as the rule does not say", replace(rule, along_branches=not rule.along_branches)


def _about_own_axes(after: Array, before: Array) -> Array:
    """The turn that the world's axes were taken for, about the body's."""
    inverse = before * [1.0, -1.0, -1.0, -1.0] / (before**2).sum(axis=1, keepdims=True)
    return multiplied(before, multiplied(after, inverse))


CONVENTIONS: dict[str, Undone] = {
    "quaternions have their scalar last": lambda after, before: after[:, [3, 0, 1, 2]],
    "quaternions are those of the inverse rotations": lambda after, before: after * [1.0, -1.0, -1.0, -1.0],
    "rotations turn about the world's axes": _about_own_axes,
}
