"""Mechanisms that an engine cannot express: no model, an entry with the reason, and a run that is green until one of them changes.

The reasons of the built-in entries are held against the engines themselves.
"""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace
from support import cross_checked, harness, pytest_in_this_process, without_progress, written_site

from harness.crosscheck.expected import AGREES, Expectations, load_expectations
from harness.crosscheck.settings import Settings
from harness.engines import Subject, subjects
from harness.errors import InvalidInput
from harness.lagrange.derivation import load_mechanism
from harness.library import Library
from harness.programs.states import States
from harness.results.records import Record
from harness.truth.compare import compare
from harness.truth.reference import ReferenceKernel
from harness.truth.sampling import generic_sample

BUILT_IN = Library.built_in()
QUANTITIES = ("accelerations", "mass_matrix")
ENTRY = '[[expected]]\nsystem = "bar_pendulum"\nsubject = "{subject}"\nverdict = "{verdict}"\nreason = "{reason}"\nlink = "a page"\n'
REASONS = {
    "mujoco/mjcf": "no such joint",
    "pinocchio/mjcf": "no such tendon",
    "mujoco/urdf": "no such wheel",
    "pinocchio/urdf": "no such loop",
}
OF_MJCF, OF_URDF = ([subject for subject in REASONS if subject.endswith(ending)] for ending in ("/mjcf", "/urdf"))
RADIUS = 2.0


def entries(*named: str) -> str:
    return "\n".join(ENTRY.format(subject=subject, verdict="unsupported", reason=REASONS[subject]) for subject in named)


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """A library with a system that no model stands for and no entry excuses, beside one that has both models."""
    directory = tmp_path / "library"
    for folder in ("systems", "mjcf", "urdf"):
        (directory / folder).mkdir(parents=True)
    for name in ("bar_pendulum", "spring_damper"):
        shutil.copy(BUILT_IN.system_path(name), directory / "systems")
    for model_format in ("mjcf", "urdf"):
        shutil.copy(BUILT_IN.model_path("spring_damper", model_format), directory / model_format)
    return directory


def excuse(root: Path, text: str) -> None:
    (root / "expected_verdicts.toml").write_text(text)


def check(root: Path, stand_ins: dict[str, Path] | None = None) -> tuple[dict[str, Record], list[InvalidInput]]:
    settings = Settings(library=Library.at(root), names=["bar_pendulum"], states=40, stand_ins=stand_ins or {}, examples=None)
    records, study = cross_checked(settings)
    assert len(records) == 5
    return {record.subject: record for record in records}, study.problems


def test_a_model_that_an_entry_excuses_is_unsupported_and_the_equations_are_compared(root: Path) -> None:
    excuse(root, entries(*REASONS))
    records, problems = check(root)
    assert problems == []
    assert all(record.as_expected for record in records.values())
    for subject, reason in REASONS.items():
        record = records[subject]
        assert (record.verdict, record.states, record.message, record.expected_reason) == ("unsupported", 0, reason, reason)
    assert (records["lagrange"].verdict, records["lagrange"].states) == ("agrees", 40)


WRONG = (
    ENTRY.format(subject="mujoco/mjcf", verdict="disagrees", reason="wrong")
    + "backward_error = inf\nmedian_backward_error = inf\nshare = 1.0\n"
)
# Entries, subjects that are an error in spite of them, and models that are reported.
NOT_EXCUSED = {
    "no entry": ("", [*REASONS], ["bar_pendulum.urdf", "bar_pendulum.xml"]),
    "an entry of another subject": (entries(*OF_MJCF, "mujoco/urdf"), ["pinocchio/urdf"], ["bar_pendulum.urdf"]),
    "an entry of another verdict": (WRONG, [*REASONS], ["bar_pendulum.urdf", "bar_pendulum.xml"]),
}


@pytest.mark.parametrize("what", NOT_EXCUSED)
def test_a_missing_model_that_no_entry_excuses_is_an_error(root: Path, what: str) -> None:
    text, failing, reported = NOT_EXCUSED[what]
    excuse(root, text)
    records, problems = check(root)
    verdicts = {subject: record.verdict for subject, record in records.items()}
    assert verdicts == {"lagrange": "agrees"} | dict.fromkeys(REASONS, "unsupported") | dict.fromkeys(failing, "error")
    assert sorted(problem.path.name for problem in problems) == reported


