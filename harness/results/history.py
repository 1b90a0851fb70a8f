"""The history of all runs, benchmarks and atlases: records, systems and measurements in a SQLite file that survives a kill."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self, TypeVar

from harness.errors import InvalidInput
from harness.results.atlas import Atlas
from harness.results.benchmark import Benchmark
from harness.results.records import Record, Run, SystemCard, dumps
from harness.results.restoring import restored

if TYPE_CHECKING:
    from harness.results.causes import Cause
    from harness.results.hard_states import RankedCase
    from harness.results.superfluous import SuperfluousPart

_Row = TypeVar("_Row")
_APPLICATION = 0x52424856
_BUSY_SECONDS = 60.0
# Each entry takes a file from the schema version before it to the next; the first makes an empty file version 1.
_STEPS = (
    """
CREATE TABLE runs (id INTEGER PRIMARY KEY, content TEXT NOT NULL);
CREATE TABLE records (id INTEGER PRIMARY KEY, run_id INTEGER NOT NULL REFERENCES runs, content TEXT NOT NULL);
CREATE TABLE systems (id INTEGER PRIMARY KEY, run_id INTEGER NOT NULL REFERENCES runs, content TEXT NOT NULL);
CREATE INDEX records_of_run ON records (run_id);
CREATE INDEX systems_of_run ON systems (run_id);
""",
    """
CREATE TABLE findings (id INTEGER PRIMARY KEY, run_id INTEGER NOT NULL REFERENCES runs, content TEXT NOT NULL);
CREATE TABLE benchmarks (id INTEGER PRIMARY KEY, content TEXT NOT NULL);
CREATE TABLE measurements (
    id INTEGER PRIMARY KEY, benchmark_id INTEGER NOT NULL REFERENCES benchmarks, part TEXT NOT NULL, content TEXT NOT NULL
);
CREATE INDEX findings_of_run ON findings (run_id);
CREATE INDEX measurements_of_benchmark ON measurements (benchmark_id);
""",
    """
CREATE TABLE atlases (id INTEGER PRIMARY KEY, content TEXT NOT NULL);
CREATE TABLE atlas_parts (
    id INTEGER PRIMARY KEY, atlas_id INTEGER NOT NULL REFERENCES atlases, part TEXT NOT NULL, content TEXT NOT NULL
);
CREATE TABLE worst_cases (id INTEGER PRIMARY KEY, run_id INTEGER NOT NULL REFERENCES runs, content TEXT NOT NULL);
CREATE INDEX parts_of_atlas ON atlas_parts (atlas_id);
CREATE INDEX worst_cases_of_run ON worst_cases (run_id);
""",
    """
