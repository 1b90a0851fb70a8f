"""Parts of a model file that its scene does not need, found by taking parts away and watching accelerations.

A number must be felt: lowered by a thousandth it moves some joint's acceleration, or its reader does not
accept it lower. What is zero or at its default is left out where the reader allows that; so are elements
whose absence nothing feels, and stages of the engine's pipeline that change nothing. Components of a
joint's axis, and of the axes that turn a frame, are the mechanism's structure and stay.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import itertools
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec
import numpy as np

from harness.arrays import Array
from harness.engines import Engine, Model, Subject, Unsupported, accelerations, engine_paths, installed_version, load_engine, runs_elsewhere
from harness.engines.interface import audit
from harness.errors import InvalidModel
from harness.files.lint.formats import STAGES
from harness.files.model_file import ModelFile
from harness.files.text.scan import Attribute, Element, Number, Watch, find_elements, largest_change, scaled, with_values, without
from harness.library import Library
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.states import States
from harness.results.cross_check import SuperfluousPart
from harness.storage import cache_directory, read_entry, sources_digest, write_entry
from harness.truth.quantities.accelerations import gaps_of
from harness.truth.sampling import random_sample
from harness.verdict import Verdict

if TYPE_CHECKING:
    from harness.crosscheck.assignment import Assignment

# Changing a number by this much moves some acceleration by 3e-7 at least in every shipped model, or by exactly nothing.
CHANGE = 1e-3
NOISE = 1e-10
# MuJoCo refuses a moving body with less mass or inertia.
LEAST = 1e-15
# As few as feel everything, for a long chain is asked a thousand times.
STATES, SEED = 8, 7
# Elements and numbers. Each costs at least one loading of the whole model; a chain of sixty links has 1700.
MOST_PARTS = 3000
# Changed models times states they are asked at. Most numbers are felt at the first state, so that a chain of sixty links takes 2000.
MOST_EVALUATIONS = 4000
# Elements that hold others together or say how to read them: never unused.
_KEPT = {
    "mjcf": {"mujoco", "worldbody", "tendon", "compiler", "option", "flag"},
    "urdf": {"robot", "axis"},
}
# Elements and attributes that hold directions, of which the length means nothing.
_DIRECTIONS = {"axis", "xyaxes", "zaxis"}
# Elements that only move what is inside them.
_WRAPPERS = {"mjcf": {"frame", "body"}, "urdf": set()}

# (line, element, attribute, value, why) of a ``SuperfluousPart``.
Row = tuple[int, str, str, str, str]


def find_superfluous(assignment: Assignment) -> list[SuperfluousPart]:
    """``superfluous`` parts of the subject's model; none where its answers are wrong as it is."""

    def is_sound() -> bool:
        verdicts = assignment.judge(_states_of(assignment)).verdicts
        return not {Verdict.DISAGREES.value, Verdict.ERROR.value} & set(verdicts)

    return superfluous(assignment, is_sound)


def superfluous(assignment: Assignment, is_sound: Callable[[], bool] = lambda: True) -> list[SuperfluousPart]:
    """Parts of the model that the subject does not feel, in the order of its lines.

    The result is kept on disk. Where nothing is kept, ``is_sound`` is asked first whether the subject is right about the
    model as it is: if not, that comes first.

    Raises:
        ValueError: the engine refuses the model.
    """
    library, subject, mechanism, model = assignment.library, assignment.subject, assignment.mechanism, assignment.model
    assert model is not None
    entry = _entry(library, subject, model, mechanism)
    parts: list[Row] | None = None
    with contextlib.suppress(msgspec.DecodeError):
        parts = msgspec.json.decode(read_entry(entry) or "", type=list[Row])
    if parts is None:
        if not is_sound():
            return []
        engine, states = load_engine(library, subject.engine), _states_of(assignment)
        examination = _Examination(engine, model, mechanism, states, _other_readers(subject))
        parts = sorted(examination.parts())
        write_entry(entry, msgspec.json.encode(parts).decode())
    return [SuperfluousPart(mechanism.name, str(subject), str(model.path), *part) for part in parts]


