"""``harness list``."""

from __future__ import annotations

import json

import click

from harness.commands._bracket import Bracket, computing
from harness.errors import InvalidInput


@click.command("list")
@computing(seed=False, workers=False)
def command(bracket: Bracket) -> None:
    """List mechanisms, engines and installed libraries.

    Example: harness list --library mine
    """
    from harness.engines import engine_files
    from harness.equations.derivation import degrees_of_freedom, kept_degrees_of_freedom
    from harness.library import installed_libraries
    from harness.study import Rounds
    from harness.workers import Task

    library = bracket.library
    installed = list(installed_libraries())
    names, failures = library.select(()), Rounds()
    systems = {name: kept for name in names if (kept := kept_degrees_of_freedom(library, name))}
    if missing := [Task(name, degrees_of_freedom, (library, name)) for name in names if name not in systems]:
        for outcome in bracket.pool.run(missing):
            if not failures.failure(outcome):
                systems[outcome.task.key] = outcome.value
            elif outcome.crash is not None:
                failures.report(InvalidInput(library.system_path(outcome.task.key), None, str(outcome.crash)))
    systems = {name: systems[name] for name in names if name in systems}
    engines = engine_files(library)
    if bracket.json_path:
        listed = {
            "systems": [{"name": name, "degrees_of_freedom": nv, "description": text} for name, (nv, text) in systems.items()],
            "engines": [{"name": name, "formats": file.formats, "version": file.version} for name, file in engines.items()],
            "libraries": installed,
        }
        bracket.write_text(json.dumps(listed, indent=2) + "\n")
    width = max(map(len, [*systems, *engines]))
    for name, (nv, text) in systems.items():
        click.echo(f"{name:<{width}}  {nv:>2} dof  {text}")
    click.echo()
    for name, file in engines.items():
        state = failures.failure(file.outcome) or file.version or "not installed"
        click.echo(f"{name:<{width}}  {state}  ({', '.join(file.formats)})")
    click.echo(f"\ninstalled libraries: {', '.join(installed) or 'none'}")
    bracket.finish(failures.problems, failures.crashed, True)
