"""The cache of machine code: below the harness's own, and replaced where it is damaged, once and by name."""

from __future__ import annotations

import contextlib
import random
import shutil
import sqlite3
from collections.abc import Callable
from pathlib import Path

import pytest
import sympy as sp
from support import harness_in_a_process, without_progress
from worker_tasks import use_heyoka

from harness.programs.machine_code import load_heyoka, replace_damaged
from harness.storage import machine_code_directory
from harness.workers import Task, Workers


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The file in which a user without any settings has machine code, after a first run.

    The loops are there already, in files of their own, which take ten seconds to compile.
    """
    loops = list(machine_code_directory().glob("*.txt"))
    assert loops
    for name in ("HEYOKA_CACHE_DIR", "HARNESS_CACHE", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("HOME", str(tmp_path))
    machine_code_directory().mkdir(parents=True)
    for loop in loops:
        shutil.copy(loop, machine_code_directory())
    assert run(tmp_path) == ""
    return tmp_path / ".cache" / "harness" / "machine_code" / "cache.db"


def run(folder: Path) -> str:
    """Standard error of a check in which all is as expected."""
    options = ["--subject", "lagrange", "--states", "20", "--workers", "1"]
    done = harness_in_a_process("check", "simple_pendulum", *options, cwd=folder)
    assert done.returncode == 0, done.stdout + done.stderr
    return without_progress(done.stderr)


def change_machine_code(file: Path) -> None:
    """One bit in the middle of each entry's machine code, which SQLite does not see."""
    with contextlib.closing(sqlite3.connect(file)) as database:
        for key, code in database.execute("SELECT hash, obj FROM cache").fetchall():
            changed = bytearray(code)
            changed[100] ^= 1
            database.execute("UPDATE cache SET obj = ? WHERE hash = ?", (bytes(changed), key))
        database.commit()


def change_file(file: Path) -> None:
    file.write_bytes(random.Random(0).randbytes(50_000))


@pytest.mark.ci
@pytest.mark.parametrize("damage", [change_machine_code, pytest.param(change_file, marks=pytest.mark.nightly)])
def test_a_damaged_cache_is_replaced_and_named_once(cache: Path, tmp_path: Path, damage: Callable[[Path], None]) -> None:
    with contextlib.closing(sqlite3.connect(cache)) as database:
        kept = database.execute("SELECT hash, obj FROM cache ORDER BY hash").fetchall()
        assert kept
        assert kept == database.execute("SELECT hash, obj FROM copies ORDER BY hash").fetchall()
    damage(cache)
    errors = run(tmp_path)
    assert errors.count(f"harness: {cache}: the cache of machine code was damaged") == 1
    assert len(errors.splitlines()) == 1
    assert replace_damaged() == ""


@pytest.mark.nightly
def test_a_cache_that_cannot_be_written_costs_time_only(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("HEYOKA_CACHE_DIR", str(tmp_path / "file"))
    assert run(tmp_path) == ""


@pytest.mark.ci
def test_a_worker_has_heyoka_without_sympy_and_sympy_afterwards() -> None:
    with Workers(1) as workers:
        [outcome] = workers.run([Task(0, use_heyoka, ())])
    assert outcome.value == (False, True)
    assert load_heyoka().from_sympy(sp.Symbol("x") * 2.5) == load_heyoka().expression("x") * 2.5
