"""States at which bodies touch: where an engine's own steps lead, and truth there with the contacts that it finds.

Points, frames, distances and numbers of contacts are inputs of the truth, so that law and solver are judged apart from geometry.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Hashable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from harness.arrays import Array, Indices
from harness.engines.request import EngineAnswers
from harness.files.contacts import FoundContact, contacts_of, measured_in, structure_of
from harness.files.equalities import Constraint
from harness.files.given import Place
from harness.files.touching import ConeKind, Touch
from harness.files.tree import WORLD, Tree
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.states import LARGEST_STATE, States
from harness.trees.bodies.spatial import parameter_name
from harness.trees.robot import Robot
from harness.truth.compare import Comparison, Flags, in_order
from harness.truth.reference import Reference, ReferenceKernel

# Of the states one of so many is where the engine's own steps lead, so many steps further for each.
EACH_SETTLED, STEPS_APART = 4, 25
# Work on all states that are judged at which bodies touch, of which each costs velocities squared times contacts and a few besides, and
# as much again where no other state has the program; so many states at least.
MOST_WORK, _BESIDES, _LEAST_TOUCHING = 100_000, 4, 4


def settling(count: int) -> Indices:
    """The numbers of the states that steps lead to, among so many."""
    return np.arange(EACH_SETTLED - 1, count, EACH_SETTLED)


def steps_of(count: int) -> tuple[int, ...]:
    """Steps that lead to each of so many states, from where the file puts all bodies."""
    return tuple(STEPS_APART * (number + 1) for number in range(count))


@dataclass(frozen=True)
class Touching:
    """The contacts that push at each of n states, as constraints; ``states`` are the numbers of those that are judged.

    Attributes:
        refused: why contacts of states are not judged, each once.
    """

    contacts: Sequence[Sequence[Constraint]]
    states: Indices
    refused: tuple[str, ...] = ()

    @classmethod
    def nowhere(cls, count: int) -> Touching:
        """No contact at any of so many states."""
        return cls([()] * count, np.arange(count))

    @classmethod
    def of(cls, found: Sequence[Sequence[FoundContact]], robot: Robot, cone: ConeKind, affordable: bool = True) -> Touching:
        """Those that an engine found on a robot with cones of this kind; with ``affordable`` as many states as work suffices for."""
        place, velocities = robot.tree.place, max(1, robot.degrees_of_freedom)
        assert place is not None
        contacts = [_constraints(own, robot.tree, place, cone) for own in found]
        why = [next((one.why_not for one in own if one.why_not), "") for own in contacts]
        usable = [number for number, own in enumerate(contacts) if own and not why[number]]
        touching = _affordable(contacts, usable, velocities) if affordable else usable
        states = [number for number, own in enumerate(contacts) if not own or number in touching]
        return cls(contacts, np.array(states, dtype=np.int64), tuple(dict.fromkeys(filter(None, why))))

    def of_states(self, answers: EngineAnswers) -> EngineAnswers:
        """Answers at the states that are judged."""
        return replace(answers, accelerations={name: own[self.states] for name, own in answers.accelerations.items()})

    @property
    def chosen(self) -> Touching:
        """The same of the states that are judged alone."""
        return self.among(self.states)

    @property
    def is_any(self) -> Flags:
        """(n,) whether bodies touch."""
        return np.array([bool(own) for own in self.contacts], dtype=np.bool_)

    @property
    def various(self) -> list[Sequence[Constraint]]:
        """The contacts of a state for each choice of bodies that touch at some state; no contact where nothing touches."""
        by_bodies = {frozenset(one.says.bodies for one in own if isinstance(one.says, Touch)): own for own in self.contacts}
        return list(by_bodies.values())

    def truth(
        self,
        states: States,
        documented: Callable[[Sequence[Constraint]], Mechanism],
        kernel: Callable[[Mechanism], ReferenceKernel] = ReferenceKernel,
        near: Array | None = None,
    ) -> Reference:
        """The truth at all states, by the mechanism that is ``documented`` with contacts of each structure, and its kernel.

        Where several accelerations are right, it is the one that is nearest to ``near``, (n, nv).
        """
        parts = list[tuple[Reference, Indices]]()
        for mechanism, values, numbers in self.by_structure(documented):
            if near is not None:
                # Of most engines one acceleration is right.
                from harness.truth.complementarity import begun_at

                values = begun_at(mechanism, states[numbers], values, near[numbers])
            parts.append((kernel(mechanism).evaluate(states[numbers], values=values), numbers))
        return in_order(parts)

    def among(self, numbers: Indices) -> Touching:
        """The same of some states alone."""
        return Touching([self.contacts[number] for number in numbers.tolist()], np.arange(len(numbers)))

    def by_structure(self, documented: Callable[[Sequence[Constraint]], Mechanism]) -> Iterator[tuple[Mechanism, Array, Indices]]:
        """The mechanism that is ``documented`` with contacts of each structure, its parameters at each state, and the numbers of these."""
        groups: dict[Hashable, list[int]] = {}
        for number, own in enumerate(self.contacts):
            groups.setdefault(structure_of(own), []).append(number)
        yield from (self._alike(numbers, documented) for numbers in groups.values())

    def _alike(self, numbers: Sequence[int], documented: Callable[[Sequence[Constraint]], Mechanism]) -> tuple[Mechanism, Array, Indices]:
        mechanism = documented(self.contacts[numbers[0]])
        columns = {name: column for column, (name, _, _) in enumerate(mechanism.parameters)}
        values = np.tile(mechanism.parameter_values, (len(numbers), 1))
        # They are the same numbers in all of these; one that no row takes is no parameter.
        places = [columns.get(parameter_name(one), -1) for one in measured_in(self.contacts[numbers[0]])]
        taken = [place >= 0 for place in places]
        own = [[part for one in self.contacts[number] if isinstance(one.says, Touch) for part in one.says.numbers] for number in numbers]
        values[:, list(itertools.compress(places, taken))] = np.array(own)[:, taken]
        return mechanism, values, np.array(numbers)


def _affordable(contacts: Sequence[Sequence[Constraint]], usable: Sequence[int], velocities: int) -> list[int]:
    """The numbers of states at which bodies touch whose truth is worth its work, which ``velocities`` make.

    The most contacts that a quarter of the work suffices for come first; then, by rising numbers of contacts, states where bodies have
    come to touch and those where they overlap anyhow, in turns.
    """

    def work(number: int) -> int:
        return velocities**2 * (len(contacts[number]) + _BESIDES)

    rising, settled = sorted(usable, key=work), settling(len(contacts))
    halves = [number for number in rising if number in settled], [number for number in rising if number not in settled]
    turns = [number for pair in itertools.zip_longest(*halves) for number in pair if number is not None]
    dense = [number for number in rising if 2 * work(number) <= MOST_WORK // 4][-1:]
    left, found, structures = MOST_WORK, list[int](), set[Hashable]()
    for number in dict.fromkeys([*dense, *turns]):
        structure = structure_of(contacts[number])
        own = work(number) * (1 if structure in structures else 2)
        if own <= left or len(found) < _LEAST_TOUCHING:
            left -= own
            found.append(number)
            structures.add(structure)
    return found


def _constraints(found: Sequence[FoundContact], tree: Tree, place: Place, cone: ConeKind) -> list[Constraint]:
    """Contacts that push, and say where they are not judged why."""
    known = {body.name for body in tree.bodies} | {WORLD}

    def read(one: FoundContact) -> FoundContact:
        missing = [name for name in one.bodies if name not in known]
        return replace(one, why_not=f"is of {missing[0]}, which the file does not have") if missing and not one.why_not else one

    return contacts_of([read(one) for one in found], place, cone)


def judged_again(found: Comparison, left: Indices, again: Callable[[Indices], Comparison]) -> Comparison:
    """A judgement of answers of which those ``left`` have another one, which ``again`` says."""
    others = np.setdiff1d(np.arange(len(found.verdicts)), left)
    return in_order([(found[others], others), (again(left), left)]) if len(left) else found


def put(states: States, numbers: Indices, q: Array, v: Array) -> States:
    """The states with other positions and velocities at ``numbers``, but for those at which a motion has broken down."""
    # What is not finite is not less.
    sound = (np.abs(np.hstack([q, v])) < LARGEST_STATE).all(axis=1)
    all_q, all_v = states.q.copy(), states.v.copy()
    all_q[numbers[sound]], all_v[numbers[sound]] = q[sound], v[sound]
    return replace(states, q=all_q, v=all_v)
