"""Two versions of an engine held against each other: what changed is told, with its term, and nothing else."""

from __future__ import annotations

import json
import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest
import toy_engine
from support import Done, cache_with_mechanisms, harness, losing_after

from harness.environments import find_environments

SLOWER = toy_engine.RIGHT.replace(
    "def accelerate(q, v, tau):", "def accelerate(q, v, tau):\n    import time; time.sleep(0.01 * len(q))\n   "
)
REFUSING = toy_engine.RIGHT + "raise ValueError('no licence')\n"
VERSIONS = {
    "1.0": toy_engine.RIGHT,
    "1.1": toy_engine.RIGHT,
    "1.2": toy_engine.HEAVIER,
    "1.3": toy_engine.LACKING,
    "1.4": SLOWER,
    "1.5": REFUSING,
}


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    with toy_engine.planted(tmp_path_factory.mktemp("toy"), VERSIONS) as root:
        yield root


def upgraded(library: Path, *arguments: str) -> tuple[Done, list[dict[str, object]]]:
    done = harness("upgrade", *arguments, "--library", str(library), "--states", "100", "--json", "out.json", cwd=library)
    return done, json.loads((library / "out.json").read_text())["changes"] if done.returncode < 2 else []


@pytest.mark.ci
def test_two_versions_that_do_alike_have_no_changes(library: Path) -> None:
    done, changes = upgraded(library, "toy", "1.0", "1.1")
    assert (done.returncode, [one for one in changes if one["what"] != "time per state"]) == (0, [])
    assert done.stdout == "No: toy 1.1 does not change bar_pendulum against 1.0; accelerations are the same to rounding\n"
    assert json.loads((library / "out.json").read_text())["summary"] == done.stdout.strip()


@pytest.mark.ci
def test_a_version_without_its_zeros_is_that_version(library: Path) -> None:
    done, _ = upgraded(library, "toy", "1", "1.1.0")
    assert done.stdout.startswith("No: toy 1.1 does not change bar_pendulum against 1.0")


@pytest.mark.ci
def test_a_subject_names_a_version_in_the_same_way(library: Path) -> None:
    arguments = ("bar_pendulum", "--library", str(library), "--subject", "toy@1/urdf", "--states", "20", "--json", "out.json")
    assert harness("check", *arguments, cwd=library).returncode == 0
    assert {one["subject"] for one in json.loads((library / "out.json").read_text())["records"]} == {"toy@1.0/urdf"}


@pytest.mark.ci
def test_a_changed_term_is_told_apart_and_named(library: Path) -> None:
    done, changes = upgraded(library, "toy", "1.1", "1.2", "bar_pendulum")
    assert done.returncode == 1
    by_kind = {str(one["what"]): one for one in changes}
    assert by_kind["verdict"]["is_worse"] and by_kind["verdict"]["before"] == "agrees"
    assert "median backward error" in by_kind
    [terms] = [one for one in changes if one["what"] == "terms"]
    assert "gravity: force on pin is wrong at every state" in str(terms["now"]) and str(terms["before"]).startswith("gravity: agrees")
    first, *others = done.stdout.splitlines()
    assert re.fullmatch(r"Yes, for the worse: toy 1\.2 changes bar_pendulum against 1\.1: accelerations by up to \S+ %", first), first
    assert "bar_pendulum, toy/urdf: worse" in others
    assert any(line.startswith("  1.2 is off by up to ") and "; 1.1 agrees (worst " in line for line in others)
    assert "  new: gravity: force on pin is wrong at every state" in done.stdout


def test_what_becomes_better_is_told_and_ends_well(library: Path) -> None:
    done, changes = upgraded(library, "toy", "1.2", "1.0")
    assert done.returncode == 0
    assert {"verdict", "terms"} <= {one["what"] for one in changes}
    assert not any(one["is_worse"] for one in changes)
    assert done.stdout.startswith("Yes, for the better: toy 1.0 changes bar_pendulum against 1.2")
    assert "  no longer: gravity: force on pin is wrong" in done.stdout


@pytest.mark.ci
def test_a_refusal_is_a_change(library: Path) -> None:
    done, changes = upgraded(library, "toy-engine", "1.0", "1.5")
    assert done.returncode == 1
    assert "no licence" in str(next(one for one in changes if one["what"] == "message")["now"])
    done, changes = upgraded(library, "toy", "1.0", "1.3")
    assert done.returncode == 1
    assert [one["now"] for one in changes if one["what"] == "verdict"] == ["unsupported"]
    assert "1.3 refuses it: " in done.stdout


