"""The static audit in a check: the quantities that the subjects of one system do not hold alike, and which of them are expected.

Accelerations feel base parameters alone: mass may move between two links and change none of them.

``expected_verdicts.toml`` of a library holds ``[[differs]]`` tables beside those of ``harness.crosscheck.expected``, with ``system``,
``quantity``, ``joint``, ``ulps``, the largest difference that the reason explains, ``reason`` and ``link``.

Source: Khalil, Dombre, Modeling, Identification and Control of Robots (2002), chapter 9, for base parameters.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Annotated

import msgspec

from harness.crosscheck.assignment import Assignment, load_audited
from harness.crosscheck.expected import TABLES, Text, read_tables
from harness.crosscheck.held import Difference, differences, held_by
from harness.crosscheck.held_quantities import OF_BODIES, OF_JOINTS, OF_MODELS, OF_SPRINGS
from harness.crosscheck.tasks import Note
from harness.engines import HeldModel
from harness.errors import InvalidInput
from harness.files.joint_kinds import JointKind
from harness.files.text.lines import JOINT
from harness.library import Library, nearest
from harness.programs.mechanisms.mechanism import Mechanism
from harness.results.cross_check import HeldDifference
from harness.study import sentence


class ExpectedDifference(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One ``[[differs]]`` table."""

    system: Text
    quantity: Text
    joint: str
    ulps: Annotated[float, msgspec.Meta(gt=0)]
    reason: Text
    link: Text

    @property
    def key(self) -> tuple[str, str]:
        return self.quantity, self.joint


def find_differences(assignments: Sequence[Assignment], note: Note) -> list[HeldDifference | Difference]:
    """What the subjects of one system do not hold alike, and those that cannot say what they hold; the note names who is asked."""
    held: dict[str, HeldModel] = {}
    silent = []
    for assignment in assignments:
        subject = str(assignment.subject)
        note(json.dumps({"subject": subject}))
        try:
            holding = held_by(load_audited(assignment))
            # An engine file may return anything.
            assert holding is None or isinstance(holding, HeldModel), f"held returned a {type(holding).__name__}; expected a HeldModel"
        except Exception as error:
            statement = f"{subject} does not say what it holds after loading: {sentence(error)}"
            silent.append(_finding(assignment.mechanism.name, "", "", [subject], statement))
            continue
        if holding is not None:
            held[subject] = holding
    note("")
    mechanism = assignments[0].mechanism
    models = {assignment.model.format: assignment.model for assignment in assignments if assignment.model is not None}
    return [*silent, *_taken_for_lengths(mechanism, held), *differences(mechanism.name, held, models)]


def _taken_for_lengths(mechanism: Mechanism, held: Mapping[str, HeldModel]) -> Iterator[HeldDifference]:
    """Hinges whose coordinates have a range, and nothing in the system's file that tells them from lengths.

    What a velocity term of an angle rounds would condemn a sound engine.
    """
    for joint, coordinate, rotates in zip(mechanism.joints, mechanism.coordinates, mechanism.rotating, strict=True):
        turning = [subject for subject, model in held.items() if joint in model.joints and model.joints[joint].kind == JointKind.HINGE]
        if turning and not rotates:
            statement = f"joint {joint} is a hinge, and the system's file has {coordinate} for a length: name it in angles=({coordinate},)"
            yield _finding(mechanism.name, JOINT, joint, turning, statement)


def judge_differences(
    found: Sequence[HeldDifference | Difference], system: str, expected: Sequence[ExpectedDifference], complete: bool
) -> Iterator[HeldDifference]:
    """The findings of ``find_differences``, those that are expected with their reason.

    ``complete``: all subjects were held against each other, so that an expectation that nothing meets is a finding too.
    """
    left: Mapping[tuple[str, str], ExpectedDifference] = {one.key: one for one in expected}
    met = set()
    for one in found:
        if isinstance(one, HeldDifference):
            yield one
            continue
        others = [subject for group in one.subjects[1:] for subject in group]
        finding = replace(_finding(system, one.quantity, one.joint, others, one.statement), places=one.places)
        known = left.get((one.quantity, one.joint))
        if known is not None:
            met.add(known.key)
        yield replace(finding, reason=f"{known.reason} ({known.link})") if known is not None and one.ulps <= known.ulps else finding
    for key, known in left.items():
        if complete and key not in met:
            owner = f" of {known.joint}" if known.joint else ""
            yield _finding(system, *key, [], f"{known.quantity}{owner} is expected to differ, and is held alike; remove its [[differs]]")


def _finding(system: str, quantity: str, joint: str, subjects: list[str], statement: str) -> HeldDifference:
    return HeldDifference(system=system, quantity=quantity, joint=joint, subjects=subjects, statement=statement, places=[])


def load_expected_differences(library: Library) -> dict[str, list[ExpectedDifference]]:
    """The ``[[differs]]`` tables of a library, by system.

    Raises:
        InvalidInput: the file is malformed, or a table names what does not exist, or what another names.
    """
    path, found = library.expected_verdicts, dict[str, list[ExpectedDifference]]()
    if not path.is_file():
        return found
    known = {"system": library.system_names(), "quantity": [*OF_MODELS, *OF_JOINTS, *OF_BODIES, *OF_SPRINGS]}
    for number, table in enumerate(read_tables(path, TABLES)["differs"], start=1):
        where = f"[[differs]] number {number}"
        try:
            entry = msgspec.convert(table, ExpectedDifference)
        except msgspec.ValidationError as error:
            texts = ", ".join(name for name in ExpectedDifference.__struct_fields__ if name != "ulps")
            raise InvalidInput(path, None, f"{where}: {error}; expected the texts {texts}, and ulps") from error
        for name, values in known.items():
            if (value := getattr(entry, name)) not in values:
                raise InvalidInput(path, None, f"{where} names {name} {value!r}, which does not exist; {nearest(value, values)}")
        if entry.key in [other.key for other in found.get(entry.system, [])]:
            raise InvalidInput(path, None, f"{where} repeats {entry.system}, {entry.quantity} of {entry.joint!r}")
        found.setdefault(entry.system, []).append(entry)
    return found
