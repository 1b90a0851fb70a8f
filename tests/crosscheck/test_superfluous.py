"""Models hold only what their scenes need: each kind of surplus is found at its line, and shipped models have none."""

from __future__ import annotations

import json
import shutil
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import pytest
from catalogue import MODELS, is_bounded
from support import call_engines_here, harness, make_library, pytest_in_this_process

from harness.arrays import Array
from harness.crosscheck.assignment import Assignment
from harness.crosscheck.expected import load_expectations
from harness.crosscheck.superfluous import superfluous
from harness.engines import Model, Subject, accelerations_and_gaps, is_native, subjects
from harness.files.model_file import parse_model
from harness.library import Library
from harness.programs.states import States
from harness.results.cross_check import SuperfluousPart
from harness.storage import cache_directory
from harness.verdict import Verdict

LIBRARY = Library.built_in()
EXPECTATIONS = load_expectations(LIBRARY)
PAIRS = [
    (name, subject)
    for name, model_format in MODELS
    for subject in subjects(LIBRARY)
    if subject.format == model_format and is_native(LIBRARY, subject)
    # A model that no engine reads is felt by none, and friction and limits by none that applies neither.
    if EXPECTATIONS.of(name, subject).verdict != Verdict.UNSUPPORTED and not (is_bounded(name) and subject.engine == "pinocchio")
]
MUJOCO, PINOCCHIO = Subject("mujoco", "mjcf"), Subject("pinocchio", "urdf")


@pytest.mark.parametrize(("name", "subject"), PAIRS, ids=[f"{name}-{subject}" for name, subject in PAIRS])
def test_shipped_models_hold_nothing_superfluous(name: str, subject: Subject) -> None:
    assert superfluous(Assignment.of(LIBRARY, name, subject)) == []


def with_text(name: str, subject: Subject, text: str) -> Assignment:
    """A subject on a system whose model has another text."""
    own = Assignment.of(LIBRARY, name, subject)
    return replace(own, model=parse_model(LIBRARY.model_path(name, subject.format), text, subject.format))


def planted(name: str, subject: Subject, old: str, new: str) -> tuple[list[SuperfluousPart], int]:
    """What is found after a change of the shipped model, and the line of the change."""
    path = LIBRARY.model_path(name, subject.format)
    text = path.read_text()
    assert text.count(old) >= 1
    changed = text.replace(old, new, 1)
    line = changed.count("\n", 0, text.index(old) + new.rindex("@") if "@" in new else text.index(old)) + 1
    return superfluous(with_text(name, subject, changed.replace("@", ""))), line


