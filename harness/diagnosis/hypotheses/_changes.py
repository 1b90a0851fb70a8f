"""Changes of slots, and hypotheses made of them.

Most mistakes are undone by a mistake of the same kind: what is exchanged is exchanged back, what is doubled is halved.
Then one list of changes serves both to mend and to plant.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from decimal import Context, Decimal

from harness.diagnosis.hypotheses import Candidate, Hypothesis, Planted
from harness.models.anatomy import anatomy
from harness.models.anatomy.parts import Anatomy, Edit, Slot, Words, edited
from harness.models.model_file import ModelFile
from harness.models.text import Place

# A slot with its new words, None where it goes.
Write = tuple[Slot, Words | None]
Writes = Sequence[Write]

# More digits than any product of two numbers of a file has.
_EXACT = Context(prec=60)


@dataclass(frozen=True)
class FixedChange:
    """Slots and what to write into them; ``statement`` says what it does, for a mend and for a mistake alike.

    ``forgotten``: slots that a mistake leaves as they are, and that are wrong beside what it writes.
    """

    statement: str
    writes: Writes
    forgotten: Sequence[Slot] = ()


@dataclass(frozen=True)
class FreeChange:
    """Slots and what to write into them at a value; ``start`` and ``scale`` are those of a ``Candidate``."""

    statement: str
    writes: Callable[[float], Writes]
    scale: float
    start: float = 0.0


Changes = Callable[[Anatomy], Iterable[FixedChange]]
FreeChanges = Callable[[Anatomy], Iterable[FreeChange]]


def hypothesis(
    name: str, title: str, source: str, changes: Changes, free: FreeChanges = lambda parts: (), plants: Changes | None = None
) -> Hypothesis:
    """The hypothesis whose mends are ``changes`` and ``free``, and whose mistakes are ``plants``, by default ``changes``."""

    def mend(model: ModelFile) -> Iterator[Candidate]:
        parts = anatomy(model)
        for change in _effective(model.text, changes(parts)):
            yield _candidate(name, model.text, change)
        for unknown in free(parts):
            yield _free_candidate(name, model.text, unknown)

    def plant(model: ModelFile) -> Iterator[Planted]:
        for change in _effective(model.text, (plants or changes)(anatomy(model))):
            yield _planted(name, model.text, change)

    return Hypothesis(name, title, mend, plant, source)


def _edits(text: str, writes: Writes) -> list[Edit]:
    return [edit for slot, words in writes for edit in (slot.gone(text) if words is None else slot.written(words))]


def _effective(text: str, changes: Iterable[FixedChange]) -> Iterator[FixedChange]:
    """Those that change some number or word, each text once."""
    seen = {text}
    for change in changes:
        effective = [(slot, words) for slot, words in change.writes if not _same(slot, words)]
        after = edited(text, _edits(text, effective))
        if after not in seen:
            seen.add(after)
            yield replace(change, writes=effective)


def _same(slot: Slot, words: Words | None) -> bool:
    if words is None:
        return slot.absent
    return not slot.renamed and _values(slot.words) == _values(words)


def _values(words: Words) -> list[float | str]:
    return [float(word) if _is_number(word) else word for word in words]


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _candidate(name: str, text: str, change: FixedChange) -> Candidate:
    edits = _edits(text, change.writes)
    return Candidate(name, change.statement, _first_place(change.writes), lambda value: edited(text, edits))


def _free_candidate(name: str, text: str, change: FreeChange) -> Candidate:
    def at(value: float) -> str:
        return text if value == change.start else edited(text, _edits(text, change.writes(value)))

    # Asked away from its start, for there it may leave the file as it is.
    place = _first_place(change.writes(change.start + change.scale))
    return Candidate(name, change.statement, place, at, change.start, change.scale)


def _first_place(writes: Writes) -> Place:
    return _found(*writes[0])


def _found(slot: Slot, words: Words | None) -> Place:
    """The place that a mend changes, in lines of the text as it is: one number of the attribute where no other changes."""
    place = slot.place
    if words is None or slot.absent or slot.renamed or len(words) != len(slot.words) or len(words) == 1:
        return place
    changed = [index for index, (old, new) in enumerate(zip(slot.words, words, strict=True)) if old != new]
    return Place(place.line, place.element, place.attribute, changed[0], slot.words[changed[0]]) if len(changed) == 1 else place


def _planted(name: str, text: str, change: FixedChange) -> Planted:
    after = edited(text, _edits(text, change.writes))
    places = [_made(slot, words) for slot, words in change.writes] + [slot.place for slot in change.forgotten]
    return Planted(name, change.statement, tuple(places), lambda size: after)


def _made(slot: Slot, words: Words | None) -> Place:
    """The place of a mistake in the text that has it."""
    place = slot.place
    if words is None:
        return Place(slot.absent_line, place.element, place.attribute, None, "")
    return Place(slot.inserted_line, place.element, slot.renamed or place.attribute, None, " ".join(words))


def times(words: Words, factor: str | Decimal) -> list[str]:
    """Numbers times a factor, exactly as decimals."""
    return [str(_EXACT.multiply(Decimal(word), Decimal(factor))) for word in words]


def divided(words: Words, divisor: str | Decimal) -> list[str]:
    """Numbers divided, exactly where the quotient has an end."""
    return [str(_EXACT.divide(Decimal(word), Decimal(divisor))) for word in words]


def plus(words: Words, others: Words, sign: int = 1) -> list[str]:
    """The sums of two vectors, or the differences, exactly as decimals."""
    return [str(_EXACT.add(Decimal(word), sign * Decimal(other))) for word, other in zip(words, others, strict=True)]


def is_zero(words: Words) -> bool:
    return not any(float(word) for word in words)


def rounded(value: float) -> str:
    """A value to one digit, for what a mistake may leave in a file."""
    return repr(float(f"{value:.1g}")) if value and math.isfinite(value) else "0"
