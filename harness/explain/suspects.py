"""The numbers of a file's actuators, dry friction, limits and equalities, by which an engine's answers with these on are explained.

Most of them are no parameters of the truth: laws follow from several of them, and differ from state to state. The truth is certified anew
with each value of a number that is tried, and no change is taken for linear where a number is named.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from harness.arrays import Array
from harness.explain.clamps import MovedClamp
from harness.explain.columns import Whitening
from harness.explain.fit import AS_WELL, TIMES_AS_WELL, agreed, best_change, fit
from harness.files.equalities import BoundTendon
from harness.files.given import Given, Place, every_number_in, with_numbers
from harness.files.tree import Actuator, Joint
from harness.results.table import error_text
from harness.trees.bodies.spatial import parameter_name
from harness.trees.robot import Robot
from harness.truth.reference import Reference
from harness.verdict import AGREEMENT

# Of a number, by which its effect is measured; numbers that are fitted, and that are screened; and values that a fit may try.
DIFFERENCE, MOST_FITTED, MOST_SCREENED, MOST_EVALUATIONS = 1e-6, 6, 300, 16
# Share of an error that rounding of a slight change leaves.
_NEAR = 1e-2
# A step that moves less than so many data roundoffs is none, and values explain as well that leave so many times what the best leaves.
_STILL, _AS_GOOD = 0.25, 1.02
_DIGITS = range(1, 17)


@dataclass(frozen=True)
class Suspect:
    """One number of a file; ``robot`` gives what the file means with another value of it.

    Attributes:
        beside: all numbers of its attribute. is_of_rows: whether nothing but rows of constraints and their laws has it.
        is_parameter: whether no number of the equations follows from it but the parameter that it is.
    """

    number: Given
    robot: Callable[[float], Robot]
    beside: tuple[float, ...]
    is_of_rows: bool
    is_parameter: bool = False

    @property
    def name(self) -> str:
        return parameter_name(self.number)

    @property
    def place(self) -> Place:
        return self.number.place

    @property
    def attribute(self) -> str:
        return self.number.attribute

    @property
    def scale(self) -> float:
        """A natural size, above 0."""
        return abs(float(self.number)) or 1.0


def suspects_of(robot: Robot) -> list[Suspect]:
    """The numbers by which what is switched on acts, a default that no file gives at the place of its element."""
    found: dict[object, Suspect] = {}
    for part, is_of_rows, is_parameter in _suspected(robot):
        for values in _attributes_in(part):
            for number in every_number_in(values):
                of_all = is_of_rows, is_parameter
                if (other := found.get(number.key)) is not None:
                    of_all = is_of_rows and other.is_of_rows, is_parameter and other.is_parameter
                found[number.key] = Suspect(number, _changing(robot, number), tuple(map(float, values)), *of_all)
    return list(found.values())


def masses_of(robot: Robot) -> list[Suspect]:
    """The masses of the bodies, of which a reading may compute more."""
    masses = [body.inertia.mass for body in robot.tree.bodies if body.inertia is not None]
    return [Suspect(one, _changing(robot, one), (float(one),), False) for one in masses if isinstance(one, Given)]


def _suspected(robot: Robot) -> Iterator[tuple[object, bool, bool]]:
    """Parts of a robot whose numbers are suspects, whether rows alone have them, and whether they are but parameters."""
    bound: list[Joint | BoundTendon] = [*robot.tree.joints, *(tendon for tendon in robot.tree.tendons if not tendon.why_not)]
    for one in bound:
        if one.friction_loss:
            yield (one.friction_loss,), True, False
            yield one.friction_softness, True, False
        if one.limits is not None:
            yield one.limits, True, True
            yield (one.margin,), True, True
            yield one.limit_softness, True, False
        if isinstance(one, BoundTendon):
            yield one.tendon, False, False
    for actuator in robot.actuators:
        if not actuator.why_not:
            yield from ((part, False, is_parameter) for part, is_parameter in _of_actuator(actuator, robot))
    yield tuple(bounds for _, bounds in robot.force_limits), False, True
    for equality in robot.equalities:
        if equality.rows is not None and equality.is_active:
            yield equality.says, False, False
            yield equality.softness, True, False


def _of_actuator(actuator: Actuator, robot: Robot) -> Iterator[tuple[object, bool]]:
    single = bool(actuator.joints) and robot.joint(actuator.joints[0][0]).kind.is_single
    # Its damping follows from the others.
    own = not actuator.damping_ratio
    yield actuator.joints, False
    yield actuator.site, False
    yield actuator.gear[:1] if single else actuator.gear, own
    yield from (((number,), own) for _, number in (*actuator.gain, *actuator.bias))
    yield (actuator.damping_ratio,), False
    yield from ((bounds, True) for bounds in (actuator.control_range, actuator.activation_range, actuator.force_range))


def _attributes_in(part: object) -> Iterator[tuple[Given, ...]]:
    """The numbers of each attribute in a part."""
    own: list[Given] = []
    for number in every_number_in(part):
        if own and (number.attribute != own[-1].attribute or number.index <= own[-1].index):
            yield tuple(own)
            own = []
        own.append(number)
    if own:
        yield tuple(own)


def _changing(robot: Robot, number: Given) -> Callable[[float], Robot]:
    def changed(value: float) -> Robot:
        other = Given(value, number.place, number.attribute, number.index)

        def put(one: Given) -> Given:
            return other if one.key == number.key else one

        parts = {name: with_numbers(getattr(robot, name), put) for name in ("tree", "actuators", "force_limits", "equalities")}
        return replace(robot, **parts)

    return changed


@dataclass(frozen=True)
class Explained:
    """A suspect with a value at which the truth is what an engine answers; what that leaves, and the best value [data roundoffs]."""

    suspect: Suspect
    value: float
    left: float
    fitted: float

    @property
    def sentence(self) -> str:
        own, short = float(self.suspect.number), f"{self.value:.10g}"
        value = repr(self.value) if float(short) == own else short
        behaves = f"{self.suspect.name} = {own:g}: the engine behaves as with {value}"
        return f"{behaves}, which leaves {error_text(self.left)} data roundoffs"


@dataclass(frozen=True)
class ExplainedOrder:
    """A range that the engine lets hold another quantity, and what that leaves [data roundoffs]."""

    clamp: MovedClamp
    left: float

    @property
    def sentence(self) -> str:
        return f"{self.clamp.name}: the engine holds {self.clamp.held} in it, which leaves {error_text(self.left)} data roundoffs"


# High and low of accelerations, (n, nv) each; not a number where they are not certain.
Accelerations = tuple[Array, Array]


class SuspectSearch:
    """The suspects of a file beside its truth, ``documented``; ``truth_of`` gives the certified accelerations with another value of one.

    It is made once for all answers about a file, whose columns are the same.
    """

    def __init__(self, suspects: Sequence[Suspect], truth_of: Callable[[Suspect, float], Accelerations], documented: Reference) -> None:
        self.suspects = suspects[:MOST_SCREENED]
        self._truth_of, self._documented = truth_of, documented
        self._whitening, self._of_clamps = Whitening(documented), dict[tuple[Place, str, str], Array | None]()

    @cached_property
    def columns(self) -> list[Array]:
        """Effect on the truth of a change of 1 of each suspect, (n, nv) [data roundoffs]; 0 where it has none at a state."""
        return [_Moves(self, one).column(float(one.number)) for one in self.suspects]

    def explaining(self, answers: Array) -> list[Explained]:
        """The suspects that make answers (n, nv) agree, the likeliest first."""
        residual = self._residual(answers)
        linear = [(best_change(column, residual)[1], 0.0) for column in self.columns]
        # Each with the change at which its fit begins.
        likely = [min(one, agreed(-column, residual)) for one, column in zip(linear, self.columns, strict=True)]
        shares = [share for share, _ in likely]
        found: list[Explained] = []
        most = 1.0
        for at in sorted(range(len(shares)), key=shares.__getitem__)[:MOST_FITTED]:
            explained = self._fitted(at, residual, likely[at][1]) if shares[at] < most else None
            if explained is not None:
                found.append(explained)
                # Others that do as well are as near.
                most = min(most, TIMES_AS_WELL * max(shares[at], _NEAR))
        least = min((one.fitted for one in found), default=0.0)
        # Where several explain as well, people write numbers of few digits.
        return sorted(found, key=lambda one: (max(one.fitted, _AS_GOOD * least), len(repr(one.value))))

    def orders_explaining(self, answers: Array, clamps: Iterable[MovedClamp]) -> list[ExplainedOrder]:
        """Those of some ranges that hold another quantity, with which the truth is what answers (n, nv) say."""
        residual, found = self._residual(answers), list[ExplainedOrder]()
        for clamp in clamps:
            key = clamp.place, clamp.attribute, clamp.held
            if key not in self._of_clamps:
                own = Suspect(Given(0.0, clamp.place, clamp.attribute), partial(_as_it_is, clamp.robot), (), False)
                self._of_clamps[key] = self.moved(own, math.nan)
            moved = self._of_clamps[key]
            if moved is not None and (left := _worst(residual - moved)) <= AGREEMENT:
                found.append(ExplainedOrder(clamp, left))
        return sorted(found, key=lambda one: one.left)

    def _residual(self, answers: Array) -> Array:
        """The error of answers (n, nv) [data roundoffs]; 0 where that is not decided."""
        with np.errstate(invalid="ignore"):
            residual = self._whitening.residual(answers)
        residual[~(self._documented.certified & np.isfinite(residual).all(axis=1))] = 0.0
        return residual

    def moved(self, suspect: Suspect, value: float) -> Array | None:
        """Effect of a value on the truth, (n, nv) [data roundoffs], 0 where that is not decided; None where no law has such a number."""
        if value == float(suspect.number):
            return np.zeros_like(self._documented.high)
        try:
            high, low = self._truth_of(suspect, value)
        except (ValueError, ZeroDivisionError):
            return None
        own = self._documented
        moved = self._whitening.change((high - own.high) + (low - own.low))
        known = np.isfinite(moved).all(axis=1) & own.certified
        # What leaves most states undecided explains nothing.
        if 2 * int(known.sum()) <= int(own.certified.sum()):
            return None
        moved[np.flatnonzero(~known)] = 0.0
        return moved

    def _fitted(self, at: int, residual: Array, begin: float) -> Explained | None:
        one, column = self.suspects[at], self.columns[at]
        moves, steep = _Moves(self, one), _worst(column)

        def left(value: float) -> Array | None:
            moved = moves.at(value)
            if moved is None:
                return None
            # A further step would be felt by nothing.
            moves.arrived = abs(best_change(column, residual - moved)[0]) * steep < _STILL
            return residual - moved

        own, known = float(one.number), None if begin else -column
        value = fit(left, lambda value: -moves.column(value), own + begin, known, one.scale, moves.is_spent)
        rest = None if value is None else left(value)
        if value is None or rest is None or (least := _worst(rest)) > AGREEMENT:
            return None
        enough = max(AS_WELL, TIMES_AS_WELL * least)
        for short in (float(f"{value:.{digits}g}") for digits in _DIGITS):
            # The column tells of most that they are too short.
            if _worst(rest - column * (short - value)) <= enough and (there := left(short)) is not None and _worst(there) <= enough:
                return Explained(one, short, _worst(there), least)
        return Explained(one, value, least, least)


def _as_it_is(robot: Robot, _value: float) -> Robot:
    return robot


def _worst(rows: Array) -> float:
    return float(np.linalg.norm(rows, axis=1).max(initial=0.0))


class _Moves:
    """Effects of the values of one suspect, each computed once."""

    def __init__(self, search: SuspectSearch, suspect: Suspect) -> None:
        self._search, self._suspect, self._kept = search, suspect, dict[float, Array | None]()
        self.arrived = False

    def at(self, value: float) -> Array | None:
        if value not in self._kept:
            self._kept[value] = self._search.moved(self._suspect, value)
        return self._kept[value]

    def column(self, value: float) -> Array:
        """The derivative by the value; 0 where it has none at a state."""
        step = DIFFERENCE * self._suspect.scale
        here, there = self.at(value), self.at(value + step)
        if here is None or there is None:
            return np.zeros((1, 1))
        return (there - here) / step

    def is_spent(self) -> bool:
        return self.arrived or len(self._kept) > MOST_EVALUATIONS