# What is planted into a model, with @ where the finding is expected to point: system, subject, old, new, element, attribute, value, why.
PLANTED = {
    "dead attribute": ("cart_pendulum", MUJOCO, '<joint name="slide"', '@<joint name="slide" armature="0"',
        "joint", "armature", "0", "leave it out"),
    "default reference": ("cart_pendulum", MUJOCO, 'stiffness="270"', '@stiffness="270" springref="0"',
        "joint", "springref", "0", "leave it out"),
    "dead position": ("cart_pendulum", MUJOCO, '<body name="cart"', '@<body name="cart" pos="3 0 0"',
        "body", "pos", "3 0 0", "leave it out"),
    "dead number beside a live one": ("cart_pendulum", MUJOCO, 'pos="0 0 -0.3"', '@pos="0 0.7 -0.3"',
        "inertial", "pos", "0.7", "its least value here is 0"),
    "inertia above least": ("cart_pendulum", MUJOCO, '"0.03 0.03 1e-15"', '@"0.03 0.03 1e-3"',
        "inertial", "diaginertia", "1e-3", "its least value here is 1e-15"),
    "inertia above what physics asks": ("bar_pendulum", MUJOCO, '"0.5 0.5 1e-15"', '@"0.75 0.5 0.25"',
        "inertial", "diaginertia", "0.75", "its least value here is 0.25"),
    "unused site": ("collar", MUJOCO, '<site name="eye"', '@<site name="ear"/><site name="eye"', "site", "", 'name="ear"', "not used"),
    "unused body": ("collar", MUJOCO, '<site name="anchor"', '@<body name="ghost"/><site name="anchor"',
        "body", "", 'name="ghost"', "not used"),
    "unused class": ("collar", MUJOCO, "<worldbody>", '@<default><default class="c"/></default><worldbody>', "default", "", "", "not used"),
    "frame that moves nothing": ("bar_pendulum", MUJOCO, "<inertial", "@<frame><site/></frame><inertial", "frame", "", "", "not used"),
    "tendon without a spring": ("collar", MUJOCO,
        "<tendon>", '<tendon>@<spatial name="slack"><site site="anchor"/><site site="eye"/></spatial>',
        "spatial", "", 'name="slack"', "not used"),
    "stage left on": ("cart_pendulum", MUJOCO, '@<flag constraint="disable"', "@<flag",
        "flag", "constraint", "enable", "is on and not needed"),
    "limit not at its least": ("cart_pendulum", PINOCCHIO, 'effort="0"', '@effort="10"',
        "limit", "effort", "10", "its least value here is 0"),
    "limit nobody asks for": ("cart_pendulum", PINOCCHIO, 'effort="0"', '@lower="-1" effort="0"', "limit", "lower", "-1", "leave it out"),
    "origin at the default": ("cart_pendulum", PINOCCHIO, "<mass", '@<origin xyz="0 0 0"/><mass', "origin", "", "", "not used"),
    "URDF inertia above least": ("cart_pendulum", PINOCCHIO, 'iyy="0.03" iyz="0" izz="0"', '@iyy="0.03" iyz="0" izz="0.01"',
        "inertia", "izz", "0.01", "least value here is 0"),
    "friction of zero": ("cart_pendulum", PINOCCHIO, 'damping="0.2"', '@damping="0.2" friction="0"',
        "dynamics", "friction", "0", "leave it out"),
    "spring without stiffness": ("bar_pendulum", PINOCCHIO,
        "</robot>", '@<gazebo reference="pin"><springStiffness>0</springStiffness><springReference>3</springReference></gazebo></robot>',
        "gazebo", "", 'reference="pin"', "not used"),
    "link that nothing needs": ("bar_pendulum", PINOCCHIO,
        "</robot>", '<link name="eye"/>@<joint name="weld" type="fixed"><parent link="world"/><child link="eye"/></joint></robot>',
        "joint", "", 'name="weld"', "carries link 'eye', which nothing needs"),
}  # fmt: skip


@pytest.mark.parametrize(("name", "subject", "old", "new", "element", "attribute", "value", "why"), PLANTED.values(), ids=PLANTED)
def test_what_is_planted_is_found(
    name: str, subject: Subject, old: str, new: str, element: str, attribute: str, value: str, why: str
) -> None:
    findings, line = planted(name, subject, old.replace("@", ""), new)
    found = [finding for finding in findings if (finding.element, finding.attribute, finding.value) == (element, attribute, value)]
    assert found, [str(finding) for finding in findings]
    assert found[0].line == line
    assert why in found[0].why
    assert (found[0].system, found[0].subject) == (name, str(subject))
    assert str(found[0]).startswith(f"{LIBRARY.model_path(name, subject.format)}:{line}: <{element}")
    assert {finding.line for finding in findings} == {line}


@pytest.mark.parametrize("stage", ["constraint", "contact", "actuation", "sensor", "damper", "spring"])
def test_every_stage_of_the_pipeline_is_asked_for(stage: str) -> None:
    findings, _ = planted("acrobot", MUJOCO, f'{stage}="disable"', f'{stage}="enable"')
    assert [(finding.element, finding.attribute, finding.value) for finding in findings] == [("flag", stage, "enable")]


def test_a_stage_that_is_needed_is_none() -> None:
    for stage in ("spring", "damper", "gravity"):
        findings, _ = planted("cart_pendulum", MUJOCO, "<flag", f'<flag {stage}="enable"')
        assert findings == []