def _states_of(assignment: Assignment) -> States:
    """The states at which parts are looked for; those of a declared truth are off the manifold, on which its numbers are not felt."""
    return assignment.truth.asked_at(random_sample(assignment.mechanism, STATES, SEED), share=1.0)


def _entry(library: Library, subject: Subject, model: ModelFile, mechanism: Mechanism) -> Path:
    engine_file = engine_paths(library)[subject.engine]
    ranges = mechanism.position_ranges, mechanism.rate_ranges, mechanism.force_ranges
    identity = [repr(mechanism.key), repr(ranges), str(subject), str(installed_version(load_engine(library, subject.engine))), model.text]
    digest = hashlib.sha256("\0".join(identity).encode())
    digest.update(sources_digest("files", "engines", "programs", "lagrange", "trees", "truth", "crosscheck"))
    digest.update(hashlib.sha256(engine_file.read_bytes()).digest())
    return cache_directory() / "superfluous" / f"{digest.hexdigest()[:40]}.json"


def _other_readers(subject: Subject) -> list[Engine]:
    """The harness's other engines that read the subject's format and are installed: those of a library change no other's record."""
    library = Library.built_in()
    names = [name for name in engine_paths(library) if name != subject.engine]
    engines = [engine for name in names if subject.format in (engine := load_engine(library, name)).formats]
    return [engine for engine in engines if not runs_elsewhere(engine) and installed_version(engine) is not None]


def _felt(loaded: Model, states: States) -> Array:
    """Accelerations, (n, nv), and for a model with constraints what these hide.

    That is 1 m or rad with what each row leaves, and the mass matrix, to which a constraint that holds a coordinate adds nothing.
    """
    answers, gaps, terms = accelerations(loaded, states), gaps_of(loaded, states), getattr(loaded, "terms", None)
    if not gaps:
        return answers
    mass = [] if terms is None else [terms(states.q, states.v, states.tau).mass.reshape(len(states), -1)]
    return np.hstack([answers, *mass, *(1.0 + rows for rows in gaps.values())])


class _Spent(Exception):
    """The evaluations are used up."""


