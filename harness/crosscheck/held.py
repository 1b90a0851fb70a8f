"""The static audit: what the subjects of one system hold after loading, compared in the world's frame before any dynamics.

Accelerations feel base parameters alone: mass may move between two links and change none of them. Every joint stands at zero.
``harness.crosscheck.held_quantities`` says what is compared, and in which ulps differences are measured. Constraints are not: what they
leave open, and the accelerations under them, are compared at each state (``harness.truth.quantities.accelerations``).

Source: Khalil, Dombre, Modeling, Identification and Control of Robots (2002), chapter 9, for base parameters.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from harness.crosscheck.assignment import Assignment, load_audited
from harness.crosscheck.expected import ExpectedDifference
from harness.crosscheck.held_quantities import NOTHING, OF_BODIES, OF_JOINTS, OF_MODELS, OF_SPRINGS, HeldQuantity, Value
from harness.engines import HeldModel, HeldSpring, Model
from harness.errors import shown_path
from harness.files.joint_kinds import JointKind
from harness.files.lint.formats import LEAST
from harness.files.model_file import ModelFile
from harness.files.text import lines as quantities
from harness.programs.mechanisms.mechanism import Mechanism
from harness.results.cross_check import HeldDifference
from harness.study import Note, sentence

# Largest difference of sound readers [ulps], about 6e-14. MuJoCo keeps a full inertia, and every inertia of a URDF, as
# principal moments and a quaternion whose norm is off by up to 25 roundings: up to 108 ulps over random tensors. Each turned
# frame costs an axis about 4 ulps.
SOUND = 256.0
# Joints from the root up to which that holds. Beyond, the bound grows as the square of the depth, as Pinocchio's MJCF reader
# loses digits, which takes each placement from the world's: over 210 random chains up to 298 ulps after 10 turned frames, 745
# after 20, 2138 after 40 and 3331 after 60, at most 3 times the square.
_SHALLOW = 8


@dataclass(frozen=True)
class Difference:
    """One quantity that the subjects of a system do not hold alike.

    Attributes:
        quantity: a name of ``harness.files.text.lines``.
        joint: the joint, or the last joint that moves the body; the number of a spring between points, from 1, in the first
            subject that has the most of them; "" for gravity.
        subjects: in groups that hold the same, the largest group first. values: what each group holds, as its first subject.
        ulps: largest difference from the first group; inf where there is no common measure.
        lines: format to the lines of its file that decide the quantity, the likeliest first. files: format to the path of its file.
        follows: the joint above whose own difference of place may be the cause of this one; "" where there is none.
    """

    quantity: str
    joint: str
    subjects: tuple[tuple[str, ...], ...]
    values: tuple[Value, ...]
    ulps: float
    lines: Mapping[str, tuple[int, ...]]
    files: Mapping[str, str]
    follows: str = ""

    def __str__(self) -> str:
        return f"{self.statement}; {'; '.join(self.places)}"

    @property
    def places(self) -> list[str]:
        """File and lines in each format that has lines for it."""
        return [f"{shown_path(Path(self.files[name]))}:{','.join(map(str, lines))}" for name, lines in self.lines.items() if lines]

    @property
    def statement(self) -> str:
        """Values that each group holds, and their distance."""
        owner = f"of {'number ' if self.quantity in OF_SPRINGS else ''}{self.joint} " if self.joint else ""
        groups = [f"{written(value)} ({', '.join(names)})" for value, names in zip(self.values, self.subjects, strict=True)]
        size = f"{self.ulps:.3g} ulps" if math.isfinite(self.ulps) else "no common measure"
        after = f"; may follow from joint {self.follows}" if self.follows else ""
        return f"{self.quantity} {owner}is {', but '.join(groups)}: {size}{after}"


def written(value: Value) -> str:
    """A quantity as text, with all its digits."""
    numbers = value if isinstance(value, list) else [value]
    return " ".join(number if isinstance(number, str) else repr(float(number)).removesuffix(".0") for number in numbers)


# What moves everything beyond it with it.
_MOVES = (quantities.JOINT, quantities.ANCHOR, quantities.AXIS, quantities.FRAME)


def held_by(model: Model) -> HeldModel | None:
    """The quantities of a loaded model; None where its engine does not offer them."""
    held = getattr(model, "held", None)
    return None if held is None else held()


def soundness(held: Mapping[str, HeldModel], models: Mapping[str, ModelFile]) -> list[str]:
    """Lines for people on what subjects hold; arguments as of ``differences``."""
    if rows := differences(held, models):
        return [str(row) for row in rows]
    worst = max(differences(held, models, above=0.0), key=lambda row: row.ulps, default=None)
    if worst is None:
        return ["sound: equal to the last bit"]
    named = f"{worst.quantity}{f' of {worst.joint}' if worst.joint else ''}"
    return [f"sound: alike within {worst.ulps:.3g} ulps ({named}); up to {SOUND:g} is the rounding of readers, and more in deep chains"]


def differences(held: Mapping[str, HeldModel], models: Mapping[str, ModelFile], above: float = SOUND) -> list[Difference]:
    """The quantities that subjects of one system do not hold alike, causes before what may follow from them, then from the root.

    ``held`` is by subject; ``models`` are the files by format, for their lines. Rows have more than ``above`` ulps, or than that
    many times (d / 8)^2 where the deepest joint concerned is the d-th from the root, d > 8.
    """
    if len(held) < 2:
        return []
    parents = {name: joint.parent for model in held.values() for name, joint in model.joints.items()}
    length = max(map(_length, held.values()))
    moved: set[str] = set()
    rows = []
    depths = {joint: 1 + len(list(_joints_above(parents, joint))) for joint in parents}
    for owner, quantity, found, items, numbers in _compared(held, sorted(depths, key=lambda joint: depths[joint]), length):
        values = {subject: "none" if item is None else found.value(item) for subject, item in items.items()}
        depth = max(depths.values(), default=0) if quantity in OF_SPRINGS else depths.get(owner, 0)
        bound = above * max(1.0, depth / _SHALLOW) ** 2
        groups, ulps = _groups(items, found, length, bound)
        if ulps <= bound:
            continue
        above_it = list(_joints_above(parents, owner))[::-1] + ([owner] if quantity in OF_BODIES else [])
        formats = {subject.partition("/")[2] for subject in held} & set(models)
        rows.append(
            Difference(
                quantity=quantity,
                joint=owner,
                subjects=groups,
                values=tuple(values[group[0]] for group in groups),
                ulps=ulps,
                lines={name: quantities.lines_of(models[name], quantity, numbers.get(name, owner)) for name in sorted(formats)},
                files={name: str(models[name].path) for name in sorted(formats)},
                follows=next((joint for joint in above_it if joint in moved), ""),
            )
        )
        if quantity in _MOVES:
            moved.add(owner)
    return sorted(rows, key=lambda row: bool(row.follows))


def _length(model: HeldModel) -> float:
    points = [joint.anchor for joint in model.joints.values()] + [body.centre for body in model.bodies.values() if body.mass > LEAST]
    return max((float(np.linalg.norm(point)) for point in points), default=0.0)


def _compared(
    held: Mapping[str, HeldModel], joints: Sequence[str], length: float
) -> Iterator[tuple[str, str, HeldQuantity, dict[str, Any], Mapping[str, str]]]:
    """Owner, name of the quantity, the quantity, subject to the item that has it, and format to the number of a spring in it.

    An item is None where a subject has none.
    """
    for name, quantity in OF_MODELS.items():
        yield "", name, quantity, dict(held), {}
    for joint in joints:
        own = {subject: model.joints.get(joint) for subject, model in held.items()}
        present = {subject: item for subject, item in own.items() if item is not None}
        for name, quantity in OF_JOINTS.items():
            yield joint, name, quantity, dict(own if name == quantities.JOINT else present), {}
        for name, quantity in OF_BODIES.items():
            yield joint, name, quantity, {subject: held[subject].bodies.get(joint, NOTHING) for subject in present}, {}
    most = max((model.springs for model in held.values()), key=len)
    partners = {subject: _partners(most, model.springs, length) for subject, model in held.items()}
    for number in range(len(most)):
        places = {subject: found[number] for subject, found in partners.items()}
        springs = {subject: None if place is None else held[subject].springs[place] for subject, place in places.items()}
        numbers = {subject.partition("/")[2]: "0" for subject in places}
        numbers |= {subject.partition("/")[2]: str(place + 1) for subject, place in places.items() if place is not None}
        for name, quantity in OF_SPRINGS.items():
            yield str(number + 1), name, quantity, dict(springs), numbers


def _partners(springs: Sequence[HeldSpring], others: Sequence[HeldSpring], length: float) -> list[int | None]:
    """For each of ``springs`` the place of the one of ``others`` with the nearest ends, of equals that in the same order."""
    ends = OF_SPRINGS[quantities.SPRING_ENDS].ulps
    pairs = [
        (apart if (apart := ends(one, other, length)) > SOUND else 0.0, abs(place - there), place, there)
        for place, one in enumerate(springs)
        for there, other in enumerate(others)
    ]
    found: dict[int, int] = {}
    for _, _, place, there in sorted(pairs):
        if place not in found and there not in found.values():
            found[place] = there
    return [found.get(place) for place in range(len(springs))]


def _groups(items: Mapping[str, Any], quantity: HeldQuantity, length: float, above: float) -> tuple[tuple[tuple[str, ...], ...], float]:
    """Subjects that hold the same, the largest group first, and the largest difference from the first of them."""

    def apart(one: str, other: str) -> float:
        if items[one] is None or items[other] is None:
            return 0.0 if items[one] is items[other] else math.inf
        return quantity.ulps(items[one], items[other], length)

    left = list(items)
    groups: list[tuple[str, ...]] = []
    while left:
        alike = [[other for other in left if apart(one, other) <= above] for one in left]
        chosen = max(range(len(left)), key=lambda place: (len(alike[place]), -place))
        group = [left[chosen], *(other for other in alike[chosen] if other != left[chosen])]
        groups.append(tuple(group))
        left = [subject for subject in left if subject not in group]
    largest = max(apart(groups[0][0], other) for other in items)
    return tuple(sorted(groups, key=len, reverse=True)), largest


def _joints_above(parents: Mapping[str, str], joint: str) -> Iterator[str]:
    """From the nearest to the root; models that disagree on the tree may make a cycle, which is left."""
    seen = {joint}
    while (joint := parents.get(joint, "")) and joint not in seen:
        seen.add(joint)
        yield joint


# In a cross-check


def find_differences(assignments: Sequence[Assignment], note: Note) -> list[tuple[HeldDifference, float | None]]:
    """The differences of what subjects of one system hold, with their ulps, and those that nothing excuses; the note names who is asked.

    That are subjects which cannot say what they hold, and hinges that a system takes for slides.
    """
    mechanism, system = assignments[0].mechanism, assignments[0].system
    held: dict[str, HeldModel] = {}
    found: list[tuple[HeldDifference, float | None]] = []
    for assignment in assignments:
        subject = str(assignment.subject)
        note(json.dumps({"subject": subject}))
        try:
            holding = held_by(load_audited(assignment))
            # An engine file may return anything.
            assert holding is None or isinstance(holding, HeldModel), f"held returned a {type(holding).__name__}; expected a HeldModel"
        except Exception as error:
            statement = f"{subject} does not say what it holds after loading: {sentence(error)}"
            found.append((_finding(mechanism.name, "", "", statement, [subject]), None))
            continue
        if holding is not None:
            held[subject] = holding
    note("")
    models = {assignment.model.format: assignment.model for assignment in assignments if assignment.model is not None}
    found += [(one, None) for one in _taken_for_lengths(mechanism, held)]
    for one in differences(held, models):
        others = [subject for group in one.subjects[1:] for subject in group]
        found.append((replace(_finding(system, one.quantity, one.joint, one.statement, others), places=one.places), one.ulps))
    return found


def _taken_for_lengths(mechanism: Mechanism, held: Mapping[str, HeldModel]) -> Iterator[HeldDifference]:
    """Hinges whose coordinates have a range, and nothing in the system's file that tells them from lengths.

    What a velocity term of an angle rounds would condemn a sound engine.
    """
    for joint, coordinate, rotates in zip(mechanism.joints, mechanism.coordinates, mechanism.rotating, strict=True):
        turning = [subject for subject, model in held.items() if joint in model.joints and model.joints[joint].kind == JointKind.HINGE]
        if turning and not rotates:
            statement = f"joint {joint} is a hinge, and the system's file has {coordinate} for a length: name it in angles=({coordinate},)"
            yield _finding(mechanism.name, quantities.JOINT, joint, statement, turning)


def judge_differences(
    found: Sequence[tuple[HeldDifference, float | None]], system: str, expected: Sequence[ExpectedDifference], complete: bool
) -> Iterator[HeldDifference]:
    """The findings of ``find_differences``, those that are expected with their reason.

    ``complete``: all subjects were held against each other, so that an expectation that nothing meets is a finding too.
    """
    left = {(one.quantity, one.joint): one for one in expected}
    known = {key: left[key] for one, ulps in found if ulps is not None and (key := (one.quantity, one.joint)) in left}
    for one, ulps in found:
        entry = known.get((one.quantity, one.joint))
        excused = entry is not None and ulps is not None and ulps <= entry.ulps
        yield replace(one, reason=f"{entry.reason} ({entry.link})") if excused and entry else one
    for key, entry in left.items():
        if complete and key not in known:
            owner = f" of {entry.joint}" if entry.joint else ""
            yield _finding(system, *key, f"{entry.quantity}{owner} is expected to differ, and is held alike; remove its [[differs]]", [])


def _finding(system: str, quantity: str, joint: str, statement: str, subjects: list[str]) -> HeldDifference:
    return HeldDifference(system=system, quantity=quantity, joint=joint, subjects=subjects, statement=statement, places=[])
