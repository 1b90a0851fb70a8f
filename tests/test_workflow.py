"""The workflow of a night, without the service: its commands are the harness's own, and its steps run with stand-ins for what they call."""

from __future__ import annotations

import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import click
import pytest
import yaml

from benchmarks.history import HISTORY
from harness.cli import main

REPOSITORY = Path(__file__).resolve().parents[1]
FILE = REPOSITORY / ".github" / "workflows" / "nightly.yml"
WORKFLOW: dict[Any, Any] = yaml.safe_load(FILE.read_text(encoding="utf-8"))
STEPS: list[dict[str, Any]] = [step for job in WORKFLOW["jobs"].values() for step in job["steps"]]
SCRIPTS = {step["name"]: step["run"] for step in STEPS if "run" in step}
# What GitHub runs a step of shell: bash with.
BASH = ["bash", "--noprofile", "--norc", "-eo", "pipefail"]
VARIABLES = {"STATES": "50", "SEED": "3", "RESUME": "--resume", "COMMIT": "abc", "BRANCH": "main", "RUN": "run 7"}
STAND_IN = """#!/usr/bin/env bash
echo "$(basename "$0") $*" >> "$CALLS"
for word in "$@"; do [ "$previous" = --body-file ] && cp "$word" "$CALLS.body"; previous=$word; done
case "$(basename "$0") $1 $2" in
  "gh issue list") echo -n "$OPEN" ;;
  "harness nightly --states") mkdir -p night; echo '{"changes": [1, 2]}' > night/nightly.json; exit "$HARNESS_STATUS" ;;
esac
"""


def commands(script: str) -> list[list[str]]:
    """The words of every command of the harness in a script, variables replaced."""
    text = re.sub(r"\$(\w+)", lambda found: VARIABLES.get(found[1], found[0]), script)
    lines = [line for line in text.splitlines() if re.search(r"\bharness (?!--)", line)]
    return [shlex.split(re.split(r"\|\||&&|;|>", line.partition("harness ")[2])[0]) for line in lines]


@pytest.mark.parametrize("name", SCRIPTS)
def test_a_step_is_a_script(name: str) -> None:
    done = subprocess.run(["bash", "-n"], input=SCRIPTS[name], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


def test_every_command_is_one_of_the_harness() -> None:
    found = [words for script in SCRIPTS.values() for words in commands(script)]
    assert [words[0] for words in found] == ["nightly"]
    for name, *arguments in found:
        command = main.get_command(click.Context(main), name)
        assert command is not None
        context = command.make_context(name, arguments)  # raises UsageError
        assert context.params["resume"] and context.params["directory"] == Path("night")


def test_nothing_that_others_write_becomes_a_part_of_a_script() -> None:
    assert [name for name, script in SCRIPTS.items() if "${{" in script] == []


@pytest.mark.parametrize(
    ("job", "kept", "between"),
    [("night", "night/history.sqlite*", "Run the night"), ("benchmarks", HISTORY.relative_to(REPOSITORY).as_posix(), "Measure")],
)
def test_the_history_comes_from_the_nights_before_and_is_kept_whatever_happens(job: str, kept: str, between: str) -> None:
    steps = WORKFLOW["jobs"][job]["steps"]
    used = {step["uses"].partition("@")[0]: step for step in steps if "uses" in step}
    restore, save = used["actions/cache/restore"], used["actions/cache/save"]
    assert restore["with"]["path"] == save["with"]["path"] == kept
    assert restore["with"]["key"] == save["with"]["key"]
    assert save["with"]["key"].startswith(restore["with"]["restore-keys"])
    assert "run_attempt" in save["with"]["key"] and save["if"] == "always()"
    places = [steps.index(restore), next(place for place, step in enumerate(steps) if step.get("name") == between), steps.index(save)]
    assert places == sorted(places)


@pytest.mark.parametrize("status", [0, 1])
def test_benchmarks_are_shown_whatever_they_say_and_the_job_ends_as_they_do(tmp_path: Path, status: int) -> None:
    program = tmp_path / "python"
    program.write_text(f"#!/bin/sh\necho 'name before after'\nexit {status}\n")
    program.chmod(0o755)
    environment = os.environ | {"PATH": f"{tmp_path}:{os.environ['PATH']}", "GITHUB_STEP_SUMMARY": str(tmp_path / "summary")}
    command = [*BASH, "-c", SCRIPTS["Measure"]]
    done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stdout) == (status, "name before after\n")
    assert (tmp_path / "summary").read_text() == "```\nname before after\n```\n"


