"""The cross-check of reactions: records of their own, expected verdicts of their own, and what no acceleration feels."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from catalogue import BUILT_IN
from support import InThisProcess, changed_engine, completed, harness, make_library

from harness.crosscheck.assignment import declared_model
from harness.crosscheck.expected import load_expectations
from harness.crosscheck.run import CrossCheck
from harness.crosscheck.settings import DEFAULT_STATES, Settings
from harness.engines import NotOffered
from harness.errors import InvalidInput
from harness.library import Library
from harness.results.cross_check import CrossCheckResult
from harness.results.records import ACCELERATIONS, Record


def turned(body: str) -> str:
    """An engine whose reactions ``found`` are changed."""
    return changed_engine(f"found = exact(q, v, tau); {body}; return found", "reactions")


ENTRY = """[[expected]]
system = "bar_pendulum"
subject = "turned/mjcf"
{quantity}
verdict = "disagrees"
backward_error = 1e18
median_backward_error = 1e18
share = 1.0
reason = "its moments have the other sign"
link = "https://example.org"
"""


def checked(library: Library, **options: Any) -> tuple[dict[str, Record], CrossCheck]:
    study = CrossCheck(Settings(library=library, states=20, examples=None, **options), ["reactions"])
    result: CrossCheckResult = completed(study, InThisProcess())
    assert len(result.records) == study.steps
    return {record.subject: record for record in result.records}, study


@pytest.mark.parametrize("name", ["spring_pendulum", "arm_2r.fixed_links"])
def test_records_are_of_the_quantity_and_replays_ask_for_it(name: str) -> None:
    records, _ = checked(BUILT_IN, names=[name])
    for subject, record in records.items():
        assert record.quantity == "reactions" and record.as_expected
        assert record.verdict == ("unsupported" if subject == "lagrange" else "agrees")
        assert record.states == (0 if subject == "lagrange" else 20)
        assert subject == "lagrange" or "--quantity reactions" in record.replay
    assert not {"lagrange"} & set(records) or records["lagrange"].expected_reason


def test_what_floats_and_has_no_joint_is_unsupported_with_the_reason() -> None:
    records, _ = checked(BUILT_IN, names=["free_body"])
    assert {record.verdict for record in records.values()} == {"unsupported"}
    assert all(record.as_expected for record in records.values())
    assert "all are free" in records["mujoco/mjcf"].message


@pytest.mark.ci
def test_an_engine_that_offers_no_reactions_is_unsupported(tmp_path: Path) -> None:
    silent = changed_engine("").replace(
        "return model", "from types import SimpleNamespace as M; return M(loaded=model.loaded, forward_dynamics=answer)"
    )
    library = Library.at(make_library(tmp_path / "library", ["bar_pendulum"], {"silent": silent}))
    records, _ = checked(library, subjects=["silent/mjcf", "mujoco/mjcf"])
    assert (records["silent/mjcf"].verdict, records["silent/mjcf"].as_expected) == ("unsupported", True)
    assert "offers no reactions" in records["silent/mjcf"].message
    assert records["mujoco/mjcf"].verdict == "agrees"


@pytest.mark.ci
@pytest.mark.parametrize(
    ("body", "verdict", "said"),
    [
        ("found[:, :, 3:] *= -1", "disagrees", "Farthest off is the moment of joint 'pin'"),
        ("found[:, :, :3] *= 1 + 1e-12", "disagrees", "Farthest off is the force of joint 'pin'"),
        ("found[len(q) // 2 :] = np.nan", "error", "answers are not finite"),
        ("found = found[:, :, :3]", "error", "expected an array of shape"),
        ("raise RuntimeError('no license')", "error", "no license"),
    ],
)
def test_a_fault_of_an_engine_is_seen_and_the_vector_named(tmp_path: Path, body: str, verdict: str, said: str) -> None:
    library = Library.at(make_library(tmp_path / "library", ["bar_pendulum"], {"turned": turned(body)}))
    records, study = checked(library, subjects=["turned/mjcf", "mujoco/mjcf"])
    assert (records["turned/mjcf"].verdict, records["mujoco/mjcf"].verdict) == (verdict, "agrees")
    assert said in records["turned/mjcf"].message
    assert not study.result().as_expected


@pytest.mark.ci
def test_an_expected_verdict_is_that_of_its_quantity(tmp_path: Path) -> None:
    root = make_library(tmp_path / "library", ["bar_pendulum"], {"turned": turned("found[:, :, 3:] *= -1")})
    library = Library.at(root)
    for quantity, is_expected in (('quantity = "reactions"', True), ("", False)):
        library.expected_verdicts.write_text(ENTRY.format(quantity=quantity))
        records, _ = checked(library, subjects=["turned/mjcf"])
        assert records["turned/mjcf"].as_expected == is_expected
        assert (("bar_pendulum", "turned/mjcf") in load_expectations(library).entries) != is_expected
    library.expected_verdicts.write_text(ENTRY.format(quantity='quantity = "reaction"'))
    with pytest.raises(InvalidInput, match=r"names quantity 'reaction', which does not exist; did you mean 'reactions'"):
        load_expectations(library)


@pytest.mark.ci
@pytest.mark.parametrize(("verdict", "is_expected"), [("unstable", True), ("disagrees", True), ("misreads", False)])
def test_lost_digits_meet_an_expectation_of_fewer(tmp_path: Path, verdict: str, is_expected: bool) -> None:
    library = replace(BUILT_IN, expected_verdicts=tmp_path / "expected_verdicts.toml")
    entry = ENTRY.format(quantity="").replace("bar_pendulum", "stanford_arm").replace("turned/mjcf", "mujoco/mjcf")
    library.expected_verdicts.write_text(entry.replace('verdict = "disagrees"', f'verdict = "{verdict}"'))
    about: dict[str, Any] = {"names": ["stanford_arm"], "subjects": ["mujoco/mjcf"]}
    study = CrossCheck(Settings(library=library, states=DEFAULT_STATES, examples=None, **about), [ACCELERATIONS])
    (record,) = completed(study, InThisProcess()).records
    assert (record.verdict, record.as_expected) == ("unstable", is_expected)


# What no acceleration feels, in one file of two, and the line and value that mends it.
UNFELT = [
    ("furuta_pendulum", "mjcf", 'pos="0.15 0 0" mass', 'pos="0.15 0 0.001" mass', "0.001", "moment of joint 'arm'"),
    ("cart_pendulum", "mjcf", 'pos="0 0 0" mass="10"', 'pos="0.0123 0 0" mass="10"', "0.0123", "moment of joint 'slide'"),
    pytest.param("furuta_pendulum", "urdf", 'xyz="0.15 0 0"', 'xyz="0.15 0 0.001"', "0.001", "moment of joint 'arm'", marks=pytest.mark.ci),
]


@pytest.mark.ci
@pytest.mark.parametrize(("name", "model_format", "old", "new", "wrong", "vector"), UNFELT)
def test_what_no_acceleration_feels_is_named_by_its_line(
    tmp_path: Path, name: str, model_format: str, old: str, new: str, wrong: str, vector: str
) -> None:
    text = BUILT_IN.model_path(name, model_format).read_text()
    assert text.count(old) == 1
    path = tmp_path / BUILT_IN.model_path(name, model_format).name
    path.write_text(text.replace(old, new))
    line = text[: text.index(old)].count("\n") + 1
    records, study = checked(BUILT_IN, names=[name], stand_ins={model_format: path})
    for subject, record in records.items():
        if subject.endswith(model_format):
            assert record.verdict == "disagrees"
            assert f"line {line}: 0.0 in the place of {wrong} in" in record.message and vector in record.message
        elif subject != "lagrange":
            assert record.verdict == "agrees"
    # The audit names the lines of both files.
    [difference] = study.result().differs
    assert f"{path}:{line}" in difference.places and len(difference.places) == 2


@pytest.mark.ci
def test_where_several_numbers_are_wrong_the_vector_and_the_audit_speak(tmp_path: Path) -> None:
    """A quarter of a kilogram goes from one link to the other, where the elbow is."""
    text = BUILT_IN.model_path("arm_2r", "mjcf").read_text()
    second = [0.2777 - 0.785**2 / 3.25, 0.1048 - 0.36**2 / 1.75]
    heavier = f'pos="{0.785 / 3.25} 0 0" mass="3.25" diaginertia="1e-15 {second[0]} {second[0]}"'
    lighter = f'pos="{0.36 / 1.75} 0 0" mass="1.75" diaginertia="1e-15 {second[1]} {second[1]}"'
    for old, new in (
        ('pos="0.22 0 0" mass="3" diaginertia="1e-15 0.07 0.07"', heavier),
        ('pos="0.18 0 0" mass="2" diaginertia="1e-15 0.04 0.04"', lighter),
    ):
        assert old in text
        text = text.replace(old, new)
    (tmp_path / "arm_2r.xml").write_text(text)
    records, study = checked(
        BUILT_IN, names=["arm_2r"], subjects=["mujoco/mjcf", "pinocchio/urdf"], stand_ins={"mjcf": tmp_path / "arm_2r.xml"}
    )
    assert (records["mujoco/mjcf"].verdict, records["pinocchio/urdf"].verdict) == ("disagrees", "agrees")
    assert records["mujoco/mjcf"].message == "Farthest off is the force of joint 'elbow'."
    assert {"mass", "centre", "inertia"} <= {difference.quantity for difference in study.result().differs}


def test_the_declared_file_is_the_librarys_own() -> None:
    assert declared_model(BUILT_IN, "arm_2r").path == BUILT_IN.model_path("arm_2r", "mjcf")
    assert declared_model(BUILT_IN, "simple_pendulum.mimic").path == BUILT_IN.model_path("simple_pendulum.mimic", "urdf")
    with pytest.raises(NotOffered, match="has no model file"):
        declared_model(BUILT_IN, "whipple_bicycle")


@pytest.mark.ci
def test_a_library_that_is_wrong_itself_is_no_truth(tmp_path: Path) -> None:
    root = make_library(tmp_path / "library", ["arm_2r"])
    path = root / "mjcf" / "arm_2r.xml"
    path.write_text(path.read_text().replace('diaginertia="1e-15 0.07 0.07"', 'diaginertia="1e-15 0.0701 0.0701"'))
    records, study = checked(Library.at(root), subjects=["mujoco/mjcf", "mujoco/urdf"])
    assert {record.verdict for record in records.values()} == {"error"}
    assert "data roundoffs from those of the energies" in str(study.problems[0]) and str(path) in str(study.problems[0])


@pytest.mark.ci
def test_the_command_compares_both_and_says_which(tmp_path: Path) -> None:
    options = [
        "--subject",
        "mujoco/mjcf",
        "--subject",
        "lagrange",
        "--states",
        "20",
        "--workers",
        "1",
        "--json",
        str(tmp_path / "out.json"),
    ]
    result = harness("check", "bar_pendulum", "--quantity", "reactions", "--quantity", "accelerations", *options)
    assert result.returncode == 0, result.stderr
    records = json.loads((tmp_path / "out.json").read_text())["records"]
    assert [(one["subject"], one["quantity"], one["verdict"]) for one in records] == [
        ("lagrange", "accelerations", "agrees"),
        ("lagrange", "reactions", "unsupported"),
        ("mujoco/mjcf", "accelerations", "agrees"),
        ("mujoco/mjcf", "reactions", "agrees"),
    ]
    assert "quantity" in result.stdout and result.stdout.startswith("bar_pendulum: all 3 answers agree; 1 further one is not offered.\n")


def test_a_quantity_that_does_not_exist_is_refused() -> None:
    result = harness("check", "bar_pendulum", "--quantity", "reaction")
    assert result.returncode == 2 and "no quantity is called 'reaction'; did you mean 'reactions'?" in result.stderr
