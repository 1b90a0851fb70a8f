"""The party at fault, inferred from the subjects of one system that agree with the reference and those that do not.

Each party that can be at fault makes certain subjects wrong and no others. A party is blamed where these are the wrong ones
exactly, among the subjects that were judged. Subjects without an answer abstain: ``undecided`` and ``unsupported`` ones, and
``unstable`` ones, which lost digits and show nothing of a model.

Source: Reiter, A theory of diagnosis from first principles, Artificial Intelligence 32 (1987), for a single fault.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass

from harness.engines import EQUATIONS, Subject
from harness.results.records import Record
from harness.verdict import Verdict

NOTHING, UNDECIDED = "nothing", "undecided"
_WRONG = {Verdict.DISAGREES.value, Verdict.ERROR.value}


@dataclass(frozen=True)
class Inference:
    """The conclusion from the pattern of agreement.

    Attributes:
        party: "nothing", "model FORMAT", "engine NAME", "reader ENGINE/FORMAT", "equations", "kernel", "system" or "undecided".
        sentence: the same for people, with the subjects that it rests on.
        ask: subjects that would decide, where the party is undecided and there are such.
    """

    party: str
    sentence: str
    ask: tuple[str, ...] = ()


@dataclass(frozen=True)
class Rule:
    """One kind of party.

    Attributes:
        party: its name, after the engine and format of a wrong subject.
        spoils: true where the party that is named after the first subject makes the second wrong.
        sentence: the conclusion, after ``right`` and ``wrong`` subjects.
        part_of: a wider party, which is named in its stead where they make the same subjects wrong.
    """

    party: str
    spoils: Callable[[Subject, Subject], bool]
    sentence: str
    part_of: str = ""


def _reads(subject: Subject) -> bool:
    return subject.format != EQUATIONS


RULES = (
    Rule(
        "model {format}",
        lambda one, other: _reads(one) and other.format == one.format,
        "the {format} model is at fault: every engine that reads it is wrong ({wrong}), and right with another file ({right})",
    ),
    Rule(
        "engine {engine}",
        lambda one, other: _reads(one) and _reads(other) and other.engine == one.engine,
        "{engine} is at fault: it is wrong with every format that it was judged with ({wrong}); right are {right}",
    ),
    Rule(
        "reader {engine}/{format}",
        lambda one, other: _reads(one) and other == one,
        "what {engine} makes of {format} is at fault, its reader or what the harness supplies for it: "
        "it alone is wrong ({wrong}); right are {right}",
        part_of="engine {engine}",
    ),
    Rule(
        "equations",
        lambda one, other: _reads(one) and _reads(other),
        "the equations are at fault, or all models share one mistake: every engine is wrong ({wrong})",
    ),
    Rule(
        "kernel",
        lambda one, other: not _reads(one) and other == one,
        "the float64 kernel of {engine} is at fault: it is given the equations themselves, and no model; right are {right}",
    ),
)


@dataclass(frozen=True)
class _Party:
    name: str
    sentence: str
    spoiled: frozenset[Subject]


def infer(verdicts: Mapping[str, str], available: Collection[str] | None = None) -> Inference:
    """The party at fault, from the verdict of each subject by its name.

    ``available`` are all subjects there are; by default every engine of ``verdicts`` with every format of them.
    """
    given = {subject_named(name): verdict for name, verdict in verdicts.items()}
    wrong = {subject for subject, verdict in given.items() if verdict in _WRONG}
    right = {subject for subject, verdict in given.items() if verdict == Verdict.AGREES}
    unstable = {subject for subject, verdict in given.items() if verdict == Verdict.UNSTABLE}
    lost = f"; {_listed(unstable)} lost digits, which says nothing of a model" if unstable else ""
    if not wrong:
        if not right | unstable:
            return Inference(UNDECIDED, "no subject was judged")
        return Inference(NOTHING, f"nothing is wrong{f' with {_listed(right)}' if right else ''}{lost}")
    failed = {subject for subject in wrong if given[subject] == Verdict.ERROR}
    if failed == wrong and not right and {_reads(subject) for subject in wrong} == {True, False}:
        return Inference("system", f"the system itself cannot be used: nobody answered, not even the equations ({_listed(wrong)})")
    everyone = _everyone(given, available)
    parties = _parties(wrong, right, everyone)
    if len(parties) == 1 and parties[0].name == "equations" and failed == wrong:
        # Two files that cannot be used are no sign of wrong equations.
        return Inference("equations", f"the system or every model is at fault: no engine could use its file ({_listed(wrong)})" + lost)
    if len(parties) == 1:
        return Inference(parties[0].name, parties[0].sentence + lost)
    if not parties:
        kept = f" and leaves {_listed(right)} right" if right else ""
        return Inference(UNDECIDED, f"more than one fault: no single one makes {_listed(wrong)} wrong{kept}{lost}")
    ask = _deciding(parties, everyone - set(given), wrong)
    names = ", or ".join(party.name for party in parties)
    asked = f"ask {' and '.join(map(str, ask))}" if ask else "no other subject can tell"
    pattern = f"wrong: {_listed(wrong)}; right: {_listed(right) or 'none'}"
    return Inference(UNDECIDED, f"{names}: {asked} ({pattern}){lost}", tuple(map(str, ask)))


def infer_from_records(records: Iterable[Record], available: Collection[str] | None = None) -> dict[str, Inference]:
    """System to the party at fault, for every system of ``records``."""
    by_system = itertools.groupby(sorted(records, key=lambda record: record.system), key=lambda record: record.system)
    return {system: infer({record.subject: record.verdict for record in own}, available) for system, own in by_system}


def subject_named(name: str) -> Subject:
    """The subject that prints as ``name``."""
    engine, _, model_format = name.partition("/")
    return Subject(engine, model_format or EQUATIONS)


def _everyone(given: Collection[Subject], available: Collection[str] | None) -> set[Subject]:
    if available is not None:
        return set(given) | {subject_named(name) for name in available}
    readers = [subject for subject in given if _reads(subject)]
    return set(given) | {Subject(one.engine, other.format) for one in readers for other in readers}


def _parties(wrong: Collection[Subject], right: Collection[Subject], everyone: Collection[Subject]) -> list[_Party]:
    """Those that make exactly the wrong ones wrong, in the order of the rules."""
    found: dict[str, _Party] = {}
    for rule, one in itertools.product(RULES, sorted(wrong)):
        spoiled = frozenset(other for other in everyone if rule.spoils(one, other))
        if spoiled & {*wrong, *right} != set(wrong):
            continue
        names = {"engine": one.engine, "format": one.format, "wrong": _listed(wrong), "right": _listed(right) or "none"}
        wider = found.get(rule.part_of.format(**names))
        if wider is None or wider.spoiled != spoiled:
            party = _Party(rule.party.format(**names), rule.sentence.format(**names), spoiled)
            found.setdefault(party.name, party)
    return list(found.values())


def _deciding(parties: Collection[_Party], askable: Collection[Subject], wrong: Collection[Subject]) -> list[Subject]:
    """The fewest further subjects found that distinguish most of ``parties``; first those that read a suspected file."""
    formats = {subject.format for subject in wrong}
    left = sorted(askable, key=lambda subject: (subject.format not in formats, subject))
    asked: list[Subject] = []

    def classes(subjects: Collection[Subject]) -> int:
        return len({frozenset(party.spoiled & set(subjects)) for party in parties})

    while left:
        best = max(left, key=lambda subject: classes([*asked, subject]))
        if classes([*asked, best]) == classes(asked):
            break
        asked.append(best)
        left.remove(best)
    return asked


def _listed(subjects: Iterable[Subject]) -> str:
    return ", ".join(map(str, sorted(subjects)))
