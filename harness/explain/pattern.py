"""The party at fault, inferred from the subjects of one system that agree with the reference and those that do not.

Each party that can be at fault makes certain subjects wrong and no others. A party is blamed where these are the wrong ones
exactly, among the subjects that were judged. Subjects without an answer abstain: ``undecided`` and ``unsupported`` ones,
``unstable`` ones, which lost digits and show nothing of a model, and those that failed: an exception is no evidence about a model,
nor about an engine's dynamics.

Source: Reiter, A theory of diagnosis from first principles, Artificial Intelligence 32 (1987), for a single fault.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType

from harness.engines import EQUATIONS, Subject
from harness.results.records import Record
from harness.verdict import AGREEMENT, SOUND, Verdict

NOTHING, UNDECIDED, FAILURE = "nothing", "undecided", "failure"
_WRONG = Verdict.DISAGREES, Verdict.ERROR


@dataclass(frozen=True)
class Inference:
    """The conclusion from the pattern of agreement.

    Attributes:
        party: "nothing", "model FORMAT", "engine NAME", "reader ENGINE/FORMAT", "readers FORMAT", "equations", "kernel", "system" or
            "undecided"; "failure" where nothing is wrong but that subjects failed.
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
        sentence: the conclusion, after ``right`` and ``wrong`` subjects; ``beside`` is a clause on the right ones, "" without any.
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
        "{engine} is at fault: it is wrong with every format that it was judged with ({wrong}){beside}",
    ),
    Rule(
        "reader {engine}/{format}",
        lambda one, other: _reads(one) and other == one,
        "what {engine} makes of {format} is at fault, its reader or what the harness supplies for it: it alone is wrong ({wrong}){beside}",
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
        "the float64 kernel of {engine} is at fault: it is given the equations themselves, and no model{beside}",
    ),
)


@dataclass(frozen=True)
class _Party:
    name: str
    sentence: str
    spoiled: frozenset[Subject]


def infer(
    verdicts: Mapping[str, str],
    available: Collection[str] | None = None,
    failures: Mapping[str, str] = MappingProxyType({}),
    meanings: Mapping[str, float] = MappingProxyType({}),
) -> Inference:
    """The party at fault, from the verdict of each subject by its name.

    ``available`` are all subjects there are; by default every engine of ``verdicts`` with every format of them. ``failures`` are
    the messages of the subjects with the verdict ``error`` that failed, by name. ``meanings`` are the backward errors of what the
    files themselves mean, by format (``errors_of_files``): they go before any majority of the subjects.
    """
    everything = {subject_named(name): verdict for name, verdict in verdicts.items()}
    failed = {subject_named(name): message for name, message in failures.items()}
    silenced = _with(everything, Verdict.ERROR)
    if not _with(everything, *SOUND, Verdict.DISAGREES) and {_reads(subject) for subject in silenced} == {True, False}:
        return Inference("system", f"the system itself cannot be used: nobody answered, not even the equations ({_listed(silenced)})")
    given = {subject: verdict for subject, verdict in everything.items() if subject not in failed}
    silent = "; ".join(_failed(failed))
    if failed and not _with(given, *_WRONG):
        return Inference(FAILURE, f"{silent}{_beside(_with(given, *SOUND))}")
    inference = _infer_with_files(given, _everyone(everything, available) - set(failed), meanings)
    return replace(inference, sentence=f"{inference.sentence}; {silent}") if silent else inference


def _with(given: Mapping[Subject, str], *verdicts: Verdict) -> set[Subject]:
    """The subjects that have one of these verdicts."""
    return {subject for subject, verdict in given.items() if verdict in verdicts}


def _failed(failures: Mapping[Subject, str]) -> Iterator[str]:
    """A sentence for each engine that failed, and each way in which it did."""
    ways: dict[tuple[str, str], list[Subject]] = {}
    for subject, message in failures.items():
        ways.setdefault((subject.engine, message.partition("\n")[0]), []).append(subject)
    for (engine, message), alike in ways.items():
        yield f"{engine} gave no answers to judge ({_listed(alike)}: {message}), which says nothing of a model or of dynamics"


def _infer_with_files(given: Mapping[Subject, str], everyone: Collection[Subject], meanings: Mapping[str, float]) -> Inference:
    """``_infer``, with the readers of a file that is wrong set aside: one that agrees does not read what the file says."""
    wrong_files = {name for name, error in meanings.items() if error > AGREEMENT}
    right_files = set(meanings) - wrong_files
    # Where all files differ from the energies, these may be what is wrong.
    suspects = wrong_files if right_files else set()
    others = {one: verdict for one, verdict in given.items() if one.format not in suspects}
    rest = _infer(others, everyone, right_files)
    if not suspects or not _with(given, *_WRONG):
        return rest
    sentences = [_about_file(name, meanings[name], given) for name in sorted(suspects)]
    if _with(others, *_WRONG):
        return Inference(UNDECIDED, "more than one fault: " + "; ".join([*sentences, rest.sentence]), rest.ask)
    party = f"model {min(suspects)}" if len(suspects) == 1 else UNDECIDED
    return Inference(party, "; ".join(sentences))


