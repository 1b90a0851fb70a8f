"""Variants of a mechanism's models: found by name, asked of the readers of their formats, with the mechanism of their system."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import lxml.html
import mujoco
import numpy as np
import pinocchio
import pytest
from catalogue import BUILT_IN, VARIANTS
from support import cross_checked, harness, make_library

from harness.arrays import Array
from harness.crosscheck.expected import load_expectations
from harness.crosscheck.run import CrossCheck
from harness.crosscheck.settings import Settings, describe_run
from harness.engines import load_engine
from harness.engines.adapters.mujoco import urdf as mujoco_urdf
from harness.errors import InvalidInput, InvalidRequest
from harness.files.model_file import read_model
from harness.lagrange.derivation import load_mechanism
from harness.library import MODEL_SUFFIXES, Library, matching, orphaned_models
from harness.programs.states import States
from harness.report import build
from harness.report.summary import Summary
from harness.results.records import Record

NAME, VARIANT = "bar_pendulum", "bar_pendulum.turned"
# The bar along x, in a frame that is turned so that it hangs.
TURNED = {
    "mjcf": (
        ('<body name="bar"', '<body name="bar" quat="1 0 1 0"'),
        ('pos="0 0 -0.75" mass="2" diaginertia="0.5 0.5 1e-15"', 'pos="0.75 0 0" mass="2" diaginertia="1e-15 0.5 0.5"'),
    ),
    "urdf": (
        ('<child link="bar"/>', '<child link="bar"/>\n    <origin rpy="0 1.5707963267948966 0"/>'),
        ('xyz="0 0 -0.75"', 'xyz="0.75 0 0"'),
        ('ixx="0.5" ixy="0" ixz="0" iyy="0.5" iyz="0" izz="0"', 'ixx="0" ixy="0" ixz="0" iyy="0.5" iyz="0" izz="0.5"'),
    ),
}


def turned(model_format: str) -> str:
    text = BUILT_IN.model_path(NAME, model_format).read_text()
    for old, new in TURNED[model_format]:
        assert old in text
        text = text.replace(old, new)
    return text


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """A library whose bar pendulum has a variant in MJCF alone."""
    made = make_library(tmp_path / "library", [NAME, "spring_damper"])
    (made / "mjcf" / f"{VARIANT}.xml").write_text(turned("mjcf"))
    return made


def checked(root: Path, *names: str, **options: object) -> dict[tuple[str, str], Record]:
    records, _ = cross_checked(Settings(library=Library.at(root), names=names, states=40, examples=None, **options))  # type: ignore[arg-type]
    return {(record.system, record.subject): record for record in records}


def test_a_variant_is_found_by_its_name_and_has_the_mechanism_of_its_system(root: Path) -> None:
    library = Library.at(root)
    assert (library.system_names(), library.variant_names()) == ([NAME, "spring_damper"], [VARIANT])
    assert (library.formats_of(VARIANT), library.formats_of(NAME)) == (["mjcf"], ["mjcf", "urdf"])
    assert orphaned_models(library) == []
    assert load_mechanism(library, VARIANT) == load_mechanism(library, NAME)


def test_a_system_file_with_a_dot_in_its_name_is_a_system(root: Path) -> None:
    shutil.copy(root / "systems" / f"{NAME}.py", root / "systems" / f"{VARIANT}.py")
    library = Library.at(root)
    assert (VARIANT in library.system_names(), library.variant_names()) == (True, [])


def test_a_variant_may_be_one_of_a_member_of_a_family(tmp_path: Path) -> None:
    for folder in ("systems", "mjcf", "urdf"):
        (tmp_path / folder).mkdir()
    shutil.copy(BUILT_IN.systems / "chain.py", tmp_path / "systems")
    for name in ("chain_3.turned", "chain_4.turned", "chains_4.turned"):
        (tmp_path / "mjcf" / f"{name}.xml").touch()
    library = Library.at(tmp_path)
    assert library.variant_names() == ["chain_3.turned", "chain_4.turned"]
    assert library.system_path("chain_4.turned") == library.system_path("chain_4")
    assert [path.stem for path in orphaned_models(library)] == ["chains_4.turned"]


def test_a_variant_of_nothing_is_named(root: Path) -> None:
    (root / "mjcf" / "bar_pendulums.turned.xml").write_text(turned("mjcf"))
    (problem,) = CrossCheck(Settings(library=Library.at(root))).problems
    assert str(problem).endswith("bar_pendulums.turned.xml: has no system; expected systems/bar_pendulums.py beside it")


@pytest.mark.ci
def test_only_readers_of_its_formats_are_asked_at_the_states_of_its_system(root: Path) -> None:
    records = checked(root)
    of_variant = {subject: record for (system, subject), record in records.items() if system == VARIANT}
    assert sorted(of_variant) == ["mujoco/mjcf", "pinocchio/mjcf"]
    assert len(records) == 5 + 5 + 2
    assert {record.verdict for record in records.values()} == {"agrees"}
    assert {record.states for record in records.values()} == {40}
    assert all(record.origins == {"stored": 0, "sampled": 40, "searched": 0, "simplest": 0} for record in of_variant.values())
    assert sorted(checked(root, NAME)) == [pair for pair in sorted(records) if pair[0] == NAME]


@pytest.mark.ci
def test_a_variant_that_says_something_else_is_red_and_its_system_is_not(root: Path) -> None:
    path = root / "mjcf" / f"{VARIANT}.xml"
    path.write_text(path.read_text().replace('quat="1 0 1 0"', 'quat="1 0 1.00001 0"'))
    done = harness("check", "bar_*", "--library", ".", "--states", "40", cwd=root)
    assert done.returncode == 1
    assert f"{VARIANT} mujoco/mjcf: disagrees, expected agrees" in done.stdout
    assert f"replay: harness check {VARIANT} --subject mujoco/mjcf --library . --state" in done.stdout
    assert f"{path.name}:16: <body" in done.stdout and done.stdout.startswith("7 pairs: 5 agree, 2 differ unexpectedly:")
    assert f"{VARIANT}: the mjcf model is at fault: every engine that reads it is wrong" in done.stdout
    replay = next(line for line in done.stdout.splitlines() if "--state '" in line)
    state = replay.partition("--state '")[2].rstrip("'")
    done = harness("check", VARIANT, "--library", ".", "--subject", "mujoco/mjcf", "--state", state, cwd=root)
    assert done.returncode == 1 and "disagrees" in done.stdout
    done = harness("diagnose", VARIANT, "--library", ".", "--states", "40", "--evaluations", "200", cwd=root)
    assert done.returncode == 1 and f"{path.name}:16: <body" in done.stdout
    assert f"{VARIANT}: model mjcf, or equations: ask mujoco/plain mjcf" in done.stdout


@pytest.mark.parametrize(
    ("pattern", "systems"),
    [
        (VARIANT, {VARIANT}),
        ("bar_pendulum.*", {VARIANT}),
        ("bar_pendulum*", {NAME, VARIANT}),
        ("*.turned", {VARIANT}),
        ("spring_*", {"spring_damper"}),
    ],
)
def test_a_pattern_takes_all_that_it_fits(root: Path, pattern: str, systems: set[str]) -> None:
    assert set(matching(Library.at(root), [pattern])) == systems


@pytest.mark.parametrize(
    ("arguments", "problem"),
    [
        (("check", "spring_damper.*"), "no system and no variant of models fits 'spring_damper.*'"),
        (("check", "bar_pendulum.turnd"), "no system is called 'bar_pendulum.turnd'; did you mean 'bar_pendulum.turned'?"),
        (("check", VARIANT, "--subject", "mujoco/urdf"), "bar_pendulum.turned has a model in mjcf alone, which mujoco/urdf does not read"),
        (("bench", VARIANT), "'bar_pendulum.turned' is a variant of models, which only check, diagnose and show take; name bar_pendulum"),
    ],
)
def test_what_cannot_be_asked_is_refused(root: Path, arguments: tuple[str, ...], problem: str) -> None:
    done = harness(*arguments, "--library", ".", cwd=root)
    assert done.returncode == 2 and problem in done.stderr


def test_a_file_stands_in_for_a_variant_s_own_and_for_one_that_is_missing(root: Path) -> None:
    other = root / "other.urdf"
    other.write_text(turned("urdf"))
    records = checked(root, VARIANT, stand_ins={"urdf": other})
    assert sorted(subject for _, subject in records) == ["mujoco/mjcf", "mujoco/urdf", "pinocchio/mjcf", "pinocchio/urdf"]
    assert {record.verdict for record in records.values()} == {"agrees"}


def test_an_entry_names_a_variant_and_is_refused_with_it(root: Path) -> None:
    entry = f'[[expected]]\nsystem = "{VARIANT}"\nsubject = "mujoco/mjcf"\nverdict = "unsupported"\nreason = "none"\nlink = "none"\n'
    (root / "expected_verdicts.toml").write_text(entry)
    assert (VARIANT, "mujoco/mjcf") in load_expectations(Library.at(root)).entries
    record = checked(root, VARIANT)[VARIANT, "mujoco/mjcf"]
    assert (record.verdict, record.expected, record.as_expected) == ("agrees", "unsupported", False)
    (root / "mjcf" / f"{VARIANT}.xml").unlink()
    with pytest.raises(InvalidInput, match="which does not exist"):
        load_expectations(Library.at(root))


def test_what_a_variant_holds_in_surplus_is_found_under_its_name(root: Path) -> None:
    path = root / "mjcf" / f"{VARIANT}.xml"
    path.write_text(path.read_text().replace('<joint name="pin"', '<joint name="pin" armature="0"'))
    _, study = cross_checked(Settings(library=Library.at(root), names=[VARIANT], states=40, examples=None))
    (part,) = study.result().superfluous
    assert (part.system, part.attribute) == (VARIANT, "armature")


def test_list_and_show_tell_of_it(root: Path) -> None:
    (root / "urdf" / f"{VARIANT}.urdf").write_text(turned("urdf"))
    done = harness("list", "--library", ".", "--json", "list.json", cwd=root)
    assert re.search(rf"^ *{re.escape(VARIANT)} +mjcf, urdf$", done.stdout, re.MULTILINE)
    assert json.loads((root / "list.json").read_text())["variants"] == [{"name": VARIANT, "system": NAME, "formats": list(MODEL_SUFFIXES)}]
    (root / "urdf" / f"{VARIANT}.urdf").unlink()
    done = harness("show", VARIANT, "--library", ".", cwd=root)
    assert (done.returncode, done.stderr) == (0, "") and f"{VARIANT}.xml" in done.stdout and "urdf" not in done.stdout


@pytest.mark.ci
def test_a_report_counts_no_format_that_a_variant_does_not_stand_in_as_missing(root: Path) -> None:
    settings = Settings(library=Library.at(root), names=[NAME, VARIANT], states=40, examples=None)
    _, study = cross_checked(settings)
    summary = Summary(describe_run(settings.library, 40, 0, "quick", ["harness", "report"], "1"), study.result())
    assert summary.systems == [NAME, VARIANT] and list(summary.cards) == [NAME]
    assert summary.missing == []
    site = build(summary.run, study.result())
    [row] = [line for line in lxml.html.fromstring(site["index.html"]).xpath("//tr") if line[0].text_content() == VARIANT]
    assert [cell.text_content() for cell in row].count("not asked") == 2
    assert f"mechanisms/{VARIANT}.html" in site and "no record: not run" not in site["report.md"]


def test_every_shipped_variant_is_one_of_a_shipped_system() -> None:
    assert len(VARIANTS) > 10
    assert orphaned_models(BUILT_IN) == []
    with pytest.raises(InvalidRequest, match="is a variant of models"):
        BUILT_IN.select(VARIANTS[:1])


# What readers make of a variant that is expected to be unsupported, where nothing refuses it: its reason in the entry.


def _relative_errors(name: str, model_format: str, answers: Callable[[States], Array]) -> Array:
    """Of answers on a variant, against what the native engine of its format makes of the plain model."""
    file = read_model(BUILT_IN.model_path(BUILT_IN.system_of(name), model_format), model_format)
    joints = list(file.joint_lines)
    plain = load_engine(BUILT_IN, {"mjcf": "mujoco", "urdf": "pinocchio"}[model_format]).load(file, joints, 9.81)
    states = States.at(*np.random.default_rng(1).normal(size=(3, 50, len(joints))))
    truth = plain.forward_dynamics(states.q, states.v, states.tau)
    return np.asarray(np.linalg.norm(answers(states) - truth, axis=1) / np.linalg.norm(truth, axis=1))


def test_pinocchio_has_everything_of_a_mimic_joint_but_aba() -> None:
    text = BUILT_IN.model_path("simple_pendulum.mimic", "urdf").read_text()
    model, q = pinocchio.buildModelFromXML(text, mimic=True), np.array([0.3])
    data = model.createData()
    with pytest.raises(RuntimeError, match="does not support Joint Mimic"):
        pinocchio.aba(model, data, q, q, q)
    # m L^2 and m g L sin q, at the gravity that a model has from the start.
    np.testing.assert_allclose(pinocchio.crba(model, data, q), [[6.0]], rtol=1e-14)
    np.testing.assert_allclose(pinocchio.rnea(model, data, q, q, 0 * q), [1.5 * 9.81 * 2 * np.sin(0.3)], rtol=1e-14)


@pytest.mark.parametrize(("impedance", "low", "high"), [(None, 1e-2, 1e-1), (0.9999, 1e-5, 1e-3)])
def test_mujoco_s_mimic_joint_is_as_soft_as_the_entry_says(
    impedance: float | None, low: float, high: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = "simple_pendulum.mimic"
    monkeypatch.setattr(mujoco_urdf, "_ignored", lambda root, joints: iter(()))
    model, _ = mujoco_urdf.read(read_model(BUILT_IN.model_path(name, "urdf"), "urdf"), 9.81)
    model.opt.disableflags &= ~int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    assert model.neq == 1
    if impedance is not None:
        model.eq_solimp[:, :2] = impedance
    pin, gondola = (model.joint(joint).qposadr[0] for joint in ("pin", "gondola"))

    def answers(states: States) -> Array:
        data, found = mujoco.MjData(model), np.empty_like(states.v)
        for row, (q, v, tau) in enumerate(zip(states.q, states.v, states.tau, strict=True)):
            mujoco.mj_resetData(model, data)
            data.qpos[[pin, gondola]], data.qvel[[pin, gondola]], data.qfrc_applied[pin] = (q[0], 0.5 - q[0]), (v[0], -v[0]), tau[0]
            mujoco.mj_forward(model, data)
            found[row] = data.qacc[pin]
        return found

    assert low < np.median(_relative_errors(name, "urdf", answers)) < high
