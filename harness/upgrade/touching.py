"""Contacts of a file by versions of an engine at the same states: points, law and solver, told apart.

States are where steps of the version beside the harness lead, so that both versions are asked at the same ones. A pair of shapes whose
contacts are elsewhere has other points; one whose contacts are where they were with other numbers, as friction, has another law. Where
points and numbers are the same, accelerations with the solver run to its end differ by the law, and those with its default settings alone
by the solver.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from harness.arrays import Array
from harness.engines import Engine, load_engine
from harness.engines.request import EngineQuestion, SolverSettings
from harness.environments import split_name
from harness.explain.meant import Meant, meant, question_of
from harness.explain.switches import held_with, switches_of
from harness.explain.touching import put, steps_of
from harness.files.contacts import FoundContact
from harness.files.findings import CONTACTS
from harness.library import Library, Stance
from harness.results.readings import share_text
from harness.results.trend import RunChange
from harness.results.upgrade import CONTACT_LAW, CONTACT_POINTS, CONTACT_SOLVER
from harness.trees.robot import Robot, with_actuators

# States at which contacts are compared; and what is rounding, of lengths in metres, of other numbers and of accelerations.
TOUCHING_STATES = 16
_ALIKE, _ALIKE_NUMBERS, _ALIKE_ANSWERS = 1e-9, 1e-12, 1e-8
_NUMBERS = ("friction", "margin", "solref", "solimp", "sliding")
# What a file calls them.
_WORDS = {"sliding": "solreffriction"}


@dataclass(frozen=True)
class ContactPortrait:
    """Contacts of a file by a version.

    Attributes:
        contacts: those of each of n states. accelerations, ended: (n, nv), with the solver's default settings, and run to its end.
        sizes: (n,) of the accelerations without contacts and of what contacts change, which may cancel.
    """

    contacts: Sequence[Sequence[FoundContact]] = ()
    accelerations: Array = field(default_factory=lambda: np.empty((0, 0)))
    ended: Array = field(default_factory=lambda: np.empty((0, 0)))
    sizes: Array = field(default_factory=lambda: np.empty(0))


def contacts_portrayed(library: Library, robot: Robot, engine: str, seed: int) -> ContactPortrait | None:
    """The contacts of a file by a version; None where they are not compared.

    Raises:
        Exception: whatever an engine raises.
    """
    caller, steps = load_engine(library, engine), load_engine(library, split_name(engine)[0])
    of_file = meant(with_actuators(robot, ()), TOUCHING_STATES, seed)
    ask = partial(_question, of_file, caller)
    question = ask(None)
    if question is None:
        return None
    # Half of the bodies are let go at rest: what is thrown away touches nothing.
    thrown = np.where(np.arange(len(question.v))[:, None] % 2, question.v, 0.0)
    settled = steps.ask(replace(question, v=thrown, steps=steps_of(len(question.q))))
    if settled.refusal or not settled.states:
        return None
    states = put(replace(of_file.states, q=question.q, v=question.v, tau=question.tau), np.arange(len(question.q)), *settled.states)
    asked = question, ask(to_the_end(caller)), question_of(of_file, Stance.PLAIN)
    answers = [caller.ask(replace(one, q=states.q, v=states.v)) for one in asked if one is not None]
    if any(one.refusal or not set(robot.joints) <= set(one.accelerations) for one in answers):
        return None
    default, ended, free = (one.of(robot.joints) for one in answers)
    sizes = np.linalg.norm(free, axis=1) + np.linalg.norm(ended - free, axis=1)
    return ContactPortrait(answers[0].contacts, default, ended, sizes)


def to_the_end(caller: Engine) -> SolverSettings | None:
    """Settings with which an engine's solver of constraints goes to the end; None of one that declares none."""
    return caller.endings[0].solver if caller.endings else None


def _question(of_file: Meant, caller: Engine, solver: SolverSettings | None) -> EngineQuestion | None:
    """Contacts alone on; None where the engine's are not judged, or the file has none."""
    robot = of_file.robot
    switches = [one for one in switches_of(robot, robot, caller) if one.group.what == CONTACTS and not one.why_not]
    return question_of(of_file, Stance.PLAIN, held_with(robot, switches, solver)) if switches else None


_Pair = tuple[str, str]


