"""Changes of a model's accelerations when parts of its file change or go, all asked of one engine.

It runs where the engine does, which it asks thousands of times, see ``Engine.run``. No truth is in it.
"""

from __future__ import annotations

import functools
import itertools
from collections.abc import Collection, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from harness.arrays import Array
from harness.engines import Engine, Model, Unsupported, accelerations_and_gaps
from harness.engines.engine import load_keeping_arithmetic
from harness.engines.interface import audit
from harness.errors import InvalidModel
from harness.files.lint.formats import STAGES
from harness.files.model_file import ModelFile
from harness.files.text.scan import Attribute, Element, Number, Watch, find_elements, largest_change, scaled, with_values, without
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.states import States

# Changing a number by this much moves some acceleration by 3e-7 at least in every shipped model, or by exactly nothing.
CHANGE = 1e-3
NOISE = 1e-10
# MuJoCo refuses a moving body with less mass or inertia.
LEAST = 1e-15
# Elements and numbers. Each costs at least one loading of the whole model; a chain of sixty links has 1700.
MOST_PARTS = 3000
# Elements that hold others together or say how to read them: never unused.
_KEPT = {
    "mjcf": {"mujoco", "worldbody", "tendon", "compiler", "option", "flag"},
    "urdf": {"robot", "axis"},
}
# Elements and attributes that hold directions, of which the length means nothing.
_DIRECTIONS = {"axis", "xyaxes", "zaxis"}
# Attributes by which a solver goes on, which few states feel: those near the one where it begins.
_OF_SOLVERS = {("option", "tolerance"), ("option", "iterations")}
# Elements that only move what is inside them.
_WRAPPERS = {"mjcf": {"frame", "body"}, "urdf": set()}

# (line, element, attribute, value, why) of a ``SuperfluousPart``.
Row = tuple[int, str, str, str, str]


class NotNeeded(NamedTuple):
    """Elements that the engine does not need.

    Attributes:
        start: place in the text of the element. plain: of one that only holds others, the text without it; "" for what goes altogether.
    """

    row: Row
    start: int
    plain: str = ""


def examine(
    engine: Engine, model: ModelFile, mechanism: Mechanism, states: States, most_evaluations: int, kept: Collection[int]
) -> list[NotNeeded]:
    """Parts of the model that the engine does without, but the elements that start at ``kept``.

    Raises:
        ValueError: the engine refuses the model.
    """
    return list(_Examination(engine, model, mechanism, states, most_evaluations, kept).parts())


def is_needed(engine: Engine, model: ModelFile, mechanism: Mechanism, states: States, plain: str) -> bool:
    """True if the engine is right about the model as it is, and not about the text ``plain``."""
    try:
        watch = Watch(model, lambda file: _felt(_loaded(engine, file, mechanism), states))
    except (InvalidModel, ValueError, Unsupported):
        return False
    try:
        movement = watch.movement(plain)
    except Unsupported:
        return True
    return movement is None or movement > NOISE


def _loaded(engine: Engine, model: ModelFile, mechanism: Mechanism, audited: bool = True) -> Model:
    loaded: Model = load_keeping_arithmetic(engine, model, mechanism.joints, mechanism.gravity)
    if audited:
        audit(loaded.loaded(), model, mechanism)
    return loaded


def _felt(loaded: Model, states: States) -> Array:
    """Accelerations, (n, nv), and for a model with constraints what these hide.

    That is 1 m or rad with what each row leaves, and the mass matrix, to which a constraint that holds a coordinate adds nothing.
    """
    (answers, gaps), terms = accelerations_and_gaps(loaded, states), getattr(loaded, "terms", None)
    if not gaps:
        return answers
    mass = [] if terms is None else [terms(states.q, states.v, states.tau).mass.reshape(len(states), -1)]
    return np.hstack([answers, *mass, *(1.0 + rows for rows in gaps.values())])


class _Spent(Exception):
    """The evaluations are used up."""