@pytest.mark.ci
def test_subjects_that_read_the_same_format_need_an_entry_each(root: Path) -> None:
    excuse(root, entries(*REASONS))
    (root / "engines").mkdir()
    (root / "engines" / "other.py").write_text(
        "from harness.engines import Engine\n\n\nclass Other(Engine):\n"
        '    requires = ("numpy", "numpy")\n    formats = ("mjcf",)\n    load = print\n\n\nENGINE = Other()\n'
    )
    settings = Settings(library=Library.at(root), names=["bar_pendulum"], states=40, examples=None)
    records, study = cross_checked(settings)
    verdicts = {record.subject: record.verdict for record in records}
    assert verdicts == {"lagrange": "agrees", "other/mjcf": "error"} | dict.fromkeys(REASONS, "unsupported")
    assert [problem.path.name for problem in study.problems] == ["bar_pendulum.xml"]


@pytest.mark.parametrize("stands_in", [False, True])
def test_an_entry_is_stale_once_there_is_a_model(root: Path, stands_in: bool) -> None:
    """Even in a run of few states, which are spared other stale entries."""
    excuse(root, entries(*REASONS))
    model = BUILT_IN.model_path("bar_pendulum", "urdf")
    if not stands_in:
        shutil.copy(model, root / "urdf")
    records, problems = check(root, {"urdf": model} if stands_in else {})
    assert problems == []
    for subject in OF_URDF:
        assert (records[subject].verdict, records[subject].expected) == ("agrees", "unsupported")
        assert not records[subject].as_expected
    assert all(records[subject].as_expected for subject in OF_MJCF)


def test_a_model_that_cannot_be_read_is_not_missing(root: Path) -> None:
    excuse(root, entries(*REASONS))
    (root / "urdf" / "bar_pendulum.urdf").symlink_to("nowhere.urdf")
    (root / "mjcf" / "bar_pendulum.xml").write_text("")
    records, problems = check(root)
    assert {records[subject].verdict for subject in REASONS} == {"error"}
    assert len(problems) == 2


@pytest.mark.parametrize(
    ("verdict", "more", "fragment"),
    [
        ("unsupported", "backward_error = 1.0\n", "no backward_error, for what is unsupported is not compared"),
        ("unstable", "", "number 1 must have backward_error and median_backward_error and share"),
        ("disagrees", "backward_error = 1.0\n", "number 1 must have backward_error and median_backward_error and share"),
        ("misreads", "backward_error = 1.0\nshare = 1.0\n", "number 1 must have backward_error and median_backward_error and share"),
        ("undecided", "backward_error = 1.0\nshare = 1.0\n", "number 1 must have backward_error"),
        ("unstable", "backward_error = true\n", "number 1: Expected `float | null`, got `bool` - at `$.backward_error`"),
        ("unsupported", "note = 1\n", "unknown field `note`; expected the texts subject, verdict, reason, link, quantity, system"),
        ("unsuported", "", "did you mean 'unsupported'"),
        ("", "", "of length >= 1 - at `$.verdict`; expected the texts"),
        ("unsupported", 'versions = "about 3"\n', "versions = 'about 3' of mujoco/mjcf on bar_pendulum is no specifier; expected one as"),
        ("unsupported", "note =\n", "cannot be read as TOML: Invalid value"),
        (
            "unsupported",
            ENTRY.format(subject="mujoco/mjcf", verdict="unsupported", reason="again"),
            "[[expected]] number 2 repeats bar_pendulum",
        ),
        (
            "unsupported",
            ENTRY.format(subject="mujoco/mjcf", verdict="agrees", reason="again") + 'quantity = "accelerations"\n',
            "[[expected]] number 2 repeats bar_pendulum, mujoco/mjcf, accelerations",
        ),
    ],
)
def test_malformed_entries_are_refused(root: Path, verdict: str, more: str, fragment: str) -> None:
    excuse(root, ENTRY.format(subject="mujoco/mjcf", verdict=verdict, reason="none") + more)
    with pytest.raises(InvalidInput, match=re.escape(fragment)):
        load_expectations(Library.at(root))


