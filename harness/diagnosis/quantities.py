"""The causes of records of other quantities than accelerations: the party at fault, the blocks that are wrong, the number that explains.

The same positions are asked for three times, as for terms: at rest, moving, and with applied forces or accelerations given.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.certify.certified import Flags
from harness.certify.compare import errors_in_roundoffs
from harness.certify.sampling import generic_sample
from harness.crosscheck.assignment import Assignment
from harness.crosscheck.quantity_explanation import explain_difference
from harness.crosscheck.settings import Settings
from harness.crosscheck.tasks import Note
from harness.diagnosis.pattern import infer_from_records, subject_named
from harness.diagnosis.terms import AT_REST, LOADED, MOVING
from harness.engines import Subject, subjects
from harness.equations.states import States
from harness.errors import InvalidInput, shown_path
from harness.library import Library
from harness.results.cross_check import Cause
from harness.results.records import Record
from harness.study import Part, Rounds
from harness.verdict import AGREEMENT, Verdict
from harness.workers import Outcome, Task

# Positions at which blocks are compared, each three times, and blocks that are named.
POSITIONS, NAMED = 16, 3
_WRONG = {Verdict.DISAGREES.value, Verdict.ERROR.value}
_ALWAYS = {AT_REST: "at every state", MOVING: "wherever it moves", LOADED: "wherever forces or accelerations are given"}
_SINCE = {AT_REST: "at rest already", MOVING: "once it moves", LOADED: "once forces or accelerations are given"}


class QuantityDiagnoses(Rounds):
    """The causes of the records of one quantity that are wrong and not as expected; a ``harness.study.Study``.

    Args:
        settings: of the cross-check. records: of all its subjects, since the party at fault follows from those that agree.
        crashes: (system, part that died or hung, and would again): a subject, a model's format, or None for the system itself.
    """

    title = "diagnosis"

    def __init__(self, settings: Settings, records: Sequence[Record], *, crashes: Collection[tuple[str, str | None]] = ()) -> None:
        super().__init__()
        self._settings, self._causes = settings, list[Cause]()
        available = [str(subject) for subject in subjects(settings.library)]
        inferences = infer_from_records(records, available, system_of=settings.library.system_of)
        self._wrong: list[tuple[Record, Cause]] = []
        for record in records:
            if record.verdict not in _WRONG or record.as_expected:
                continue
            said = inferences[record.system].sentence
            cause = Cause(system=record.system, subject=record.subject, inference=said, first_line=said)
            died = any((record.system, what) in crashes for what in (record.subject, subject_named(record.subject).format, None))
            if record.failed or died:
                # What failed has nothing to be diagnosed, or would fail again.
                self._causes.append(cause)
            else:
                self._wrong.append((record, cause))
        self.steps = len(self._wrong)

    def rounds(self) -> Iterator[Sequence[Task]]:
        settings = self._settings
        tasks = []
        for record, cause in self._wrong:
            subject = subject_named(record.subject)
            asked = settings.library, record.system, subject, settings.stand_ins.get(subject.format), record.quantity, settings.seed
            tasks.append(Task((self._diagnosed, cause), examine_quantity, asked, record.system))
        yield tasks

    def result(self) -> list[Cause]:
        return sorted(self._causes, key=lambda cause: (cause.system, cause.subject))

    def _diagnosed(self, outcome: Outcome, cause: Cause) -> Iterator[Part]:
        found: QuantityDiagnosis | None = outcome.value
        if found is not None:
            cause = replace(cause, diagnosed=cause.subject, first_line=found.of_file or cause.inference, found=found.as_json())
        elif not isinstance(outcome.exception, InvalidInput):
            # The record's own message has the reason why a model is refused.
            cause = replace(cause, first_line=f"no diagnosis: {outcome.crash or outcome.exception}")
        self._causes.append(cause)
        yield Part(f"{cause.system} {cause.subject}", cause)


@dataclass(frozen=True)
class QuantityDiagnosis:
    """What is wrong with a subject's answers.

    Attributes:
        sentences: one for blocks that are wrong since the same kind of state. file: path of the model; None for a subject without one.
        of_file: the numbers of the file that explain it, or that none does; "" without a file.
    """

    sentences: tuple[str, ...]
    file: Path | None
    of_file: str

    def as_json(self) -> dict[str, Any]:
        """Plain data in the shape of ``harness.diagnosis.causes.SubjectDiagnosis.as_json``."""
        model = None if self.file is None else {"file": str(self.file), "text": [self.of_file]}
        return {"terms": {"sentences": list(self.sentences)}, "model": model, "textbook": None}


def examine_quantity(
    library: Library, name: str, subject: Subject, stand_in: Path | None, quantity: str, seed: int, note: Note
) -> QuantityDiagnosis:
    """Diagnose a subject of a system, with the model that stands in for its own, if any, as a task for ``harness.workers``.

    Raises:
        InvalidInput: the system or its model cannot be used. harness.engines.Unsupported: the engine cannot express it.
    """
    asked = replace(Assignment.of(library, name, subject, stand_in), quantity=quantity)
    note("comparing blocks")
    batches = batches_at(generic_sample(asked.mechanism, POSITIONS, seed))
    states = States.concatenate(list(batches.values()))
    certified, answers = asked.truth.evaluate(states), asked.answers(states)
    errors = np.where(certified.certified[:, None], errors_in_roundoffs(certified, answers), 0.0)
    kinds = np.repeat(list(batches), POSITIONS)
    sentences = tuple(wrong_blocks(asked.truth.blocks, errors, kinds)) or (
        f"{quantity} agrees at the {len(states)} states of the diagnosis",
    )
    if asked.model is None:
        return QuantityDiagnosis(sentences, None, "")
    note("explaining by numbers of the file")
    explained = explain_difference(asked, seed, note)
    file = shown_path(asked.model.path)
    of_file = f"{file}: no single number explains it" if explained is None else f"{file}: {explained.sentence}"
    return QuantityDiagnosis(sentences, asked.model.path, of_file)


def batches_at(states: States) -> dict[str, States]:
    """The positions of ``states`` at rest, at their velocities, and with what is given besides."""
    still = np.zeros_like(states.v)
    at_rest, moving = (States(states.q, v, still, states.time) for v in (still, states.v))
    return {AT_REST: at_rest, MOVING: moving, LOADED: states}


def wrong_blocks(blocks: Sequence[str], errors: Array, kinds: Array) -> Iterator[str]:
    """A sentence for the blocks that are wrong since the same kind of state, and as often; ``errors`` are (n, blocks) [data roundoffs].

    ``kinds``, (n,), are kinds of states, in order. NaN counts as wrong.
    """
    wrong = ~(errors <= AGREEMENT)
    alike: dict[tuple[str, bool], list[int]] = {}
    for block in np.flatnonzero(wrong.any(axis=0)).tolist():
        since = str(kinds[np.argmax(wrong[:, block])])
        later: Flags = wrong[int(np.argmax(kinds == since)) :, block]
        alike.setdefault((since, bool(later.all())), []).append(block)
    for (since, always), found in sorted(alike.items(), key=lambda item: list(_SINCE).index(item[0][0])):
        largest = np.nan_to_num(errors[:, found], nan=np.inf, posinf=np.inf).max(axis=0)
        worst = [blocks[found[place]] for place in np.argsort(-largest, kind="stable")]
        more = f" and {len(worst) - NAMED} more" if len(worst) > NAMED else ""
        size = f"{largest.max():.3g} data roundoffs" if np.isfinite(largest.max()) else "not finite"
        when = _ALWAYS[since] if always else f"at some states, {_SINCE[since]}"
        yield f"{', '.join(worst[:NAMED])}{more} {'are' if len(worst) > 1 else 'is'} wrong {when}; {size}"