def contact_changes(system: str, subject: str, before: ContactPortrait | None, now: ContactPortrait | None) -> Iterator[RunChange]:
    """Changes of contacts, the largest of each kind; none where a version has no portrait of them."""
    if before is None or now is None or before.accelerations.shape != now.accelerations.shape:
        return
    change = partial(RunChange, system=system, subject=subject, before="")
    points, numbers, same = dict[_Pair, float](), dict[_Pair, list[str]](), list[int]()
    for state, (old, new) in enumerate(zip(before.contacts, now.contacts, strict=True)):
        moved, otherwise = _by_pair(old, new)
        for pair, size in moved.items():
            points[pair] = max(points.get(pair, 0.0), size)
        for pair, names in otherwise.items():
            numbers[pair] = list(dict.fromkeys([*numbers.get(pair, []), *names]))
        if old and not moved and not otherwise:
            same.append(state)
    if points:
        pair = max(points, key=lambda one: points[one])
        yield change(what=CONTACT_POINTS, now=f"{_told(pair, len(points))} {_moved(points[pair])}", size=min(points[pair], 1.0))
    law = _largest(before.ended, now.ended, now.sizes, same)
    if numbers:
        pair = next(iter(numbers))
        yield change(what=CONTACT_LAW, now=f"{_told(pair, len(numbers))} have other {' and '.join(numbers[pair])}", size=1.0)
    elif law > _ALIKE_ANSWERS:
        yield change(what=CONTACT_LAW, now=f"{_where(now, same)} push otherwise, {share_text(law)} of qdd", size=law)
    solver = _largest(before.accelerations, now.accelerations, now.sizes, same)
    if solver > _ALIKE_ANSWERS and law <= _ALIKE_ANSWERS:
        yield change(what=CONTACT_SOLVER, now=f"ends elsewhere at {_where(now, same)}, {share_text(solver)} of qdd", size=solver)


def _by_pair(before: Sequence[FoundContact], now: Sequence[FoundContact]) -> tuple[dict[_Pair, float], dict[_Pair, list[str]]]:
    """Pairs of shapes whose contacts are elsewhere, by how much, infinite for another number of them; and those with other numbers."""
    old, new = _grouped(before), _grouped(now)
    moved, otherwise = dict[_Pair, float](), dict[_Pair, list[str]]()
    for pair in dict.fromkeys([*old, *new]):
        those = list(zip(old.get(pair, ()), new.get(pair, ()), strict=False))
        if len(old.get(pair, ())) != len(new.get(pair, ())):
            moved[pair] = float("inf")
            continue
        size = max(max(_apart(one, other, _place_of)) for one, other in those)
        if size > _ALIKE:
            moved[pair] = size
        elif names := [name for name in _NUMBERS if any(_differ(getattr(one, name), getattr(other, name)) for one, other in those)]:
            otherwise[pair] = [_WORDS.get(name, name) for name in names]
    return moved, otherwise


def _grouped(contacts: Sequence[FoundContact]) -> dict[_Pair, list[FoundContact]]:
    """By pairs of shapes, in an order that does not depend on that of the engine."""
    found = defaultdict[_Pair, list[FoundContact]](list)
    for one in sorted(contacts, key=lambda one: tuple(np.round(one.point, 7))):
        first, second = sorted(one.shapes if all(one.shapes) else one.bodies)
        found[first, second].append(one)
    return found


def _place_of(contact: FoundContact) -> Sequence[float]:
    # Tangents are the engine's choice, and so is which shape is the first.
    sign = 1 if tuple(contact.shapes) == tuple(sorted(contact.shapes)) else -1
    return *contact.point, contact.distance, *(sign * one for one in contact.frame[:3])


def _apart(one: FoundContact, other: FoundContact, place: Callable[[FoundContact], Sequence[float]]) -> list[float]:
    return [abs(a - b) for a, b in zip(place(one), place(other), strict=True)]


def _differ(one: float | Sequence[float], other: float | Sequence[float]) -> bool:
    first, second = np.atleast_1d(one), np.atleast_1d(other)
    return len(first) != len(second) or bool((abs(first - second) > _ALIKE_NUMBERS * np.maximum(abs(first), abs(second))).any())


def _largest(before: Array, now: Array, sizes: Array, states: Sequence[int]) -> float:
    """The largest change of accelerations among states, relative to ``sizes`` there."""
    if not states:
        return 0.0
    change = np.linalg.norm(now[states] - before[states], axis=1)
    return float(np.nan_to_num(change / np.where(sizes[states] > 0, sizes[states], 1.0), nan=np.inf).max())


def _where(now: ContactPortrait, states: Sequence[int]) -> str:
    """The pairs that touch at states."""
    pairs = list(dict.fromkeys(pair for state in states for pair in _grouped(now.contacts[state])))
    return _told(pairs[0], len(pairs))


def _told(pair: _Pair, count: int) -> str:
    more = f" and {count - 1} more {'pair' if count == 2 else 'pairs'}" if count > 1 else ""
    return f"{pair[0]!r} and {pair[1]!r}{more}"


def _moved(size: float) -> str:
    return "touch in another number of points" if size == float("inf") else f"touch elsewhere, by up to {size:.2g} m"
