"""Engines of other versions, or that are not installed beside the harness, each in an environment and an interpreter of its own.

An environment holds one engine, NumPy, and the two packages that engine files are read with; the harness itself is not installed in it.
Who runs it is ``harness.engines``.

Knows nothing of engines but names and versions. May use ``storage`` and ``errors``.

They are a folder each below the cache, described by a file that is written last. They are made by uv where it is installed, else by venv
and pip, from the package indexes that the user has configured.

Start with ``Environment``, then ``install``, which makes one.
"""

from __future__ import annotations

import ast
import importlib.util
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import msgspec

from harness.errors import InvalidRequest
from harness.storage import cache_directory, write_atomically

_DESCRIPTION = "environment.json"
AT = "@"
# Newer than any version.
NEWEST = "99999"
# What engine files are read with, beside the engine.
REQUIREMENTS = ("numpy", "lxml", "msgspec")
# Settings of pip that say where packages come from. uv has the same options and does not read pip's files.
_SOURCES = ("index-url", "extra-index-url", "find-links", "no-index")
_INSTALLED = "import importlib.metadata, json; print(json.dumps({d.name: d.version for d in importlib.metadata.distributions()}))"


@dataclass(frozen=True)
class Environment:
    """An engine of one version in a folder.

    Attributes:
        engine: the name of its engine file. distribution, version: of the program.
        python: version of the interpreter, as "3.11".
        installed: version of every package in it, by distribution.
    """

    engine: str
    distribution: str
    version: str
    python: str
    installed: dict[str, str]

    @property
    def name(self) -> str:
        """``engine@version``, as subjects have it."""
        return f"{self.engine}{AT}{self.version}"

    @property
    def folder(self) -> Path:
        return environments_directory() / f"{self.name}-python{self.python}"

    @property
    def interpreter(self) -> Path:
        return interpreter_in(self.folder)

    def meets(self, requirements: Iterable[str]) -> bool:
        """True where every one of these is installed, in a version that it allows."""
        # Imported late: an environment's interpreter imports this module and has no such package.
        from packaging.requirements import Requirement

        installed = {_canonical(name): version for name, version in self.installed.items()}
        asked = [(_canonical(one.name), one.specifier) for one in map(Requirement, requirements)]
        return all(name in installed and wanted.contains(installed[name], prereleases=True) for name, wanted in asked)

    def size(self) -> int:
        """Bytes of its files."""
        return sum(file.lstat().st_size for file in self.folder.rglob("*") if file.is_file() and not file.is_symlink())

    def remove(self) -> None:
        """Delete the folder; what describes it goes first, so that no half of one is taken for an environment."""
        (self.folder / _DESCRIPTION).unlink(missing_ok=True)
        shutil.rmtree(self.folder)

    def describe(self, folder: Path) -> None:
        """Write into ``folder`` that it is this environment, complete."""
        write_atomically(folder / _DESCRIPTION, msgspec.json.format(msgspec.json.encode(self)).decode())


def split_name(name: str) -> tuple[str, str]:
    """Engine and version of ``engine@version``; the version is "" where there is none."""
    engine, _, version = name.partition(AT)
    return engine, version


def the_version(wanted: str, among: Iterable[str]) -> str | None:
    """The one of several versions that is ``wanted``, as 3.13.0 is 3.13; None where none is; raises as ``require_version``."""
    # Imported late: an environment's interpreter imports this module and has no such package.
    from packaging.version import Version

    require_version(wanted)
    return next((one for one in among if Version(one) == Version(wanted)), None)


def require_version(wanted: str) -> None:
    """Refuse what is no version.

    Raises:
        InvalidRequest: with what is expected.
    """
    from packaging.version import InvalidVersion, Version

    try:
        Version(wanted)
    except InvalidVersion as error:
        raise InvalidRequest(f"{wanted!r} is no version; expected one as 3.13.0, or the engine's name alone for the newest") from error


def environments_directory() -> Path:
    """The folder of environments, whoever made them."""
    return cache_directory() / "environments"


