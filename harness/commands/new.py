"""``harness new``."""

from __future__ import annotations

import shlex
from pathlib import Path

import click

from harness.commands.frame.bracket import Bracket, computing
from harness.commands.frame.terminal import say


@click.command("new")
@click.argument("name", required=False)
@click.option(
    "--dof", type=click.IntRange(1, 12), default=1, show_default=True, help="Degrees of freedom: plates of the chain that is the example."
)
@click.option("--engine", metavar="ENGINE", help="Write the adapter of an engine of this name, which reads URDF, into engines/.")
@click.option(
    "--library",
    "library_path",
    metavar="DIR",
    default=".",
    help="Folder of the library, made where it is missing; the current one by default.",
)
@computing(library=False, json=False, seed=False, workers=False)
def command(bracket: Bracket, name: str | None, dof: int, engine: str | None) -> None:
    """Write a working mechanism NAME, or an engine, to edit.

    A mechanism is a system file, an MJCF and a URDF; an engine is one Python file. Both agree from the start, and the
    places to edit are marked EDIT:.

    \b
    Examples:
      harness new my_arm
      harness new my_arm --dof 2 --engine my_engine --library mine
      harness new --engine my_engine --library mine
    """
    from harness.commands.frame.scaffold import write_example

    if name is None and engine is None:
        raise click.UsageError("name a mechanism to write, or an engine with --engine")
    library_path = bracket.library_path or "."
    for path in write_example(Path(library_path), name, dof, engine):
        say(f"written: {path}")
    watch = ["harness", "check", *([name] if name else []), "--library", library_path]
    say("edit what is marked EDIT:, and watch it with", f"  {shlex.join(watch)}")
    if engine is not None:
        add = shlex.join(["harness", "engines", "add", engine, "--library", library_path])
        say("an engine that is not installed beside the harness gets an environment of its own by", f"  {add}")
