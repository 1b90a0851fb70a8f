"""The blocks of another quantity than accelerations that are wrong, and the number of the file that explains it.

The same positions are asked for three times, as for terms: at rest, moving, and with applied forces or accelerations given.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.certify.certified import Flags
from harness.certify.compare import errors_in_roundoffs
from harness.certify.sampling import generic_sample
from harness.crosscheck.assignment import Assignment
from harness.crosscheck.explanation import explain_difference
from harness.crosscheck.tasks import Note
from harness.diagnosis.terms import AT_REST, LOADED, MOVING
from harness.equations.states import States
from harness.errors import shown_path
from harness.verdict import AGREEMENT

# Positions at which blocks are compared, each three times, and blocks that are named.
POSITIONS, NAMED = 16, 3
_ALWAYS = {AT_REST: "at every state", MOVING: "wherever it moves", LOADED: "wherever forces or accelerations are given"}
_SINCE = {AT_REST: "at rest already", MOVING: "once it moves", LOADED: "once forces or accelerations are given"}


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

    def first_line(self, suspects_textbook: bool = False) -> str:
        """Of the file; there is no diagnosis of the textbook's side."""
        return self.of_file

    def as_json(self) -> dict[str, Any]:
        """Plain data in the shape of ``harness.diagnosis.subject.SubjectDiagnosis.as_json``."""
        model = None if self.file is None else {"file": str(self.file), "text": [self.of_file]}
        return {"terms": {"sentences": list(self.sentences)}, "model": model, "textbook": None}


def diagnose_blocks(asked: Assignment, seed: int, note: Note) -> QuantityDiagnosis:
    """Diagnose a subject by the blocks of a quantity, and the numbers of its file.

    Raises:
        InvalidModel: a file is no truth, or the engine refuses it. harness.engines.Unsupported: the engine cannot express it.
    """
    note("comparing blocks")
    batches = batches_at(generic_sample(asked.mechanism, POSITIONS, seed))
    states = States.concatenate(list(batches.values()))
    certified, answers = asked.truth.evaluate(states), asked.answers(states)
    errors = np.where(certified.certified[:, None], errors_in_roundoffs(certified, answers), 0.0)
    kinds = np.repeat(list(batches), POSITIONS)
    sentences = tuple(wrong_blocks(asked.truth.blocks, errors, kinds)) or (
        f"{asked.quantity} agrees at the {len(states)} states of the diagnosis",
    )
    if asked.model is None:
        return QuantityDiagnosis(sentences, None, "")
    note("explaining by numbers of the file")
    explained = explain_difference(asked, seed) or "no single number explains it"
    of_file = f"{shown_path(asked.model.path)}: {explained}"
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
