"""Perturbation columns: what a change of one value in a model file does to its accelerations, in data roundoffs.

A column is the derivative of the accelerations by the value, by central differences through a ``Watch``,
one-sided where a reader or physics refuses one direction. It is whitened: multiplied by the factor R of the
reference, |x|_M = |R x|, and divided by the data roundoff of its state, so that a column times a change of 1
counts data roundoffs, and residuals of all states and coordinates weigh alike.

Source: Khalil, Dombre, Modeling, Identification and Control of Robots (2002), chapter 12, on the observation matrix.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.certify.gaps import answers_with_gaps
from harness.certify.reference import Reference
from harness.certify.sampling import generic_sample
from harness.engines import Engine, Unsupported
from harness.equations.mechanism import Mechanism
from harness.equations.states import States
from harness.models.formats import BALL_CONSTRAINT, ORIENTATIONS, POINT_SPRING
from harness.models.model_file import ModelFile
from harness.models.text import Attribute, Candidate, Element, Number, Place, Watch, find_elements, with_values
from harness.verdict import AGREEMENT

NUMBER = "number"
# Of the central differences, relative to a value's scale: their error is about u / DIFFERENCE, or DIFFERENCE^2.
DIFFERENCE = 1e-5
# Of a value beside far larger ones, which may be what a wrong unit left: its scale is at least this share of theirs.
LEAST_SHARE = 1e-3
# A file whose lengths are all below this [m] has none by which to measure one.
NEGLIGIBLE_LENGTH = 1e-6
# Sampled states: of three, the last is held out of fits; of twelve, three are at rest and six without applied forces.
STATES = 96
HELD_OUT_OF = 3
# What two answers of a sound engine differ by, in data roundoffs, and the error of second order of a difference.
ROUNDOFFS = 4.0
SECOND_ORDER = 1e-8

# Format and element to the attributes that are moments or products of inertia.
INERTIAS = {("urdf", "inertia"): ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), ("mjcf", "inertial"): ("diaginertia", "fullinertia")}
_LENGTHS = {"pos", "xyz", "springlength"}
# Elements whose value is a length or a point.
_POINTS = (f"{POINT_SPRING}_p_", f"{POINT_SPRING}_free_length", f"{BALL_CONSTRAINT}_p_")
_ANGLES = {"rpy", "axis", *ORIENTATIONS}


def watch(engine: Engine, mechanism: Mechanism, model: ModelFile, states: States) -> Watch:
    """The accelerations that ``engine`` answers at ``states``, with gaps; what the model holds is not audited.

    Raises:
        ValueError: the engine refuses the model as it is; harness.engines.Unsupported: it cannot express it.
    """

    def answer(changed: ModelFile) -> Array:
        try:
            loaded = engine.load(changed, mechanism.joints, mechanism.gravity)
        except Unsupported as reason:
            if changed is model:
                raise
            raise ValueError(str(reason)) from reason
        return answers_with_gaps(loaded, states)

    return Watch(model, answer, mechanism.nv)


def diagnostic_states(mechanism: Mechanism, seed: int, count: int = STATES) -> States:
    """Sampled states of every kind, at rest, moving, and moving under applied forces, each among those that fits hold out."""
    states = generic_sample(mechanism, count, seed)
    kind = np.arange(count) // HELD_OUT_OF % 4
    v, tau = (np.where((kind >= quiet)[:, None], 0.0, values) for quiet, values in ((3, states.v), (2, states.tau)))
    return States.at(states.q, v, tau, states.time)


def held_out(count: int) -> np.ndarray[Any, np.dtype[np.bool_]]:
    """The states of ``count`` that fits do not see, (count,) bool."""
    return np.asarray(np.arange(count) % HELD_OUT_OF == HELD_OUT_OF - 1)


@dataclass(frozen=True)
class Whitening:
    """Accelerations of n states as multiples of data roundoffs beside their certified values."""

    reference: Reference

    @cached_property
    def _factor(self) -> Array:
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(self.reference.norm_factor / self.reference.roundoff_with_share[:, None, None])

    def residual(self, accelerations: Array) -> Array:
        """Errors, (n, nv), whose norm in each row is the backward error of that state."""
        with np.errstate(all="ignore"):
            return self.change((accelerations - self.reference.high) - self.reference.low)

    def change(self, difference: Array) -> Array:
        """A difference of accelerations, (n, nv), in the same measure."""
        with np.errstate(all="ignore"):
            whitened = np.asarray(np.einsum("nij,nj->ni", self._factor, difference))
        # A body at rest without gravity has no data roundoff, and nothing to explain.
        whitened[(difference == 0).all(axis=1)] = 0.0
        return whitened


def derivative(answer: Callable[[str], Array | None], text: Callable[[float], str], at: float, step: float) -> Array | None:
    """Derivative (n, nv) by the value of ``text`` of the accelerations that ``answer`` gives for a text, None where it is refused.

    By central differences; where one direction is refused, by three points in the other; None where both are.
    """
    up, down = (answer(text(at + sign * step)) for sign in (1.0, -1.0))
    if up is not None and down is not None:
        return (up - down) / (2 * step)
    near, sign = (up, 1.0) if up is not None else (down, -1.0)
    here = None if near is None else answer(text(at))
    if near is None or here is None:
        return None
    far = answer(text(at + 2 * sign * step))
    return sign * ((near - here) / step if far is None else (4 * near - 3 * here - far) / (2 * step))


@dataclass(frozen=True)
class Column:
    """One live candidate and what its value does.

    Attributes:
        values: whitened derivative of the accelerations by the value, (n, nv) [data roundoffs per unit of the value].
        noise: what rounding and the second order leave uncertain in the column's direction, relative to its norm.
    """

    candidate: Candidate
    values: Array
    noise: float

    @cached_property
    def norm(self) -> float:
        """Euclidean norm over all states and coordinates."""
        return float(np.linalg.norm(self.values))

    @cached_property
    def direction(self) -> Array:
        """The column as a vector of length 1."""
        return self.values.ravel() / self.norm


def find_columns(
    answer: Callable[[str], Array | None],
    reference: Reference,
    candidates: Iterable[Candidate],
    is_spent: Callable[[], bool] = lambda: False,
    step_of: Callable[[Candidate], float] = lambda candidate: DIFFERENCE * candidate.scale,
) -> list[Column]:
    """Columns of all candidates with a free value on which some acceleration depends, at the model as it is.

    ``answer`` gives the accelerations (n, nv) of a text, None where it is refused; ``step_of`` the step of a value in either direction.
    Of candidates of one statement and place, later ones stand in for those that are refused in both directions.
    """
    whitening = Whitening(reference)
    found: list[Column] = []
    answered: set[tuple[str, Place]] = set()
    for candidate in candidates:
        if is_spent():
            break
        identity = candidate.hypothesis, candidate.place
        if candidate.start is None or (candidate.hypothesis == NUMBER and identity in answered):
            continue
        step = step_of(candidate)
        slope = derivative(answer, candidate.text, candidate.start, step)
        if slope is None:
            continue
        answered.add(identity)
        values = whitening.change(slope)
        values[~np.isfinite(values).all(axis=1)] = 0.0
        if float(np.linalg.norm(values, axis=1).max()) * step > AGREEMENT:
            noise = ROUNDOFFS * math.sqrt(values.shape[0]) / (step * float(np.linalg.norm(values))) + SECOND_ORDER
            found.append(Column(candidate, values, noise))
    return found


def numeric_candidates(model: ModelFile) -> list[Candidate]:
    """Every number of the model as a candidate whose free value stands in its place, zeros included.

    A component of an axis changes with the others so that the axis keeps its length. A moment of inertia that
    physics may forbid to change alone comes a second time, in proportion with the others of its body.
    """
    elements = find_elements(model.text, model.format)
    return [
        candidate
        for element in elements
        for attribute in element.attributes
        for number in attribute.numbers
        for candidate in _of_number(model, elements, element, attribute, number)
    ]


def _of_number(
    model: ModelFile, elements: Sequence[Element], element: Element, attribute: Attribute, number: Number
) -> Iterator[Candidate]:
    place = _place(model, number)
    names = INERTIAS.get((model.format, element.tag), ())
    inertia = [other for own in element.attributes if own.name in names for other in own.numbers] if attribute.name in names else []
    group = inertia or list(attribute.numbers)
    scale = _scale(elements, element, attribute, number, group)
    if "axis" in (element.tag, attribute.name):
        others = [other for other in group if other is not number]
        rest = math.hypot(*(other.value for other in others))
        length = math.hypot(number.value, rest)
        if rest > 0:
            beside = tuple(_place(model, other) for other in others if other.value)
            yield Candidate(NUMBER, "", place, _turned(model.text, group, number, rest, length), number.value, length, beside)
            return
    yield Candidate(NUMBER, "", place, lambda value: with_values(model.text, {number: value}), number.value, scale)
    moments = [other for other in inertia if other.value != 0]
    if number in moments and len(moments) > 1:
        yield Candidate(
            NUMBER,
            "with the other moments of inertia in proportion",
            place,
            lambda value: with_values(model.text, {other: other.value * (value / number.value) for other in moments}),
            number.value,
            scale,
            tuple(_place(model, other) for other in moments if other is not number),
        )


def _place(model: ModelFile, number: Number) -> Place:
    return Place(number.line, number.element, number.attribute, number.index, model.text[number.start : number.end])


def _turned(text: str, components: Sequence[Number], number: Number, rest: float, length: float) -> Callable[[float], str]:
    """The text with another component of an axis, the others scaled so that the axis keeps its length."""

    def turned(value: float) -> str:
        value = max(-length, min(length, value))
        share = math.sqrt(max(0.0, length**2 - value**2)) / rest
        # At its own value the text is the file's, not what rounding makes of it.
        others = {} if value == number.value else {other: other.value * share for other in components}
        return with_values(text, {**others, number: value})

    return turned


def _scale(elements: Sequence[Element], element: Element, attribute: Attribute, number: Number, group: Sequence[Number]) -> float:
    """The natural size of a number: its own, its neighbours', or that of its like elsewhere in the file."""
    largest, is_length = max(abs(other.value) for other in group), _is_length(element, attribute)
    if largest > 0 and not is_length and len(group) > 1:
        return max(abs(number.value), LEAST_SHARE * largest) if number.value else largest
    if attribute.name in _ANGLES:
        return 1.0
    # A name such as "value" means something else in each element.
    like = [
        abs(other.value)
        for holder in elements
        for own in holder.attributes
        if (_is_length(holder, own) if is_length else (holder.tag, own.name) == (element.tag, attribute.name))
        for other in own.numbers
    ]
    alike = max(like, default=0.0)
    if alike <= (NEGLIGIBLE_LENGTH if attribute.name in _LENGTHS else 0.0):
        alike = 1.0
    # A length or a mass far below all others may be what is wrong: its step must be felt.
    return max(abs(number.value) or largest or alike, LEAST_SHARE * alike)


def _is_length(element: Element, attribute: Attribute) -> bool:
    return attribute.name in _LENGTHS or (element.tag.startswith(_POINTS) and attribute.name == "value")