@pytest.mark.ci
def test_where_nobody_answers_nothing_was_compared(library: Path) -> None:
    done, _ = upgraded(library, "toy", "1.3", "1.5")
    assert done.returncode == 1
    assert done.stdout.startswith("Nothing was compared: neither toy 1.3 nor 1.5 answers about bar_pendulum\n")


@pytest.mark.ci
def test_a_cost_is_told_where_it_is_asked_for_and_counts_against_nobody(library: Path) -> None:
    done, changes = upgraded(library, "toy", "1.0", "1.4")
    assert (done.returncode, done.stdout.count("\n")) == (0, 1)
    [cost] = [one for one in changes if one["what"] == "time per state"]
    assert not cost["is_worse"] and float(str(cost["now"]).split()[0]) > 100
    done, _ = upgraded(library, "toy", "1.0", "1.4", "--verbose")
    assert done.returncode == 0 and "\n  time per state: " in done.stdout


@pytest.mark.ci
def test_a_red_check_of_a_version_ends_with_the_command_that_diagnoses_that_version(library: Path) -> None:
    done = harness("check", "bar_pendulum", "--library", str(library), "--subject", "toy@1.2/urdf", "--states", "40", cwd=library)
    [command] = re.findall(r"^the whole diagnosis: harness (.*)$", done.stdout, re.MULTILINE)
    assert "--subject toy@1.2/urdf" in command
    diagnosed = harness(*shlex.split(command), cwd=library)
    assert (done.returncode, diagnosed.returncode) == (1, 1)
    assert "gravity" in diagnosed.stdout and "toy@1.2/urdf" in diagnosed.stdout


@pytest.mark.parametrize(
    ("arguments", "fragment"),
    [
        (("toy", "1.0"), "name two versions"),
        (("toy", "1.0", "1.0"), "toy@1.0 is one version; name two"),
        (("toy", "1.0", "1.0.0"), "toy@1.0 is one version; name two"),
        (("toy", "1.0", "7.7"), "make one: harness engines add toy==7.7"),
        (("toy", "1.0", "latest"), "'latest' is no version; expected one as 3.13.0"),
        (("tay", "1.0", "1.1"), "no engine is called 'tay'"),
        (("toy", "--bisect", "1.0"), "expected two versions as 3.3.0..4.0.0"),
        (("mujoco", "4.0.0", "0.1"), "mujoco 0.1 is in no environment"),
    ],
)
def test_bad_usage_says_what_to_do(library: Path, arguments: tuple[str, ...], fragment: str) -> None:
    done, _ = upgraded(library, *arguments)
    assert done.returncode == 2
    assert fragment in done.stderr


@pytest.mark.ci
def test_a_planted_wheel_is_bisected_among_five(library: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """From an index to the name of the version and its term, every environment made on the way."""
    monkeypatch.setenv("HARNESS_CACHE", str(cache_with_mechanisms(tmp_path / "cache")))
    wheels = tmp_path / "wheels"
    wheels.mkdir()
    for number in range(5):
        toy_engine.write_wheel(wheels, f"5.{number}", toy_engine.HEAVIER if number >= 3 else toy_engine.RIGHT)
    monkeypatch.setenv("PIP_FIND_LINKS", " ".join([str(wheels), *filter(None, [toy_engine.links()])]))
    done, changes = upgraded(library, "toy", "--bisect", "5..5.4.0")
    assert done.returncode == 1, done.stdout + done.stderr
    first, second = done.stdout.splitlines()[:2]
    said = "toy 5.3 is the first version that changes anything, and 5.2 is as 5.0"
    assert first == f"{said}; asked: 5.0, 5.4, 5.2, 5.3 of 5 versions"
    assert second.startswith("Yes, for the worse: toy 5.3 changes bar_pendulum against 5.2: ")
    assert any(one["what"] == "terms" and "gravity" in str(one["now"]) for one in changes)
    assert [one.version for one in find_environments("toy")] == ["5.0", "5.2", "5.3", "5.4"]
    done, _ = upgraded(library, "toy", "--bisect", "5.0..5.2")
    assert done.returncode == 0
    assert done.stdout.startswith("No version of toy up to 5.2 changes what 5.0 does; asked: 5.0, 5.2 of 3 versions\nNo: toy 5.2 ")


@pytest.mark.parametrize("answers", [0, 5])
def test_without_its_cluster_nothing_is_said_of_versions(library: Path, answers: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("support.InThisProcess", losing_after(answers))
    done, _ = upgraded(library, "toy", "1.0", "1.2", "--scheduler", "tcp://cluster:8786")
    assert done.returncode == 3, done.stdout + done.stderr
    assert "the scheduler at tcp://cluster:8786 is gone" in (done.stdout + done.stderr).splitlines()[0].replace("The", "the")
    assert "change" not in done.stdout
