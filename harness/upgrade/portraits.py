"""Portraits of mechanisms and files by versions of an engine: the numbers that they hold, and their accelerations; and two together."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np

from harness.arrays import Array
from harness.crosscheck.assignment import Assignment
from harness.crosscheck.held import SOUND
from harness.engines import Subject, Unsupported, load_engine
from harness.engines.interface import QUATERNION, CompiledNumber
from harness.engines.request import Held, Refused
from harness.engines.tree_request import model_request
from harness.explain.as_read import ReadTruth
from harness.explain.documented import all_judged
from harness.explain.meant import Meant, question_of
from harness.explain.switches import GROUPS
from harness.files.findings import CONTACTS, LeftOut
from harness.library import Library
from harness.results.readings import share_text
from harness.results.table import error_text, grouped
from harness.results.trend import RunChange
from harness.results.upgrade import ACCELERATIONS, NUMBERS, CompiledChange
from harness.study import Note
from harness.trees.mechanism import RobotMechanism
from harness.trees.robot import Robot
from harness.truth.compare import Certified
from harness.truth.reference import Reference
from harness.truth.sampling import generic_sample, sample
from harness.upgrade.touching import ContactPortrait, contact_changes, contacts_portrayed, to_the_end
from harness.verdict import AGREEMENT

# States at which two versions are held against each other.
STATES = 16
# Of two sound compilers, relative to the largest component of what a number is one of.
ROUNDED = SOUND * 2.0**-52


@dataclass(frozen=True)
class Portrait:
    """Portrait of a system by a version.

    Attributes:
        numbers: that it holds. accelerations: (n, nv) in the kinetic-energy metric, as shares of the certified ones; roundoff: (n,) data
            roundoff in the same measure; both empty where there are none. left_out: what of a file nobody is asked about. actuators: of
            a file, how many act. contacts: of a file; None where they are not compared. failure: of what gives the portrait, a sentence.
    """

    numbers: Sequence[CompiledNumber] = ()
    accelerations: Array = field(default_factory=lambda: np.empty((0, 0)))
    roundoff: Array = field(default_factory=lambda: np.empty(0))
    left_out: Sequence[LeftOut] = ()
    actuators: int = 0
    contacts: ContactPortrait | None = None
    failure: str = ""


def portray(library: Library, system: str, subject: Subject, seed: int, note: Note) -> Portrait:
    """The portrait that a subject, of a version, gives of a system; records hold why one refuses.

    Raises:
        Exception: whatever else an engine raises.
    """
    one = Assignment.of(library, system, subject)
    robot = one.mechanism.robot if library.reads_files and isinstance(one.mechanism, RobotMechanism) else None
    note(f"numbers of {subject}")
    numbers = _numbers_of(one)
    note(f"accelerations of {subject}")
    answered = _answers(one, seed) if robot is None else _answers_on_file(one, robot, seed)
    found = Portrait(numbers)
    if robot is not None:
        note(f"contacts of {subject}")
        contacts = contacts_portrayed(library, robot, subject.engine, seed)
        left_out = tuple(part for part in _left_out(one, robot) if contacts is None or part.what != CONTACTS)
        found = replace(found, left_out=left_out, actuators=len(robot.tree.actuators), contacts=contacts)
    if answered is None:
        return found
    shares, roundoff = _in_metric(*answered)
    return replace(found, accelerations=shares, roundoff=roundoff)


def _left_out(one: Assignment, robot: Robot) -> Iterator[LeftOut]:
    """Parts of a file that would move it and are not asked about; of what acts, the elements that are not judged."""
    known = all_judged(robot, load_engine(one.library, one.subject.engine)) if one.acts else []
    judged = {(switch.group.what, switch.number) for switch in known}
    acting = {group.what: group.of(robot) for group in GROUPS if any(what == group.what for what, _ in judged)}
    for part in robot.left_out:
        lines = part.lines
        if part.what in acting:
            lines = tuple(own.line for number, own in enumerate(acting[part.what]) if (part.what, number) not in judged)
        if part.bears_on_motion and lines:
            yield replace(part, lines=lines)


def _answers(one: Assignment, seed: int) -> tuple[Certified, Array] | None:
    """Certified accelerations, and those of an engine; None where it cannot say them."""
    states = generic_sample(one.mechanism, STATES, seed)
    with suppress(Unsupported):
        return one.truth.evaluate(states), one.answers(states)
    return None


def _answers_on_file(one: Assignment, robot: Robot, seed: int) -> tuple[Certified, Array] | None:
    """The same over the joints of a file, whatever an engine reads of it; its solver of constraints goes to the end."""
    truth, engine = one.truth, load_engine(one.library, one.subject.engine)
    truth = truth.of_file if isinstance(truth, ReadTruth) else truth
    states = truth.asked_at(sample(one.mechanism, STATES, seed))
    certified = truth.evaluate(states)
    assert isinstance(certified, Reference) and isinstance(one.mechanism, RobotMechanism)
    of_file, held = Meant(robot, states, certified), one.mechanism.held or Held((), ())
    answers = engine.ask(question_of(of_file, one.library.stance, replace(held, solver=to_the_end(engine))))
    return (of_file.truth, answers.of(robot.joints)) if set(robot.joints) <= set(answers.accelerations) else None


def _numbers_of(one: Assignment) -> tuple[CompiledNumber, ...]:
    """The numbers that an engine holds of a file as its user loads it; none of one that it does not read without help."""
    mechanism, request = one.mechanism, None
    if one.library.reads_files:
        request = mechanism.handed_to_engines
    elif one.model is not None:
        request = model_request(one.model, mechanism.joints, mechanism.gravity)
    with suppress(Refused, Unsupported):
        return () if request is None else load_engine(one.library, one.subject.engine).compiled(request)
    return ()


def _in_metric(truth: Certified, answers: Array) -> tuple[Array, Array]:
    """Answers (n, nv) and data roundoffs (n,) as shares of the exact values, in the metric of these; without states that have none."""
    with np.errstate(all="ignore"):
        size = truth.lengths(truth.high)
        kept = truth.certified & (size > 0) & np.isfinite(answers).all(axis=1)
        shares = np.einsum("nij,nj->ni", truth.norm_factor, answers) / size[:, None]
        roundoff = truth.data_roundoff / size
    return np.where(kept[:, None], shares, 0.0), np.where(kept, roundoff, np.inf)


def changes_between(system: str, subject: str, before: Portrait, now: Portrait) -> tuple[list[RunChange], list[CompiledChange]]:
    """The change of accelerations, if there is one, or why they are not compared; and those of the numbers that are held."""
    failures = [failure for failure in (before.failure, now.failure) if failure]
    found = [RunChange(system=system, subject=subject, what=NUMBERS, before="", now=f"not compared: {failure}") for failure in failures[:1]]
    if before.accelerations.shape == now.accelerations.shape and now.accelerations.size:
        by, roundoff = np.linalg.norm(now.accelerations - before.accelerations, axis=1), before.roundoff + now.roundoff
        if (felt := by > AGREEMENT * roundoff).any():
            moved, roundoffs = float(by[felt].max()), float((by / roundoff).max())
            said = f"{share_text(moved)} of their size, {error_text(roundoffs)} data roundoffs"
            found.append(RunChange(system=system, subject=subject, what=ACCELERATIONS, before="", now=said, size=moved))
    found += contact_changes(system, subject, before.contacts, now.contacts)
    return found, list(_numbers(system, subject, _by_name(before), _by_name(now)))


def _by_name(portrait: Portrait) -> dict[tuple[str, str], CompiledNumber]:
    return {(number.quantity, number.owner): number for number in portrait.numbers}


_Value = float | str | None
_Changed = tuple[str, str, _Value, _Value, float, bool]


def _numbers(
    system: str, subject: str, before: Mapping[tuple[str, str], CompiledNumber], now: Mapping[tuple[str, str], CompiledNumber]
) -> Iterator[CompiledChange]:
    """The numbers that changed, equal changes of several objects as one; a quantity that one version does not know is none of them."""
    known = {quantity for quantity, _ in before} & {quantity for quantity, _ in now}
    pairs = [
        (change, owner)
        for quantity, owner in dict.fromkeys([*before, *now])
        if quantity in known
        for change in _of_object(before.get((quantity, owner)), now.get((quantity, owner)))
    ]
    for (quantity, part, old, new, size, felt), owners in grouped(pairs).items():
        yield CompiledChange(
            system=system, subject=subject, quantity=quantity, part=part, owners=owners, before=old, now=new, size=size, felt=felt
        )


def _of_object(before: CompiledNumber | None, now: CompiledNumber | None) -> Iterator[_Changed]:
    known = now or before
    assert known is not None
    if before is None or now is None:
        value = None if not known.values else known.values[0]
        yield (known.quantity, "", *((None, value) if before is None else (value, None)), math.inf, known.felt)
        return
    old, new = before.values, now.values
    count = max(len(old), len(new))
    # Versions may have longer rows of parameters, the further ones zero.
    old, new = (values + (0.0,) * (count - len(values)) for values in (old, new))
    numeric = all(isinstance(value, float) for value in (*old, *new))
    if numeric and known.parts == QUATERNION and sum(float(a) * float(b) for a, b in zip(old, new, strict=True)) < 0:
        old = tuple(-float(value) for value in old)
    length = max((abs(float(value)) for value in (*old, *new)), default=0.0) if numeric and known.parts else 0.0
    for place, (a, b) in enumerate(zip(old, new, strict=True)):
        part = "" if count == 1 else f".{known.parts[place]}" if known.parts else f"[{place}]"
        if isinstance(a, str) or isinstance(b, str):
            if a != b:
                yield known.quantity, part, a, b, math.inf, known.felt
        elif a != b and (size := abs(b - a) / (length or max(abs(a), abs(b)))) > ROUNDED:
            yield known.quantity, part, a, b, size, known.felt