class _Examination:
    """One model in one engine, and what happens to its accelerations when parts of it change or go."""

    def __init__(
        self, engine: Engine, model: ModelFile, mechanism: Mechanism, states: States, most_evaluations: int, kept: Collection[int]
    ) -> None:
        self._engine, self._mechanism, self._kept = engine, mechanism, kept
        self._format, self._text = model.format, model.text
        self._states = states
        self._most = self._left = most_evaluations
        self._healthy: Array | None = None
        # A changed number may contradict the system, for that is how it shows; a part that goes must not.
        self._watch = Watch(model, self._answer)
        self._audited = Watch(model, functools.partial(self._answer, audited=True))
        self._healthy = self._watch.healthy
        self._elements = find_elements(model.text, model.format)

    def _answer(self, model: ModelFile, audited: bool = False) -> Array:
        """The accelerations at all states; those of the unchanged model stand behind the first state that feels a change."""
        states, loaded = self._states, _loaded(self._engine, model, self._mechanism, audited)
        if self._healthy is None:
            return _felt(loaded, states)
        answers = self._healthy.copy()
        for asked in (slice(0, 1), slice(1, None)):
            self._left -= len(states[asked])
            if self._left < 0:
                raise _Spent
            answers[asked] = _felt(loaded, states[asked])
            if largest_change(self._healthy, answers) > NOISE:
                break
        return answers

    def parts(self) -> Iterator[NotNeeded]:
        """Everything that is not needed, as far as the evaluations reach."""
        root, count = self._elements[0], sum(1 + sum(len(part.numbers) for part in element.attributes) for element in self._elements)
        if count > MOST_PARTS:
            many = f"holds {count} elements and numbers, too many to ask for each whether it is felt; expected at most {MOST_PARTS}"
            yield NotNeeded((root.line, root.tag, "", _named(root), many), root.start)
            return
        try:
            yield from self._examined()
        except _Spent:
            spent = f"is examined in part: {self._most} evaluations of changed models are used up"
            yield NotNeeded((root.line, root.tag, "", _named(root), spent), root.start)

    def _examined(self) -> Iterator[NotNeeded]:
        needed, dead = self._sorted_numbers()
        gone: list[Element] = []
        for element in self._elements:
            if any(outer.start <= element.start < outer.end for outer in gone):
                continue
            why, plain = self._why_unused(element, needed)
            if why:
                gone.append(element)
                yield NotNeeded((element.line, element.tag, "", _named(element), why), element.start, plain)
                continue
            for attribute in self._said(element):
                if self._is_default(element, attribute, needed):
                    row = attribute.line, element.tag, attribute.name, attribute.value, "is not felt; leave it out"
                    yield NotNeeded(row, element.start)
                    continue
                for number in attribute.numbers:
                    if number in dead:
                        why = f"is not felt by any acceleration; its least value here is {dead[number]}"
                        row = number.line, element.tag, attribute.name or "text", self._text[number.start : number.end], why
                        yield NotNeeded(row, element.start)
        yield from self._stages()

    def _said(self, element: Element) -> Sequence[Attribute]:
        """The attributes by which an element may move something.

        The pose of a body with a free joint is where it stands at first, from which some versions of readers measure the joint.
        """
        inside = (other for other in self._elements if other.path[:-1] == element.path and element.start < other.start < element.end)
        floats = element.tag == "body" and any(
            other.tag == "freejoint" or (other.tag == "joint" and other.get("type") == "free") for other in inside
        )
        return () if floats else [one for one in element.attributes if (element.tag, one.name) not in _OF_SOLVERS]

    def _unmoved(self, text: str, audited: bool = False) -> bool:
        """True if the reader accepts ``text`` and answers as before."""
        movement = (self._audited if audited else self._watch).movement(text)
        return movement is not None and movement <= NOISE

    def _sorted_numbers(self) -> tuple[set[Number], dict[Number, str]]:
        """Numbers the model needs, and the others, which are not zero, with their least value."""
        needed: set[Number] = set()
        dead: dict[Number, str] = {}
        for element in self._elements:
            bound: list[Number] = []
            for number in (number for attribute in self._said(element) for number in attribute.numbers):
                if number.value == 0 or _DIRECTIONS & {element.tag, number.attribute}:
                    continue
                movement = self._watch.movement(scaled(self._text, [number], 1 - CHANGE))
                if movement is not None and movement <= NOISE:
                    if abs(number.value) > LEAST:
                        dead[number] = self._least([number])
                    continue
                if abs(number.value) > LEAST:
                    needed.add(number)
                if movement is None:
                    bound.append(number)
            # Numbers that hold each other up, as two equal moments of inertia do, may still go down together.
            for group in (*itertools.combinations(bound, 2), bound if len(bound) > 2 else ()):
                free = [number for number in group if number in needed]
                if len(free) > 1 and self._unmoved(scaled(self._text, free, 1 - CHANGE)):
                    least = self._least(free)
                    dead |= dict.fromkeys(free, least)
                    needed -= set(free)
        return needed, dead

    def _least(self, numbers: Sequence[Number]) -> str:
        """The least value, to three digits, that the reader accepts for all ``numbers`` without any acceleration moving."""
        for value in (0.0, LEAST):
            if self._unmoved(with_values(self._text, dict.fromkeys(numbers, value))):
                return f"{value:g}"
        low, high = 0.0, 1.0
        while high - low > 1e-3 * high:
            middle = (low + high) / 2
            low, high = (low, middle) if self._unmoved(scaled(self._text, numbers, middle)) else (middle, high)
        return " and ".join(f"{number.value * high:.3g}" for number in numbers)

    def _is_default(self, element: Element, attribute: Attribute, needed: set[Number]) -> bool:
        if not attribute.name or not attribute.numbers or _DIRECTIONS & {element.tag, attribute.name} or needed & set(attribute.numbers):
            return False
        return self._unmoved(without(self._text, (attribute.start, attribute.end)), audited=True)

    def _why_unused(self, element: Element, needed: set[Number]) -> tuple[str, str]:
        """Why the model can do without ``element``, "" where it cannot; and ``NotNeeded.plain``."""
        if element.tag in _KEPT[self._format]:
            return "", ""
        if not any(element.holds(number) for number in needed):
            if self._unmoved(without(self._text, (element.start, element.end)), audited=True):
                return "is not used; remove it", ""
            carried = self._carried_by(element)
            if carried is not None and self._unmoved(
                without(self._text, (element.start, element.end), (carried.start, carried.end)), audited=True
            ):
                return f"carries link {carried.get('name')!r}, which nothing needs; remove both", ""
        own = {number for attribute in element.attributes for number in attribute.numbers}
        if element.tag in _WRAPPERS[self._format] and not own & needed and element.start not in self._kept:
            tags = (element.start, element.opened), (element.closed, element.end)
            plain = without(self._text, *tags)
            if self._unmoved(plain, audited=True):
                return "moves nothing; remove it and keep what is inside", plain
        return "", ""

    def _carried_by(self, element: Element) -> Element | None:
        """The link that a fixed URDF joint carries."""
        if element.path != ("robot", "joint") or element.get("type") != "fixed":
            return None
        inside = [other for other in self._elements if element.start < other.start < element.end and other.tag == "child"]
        names = {child.get("link") for child in inside}
        return next((other for other in self._elements if other.path == ("robot", "link") and other.get("name") in names), None)

    def _stages(self) -> Iterator[NotNeeded]:
        """Parts of the pipeline that are on although switching them off changes nothing."""
        if not STAGES[self._format]:
            return
        root = self._elements[0]
        flags = [element for element in self._elements if element.tag == "flag"]
        place = next((found[-1] for tag in ("flag", "option") if (found := [e for e in self._elements if e.tag == tag])), root)
        for stage in STAGES[self._format]:
            written = [(flag, value) for flag in flags if (value := flag.get(stage)) is not None]
            flag, value = written[-1] if written else (place, "enable")
            # A later option overrides an earlier one.
            off = f'<option><flag {stage}="disable"/></option>'
            if value != "disable" and self._unmoved(self._text[: root.closed] + off + self._text[root.closed :], audited=True):
                row = flag.line, "flag", stage, value, f'is on and not needed; write <flag {stage}="disable"/> in <option>'
                yield NotNeeded(row, flag.start)


def _named(element: Element) -> str:
    """The attribute that identifies the element: a name or a reference; "" for none."""
    return next((f'{key}="{value}"' for key in ("name", "class", "reference", "site", "joint") if (value := element.get(key))), "")
