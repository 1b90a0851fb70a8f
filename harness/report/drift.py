"""A drift in sections, for the terminal; it computes nothing."""

from __future__ import annotations

from collections.abc import Iterator

from harness.report.comparison import Section
from harness.results.detail import Detail
from harness.results.drift import Drifts
from harness.results.table import counted

# Lines of what differs, where not all is asked for.
_MOST_LINES = 12


def drift_sections(found: Drifts, detail: Detail = Detail.BRIEF) -> Iterator[Section]:
    """The causes of the gap over time, and the differences of the sides."""
    for drift in found.drifts:
        yield Section(drift.sentence, is_answer=True)
        yield Section("The sides", [drift.first.title, drift.second.title])
        table, others = drift.table(detail)
        how = f"{counted(drift.orders, 'sampled order')} of the causes" if drift.orders else "every subset of the causes"
        note = f"{counted(drift.motions, 'motion')}, with {how} exchanged; positions in the kinetic-energy norm."
        broken = f"Motions between both sides that break down, left out with all orders through them: {drift.left_out}."
        given = f"Actuators without a column in the control are given 0: {', '.join(drift.uncontrolled)}."
        notes = [note, *([broken] if drift.left_out else []), *([given] if drift.uncontrolled else [])]
        yield Section("What the gap in positions is made of", [table, *notes, *filter(None, [others])])
        lines = drift.lines
        if detail == Detail.BRIEF and len(lines) > _MOST_LINES:
            lines = [*lines[:_MOST_LINES], f"{len(lines) - _MOST_LINES} more (--all)"]
        if lines:
            yield Section("What differs", lines)
    for measured in found.measured:
        yield Section(measured.sentence, is_answer=True)
        table, others = measured.table(detail)
        note = f"{measured.motions} motions by {measured.mover}, held against {', '.join(measured.joints)}."
        if measured.together:
            yield Section("The numbers that explain the gap at once", [measured.joint_table])
        if measured.numbers:
            yield Section("What one number would explain of the gap", [table, note, *filter(None, [others])])