def interpreter_in(folder: Path) -> Path:
    return folder / ("Scripts/python.exe" if os.name == "nt" else "bin/python")


def this_python() -> str:
    """The version of Python that environments are made with, for the harness's own sources run in them."""
    return "{}.{}".format(*sys.version_info)


def find_environments(engine: str | None = None) -> list[Environment]:
    """The complete environments of this Python, of one engine or all, by engine and then from the oldest version to the newest."""
    # Imported late: an environment's interpreter imports this module and has no such package.
    from packaging.version import Version

    found = [one for one in _read_all() if engine in (None, one.engine) and one.python == this_python()]
    return sorted(found, key=lambda one: (one.engine, Version(one.version)))


def _read_all() -> Iterator[Environment]:
    for description in environments_directory().glob(f"*/{_DESCRIPTION}"):
        # What another harness wrote in another form, or what is being removed, is none.
        with suppress(OSError, ValueError, InvalidRequest):
            found = msgspec.json.decode(description.read_bytes(), type=Environment)
            require_version(found.version)
            if found.folder == description.parent and found.interpreter.exists():
                yield found


def environment_of(engine: str, version: str = "") -> Environment:
    """The environment of an engine and version, or with the newest that there is.

    Raises:
        InvalidRequest: there is none; the message says how to make it.
    """
    found = find_environments(engine)
    if version:
        chosen = the_version(version, [one.version for one in found])
        found = [one for one in found if one.version == chosen]
    if not found:
        wanted = f"{engine}=={version}" if version else engine
        others = ", ".join(one.version for one in find_environments(engine))
        known = f"; there are environments of {others}" if others else ""
        raise InvalidRequest(f"no environment holds {engine} {version}".rstrip() + f"{known}; make one: harness engines add {wanted}")
    return found[-1]


def install(engine: str, distribution: str, module: str, version: str = "", companions: Sequence[str] = ()) -> Environment:
    """Make the environment of an engine, of its newest version where none is given; one of that version is replaced.

    Args:
        engine: name of its engine file. module: by which the program is imported. companions: what this version needs beside what it
            requires itself.

    Raises:
        InvalidRequest: it cannot be installed, or not be imported then; the message is that of the installer, or of the import.
    """
    root = environments_directory()
    root.mkdir(parents=True, exist_ok=True)
    scratch = Path(tempfile.mkdtemp(dir=root, prefix=".new-"))
    try:
        wanted = [f"{distribution}=={version}" if version else distribution, *companions, *REQUIREMENTS]
        # Of another engine of the same program, as of the two solvers of one library, hundreds of megabytes are there already.
        alike = next((one for one in find_environments() if version and one.engine != engine and one.meets(wanted)), None)
        if alike is not None:
            shutil.copytree(alike.folder, scratch, symlinks=True, copy_function=_linked, dirs_exist_ok=True)
        else:
            _fill(scratch, wanted)
        installed: dict[str, str] = json.loads(_output([str(interpreter_in(scratch)), "-I", "-c", _INSTALLED]))
        _output([str(interpreter_in(scratch)), "-I", "-c", f"import {module}"])
        by_name = {_canonical(name): found for name, found in installed.items()}
        found = by_name[_canonical(distribution)]
        environment = Environment(engine, distribution, found, this_python(), dict(sorted(installed.items())))
        environment.describe(scratch)
        if environment.folder.exists():
            environment.remove()
        # An environment is run by its interpreter alone, which finds its packages wherever the folder is.
        scratch.rename(environment.folder)
    finally:
        shutil.rmtree(scratch, ignore_errors=True)
    return environment


def available_versions(distribution: str) -> list[str]:
    """The versions that the user's package indexes offer, from the oldest to the newest.

    Raises:
        InvalidRequest: pip does not find the distribution, or is not installed beside the harness.
    """
    from packaging.version import Version

    listing = _output([sys.executable, "-m", "pip", "index", "versions", distribution])
    found = re.search(r"^Available versions: (.+)$", listing, re.MULTILINE)
    if found is None:
        raise InvalidRequest(f"pip lists no version of {distribution}: {listing.strip()}")
    return sorted(found[1].split(", "), key=Version)


