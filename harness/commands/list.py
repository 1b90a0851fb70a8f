"""``harness list``."""

from __future__ import annotations

import json

import click

from harness.commands._bracket import Bracket, computing
from harness.commands._options import report_errors
from harness.errors import InvalidInput


@click.command("list")
@computing(seed=False, workers=False)
def command(bracket: Bracket) -> None:
    """List mechanisms, engines and installed libraries.

    Example: harness list --library mine
    """
    from harness.engines import engine_names, installed_version, load_engine
    from harness.equations.derivation import degrees_of_freedom
    from harness.library import installed_libraries

    library = bracket.library
    installed = list(installed_libraries())
    problems: list[InvalidInput] = []
    systems: dict[str, tuple[int, str]] = {}
    for name in library.select(()):
        try:
            systems[name] = degrees_of_freedom(library, name)
        except InvalidInput as problem:
            problems.append(problem)
    engines = {name: load_engine(library, name) for name in engine_names(library)}
    if bracket.json_path:
        from harness.storage import write_atomically

        listed = {
            "systems": [{"name": name, "degrees_of_freedom": nv, "description": text} for name, (nv, text) in systems.items()],
            "engines": [
                {"name": name, "formats": engine.formats, "version": installed_version(engine)} for name, engine in engines.items()
            ],
            "libraries": installed,
        }
        write_atomically(bracket.json_path, json.dumps(listed, indent=2) + "\n")
    width = max(map(len, [*systems, *engines]))
    for name, (nv, text) in systems.items():
        click.echo(f"{name:<{width}}  {nv:>2} dof  {text}")
    click.echo()
    for name, engine in engines.items():
        click.echo(f"{name:<{width}}  {installed_version(engine) or 'not installed'}  ({', '.join(engine.formats)})")
    click.echo(f"\ninstalled libraries: {', '.join(installed) or 'none'}")
    report_errors(problems)
