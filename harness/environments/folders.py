"""The environments of this machine: a folder each below the cache, described by a file that is written last."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import msgspec

from harness.errors import InvalidRequest
from harness.storage import cache_directory, write_atomically

_DESCRIPTION = "environment.json"
AT = "@"


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


def environments_directory() -> Path:
    """Where environments are kept, whoever made them."""
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
        with suppress(OSError, ValueError):
            found = msgspec.json.decode(description.read_bytes(), type=Environment)
            if found.folder == description.parent and found.interpreter.exists():
                yield found


def environment_of(engine: str, version: str = "") -> Environment:
    """The environment of an engine and version, or with the newest that there is.

    Raises:
        InvalidRequest: there is none; the message says how to make it.
    """
    found = [one for one in find_environments(engine) if version in ("", one.version)]
    if not found:
        wanted = f"{engine}=={version}" if version else engine
        others = ", ".join(one.version for one in find_environments(engine))
        known = f"; there are environments of {others}" if others else ""
        raise InvalidRequest(f"no environment holds {engine} {version}".rstrip() + f"{known}; make one: harness engines add {wanted}")
    return found[-1]