class _Examination:
    """One model in one engine, and what happens to its accelerations when parts of it change or go."""

    def __init__(self, engine: Engine, model: ModelFile, mechanism: Mechanism, states: States, others: Sequence[Engine] = ()) -> None:
        self._engine, self._mechanism, self._others = engine, mechanism, others
        self._model, self._format, self._text = model, model.format, model.text
        self._states = states
        self._left = MOST_EVALUATIONS
        self._healthy: Array | None = None
        # A changed number may contradict the system, for that is how it shows; a part that goes must not.
        self._watch = Watch(model, self._answer)
        self._audited = Watch(model, functools.partial(self._answer, audited=True))
        self._healthy = self._watch.healthy
        self._elements = find_elements(model.text, model.format)

    def _load(self, engine: Engine, model: ModelFile, audited: bool = True) -> Model:
        loaded = engine.load(model, self._mechanism.joints, self._mechanism.gravity)
        if audited:
            audit(loaded.loaded(), model, self._mechanism)
        return loaded

    def _answer(self, model: ModelFile, audited: bool = False) -> Array:
        """The accelerations at all states; those of the unchanged model stand behind the first state that feels a change."""
        states, loaded = self._states, self._load(self._engine, model, audited)
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

    def parts(self) -> Iterator[Row]:
        """(line, element, attribute, value, why) of everything that is not needed, as far as the evaluations reach."""
        root, count = self._elements[0], sum(1 + sum(len(part.numbers) for part in element.attributes) for element in self._elements)
        if count > MOST_PARTS:
            many = f"holds {count} elements and numbers, too many to ask for each whether it is felt; expected at most {MOST_PARTS}"
            yield root.line, root.tag, "", _named(root), many
            return
        try:
            yield from self._examined()
        except _Spent:
            spent = f"is examined in part: {MOST_EVALUATIONS} evaluations of changed models are used up"
            yield root.line, root.tag, "", _named(root), spent

    def _examined(self) -> Iterator[Row]:
        needed, dead = self._sorted_numbers()
        gone: list[Element] = []
        for element in self._elements:
            if any(outer.start <= element.start < outer.end for outer in gone):
                continue
            why = self._why_unused(element, needed)
            if why:
                gone.append(element)
                yield element.line, element.tag, "", _named(element), why
                continue
            for attribute in self._said(element):
                if self._is_default(element, attribute, needed):
                    yield attribute.line, element.tag, attribute.name, attribute.value, "is not felt; leave it out"
                    continue
                for number in attribute.numbers:
                    if number in dead:
                        why = f"is not felt by any acceleration; its least value here is {dead[number]}"
                        yield number.line, element.tag, attribute.name or "text", self._text[number.start : number.end], why
        yield from self._stages()

    def _said(self, element: Element) -> Sequence[Attribute]:
        """The attributes by which an element may move something.

        The pose of a body with a free joint is where it stands at first, from which some versions of readers measure the joint.
        """
        inside = (other for other in self._elements if other.path[:-1] == element.path and element.start < other.start < element.end)
        floats = element.tag == "body" and any(
            other.tag == "freejoint" or (other.tag == "joint" and other.get("type") == "free") for other in inside
        )
        return () if floats else element.attributes

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

    def _why_unused(self, element: Element, needed: set[Number]) -> str:
        """Why the model can do without ``element``; "" where it cannot."""
        if element.tag in _KEPT[self._format]:
            return ""
        if not any(element.holds(number) for number in needed):
            if self._unmoved(without(self._text, (element.start, element.end)), audited=True):
                return "is not used; remove it"
            carried = self._carried_by(element)
            if carried is not None and self._unmoved(
                without(self._text, (element.start, element.end), (carried.start, carried.end)), audited=True
            ):
                return f"carries link {carried.get('name')!r}, which nothing needs; remove both"
        own = {number for attribute in element.attributes for number in attribute.numbers}
        if element.tag in _WRAPPERS[self._format] and not own & needed:
            tags = (element.start, element.opened), (element.closed, element.end)
            plain = without(self._text, *tags)
            if self._unmoved(plain, audited=True) and not any(self._is_needed_by(engine, plain) for engine in self._others):
                return "moves nothing; remove it and keep what is inside"
        return ""

    def _is_needed_by(self, engine: Engine, model: str) -> bool:
        """True if another reader of the file is right about it as it is, and not about the text ``model``."""
        try:
            watch = Watch(self._model, lambda file: _felt(self._load(engine, file), self._states))
        except (InvalidModel, ValueError, Unsupported):
            return False
        try:
            movement = watch.movement(model)
        except Unsupported:
            return True
        return movement is None or movement > NOISE

    def _carried_by(self, element: Element) -> Element | None:
        """The link that a fixed URDF joint carries."""
        if element.path != ("robot", "joint") or element.get("type") != "fixed":
            return None
        inside = [other for other in self._elements if element.start < other.start < element.end and other.tag == "child"]
        names = {child.get("link") for child in inside}
        return next((other for other in self._elements if other.path == ("robot", "link") and other.get("name") in names), None)

    def _stages(self) -> Iterator[Row]:
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
                yield flag.line, "flag", stage, value, f'is on and not needed; write <flag {stage}="disable"/> in <option>'


def _named(element: Element) -> str:
    """The attribute that identifies the element: a name or a reference; "" for none."""
    return next((f'{key}="{value}"' for key in ("name", "class", "reference", "site", "joint") if (value := element.get(key))), "")
