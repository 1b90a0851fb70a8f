"""The SQLite file of a history: its tables, and how one of an older harness is brought up to date.

Source: sqlite.org/pragma.html, application_id and user_version.
"""

from __future__ import annotations

import sqlite3
from pathlib import Path
from typing import Any

from harness.errors import InvalidInput

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
