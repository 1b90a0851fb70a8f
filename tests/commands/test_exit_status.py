"""Exit status 1 is a verdict and nothing else; who is to blame for another one is said."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from support import harness, heeding_interrupts, make_library

from harness.commands import check
from harness.library import Library

RECURSIONS = {
    "calls_itself": "def again():\n    return again()\n\n\nagain()\n",
    "nested": "x = " + "(" * 5000 + ")" * 5000 + "\n",
    "chained": "x = " + "-" * 100_000 + "1\n",
    "deep": """
import sympy as sp
from sympy.physics.mechanics import dynamicsymbols
from harness import TIME, System

x = dynamicsymbols("x")
m = sp.Symbol("m", positive=True)
potential = x
for _ in range(20_000):
    potential = sp.sin(potential, evaluate=False)
SYSTEM = System(coordinates={x: "slide"}, kinetic=m * x.diff(TIME)**2 / 2, potential=potential, parameters={m: (1.0, "kg")}, total_mass=m)
""",
    "no_expression": """
from sympy.physics.mechanics import dynamicsymbols
from harness import System


class Odd:
    def __getattr__(self, name):
        return getattr(self, name + "x")


x = dynamicsymbols("x")
SYSTEM = System(coordinates={x: "slide"}, kinetic=Odd(), potential=0, parameters={}, total_mass=0)
""",
}
FOLDER = "a folder of the file's name"
REFUSED = Library.built_in().model_path("bar_pendulum", "mjcf").read_text().replace("0.5 0.5 1e-15", "0.5 0.5 1.0000000000000002")


@pytest.fixture
def library(tmp_path: Path) -> Path:
    return make_library(tmp_path / "library", ["bar_pendulum"])


@pytest.mark.ci
def test_an_interrupt_is_130(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "harness", "check", "--states", "100000", "--workers", "1"]
    with heeding_interrupts():
        process = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    with process:
        # Workers are its children as soon as the study runs.
        deadline = time.monotonic() + 60
        children = Path(f"/proc/{process.pid}/task/{process.pid}/children")
        while time.monotonic() < deadline and not children.read_text().strip():
            time.sleep(0.02)
        os.kill(process.pid, signal.SIGINT)
        printed, told = process.communicate(timeout=60)
    assert (process.returncode, printed) == (130, "")
    assert told.splitlines() == ["harness: interrupted"]


@pytest.mark.ci
@pytest.mark.parametrize(
    ("words", "number", "status", "why"),
    [
        (["check", "bar_pendulum", "chain_12"], signal.SIGINT, 130, "interrupted"),
        (["compare", "robots/bar_pendulum.xml", "robots/large.xml"], signal.SIGTERM, 143, "terminated by a signal"),
        (["survey", "robots"], signal.SIGINT, 130, "interrupted"),
    ],
)
def test_what_was_answered_before_a_signal_is_told_and_written(
    words: list[str], number: signal.Signals, status: int, why: str, tmp_path: Path
) -> None:
    """One robot is answered soon, and the other is large."""
    (tmp_path / "robots").mkdir()
    shutil.copy(Library.built_in().model_path("bar_pendulum", "mjcf"), tmp_path / "robots")
    links = "".join(f'<body pos="0 0 -1"><joint axis="1 {one} 0"/><geom size="0.1"/>' for one in range(60)) + "</body>" * 60
    (tmp_path / "robots" / "large.xml").write_text(f"<mujoco><worldbody>{links}</worldbody></mujoco>")
    command = [sys.executable, "-m", "harness", *words, "--states", "100000", "--workers", "1", "--json", "found.json"]
    with heeding_interrupts():
        process = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    with process:
        deadline, written = time.monotonic() + 120, tmp_path / "found.json"
        while time.monotonic() < deadline and process.poll() is None and not written.is_file():
            time.sleep(0.02)
        os.kill(process.pid, number)
        printed, told = process.communicate(timeout=60)
    assert process.returncode == status, told
    assert re.match(rf"{why.capitalize()}: \d+ of \d+ parts of the \S+ were complete, and what follows is of those\.", printed), printed
    assert "Traceback" not in told
    found = json.loads(written.read_text())
    assert found["incomplete"] == why and "bar_pendulum" in json.dumps(found)


def test_a_fault_of_the_harness_is_70_and_says_so(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def broken(*arguments: object) -> None:
        raise ZeroDivisionError("nobody's model")

    monkeypatch.setattr(check, "_parse_state", broken)
    done = harness("check", "bar_pendulum", cwd=tmp_path)
    assert done.returncode == 70
    lines = done.stderr.splitlines()
    assert lines[0].startswith("Traceback") and "ZeroDivisionError: nobody's model" in lines
    assert lines[-1].startswith("harness: internal error") and "report" in lines[-1] and "not of your files" in lines[-1]


def test_a_fault_in_a_worker_is_70_too_and_costs_no_other_record(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def broken(*arguments: object) -> None:
        raise ZeroDivisionError("nobody's engine")

    monkeypatch.setattr("harness.crosscheck.hypothesis_search._draw", broken)
    done = harness("check", "bar_pendulum", cwd=tmp_path)
    assert done.returncode == 70, done.stdout + done.stderr
    assert "nobody's engine" in done.stderr and done.stderr.splitlines()[-1].startswith("harness: internal error")
    assert "bar_pendulum" in done.stdout


@pytest.mark.ci
@pytest.mark.parametrize("case", RECURSIONS)
def test_a_system_file_that_recurses_without_end_is_2(library: Path, case: str) -> None:
    path = library / "systems" / f"{case}.py"
    path.write_text('"""A.\n\nSource: none.\n"""\n' + RECURSIONS[case])
    done = harness("check", case, "--library", str(library), "--states", "20", cwd=library)
    assert done.returncode == 2, (done.returncode, done.stdout, done.stderr[-2000:])
    assert "Traceback" not in done.stderr and str(path) in done.stderr


@pytest.mark.parametrize("command", ["list", "show"])
def test_listing_and_showing_it_is_2_as_well(library: Path, command: str) -> None:
    (library / "systems" / "again.py").write_text('"""A.\n\nSource: none.\n"""\n' + RECURSIONS["calls_itself"])
    arguments = ["again"] if command == "show" else []
    done = harness(command, *arguments, "--library", str(library), cwd=library)
    assert done.returncode == 2 and "again.py:6: raises RecursionError" in done.stderr, done.stderr


@pytest.mark.parametrize("command", ["check", "diagnose"])
@pytest.mark.parametrize(
    ("text", "fragment"),
    [
        (None, "no such file"),
        ("<mujoco><", "stand_in.xml:1"),
        ("\0\0", "stand_in.xml"),
        ("<robot/>", "robot"),
        (FOLDER, "stand_in.xml"),
        (REFUSED, "stand_in.xml: mujoco refuses it"),
    ],
)
def test_a_model_file_that_cannot_be_used_ends_the_run_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: str, text: str | None, fragment: str
) -> None:
    def never(*arguments: object, **named: object) -> None:
        raise AssertionError("something was computed")

    monkeypatch.setattr("harness.crosscheck.run.compare_all", never)
    if text != REFUSED:
        monkeypatch.setattr("harness.crosscheck.loading.load_mechanism", never)
    path = tmp_path / "stand_in.xml"
    if text == FOLDER:
        path.mkdir()
    elif text is not None:
        path.write_text(text)
    # Only the engine that refuses a file can say so.
    for subjects in ([],) if text == REFUSED else (["--subject", "mujoco/mjcf"], ["--subject", "pinocchio/urdf"]):
        done = harness(command, "bar_pendulum", "--mjcf", str(path), *subjects, cwd=tmp_path)
        assert done.returncode == 2 and done.stdout == "", done.stdout + done.stderr
        assert len(done.stderr.splitlines()) == 1 and fragment in done.stderr
