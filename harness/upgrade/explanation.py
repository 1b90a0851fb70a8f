"""The terms and readings that changed between two versions of an engine on one system."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator

from harness.certify.sampling import generic_sample
from harness.crosscheck.assignment import Assignment, acceleration_truth_of, load_audited
from harness.crosscheck.held import differences, held_by, written
from harness.diagnosis.terms import TermTruth, compare_terms
from harness.engines import HeldModel, Unsupported
from harness.results.run_changes import READING, TERMS, RunChange
from harness.verdict import SEVERITY

# States at which terms are compared.
STATES = 16


def explain_changes(before: Assignment, after: Assignment, seed: int, note: Callable[[str], None]) -> list[RunChange]:
    """What two versions read and compute otherwise, of one system from one file; nothing where one of them cannot say.

    Raises:
        Exception: whatever an engine raises.
    """
    note("reading")
    return [*_readings(before, after), *_terms(before, after, seed, note)]


def _readings(before: Assignment, after: Assignment) -> Iterator[RunChange]:
    held: dict[str, HeldModel] = {}
    for one in (before, after):
        # A version may have no interface for it.
        with contextlib.suppress(Unsupported):
            holding = held_by(load_audited(one))
            held |= {} if holding is None else {str(one.subject): holding}
    models = {one.model.format: one.model for one in (after,) if one.model is not None}
    if len(held) < 2:
        return
    for difference in differences(after.mechanism.name, held, models):
        values = {name: written(value) for names, value in zip(difference.subjects, difference.values, strict=True) for name in names}
        owner = f" of {difference.joint}" if difference.joint else ""
        where = f" ({'; '.join(difference.places)})" if difference.places else ""
        old, new = (values.get(str(one.subject), "nothing") for one in (before, after))
        yield _change(after, READING, f"{difference.quantity}{owner}{where}: {old}", new)


def _change(of: Assignment, what: str, before: str, now: str, is_worse: bool = False) -> RunChange:
    name, subject = of.mechanism.name, str(of.subject.without_version)
    return RunChange(system=name, subject=subject, what=what, before=before, now=now, is_worse=is_worse)


def _terms(before: Assignment, after: Assignment, seed: int, note: Callable[[str], None]) -> Iterator[RunChange]:
    states = generic_sample(after.mechanism, STATES, seed)
    found = []
    for one in (before, after):
        note(f"terms of {one.subject}")
        model = load_audited(one)
        truth = acceleration_truth_of(one)
        compared = compare_terms(TermTruth(truth.kernel, states), model, str(one.subject), truth.may_lose_digits(model))
        found.append({finding.term: finding for finding in compared.findings})
    for term in [term for term in found[0] if term in found[1]]:
        old, new = found[0][term], found[1][term]
        if old.verdict != new.verdict:
            yield _change(after, TERMS, old.sentence, new.sentence, SEVERITY[new.verdict] > SEVERITY[old.verdict])
