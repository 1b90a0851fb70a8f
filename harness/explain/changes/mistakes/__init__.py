"""The mistakes that a model may have, each a ``Mistake`` declared in a module of this package.

A declaration mends and plants: diagnosis tries every change that would undo the mistake, wherever it could have been made; the
fault campaign makes it wherever it can be made. Most mistakes are undone by a mistake of the same kind: what is exchanged is
exchanged back, what is doubled is halved. Then one list of changes serves both. No engine is imported here: what a change does
to accelerations is found by ``harness.files.text.scan.Watch``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from decimal import Context, Decimal

from harness.explain.changes import Change
from harness.files.model_file import ModelFile
from harness.files.text.anatomy import anatomy
from harness.files.text.scan import TextPlace, edited
from harness.files.text.slots import Anatomy, Slot, Words
from harness.registry import declared

# A slot with its new words, None where it goes.
Write = tuple[Slot, Words | None]
Writes = Sequence[Write]

COMPONENTS = "xyz"
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
    """Slots and what to write into them at a value, of a natural size ``scale``; at 0 the file is as it is."""

    statement: str
    writes: Callable[[float], Writes]
    scale: float


Rewrites = Callable[[Anatomy], Iterable[FixedChange]]


@dataclass(frozen=True)
class Mistake:
    """One kind of mistake.

    Attributes:
        name: for the command line and the report. title: what people call the mistake. source: where it is known from.
        changes, free: what would undo it, without and with a free value; none where every model that has the mistake is refused
            by name before a diagnosis. ``changes`` is None for a mistake that no diagnosis looks for: it must be caught, and the
            diagnosis should say that no single change explains it.
        plants: the ways to make it in a sound model; None where they are ``changes``.
    """

    name: str
    title: str
    source: str
    changes: Rewrites | None
    free: Callable[[Anatomy], Iterable[FreeChange]] = lambda parts: ()
    plants: Callable[[Anatomy], Iterable[FixedChange | Change]] | None = None

    def mend(self, model: ModelFile) -> Iterator[Change]:
        """The changes of a model that would undo the mistake."""
        parts, text = anatomy(model), model.text
        for change, after in _effective(text, self.changes(parts) if self.changes else ()):
            yield Change(self.name, change.statement, (_found(*change.writes[0]),), lambda value, after=after: after)  # type: ignore[misc]
        yield from (_with_value(self.name, text, unknown) for unknown in self.free(parts))

    def plant(self, model: ModelFile) -> Iterator[Change]:
        """The mistakes that can be made in a model."""
        kinds = self.plants or self.changes
        assert kinds is not None
        declared = list(kinds(anatomy(model)))
        yield from (change for change in declared if isinstance(change, Change))
        for change, after in _effective(model.text, (change for change in declared if isinstance(change, FixedChange))):
            places = [*(_made(slot, words) for slot, words in change.writes), *(slot.place for slot in change.forgotten)]
            yield Change(self.name, change.statement, tuple(places), lambda size, after=after: after)  # type: ignore[misc]


def find_mistakes() -> list[Mistake]:
    """Every kind of mistake that a module of this package holds, those first that a diagnosis looks for, sorted by name."""
    return sorted(declared(__name__, Mistake, "kind of mistake").values(), key=lambda mistake: (mistake.changes is None, mistake.name))


def mended_mistakes() -> list[Mistake]:
    """Those that a diagnosis looks for."""
    return [mistake for mistake in find_mistakes() if mistake.changes is not None]


def _after(text: str, writes: Writes) -> str:
    return edited(text, [edit for slot, words in writes for edit in (slot.gone(text) if words is None else slot.written(words))])


def _effective(text: str, changes: Iterable[FixedChange]) -> Iterator[tuple[FixedChange, str]]:
    """Those that change some number or word, and the text after each; each text once."""
    seen = {text}
    for change in changes:
        effective = [(slot, words) for slot, words in change.writes if not _same(slot, words)]
        after = _after(text, effective)
        if after not in seen:
            seen.add(after)
            yield replace(change, writes=effective), after


def _same(slot: Slot, words: Words | None) -> bool:
    if words is None:
        return slot.absent
    return not slot.renamed and list(map(_value, slot.words)) == list(map(_value, words))


def _value(word: str) -> float | str:
    """A number, or the word itself."""
    try:
        return float(word)
    except ValueError:
        return word


def _with_value(name: str, text: str, change: FreeChange) -> Change:
    def at(value: float) -> str:
        return text if value == 0.0 else _after(text, change.writes(value))

    # Asked away from zero, for there it may leave the file as it is.
    return Change(name, change.statement, (_found(*change.writes(change.scale)[0]),), at, 0.0, change.scale)


def _found(slot: Slot, words: Words | None) -> TextPlace:
    """The place that a mend changes, in lines of the text as it is: one number of the attribute where no other changes."""
    place = slot.place
    if words is None or slot.absent or slot.renamed or len(words) != len(slot.words) or len(words) == 1:
        return place
    changed = [index for index, (old, new) in enumerate(zip(slot.words, words, strict=True)) if old != new]
    return TextPlace(place.line, place.element, place.attribute, changed[0], slot.words[changed[0]]) if len(changed) == 1 else place


def _made(slot: Slot, words: Words | None) -> TextPlace:
    """The place of a mistake in the text that has it."""
    place = slot.place
    if words is None:
        return TextPlace(slot.absent_line, place.element, place.attribute, None, "")
    return TextPlace(slot.inserted_line, place.element, slot.renamed or place.attribute, None, " ".join(words))


def times(words: Words, factor: str) -> list[str]:
    """Numbers times a factor, exactly as decimals."""
    return [str(_EXACT.multiply(Decimal(word), Decimal(factor))) for word in words]


def plus(words: Words, others: Words, sign: int = 1) -> list[str]:
    """The sums of two vectors, or the differences, exactly as decimals."""
    return [str(_EXACT.add(Decimal(word), sign * Decimal(other))) for word, other in zip(words, others, strict=True)]


def along(axis: int, word: str) -> list[str]:
    """A vector of one component."""
    return [word if place == axis else "0" for place in range(3)]


def exchanged(words: Words, first: int, second: int) -> list[str]:
    """The words, two of them in each other's place."""
    order = {first: second, second: first}
    return [words[order.get(place, place)] for place in range(len(words))]


def is_zero(words: Words) -> bool:
    return not any(float(word) for word in words)