@pytest.mark.parametrize(("more", "of_masses"), [("", "unsupported"), ('quantity = "accelerations"\n', "agrees")])
def test_an_entry_that_names_accelerations_is_about_them_alone(root: Path, more: str, of_masses: str) -> None:
    excuse(root, ENTRY.format(subject="mujoco/mjcf", verdict="unsupported", reason="none") + more)
    verdicts = {name: load_expectations(Library.at(root), name).of("bar_pendulum", "mujoco/mjcf").verdict for name in QUANTITIES}
    assert verdicts == {"accelerations": "unsupported", "mass_matrix": of_masses}


def test_a_family_that_writes_a_model_has_it(tmp_path: Path) -> None:
    assert BUILT_IN.has_model("chain_3", "mjcf") and not BUILT_IN.model_path("chain_3", "mjcf").exists()
    assert not BUILT_IN.has_model("rolling_disc", "mjcf")
    unsupported = Expectations({("chain_3", "mujoco/mjcf"): replace(AGREES, verdict="unsupported", reason="none", link="none")})
    assert unsupported.why_no_model(BUILT_IN, "chain_3", Subject("mujoco", "mjcf")) == ""
    assert Expectations().why_no_model(BUILT_IN, "rolling_disc", Subject("lagrange", "equations")) == ""


@pytest.mark.ci
def test_check_and_report_are_green_and_tell_the_reason(root: Path) -> None:
    excuse(root, entries(*REASONS))
    done = harness("report", "--library", ".", "--out", "out", "--json", "out.json", "--workers", "1", cwd=root)
    assert done.returncode == 0, done.stdout + done.stderr
    assert without_progress(done.stderr) == ""
    assert re.search(r"^bar_pendulum +mujoco/mjcf +0 +unsupported \(as expected\) ", done.stdout, re.MULTILINE)
    assert done.stdout.startswith("10 pairs: 6 agree, 4 differ for a known reason, 0 unexpectedly;")
    records = {(record["system"], record["subject"]): record for record in json.loads((root / "out.json").read_text())["records"]}
    assert records["bar_pendulum", "mujoco/mjcf"]["message"] == "no such joint"
    assert records["spring_damper", "mujoco/mjcf"]["verdict"] == "agrees"
    for text in ((root / "out" / "report.md").read_text(), written_site(root / "out").text):
        assert all(reason in text for reason in REASONS.values())

    shutil.copy(BUILT_IN.model_path("bar_pendulum", "urdf"), root / "urdf")
    arguments = ("--library", ".", "--states", "20", "--subject", "pinocchio/urdf", "--workers", "1")
    done = harness("check", "bar_pendulum", *arguments, cwd=root)
    assert done.returncode == 1
    assert "bar_pendulum pinocchio/urdf: agrees, expected unsupported" in done.stdout
    assert "expected because no such loop (a page)" in done.stdout and "remove or mend the entry" in done.stdout


def test_show_tells_the_reason_in_place_of_what_an_engine_holds(root: Path) -> None:
    excuse(root, entries(*REASONS))
    done = harness("show", "bar_pendulum", "--library", ".", "--html", "page.html", cwd=root)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    for subject, reason in REASONS.items():
        assert re.search(rf"^ +{subject} +unsupported: {reason}$", done.stdout, re.MULTILINE)
    page = (root / "page.html").read_text()
    assert "There is no model." in page and "unsupported: no such joint" in page and "<svg" not in page

    excuse(root, entries(*OF_MJCF))
    done = harness("show", "bar_pendulum", "--library", ".", cwd=root)
    assert done.returncode == 2
    assert "bar_pendulum.urdf" in done.stderr and "bar_pendulum.xml" not in done.stderr
    assert re.search(r"^ +pinocchio/urdf +no valid urdf model$", done.stdout, re.MULTILINE)

    excuse(root, "expected = 3\n")
    done = harness("show", "bar_pendulum", "--library", ".", cwd=root)
    assert done.returncode == 2
    assert "[[expected]]" in done.stderr and "theta''" in done.stdout and "Traceback" not in done.stderr


@pytest.mark.ci
def test_the_regression_passes_for_what_is_excused_only(root: Path) -> None:
    excuse(root, entries(*OF_MJCF, "mujoco/urdf"))
    done = pytest_in_this_process("-v", "--harness-library", ".", "--harness-states", "40", "-k", "bar_pendulum", cwd=root)
    assert done.returncode == 1
    assert "1 failed, 4 passed" in done.stdout, done.stdout
    assert "bar_pendulum.py::mujoco/mjcf PASSED" in done.stdout
    assert "bar_pendulum.py::pinocchio/urdf FAILED" in done.stdout
    assert "there is no such file" in done.stdout and "Traceback" not in done.stdout