def test_what_a_job_may_do_is_what_its_steps_need() -> None:
    assert WORKFLOW["permissions"] == {"contents": "read"}
    assert WORKFLOW["jobs"]["night"]["permissions"] == {"contents": "read", "issues": "write", "actions": "write"}
    assert WORKFLOW["jobs"]["publish"]["permissions"] == {"pages": "write", "id-token": "write"}
    # YAML 1.1 reads the word as true.
    assert set(WORKFLOW[True]) == {"schedule", "workflow_dispatch"}
    assert WORKFLOW["concurrency"] == {"group": "nightly"}


def test_the_night_runs_the_tests_that_ci_leaves_out() -> None:
    tests, settings = WORKFLOW["jobs"]["tests"], (REPOSITORY / ".ci" / "run").read_text(encoding="utf-8")
    [command] = [shlex.split(step["run"]) for step in tests["steps"] if "pytest" in step.get("run", "")]
    assert command[:5] == ["python", "-m", "pytest", "-m", "nightly"]
    assert command[5:7] == re.findall(r"--(?:harness-states|hypothesis-profile)=\w+", settings)
    # Which cases have their turn follows from the number of the run, and what each file costs is told.
    assert command[7:] == ["--night", "$NIGHT", "--costs", "file"]
    assert tests["if"] == "${{ !inputs.resume }}"


def test_the_night_has_the_rules_of_accessibility_before_its_tests() -> None:
    """Without them the tests of pages are skipped."""
    taking, running = (step for step in WORKFLOW["jobs"]["tests"]["steps"] if "axe" in str(step))
    assert running["env"]["HARNESS_AXE"] == "${{ runner.temp }}/package/axe.min.js"
    [packed, unpacked] = [shlex.split(part) for part in taking["run"].split("&&")]
    name, _, version = packed[2].partition("@")
    assert packed[:2] == ["npm", "pack"] and unpacked == ["tar", "-xzf", f"{name}-{version}.tgz", "-C", "$RUNNER_TEMP"]


def run(name: str, folder: Path, **variables: str) -> tuple[subprocess.CompletedProcess[str], list[str]]:
    """A step with stand-ins for ``gh`` and ``harness`` and this Python as ``python``, and what it called."""
    programs = folder / "programs"
    programs.mkdir(exist_ok=True)
    (programs / "python").write_text(f'#!/bin/sh\nexec {shlex.quote(sys.executable)} "$@"\n')
    (programs / "python").chmod(0o755)
    for program in ("gh", "harness"):
        (programs / program).write_text(STAND_IN)
        (programs / program).chmod(0o755)
    environment = os.environ | VARIABLES | {"PATH": f"{programs}:{os.environ['PATH']}", "CALLS": str(folder / "calls"), "OPEN": ""}
    environment |= {"HARNESS_STATUS": "0", "GITHUB_OUTPUT": str(folder / "output")} | variables
    script = folder / "step.sh"
    script.write_text(SCRIPTS[name])
    done = subprocess.run([*BASH, str(script)], cwd=folder, env=environment, capture_output=True, text=True, timeout=60, check=False)
    calls = folder / "calls"
    return done, calls.read_text().splitlines() if calls.is_file() else []


@pytest.mark.parametrize("status", ["0", "1", "2", "3"])
def test_the_night_s_status_is_handed_on_and_ends_no_step(tmp_path: Path, status: str) -> None:
    done, calls = run("Run the night", tmp_path, HARNESS_STATUS=status)
    assert done.returncode == 0, done.stderr
    assert calls == ["harness nightly --states 50 --seed 3 --survey harness/robots --out night --json night/nightly.json --resume"]
    assert (tmp_path / "output").read_text().split() == [f"status={status}", "changes=2"]


