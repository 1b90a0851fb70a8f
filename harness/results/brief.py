"""What a subject was asked for beside accelerations, in one line."""

from __future__ import annotations

from collections.abc import Sequence

from harness.results.records import Record
from harness.verdict import Verdict


def quantities_in_brief(records: Sequence[Record]) -> str:
    """The quantities that agree, with the worst of them, those with another verdict, and what is not as expected.

    ``records`` are of one subject. A quantity of which one record is not as expected counts as such.
    """
    wrong = sorted({record.quantity for record in records if not record.as_expected})
    good = [record for record in records if record.quantity not in wrong]
    agreeing = [record for record in good if record.verdict == Verdict.AGREES]
    parts = []
    if agreeing:
        worst = max(agreeing, key=lambda record: record.backward_error or 0.0)
        size = f"{worst.backward_error or 0.0:.3g} ({worst.quantity} of {worst.system})"
        count = len({record.quantity for record in agreeing})
        parts.append(f"{count} {'quantity agrees' if count == 1 else 'quantities agree'}, worst {size}")
    for verdict in sorted({record.verdict for record in good} - {Verdict.AGREES.value}):
        # What one mechanism has nothing of is no news where another one has.
        names = {record.quantity for record in good if record.verdict == verdict} - {record.quantity for record in agreeing}
        said = "not offered" if verdict == Verdict.UNSUPPORTED else f"{verdict} (as expected)"
        parts += [f"{', '.join(sorted(names))} {said}"] if names else []
    parts += [f"not as expected: {', '.join(wrong)}"] if wrong else []
    return "; ".join(parts)
