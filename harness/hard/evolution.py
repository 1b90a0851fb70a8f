"""Hard states by an evolution strategy: CMA-ES on log10 of the backward error, whole populations at once.

Backward error is a smooth hill under the noise of roundings that fall one way or the other; CMA-ES ranks
its points only, so that noise costs it nothing but time.

Source: Hansen, The CMA evolution strategy: a tutorial, arXiv 1604.00772; Auger, Hansen, A restart CMA
evolution strategy with increasing population size, CEC 2005; the package ``cma``.
"""

from __future__ import annotations

import itertools
import math
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.crosscheck import hypothesis_search
from harness.crosscheck.assignment import Assignment, touches
from harness.crosscheck.hypothesis_search import note_of, objective
from harness.crosscheck.variation import quaternion_columns, row_ranges, rows_of, states_of, unit_quaternions
from harness.errors import require
from harness.explain.touching import EACH_SETTLED, settling
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.states import States
from harness.study import Note
from harness.truth.compare import Comparison
from harness.truth.sampling import HUGE_ANGLES, generic_sample
from harness.verdict import SEVERITY, Verdict

SMALLEST_POPULATION = 4
# Spread of the first population, where 1 is half of a range.
FIRST_SPREAD = 0.3
# A range is searched on all scales down to its half over 10^DECADES: what cancels does so near zero. Measured:
# on a plain scale the same budget finds a third of the backward error on a chain of ten links.
DECADES = 8
# How far a free angle goes on a plain scale [half turns].
PLAIN_HALF_TURNS = 2.0
# Hypothesis costs ten times as much per state as a population.
HYPOTHESIS_SHARE = 8
# Populations of the evolution strategies and the decades of their scales; each gets states in proportion, hence as many
# generations. The plain scale is for what is hard far from zero.
POPULATIONS = {20: 0, 40: DECADES, 80: DECADES}
# States to which steps lead that a strategy begins with, where contacts are on; each takes more steps than those before it.
MOST_TOUCHED = 64
_FAILURES = (Verdict.UNSTABLE.value, Verdict.DISAGREES.value, Verdict.ERROR.value)


