"""``harness list``."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import Any

import click

from harness.commands._bracket import Bracket, computing
from harness.commands._options import report_errors
from harness.commands._terminal import say
from harness.errors import InvalidInput
from harness.results.table import Table, printable


def _cases() -> Table:
    from harness.hard.cases import hard_cases

    def knob(case: Any) -> str:
        name, unit = case.knob
        return f"{name} [{unit}]" if unit else name

    return Table.of(hard_cases().values(), {"case": "name", "title": "title", "knob": knob})


def _faults() -> Table:
    from harness.diagnosis.faults.campaign import kinds_of_faults

    return Table(["kind", "title"], list(kinds_of_faults().items()))


def _integrators() -> Table:
    from harness.motion.integrators import integrators

    def order(one: Any) -> object:
        return "adaptive" if one.adaptive else one.order

    return Table.of(integrators(), {"integrator": "name", "reads": "format", "order": order})


def _methods() -> Table:
    from harness.bench.methods import find_methods

    return Table.of(find_methods(), {"method": "name", "reads": "format", "cost grows as bodies to the": "growth"})


# What can be listed beside the mechanisms: its rows, and the command that takes the names.
_KINDS: Mapping[str, tuple[Callable[[], Table], str]] = {
    "cases": (_cases, "harness atlas CASE"),
    "faults": (_faults, "harness faults --kind KIND"),
    "integrators": (_integrators, "harness bench --motion --methods NAME"),
    "methods": (_methods, "harness bench --methods NAME"),
}


@click.command("list")
@click.argument("kind", type=click.Choice(list(_KINDS)), required=False)
@computing(seed=False, workers=False)
def command(bracket: Bracket, kind: str | None) -> None:
    """List mechanisms, engines and all other names.

    Without an argument: mechanisms, engines with their versions, and installed libraries. Otherwise the names that other
    commands take: cases (harness atlas), faults (harness faults --kind), integrators and methods (harness bench --methods).

    \b
    Examples:
      harness list
      harness list methods
      harness list --library mine --json list.json
    """
    if kind is None:
        _list_library(bracket)
        return
    rows, taker = _KINDS[kind]
    table = rows()
    _write(bracket, {kind: [dict(zip((head.title for head in table.heads), row, strict=True)) for row in table.rows]})
    say(*str(table).split("\n"), "", f"for: {taker}")


def _write(bracket: Bracket, listed: Mapping[str, Any]) -> None:
    from harness.storage import write_atomically

    if bracket.json_path:
        write_atomically(bracket.json_path, json.dumps(listed, indent=2) + "\n")


def _list_library(bracket: Bracket) -> None:
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
    _write(
        bracket,
        {
            "systems": [{"name": name, "degrees_of_freedom": nv, "description": text} for name, (nv, text) in systems.items()],
            "engines": [
                {"name": name, "formats": engine.formats, "version": installed_version(engine)} for name, engine in engines.items()
            ],
            "libraries": installed,
        },
    )
    width = max(len(printable(name)) for name in [*systems, *engines])
    for name, (nv, text) in systems.items():
        say(f"{printable(name):<{width}}  {nv:>2} dof  {text}")
    say("")
    for name, engine in engines.items():
        say(f"{printable(name):<{width}}  {installed_version(engine) or 'not installed'}  ({', '.join(engine.formats)})")
    say("", f"installed libraries: {', '.join(installed) or 'none'}", f"other names: harness list {'|'.join(_KINDS)}")
    report_errors(problems)
