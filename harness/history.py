"""The history of all runs: records and systems in a SQLite file that survives a kill."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from types import TracebackType
from typing import Any, Self, TypeVar

from harness.errors import InvalidInput
from harness.records import Record, Run, SystemCard, dumps

_Row = TypeVar("_Row")
_APPLICATION = 0x52424856
_VERSION = 1
_BUSY_SECONDS = 60.0
_TABLES = """
CREATE TABLE runs (id INTEGER PRIMARY KEY, content TEXT NOT NULL);
CREATE TABLE records (id INTEGER PRIMARY KEY, run_id INTEGER NOT NULL REFERENCES runs, content TEXT NOT NULL);
CREATE TABLE systems (id INTEGER PRIMARY KEY, run_id INTEGER NOT NULL REFERENCES runs, content TEXT NOT NULL);
CREATE INDEX records_of_run ON records (run_id);
CREATE INDEX systems_of_run ON systems (run_id);
"""
_ELSEWHERE = "the file was left as it is; name another file, or move this one away to start a new history"


class History:
    """Runs, records and systems in one SQLite file, each row as JSON.

    Every ``append`` is its own committed transaction under SQLite's rollback journal, so a kill loses
    none that returned, and the history stays one file that can be copied. Several processes may append
    at once. Created, with its folder, where it does not exist.

    Raises:
        InvalidInput: on opening and from every method: the file is no history, is damaged, comes from
            a newer harness, cannot be written, or is locked by another process for a minute.

    Source: sqlite.org/atomiccommit.html; sqlite.org/pragma.html, application_id and user_version.
    """

    def __init__(self, path: Path | str) -> None:
        self.path = Path(path)
        with self._explained():
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._connection = sqlite3.connect(self.path, timeout=_BUSY_SECONDS, isolation_level=None)
            try:
                self._open()
            except BaseException:
                self._connection.close()
                raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """Close the file; the history cannot be used afterwards."""
        self._connection.close()

    def begin(self, run: Run) -> int:
        """Store ``run``; its number, which grows from run to run."""
        with self._explained():
            number = self._connection.execute("INSERT INTO runs (content) VALUES (?)", (dumps(asdict(run)),)).lastrowid
        assert number is not None
        return number

    def append(self, run_id: int, record: Record) -> None:
        """Store ``record``; once this returns, it survives a kill.

        Raises:
            ValueError: there is no such run.
        """
        self._insert("INSERT INTO records (run_id, content) VALUES (?, ?)", run_id, asdict(record))

    def append_system(self, run_id: int, card: SystemCard) -> None:
        """Store ``card``.

        Raises:
            ValueError: there is no such run.
        """
        self._insert("INSERT INTO systems (run_id, content) VALUES (?, ?)", run_id, asdict(card))

    def runs(self, limit: int = 100) -> list[tuple[int, Run]]:
        """The latest ``limit`` runs and their numbers, newest first."""
        rows = self._rows("SELECT id, content FROM runs ORDER BY id DESC LIMIT ?", limit)
        return [(number, self._loaded(lambda data: Run(**data), content)) for number, content in rows]

    def records(self, run_id: int) -> list[Record]:
        """The records of a run, in the order they were appended; empty for a run that does not exist."""
        rows = self._rows("SELECT id, content FROM records WHERE run_id = ? ORDER BY id", run_id)
        return [self._loaded(_record, content) for _, content in rows]

    def systems(self, run_id: int) -> list[SystemCard]:
        """The systems of a run, in the order they were appended; empty for a run that does not exist."""
        rows = self._rows("SELECT id, content FROM systems WHERE run_id = ? ORDER BY id", run_id)
        return [self._loaded(_card, content) for _, content in rows]

    def earlier(self, run_id: int, limit: int = 30) -> list[tuple[Run, list[Record]]]:
        """Up to ``limit`` runs before ``run_id`` of the same library and profile, newest first, with records."""
        runs = {number: run for number, run in self.runs(-1) if number <= run_id}
        this = runs.pop(run_id, None)
        alike = [(number, run) for number, run in runs.items() if this and (run.library, run.profile) == (this.library, this.profile)]
        return [(run, self.records(number)) for number, run in alike[:limit]]

    def _open(self) -> None:
        self._connection.execute("PRAGMA foreign_keys = ON")
        self._connection.execute("PRAGMA synchronous = FULL")
        if self._is_empty():
            self._connection.execute("BEGIN IMMEDIATE")
            # Another process may have created the tables while this one waited for the lock.
            if self._is_empty():
                for statement in filter(str.strip, _TABLES.split(";")):
                    self._connection.execute(statement)
                self._connection.execute(f"PRAGMA application_id = {_APPLICATION}")
                self._connection.execute(f"PRAGMA user_version = {_VERSION}")
            self._connection.execute("COMMIT")
        if self._pragma("application_id") != _APPLICATION:
            raise InvalidInput(self.path, None, f"is a SQLite database of another program; {_ELSEWHERE}")
        version = self._pragma("user_version")
        if version != _VERSION:
            problem = f"has schema version {version}, expected {_VERSION}; use the harness that wrote it. Otherwise {_ELSEWHERE}"
            raise InvalidInput(self.path, None, problem)
        if (found := self._pragma("quick_check")) != "ok":
            raise sqlite3.DatabaseError(found)

    def _is_empty(self) -> bool:
        (objects,) = self._connection.execute("SELECT count(*) FROM sqlite_master").fetchone()
        return not objects and not self._pragma("application_id") and not self._pragma("user_version")

    def _pragma(self, name: str) -> Any:
        return self._connection.execute(f"PRAGMA {name}").fetchone()[0]

    def _insert(self, statement: str, run_id: int, data: dict[str, Any]) -> None:
        with self._explained():
            try:
                self._connection.execute(statement, (run_id, dumps(data)))
            except sqlite3.IntegrityError as error:
                raise ValueError(f"there is no run {run_id} in {self.path.name}") from error

    def _rows(self, query: str, value: int) -> list[tuple[int, str]]:
        with self._explained():
            return self._connection.execute(query, (value,)).fetchall()

    def _loaded(self, make: Callable[[dict[str, Any]], _Row], content: str) -> _Row:
        try:
            return make(json.loads(content))
        except (ValueError, TypeError, KeyError, AttributeError) as error:
            raise InvalidInput(self.path, None, f"holds a row that is no record of this harness ({error}); {_ELSEWHERE}") from error

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
            raise InvalidInput(self.path, None, f"is damaged or no SQLite database ({error}); {_ELSEWHERE}") from error
        except OSError as error:
            raise InvalidInput(self.path, None, f"cannot be used ({error.strerror}); name a file in a folder that is writable") from error


def _number(value: Any) -> Any:
    return None if value is None else float(value)


def _record(data: dict[str, Any]) -> Record:
    for name in ("backward_error", "relative_error", "seconds_per_state", "median_backward_error", "expected_backward_error"):
        data[name] = _number(data[name])
    if data["worst_state"] is not None:
        data["worst_state"] = {key: [float(number) for number in numbers_] for key, numbers_ in data["worst_state"].items()}
    return Record(**data)


def _card(data: dict[str, Any]) -> SystemCard:
    for name in ("derivation_seconds", "reference_seconds_per_state"):
        data[name] = _number(data[name])
    data["parameters"] = [parameter | {"value": float(parameter["value"])} for parameter in data["parameters"]]
    return SystemCard(**data)
