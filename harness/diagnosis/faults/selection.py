"""The models and subjects that faults are planted for: those asked for, without pairs that are expected to be unsupported."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from harness.crosscheck.expected import Expectation, load_expectations
from harness.engines import EQUATIONS, Subject, select_subjects
from harness.library import Library
from harness.verdict import Verdict


def expectations(library: Library) -> Mapping[tuple[str, str], Expectation]:
    """Verdicts of the library that are expected to be other than ``agrees``, by (system, subject)."""
    return load_expectations(library, [str(subject) for subject in select_subjects(library, ())])


def select_pairs(
    library: Library, names: Sequence[str], subjects: Sequence[Subject]
) -> tuple[list[tuple[str, Subject]], dict[tuple[str, Subject], str]]:
    """(system, subject) of all pairs that read a model, and the reasons of those that are expected to be unsupported.

    Without ``names``, families are represented by their smallest member, whose numbers are those of all.

    Raises:
        harness.errors.InvalidRequest: a system that does not exist.
    """
    known = expectations(library)
    smallest = [members[0] for path in sorted(library.systems.glob("*.py")) if (members := library.names_in(path))]
    systems = library.select(names) if names else smallest
    pairs = [(name, subject) for name in systems for subject in subjects if subject.format != EQUATIONS]
    expected = {pair: known.get((pair[0], str(pair[1])), Expectation()) for pair in pairs}
    reasons = {pair: one.reason for pair, one in expected.items() if one.verdict == Verdict.UNSUPPORTED}
    return [pair for pair in pairs if pair not in reasons], reasons


def select_models(library: Library, names: Sequence[str]) -> tuple[list[tuple[str, str]], dict[tuple[str, str], str]]:
    """(system, format) of every model that some subject reads, and the reasons of those that none does; raises as above."""
    pairs, excused = select_pairs(library, names, select_subjects(library, ()))
    models = sorted({(name, subject.format) for name, subject in pairs})
    reasons = {(name, subject.format): reason for (name, subject), reason in reversed(excused.items())}
    return models, {model: reasons[model] for model in sorted(reasons) if model not in models}
