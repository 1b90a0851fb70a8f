"""``harness engines``."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from operator import itemgetter
from typing import TYPE_CHECKING, Any

import click

from harness.commands import ENGINES
from harness.commands.frame.bracket import Bracket, computing
from harness.commands.frame.terminal import say
from harness.errors import InvalidRequest

if TYPE_CHECKING:
    from harness.environments import Environment
    from harness.library import Library

SECTION = ENGINES
_SPECIFICATION = re.compile(r"(?P<name>[A-Za-z0-9][\w.-]*?)(?:==(?P<version>[\w.+!-]+))?")


@click.command("engines")
@click.argument("action", type=click.Choice(["list", "add", "remove"]), default="list")
@click.argument("names", nargs=-1, metavar="[ENGINE[==VERSION]...]")
@computing(seed=False)
def command(bracket: Bracket, action: str, names: tuple[str, ...]) -> None:
    """List engines; add or remove other versions.

    An engine that is added gets a Python environment of its own: by uv where it is installed, else by venv and pip, from the package
    indexes that you have configured. Nothing that is installed beside the harness changes. A version is then called
    ENGINE@VERSION, as in `harness check --subject mujoco@3.13.0/mjcf`. An engine that is not installed beside the harness is run by its
    newest environment under its own name. Environments are kept in the cache, for all runs.

    \b
    Examples:
      harness engines
      harness engines add mujoco==3.13.0 drake
      harness engines remove mujoco==3.13.0
    """
    if action == "list" and names:
        raise click.UsageError(f"list takes no names; to make an environment: harness engines add {' '.join(names)}")
    if action != "list" and not names:
        raise click.UsageError(f"{action} takes names of engines, as mujoco==3.13.0")
    for engine, version in requested(bracket, names):
        (add if action == "add" else _remove)(bracket, engine, version)
    if action == "list":
        _list(bracket)


def requested(bracket: Bracket, names: Sequence[str]) -> list[tuple[str, str]]:
    """Engine and version, "" for the newest, of each name, which may be that of the engine's file or of its distribution.

    Raises:
        InvalidRequest: there is no such engine.
    """
    from harness.engines import EQUATIONS, engine_files
    from harness.environments import require_version
    from harness.library import nearest

    # What takes equations is the harness's own.
    by_name = {name: name for name, file in engine_files(bracket.library).items() if "@" not in name and file.formats != (EQUATIONS,)}
    by_name = {file.requires[1]: name for name, file in engine_files(bracket.library).items() if name in by_name} | by_name
    requested = []
    for name in names:
        match = _SPECIFICATION.fullmatch(name.replace("@", "=="))
        if match is None:
            raise InvalidRequest(f"{name!r} names no engine and version; expected one as mujoco==3.13.0")
        if match["name"] not in by_name:
            raise InvalidRequest(f"no engine is called {match['name']!r}; {nearest(match['name'], by_name)}")
        if match["version"]:
            require_version(match["version"])
        requested.append((by_name[match["name"]], match["version"] or ""))
    return requested


def add(bracket: Bracket, engine: str, version: str, err: bool = False) -> str:
    """Make the environment of a version, "" for the newest, where there is none; the name that subjects have for it.

    ``err``: whether what was done is said on standard error.

    Raises:
        InvalidRequest: it cannot be installed.
    """
    from harness.engines import engine_files
    from harness.environments import find_environments, install, the_version

    file = engine_files(bracket.library)[engine]
    there = {one.version: one for one in find_environments(engine)}
    found = the_version(version, there) if version else None
    if why := file.too_old(version):
        raise InvalidRequest(why)
    known = [] if found is None else [there[found]]
    made = known[0] if known else install(engine, file.requires[1], file.requires[0], version, file.requirements(version))
    if not known:
        bracket.describe_engines()
    say(f"{made.name}: {'is there' if known else 'made'}, {_megabytes(made.size())} in {made.folder}", err=err)
    return made.name


def _remove(bracket: Bracket, engine: str, version: str) -> None:
    from harness.environments import environment_of

    one = environment_of(engine, version)
    size = one.size()
    one.remove()
    say(f"{one.name}: removed, {_megabytes(size)}")


def installed(library: Library) -> str:
    """The engines that are installed, and how another is, in a sentence; the harness's own equations are none."""
    from harness.engines import EQUATIONS, engine_files
    from harness.results.table import counted, plural

    versions = {name: file.version for name, file in engine_files(library).items() if file.formats != (EQUATIONS,)}
    engines = [name for name in versions if "@" not in name]
    there = [name for name in engines if versions[name] is not None]
    others = len(versions) - len(engines)
    named = f": {' and '.join(filter(None, [', '.join(there[:-1]), *there[-1:]]))}" if there else ""
    further = f", and {counted(others, 'version')} in environments of their own" if others else ""
    count = f"{len(there) or 'none'} of {counted(len(engines), 'engine')} {plural(len(there) or 1, 'is', 'are')} installed"
    return f"{count}{named}{further}; harness engines add NAME installs another."


def _list(bracket: Bracket) -> None:
    from harness.engines import engine_files
    from harness.environments import find_environments
    from harness.results.table import Column, Table

    environments = {one.name: one for one in find_environments()}
    found = [
        {
            "engine": name,
            "version": file.version,
            "formats": {model_format: file.oldest.get(model_format) for model_format in file.formats},
            "bytes": environments[name].size() if name in environments else None,
            "where": "nowhere" if file.version is None else _where(file.elsewhere, environments.get(name)),
        }
        for name, file in engine_files(bracket.library).items()
    ]
    bracket.write_plain({"engines": found})
    columns: dict[Column | str, Callable[[Any], object]] = {
        "engine": itemgetter("engine"),
        "version": lambda one: one["version"] or f"none; harness engines add {one['engine']}",
        "formats": lambda one: ", ".join(f"{name} from {oldest}" if oldest else name for name, oldest in one["formats"].items()),
        Column("size", "plain"): lambda one: "" if one["bytes"] is None else _megabytes(one["bytes"]),
        "where": itemgetter("where"),
    }
    say(installed(bracket.library), "", *str(Table.of(found, columns)).split("\n"))


def _where(elsewhere: bool, environment: Environment | None) -> str:
    if environment is not None:
        return str(environment.folder)
    return "its newest environment" if elsewhere else "beside the harness"


def _megabytes(size: int) -> str:
    return f"{size / 1e6:.0f} MB"
