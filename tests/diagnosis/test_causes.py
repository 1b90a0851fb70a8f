"""A check that is red names who is at fault, the wrong terms, and the number of the file that explains it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from catalogue import BUILT_IN
from comparison.robots import edited
from support import InThisProcess, cross_checked, make_library

from harness.crosscheck.settings import Settings
from harness.diagnosis import causes
from harness.diagnosis.causes import EVALUATIONS_IN_ALL
from harness.diagnosis.wanted import find_causes
from harness.engines import load_engine
from harness.explain.columns import diagnostic_states, watch
from harness.explain.model_side import diagnose
from harness.explain.result import Finding
from harness.explain.search import EVALUATIONS, Limits
from harness.files.model_file import read_model
from harness.lagrange.derivation import load_mechanism
from harness.library import Library
from harness.results.cross_check import Cause
from harness.results.records import Record
from harness.truth.reference import ReferenceKernel

NATIVE = {"mjcf": "mujoco/mjcf", "urdf": "pinocchio/urdf"}


def causes_of(tmp_path: Path, model_format: str, found: str, planted: str) -> tuple[list[Record], list[Cause]]:
    """Records and causes of a check of the pendulum whose model holds ``planted`` in the place of ``found``."""
    return checked(names=["simple_pendulum"], stand_ins={model_format: pendulum(tmp_path, model_format, found, planted)})


def pendulum(folder: Path, model_format: str, found: str, planted: str) -> Path:
    return edited(BUILT_IN.model_path("simple_pendulum", model_format), folder, (found, planted))


def checked(library: Library = BUILT_IN, **about: Any) -> tuple[list[Record], list[Cause]]:
    settings = Settings(library=library, states=40, examples=None, **about)
    records, _ = cross_checked(settings)
    return records, list(find_causes(settings, records, InThisProcess()))


@pytest.mark.ci
@pytest.mark.parametrize(
    ("model_format", "found", "planted"),
    [
        ("mjcf", 'mass="1.5"', 'mass="1.5000001"'),
        ("mjcf", 'mass="1.5"', 'mass="3"'),
        ("urdf", '<mass value="1.5"/>', '<mass value="1.5000001"/>'),
    ],
)
def test_a_wrong_number_is_named_with_its_line_and_the_value_that_explains_it(
    tmp_path: Path, model_format: str, found: str, planted: str
) -> None:
    records, causes = causes_of(tmp_path, model_format, found, planted)
    assert {cause.subject for cause in causes} == {f"mujoco/{model_format}", f"pinocchio/{model_format}"}
    assert {record.subject for record in records if not record.as_expected} == {cause.subject for cause in causes}
    for cause in causes:
        assert cause.inference.startswith(f"the {model_format} model is at fault")
        assert any("gravity" in sentence for sentence in cause.terms)
        assert planted.split('"')[1] in cause.first_line
        assert "explains it with 1.5 " in cause.first_line
        assert cause.found is not None
        assert cause.found["model"]["finding"] == "explained"
        assert cause.diagnosed == NATIVE[model_format]


def test_where_all_is_well_there_is_no_cause(tmp_path: Path) -> None:
    records, causes = causes_of(tmp_path, "mjcf", 'mass="1.5"', 'mass="1.50"')
    assert records and not causes


def test_an_engine_that_reads_no_model_is_asked_about_the_textbook_alone(tmp_path: Path) -> None:
    records, _ = causes_of(tmp_path, "mjcf", 'mass="1.5"', 'mass="1.50"')
    wrong = [replace(record, verdict="disagrees") if record.subject == "lagrange" else record for record in records]
    settings = Settings(library=BUILT_IN, names=["simple_pendulum"])
    (cause,) = find_causes(settings, wrong, InThisProcess())
    assert (cause.subject, cause.diagnosed, len(cause.sides)) == ("lagrange", "lagrange", 1)
    assert cause.inference.startswith("the float64 kernel of lagrange is at fault")
    assert "nothing to explain" in cause.first_line


@pytest.mark.ci
def test_where_every_engine_is_wrong_alike_the_textbook_goes_first(tmp_path: Path) -> None:
    old, new = 'mass="1.5"', 'mass="1.50001"'
    stand_ins = {"mjcf": pendulum(tmp_path, "mjcf", old, new)}
    stand_ins["urdf"] = pendulum(tmp_path, "urdf", '<mass value="1.5"/>', '<mass value="1.50001"/>')
    _, found = checked(names=["simple_pendulum"], stand_ins=stand_ins)
    assert len(found) == 4
    for cause in found:
        assert "behaves as if m = 1.50001 kg instead of 1.5" in cause.first_line


@pytest.mark.ci
@pytest.mark.parametrize("workers", [InThisProcess(), InThisProcess(time_limit=4.0)])
def test_the_evaluations_of_a_diagnosis_depend_on_how_much_is_wrong_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, workers: InThisProcess
) -> None:
    records, _ = causes_of(tmp_path, "mjcf", 'mass="1.5"', 'mass="1.6"')
    given: list[int] = []

    def examine(*arguments: Any) -> Any:
        given.append(arguments[4].evaluations)
        raise ValueError

    monkeypatch.setattr(causes, "examine", examine)
    settings = Settings(library=BUILT_IN, names=["simple_pendulum"], stand_ins={"mjcf": tmp_path / "simple_pendulum.xml"})
    list(find_causes(settings, records, workers))
    assert given == [EVALUATIONS]
    given.clear()
    renamed = [replace(record, system=f"system_{number}") for record in records for number in range(60)]
    list(find_causes(settings, renamed, workers))
    assert given == [EVALUATIONS_IN_ALL // 60] * 60
    given.clear()
    list(find_causes(settings, records, workers, evaluations=7))
    assert given == [7]


@pytest.mark.ci
def test_what_crashed_is_not_asked_again(tmp_path: Path) -> None:
    records, _ = causes_of(tmp_path, "mjcf", 'mass="1.5"', 'mass="1.6"')
    settings = Settings(library=BUILT_IN, names=["simple_pendulum"])
    causes = find_causes(settings, records, InThisProcess(), crashes={("simple_pendulum", "mjcf")})
    assert {(cause.subject, cause.diagnosed, cause.first_line == cause.inference) for cause in causes} == {
        ("mujoco/mjcf", "", True),
        ("pinocchio/mjcf", "", True),
    }


def point_mass(root: Path, moment_in_urdf: str) -> Path:
    """A library with a pendulum of 1 kg on 0.2 m, which feels an inertia of 1e-15 kg m^2 by 2.5e-14."""
    make_library(root, ["simple_pendulum"])
    moments = [(f'{name}="0"', f'{name}="{moment_in_urdf}"') for name in ("ixx", "iyy", "izz")]
    for path, changes in {
        "systems/simple_pendulum.py": [("m: (1.5", "m: (1.0"), ("L: (2.0", "L: (0.2")],
        "mjcf/simple_pendulum.xml": [('mass="1.5"', 'mass="1"'), ('pos="0 0 -2"', 'pos="0 0 -0.2"')],
        "urdf/simple_pendulum.urdf": [('mass value="1.5"', 'mass value="1"'), ('xyz="0 0 -2"', 'xyz="0 0 -0.2"'), *moments],
    }.items():
        edited(root / path, (root / path).parent, *changes)
    return root


@pytest.mark.ci
@pytest.mark.parametrize(("moment_in_urdf", "formats"), [("0", {"mjcf"}), ("1e-15", {"mjcf", "urdf"})])
def test_the_least_inertia_that_is_felt_is_named_with_its_remedy(tmp_path: Path, moment_in_urdf: str, formats: set[str]) -> None:
    """And no mass, length or gravity of fifteen digits, which would explain it as well."""
    records, found = checked(Library.at(point_mass(tmp_path / "library", moment_in_urdf)))
    assert {record.subject.partition("/")[2] for record in records if not record.as_expected} == formats
    causes = {cause.subject: cause.first_line for cause in found}
    remedies = {"mjcf": "take it off the inertia of a body that turns with this one", "urdf": "write 0, which a URDF may hold"}
    assert len(causes) == 2 * len(formats)
    for subject, line in causes.items():
        assert '1e-15">' in line or '="1e-15 1e-15 1e-15">' in line
        assert "the least inertia that MuJoCo accepts, 1e-15 kg m^2, is felt here" in line and remedies[subject.partition("/")[2]] in line


def test_a_least_inertia_explains_nothing_where_all_is_right() -> None:
    """As where an engine that factorises M is asked for a reason of what is wrong beside its accelerations."""
    mechanism, model = load_mechanism(BUILT_IN, "simple_pendulum"), read_model(BUILT_IN.model_path("simple_pendulum", "mjcf"), "mjcf")
    states = diagnostic_states(mechanism, 0)
    watched = watch(load_engine(BUILT_IN, "mujoco"), mechanism, model, states)
    found = diagnose(watched, ReferenceKernel(mechanism).evaluate(states), Limits(factorises=True))
    assert '"1e-15 ' in model.text and (found.finding, found.tried) == (Finding.SOUND, ())


@pytest.mark.ci
def test_a_mass_that_is_wrong_beside_a_least_inertia_is_named_itself(tmp_path: Path) -> None:
    library = Library.at(point_mass(tmp_path / "library", "0"))
    model = library.model_path("simple_pendulum", "mjcf")
    edited(model, model.parent, ('mass="1"', 'mass="1.0000001"'))
    _, [cause] = checked(library, subjects=["mujoco/mjcf"])
    assert "least inertia" not in cause.first_line


@pytest.mark.parametrize(
    ("system", "found", "planted"),
    [
        ("bar_pendulum", 'damping="0.3"/>', 'damping="0.3" frictionloss="6.5"/>'),
        ("dry_pendulum", 'damping="0.3" frictionloss="6.5"', 'damping="0.3" limited="true" range="-7 7"'),
    ],
)
def test_dry_friction_of_another_mechanism_is_the_file_s_fault_and_no_engine_is_examined(
    tmp_path: Path, system: str, found: str, planted: str
) -> None:
    """Its equations of motion are right, so that the readers were blamed, and a number of the file that has no part in it."""
    model = edited(BUILT_IN.model_path(system, "mjcf"), tmp_path, (found, planted))
    records, causes = checked(names=[system], stand_ins={"mjcf": model})
    refused = {record.subject for record in records if not record.as_expected}
    assert refused == {"mujoco/mjcf", "pinocchio/mjcf"} == {cause.subject for cause in causes}
    assert all("dry friction of joint pin" in record.message for record in records if record.subject in refused)
    assert all(cause.first_line.startswith("the mjcf model is at fault") and cause.found is None for cause in causes)