def test_two_numbers_that_hold_each_other_up_are_found() -> None:
    """Neither moment about the axes across can shrink alone, but both can together."""
    findings, _ = planted("quarter_car", MUJOCO, '"1e-15 1e-15 1e-15"', '"0.5 0.5 1e-15"')
    assert [(finding.attribute, finding.value) for finding in findings] == [("diaginertia", "0.5")] * 2


def test_a_reflected_inertia_is_felt() -> None:
    transmission = (
        '<transmission name="t"><type>transmission_interface/SimpleTransmission</type><joint name="pin"/>'
        '<actuator name="a"><drake:rotor_inertia value="{}"/><drake:gear_ratio value="3"/></actuator></transmission></robot>'
    )

    def findings(inertia: str, effort: str) -> list[SuperfluousPart]:
        path = LIBRARY.model_path("bar_pendulum", "urdf")
        text = path.read_text().replace("</robot>", transmission.format(inertia)).replace('effort="0"', f'effort="{effort}"')
        text = text.replace('<robot name="bar_pendulum"', '<robot name="bar_pendulum" xmlns:drake="http://drake.mit.edu"')
        return superfluous(with_text("bar_pendulum", PINOCCHIO, text))

    assert findings("0.25", "1e-15") == []
    assert [finding.element for finding in findings("0.25", "10")] == ["limit"]
    assert [(finding.element, finding.value) for finding in findings("0", "1e-15")] == [("transmission", 'name="t"')]