def test_what_lacks_a_model_here_has_a_reason() -> None:
    expectations = load_expectations(BUILT_IN)
    for name in BUILT_IN.system_names():
        for subject in subjects(BUILT_IN):
            if subject.format != "equations" and not BUILT_IN.has_model(name, subject.format):
                assert expectations.why_no_model(BUILT_IN, name, subject)


def test_no_equality_of_mujoco_ties_rates() -> None:
    """Points, frames, joints, tendons and flexes: each row is of positions, so that nothing rolls but by friction."""
    import mujoco

    kinds = {name.removeprefix("mjEQ_") for name in mujoco.mjtEq.__members__}
    assert kinds == {"CONNECT", "WELD", "JOINT", "TENDON", "FLEX", "FLEXVERT", "FLEXSTRAIN", "DISTANCE"}


def test_no_constraint_of_pinocchio_ties_rates() -> None:
    import pinocchio

    kinds = {name for name in pinocchio.ContactType.names if name != "CONTACT_UNDEFINED"}
    assert kinds == {"CONTACT_3D", "CONTACT_6D"}


@pytest.fixture(scope="module")
def states() -> States:
    return generic_sample(load_mechanism(BUILT_IN, "cycloid_bead"), 256, seed=1)


def test_pinocchio_refuses_the_bead_in_aba_and_agrees_about_its_inertia_and_bias(states: States) -> None:
    """The wheel mimics the rail: what applies to it applies to the rail 1/R times."""
    import pinocchio

    model = pinocchio.buildModelFromXML(BUILT_IN.model_path("cycloid_bead", "urdf").read_text(), mimic=True)
    assert (model.nq, model.nv) == (1, 1)
    data = model.createData()
    with pytest.raises(RuntimeError, match="does not support Joint Mimic"):
        pinocchio.aba(model, data, np.ones(1), np.ones(1), np.zeros(1))

    reference = ReferenceKernel(load_mechanism(BUILT_IN, "cycloid_bead")).evaluate(states)
    answers = []
    for q, v, tau in zip(states.q[:, :1], states.v[:, :1], states.tau, strict=True):
        load = tau[0] + tau[1] / RADIUS - pinocchio.rnea(model, data, q, v, np.zeros(1))
        rail = float(load[0] / pinocchio.crba(model, model.createData(), q)[0, 0])
        answers.append([rail, rail / RADIUS])
    comparison = compare(reference, np.array(answers))
    assert set(comparison.verdicts) == {"agrees"}, comparison.backward_error.max()


def test_mujoco_ties_the_rolling_wheel_softly_at_any_impedance(states: States) -> None:
    import mujoco

    reference = ReferenceKernel(load_mechanism(BUILT_IN, "cycloid_bead")).evaluate(states)
    text = BUILT_IN.model_path("cycloid_bead", "mjcf").read_text()
    median: dict[float, float] = {}
    for impedance in (0.9, 0.99, 0.999, 0.9999, 1.0):
        model = mujoco.MjModel.from_xml_string(text.replace('polycoef="', f'solimp="{impedance} {impedance} 1" polycoef="'))
        data = mujoco.MjData(model)
        answers = []
        for q, v, tau in zip(states.q, states.v, states.tau, strict=True):
            data.qpos[:], data.qvel[:], data.qfrc_applied[:] = q, v, tau
            mujoco.mj_forward(model, data)
            answers.append(data.qacc.copy())
        comparison = compare(reference, np.array(answers))
        assert set(comparison.verdicts) == {"disagrees"}
        median[impedance] = float(np.median(np.abs(np.array(answers)[:, 1] / reference.high[:, 1] - 1)))
    # It falls like 1 - impedance, and 1 is taken for 0.9999: no setting makes the tie hard.
    assert median[0.99] / median[0.999] == pytest.approx(10, rel=0.1)
    assert median[0.999] / median[0.9999] == pytest.approx(10, rel=0.1)
    assert median[1.0] == median[0.9999] > 1e-4
    assert median[0.9] > 0.1
