"""The cache between runs and within a process, and the atomic writing of files.

An entry of the cache is text under a name that hashes what it was made from; it carries its own digest, so that a
damaged entry counts as missing. What is made by code is named after the sources of the whole rooms that make it.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import os
from collections import OrderedDict
from collections.abc import Callable, Hashable
from pathlib import Path
from typing import Generic, TypeVar, cast

from harness.errors import InvalidInput

_PACKAGE = Path(__file__).resolve().parent
T = TypeVar("T")
_NOTHING = object()


class Kept(Generic[T]):
    """The objects last made in this process, by key: compiled kernels and loaded models."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._found: OrderedDict[Hashable, T] = OrderedDict()

    def __contains__(self, key: Hashable) -> bool:
        return key in self._found

    def get(self, key: Hashable, make: Callable[[], T]) -> T:
        """The result of ``make`` for ``key``; the one that was used longest ago goes when there are too many."""
        # A key may be a whole tree, whose hash is computed each time that it is looked up.
        found = self._found.get(key, _NOTHING)
        if found is not _NOTHING:
            self._found.move_to_end(key)
            return cast("T", found)
        made = self._found[key] = make()
        if len(self._found) > self._most:
            self._found.popitem(last=False)
        return made


def cache_directory() -> Path:
    """``$HARNESS_CACHE``, else ``harness`` below ``$XDG_CACHE_HOME`` or ``~/.cache``."""
    override = os.environ.get("HARNESS_CACHE")
    if override:
        return Path(override)
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "harness"


def machine_code_directory() -> Path:
    """``$HEYOKA_CACHE_DIR``, else ``machine_code`` in the harness's cache."""
    return Path(os.environ.get("HEYOKA_CACHE_DIR") or cache_directory() / "machine_code")


@functools.cache
def sources_digest(*rooms: str) -> bytes:
    """A hash of every Python file of ``rooms``, and of the modules that every room may use.

    Raises:
        ValueError: there is no such room.
    """
    if missing := [room for room in rooms if not (_PACKAGE / room).is_dir()]:
        raise ValueError(f"no room of the package is called {missing[0]!r}")
    files = [*_PACKAGE.glob("*.py"), *(file for room in rooms for file in (_PACKAGE / room).rglob("*.py"))]
    digest = hashlib.sha256()
    for file in sorted(files):
        digest.update(f"{file.relative_to(_PACKAGE)}\0".encode() + hashlib.sha256(file.read_bytes()).digest())
    return digest.digest()


def read_entry(entry: Path) -> str | None:
    """The text of an entry of the cache; None where it is missing, damaged or cannot be read."""
    try:
        head, _, text = entry.read_text(encoding="utf-8").partition("\n")
    except (OSError, ValueError):
        return None
    return text if head == _digest(text) else None


def write_entry(entry: Path, text: str) -> None:
    """Keep ``text``; a cache that cannot be written costs time, not the run."""
    with contextlib.suppress(OSError, InvalidInput):
        entry.parent.mkdir(parents=True, exist_ok=True)
        # A part of an entry is known by its digest.
        write_atomically(entry, f"{_digest(text)}\n{text}", lasting=False)


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def write_atomically(path: Path | str, text: str, lasting: bool = True) -> None:
    """Write UTF-8 ``text`` so that a reader meets either the old file or the new one, never a part.

    ``lasting``: also after a loss of power, for which the disk is waited for.

    Raises:
        InvalidInput: the file cannot be written.
    """
    try:
        target = Path(path).resolve()
        content = text.encode("utf-8", "backslashreplace")
        # Replacing /dev/stdout or a pipe would destroy it.
        if target.exists() and not target.is_file():
            target.write_bytes(content)
            return
        temporary = target.with_name(f".{target.name}.{os.getpid()}.tmp")
        try:
            with temporary.open("wb") as stream:
                stream.write(content)
                if lasting:
                    stream.flush()
                    os.fsync(stream.fileno())
            temporary.replace(target)
        finally:
            temporary.unlink(missing_ok=True)
    except OSError as error:
        problem = f"cannot be written ({error.strerror}); name a file in a folder that exists and is writable"
        raise InvalidInput(path, None, problem) from error
