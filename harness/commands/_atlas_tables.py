"""Terminal output of ``harness atlas``."""

from __future__ import annotations

import click

from harness.commands._terminal import print_titled
from harness.report import hard_tables
from harness.report.hard_cases import HardSummary
from harness.results.atlas import Atlas
from harness.results.records import Run


def print_atlas(run: Run, atlas: Atlas) -> None:
    """A table of families and subjects, one of motions that part and one of stable steps, and what is not as expected."""
    summary = HardSummary(run, atlas)
    print_titled("hard cases", hard_tables.rows_of(summary).without("time"))
    print_titled("motions that part", hard_tables.partings(summary).without("largest distance"))
    print_titled("largest stable step times the frequency of an undamped spring", hard_tables.stable_steps(summary))
    for problem in atlas.problems:
        click.echo(f"\nnot measured: {problem}")
    for sentence in atlas.unexpected:
        click.echo(f"\nnot as expected: {sentence}")
    click.echo(f"\n{summary.sentence}")
