"""The conclusion of a cross-check in a sentence, and the records that a person reads first; the same for every medium."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, TypeVar

from harness.results.detail import Detail
from harness.results.readings import by_effect, names_of
from harness.results.records import Record, Records
from harness.results.table import counted, grouped, joined, plural
from harness.verdict import DEPARTS, SOFT, SOUND, Verdict

if TYPE_CHECKING:
    from harness.results.cross_check import Cause
    from harness.results.engine_lines import EngineOutcome

_Named = TypeVar("_Named", Record, "Cause")
# Of more records those that agree are counted, and not shown one by one.
MOST_ROWS = 30
# Of those that are not as expected; of more the first are.
_MOST_NAMED = 3


def conclusion(records: Sequence[Record]) -> str:
    """Numbers of answers that agree, differ for a known reason, and differ unexpectedly; or why nothing was compared.

    What no engine offers is not counted.
    """
    asked = [one for one in records if one.is_asked]
    if not was_compared(records):
        return _nothing(records)
    systems = {one.system for one in asked}
    kind = "answer" if any(one.is_further for one in asked) else "pair" if len(systems) > 1 else "subject"
    head = f"{asked[0].system}: " if len(systems) == 1 else ""
    agreeing, wrong = [one for one in asked if one.verdict == Verdict.AGREES and one.as_expected], Records(asked).unexpected
    soft = sum(one.outcome == SOFT for one in agreeing)
    softly = f" ({soft} {SOFT})" if soft else ""
    silent = len(records) - len(asked)
    rest = f"; {counted(silent, 'further one')} {plural(silent, 'is', 'are')} not offered" if silent else ""
    if len(agreeing) == len(asked):
        all_of_them = "both" if len(asked) == 2 else f"all {len(asked)}"
        every = f"{all_of_them} {kind}s agree" if len(asked) > 1 else f"{_name(asked[0], head)} agrees"
        return f"{head}{every}{softly}{rest}"
    answered = [one for one in asked if one.verdict in SOUND and one.as_expected and one not in agreeing]
    # An answer that is explained by no reading is that of a solver that stops early.
    stopping = [one for one in answered if one.verdict == Verdict.EXPLAINED and not one.readings]
    departing = [one for one in answered if one.outcome == DEPARTS]
    explained = [one for one in answered if one not in stopping and one not in departing]
    known = len(asked) - len(agreeing) - len(answered) - len(wrong)
    parts = [f"{len(agreeing) or 'none'} {plural(len(agreeing) or 1, 'agrees', 'agree')}{softly}"]
    parts += [f"{len(explained)} {plural(len(explained), 'is', 'are')} explained by how the engine reads the file"] if explained else []
    parts += [f"{len(departing)} {plural(len(departing), 'departs', 'depart')} from the engine's documentation"] if departing else []
    stops = f"{len(stopping)} {plural(len(stopping), 'stops', 'stop')} before the solution that the engine documents"
    parts += [stops] if stopping else []
    parts += [f"{known} {plural(known, 'differs', 'differ')} for a known reason"] if known else []
    unexpected = f"{len(wrong)} {'' if known else plural(len(wrong), 'differs ', 'differ ')}unexpectedly"
    parts += [unexpected] if known or wrong else []
    return f"{head}{counted(len(asked), kind)}: {', '.join(parts)}{rest}{_named(wrong, head)}{_read(answered)}"


def with_short_names(named: Iterable[_Named]) -> list[_Named]:
    """Records, or causes, of files under the shortest names that tell these apart; what repeats them has the whole path."""
    known = list(named)
    if not any("/" in one.system for one in known):
        return known
    from harness.results.comparison import names_apart

    names = names_apart(one.system for one in known)
    return [replace(one, system=names[one.system]) for one in known]


def was_compared(records: Iterable[Record]) -> bool:
    """True where somebody answered, or failed to."""
    return any(one.states or not one.as_expected for one in records)


def first_rows(records: Sequence[Record], detail: Detail) -> Records:
    """All records where they are few or all is asked for; else those that are not plain agreement."""
    if len(records) <= MOST_ROWS or detail >= Detail.ALL:
        return Records(records)
    return Records(one for one in records if one.is_asked and not (one.verdict == Verdict.AGREES and one.as_expected))


def engine_lines(records: Iterable[Record]) -> list[str]:
    """A line for each engine: what it is right on, and what not."""
    from harness.results.engine_lines import engine_line

    answers = grouped((one.subject.partition("/")[0], _answer(one)) for one in records if one.is_asked)
    return [f"{engine}: {engine_line(own)}" for engine, own in sorted(answers.items())]


def _answer(record: Record) -> EngineOutcome:
    from harness.results.engine_lines import EngineOutcome

    return EngineOutcome(
        name=record.system if not record.is_further else f"{record.quantity} of {record.system}",
        format=record.subject.partition("/")[2],
        outcome=record.outcome if record.outcome == DEPARTS else record.verdict,
        readings=names_of(record.readings),
        features=record.features,
        from_rigid=record.from_rigid,
    )


def _name(record: Record, head: str) -> str:
    """A record by what its head leaves open."""
    return record.series if head else record.title


def _named(wrong: Sequence[Record], head: str) -> str:
    # A file that no engine can be asked with is no engine's fault, and is said once.
    refused = [one for one in wrong if one.verdict == _REFUSED and not one.failed and one.message]
    others = [one for one in wrong if one not in refused]
    named = [f"{_name(one, head)} {_SAID.get(one.verdict, f'is {one.verdict}')}" for one in others[:_MOST_NAMED]]
    more = [f"{len(others) - _MOST_NAMED} more"] if len(others) > _MOST_NAMED else []
    whys = grouped((one.message.partition("\n")[0], _name(one, head)) for one in refused)
    told = [f"{joined(own)} {plural(len(own), 'is', 'are')} not asked, {message}" for message, own in list(whys.items())[:_MOST_NAMED]]
    said = "; ".join(filter(None, [", ".join([*named, *more]), *told]))
    return f": {said}" if said else ""


_REFUSED = Verdict.ERROR.value
_SAID = {
    Verdict.AGREES.value: "agrees",
    Verdict.DISAGREES.value: "disagrees",
    Verdict.MISREADS.value: "misreads it",
    _REFUSED: "gives no answer",
}


def _read(explained: Sequence[Record]) -> str:
    """The readings that move the accelerations of each subject most, with their effects and what its user can do."""
    if not explained:
        return ""
    from harness.results.conclusion import reasons_text

    largest = [reading for one in explained for reading in by_effect(one.readings)[:1]]
    stopping = dict.fromkeys(one.message.partition(". ")[0].removesuffix(".") for one in explained if not one.readings and one.message)
    return "".join(f". {sentence}" for sentence in [*reasons_text(largest), *stopping])


def worlds_text(records: Iterable[Record]) -> str:
    """A clause on how many answer alike in equal worlds, and who does not; "" where nobody was asked."""
    asked = {one.title: one.unequal_worlds for one in records if one.unequal_worlds is not None}
    unequal = [f"{title} by {size:.2g} of its answer" for title, size in asked.items() if size]
    if not unequal:
        of_all = f" in all {len(asked)}" if len(asked) > 1 else ""
        return f"equal worlds answer with the same bits{of_all}" if asked else ""
    more = len(unequal) - _MOST_NAMED
    named = joined([*unequal[:_MOST_NAMED], *([f"{more} more"] if more > 0 else [])])
    return f"equal worlds differ in {len(unequal)} of {len(asked)}: {named}"


def _nothing(records: Sequence[Record]) -> str:
    whys = list(dict.fromkeys(f"{one.title}: {one.message or one.verdict}" for one in records))
    more = f", and {len(whys) - 1} more" if len(whys) > 1 else ""
    why = f": {whys[0]}{more}" if whys else ""
    return f"nothing was compared{why}; name another subject or quantity"