@pytest.mark.ci
def test_findings_are_kept_on_disk_and_damage_is_mended(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("HARNESS_CACHE", str(tmp_path))
    found, _ = planted("cart_pendulum", MUJOCO, "<flag", "<flag")
    assert found == []
    surplus, _ = planted("cart_pendulum", MUJOCO, ' contact="disable"', "")
    entries = sorted((cache_directory() / "superfluous").iterdir())
    assert len(entries) == 2
    with monkeypatch.context() as patch:
        patch.setattr("harness.crosscheck.superfluous._not_needed", lambda *given: pytest.fail("examined again"))
        assert planted("cart_pendulum", MUJOCO, ' contact="disable"', "")[0] == surplus
    for damage in (b"", b"[[1]]", b"{}", b"\xff"):
        for entry in entries:
            entry.write_bytes(damage)
        assert planted("cart_pendulum", MUJOCO, ' contact="disable"', "")[0] == surplus


def test_a_number_that_is_felt_costs_one_state(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Both models as they are at eight states each, and each of the cart's numbers at the first that feels it."""
    monkeypatch.setenv("HARNESS_CACHE", str(tmp_path))
    asked: list[int] = []

    def counted(model: Model, states: States) -> tuple[Array, Mapping[str, Array]]:
        asked.append(len(states))
        return accelerations_and_gaps(model, states)

    call_engines_here(monkeypatch)
    monkeypatch.setattr("harness.crosscheck.examination.accelerations_and_gaps", counted)
    assert superfluous(Assignment.of(LIBRARY, "cart_pendulum", MUJOCO)) == []
    assert asked[:1] == [8] and sum(asked) < 2 * 8 + 2 * len(asked)


def test_a_search_that_uses_up_its_evaluations_says_so(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("HARNESS_CACHE", str(tmp_path))
    monkeypatch.setattr("harness.crosscheck.superfluous.MOST_EVALUATIONS", 5)
    [found] = superfluous(Assignment.of(LIBRARY, "cart_pendulum", MUJOCO))
    assert found.element == "mujoco" and found.why == "is examined in part: 5 evaluations of changed models are used up"


def test_a_model_that_is_wrong_as_it_is_is_not_examined() -> None:
    path = LIBRARY.model_path("cart_pendulum", "mjcf")
    wrong = with_text("cart_pendulum", MUJOCO, path.read_text().replace(' sensor="disable"', ""))
    assert superfluous(wrong, is_sound=lambda: False) == []


ORIGIN, EFFORT = '<origin xyz="0 0 0"/>', 'effort="1"'


@pytest.fixture
def library(tmp_path: Path) -> Path:
    """A library of the bar pendulum whose URDF says what its readers assume."""
    root = make_library(tmp_path / "mechanisms", ["bar_pendulum"])
    model = root / "urdf" / "bar_pendulum.urdf"
    text = model.read_text()
    assert text.count("<parent") == 1 and text.count('effort="0"') == 1
    model.write_text(text.replace("<parent", f"{ORIGIN}<parent").replace('effort="0"', EFFORT))
    return root


def built_in_at(root: Path) -> Library:
    """The library in ``root`` as if it came with the harness."""
    return replace(Library.at(root), name=LIBRARY.name, engines=LIBRARY.engines)


OPTIONS = ("--states", "40", "--quantity", "accelerations", "--json", "out.json")


@pytest.mark.ci
def test_a_surplus_is_a_warning_that_is_printed_and_in_the_json(library: Path) -> None:
    done = harness("check", "--library", str(library), *OPTIONS, cwd=library)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.startswith("bar_pendulum: all 5 subjects agree; 2 superfluous parts are warnings.\n")
    assert "2 superfluous parts of models, which are warnings:" in done.stdout
    model = library / "urdf" / "bar_pendulum.urdf"
    line = next(number for number, text in enumerate(model.read_text().splitlines(), start=1) if ORIGIN in text)
    assert f"{model}:{line}: <origin> is not used; remove it" in done.stdout
    found = json.loads((library / "out.json").read_text())["superfluous"]
    assert [(part["element"], part["attribute"], part["fails"]) for part in found] == [("origin", "", False), ("limit", "effort", False)]
    assert {"path", "line", "value", "why", "system", "subject"} <= set(found[0])
    shutil.copy(LIBRARY.model_path("bar_pendulum", "urdf"), model)
    done = harness("check", "--library", str(library), *OPTIONS, cwd=library)
    assert done.returncode == 0 and "superfluous" not in done.stdout
    assert json.loads((library / "out.json").read_text())["superfluous"] == []


def test_a_surplus_of_a_file_that_stands_in_is_a_warning(library: Path) -> None:
    model = library / "urdf" / "bar_pendulum.urdf"
    done = harness("check", "bar_pendulum", "--urdf", str(model), *OPTIONS, cwd=library)
    assert done.returncode == 0 and "which are warnings:" in done.stdout


def test_a_surplus_of_the_built_in_library_fails(library: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Library, "built_in", classmethod(lambda cls: built_in_at(library)))
    done = harness("check", *OPTIONS, cwd=library)
    assert done.returncode == 1 and "2 superfluous parts of models:" in done.stdout
    assert done.stdout.startswith("bar_pendulum: all 5 subjects agree; not as expected: 2 superfluous parts.\n")
    assert [part["fails"] for part in json.loads((library / "out.json").read_text())["superfluous"]] == [True, True]
    assert harness("diagnose", "bar_pendulum", *OPTIONS, cwd=library).returncode == 1


@pytest.mark.ci
def test_a_surplus_warns_in_pytest_and_fails_the_built_in_regression_of_its_subject(library: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    options = ("-v", "--harness-states", "40", "--harness-library")
    done = pytest_in_this_process(*options, str(library), cwd=library)
    assert done.returncode == 0 and "5 passed, 1 warning" in done.stdout
    assert "superfluous parts of the model:" in done.stdout and "<origin> is not used" in done.stdout
    monkeypatch.setattr(Library, "built_in", classmethod(lambda cls: built_in_at(library)))
    done = pytest_in_this_process(*options, "built-in", cwd=library)
    assert done.returncode == 1
    assert "1 failed, 4 passed" in done.stdout
    assert "bar_pendulum.py::pinocchio/urdf FAILED" in done.stdout
    assert "superfluous parts of the model:" in done.stdout and "Traceback" not in done.stdout