def _about_file(name: str, error: float, given: Mapping[Subject, str]) -> str:
    readers = {one: verdict for one, verdict in given.items() if one.format == name}
    wrong, right = _with(readers, *_WRONG), _with(readers, *SOUND)
    as_it_says = f"; wrong with it: {_listed(wrong)}" if wrong else ""
    otherwise = f"; {_listed(right)} agrees with the energies, and so does not use what the file says" if right else ""
    return f"the {name} model is at fault: it means another mechanism, by {error:.3g} data roundoffs{as_it_says}{otherwise}"


def _infer(given: Mapping[Subject, str], everyone: Collection[Subject], right_files: Collection[str] = ()) -> Inference:
    """``infer`` from those that did not fail, of ``everyone`` who could be asked; files that are right are no party."""
    wrong, right, unstable = _with(given, *_WRONG), _with(given, *SOUND), _with(given, Verdict.UNSTABLE)
    lost = f"; {_listed(unstable)} lost digits, which says nothing of a model" if unstable else ""
    if not wrong:
        if not right | unstable:
            return Inference(UNDECIDED, "no subject was judged")
        read, agreeing = _with(given, Verdict.EXPLAINED), _with(given, Verdict.AGREES)
        makes = "answers for what its reader makes" if len(read) == 1 else "answer for what their readers make"
        explained = f"; {_listed(read)} {makes} of the file" if read else ""
        return Inference(NOTHING, f"nothing is wrong{f' with {_listed(agreeing)}' if agreeing else ''}{explained}{lost}")
    parties = [party for party in _parties(wrong, right, everyone) if not _is_cleared(party, right_files)]
    if len(parties) == 1:
        [party] = parties
        if party.name == "equations" and _with(given, Verdict.ERROR) == wrong:
            # Two files that cannot be used are no sign of wrong equations.
            return Inference("equations", f"the system or every model is at fault: no engine could use its file ({_listed(wrong)}){lost}")
        return Inference(party.name, party.sentence + lost)
    formats = {subject.format for subject in wrong}
    if not parties and len(formats) == 1 and formats <= set(right_files):
        [name] = formats
        return Inference(f"readers {name}", f"the {name} model is right by what it says: {_listed(wrong)} misread it or are wrong{lost}")
    if not parties:
        kept = f" and leaves {_listed(right)} right" if right else ""
        return Inference(UNDECIDED, f"more than one fault: no single one makes {_listed(wrong)} wrong{kept}{lost}")
    ask = _deciding(parties, set(everyone) - set(given), wrong)
    names = ", or ".join(party.name for party in parties)
    asked = f"ask {' and '.join(map(str, ask))}" if ask else "no other subject can tell"
    pattern = f"wrong: {_listed(wrong)}; right: {_listed(right) or 'none'}"
    return Inference(UNDECIDED, f"{names}: {asked} ({pattern}){lost}", tuple(map(str, ask)))


def infer_from_records(
    records: Iterable[Record],
    available: Collection[str] | None = None,
    meanings: Mapping[str, Mapping[str, float]] = MappingProxyType({}),
    system_of: Callable[[str], str] = str,
) -> dict[str, Inference]:
    """System to the party at fault, for every system of ``records``; ``meanings`` of their files, as of ``infer``, by system.

    Of a variant of models, for whose name ``system_of`` gives another, the plain models of its system are further files: what
    reads them right has right equations.
    """
    by_system: dict[str, list[Record]] = {}
    for record in sorted(records, key=lambda record: record.system):
        by_system.setdefault(record.system, []).append(record)
    found = {}
    for name, own in by_system.items():
        verdicts = {record.subject: record.verdict for record in own}
        failures = {record.subject: record.message for record in own if record.failed}
        known = available
        if (system := system_of(name)) != name:
            known = [*verdicts, *map(_of_plain_model, available or ())]
            verdicts |= {_of_plain_model(record.subject): record.verdict for record in by_system.get(system, ())}
        found[name] = infer(verdicts, known, failures, meanings.get(name, {}))
    return found


def _of_plain_model(subject: str) -> str:
    """The name of a subject that reads the plain model, beside those that read a variant."""
    return subject.replace("/", "/plain ")


def subject_named(name: str) -> Subject:
    """The subject that prints as ``name``."""
    engine, _, model_format = name.partition("/")
    return Subject(engine, model_format or EQUATIONS)


def _is_cleared(party: _Party, right_files: Collection[str]) -> bool:
    kind, _, name = party.name.partition(" ")
    readers = {subject.format for subject in party.spoiled if _reads(subject)}
    return (kind == "model" and name in right_files) or (kind == "equations" and readers <= set(right_files))


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
        names = {"engine": one.engine, "format": one.format, "wrong": _listed(wrong), "right": _listed(right), "beside": _beside(right)}
        wider = found.get(rule.part_of.format(**names))
        if wider is None or wider.spoiled != spoiled:
            party = _Party(rule.party.format(**names), rule.sentence.format(**names), spoiled)
            found.setdefault(party.name, party)
    return list(found.values())


def _beside(right: Collection[Subject]) -> str:
    """A clause on those that are right beside a wrong one; "" for none."""
    return f"; right {'is' if len(right) == 1 else 'are'} {_listed(right)}" if right else ""


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
