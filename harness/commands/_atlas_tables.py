"""What ``harness atlas`` prints."""

from __future__ import annotations

import click

from harness.commands._terminal import print_rows
from harness.hard.atlas import HEADINGS, table
from harness.report.hard_cases import HardSummary
from harness.results.atlas import Atlas
from harness.results.records import Run


def print_atlas(run: Run, atlas: Atlas) -> None:
    """A table of families and subjects, one of motions that part and one of stable steps, and what is not as expected."""
    summary = HardSummary(run, atlas)
    # The remarks follow below, and would make the table too wide.
    print_rows("hard cases", HEADINGS[:-1], [cells[:-1] for cells in table(atlas.rows)])
    partings = [
        [entry.motion, entry.integrator, f"{entry.parted} of {entry.starts}", entry.rates, entry.soonest, entry.verdict]
        for entry in summary.partings()
    ]
    print_rows("motions that part", ["motion", "integrator", "parted", "rate over expected", "soonest", "verdict"], partings)
    steps = [
        [entry.integrator, f"{entry.expected:.4g}", entry.measured, f"{entry.softest:.3g} to {entry.stiffest:.3g} rad/s", entry.verdict]
        for entry in summary.stable_steps()
    ]
    print_rows(
        "largest stable step times the frequency of an undamped spring",
        ["integrator", "expected", "measured", "frequency", "verdict"],
        steps,
    )
    for problem in atlas.problems:
        click.echo(f"\nnot measured: {problem}")
    for sentence in atlas.unexpected:
        click.echo(f"\nnot as expected: {sentence}")
    click.echo(f"\n{summary.sentence}")
