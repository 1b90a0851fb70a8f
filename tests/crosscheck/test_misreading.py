"""A reader that is known to make another mechanism of a file is asked every time: mended, or wrong in another way too, it is noticed."""

from __future__ import annotations

import re
import subprocess
import sys
import tomllib
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from catalogue import BUILT_IN
from rooms import PACKAGE
from support import InThisProcess, call_engines_here, completed

from harness.comparison.robot_library import RobotLibrary
from harness.crosscheck.run import CrossCheck
from harness.crosscheck.settings import Settings
from harness.engines.adapters.pinocchio import mjcf, model
from harness.files.model_file import ModelFile, read_model
from harness.library import Stance
from harness.results.readings import FELT
from harness.results.records import Record

EULER, CLASS, FRAME, FURTHER = "acrobot.euler_fixed_axes", "furuta_pendulum.class_in_childclass", "acrobot.frames", "coupled_oscillators"
TEXTS = sorted((Path(__file__).parents[2] / "docs" / "issues").glob("*.md"))
ADAPTERS = PACKAGE / "engines" / "adapters"


def record_of(name: str, quantity: str = "accelerations", states: int = 200) -> Record:
    settings = Settings(library=BUILT_IN, names=[name], subjects=["pinocchio/mjcf"], states=states, examples=None)
    study = CrossCheck(settings, [quantity])
    (record,) = completed(study, InThisProcess()).records
    assert not study.problems
    return record  # type: ignore[no-any-return]


@pytest.mark.parametrize(
    ("name", "reading", "low", "high"),
    [(EULER, "Euler angles about fixed axes", 0.2, 2.0), (CLASS, "class beside a childclass", 1e12, 1e15)],
)
def test_a_misreading_has_its_error_its_reading_and_its_effect(name: str, reading: str, low: float, high: float) -> None:
    record = record_of(name)
    assert (record.verdict, record.as_expected, record.verdict_counts) == ("misreads", True, {"misreads": record.states})
    (effect,) = record.readings
    assert effect.name == reading and effect.alone is not None and low < effect.alone < high and effect.remedy and effect.lines
    assert record.backward_error is not None and record.backward_error > 1e14 and record.share == 1.0


@pytest.mark.parametrize(("name", "reading"), [(FRAME, "frames"), (FURTHER, "further trees")])
def test_a_reader_that_drops_joints_is_asked_for_those_that_it_has(name: str, reading: str) -> None:
    record = record_of(name)
    assert (record.verdict, record.as_expected, record.backward_error) == ("misreads", True, None)
    assert [effect.name for effect in record.readings] == [reading] and "has no moving joint" in record.message and record.states


def test_a_mended_reader_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    plain = read_model(BUILT_IN.model_path("acrobot", "mjcf"), "mjcf")
    read: Callable[[ModelFile], Any] = mjcf.read
    call_engines_here(monkeypatch)
    monkeypatch.setattr(mjcf, "read", lambda file: read(plain))
    record = record_of(EULER)
    assert (record.verdict, record.expected, record.as_expected) == ("agrees", "misreads", False)


def test_a_second_fault_beside_a_misreading_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Twice the answer where the first joint turns fast enough."""
    exact = model.PinocchioModel.forward_dynamics

    def doubled(self: Any, q: Any, v: Any, tau: Any) -> Any:
        return np.where(np.abs(v[:, :1]) > 2.0, 2.0, 1.0) * exact(self, q, v, tau)

    call_engines_here(monkeypatch)
    monkeypatch.setattr(model.PinocchioModel, "forward_dynamics", doubled)
    record = record_of(EULER)
    assert (record.verdict, record.as_expected) == ("disagrees", False)
    assert 0 < record.verdict_counts["disagrees"] < record.states


def test_every_quantity_of_a_misread_file_is_misread_or_does_not_feel_it() -> None:
    verdicts = {name: record_of(EULER, name, states=20) for name in ("mass_matrix", "power", "steps")}
    assert all(record.as_expected for record in verdicts.values())
    assert {verdicts["mass_matrix"].verdict, verdicts["steps"].verdict} == {"misreads", "unsupported"}


def test_a_user_s_file_that_is_misread_says_so(tmp_path: Path) -> None:
    path = tmp_path / "fixed.xml"
    inertial = '<inertial pos="0.1 0 0.3" mass="2" diaginertia="0.3 0.4 0.5"/>'
    path.write_text(f"""<mujoco model="fixed"><worldbody><body name="base" quat="0.6 0.8 0 0">
