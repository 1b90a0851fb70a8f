"""A night that is killed at random moments and goes on: no record lost, none doubled, and the result of a night that was not killed."""

from __future__ import annotations

import json
import os
import random
import re
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from catalogue import BUILT_IN
from support import make_library, without_progress

from harness.night.stage import Stage
from harness.night.stages import find_stages
from harness.results.history import History
from harness.results.night import Night

SYSTEMS = ["bar_pendulum", "spring_damper", "simple_pendulum"]
# By day the stages that are soonest complete, of two mechanisms; at night all of them.
SOME = ["--stage", "cross-check", "--stage", "survey", "--survey", "robots"]
ALL = ["--survey", "robots", "--case", "far_base", "--faults", "1"]
KILLS = [
    pytest.param(2, SYSTEMS[:2], SOME, id="two kills"),
    pytest.param(10, SYSTEMS, ALL, id="ten kills", marks=pytest.mark.nightly),
]
# What differs between two runs of the same: times, and what is made of them.
TIMES = re.compile(r".*(seconds|fastest|slowest|repetitions|trusted|exponent).*")


def command(arguments: list[str]) -> list[str]:
    asked = ["--library", "library", "--states", "60", "--workers", "2", "--out", "out", "--resume", *arguments]
    return [sys.executable, "-m", "harness", "nightly", *asked]


def folder_with_library(folder: Path, systems: list[str]) -> Path:
    make_library(folder / "library", systems)
    (folder / "robots").mkdir()
    for name in systems:
        shutil.copy(BUILT_IN.model_path(name, "urdf"), folder / "robots")
    return folder


def rows(history: Path) -> int:
    """How many parts are stored by now."""
    if not history.is_file():
        return 0
    try:
        # One that may write plays back the journal of a commit that was killed.
        with sqlite3.connect(f"file:{history}?mode=rw", uri=True, timeout=10) as connection:
            return int(connection.execute("SELECT count(*) FROM parts").fetchone()[0])
    except sqlite3.OperationalError:
        return 0


def without_times(item: Any) -> Any:
    if isinstance(item, dict):
        return {name: without_times(value) for name, value in item.items() if not TIMES.fullmatch(name)}
    return [without_times(value) for value in item] if isinstance(item, list) else item


def stored(folder: Path) -> dict[str, Counter[str]]:
    """Stage to all that the one night of a folder has stored of it, without times, each row with how often it is there."""
    with History(folder / "out" / "history.sqlite") as history:
        # A kill before a night has said what it was asked leaves one that nothing refers to.
        nights = [night for number in history.studies(Night) if (night := history.read(number, Night)).settings]
    [night] = nights
    assert night.ended
    with sqlite3.connect(folder / "out" / "history.sqlite") as connection:
        found = {}
        for begun in night.begun:
            parts = connection.execute("SELECT part, content FROM parts WHERE study_id = ?", (begun.study,)).fetchall()
            found[begun.stage] = Counter(
                f"{part} {json.dumps(without_times(json.loads(text.replace(str(folder), ''))), sort_keys=True)}" for part, text in parts
            )
        done = Counter((one.stage, one.unit) for one in night.done)
    assert set(done.values()) == {1}
    return found


def keys(found: dict[str, Counter[str]]) -> dict[str, Counter[str]]:
    """Of measurements, whose numbers are times, which there are."""
    names = ("system", "method", "subject", "case", "part")

    def key(row: str) -> str:
        part, _, text = row.partition(" ")
        content = json.loads(text)
        return f"{part} {[content.get(name) for name in names] if isinstance(content, dict) else content}"

    return {stage: Counter({key(row): count for row, count in every.items()}) for stage, every in found.items()}


