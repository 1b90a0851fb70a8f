"""The fault campaign: mistakes are made in sound models, unknown to the check and the diagnosis.

Every kind of mistake is made at every place where it applies: each number of a file is changed in sizes from
``SIZES``, each declared mistake is planted wherever it can be made. A mistake that moves no acceleration is none. Of the
others it is recorded whether they are caught, by a refusal or by the states of a check, whom the pattern of agreement
blames, and, for as many as are asked for, what the diagnosis names.

Source: DeMillo, Lipton, Sayward, Hints on test data selection, IEEE Computer 11(4), 1978 (mutation testing).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

from harness.crosscheck.examination import CHANGE
from harness.diagnosis.faults.bench import REFUSED, Answer, FaultBench
from harness.diagnosis.faults.reader import MOST_ABOVE_THEORY, RED
from harness.diagnosis.faults.summary import Fault, SmallestChange
from harness.engines import Subject, Unsupported
from harness.errors import InvalidModel
from harness.explain.changes import NUMBER, Change
from harness.explain.changes.mistakes import find_mistakes
from harness.explain.changes.numbers import numeric_changes
from harness.explain.columns import watch
from harness.explain.model_side import diagnose
from harness.explain.result import TriedChange
from harness.explain.search import EVALUATIONS, Limits
from harness.files.model_file import ModelFile
from harness.files.text.scan import TextPlace
from harness.library import Library

SIZES = tuple(float(f"1e{power}") for power in range(-12, 1))
# Relative size from which on a fault of a live number must be caught, where theory allows.
MUST_BE_CAUGHT = 1e-9
# A mended number is right up to this relative error, or where it leaves no more than so many data roundoffs.
RIGHT_VALUE, RIGHT_ROUNDOFFS = 1e-6, 3.0


@dataclass(frozen=True, kw_only=True)
class CampaignSettings:
    """The faults to plant and the limits of their diagnosis.

    Attributes:
        kinds: as of ``kinds_of_faults``; all for none. sizes: of changed numbers, relative.
        states: sampled states of a check; seed: of them.
        diagnosed: most faults of each kind in each model that are diagnosed, spread evenly; None for all.
        evaluations: of changed models that a diagnosis may take.
    """

    kinds: Sequence[str] = ()
    sizes: Sequence[float] = SIZES
    states: int = 1000
    seed: int = 0
    diagnosed: int | None = None
    evaluations: int = EVALUATIONS


def kinds_of_faults() -> dict[str, str]:
    """Name to title of every kind that can be planted."""
    return {NUMBER: "one number changed", **{mistake.name: mistake.title for mistake in find_mistakes()}}


def number_faults(model: ModelFile) -> Iterator[Change]:
    """Every number of a model changed relatively, and zeros by as much of what is natural there.

    A number that comes a second time, together with its neighbours, does so for where it cannot change alone.
    """
    alone: dict[TextPlace, Change] = {}
    for number in numeric_changes(model):

        def at(size: float, number: Change = number, start: float = number.start or 0.0) -> str:
            return number.text(start + size * (start or number.scale))

        planted = replace(number, text=at, start=0.0)
        if number.place not in alone:
            alone[number.place] = planted
            yield planted
        elif not any(is_valid(model, alone[number.place].text(size)) for size in (CHANGE, -CHANGE)):
            yield planted


class ModelCampaign:
    """The faults of one model of one system; raises as ``harness.diagnosis.faults.bench.FaultBench``."""

    def __init__(self, library: Library, name: str, model_format: str, settings: CampaignSettings) -> None:
        self.name, self.settings = name, settings
        self.bench = FaultBench(library, name, model_format, settings.states, settings.seed)
        self.model = self.bench.model
        self._mistakes = {mistake.name: mistake for mistake in find_mistakes()}

    def faults(self, note: Callable[[str], None]) -> Iterator[Fault]:
        """Every mistake of the kinds asked for, kind by kind, in the order of the file."""
        plants = {NUMBER: number_faults, **{name: mistake.plant for name, mistake in self._mistakes.items()}}
        for kind in self.settings.kinds or plants:
            planted, found = list(plants[kind](self.model)), []
            for one in planted:
                note(f"{self.model.path}: {kind}: {one.statement} {one.places[0]}")
                found.append(self._caught(one))
            answered = [place for place, fault in enumerate(found) if fault.live and fault.caught_by in ("check", "audit")]
            chosen = {answered[place] for place in spread_evenly(len(answered), self.settings.diagnosed)}
            # A party that is blamed wrongly is cleared by a diagnosis that explains its answers.
            chosen |= {place for place in answered if found[place].blamed}
            for place, (one, fault) in enumerate(zip(planted, found, strict=True)):
                note(f"{self.model.path}: diagnosis of {kind}: {one.statement} {one.places[0]}")
                yield self._diagnosed(fault, one, place) if place in chosen else fault

    def _caught(self, planted: Change) -> Fault:
        where = tuple(dict.fromkeys(place.key for place in planted.places))
        # Of a kind that a diagnosis looks for.
        known = planted.kind == NUMBER or self._mistakes[planted.kind].changes is not None
        about: dict[str, Any] = {"system": self.name, "format": self.model.format, "kind": planted.kind}
        about |= {
            "statement": planted.statement,
            "where": where,
            "known": known,
            "sizes": tuple(self.settings.sizes if planted.is_sized else ()),
        }
        probe, _ = self.bench.ask_sized(planted, CHANGE if planted.is_sized else 1.0)
        fault = Fault(**about, live=probe.is_live)
        if not planted.is_sized or probe.refused_by in REFUSED:
            # Where physics forbids a number to change alone, the refusal names it.
            return replace(fault, caught_by=probe.caught_by, blamed=self.bench.blamed(probe), **self._refusal(probe, where))
        if not fault.live:
            return fault
        smallest, theory, order = self.bench.smallest(planted)
        answers = {size: self.bench.ask_sized(planted, size)[0] for size in fault.sizes}
        must = [size for size in fault.sizes if size >= _least(theory)]
        blamed_at = next((size for size in must if self.bench.blamed(answers[size])), None)
        return replace(
            fault,
            missed=tuple(size for size in must if not answers[size].caught_by),
            caught_by=next((answer.caught_by for answer in answers.values() if answer.caught_by), ""),
            smallest=smallest,
            theory=theory,
            order=order,
            blamed="" if blamed_at is None else self.bench.blamed(answers[blamed_at]),
            blamed_at=blamed_at,
        )

    def _refusal(self, answer: Answer, where: Sequence[tuple[int, str, str]]) -> dict[str, Any]:
        """The result of a refusal: it names the mistake if it names one of its lines."""
        named = answer.line is not None and answer.line in {line for line, _, _ in where} and answer.line != self.model.root_line
        return {"named": named, "in_class": named, "answer": answer.refusal} if answer.refused_by else {}

    def _diagnosed(self, fault: Fault, planted: Change, place: int) -> Fault:
        size = self._size_to_diagnose(fault, place) if planted.is_sized else 1.0
        answer, size = self.bench.ask_sized(planted, size)
        text = planted.text(size)
        red = [one for one in self.bench.readers if answer.verdicts.get(str(one.subject), RED[0]) in RED]
        # A reader that loses digits at every state of a diagnosis cannot be diagnosed.
        red = [one for one in red if len(self.bench.diagnostic(one)[0])]
        if not red or answer.refused_by in REFUSED:
            return fault
        # The engine whose own format this is, first: what others make of it is partly the harness's.
        one = min(red, key=lambda one: one.engine.formats[0] != self.model.format)
        started = time.perf_counter()
        try:
            wrong = self.model.with_text(text)
            states, reference = self.bench.diagnostic(one)
            engine = planted.through(one.engine) if planted.through else one.engine
            watched = watch(engine, self.bench.mechanism, wrong, states)
        except (Unsupported, ValueError):
            return fault
        diagnosis = diagnose(watched, reference, Limits(self.settings.evaluations))
        seconds = time.perf_counter() - started
        where = set(fault.where)
        explained = bool(diagnosis.explaining)
        named = explained and diagnosis.tried[0].place.key in where
        return replace(
            fault,
            # A mistake that others do not feel makes one reader wrong alone; a change of the file that explains it clears the reader.
            blamed="" if explained else fault.blamed,
            cleared=fault.blamed if explained else "",
            diagnosed=size,
            named=named,
            in_class=any(one.place.key in where for one in diagnosis.explaining),
            explained=explained,
            right_value=self._is_right(diagnosis.tried[0], planted) if named else None,
            stopped=diagnosis.stopped,
            answer=diagnosis.first_line,
            seconds=seconds,
        )

    def _is_right(self, first: TriedChange, planted: Change) -> bool:
        """True where a mend gives the number that stood there, or what moves accelerations no more than rounding does."""
        if first.residual <= RIGHT_ROUNDOFFS:
            return True
        true = [
            place.found for place in planted.places if planted.is_sized and (place.key, place.index) == (first.place.key, first.place.index)
        ]
        return bool(true) and first.value is not None and abs(first.value - float(true[0])) <= RIGHT_VALUE * abs(float(true[0]))

    def _size_to_diagnose(self, fault: Fault, place: int) -> float:
        """Sizes are dealt out in turn among those that must be caught."""
        if fault.blamed_at is not None:
            return fault.blamed_at
        sizes = [size for size in fault.sizes if size >= _least(fault.theory)] or [max(fault.sizes)]
        return sizes[place % len(sizes)]


def _least(theory: float | None) -> float:
    """The size from which on a fault must be caught: of a number that is felt little, or by its square, theory promises less."""
    return MUST_BE_CAUGHT if theory is None else max(MUST_BE_CAUGHT, MOST_ABOVE_THEORY * theory)


def is_valid(model: ModelFile, text: str) -> bool:
    try:
        model.with_text(text)
    except InvalidModel:
        return False
    return True


def spread_evenly(count: int, most: int | None) -> set[int]:
    """At most ``most`` of ``count`` places, evenly apart."""
    if most is None or most >= count:
        return set(range(count))
    return {(2 * place + 1) * count // (2 * most) for place in range(most)}


def run_campaign(library: Library, name: str, model_format: str, settings: CampaignSettings, note: Callable[[str], None]) -> list[Fault]:
    """Every fault of one model, as a task for ``harness.workers``."""
    return list(ModelCampaign(library, name, model_format, settings).faults(note))


def smallest_changes(
    library: Library, name: str, subject: Subject, states: int, seed: int, note: Callable[[str], None]
) -> list[SmallestChange]:
    """Every number other than 0 of one model, in the order of the file, as a task for ``harness.workers``; raises as ``FaultBench``."""
    bench = FaultBench(library, name, subject.format, states, seed, [str(subject)])
    found = []
    for planted in number_faults(bench.model):
        place = planted.places[0]
        value = float(place.found)
        answer, _ = bench.ask_sized(planted, CHANGE)
        if not value or answer.refused_by in REFUSED or not answer.is_live:
            continue
        smallest, theory, _ = bench.smallest(planted)
        about = {"system": name, "subject": str(subject), "file": bench.model.path.name}
        found.append(SmallestChange(**about, place=place, statement=planted.statement, value=value, smallest=smallest, theory=theory))
    return found