CREATE TABLE causes (id INTEGER PRIMARY KEY, run_id INTEGER NOT NULL REFERENCES runs, content TEXT NOT NULL);
CREATE INDEX causes_of_run ON causes (run_id);
""",
)
_VERSION = len(_STEPS)
_ELSEWHERE = "the file was left as it is; name another file, or move this one away to start a new history"


class History:
    """Runs with what they found, benchmarks with measurements, and atlases with their parts, in one SQLite file.

    Each row holds JSON.

    Every ``append`` is its own committed transaction under SQLite's rollback journal, so a kill loses
    none that returned, and the history stays one file that can be copied. Several processes may append
    at once. Created, with its folder, where it does not exist; a file of an older harness is brought up to date.

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
        return self._begin("INSERT INTO runs (content) VALUES (?)", run)

    def append(self, run_id: int, record: Record) -> None:
        """Store ``record``; once this returns, it survives a kill.

        Raises:
            ValueError: there is no such run.
        """
        self._insert("INSERT INTO records (run_id, content) VALUES (?, ?)", run_id, (dumps(asdict(record)),))

    def append_system(self, run_id: int, card: SystemCard) -> None:
        """Store ``card``.

        Raises:
            ValueError: there is no such run.
        """
        self._insert("INSERT INTO systems (run_id, content) VALUES (?, ?)", run_id, (dumps(asdict(card)),))

    def append_finding(self, run_id: int, finding: SuperfluousPart) -> None:
        """Store a superfluous part of a model.

        Raises:
            ValueError: there is no such run.
        """
        self._insert("INSERT INTO findings (run_id, content) VALUES (?, ?)", run_id, (dumps(asdict(finding)),))

    def append_cause(self, run_id: int, cause: Cause) -> None:
        """Store why a record is wrong.

        Raises:
            ValueError: there is no such run.
        """
        self._insert("INSERT INTO causes (run_id, content) VALUES (?, ?)", run_id, (dumps(asdict(cause)),))

    def append_worst_cases(self, run_id: int, cases: Iterable[RankedCase]) -> None:
        """Store all of a run's worst cases in one transaction.

        Raises:
            ValueError: there is no such run.
        """
        rows = [(dumps(asdict(case)),) for case in cases]
        self._insert("INSERT INTO worst_cases (run_id, content) VALUES (?, ?)", run_id, *rows)

    def begin_benchmark(self, run: Run) -> int:
        """Store that a benchmark begins; its number, which grows from benchmark to benchmark."""
        return self._begin("INSERT INTO benchmarks (content) VALUES (?)", run)

    def append_measurements(self, benchmark_id: int, measured: Benchmark) -> None:
        """Store all of ``measured`` in one transaction, except what follows from the rest: ``cheapest``.

        Raises:
            ValueError: there is no such benchmark.
        """
        self._insert("INSERT INTO measurements (benchmark_id, part, content) VALUES (?, ?, ?)", benchmark_id, *_parts(measured))

    def begin_atlas(self, run: Run) -> int:
        """Store that an atlas begins; its number, which grows from atlas to atlas."""
        return self._begin("INSERT INTO atlases (content) VALUES (?)", run)

    def append_atlas(self, atlas_id: int, measured: Atlas) -> None:
        """Store all of ``measured`` in one transaction.

        Raises:
            ValueError: there is no such atlas.
        """
        self._insert("INSERT INTO atlas_parts (atlas_id, part, content) VALUES (?, ?, ?)", atlas_id, *_parts(measured))

    def runs(self, limit: int = 100) -> list[tuple[int, Run]]:
        """The latest ``limit`` runs and their numbers, newest first."""
        rows = self._rows("SELECT id, content FROM runs ORDER BY id DESC LIMIT ?", limit)
        return [(number, self._loaded(Run, content)) for number, content in rows]

    def records(self, run_id: int) -> list[Record]:
        """The records of a run, in the order they were appended; empty for a run that does not exist."""
        rows = self._rows("SELECT id, content FROM records WHERE run_id = ? ORDER BY id", run_id)
        return [self._loaded(Record, content) for _, content in rows]

    def systems(self, run_id: int) -> list[SystemCard]:
        """The systems of a run, in the order they were appended; empty for a run that does not exist."""
        rows = self._rows("SELECT id, content FROM systems WHERE run_id = ? ORDER BY id", run_id)
        return [self._loaded(SystemCard, content) for _, content in rows]

    def findings(self, run_id: int) -> list[SuperfluousPart]:
        """The superfluous parts a run found, in the order they were appended."""
        from harness.results.superfluous import SuperfluousPart

        rows = self._rows("SELECT id, content FROM findings WHERE run_id = ? ORDER BY id", run_id)
        return [self._loaded(SuperfluousPart, content) for _, content in rows]

    def causes(self, run_id: int) -> list[Cause]:
        """Why records of a run are wrong, in the order they were appended."""
        from harness.results.causes import Cause

        rows = self._rows("SELECT id, content FROM causes WHERE run_id = ? ORDER BY id", run_id)
        return [self._loaded(Cause, content) for _, content in rows]

    def worst_cases(self, run_id: int) -> list[RankedCase]:
        """The worst cases of a run, in the order they were appended."""
        from harness.results.hard_states import RankedCase

        rows = self._rows("SELECT id, content FROM worst_cases WHERE run_id = ? ORDER BY id", run_id)
        return [self._loaded(RankedCase, content) for _, content in rows]

    def latest_run(self, library: str) -> int | None:
        """The newest run of a library that holds a record; None where there is none."""
        return next((number for number, run in self.runs(-1) if run.library == library and self.records(number)), None)

    def latest_benchmark(self, library: str) -> tuple[Run, Benchmark] | None:
        """The newest benchmark of a library that measured anything; None where there is none."""
        parts = "SELECT part, content FROM measurements WHERE benchmark_id = ? ORDER BY id"
        return self._latest("SELECT id, content FROM benchmarks ORDER BY id DESC LIMIT ?", parts, Benchmark, library)

    def latest_atlas(self, library: str) -> tuple[Run, Atlas] | None:
        """The newest atlas of a library that measured anything; None where there is none."""
        parts = "SELECT part, content FROM atlas_parts WHERE atlas_id = ? ORDER BY id"
        return self._latest("SELECT id, content FROM atlases ORDER BY id DESC LIMIT ?", parts, Atlas, library)

    def earlier(self, run_id: int, limit: int = 30) -> list[tuple[Run, list[Record]]]:
        """Up to ``limit`` runs before ``run_id`` of the same library and profile, newest first, with records."""
        runs = {number: run for number, run in self.runs(-1) if number <= run_id}
        this = runs.pop(run_id, None)
        alike = [(number, run) for number, run in runs.items() if this and (run.library, run.profile) == (this.library, this.profile)]
        return [(run, self.records(number)) for number, run in alike[:limit]]

    def _latest(self, heads: str, parts: str, kind: type[_Row], library: str) -> tuple[Run, _Row] | None:
        """The newest of ``heads`` of a library with any ``parts``, as a ``kind`` whose fields are lists of them."""
        for number, content in self._rows(heads, -1):
            run = self._loaded(Run, content)
            if run.library != library:
                continue
            found: dict[str, list[str]] = {}
            for part, item in self._rows(parts, number):
                found.setdefault(part, []).append(item)
            if found:
                whole = ", ".join(f"{json.dumps(part)}: [{', '.join(items)}]" for part, items in found.items())
                return run, self._loaded(kind, f"{{{whole}}}")
        return None

    def _open(self) -> None:
        self._connection.execute("PRAGMA foreign_keys = ON")
        self._connection.execute("PRAGMA synchronous = FULL")
        if self._is_empty():
            self._upgrade()
        if self._pragma("application_id") != _APPLICATION:
            raise InvalidInput(self.path, None, f"is a SQLite database of another program; {_ELSEWHERE}")
        version = self._pragma("user_version")
        if not 1 <= version <= _VERSION:
            problem = f"has schema version {version}, expected {_VERSION}; use the harness that wrote it. Otherwise {_ELSEWHERE}"
            raise InvalidInput(self.path, None, problem)
        if (found := self._pragma("quick_check")) != "ok":
            raise sqlite3.DatabaseError(found)
        if version < _VERSION:
            self._upgrade()

    def _upgrade(self) -> None:
        """From whatever version the file has to ours, all at once or not at all."""
        self._connection.execute("BEGIN IMMEDIATE")
        # Another process may have done it while this one waited for the lock; another program may have made the file its own.
        version = self._pragma("user_version")
        if self._is_empty() or (self._pragma("application_id") == _APPLICATION and version < _VERSION):
            for step in _STEPS[version:]:
                for statement in filter(str.strip, step.split(";")):
                    self._connection.execute(statement)
            self._connection.execute(f"PRAGMA application_id = {_APPLICATION}")
            self._connection.execute(f"PRAGMA user_version = {_VERSION}")
        self._connection.execute("COMMIT")

    def _is_empty(self) -> bool:
        (objects,) = self._connection.execute("SELECT count(*) FROM sqlite_master").fetchone()
        return not objects and not self._pragma("application_id") and not self._pragma("user_version")

    def _pragma(self, name: str) -> Any:
        return self._connection.execute(f"PRAGMA {name}").fetchone()[0]

    def _begin(self, statement: str, run: Run) -> int:
        with self._explained():
            number = self._connection.execute(statement, (dumps(asdict(run)),)).lastrowid
        assert number is not None
        return number

    def _insert(self, statement: str, owner: int, *rows: tuple[str, ...]) -> None:
        """``statement`` for each of ``rows`` after the number of their owner, all in one transaction."""
        with self._explained():
            try:
                self._connection.execute("BEGIN IMMEDIATE")
                self._connection.executemany(statement, [(owner, *row) for row in rows])
                self._connection.execute("COMMIT")
            except sqlite3.IntegrityError as error:
                [owners] = [word for word in ("benchmark", "atlas", "run") if f"({word}_id" in statement]
                raise ValueError(f"there is no {owners} {owner} in {self.path.name}") from error
            finally:
                if self._connection.in_transaction:
                    self._connection.execute("ROLLBACK")

    def _rows(self, query: str, value: int) -> list[tuple[Any, str]]:
        with self._explained():
            return self._connection.execute(query, (value,)).fetchall()

    def _loaded(self, kind: type[_Row], content: str) -> _Row:
        try:
            return restored(kind, json.loads(content))
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


def _parts(measured: Benchmark | Atlas) -> list[tuple[str, str]]:
    """(field, one of its items) of everything but what follows from the rest."""
    return [(part, dumps(item)) for part, items in asdict(measured).items() if part != "cheapest" for item in items]