def versions_between(distribution: str, first: str, last: str) -> list[str]:
    """The released versions from ``first`` to ``last``, from the oldest to the newest.

    Raises:
        InvalidRequest: the indexes offer one of the two not, or they are the wrong way round.
    """
    from packaging.version import Version

    available = available_versions(distribution)
    ends = [the_version(end, available) for end in (first, last)]
    offered = [one for one in available if not Version(one).is_prerelease or one in ends]
    if missing := [name for name, end in zip((first, last), ends, strict=True) if end is None]:
        raise InvalidRequest(f"no package index offers {distribution} {missing[0]}; they offer {', '.join(offered)}")
    start, end = (offered.index(str(end)) for end in ends)
    between = offered[start : end + 1]
    if len(between) < 2:
        raise InvalidRequest(f"{distribution} {first} is not older than {last}; expected the older version first")
    return between


def _fill(folder: Path, requirements: Sequence[str]) -> None:
    """Make a virtual environment in ``folder`` and install ``requirements`` in it."""
    if (uv := shutil.which("uv")) is not None:
        _output([uv, "venv", "--quiet", "--allow-existing", "--python", sys.executable, str(folder)])
        _output([uv, "pip", "install", "--quiet", "--python", str(interpreter_in(folder)), *_sources(), *requirements])
        return
    # As by uv, a module is compiled when it is first imported: most of what an engine brings never is.
    pip = ["install", "--quiet", "--disable-pip-version-check", "--no-compile", *requirements]
    if importlib.util.find_spec("pip") is not None:
        _output([sys.executable, "-m", "venv", "--without-pip", str(folder)])
        _output([sys.executable, "-m", "pip", "--python", str(interpreter_in(folder)), *pip])
    else:
        _output([sys.executable, "-m", "venv", str(folder)])
        _output([str(interpreter_in(folder)), "-m", "pip", *pip])


def _linked(source: str, copy: str) -> None:
    """A second name of one file, where the file system has such; no environment changes a file that is there."""
    try:
        os.link(source, copy)
    except OSError:
        shutil.copy2(source, copy)


def _sources() -> list[str]:
    """The options of uv that say what pip's configuration says of indexes; none where the user has configured uv itself."""
    if any(name.startswith(("UV_INDEX", "UV_DEFAULT_INDEX", "UV_EXTRA_INDEX", "UV_FIND_LINKS", "UV_NO_INDEX")) for name in os.environ):
        return []
    try:
        listing = _output([sys.executable, "-m", "pip", "config", "list"])
    except InvalidRequest:
        return []
    options = []
    for name, value in _configured(listing).items():
        if name == "no-index":
            options += ["--no-index"] if value.lower() in ("1", "true", "yes", "on") else []
        else:
            options += [word for one in value.split() for word in (f"--{name}", one)]
    return options


def _configured(listing: str) -> Mapping[str, str]:
    """The settings of ``pip config list`` that say where packages come from: of the environment before those of files."""
    found: dict[str, str] = {}
    for line in listing.splitlines():
        owner, _, value = line.partition("=")
        section, _, name = owner.rpartition(".")
        if name in _SOURCES and (section == ":env:" or name not in found):
            found[name] = str(ast.literal_eval(value))
    return found


def _output(command: Sequence[str]) -> str:
    # What is listed is read here, however quiet the user's own pip is.
    variables = {name: value for name, value in os.environ.items() if name != "PIP_QUIET"}
    done = subprocess.run(command, capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL, env=variables)
    if done.returncode:
        said = "\n".join(line for line in done.stderr.splitlines() if not line.startswith(("WARNING", "DEPRECATION"))).strip()
        raise InvalidRequest(f"{Path(command[0]).name} cannot do it: {said or done.stdout.strip() or f'exit status {done.returncode}'}")
    return done.stdout


def _canonical(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()
