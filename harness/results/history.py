"""The history of all studies in a SQLite file that survives a kill."""

from __future__ import annotations

import json
import math
import shutil
import sqlite3
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeVar

import msgspec

from harness.errors import InvalidInput
from harness.results.plain_json import dumps
from harness.results.run import Run, StudyResult
from harness.results.table import grouped

_APPLICATION = 0x52424856
_SCHEMA = (
    "CREATE TABLE studies (id INTEGER PRIMARY KEY, kind TEXT NOT NULL, content TEXT NOT NULL)",
    "CREATE TABLE parts (id INTEGER PRIMARY KEY, study_id INTEGER NOT NULL REFERENCES studies, part TEXT NOT NULL, content TEXT NOT NULL)",
    "CREATE INDEX parts_of_study ON parts (study_id, part)",
)
_VERSION = 5
# Versions 1 to 4 had tables of their own for each kind of study: its name, its kind, the column that names it in the tables of
# its parts, and each of these with the name of the part in SQL.
_PARTS_OF_RUNS = {"records": "'records'", "systems": "'systems'", "findings": "'superfluous'", "causes": "'causes'"}
_OLDER_TABLES = (
    ("runs", "cross-check", "run_id", _PARTS_OF_RUNS | {"worst_cases": "'worst_cases'"}),
    ("benchmarks", "benchmark", "benchmark_id", {"measurements": "part"}),
    ("atlases", "atlas", "atlas_id", {"atlas_parts": "part"}),
)
ELSEWHERE = "the file was left as it is; name another file, or move this one away to start a new history"


def open_history(connection: sqlite3.Connection, path: Path) -> None:
    """Make an empty file a history, and bring an older one up to date.

    Raises:
        InvalidInput: the file is of another program, or of a newer harness.
        sqlite3.Error: it is damaged, locked or cannot be written.
    """
    connection.execute("PRAGMA foreign_keys = ON")
    connection.execute("PRAGMA synchronous = FULL")
    if _is_empty(connection):
        _upgrade(connection)
    if _pragma(connection, "application_id") != _APPLICATION:
        raise InvalidInput(path, None, f"is a SQLite database of another program; {ELSEWHERE}")
    version = _pragma(connection, "user_version")
    if not 1 <= version <= _VERSION:
        problem = f"has schema version {version}, expected {_VERSION}; use the harness that wrote it. Otherwise {ELSEWHERE}"
        raise InvalidInput(path, None, problem)
    if (found := _pragma(connection, "quick_check")) != "ok":
        raise sqlite3.DatabaseError(found)
    if version < _VERSION:
        _upgrade(connection)


def _upgrade(connection: sqlite3.Connection) -> None:
    """Bring an empty file or one of an older version to ours, all at once or not at all."""
    connection.execute("BEGIN IMMEDIATE")
    # Another process may have done it while this one waited for the lock; another program may have made the file its own.
    if _is_empty(connection) or (_pragma(connection, "application_id") == _APPLICATION and _pragma(connection, "user_version") < _VERSION):
        for statement in _SCHEMA:
            connection.execute(statement)
        _move_older_tables(connection)
        connection.execute(f"PRAGMA application_id = {_APPLICATION}")
        connection.execute(f"PRAGMA user_version = {_VERSION}")
    connection.execute("COMMIT")


def _move_older_tables(connection: sqlite3.Connection) -> None:
    run = connection.execute
    held = {name for (name,) in run("SELECT name FROM sqlite_master WHERE type = 'table'")}
    for studies, kind, owner, parts in _OLDER_TABLES:
        if studies in held:
            # Each kind of study was numbered by itself.
            (offset,) = run("SELECT coalesce(max(id), 0) FROM studies").fetchone()
            run(f"INSERT INTO studies SELECT id + ?, ?, content FROM {studies}", (offset, kind))
            for table, part in parts.items():
                if table in held:
                    moved = f"SELECT {owner} + ?, {part}, content FROM {table} ORDER BY id"
                    run(f"INSERT INTO parts (study_id, part, content) {moved}", (offset,))
                    run(f"DROP TABLE {table}")
            run(f"DROP TABLE {studies}")


def _is_empty(connection: sqlite3.Connection) -> bool:
    (objects,) = connection.execute("SELECT count(*) FROM sqlite_master").fetchone()
    return not objects and not _pragma(connection, "application_id") and not _pragma(connection, "user_version")


def _pragma(connection: sqlite3.Connection, name: str) -> Any:
    return connection.execute(f"PRAGMA {name}").fetchone()[0]


_Row = TypeVar("_Row")
_Result = TypeVar("_Result", bound=StudyResult)
_BUSY_SECONDS = 60.0


