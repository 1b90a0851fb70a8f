"""A machine that is busy with other things changes no verdict, no name and no number."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from catalogue import BUILT_IN
from support import harness

BUSY = 8
# What a run says of its clock and its machine.
TIMES = {"seconds_per_state", "fastest_seconds_per_state", "reference_seconds", "compilation_seconds", "derivation_seconds"}
ABOUT_THE_RUN = {"harness", "run"}


@contextmanager
def busy_machine() -> Iterator[None]:
    """``BUSY`` processes that do nothing but compute."""
    processes = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(BUSY)]
    try:
        yield
    finally:
        for process in processes:
            process.kill()
            process.wait()


def without_times(found: Any) -> Any:
    if isinstance(found, dict):
        return {name: without_times(value) for name, value in found.items() if name not in TIMES}
    return [without_times(value) for value in found] if isinstance(found, list) else found


@pytest.mark.nightly
@pytest.mark.parametrize("command", ["check", "diagnose"])
def test_a_busy_machine_changes_nothing_but_times(tmp_path: Path, command: str) -> None:
    wrong = tmp_path / "double_pendulum.xml"
    text = BUILT_IN.model_path("double_pendulum", "mjcf").read_text()
    assert text.count("<inertial pos=") == 2
    wrong.write_text(text.replace('<inertial pos="0 0 -', '<inertial pos="0 0 -1', 1))
    stand_in = ["--mjcf", str(wrong)] if command == "diagnose" else []

    def run(name: str) -> Any:
        folder = tmp_path / name
        folder.mkdir()
        done = harness(command, "double_pendulum", *stand_in, "--states", "40", "--json", "out.json", isolated=True, cwd=folder)
        assert done.returncode == (1 if stand_in else 0), done.stderr
        found = json.loads((folder / "out.json").read_text())
        return without_times({part: value for part, value in found.items() if part not in ABOUT_THE_RUN})

    alone = run("alone")
    with busy_machine():
        assert run("beside") == alone
    assert len([record for record in alone["records"] if record["quantity"] == "accelerations"]) == 5
    wrong_verdicts = {record["subject"]: record["verdict"] for record in alone["records"] if record["verdict"] != record["expected"]}
    assert wrong_verdicts == (dict.fromkeys(["mujoco/mjcf", "pinocchio/mjcf"], "disagrees") if stand_in else {})
    assert not stand_in or alone["causes"]
