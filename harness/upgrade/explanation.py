"""The terms and readings that changed between two versions of an engine on one system."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from harness.certify.sampling import generic_sample
from harness.crosscheck.held import differences, held_by, written
from harness.crosscheck.tasks import Assignment, load_audited, may_lose_digits, reference_kernel_of
from harness.diagnosis.terms import TITLES, TermTruth, compare_terms
from harness.results.changes import Change, error_changes
from harness.verdict import SEVERITY

# States at which terms are compared.
STATES = 16


def explain_changes(before: Assignment, after: Assignment, seed: int, note: Callable[[str], None]) -> list[Change]:
    """What two versions read and compute otherwise, of one system from one file; nothing where one of them cannot say.

    Raises:
        Exception: whatever an engine raises.
    """
    note("reading")
    return [*_readings(before, after), *_terms(before, after, seed, note)]


def _readings(before: Assignment, after: Assignment) -> Iterator[Change]:
    held = {str(one.subject): holding for one in (before, after) if (holding := held_by(load_audited(one))) is not None}
    models = {one.model.format: one.model for one in (after,) if one.model is not None}
    if len(held) < 2:
        return
    for difference in differences(after.mechanism.name, held, models):
        values = {name: written(value) for names, value in zip(difference.subjects, difference.values, strict=True) for name in names}
        owner = f" of {difference.joint}" if difference.joint else ""
        where = f" ({'; '.join(difference.places)})" if difference.places else ""
        old, new = (values.get(str(one.subject), "nothing") for one in (before, after))
        yield Change(what="reading", before=f"{difference.quantity}{owner}{where}: {old}", after=new)


def _terms(before: Assignment, after: Assignment, seed: int, note: Callable[[str], None]) -> Iterator[Change]:
    states = generic_sample(after.mechanism, STATES, seed)
    found = []
    for one in (before, after):
        note(f"terms of {one.subject}")
        model = load_audited(one)
        truth = TermTruth(reference_kernel_of(one), states)
        compared = compare_terms(truth, model, str(one.subject), may_lose_digits(one, model))
        found.append({finding.term: finding for finding in compared.findings})
    for term in [term for term in found[0] if term in found[1]]:
        old, new = found[0][term], found[1][term]
        if old.verdict != new.verdict:
            yield Change(what="terms", before=old.sentence, after=new.sentence, is_worse=SEVERITY[new.verdict] > SEVERITY[old.verdict])
        else:
            yield from error_changes(TITLES[term], old.backward_error, new.backward_error, "terms")
