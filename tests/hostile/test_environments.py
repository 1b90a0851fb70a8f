"""Surroundings that fail a command: each ends with one clear line and its own status, or the command just works."""

from __future__ import annotations

import errno
import shlex
import subprocess
import sys
from pathlib import Path

import pytest
import worker_tasks as work
from support import make_library, without_progress

from harness.cli import surroundings
from harness.workers import Task, Workers, local

LIST = "list --library library"
CHECK = "check bar_pendulum --library library --states 40 --quantity accelerations --subject mujoco/mjcf"


def shell(line: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """A line for bash, in which ``harness`` is the program."""
    harness = f"{shlex.quote(sys.executable)} -m harness"
    make_library(folder / "library", ["bar_pendulum", "spring_damper"])
    command = ["bash", "-c", f'harness() {{ {harness} "$@"; }}\n{line}']
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300, check=False)
    done.stderr = without_progress(done.stderr)
    return done


def one_line(done: subprocess.CompletedProcess[str], *fragments: str) -> None:
    assert done.stderr.startswith("harness: ") and done.stderr.count("\n") == 1, done.stderr
    for fragment in fragments:
        assert fragment in done.stderr


@pytest.mark.parametrize("command", [LIST, "--help", pytest.param(CHECK, marks=pytest.mark.nightly)])
def test_a_full_standard_output_is_named(command: str, tmp_path: Path) -> None:
    done = shell(f"harness {command} > /dev/full", tmp_path)
    assert done.returncode == 2
    one_line(done, "standard output", "No space left on device")


@pytest.mark.parametrize("command", [LIST, pytest.param(CHECK, marks=pytest.mark.nightly)])
def test_a_reader_that_is_gone_changes_nothing(command: str, tmp_path: Path) -> None:
    done = shell(f"harness {command} | head -0; exit ${{PIPESTATUS[0]}}", tmp_path)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize("closed", [">&-", pytest.param("<&- >&- 2>&-", marks=pytest.mark.nightly)])
def test_closed_streams_change_nothing(closed: str, tmp_path: Path) -> None:
    done = shell(f"harness {CHECK} --json out.json {closed}", tmp_path)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert (tmp_path / "out.json").read_text().count('"verdict": "agrees"') == 1


def test_a_working_folder_that_was_removed_is_named(tmp_path: Path) -> None:
    done = shell(f"mkdir gone && cd gone && rmdir ../gone && harness {CHECK}", tmp_path)
    assert done.returncode == 2
    one_line(done, "working folder", "removed")


def test_a_pool_that_cannot_grow_goes_on_with_what_it_has(monkeypatch: pytest.MonkeyPatch) -> None:
    class Limited(local._Process):
        started = 0

        def __init__(self, memory_limit: int) -> None:
            if Limited.started:
                raise OSError(errno.EMFILE, "Too many open files")
            super().__init__(memory_limit)
            Limited.started += 1

    monkeypatch.setattr(local, "_Process", Limited)
    with Workers(3) as workers:
        outcomes = list(workers.run([Task(number, work.own_process, (), number) for number in range(4)]))
    assert sorted(outcome.task.key for outcome in outcomes) == [0, 1, 2, 3]
    assert len({outcome.value for outcome in outcomes}) == 1
    with Workers(1) as workers, pytest.raises(OSError, match="Too many"):
        list(workers.run([Task(0, work.own_process, ())]))


@pytest.mark.ci
def test_no_file_to_be_had_is_named(tmp_path: Path) -> None:
    done = shell(f"ulimit -n 9; harness {CHECK}", tmp_path)
    assert done.returncode == 2
    one_line(done, "Too many open files", "ulimit -n")


@pytest.mark.nightly
def test_few_open_files_are_enough(tmp_path: Path) -> None:
    """A second worker has no room, so one does all the work."""
    done = shell("ulimit -n 20; harness check --library library --states 4 --workers 2", tmp_path)
    assert (done.returncode, done.stderr) == (0, "")


# With much less memory than the least of these, CPython has no room to handle its own MemoryError, and ends as it happens to.
@pytest.mark.nightly
@pytest.mark.parametrize("limit", ["-n 10", "-n 14", "-n 16", "-n 20", "-v 2000000", "-v 700000", "-v 400000", "-v 250000", "-u 0", "-f 0"])
def test_no_limit_gives_a_traceback(limit: str, tmp_path: Path) -> None:
    done = shell(f"ulimit {limit}; harness {CHECK} --time-limit 20", tmp_path)
    assert done.returncode in (0, 1, 2, 3)
    assert "Traceback" not in done.stdout + done.stderr
    if limit == "-v 2000000":
        assert done.returncode == 0


@pytest.mark.nightly
def test_two_gigabytes_of_memory_are_enough_for_every_engine(tmp_path: Path) -> None:
    done = shell("ulimit -v 2000000; harness check --library library --states 4", tmp_path)
    assert (done.returncode, done.stderr) == (0, "")


UNMAPPED = "libsdf_plugin.so: failed to map segment from shared object"


@pytest.mark.parametrize(
    "error", [ImportError(UNMAPPED), OSError(UNMAPPED), OSError("Could not find/load shared object file 'libllvmlite.so'"), MemoryError()]
)
def test_a_library_that_does_not_fit_into_memory_ends_with_a_remedy(error: Exception, capsys: pytest.CaptureFixture[str]) -> None:
    """As Python, ctypes and llvmlite say it."""
    with pytest.raises(SystemExit) as ended, surroundings():
        raise error
    assert ended.value.code == 2
    assert "ulimit -v" in capsys.readouterr().err
