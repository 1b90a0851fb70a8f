"""``harness show``."""

from __future__ import annotations

import sys

import click

from harness.commands._options import CRASHED, library_option, tell, time_limit_option, told


@click.command("show")
@click.argument("name")
@click.option("--html", "html_path", type=click.Path(dir_okay=False), help="Write one offline page with a picture to this file.")
@library_option
@time_limit_option
@told
def command(name: str, html_path: str | None, library_path: str | None, time_limit: float) -> None:
    """Show equations, parameters and models of NAME.

    Prints the joints of both models side by side, and what each engine holds after loading.

    Example: harness show collar --html collar.html
    """
    from harness.library import Library
    from harness.show.exhibit import as_text, look_at
    from harness.workers import Workers

    library = Library.at(library_path)
    library.select([name])
    exhibit = look_at(library, name, html_path is not None, Workers(1, time_limit=time_limit))
    for line in as_text(exhibit):
        click.echo(line)
    if html_path is not None:
        from harness.show.page import render
        from harness.storage import write_atomically

        write_atomically(html_path, render(exhibit, library.name))
        click.echo(f"\npage: {click.format_filename(html_path)}")
    tell(exhibit.problems)
    if exhibit.crashed:
        sys.exit(CRASHED)
