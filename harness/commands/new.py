"""``harness new``: files of a mechanism or an engine that agrees from the start, with the places to edit marked ``EDIT:``.

The mechanism is a chain of plates on pins. Each of its three files has a template of its own in ``templates/``, written
from the plates' numbers; no file is made from another. The engine wraps Pinocchio.
"""

from __future__ import annotations

import importlib.util
import keyword
import re
import shlex
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

import click

from harness.commands import MECHANISM
from harness.commands.frame.bracket import Bracket, computing
from harness.commands.frame.terminal import say
from harness.errors import InvalidInput, InvalidRequest, shown_path
from harness.library import MODEL_SUFFIXES, Library, installed_libraries, member_of
from harness.results.table import number_text

SECTION = MECHANISM
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")


@dataclass(frozen=True)
class Plate:
    """A rigid plate that hangs on a pin, its centre of mass half way to the next pin.

    Attributes:
        mass: [kg]. length: from its pin to the next one [m]. inertia: about the centre of mass [kg m^2].
        stiffness, damping: of its pin [N m/rad, N m s/rad].
    """

    mass: float
    length: float
    inertia: float
    stiffness: float
    damping: float


def chain(count: int) -> list[Plate]:
    """Plates of which each has half the mass of the one above it.

    They are wide and ever lighter, because a long chain of equal bars is ill-conditioned: that would be a
    test of engines, not an example.
    """
    halves = [0.5**number for number in range(count)]
    return [Plate(mass=6.0 * half, length=0.25, inertia=1.5 * half, stiffness=20.0 * half, damping=0.5 * half) for half in halves]


def write_example(directory: Path, name: str | None = None, degrees_of_freedom: int = 1, engine: str | None = None) -> list[Path]:
    """Write the mechanism ``name``, ``engine`` or both into the library ``directory``, made where it is missing; their paths.

    Raises:
        InvalidRequest: a name is none that a mechanism or an engine can have.
        InvalidInput: a file exists or cannot be written, or there is no mechanism to check the engine with; then none is written.
    """
    root = _checked_root(directory)
    texts: dict[Path, str] = {}
    if name is not None:
        texts |= _mechanism(root, name, degrees_of_freedom)
    if engine is not None:
        texts |= _engine(root, engine)
        if name is None and not any((root / "systems").glob("*.py")):
            problem = f"holds no mechanism to check an engine with; write both: harness new NAME --engine {engine}"
            raise InvalidInput(directory, None, problem)
    for path in texts:
        if path.exists() or path.is_symlink():
            raise InvalidInput(path, None, "exists already and is left alone; choose another name, or remove the file")
    written: list[Path] = []
    try:
        for path, text in texts.items():
            path.parent.mkdir(parents=True, exist_ok=True)
            with path.open("x", encoding="utf-8") as file:
                written.append(path)
                file.write(text)
    except OSError as error:
        for path in written:
            path.unlink(missing_ok=True)
        raise InvalidInput(error.filename or root, None, f"cannot be written: {error.strerror}; nothing was made") from error
    return written


def _checked_root(directory: Path) -> Path:
    """The folder of the library, which may be missing."""
    root, built_in = directory.resolve(), Library.built_in()
    if root == built_in.models or root.is_relative_to(built_in.systems.parent):
        raise InvalidInput(directory, None, "belongs to the harness itself; write to a library of your own, named by --library DIR")
    if root.exists() and not root.is_dir():
        raise InvalidInput(directory, None, "is not a directory; expected a library, or the folder that is to become one")
    if not root.exists() and str(directory) in installed_libraries():
        raise InvalidInput(directory, None, "is an installed library, which is not to be edited; name a folder")
    return root


def _mechanism(root: Path, name: str, degrees_of_freedom: int) -> dict[Path, str]:
    _check_name(name, "a mechanism")
    # The folder of systems is on Python's path while one of them is loaded.
    specification = None if name in sys.stdlib_module_names else importlib.util.find_spec(name)
    if name in sys.stdlib_module_names or (specification is not None and specification.origin is not None):
        raise InvalidRequest(f"{name!r} is a Python module, which systems/{name}.py would hide from its neighbours; choose another name")
    system = root / "systems" / f"{name}.py"
    taken = member_of(system) is not None or (system.parent.is_dir() and name in Library.at(root).system_names())
    if taken and not system.exists():
        raise InvalidRequest(f"the library has a system called {name!r} already; choose another name")
    plates = chain(degrees_of_freedom)
    models = {root / kind / f"{name}{suffix}": _render(f"model{suffix}.jinja", name, plates) for kind, suffix in MODEL_SUFFIXES.items()}
    return {system: _render("system.py.jinja", name, plates)} | models


def _engine(root: Path, name: str) -> dict[Path, str]:
    _check_name(name, "an engine")
    if any((Library.built_in().engines / place).is_file() for place in (f"{name}.py", f"{name}/__init__.py")):
        raise InvalidRequest(f"the harness has an engine called {name!r}, which this one would hide; choose another name")
    return {root / "engines" / f"{name}.py": _render("engine.py.jinja", name)}


def _check_name(name: str, kind: str) -> None:
    """Refuse what cannot be the name of a Python file that others may import beside it."""
    if name.startswith("_"):
        raise InvalidRequest(f"{name!r} begins with an underscore, which marks helpers; begin with a letter")
    if not _NAME.fullmatch(name) or keyword.iskeyword(name):
        raise InvalidRequest(f"{name!r} cannot name {kind}; expected a Python identifier of ASCII letters, digits and _")


def _render(template: str, name: str, plates: Sequence[Plate] = ()) -> str:
    from jinja2 import Environment, StrictUndefined

    environment = Environment(undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True, keep_trailing_newline=True)
    environment.filters["number"] = number_text
    source = files("harness").joinpath("commands", "templates", template).read_text("utf-8")
    return environment.from_string(source).render(name=name, plates=plates)


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
    if name is None and engine is None:
        raise click.UsageError("name a mechanism to write, or an engine with --engine")
    library_path = bracket.library_path or "."
    written = write_example(Path(library_path), name, dof, engine)
    watch = shlex.join(["harness", "check", *([name] if name else []), "--library", library_path])
    what = " and ".join(filter(None, [name and f"the mechanism {name}", engine and f"the engine {engine}"]))
    say(f"{what[:1].upper()}{what[1:]} works as written: edit what is marked EDIT:, and watch it with {watch}")
    say(*(f"  {shown_path(path)}" for path in written))
    if engine is not None:
        add = shlex.join(["harness", "engines", "add", engine, "--library", library_path])
        say("an engine that is not installed beside the harness gets an environment of its own by", f"  {add}")
