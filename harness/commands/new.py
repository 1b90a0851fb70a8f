"""``harness new``."""

from __future__ import annotations

import shlex
from pathlib import Path

import click

from harness.commands._options import reporting_errors


@click.command("new")
@click.argument("name")
@click.option(
    "--dof", type=click.IntRange(1, 12), default=1, show_default=True, help="Degrees of freedom: plates of the chain that is the example."
)
@click.option(
    "--library",
    "library_path",
    metavar="DIR",
    default=".",
    help="Folder of the library, made where it is missing; the current one by default.",
)
@reporting_errors
def command(name: str, dof: int, library_path: str) -> None:
    """Write the three files of a mechanism NAME: a working example with the places to edit marked."""
    from harness.commands._scaffold import write_example

    for path in write_example(name, dof, Path(library_path)):
        click.echo(f"written: {click.format_filename(path)}")
    click.echo(f"edit what is marked EDIT:, and watch it with\n  {shlex.join(['harness', 'check', name, '--library', library_path])}")
