"""What a report says of an atlas in Markdown: verdicts that stay the same while the results do, and numbers that need not."""

from __future__ import annotations

from collections.abc import Iterator

from harness.report.hard_cases import HardSummary, growth_text
from harness.report.markdown_parts import bullets, plain, table
from harness.report.summary import error_text
from harness.results.atlas import HardRow


def stable_hard(hard: HardSummary | None) -> Iterator[str]:
    """Verdicts and their reasons."""
    if hard is None:
        return
    yield "## Hard cases"
    yield hard.sentence
    yield bullets(f"**not as expected**: {plain(sentence)}" for sentence in hard.unexpected)
    yield bullets(f"**not measured**: {plain(problem)}" for problem in hard.problems)
    rows = [[family.name, *(_verdicts(family.rows.get(subject)) for subject in hard.subjects)] for family in hard.families]
    yield table(["family", *hard.subjects], rows)
    yield bullets(
        f"{family.name}, {', '.join(subjects)}, {reason.verdict}: {plain(reason.reason)}; {plain(reason.remedy)} ({plain(reason.link)})"
        for family in hard.families
        for subjects, reason in family.reasons
    )
    parted = [[entry.motion, entry.integrator, entry.verdict] for entry in hard.partings()]
    yield table(["motion", "integrator", "verdict"], parted)
    steps = [[entry.integrator, f"{entry.expected:.4g}", entry.verdict] for entry in hard.stable_steps()]
    yield table(["integrator", "largest stable step times frequency, by theory", "verdict"], steps)


def volatile_hard(hard: HardSummary | None) -> Iterator[str]:
    """Errors, slopes and times."""
    if hard is None:
        return
    yield "### Hard cases"
    yield table(["what", "value"], [["started", hard.run.started], ["command", hard.run.command]])
    rows = [
        [family.name, subject, error_text(row.worst), growth_text(row.growth, row.theory_growth), _seconds(row)]
        for family in hard.families
        for subject, row in family.rows.items()
    ]
    yield table(["family", "subject", "largest backward error", "growth", "time"], rows)
    parted = [
        [entry.motion, entry.integrator, f"{entry.parted} of {entry.starts}", entry.rates, entry.soonest] for entry in hard.partings()
    ]
    yield table(["motion", "integrator", "parted", "rate over the expected one", "soonest"], parted)
    yield table(
        ["integrator", "largest stable step times frequency"], [[entry.integrator, entry.measured] for entry in hard.stable_steps()]
    )


def _verdicts(row: HardRow | None) -> str:
    if row is None:
        return "not run"
    counts = ", ".join(f"{verdict} {count}" for verdict, count in sorted(row.verdicts.items()))
    return counts if row.as_expected else f"{counts} (not as expected)"


def _seconds(row: HardRow) -> str:
    return f"{row.seconds:.1f} s"