@pytest.mark.ci
@pytest.mark.parametrize(("kills", "systems", "arguments"), KILLS)
def test_a_killed_night_goes_on_and_ends_as_one_that_was_not(kills: int, systems: list[str], arguments: list[str], tmp_path: Path) -> None:
    quiet, killed = folder_with_library(tmp_path / "quiet", systems), folder_with_library(tmp_path / "killed", systems)
    done = subprocess.run(command(arguments), cwd=quiet, capture_output=True, text=True, timeout=1800, check=False)
    assert done.returncode in (0, 1), done.stdout + done.stderr
    total, history = rows(quiet / "out" / "history.sqlite"), killed / "out" / "history.sqlite"

    draw, happened = random.Random(kills), 0
    for moment in sorted(draw.uniform(0, 0.9) for _ in range(kills)):
        process = subprocess.Popen(
            command(arguments), cwd=killed, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, start_new_session=True
        )
        with process:
            while process.poll() is None and rows(history) < moment * total:
                time.sleep(0.02)
            time.sleep(draw.uniform(0, 0.5))
            before = rows(history)
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
                happened += 1
            process.wait(60)
        assert rows(history) >= before
        if process.returncode != -signal.SIGKILL:
            break
    assert happened >= min(kills, 2)
    last = subprocess.run(command(arguments), cwd=killed, capture_output=True, text=True, timeout=1800, check=False)
    assert last.returncode == done.returncode, last.stdout + last.stderr
    assert "goes on: " in without_progress(last.stderr)

    expected, found = stored(quiet), stored(killed)
    assert keys(found) == keys(expected)
    exact = [stage for stage in expected if not stage_of(stage).is_timed]
    assert {stage: found[stage] for stage in exact} == {stage: expected[stage] for stage in exact}
    assert all(expected.values())


def answers(folder: Path) -> int:
    """Outcomes of tasks that are kept by now, those of units under way alone."""
    # The night may remove a folder meanwhile, over which ``Path.rglob`` stumbles.
    return sum(not name.startswith(".") for _, _, names in os.walk(folder / "cache" / "nights") for name in names)


@pytest.mark.ci
@pytest.mark.parametrize(("seed", "most"), [(1, 4), *(pytest.param(seed, 1000, marks=pytest.mark.nightly) for seed in range(2, 8))])
def test_a_unit_goes_on_behind_the_batch_that_was_under_way(seed: int, most: int, tmp_path: Path) -> None:
    """One system, of whose unit nothing is complete when it is killed; what is waited for is a number of answers, not a time."""
    asked = ["--stage", "cross-check", "--states", "6000", "--faults", "0"]
    quiet, killed = (folder_with_library(tmp_path / name, ["bar_pendulum"]) for name in ("quiet", "killed"))

    def begin(folder: Path, **options: Any) -> subprocess.Popen[str]:
        variables = {**os.environ, "HARNESS_CACHE": str(folder / "cache")}
        options |= {"env": variables, "stderr": subprocess.PIPE, "start_new_session": True}
        return subprocess.Popen(command(asked), cwd=folder, text=True, **options)

    with begin(quiet) as process:
        said = process.communicate(timeout=600)[1]
    assert process.returncode == 0, said
    assert "interrupted with anything answered" in said

    draw, kills = random.Random(seed), 0
    while True:
        before, more = answers(killed), draw.randint(1, 8)
        with begin(killed, stdout=subprocess.DEVNULL) as process:
            until = time.monotonic() + 120
            while kills < most and process.poll() is None and (kept := answers(killed)) < before + more and time.monotonic() < until:
                time.sleep(0.005)
            if kills < most and process.poll() is None:
                assert kept >= before + more, f"{kept} answers, of which {before} are from before"
                os.killpg(process.pid, signal.SIGKILL)
                kills += 1
            said = without_progress(process.communicate(timeout=60)[1])
        assert not before or f"goes on: it has 0 complete units, and {before} answer" in said
        if process.returncode != -signal.SIGKILL:
            break
        assert answers(killed) >= kept
    assert kills >= min(most, 10)
    assert process.returncode == 0, said
    assert stored(killed) == stored(quiet)
    assert not answers(killed)


def stage_of(name: str) -> Stage:
    return find_stages()[name]