<body name="arm"><joint name="pin" axis="0 1 0" damping="0.5"/>{inertial}</body></body></worldbody></mujoco>""")
    settings = Settings(library=RobotLibrary.of([str(path)]), subjects=["pinocchio/mjcf"], states=20, examples=None)
    (record,) = completed(CrossCheck(settings), InThisProcess()).records
    assert (record.verdict, record.as_expected) == ("misreads", True)
    assert {one.name: one.is_misread for one in record.readings} == {"pose of a body fixed to the world": True, "joint damping": False}


INERTIAL = '<inertial pos="0.1 0 -0.25" mass="2" diaginertia="0.0625 0.0625 0.03125"/>'
# A hinge of a URDF with a rotor, of which an aided engine is told.
GEARED = (Path(__file__).parents[2] / "docs" / "examples" / "rotor-inertias.urdf").read_text()
ROTORS = {
    "along x": ('<joint name="j" axis="1 0 0" armature="0.3"/>', False),
    "nearly along z": ('<joint name="j" axis="0 1e-14 1" armature="0.3"/>', False),
    "along -y": ('<joint name="j" axis="0 -1 0" armature="0.3"/>', True),
    "of length 2": ('<joint name="j" axis="0 2 0" armature="0.3" damping="0.5"/>', True),
    "oblique": ('<joint name="j" axis="0 1 1" armature="0.3"/>', True),
    "a slide": ('<joint name="j" type="slide" axis="0 -1 0" armature="0.3"/>', False),
    "of two": ('<joint name="j" axis="0 -1 0" armature="0.3"/><joint name="k" axis="1 0 0" armature="0.2"/>', False),
    "revolute": (GEARED.replace('xyz="0 1 0"', 'xyz="0 -1 0"'), True),
    "revolute along y": (GEARED, False),
    "continuous": (GEARED.replace('xyz="0 1 0"', 'xyz="0 -1 0"').replace("revolute", "continuous"), False),
}


@pytest.mark.parametrize("name", ROTORS)
def test_energy_is_read_without_the_rotors_that_its_program_forgets(name: str, tmp_path: Path) -> None:
    """Accelerations have them; so the reading is of energy alone, by which its effect is told."""
    text, is_forgotten = ROTORS[name]
    is_urdf = text.startswith("<robot")
    path = tmp_path / ("robot.urdf" if is_urdf else "robot.xml")
    path.write_text(text if is_urdf else f'<mujoco><worldbody><body name="a">{text}{INERTIAL}</body></worldbody></mujoco>')
    stance = Stance.AIDED if is_urdf else Stance.PLAIN
    library = RobotLibrary.of([str(path)], stance=stance)
    settings = Settings(library=library, subjects=[f"pinocchio/{path.suffix[1:].replace('xml', 'mjcf')}"], states=20, examples=None)
    (moving,), (energy,) = (completed(CrossCheck(settings, [one]), InThisProcess()).records for one in ("accelerations", "energy"))
    assert moving.as_expected and not any(one.quantity for one in moving.readings) and energy.as_expected
    assert (moving.verdict, energy.verdict) == ("explained" if "damping" in text else "agrees", "misreads" if is_forgotten else "agrees")
    if is_forgotten:
        felt = [one for one in energy.readings if one.alone is None or one.alone > FELT]
        assert [(one.name, one.quantity) for one in felt] == [("energy of rotors at unaligned hinges", "energy")] and felt[0].lines
        assert felt[0].alone is not None and felt[0].alone < 1.0 and felt[0].statement.endswith(" % of energy")


def test_what_is_an_engine_s_fault_links_to_an_issue_or_its_text() -> None:
    tables = tomllib.loads(BUILT_IN.expected_verdicts.read_text())["expected"]
    assert {one["verdict"] for one in tables} >= {"misreads", "disagrees"}
    # Of what an algorithm loses where M is well-conditioned there is a text; where it is ill-conditioned, a book.
    linked = {
        one["link"]
        for one in tables
        if one["verdict"] == "misreads"
        or one.get("versions")
        or re.search("centre of mass|axes of the world|frame of the world", one["reason"])
    }
    assert all(link.startswith("docs/issues/") or re.search(r"github\.com/.*/(issues|pull|commit)/", link) for link in linked)
    of_texts = {one["link"].removeprefix("docs/issues/") for one in tables if one["link"].startswith("docs/")}
    # An adapter names what it has to go around, and a rule where it is found.
    naming = [*ADAPTERS.rglob("*.py"), *(PACKAGE / "explain" / "changes").rglob("*.py")]
    named = {name for file in naming for name in re.findall(r"docs/issues/([\w-]+\.md)", file.read_text())}
    assert of_texts | named == {path.name for path in TEXTS}


@pytest.mark.ci
@pytest.mark.parametrize("path", TEXTS, ids=lambda path: path.stem)
def test_the_program_of_an_issue_prints_what_its_text_says(path: Path, tmp_path: Path) -> None:
    text = path.read_text()
    program = re.search(r"```python\n(.*?)```", text, re.DOTALL)
    printed = re.search(r"```text\ncomputed (.*)\nexpected (.*)\n```", text)
    assert text.startswith("# ") and program and printed and printed[1] != printed[2]
    # That of an older version, or of an engine that is not beside the harness, cannot be run here.
    if not {f"Pinocchio {version('pin')}", f"MuJoCo {version('mujoco')}"} & set(re.findall(r"[A-Z]\w+ \d+\.\d+\.\d+", text)):
        assert re.search(r"(Drake|Newton|PhysX|Pinocchio|MuJoCo|Warp|MJX|PyBullet) \d+\.\d+\.\d+, `", text)
        return
    done = subprocess.run([sys.executable, "-c", program[1]], capture_output=True, text=True, cwd=tmp_path, check=True)
    assert done.stdout.splitlines()[-2:] == [f"computed {printed[1]}", f"expected {printed[2]}"]
