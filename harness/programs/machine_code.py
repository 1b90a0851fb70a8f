"""heyoka, with its cache of machine code beside the harness's own cache, and checked before anything in it is run.

heyoka keeps what it compiles in an SQLite file, and runs what it finds there as it is: a damaged entry is an error of the
compiler, a crash, or another program. Here each entry is kept twice, and a file in which two copies differ is replaced. The
second copy is written by a trigger of the file, so that processes that write at once need no agreement.
"""

from __future__ import annotations

import contextlib
import functools
import sqlite3
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from harness.errors import require
from harness.storage import machine_code_directory
from harness.workers.program import is_worker

_SECOND_COPY = """
BEGIN IMMEDIATE;
CREATE TABLE copies (hash INTEGER PRIMARY KEY, obj BLOB NOT NULL);
INSERT INTO copies SELECT hash, obj FROM cache;
CREATE TRIGGER copy AFTER INSERT ON cache BEGIN
    DELETE FROM copies WHERE hash = new.hash;
    INSERT INTO copies VALUES (new.hash, new.obj);
END;
CREATE TRIGGER forget AFTER DELETE ON cache BEGIN DELETE FROM copies WHERE hash = old.hash; END;
COMMIT;
"""
_DIFFERENT = "SELECT 1 FROM cache LEFT JOIN copies USING (hash) WHERE copies.obj IS NOT cache.obj LIMIT 1"


def load_heyoka() -> Any:
    """The module, ready to compile; where its cache cannot be used, it compiles without one.

    Raises:
        InvalidRequest: it is not installed.
    """
    require("equations of motion become machine code", "heyoka")
    with _without_sympy() if is_worker() else contextlib.nullcontext():
        import heyoka

    _open(machine_code_directory())
    return heyoka


@contextlib.contextmanager
def _without_sympy() -> Iterator[None]:
    """While heyoka is imported: it imports SymPy, for half a second, to convert expressions, which no task asks of it.

    In a user's process its conversions stay; SymPy is found again afterwards.
    """
    if "sympy" in sys.modules:
        yield
        return
    sys.modules["sympy"] = None  # type: ignore[assignment]
    try:
        yield
    finally:
        del sys.modules["sympy"]


def replace_damaged() -> str:
    """Delete the cache of machine code where it is damaged; a sentence that says so, "" where it is not."""
    directory = machine_code_directory()
    if _is_sound(directory):
        return ""
    for file in directory.glob("cache.db*"):
        file.unlink(missing_ok=True)
    return f"{directory / 'cache.db'}: the cache of machine code was damaged; it has been deleted and is made anew"


@functools.cache
def _open(directory: Path) -> None:
    """Have heyoka use the cache in ``directory``, once per process.

    Python's SQLite and heyoka's, which know nothing of each other, would take away each other's locks on one file: the file is
    closed in the one before it is opened in the other.
    """
    import heyoka

    if damaged := replace_damaged():
        warnings.warn(damaged, stacklevel=3)
    state = heyoka.llvm_state
    state.set_diskcache_path(directory)
    try:
        if not _has_second_copies(directory):
            # Makes the file where there is none, and closes it.
            state.get_diskcache_size()
            state.set_diskcache_path(directory)
            with contextlib.closing(_connect(directory)) as database:
                # Another process may have been quicker.
                with contextlib.suppress(sqlite3.OperationalError):
                    database.executescript(_SECOND_COPY)
                database.execute(_DIFFERENT)
    except (RuntimeError, sqlite3.Error):
        state.set_diskcache_enabled(False)


def _has_second_copies(directory: Path) -> bool:
    with contextlib.suppress(sqlite3.OperationalError), contextlib.closing(_connect(directory)) as database:
        return bool(database.execute("SELECT 1 FROM sqlite_master WHERE name = 'copies'").fetchone())
    return False


def _is_sound(directory: Path) -> bool:
    try:
        with contextlib.closing(_connect(directory)) as database:
            # Copied into memory page by page, 150 MB take three times as long.
            database.execute(f"PRAGMA mmap_size = {1 << 31}")
            return database.execute("PRAGMA quick_check").fetchone() == ("ok",) and not database.execute(_DIFFERENT).fetchone()
    except sqlite3.OperationalError:
        # There is no such file, it has no second copies yet, or it is busy.
        return True
    except sqlite3.Error:
        return False


def _connect(directory: Path) -> sqlite3.Connection:
    return sqlite3.connect(f"{(directory / 'cache.db').absolute().as_uri()}?mode=rw", uri=True, timeout=60.0)
