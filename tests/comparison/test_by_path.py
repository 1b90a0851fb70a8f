"""A file gets by path, of aided engines, what it gets by the name of its mechanism; a survey of our own files explains every row."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import msgspec
import pytest
from catalogue import BUILT_IN, MODELS
from support import harness

from harness.results.readings import Effect, are_misread

# Those that lie in a folder; of families the model is written when it is read.
FILES = [(name, model_format) for name, model_format in MODELS if BUILT_IN.model_path(name, model_format).is_file()]
# Names by which a verdict by path is another, each with the reason; what a file cannot say makes the difference.
EQUALITIES = "a file is asked without the equalities that it closes itself by, of which Pinocchio's reader has none by name"
POLE = "a file has no range that keeps off the pole, where M is singular and no answer is right"
COUPLED = "by name Pinocchio refuses a constraint that couples joints; by path it is asked without, and passes over further trees"
DEPARTS = "by name MuJoCo's law of the loop departs from its documentation; by path that is told of the file with its equalities"
FOLLOWER = "by name an engine refuses a joint that mimics another and is no coordinate; by path it is eliminated"
LEFT_OUT = "by name Pinocchio leaves out the dry friction of the mechanism; by path one that is aided is asked about the tree"
LAWLESS = "by name the actuators of the mechanism act, of which a URDF states no law; by path the file is all there is"
DIFFERENT = {
    ("atwood", "pinocchio/mjcf"): COUPLED,
    ("simple_pendulum.mimic", "mujoco/urdf"): FOLLOWER,
    ("simple_pendulum.mimic", "pinocchio/urdf"): FOLLOWER,
    ("cycloid_bead", "pinocchio/mjcf"): EQUALITIES,
    ("dry_pendulum", "pinocchio/mjcf"): LEFT_OUT,
    ("dry_pendulum", "pinocchio/urdf"): LEFT_OUT,
    ("rolling_disc_on_incline", "pinocchio/mjcf"): EQUALITIES,
    ("slider_crank", "mujoco/mjcf"): DEPARTS,
    ("slider_crank", "mujoco/urdf"): DEPARTS,
    ("spherical_pendulum", "mujoco/urdf"): POLE,
    ("spherical_pendulum", "pinocchio/urdf"): POLE,
    ("spring_pendulum", "mujoco/urdf"): POLE,
    ("spring_pendulum", "pinocchio/urdf"): POLE,
    **{(name, f"{engine}/urdf"): LAWLESS for name in ("geared_motor", "servo_arm", "tendon_finger") for engine in ("mujoco", "pinocchio")},
}
# A check has all on, of which a survey tells beside the plain answer: that Pinocchio leaves out an actuator, where nothing else is read.
DRIVEN_BY_A_CHECK = {("servo_arm", "pinocchio/mjcf")}
# By name states come on top that are stored, at some of which an answer loses digits.
SOUND = {"unstable": "agrees"}
# What a check says where a survey says the verdict on the file itself, explained, and whether digits are lost beyond the readings.
AS_CHECKED = {
    ("agrees", False): "agrees",
    ("disagrees", False): "explained",
    ("disagrees", True): "agrees",
    ("unstable", True): "agrees",
    ("unsupported", False): "unsupported",
}
Verdicts = dict[tuple[str, str], str]


def verdicts(targets: list[str], document: Path, *options: str) -> Verdicts:
    """The verdict of each subject on each mechanism or file."""
    harness("check", *targets, *options, "--states", "16", "--quantity", "accelerations", "--json", str(document))
    records = json.loads(document.read_text())["records"]
    return {(record["system"], record["subject"]): SOUND.get(record["verdict"], record["verdict"]) for record in records}


@pytest.fixture(scope="module")
def by_name(tmp_path_factory: pytest.TempPathFactory) -> Verdicts:
    return verdicts(sorted({name for name, _ in FILES}), tmp_path_factory.mktemp("name") / "check.json")


@pytest.mark.ci
@pytest.mark.parametrize("model_format", sorted({model_format for _, model_format in FILES}))
def test_a_file_gets_by_path_what_it_gets_by_name(model_format: str, by_name: Verdicts, tmp_path: Path) -> None:
    paths = {str(BUILT_IN.model_path(name, one)): name for name, one in FILES if one == model_format}
    by_path = {
        (paths[path], subject): found for (path, subject), found in verdicts(list(paths), tmp_path / "check.json", "--aided").items()
    }
    assert {name for name, _ in by_path} == set(paths.values())
    different = {key for key, verdict in by_path.items() if verdict != by_name[key]}
    # One that is no longer different is to be taken off the list.
    assert different == {key for key in DIFFERENT if key in by_path}


@pytest.fixture(scope="module")
def survey(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """A survey of our own files, with its exit status."""
    folder = tmp_path_factory.mktemp("survey")
    document = folder / "survey.json"
    folders = {str(BUILT_IN.model_path(name, model_format).parent) for name, model_format in FILES}
    harness("survey", *sorted(folders), "--states", "8", "--out", str(folder / "reports"), "--json", str(document))
    found: dict[str, Any] = json.loads(document.read_text())
    return found


@pytest.mark.ci
def test_a_survey_of_our_own_files_leaves_no_row_unexplained(survey: dict[str, Any]) -> None:
    assert len(survey["files"]) >= len(FILES)
    assert [row for row in [*survey["subjects"], *survey["switched_on"]] if not row["explained"]] == []


@pytest.mark.ci
def test_constraints_that_give_have_one_verdict_by_name_and_by_path(survey: dict[str, Any], by_name: Verdicts) -> None:
    """By path they are among what a file has switched on, which is asked for beside the plain answer."""
    names = {str(BUILT_IN.model_path(name, one)): name for name, one in FILES}
    rows = [row for row in survey["switched_on"] if row["engine"] == "mujoco" and row["verdict"] and row["path"] in names]
    verdicts_of = {(names[row["path"]], f"mujoco/{row['format']}"): "explained" if row["departures"] else row["verdict"] for row in rows}
    told = {key: SOUND.get(verdict, verdict) for key, verdict in verdicts_of.items()}
    assert len(told) > 10 and told == {key: by_name[key] for key in told}


@pytest.mark.ci
@pytest.mark.parametrize("model_format", sorted({model_format for _, model_format in FILES}))
def test_a_check_and_a_survey_of_plain_engines_come_to_one_verdict(model_format: str, survey: dict[str, Any], tmp_path: Path) -> None:
    paths = [str(BUILT_IN.model_path(name, one)) for name, one in FILES if one == model_format]
    names = {str(BUILT_IN.model_path(name, one)): name for name, one in FILES if one == model_format}
    checked = verdicts(paths, tmp_path / "check.json")
    acting = {(row["path"], f"{row['engine']}/{row['format']}"): row for row in survey["switched_on"] if row["verdict"]}
    different = set()
    for row in (row for row in survey["subjects"] if not row["aided"] and row["path"] in names):
        subject = f"{row['engine']}/{row['format']}"
        said = "unsupported" if row["another_robot"] else AS_CHECKED[row["verdict"], bool(row["lost_digits"])]
        if row["verdict"] in ("disagrees", "unstable") and are_misread(msgspec.convert(row["readings"], list[Effect], strict=False)):
            said = "misreads"
        on = acting.get((row["path"], subject))
        if on is not None and said == "agrees":
            said = "explained" if on["departures"] or on["to_the_end"] is not None else SOUND.get(on["verdict"], on["verdict"])
        if checked[row["path"], subject] != said:
            different.add((names[row["path"]], subject))
    poles = {key for key, reason in DIFFERENT.items() if reason == POLE}
    assert different == {key for key in poles | DRIVEN_BY_A_CHECK if key[1] == f"pinocchio/{model_format}"}
