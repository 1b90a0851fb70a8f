"""Every printed number can be had again: the commands that stand in a report are run, and give the numbers beside them."""

from __future__ import annotations

import json
import re
import shlex
from pathlib import Path
from typing import Any

import pytest
from support import changed_engine, expected_entry, harness, make_library, records_of, written_site

from harness.library import Library
from harness.results.hard_states import FoundState, keep
from harness.results.table import error_text
from harness.version import __version__

# Of another machine with the very versions of this run: nobody measured that number here.
STALE = FoundState(
    state={"q": [0.5, -0.25], "v": [3.0, -2.0], "tau": [1.0, 0.0]}, subject="mujoco/mjcf", backward_error=5230.0, digits_lost=3.7,
    verdict="unstable", term="mass matrix", statement="stored elsewhere", versions={"harness": __version__}, date="2026-01-01",
)  # fmt: skip
# No number for a few of the fastest states.
ENGINE = changed_engine("return np.where(v[:, :1] > 9.5, np.nan, exact(q, v, tau))")


@pytest.fixture(scope="module")
def reported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a report on a library with a stored state, a wrong model and an engine that answers NaN at times."""
    root = make_library(tmp_path_factory.mktemp("replays") / "library", ["arm_2r", "bar_pendulum"], {"silent": ENGINE})
    keep(Library.at(root), "arm_2r", [STALE])
    model = root / "mjcf" / "bar_pendulum.xml"
    model.write_text(model.read_text().replace("9.81", "9.8100001"))
    # What is expected is not diagnosed, which would take the most of the time.
    wrong = [("bar_pendulum", "mujoco/mjcf", "disagrees", 1e12), ("bar_pendulum", "pinocchio/mjcf", "disagrees", 1e12)]
    wrong += [(name, "silent/mjcf", "error", 1e12) for name in ("arm_2r", "bar_pendulum")]
    entries = "".join(expected_entry(*one) for one in wrong)
    differs = 'system = "bar_pendulum"\nquantity = "gravity"\njoint = ""\nulps = 1e9\nreason = "planted"\nlink = "here"\n'
    (root / "expected_verdicts.toml").write_text(f"{entries}[[differs]]\n{differs}")
    done = harness("report", "--library", str(root), "--out", "out", cwd=root)
    assert done.returncode == 0, done.stdout + done.stderr
    return root / "out"


def replayed(command: str, folder: Path) -> dict[str, Any]:
    """The one record that a replay command computes."""
    name, *arguments = shlex.split(command)
    assert name == "harness"
    harness(*arguments, "--json", "again.json", cwd=folder)
    [record] = json.loads((folder / "again.json").read_text())["records"]
    return dict(record)


def same(one: float | None, other: float | None) -> bool:
    return error_text(one) == error_text(other)


@pytest.mark.ci
def test_every_worst_case_gives_its_number_again(reported: Path) -> None:
    document = json.loads((reported / "report.json").read_text())
    page, markdown = written_site(reported), (reported / "report.md").read_text()
    records = {(record["system"], record["subject"]): record for record in records_of(reported / "report.json")}
    assert len(document["worst_cases"]) == len(records) == 12
    for case in document["worst_cases"]:
        again, record = replayed(case["replay"], reported), records[case["system"], case["subject"]]
        assert same(case["backward_error"], again["backward_error"]) and case["verdict"] == again["verdict"], case
        number = error_text(case["backward_error"])
        if record["verdict"] != "error":
            assert case["backward_error"] == record["backward_error"]
            # The text and the list of worst cases say the same.
            assert case["verdict"] == "agrees" or f"{case['subject']} {number}" in markdown
            assert f"{case['system']} {case['verdict']} {number} data roundoffs" in page.words
        assert case["replay"] in page.text
    assert "stored elsewhere" not in page.text


@pytest.mark.ci
def test_every_record_gives_its_numbers_again(reported: Path) -> None:
    records = records_of(reported / "report.json")
    found = {record["subject"]: record["representative"] for record in records if record["system"] == "bar_pendulum"}
    # At rest and below every sampled rate: the simplest state that fails is another one than the worst.
    assert found["mujoco/mjcf"]["state"]["v"] == [0.0] and found["lagrange"] is None
    page = written_site(reported).text
    for record in records:
        again = replayed(record["replay"], reported)
        assert same(record["backward_error"], again["backward_error"]) and same(record["relative_error"], again["relative_error"])
        if shown := record["representative"]:
            again = replayed(shown["replay"], reported)
            assert again["verdict"] == record["verdict"] and same(shown["backward_error"], again["backward_error"])
            assert shown["replay"] in page
    [silent] = [record for record in records if (record["system"], record["subject"]) == ("arm_2r", "silent/mjcf")]
    assert silent["verdict"] == "error" and silent["representative"]["backward_error"] is None
    # The number beside the table is that of the states that have one.
    assert 0 < silent["backward_error"] < 64


@pytest.mark.ci
def test_where_states_come_from_is_said(reported: Path) -> None:
    records = records_of(reported / "report.json")
    for record in records:
        origins = record["origins"]
        assert sum(origins.values()) == record["states"]
        assert origins["sampled"] == 500 and origins["stored"] == (record["system"] == "arm_2r")
    done = harness("check", "arm_2r", "--library", str(reported.parent), "--subject", "lagrange", "--verbose", cwd=reported)
    [line] = [line for line in done.stdout.splitlines() if line.startswith("states:")]
    assert (
        line.startswith("states: 500 sampled, 500 searched for by hypothesis") and "; on top 1 stored with the system, 0 simplest" in line
    )
    for text in (written_site(reported).text, (reported / "report.md").read_text()):
        assert "500 sampled" in text and "; on top 0 to 1 stored with the system" in text
    given = harness(*shlex.split(records[0]["replay"])[1:], cwd=reported)
    assert "states:" not in given.stdout


@pytest.mark.ci
def test_costs_carry_their_spread_and_the_load(reported: Path) -> None:
    document = json.loads((reported / "report.json").read_text())
    for record in records_of(reported / "report.json"):
        assert 0 < record["fastest_seconds_per_state"] <= record["seconds_per_state"]
    assert re.fullmatch(r"\d+\.\d\d at the start", document["run"]["machine"]["load"])
    assert int(document["run"]["machine"]["worker processes"]) > 0
    done = harness("check", "arm_2r", "--library", str(reported.parent), "--subject", "lagrange", "--verbose", cwd=reported)
    assert re.search(r"time per state +fastest$", done.stdout, re.MULTILINE)
    assert re.search(r"^times: .* worker processes \d+, cpus \d+, load \d+\.\d\d at the start", done.stdout, re.MULTILINE)


@pytest.mark.ci
def test_the_terminal_shows_both_states_with_their_numbers(reported: Path) -> None:
    (reported.parent / "expected_verdicts.toml").unlink()
    done = harness("check", "bar_pendulum", "--library", str(reported.parent), "--subject", "mujoco/mjcf", cwd=reported)
    worst, simplest = re.findall(r"backward error ([\d.e+]+) data roundoffs", done.stdout)
    commands = [line.partition("replay: ")[2] for line in done.stdout.splitlines() if "replay: " in line]
    for number, command in zip((worst, simplest), commands, strict=True):
        assert f"{replayed(command, reported)['backward_error']:.3g}" == number


@pytest.mark.nightly
def test_every_worst_case_of_the_catalogue_gives_its_number_again(tmp_path: Path) -> None:
    assert harness("report", "--out", "out", cwd=tmp_path).returncode == 0
    for case in json.loads((tmp_path / "out" / "report.json").read_text())["worst_cases"]:
        again = replayed(case["replay"], tmp_path)
        assert same(case["backward_error"], again["backward_error"]) and case["verdict"] == again["verdict"], case