def test_a_night_without_a_document_has_no_changes(tmp_path: Path) -> None:
    done, _ = run("Run the night", tmp_path, STATES="", HARNESS_STATUS="70")
    assert done.returncode == 0
    (tmp_path / "night" / "nightly.json").unlink()
    (tmp_path / "programs" / "harness").write_text("#!/bin/sh\nexit 70\n")
    script = subprocess.run(
        [*BASH, str(tmp_path / "step.sh")], cwd=tmp_path, capture_output=True, text=True, check=False,
        env=os.environ | VARIABLES | {"PATH": f"{tmp_path / 'programs'}:{os.environ['PATH']}", "GITHUB_OUTPUT": str(tmp_path / "second")},
    )  # fmt: skip
    assert script.returncode == 0
    assert (tmp_path / "second").read_text().split() == ["status=70", "changes=0"]


def test_a_night_in_which_all_is_well_alerts_nobody_and_closes_the_alert(tmp_path: Path) -> None:
    done, calls = run("Alert", tmp_path, STATUS="0", CHANGES="0")
    assert done.returncode == 0, done.stderr
    assert [call.split()[:3] for call in calls] == [["gh", "issue", "list"]]
    _, calls = run("Alert", tmp_path, STATUS="0", CHANGES="0", OPEN="12")
    assert calls[-1].startswith("gh issue close 12 ")


@pytest.mark.parametrize(("status", "changes"), [("1", "0"), ("0", "3"), ("", ""), ("70", "")])
def test_what_is_wrong_opens_an_issue_or_adds_to_it(tmp_path: Path, status: str, changes: str) -> None:
    (tmp_path / "night").mkdir()
    (tmp_path / "night" / "nightly.md").write_text("é" * 100_000)
    done, calls = run("Alert", tmp_path, STATUS=status, CHANGES=changes)
    assert done.returncode == 0, done.stderr
    assert [call.split()[:3] for call in calls] == [["gh", "issue", "list"], ["gh", "label", "create"], ["gh", "issue", "create"]]
    body = (tmp_path / "calls.body").read_text(encoding="utf-8")
    # GitHub takes 65,536 characters.
    assert f"Exit status {status or 'unknown'}, {changes or 0} changes of the trend: run 7" in body and 30_000 <= len(body) < 65_536
    done, calls = run("Alert", tmp_path, STATUS=status, CHANGES=changes, OPEN="12")
    assert calls[-1].startswith("gh issue comment 12 ")


def test_a_night_without_a_summary_alerts_too(tmp_path: Path) -> None:
    _, calls = run("Alert", tmp_path, STATUS="70", CHANGES="")
    assert calls[-1].startswith("gh issue create")
    assert "no summary" in (tmp_path / "calls.body").read_text()


def test_a_night_that_takes_too_long_goes_on_with_its_own_commit_and_seed(tmp_path: Path) -> None:
    assert any(step.get("if") == "steps.night.outputs.status == '124'" for step in STEPS)
    done, calls = run("Go on in another run", tmp_path)
    assert done.returncode == 0
    inputs = dict(word.split("=") for word in calls[0].split() if "=" in word)
    assert inputs == {"states": "50", "seed": "3", "commit": "abc", "resume": "true"}
    assert set(inputs) == set(WORKFLOW[True]["workflow_dispatch"]["inputs"])


def test_the_page_is_published_without_the_history(tmp_path: Path) -> None:
    (tmp_path / "night").mkdir()
    for name in ("index.html", "history.sqlite", "history.sqlite-journal", "nightly.json"):
        (tmp_path / "night" / name).write_text(json.dumps(name))
    done, _ = run("Choose what is published", tmp_path)
    assert done.returncode == 0
    assert sorted(path.name for path in (tmp_path / "page").iterdir()) == ["index.html", "nightly.json"]
    assert (tmp_path / "output").read_text() == "page=yes\n"


def test_a_night_without_a_page_publishes_none(tmp_path: Path) -> None:
    done, _ = run("Choose what is published", tmp_path)
    assert done.returncode == 0
    assert not (tmp_path / "output").exists()
    assert WORKFLOW["jobs"]["publish"]["if"].endswith("needs.night.outputs.page == 'yes'")


@pytest.mark.parametrize(("status", "ends"), [("1", 1), ("3", 3), ("", 1)])
def test_the_job_ends_as_the_night_did(tmp_path: Path, status: str, ends: int) -> None:
    done, _ = run("End as the night did", tmp_path, STATUS=status)
    assert done.returncode == ends
