"""``harness list``."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import click

from harness.commands import MECHANISM
from harness.commands.engines import installed as installed_engines
from harness.commands.frame.bracket import Bracket, computing
from harness.commands.frame.terminal import say
from harness.errors import InvalidInput
from harness.results.table import Table, counted, printable

SECTION = MECHANISM


def _cases() -> Table:
    from harness.hard.cases import hard_cases

    def knob(case: Any) -> str:
        name, unit = case.knob
        return f"{name} [{unit}]" if unit else name

    return Table.of(hard_cases().values(), {"case": "name", "title": "title", "knob": knob})


def _faults() -> Table:
    from harness.diagnosis.faults.campaign import kinds_of_faults

    return Table(["kind", "title"], list(kinds_of_faults().items()))


def _of_all(find: Callable[[str], Iterable[Any]]) -> list[Any]:
    """Declarations of every kind that ``find`` has, each once."""
    from harness.motion.integrators import KINDS

    return list({one.name: one for of in KINDS for one in find(of)}.values())


def _of(one: Any) -> str:
    return ", ".join(one.of)


def _integrators() -> Table:
    from harness.motion.integrators import integrators

    def order(one: Any) -> object:
        return "adaptive" if one.adaptive else one.order

    return Table.of(_of_all(integrators), {"integrator": "name", "reads": "format", "of": _of, "order": order})


def _methods() -> Table:
    from harness.bench.methods import find_methods

    return Table.of(_of_all(find_methods), {"method": "name", "reads": "format", "of": _of, "cost grows as bodies to the": "growth"})


def _derivatives() -> Table:
    from harness.bench.methods import DERIVATIVES, find_methods

    return Table.of(
        find_methods(DERIVATIVES),
        {
            "method": "name",
            "reads": "format",
            "of": lambda method: "tau" if method.is_inverse else "qdd",
            "step": lambda method: "tried over a range" if method.steps else "none",
        },
    )


# What can be listed beside the mechanisms: its rows, and the command that takes the names.
_KINDS: Mapping[str, tuple[Callable[[], Table], str]] = {
    "cases": (_cases, "harness atlas CASE"),
    "derivatives": (_derivatives, "harness bench --derivatives --methods NAME"),
    "faults": (_faults, "harness faults --kind KIND"),
    "integrators": (_integrators, "harness bench --motion --methods NAME"),
    "methods": (_methods, "harness bench --methods NAME"),
}


@click.command("list")
@click.argument("kind", type=click.Choice(list(_KINDS)), required=False)
@computing(time_limit=60.0, seed=False, workers=False)
def command(bracket: Bracket, kind: str | None) -> None:
    """List mechanisms, engines and all other names.

    Without an argument: mechanisms, engines with their versions, and installed libraries. Otherwise the names that other
    commands take: cases (harness atlas), faults (harness faults --kind), derivatives, integrators and methods
    (harness bench --methods).

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
    bracket.write_plain({kind: [dict(zip((head.title for head in table.heads), row, strict=True)) for row in table.rows]})
    say(f"Names that {taker} takes:", "", *str(table).split("\n"))


def _list_library(bracket: Bracket) -> None:
    from harness.engines import engine_files
    from harness.lagrange.derivation import degrees_of_freedom, kept_degrees_of_freedom
    from harness.library import installed_libraries
    from harness.study import Study
    from harness.workers import Task

    library = bracket.library
    installed = list(installed_libraries())
    names, failures = library.select(()), Study()
    found = {name: kept for name in names if (kept := kept_degrees_of_freedom(library, name))}
    # Worker processes alone run a system file.
    # Each imports SymPy, which takes longer than most files.
    bracket.workers = 1
    if missing := [Task(name, degrees_of_freedom, (library, name)) for name in names if name not in found]:
        for outcome in bracket.pool.run(missing):
            if not failures.failure(outcome):
                found[outcome.task.key] = outcome.value
            elif outcome.crash is not None:
                failures.report(InvalidInput(library.system_path(outcome.task.key), None, str(outcome.crash)))
    systems = {name: found[name] for name in names if name in found}
    variants = {name: library.formats_of(name) for name in library.variant_names()}
    engines = engine_files(library)
    bracket.write_plain(
        {
            "systems": [{"name": name, "degrees_of_freedom": nv, "description": text} for name, (nv, text) in systems.items()],
            "variants": [{"name": name, "system": library.system_of(name), "formats": formats} for name, formats in variants.items()],
            "engines": [{"name": name, "formats": file.formats, "version": file.version} for name, file in engines.items()],
            "libraries": installed,
        }
    )
    states = {name: failures.failure(file.outcome) or file.version or "not installed" for name, file in engines.items()}
    of_models = f" and {counted(len(variants), 'variant')} of their models" if variants else ""
    say(f"{counted(len(systems), 'mechanism')}{of_models}; {installed_engines(library)}", "")
    width = max(len(printable(name)) for name in [*systems, *variants, *engines])
    for title, listed in (
        ([], {name: f"{nv:>2} dof  {text}" for name, (nv, text) in systems.items()}),
        (["", "variants of their models:"] if variants else [], {name: ", ".join(formats) for name, formats in variants.items()}),
        ([""], {name: f"{states[name]}  ({', '.join(file.formats)})" for name, file in engines.items()}),
    ):
        say(*title, *(f"{printable(name):<{width}}  {text}" for name, text in listed.items()))
    say("", f"installed libraries: {', '.join(installed) or 'none'}", f"other names: harness list {'|'.join(_KINDS)}")
    bracket.finish(failures.problems, failures.crashed, not failures.refused)
