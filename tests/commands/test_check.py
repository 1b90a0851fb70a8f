"""The command line as its users meet it: tables, exit statuses, JSON, replays, and bad input."""

from __future__ import annotations

import json
import re
import shlex
import shutil
import sqlite3
import subprocess
import sys
from pathlib import Path

import pytest
from support import engine_source, expected_entry, harness, harness_in_a_process, make_library, records_of, without_progress

from harness.library import Library
from harness.results.hard_states import load_found

BUILT_IN = Library.built_in()
SYSTEMS = BUILT_IN.system_names()
FEW = 40
CONTRACT = {
    "system",
    "subject",
    "states",
    "verdict",
    "expected",
    "backward_error",
    "relative_error",
    "worst_state",
    "seconds_per_state",
    "message",
}


@pytest.fixture
def library(tmp_path: Path) -> Path:
    """A library with the bar pendulum and the spring-damper."""
    return make_library(tmp_path / "library", ["bar_pendulum", "spring_damper"])


def edit(path: Path, old: str, new: str) -> None:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))


# By day a tree with variants, a ball joint, a loop, a condition on velocities, and a mechanism that no engine expresses.
SOME = ["acrobot", "four_bar", "heavy_top", "rolling_disc", "rolling_disc_on_incline", "slider_crank"]
# What the table has for a verdict, where that is another word: constraints that give as documented are told from rigid ones, of which the
# verdict in the record does not speak.
TOLD = {"agrees": "(agrees|soft, as documented)"}
SOME_VARIANTS = [name for name in BUILT_IN.variant_names() if BUILT_IN.system_of(name) in SOME]