def hunts(budget: int) -> list[tuple[int, int]]:
    """(states, population) of each hunt; population 0 is hypothesis. A budget that is small has fewer hunts."""
    by_hypothesis = max(1, budget // HYPOTHESIS_SHARE)
    rest = budget - by_hypothesis
    shares = [(rest * population // sum(POPULATIONS), population) for population in POPULATIONS]
    return [(by_hypothesis, 0), *((states, population) for states, population in shares if states >= SMALLEST_POPULATION)]


@dataclass(frozen=True)
class Hunt:
    """The outcome of one search.

    Attributes:
        worst: the one state it did worst at.
        backward_error: there [units of data roundoff]; NaN where the answer is not finite or nothing is certified.
        states: how many it tried; undecided: how many of them have no certified truth.
    """

    worst: States
    backward_error: float
    states: int
    undecided: int

    @classmethod
    def of(cls, states: States, comparison: Comparison) -> Hunt:
        """The outcome of a search that tried ``states``."""
        index, undecided = worst_index(comparison), int((comparison.verdicts == Verdict.UNDECIDED.value).sum())
        return cls(states[index : index + 1], float(comparison.backward_error[index]), len(states), undecided)


def evolve(assignment: Assignment, states: int, population: int, seed: int, note: Note = lambda text: None, decades: int = DECADES) -> Hunt:
    """Maximise the backward error over at most ``states`` states, from a random start; ``decades`` as in ``StateSpace``.

    A strategy that has converged starts again elsewhere, with twice the population.
    """
    truth, mechanism, random = assignment.truth, assignment.mechanism, np.random.default_rng([seed, population])
    population = max(SMALLEST_POPULATION, min(population, states))
    tried: list[tuple[States, Comparison]] = []
    left = max(states, population)
    centres: Iterator[Array | None] = itertools.repeat(None)
    if touches(assignment):
        tried.append(touched(assignment, max(1, min(MOST_TOUCHED, left // EACH_SETTLED)), seed + population, note))
        first, comparison = tried[0]
        left, centres = max(left - len(first), population), itertools.cycle(rows_of(first)[np.argsort(-objective(comparison))])
    while left >= population:
        centre = next(centres)
        # Depths of contacts differ by decades.
        space = StateSpace(mechanism, decades if centre is None else DECADES, centre)
        begun = random.uniform(-1.0, 1.0, len(space.bound)) if centre is None else space.encode(centre)
        strategy = _strategy(begun, space, population, random)
        while left >= population and not strategy.stop():
            points = strategy.ask()
            batch = space.decode(np.array(points))
            batch = truth.asked_at(batch) if centre is None else batch
            note(note_of(str(assignment.subject), batch))
            comparison = assignment.judge(batch)
            strategy.tell(points, (-objective(comparison)).tolist())
            left -= population
            tried.append((batch, comparison))
        population *= 2
    return Hunt.of(States.concatenate([batch for batch, _ in tried]), Comparison.concatenate([one for _, one in tried]))


def touched(assignment: Assignment, count: int, seed: int, note: Note = lambda text: None) -> tuple[States, Comparison]:
    """So many states to which the engine's own steps lead, under random forces, and the judgement of its answers there.

    Half of the steps begin at rest: what is thrown away touches nothing.
    """
    states = generic_sample(assignment.mechanism, EACH_SETTLED * count, seed)
    begins_at_rest = np.arange(len(states))[:, None] // EACH_SETTLED % 2 == 0
    states = replace(states, v=np.where(begins_at_rest, 0.0, states.v))
    note(note_of(str(assignment.subject), states))
    found = assignment.truth.asked_at(states)[settling(len(states))]
    note(note_of(str(assignment.subject), found))
    return found, assignment.judge(found)


def hunt(assignment: Assignment, states: int, population: int, seed: int, note: Note = lambda text: None) -> Hunt:
    """One hunt of ``hunts``; of population 0 by hypothesis, whose draws hold the special values."""
    if population:
        return evolve(assignment, states, population, seed, note, POPULATIONS[population])
    found = hypothesis_search.explore(assignment, states, seed, note)
    return Hunt.of(found.states, found.comparison)


def worst_index(comparison: Comparison) -> int:
    """Index of the answer that shows most: the gravest verdict that is the engine's, then the largest backward error."""
    severity = np.array([SEVERITY[verdict] if verdict in _FAILURES else 0 for verdict in comparison.verdicts.tolist()], dtype=np.float64)
    return int(np.lexsort((objective(comparison), severity))[-1])


def _strategy(begun: Array, space: StateSpace, population: int, random: np.random.Generator) -> Any:
    """A strategy that begins at a point, (m,)."""
    require("a search follows evolution strategies", "cma")
    with warnings.catch_warnings():
        # It says that it cannot plot, and that it does not know the name of its own signals file.
        warnings.simplefilter("ignore")
        import cma

        options = {
            "popsize": population,
            "bounds": [(-space.bound).tolist(), space.bound.tolist()],
            # NaN leaves numpy's global generator alone; ``randn`` is what the strategy draws from.
            "seed": math.nan,
            "randn": lambda *shape: random.standard_normal(shape),
            # Below -9 it reads no options from a file in the current folder.
            "verbose": -10,
            "verb_log": 0,
        }
        return cma.CMAEvolutionStrategy(begun, FIRST_SPREAD, options)


class StateSpace:
    """Points of a box for the states of a mechanism, on a scale that is linear near zero and logarithmic away from it.

    The logarithmic part is ``decades`` long; for 0 the scale is plain.

    Attributes:
        bound: (m,) the box is [-bound, bound]; m is nq + 2 nv. At 1 a range ends; a free angle has made a half turn
            there and goes on, to the largest of ``HUGE_ANGLES`` where there are decades.


    A range that does not hold zero has its own middle in place of it. A quaternion has four columns, of any length. Positions of a row,
    ``around``, are the middle in place of both, and as far around them as ranges are wide is searched.
    """

    def __init__(self, mechanism: Mechanism, decades: int = DECADES, around: Array | None = None) -> None:
        self._mechanism = mechanism
        ranges = row_ranges(mechanism)
        huge = max(HUGE_ANGLES)
        self._low, self._high = np.array([bounds or (-huge, huge) for bounds in ranges]).T
        reach = np.array([math.pi if bounds is None else max(abs(bounds[0]), abs(bounds[1])) for bounds in ranges])
        holds_zero = (self._low <= 0) & (self._high >= 0)
        self._centre = np.where(holds_zero, 0.0, (self._low + self._high) / 2)
        self._reach = np.where(holds_zero, reach, (self._high - self._low) / 2)
        self._steepness = math.log(2 * 10**decades) if decades else 0.0
        free = np.array([bounds is None for bounds in ranges])
        furthest = 1.0 + math.log(huge / math.pi) / self._steepness if decades else PLAIN_HALF_TURNS
        self.bound = np.where(free, furthest, 1.0)
        if around is not None:
            own = slice(0, mechanism.nq)
            self._centre[own], self.bound[own] = around[own], 1.0
            self._low[own], self._high[own] = around[own] - self._reach[own], around[own] + self._reach[own]

    def encode(self, row: Array) -> Array:
        """The point of a row, (m,), in the box."""
        scaled = (row - self._centre) / np.where(self._reach > 0, self._reach, 1.0)
        points = np.arcsinh(scaled * math.sinh(self._steepness)) / self._steepness if self._steepness else scaled
        return np.clip(points, -self.bound, self.bound)

    def decode(self, points: Array) -> States:
        """The states at ``points``, (n, m)."""
        scaled = np.sinh(self._steepness * points) / math.sinh(self._steepness) if self._steepness else points
        values = np.clip(self._centre + self._reach * scaled, self._low, self._high)
        for columns in quaternion_columns(self._mechanism):
            values[:, columns] = unit_quaternions(values[:, columns])
        return states_of(self._mechanism, values)