class History(AbstractContextManager["History"]):
    """Studies and the parts of their results in one SQLite file, each row as JSON.

    Every ``append`` is its own committed transaction under SQLite's rollback journal, so a kill loses
    none that returned, and the history stays one file that can be copied. Several processes may append
    at once. Created, with its folder, where it does not exist; a file of an older harness is brought up to date.
    Fields that a row lacks take their defaults; fields that this harness does not know are passed over, for rows are
    never written again.

    A kill in the middle of a commit leaves a journal beside the file, without which nobody can read it: the next to open it plays the
    journal back. Where the folder may not be written, that is done in a copy, which nothing can be appended to.

    Raises:
        InvalidInput: on opening and from every method: the file is no history, is damaged, comes from
            a newer harness, cannot be written, or is locked by another process for a minute.

    Source: sqlite.org/atomiccommit.html; sqlite.org/pragma.html, application_id and user_version.
    """

    def __init__(self, path: Path | str) -> None:
        self.path = Path(path)
        self._copy: TemporaryDirectory[str] | None = None
        with self._explained():
            self.path.parent.mkdir(parents=True, exist_ok=True)
            try:
                self._connection = self._connected(self.path)
            except sqlite3.OperationalError as error:
                if error.sqlite_errorcode != sqlite3.SQLITE_READONLY_ROLLBACK:
                    raise
                self._copy = TemporaryDirectory()
                for name in (self.path.name, f"{self.path.name}-journal"):
                    shutil.copy(self.path.with_name(name), self._copy.name)
                self._connection = self._connected(Path(self._copy.name) / self.path.name)
                self._connection.execute("PRAGMA query_only = ON")

    def _connected(self, path: Path) -> sqlite3.Connection:
        connection = sqlite3.connect(path, timeout=_BUSY_SECONDS, isolation_level=None)
        try:
            open_history(connection, self.path)
        except BaseException:
            connection.close()
            raise
        return connection

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file; the history cannot be used afterwards."""
        self._connection.close()
        if self._copy is not None:
            self._copy.cleanup()

    def begin(self, run: Run, kind: type[StudyResult]) -> int:
        """Store that a study of this kind begins; its number, which grows from study to study."""
        with self._explained():
            number = self._connection.execute("INSERT INTO studies (kind, content) VALUES (?, ?)", (kind.STUDY, dumps(run))).lastrowid
        assert number is not None
        return number

    def append(self, study: int, found: StudyResult) -> None:
        """Store all of ``found`` in one transaction; once this returns, it survives a kill.

        Raises:
            ValueError: there is no such study.
        """
        self.append_together((study, found))

    def append_together(self, *found: tuple[int, StudyResult]) -> None:
        """Store results of several studies, each with the number of its study, in one transaction; raises as ``append``."""
        rows = [(study, part, dumps(item)) for study, result in found for part, item in result.stored_parts()]
        numbers = ", ".join(str(study) for study, _ in found)
        with self._explained():
            try:
                self._connection.execute("BEGIN IMMEDIATE")
                self._connection.executemany("INSERT INTO parts (study_id, part, content) VALUES (?, ?, ?)", rows)
                self._connection.execute("COMMIT")
            except sqlite3.IntegrityError as error:
                raise ValueError(f"there is no study {numbers} in {self.path.name}") from error
            finally:
                if self._connection.in_transaction:
                    self._connection.execute("ROLLBACK")

    def studies(self, kind: type[StudyResult], library: str | None = None) -> dict[int, Run]:
        """Number and run of the studies of a kind, newest first; of one library or of all."""
        rows = self._rows("SELECT id, content FROM studies WHERE kind = ? ORDER BY id DESC", kind.STUDY)
        runs = {number: self._loaded(Run, content) for number, content in rows}
        return {number: run for number, run in runs.items() if library in (None, run.library)}

    def read(self, study: int, kind: type[_Result], part: str = "%") -> _Result:
        """The result of a study, its parts in the order they were appended, or one part of it; empty for a study that does not exist."""
        found = grouped(self._rows("SELECT part, content FROM parts WHERE study_id = ? AND part LIKE ? ORDER BY id", study, part))
        whole = ", ".join(f"{json.dumps(name)}: [{', '.join(items)}]" for name, items in found.items())
        return self._loaded(kind, f"{{{whole}}}")

    def latest(self, kind: type[_Result], library: str, profile: str | None = None) -> tuple[Run, _Result] | None:
        """The newest study of a kind, library and profile, or any profile, that found anything; None where there is none."""
        return next(self.recent(kind, library, profile), None)

    def recent(
        self, kind: type[_Result], library: str, profile: str | None = None, part: str = "%", before: float = math.inf
    ) -> Iterator[tuple[Run, _Result]]:
        """The studies of a kind, library and profile, or any profile, that found anything, newest first; all of each, or one part.

        Those of the number ``before`` and later are left out.
        """
        for number, run in self.studies(kind, library).items():
            found = self.read(number, kind, part) if profile in (None, run.profile) and number < before else kind()
            if any(found.stored_parts()):
                yield run, found

    def earlier(self, study: int, kind: type[_Result], part: str = "%") -> Iterator[tuple[Run, _Result]]:
        """As ``recent``, the studies of a kind before ``study``, of its library and profile; none where there is no such study."""
        this = self.studies(kind).get(study)
        return iter(()) if this is None else self.recent(kind, this.library, this.profile, part, study)

    def _rows(self, query: str, *values: object) -> list[tuple[Any, str]]:
        with self._explained():
            return self._connection.execute(query, values).fetchall()

    def _loaded(self, kind: type[_Row], content: str) -> _Row:
        try:
            # JSON has no infinity; lax conversion reads the text of one into a field of floats.
            return msgspec.convert(json.loads(content), kind, strict=False)
        except ValueError as error:
            raise InvalidInput(self.path, None, f"holds a row that is no record of this harness ({error}); {ELSEWHERE}") from error

    @contextmanager
    def _explained(self) -> Iterator[None]:
        try:
            yield
        except sqlite3.ProgrammingError:
            raise
        except sqlite3.OperationalError as error:
            problem = f"cannot be used ({error}); see that the folder is writable, the disk has room and no other process holds the file"
            raise InvalidInput(self.path, None, problem) from error
        except sqlite3.DatabaseError as error:
            raise InvalidInput(self.path, None, f"is damaged or no SQLite database ({error}); {ELSEWHERE}") from error
        except OSError as error:
            raise InvalidInput(self.path, None, f"cannot be used ({error.strerror}); name a file in a folder that is writable") from error