# The tests of harness/systems ask the same at more states; here the command's contract counts, and some do.
@pytest.mark.ci
@pytest.mark.parametrize("names", [[*SOME, *SOME_VARIANTS], pytest.param([], marks=pytest.mark.nightly)], ids=["some", "all"])
def test_check_of_everything_is_green_and_keeps_the_contract(tmp_path: Path, names: list[str]) -> None:
    done = harness_in_a_process("check", *names, "--all", "--states", str(FEW), "--json", "out.json", cwd=tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert without_progress(done.stderr) == ""
    data = json.loads((tmp_path / "out.json").read_text())
    assert {"harness", "python", "mujoco", "pin", "sympy"} <= set(data["harness"])
    # A mechanism's own models are asked of every subject, a variant of those that read its formats.
    systems, variants = (SOME, SOME_VARIANTS) if names else (SYSTEMS, BUILT_IN.variant_names())
    records = records_of(tmp_path / "out.json")
    assert len(records) == 5 * len(systems) + 2 * sum(len(BUILT_IN.formats_of(name)) for name in variants)
    assert all(record["verdict"] == record["expected"] for record in data["records"])
    for record in records:
        assert set(record) >= CONTRACT
        if record["verdict"] == "agrees":
            assert record["states"] == FEW + len(load_found(BUILT_IN, BUILT_IN.system_of(record["system"])))
            assert 0 < record["backward_error"] <= 64
        # What an engine documents that it leaves out is no departure.
        departs = record["verdict"] == "explained" and any(one["departs"] for one in record["readings"])
        told = "departs from its documentation: " if departs else TOLD.get(record["verdict"], record["verdict"])
        row = rf"^{re.escape(record['system'])} +{re.escape(record['subject'])} +{record['states']:,} +{told}"
        assert re.search(row, done.stdout, re.MULTILINE), row


@pytest.mark.nightly(nights=12)
@pytest.mark.parametrize("name", [*BUILT_IN.system_names(), *BUILT_IN.variant_names()])
def test_a_hundred_thousand_states_agree_everywhere(name: str, tmp_path: Path) -> None:
    done = harness_in_a_process("check", name, "--states", "100000", "--json", "out.json", cwd=tmp_path, timeout=7200)
    assert done.returncode == 0, done.stdout + done.stderr
    for record in records_of(tmp_path / "out.json"):
        if record["expected"] == "agrees":
            assert record["states"] == 100_000 + len(load_found(BUILT_IN, BUILT_IN.system_of(record["system"])))


@pytest.mark.ci
def test_the_same_seed_gives_the_same_states(tmp_path: Path) -> None:
    errors = []
    for seed in ("1", "1", "2"):
        # A fresh folder, because failing examples of a folder are tried first.
        folder = tmp_path / str(len(errors))
        folder.mkdir()
        harness(
            "check", "cart_pendulum", "--quantity", "accelerations", "--seed", seed, "--states", "100", "--json", "out.json", cwd=folder
        )
        records = records_of(folder / "out.json")
        errors.append([(record["backward_error"], record["worst_state"]) for record in records])
    assert errors[0] == errors[1] != errors[2]


@pytest.mark.ci
def test_a_wrong_model_is_exit_status_1_with_a_replay_that_shows_it(tmp_path: Path) -> None:
    model = tmp_path / "stiffer.xml"
    shutil.copy(Library.built_in().model_path("cart_pendulum", "mjcf"), model)
    edit(model, 'stiffness="270"', 'stiffness="270.001"')
    done = harness("check", "cart_pendulum", "--mjcf", str(model), cwd=tmp_path)
    assert done.returncode == 1
    assert "cart_pendulum mujoco/mjcf: disagrees, expected agrees" in done.stdout
    assert re.search(r"cart_pendulum +pinocchio/urdf +1,000 +agrees", done.stdout)
    command = shlex.split(next(line for line in done.stdout.splitlines() if "replay:" in line).partition("replay:")[2])
    assert command[0] == "harness"
    again = harness(*command[1:], cwd=tmp_path)
    assert again.returncode == 1
    assert re.search(r"cart_pendulum +mujoco/mjcf +1 +disagrees", again.stdout)


@pytest.mark.ci
def test_failing_examples_are_kept_and_tried_first(library: Path, tmp_path: Path) -> None:
    edit(library / "mjcf" / "bar_pendulum.xml", "9.81", "9.8100001")
    options = ("check", "bar_pendulum", "--library", str(library), "--subject", "mujoco/mjcf", "--json", "out.json")
    harness(*options, "--seed", "3", cwd=tmp_path)
    assert any((tmp_path / ".hypothesis" / "harness").rglob("*"))
    harness(*options, "--seed", "4", "--states", "8", cwd=tmp_path)
    record = json.loads((tmp_path / "out.json").read_text())["records"][0]
    assert record["verdict"] == "disagrees"
    kept = record["representative"]["state"] if record["representative"] else record["worst_state"]
    assert record["origins"] == {"stored": 0, "sampled": 4, "searched": 4, "simplest": 2} and 0.0 in kept["v"]


@pytest.mark.ci
def test_an_expected_verdict_is_exit_status_0_until_it_no_longer_holds(library: Path) -> None:
    expected, about = library / "expected_verdicts.toml", ("mujoco/mjcf", "disagrees")
    expected.write_text(expected_entry("bar_pendulum", *about, 1e9))
    model = library / "mjcf" / "bar_pendulum.xml"
    edit(model, "9.81", "9.8100001")
    arguments = ("check", "bar_pendulum", "--library", str(library), "--subject", "mujoco/mjcf")
    assert harness(*arguments, cwd=library).returncode == 0
    expected.write_text(expected_entry("bar_pendulum", *about, 1e3))
    assert harness(*arguments, cwd=library).returncode == 1
    expected.write_text(expected_entry("bar_pendulum", *about, 1e9))
    edit(model, "9.8100001", "9.81")
    done = harness(*arguments, cwd=library)
    assert done.returncode == 1
    assert "expected disagrees" in done.stdout and "planted" in done.stdout
    expected.write_text(expected_entry("bar_pendlum", *about, 1e9))
    done = harness(*arguments, cwd=library)
    assert done.returncode == 2
    assert "bar_pendlum" in done.stderr and "did you mean 'bar_pendulum'" in done.stderr


@pytest.mark.ci
def test_a_cluster_that_is_not_there_is_exit_status_2(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("harness.workers.cluster.CONNECT_SECONDS", 1.0)
    done = harness("check", "--scheduler", "tcp://127.0.0.1:9", "collar", cwd=tmp_path, isolated=True)
    assert done.returncode == 2 and "tcp://127.0.0.1:9" in done.stderr and "Traceback" not in done.stderr


BROKEN_SYSTEMS = {
    "raises": ("x = 1 / 0\n", 1, "ZeroDivisionError"),
    "no_system": ('"""A.\n\nSource: none."""\n', None, "no SYSTEM"),
    "wrong_type": ("import math\nSYSTEM = 3\n", 2, "expected a harness.System"),
    "syntax": ("a = (\n", 1, "not Python"),
    "leaves": ("import sys\n\nsys.exit(0)\n", 3, "SystemExit"),
    "aborts": ("import os\nos.abort()\n", None, "SIGABRT"),
    "hangs": ("import time\nwhile True:\n    time.sleep(1)\n", None, "time limit"),
}


@pytest.mark.ci
def test_broken_systems_are_exit_status_2_and_cost_nobody_else(library: Path) -> None:
    for name, (source, _, _) in BROKEN_SYSTEMS.items():
        (library / "systems" / f"{name}.py").write_text(source)
    arguments = ("--library", str(library), "--quantity", "accelerations", "--states", "50", "--json", "out.json", "--time-limit", "5")
    done = harness("check", *arguments, isolated=True, cwd=library)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    verdicts: dict[str, set[str]] = {}
    for record in json.loads((library / "out.json").read_text())["records"]:
        verdicts.setdefault(record["system"], set()).add(record["verdict"])
    assert verdicts.pop("bar_pendulum") == verdicts.pop("spring_damper") == {"agrees"}
    assert verdicts == {name: {"error"} for name in BROKEN_SYSTEMS}
    for name, (_, line, fragment) in BROKEN_SYSTEMS.items():
        place = f"{library / 'systems' / name}.py" + (f":{line}:" if line else ":")
        messages = [text for text in done.stderr.splitlines() if place in text]
        assert len(messages) == 1, (name, done.stderr)
        assert fragment in messages[0]


BROKEN_MODELS = {
    "a missing file": (None, None, "no such file"),
    "an empty file": ("", None, "empty"),
    "another joint": ('name="pin"', 'name="pim"', "'pin'"),
    "another mass": ('mass="2"', 'mass="3"', "3 kg in all, expected 2 kg"),
    "another gravity": ("-9.81", "-1.62", "gravity is 0 0 -1.62 m/s^2, expected 0 0 -9.81"),
    "NaN": ('mass="2"', 'mass="NaN"', "NaN"),
    "one joint too many": ("<inertial", '<joint name="extra" type="slide" axis="1 0 0"/><inertial', "'extra'"),
    "a ball": ('type="hinge" axis="0 -1 0"', 'type="ball"', "nq = 4 and nv = 3, expected 1 and 1"),
    "an unknown attribute": ('type="hinge"', 'type="hinge" dampng="0.3"', "did you mean 'damping'"),
    "an inertia only MuJoCo refuses": ("0.5 0.5 1e-15", "0.5 0.5 1.0000000000000002", "mujoco refuses it"),
}

# One that no reader takes, one that a single reader refuses, and one that is another mechanism.
AT_THE_DESK = {"an unknown attribute", "an inertia only MuJoCo refuses", "another mass"}


@pytest.mark.parametrize("case", [pytest.param(name, marks=() if name in AT_THE_DESK else pytest.mark.ci) for name in BROKEN_MODELS])
def test_a_broken_model_is_exit_status_2_and_costs_its_subject_only(library: Path, case: str) -> None:
    old, new, fragment = BROKEN_MODELS[case]
    model = library / "mjcf" / "bar_pendulum.xml"
    if old is None:
        model.unlink()
    elif old == "":
        model.write_text("")
    else:
        assert new is not None
        edit(model, old, new)
    done = harness("check", "--library", str(library), "--states", "50", "--json", "out.json", cwd=library)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert str(model) in done.stderr and fragment in done.stderr
    records = {(record["system"], record["subject"]): record for record in records_of(library / "out.json")}
    for reader in ["mujoco/mjcf"] if "only MuJoCo" in case else ["mujoco/mjcf", "pinocchio/mjcf"]:
        broken = records.pop(("bar_pendulum", reader))
        assert broken["verdict"] == "error" and fragment in broken["message"]
    assert {record["verdict"] for record in records.values()} == {"agrees"}


@pytest.mark.ci
def test_only_the_subject_that_is_wrong_is_not_asked_for_further_quantities(tmp_path: Path) -> None:
    library = make_library(tmp_path / "library", ["bar_pendulum"], {"wrong": engine_source("return 2.0 * tau")})
    subjects = ("--subject", "mujoco/mjcf", "--subject", "wrong/mjcf")
    done = harness("check", "--library", str(library), *subjects, "--states", "40", "--json", "out.json", cwd=library)
    assert done.returncode == 1
    records = json.loads((library / "out.json").read_text())["records"]
    assert {record["quantity"] for record in records if record["subject"] == "mujoco/mjcf"} > {"accelerations", "mass_matrix", "steps"}
    assert {record["quantity"] for record in records if record["subject"] == "wrong/mjcf"} == {"accelerations"}
    assert re.findall(r"^  (\S+): \d+ quantities agree", done.stdout, re.MULTILINE) == ["mujoco/mjcf"]


@pytest.mark.ci
def test_a_model_without_a_system_is_named(library: Path) -> None:
    shutil.copy(library / "mjcf" / "bar_pendulum.xml", library / "mjcf" / "orphan.xml")
    done = harness("check", "--library", str(library), "--states", "50", cwd=library)
    assert done.returncode == 2
    assert "orphan.xml" in done.stderr and "systems/orphan.py" in done.stderr


@pytest.mark.ci
def test_list_and_show(tmp_path: Path) -> None:
    listed = harness("list", "--json", "list.json", cwd=tmp_path)
    assert listed.returncode == 0
    data = json.loads((tmp_path / "list.json").read_text())
    assert [system["name"] for system in data["systems"]] == SYSTEMS
    assert {engine["name"] for engine in data["engines"]} >= {"lagrange", "mujoco", "pinocchio"}
    assert re.search(r"^cart_pendulum +2 dof", listed.stdout, re.MULTILINE)
    shown = harness("show", "spring_damper", cwd=tmp_path)
    assert shown.returncode == 0
    assert "x''*m + x'*c + x*k = tau_x" in shown.stdout
    assert re.search(r"k +80 +N/m", shown.stdout)
    assert re.search(r"^  slide +mjcf +slide +1 0 0 ", shown.stdout, re.MULTILINE)


def test_listing_imports_nothing_heavy(library: Path) -> None:
    listing = ["list", "--library", str(library)]
    assert harness(*listing).returncode == 0
    code = f"import sys; from harness.cli import main; main({listing}, standalone_mode=False); print(sorted(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    modules = done.stdout.splitlines()[-1]
    for heavy in ("sympy", "heyoka", "mujoco", "pinocchio", "flint", "bokeh", "distributed", "hypothesis", "scipy"):
        assert f"'{heavy}'" not in modules


@pytest.mark.ci
def test_report_writes_everything_and_keeps_history(library: Path) -> None:
    for _ in range(2):
        done = harness("report", "--library", str(library), "--out", "out", cwd=library)
        assert done.returncode == 0, done.stdout + done.stderr
    out = library / "out"
    assert {"history.sqlite", "index.html", "report.json", "report.md", "site.json", "rebuild.py"} < {path.name for path in out.iterdir()}
    assert len(records_of(out / "report.json")) == 10
    everything = len(json.loads((out / "report.json").read_text())["records"])
    with sqlite3.connect(out / "history.sqlite") as connection:
        assert connection.execute("SELECT count(*) FROM parts WHERE part = 'records'").fetchone() == (2 * everything,)
