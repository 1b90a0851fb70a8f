"""Hard states by an evolution strategy: CMA-ES on log10 of the backward error, whole populations at once.

Backward error is a smooth hill under the noise of roundings that fall one way or the other; CMA-ES ranks
its points only, so that noise costs it nothing but time.

Source: Hansen, The CMA evolution strategy: a tutorial, arXiv 1604.00772; Auger, Hansen, A restart CMA
evolution strategy with increasing population size, CEC 2005; the package ``cma``.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.crosscheck import hypothesis_search
from harness.crosscheck.assignment import Assignment
from harness.crosscheck.hypothesis_search import note_of, objective
from harness.crosscheck.variation import quaternion_columns, row_ranges, states_of, unit_quaternions
from harness.errors import require
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.states import States
from harness.study import Note
from harness.truth.compare import Comparison
from harness.truth.sampling import HUGE_ANGLES
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
    truth, space = assignment.truth, StateSpace(assignment.mechanism, decades)
    random = np.random.default_rng([seed, population])
    population = max(SMALLEST_POPULATION, min(population, states))
    tried: list[tuple[States, Comparison]] = []
    left = max(states, population)
    while left >= population:
        strategy = _strategy(space, population, random)
        while left >= population and not strategy.stop():
            points = strategy.ask()
            batch = truth.asked_at(space.decode(np.array(points)))
            note(note_of(str(assignment.subject), batch))
            comparison = assignment.judge(batch)
            strategy.tell(points, (-objective(comparison)).tolist())
            left -= population
            tried.append((batch, comparison))
        population *= 2
    return Hunt.of(States.concatenate([batch for batch, _ in tried]), Comparison.concatenate([one for _, one in tried]))


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


def _strategy(space: StateSpace, population: int, random: np.random.Generator) -> Any:
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
        return cma.CMAEvolutionStrategy(random.uniform(-1.0, 1.0, len(space.bound)), FIRST_SPREAD, options)


class StateSpace:
    """Points of a box for the states of a mechanism, on a scale that is linear near zero and logarithmic away from it.

    The logarithmic part is ``decades`` long; for 0 the scale is plain.

    Attributes:
        bound: (m,) the box is [-bound, bound]; m is nq + 2 nv. At 1 a range ends; a free angle has made a half turn
            there and goes on, to the largest of ``HUGE_ANGLES`` where there are decades.

    A range that does not hold zero has its own middle in place of it. A quaternion has four columns, of any length.
    """

    def __init__(self, mechanism: Mechanism, decades: int = DECADES) -> None:
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

    def decode(self, points: Array) -> States:
        """The states at ``points``, (n, m)."""
        scaled = np.sinh(self._steepness * points) / math.sinh(self._steepness) if self._steepness else points
        values = np.clip(self._centre + self._reach * scaled, self._low, self._high)
        for columns in quaternion_columns(self._mechanism):
            values[:, columns] = unit_quaternions(values[:, columns])
        return states_of(self._mechanism, values)
