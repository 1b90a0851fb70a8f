"""``harness nightly``: what it writes, what it says of the night before, and a median that rises."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import lxml.html
import pytest
from lxml import etree
from support import Done, harness, make_library

from harness.results.trend import MEDIAN
from harness.truth.quantities import find_quantities, further_quantities

# MuJoCo's answers, scaled: an error of so many units in the last place as a file beside it says, which a process that keeps engines reads.
ENGINE = """
from pathlib import Path
from harness.engines.adapters.mujoco import ENGINE as MUJOCO

class Model:
    def __init__(self, model):
        self.model, self.loaded = model, model.loaded

    def forward_dynamics(self, q, v, tau):
        return self.model.forward_dynamics(q, v, tau) * (1 + float(Path(__file__).with_suffix('.ulps').read_text()) * 2.0**-52)

from harness.engines import Engine

class Engine(Engine):
    requires, formats = ("mujoco", "mujoco"), ("mjcf",)

    def load(self, source, joints, gravity):
        return Model(MUJOCO.load(source, joints, gravity))

ENGINE = Engine()
"""


def night(folder: Path, *arguments: str, states: int = 300, ulps: float = 4, **variables: str) -> Done:
    asked = ["--library", "library", "--out", "out", "--json", "out.json", "--stage", "cross-check", "--states", str(states)]
    (folder / "library" / "engines" / "scaled.ulps").write_text(str(ulps))
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("GITHUB_STEP_SUMMARY", raising=False)
        patch.setattr("harness.night.stages.QUANTITY_STATES", 4)
        for name, value in variables.items():
            patch.setenv(name, value)
        return harness("nightly", *asked, *arguments, cwd=folder)


def document(folder: Path) -> Any:
    return json.loads((folder / "out.json").read_text())


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    make_library(tmp_path / "library", ["bar_pendulum", "spring_damper"], {"scaled": ENGINE})
    return tmp_path


@pytest.mark.ci
@pytest.mark.usefixtures("without_charts")
def test_a_median_that_rises_is_reported_that_night_and_changes_no_verdict(folder: Path) -> None:
    for seed in ("1", "2", "3"):
        assert night(folder, "--seed", seed).returncode == 0
        assert document(folder)["changes"] == []
    done = night(folder, "--seed", "4", ulps=10)
    assert done.returncode == 0, done.stdout + done.stderr
    changes = document(folder)["changes"]
    medians = [one for one in changes if one["number"] == MEDIAN]
    assert {(one["system"], one["subject"]) for one in medians} == {("bar_pendulum", "scaled/mjcf"), ("spring_damper", "scaled/mjcf")}
    assert {one["subject"] for one in changes} == {"scaled/mjcf"}
    assert all(1.8 < one["now"] / one["before"] < 4 and one["nights"] == 3 for one in medians)
    assert "changed in the trend" in done.stdout
    assert "## Changed in the trend" in (folder / "out" / "nightly.md").read_text()
    # The pages have the same rule.
    rows = lxml.html.parse(folder / "out" / "changes.html").xpath("//table[starts-with(caption, 'Changed in the trend')]/tbody/tr")
    assert sorted([cell.text_content() for cell in row[1:4]] for row in rows) == sorted(
        [one["system"], one["subject"], one["number"]] for one in changes
    )
    # It is reported once.
    assert night(folder, "--seed", "5", ulps=10).returncode == 0
    assert document(folder)["changes"] == []


@pytest.mark.ci
@pytest.mark.usefixtures("without_charts")
def test_a_night_writes_page_summary_and_junit_and_says_what_is_new(folder: Path) -> None:
    summary = folder / "step.md"
    summary.write_text("before\n")
    done = night(folder, states=60, GITHUB_STEP_SUMMARY=str(summary))
    assert done.returncode == 0, done.stdout + done.stderr
    written = (folder / "out" / "nightly.md").read_text()
    assert summary.read_text() == "before\n" + written
    assert "Since the last night" not in written
    root = etree.parse(folder / "out" / "nightly.xml").getroot()
    everything = {(str(case.get("classname")), str(case.get("name"))) for case in root.iter("testcase")}
    # Another quantity than accelerations stands behind the subject.
    cases = {(group, name) for group, name in everything if " " not in name}
    assert {name.split()[1] for _, name in everything - cases} == {one.name for one in further_quantities()}
    subjects = ("lagrange", "mujoco/mjcf", "mujoco/urdf", "pinocchio/mjcf", "pinocchio/urdf", "scaled/mjcf", "models")
    assert cases == {(f"cross-check.{system}", name) for system in ("bar_pendulum", "spring_damper") for name in subjects}
    assert (folder / "out" / "index.html").is_file()

    done = night(folder, "bar_pendulum", states=60, ulps=1e6)
    assert done.returncode == 1
    found = document(folder)["since_last_night"]
    assert [(case["group"], case["name"]) for case in found["worse"]] == [("bar_pendulum", "scaled/mjcf")]
    gone = [title.split()[-1] for title in found["went"]]
    assert len([name for name in gone if name not in find_quantities()]) == len(subjects)
    # Where accelerations are wrong, nothing else is asked.
    assert set(gone) >= {one.name for one in further_quantities()}
    text = (folder / "out" / "nightly.md").read_text()
    assert "1 of 7 cases is not as expected, 1 of them new since the last night" in text
    assert "replay: harness check bar_pendulum --subject scaled/mjcf --library library" in text
    [failure] = etree.parse(folder / "out" / "nightly.xml").getroot().iter("failure")
    assert "worst backward error" in (failure.text or "")

    assert night(folder, "bar_pendulum", states=60, ulps=1).returncode == 0
    assert "Good again (1)" in (folder / "out" / "nightly.md").read_text()


@pytest.mark.ci
def test_a_summary_that_cannot_be_written_is_named(folder: Path) -> None:
    done = night(folder, "bar_pendulum", states=20, GITHUB_STEP_SUMMARY=str(folder / "gone" / "step.md"))
    assert done.returncode == 2
    assert "GITHUB_STEP_SUMMARY" in done.stderr


@pytest.mark.ci
@pytest.mark.usefixtures("without_charts")
def test_a_file_that_has_to_be_mended_is_named_and_the_rest_goes_on(folder: Path) -> None:
    (folder / "library" / "mjcf" / "spring_damper.xml").write_text("<mujoco>")
    (folder / "library" / "mjcf" / "orphan.xml").write_text("<mujoco/>")
    done = night(folder, states=20)
    assert done.returncode == 2
    assert "spring_damper.xml" in done.stderr and "orphan.xml" in done.stderr
    cases = document(folder)["cases"]
    good = {case["name"] for case in cases if case["group"] == "bar_pendulum" and case["outcome"] == "passed" and " " not in case["name"]}
    assert good == {"lagrange", "mujoco/mjcf", "mujoco/urdf", "pinocchio/mjcf", "pinocchio/urdf", "scaled/mjcf", "models"}
    assert "To be mended" in (folder / "out" / "nightly.md").read_text()
