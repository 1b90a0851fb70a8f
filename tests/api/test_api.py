"""``import harness`` as a script or notebook uses it."""

from __future__ import annotations

import pydoc
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
import sympy as sp
from catalogue import BUILT_IN
from support import InThisProcess

import harness
from harness.errors import InvalidInput, InvalidModel, InvalidRequest
from harness.lagrange.derivation import load_system
from harness.truth.sampling import generic_sample


@pytest.fixture(autouse=True)
def in_this_process(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("harness.workers.Workers", InThisProcess)


def test_everything_public_is_there_and_documented() -> None:
    page = pydoc.plain(pydoc.render_doc(harness))
    for name in harness.__all__:
        assert getattr(harness, name) is not None
        assert name in page or name == "__version__"
    for name in ("load", "check", "compare", "diagnose", "System", "Library", "Record", "Records", "Verdict"):
        assert (getattr(harness, name).__doc__ or "").strip()
    assert set(harness.__all__) <= set(dir(harness))
    with pytest.raises(AttributeError, match="nothing_like_it"):
        _ = harness.nothing_like_it


def test_rooms_do_not_hide_functions() -> None:
    """A room of the name of a function would take its place as soon as it is imported."""
    rooms = {path.name for path in Path(harness.__file__).parent.iterdir() if (path / "__init__.py").is_file()}
    assert not rooms & set(harness.__all__)


def test_importing_costs_nothing() -> None:
    code = "import sys, harness; print(sorted(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    for heavy in ("numpy", "sympy", "heyoka", "mujoco", "pinocchio", "flint", "scipy", "hypothesis", "click"):
        assert f"'{heavy}'" not in done.stdout


def test_the_equations_are_sympy() -> None:
    pendulum = harness.load("double_pendulum")
    q, v = (sp.Matrix(symbols) for symbols in (pendulum.equations.coordinates, pendulum.equations.rates))
    assert pendulum.M.shape == pendulum.C.shape == (2, 2) and pendulum.g.shape == (2, 1)
    assert (pendulum.C * v - pendulum.equations.velocity_terms).applyfunc(sp.simplify) == sp.zeros(2, 1)
    assert pendulum.g.free_symbols & set(q)
    assert pendulum.latex.count(r"\ddot") >= 2


@pytest.mark.parametrize("name", ["double_pendulum", "arm_3r", "collar"])
def test_the_truth_is_within_its_bound(name: str, exact_of: Callable[[harness.System], Any]) -> None:
    """Against the equations in mpmath at 80 digits; the bound is no wider than the rounding to float64."""
    system, mechanism = harness.load(name), harness.load(name).mechanism
    states = generic_sample(mechanism, 4, 3)
    found = system.accelerations(states.q, states.v, states.tau)
    assert found.certified.all()
    exact = exact_of(load_system(BUILT_IN.system_path(name))[0])
    for index in range(4):
        arguments = [*states.q[index], *states.v[index], *states.tau[index], 0.0, *mechanism.parameter_values]
        for truth, value, bound in zip(exact.accelerations(arguments), found.value[index], found.error_bound[index], strict=True):
            with mpmath.workdps(60):
                assert abs(truth - mpmath.mpf(float(value))) <= bound <= 1.5e-16 * abs(truth)


@pytest.mark.parametrize("name", ["double_pendulum", "collar"])
def test_derivatives_are_within_their_bounds(name: str, exact_of: Callable[[harness.System], Any]) -> None:
    """Against differences of the equations in mpmath at 80 digits."""
    system, mechanism = harness.load(name), harness.load(name).mechanism
    states, nv = generic_sample(mechanism, 2, 3), mechanism.nv
    found = system.derivatives(states.q, states.v, states.tau)
    exact, step = exact_of(load_system(BUILT_IN.system_path(name))[0]), mpmath.mpf(10) ** -30
    assert found.certified.all() and found.error_bound.shape == (2, 3, nv, nv) and found.data_roundoff.shape == (2, 3, nv)
    for index in range(2):
        arguments = [*states.q[index], *states.v[index], *states.tau[index], 0.0, *mechanism.parameter_values]
        for part, matrix in enumerate((found.by_position, found.by_velocity, found.by_force)):
            for column in range(nv):
                with mpmath.workdps(80):
                    sides = []
                    for sign in (1, -1):
                        changed = [mpmath.mpf(float(value)) for value in arguments]
                        changed[part * nv + column] += sign * step
                        sides.append(exact.accelerations(changed))
                    slopes = [(more - less) / (2 * step) for more, less in zip(*sides, strict=True)]
                    for row, truth in enumerate(slopes):
                        error, bound = abs(truth - float(matrix[index, row, column])), found.error_bound[index, part, row, column]
                        assert error <= bound + mpmath.mpf(10) ** -25 and bound <= 1.5e-16 * abs(truth) + mpmath.mpf(10) ** -25


def test_derivatives_along_tied_coordinates_are_refused() -> None:
    with pytest.raises(InvalidRequest, match="four_bar: its constraints tie the joints"):
        harness.load("four_bar").derivatives([0.0] * 3, [0.0] * 3)


@pytest.mark.parametrize("name", ["double_pendulum", "collar"])
def test_what_controllers_take_is_within_its_bound(name: str) -> None:
    """Against the equations of SymPy at 60 digits; the bound is no wider than the rounding to float64."""
    system, states = harness.load(name), generic_sample(harness.load(name).mechanism, 3, 3)
    equations, accelerations = system.equations, sp.symbols(f"a:{system.mechanism.nv}")
    bias = equations.velocity_terms + equations.gravity_terms
    inverse = equations.mass_matrix * sp.Matrix(accelerations) + bias - equations.passive_forces
    pairs = [
        (system.mass_matrix(states.q), equations.mass_matrix),
        (system.bias(states.q, states.v), bias),
        (system.inverse_dynamics(states.q, states.v, states.tau), inverse),
    ]
    numbers = {name: value for name, value, _ in system.mechanism.parameters}
    symbols = [*equations.coordinates, *equations.rates, *accelerations]
    with mpmath.workdps(60):
        for found, expression in pairs:
            parameters = sorted(expression.free_symbols - set(symbols), key=str)
            exact = sp.lambdify([*symbols, *parameters], expression, "mpmath")
            assert found.certified.all()
            for index in range(3):
                given = [*states.q[index], *states.v[index], *states.tau[index], *(numbers[str(symbol)] for symbol in parameters)]
                truths = list(exact(*(mpmath.mpf(float(number)) for number in given)))
                for truth, value, bound in zip(truths, found.value[index].ravel(), found.error_bound[index].ravel(), strict=True):
                    assert abs(truth - mpmath.mpf(float(value))) <= bound <= 1.5e-16 * abs(truth)


@pytest.mark.parametrize("name", ["quadrotor", "heavy_top", "arm_3r"])
def test_forces_and_accelerations_are_inverse(name: str) -> None:
    """Applied forces follow from the accelerations that they cause, as far as these are known."""
    system = harness.load(name)
    states = generic_sample(system.mechanism, 8, 1)
    caused = system.accelerations(states.q, states.v, states.tau)
    found, mass = system.inverse_dynamics(states.q, states.v, caused.value), system.mass_matrix(states.q)
    assert found.certified.all() and mass.certified.all()
    unknown = np.einsum("nij,nj->ni", np.abs(mass.value), caused.error_bound) * (1 + 1e-9) + found.error_bound
    assert (np.abs(found.value - states.tau) <= unknown).all()
    # Without accelerations it is the bias, but for springs and dampers, of which these have none.
    still = system.inverse_dynamics(states.q, states.v, np.zeros_like(states.v))
    assert (np.abs(still.value - system.bias(states.q, states.v).value) <= 2 * still.error_bound).all()


def test_accelerations_do_not_determine_the_forces_on_a_loop() -> None:
    loop = harness.load("four_bar")
    q, v = np.zeros(loop.mechanism.nq), np.zeros(loop.mechanism.nv)
    assert loop.mass_matrix(q).value.shape == (1, len(v), len(v))
    with pytest.raises(InvalidRequest, match="has constraints"):
        loop.inverse_dynamics(q, v, v)


def test_a_bound_is_infinite_where_nothing_is_certain() -> None:
    top = harness.load("heavy_top")
    found = top.accelerations([0.0] * top.mechanism.nq, [1.0] * top.mechanism.nv)
    assert not found.certified.any() and np.isinf(found.error_bound).all()


def test_sizes_are_checked() -> None:
    with pytest.raises(ValueError, match=r"double_pendulum has \(2, 2, 2\)"):
        harness.load("double_pendulum").accelerations([0.0], [0.0, 0.0])
    with pytest.raises(InvalidRequest, match="did you mean 'double_pendulum'"):
        harness.load("double_pendulm")


def test_anybodys_answers_are_compared() -> None:
    pendulum = harness.load("double_pendulum")
    q, v = [[0.3, -0.2], [1.0, 0.4]], [[1.0, 0.5], [0.0, -2.0]]
    truth = pendulum.accelerations(q, v).value
    right = harness.compare("double_pendulum", q, v, truth)
    assert list(right.verdicts) == ["agrees", "agrees"] and (right.backward_error <= 1).all()
    wrong = harness.compare("double_pendulum", q, v, truth * (1 + 1e-9))
    assert list(wrong.verdicts) == ["disagrees", "disagrees"]


def test_a_comparison_of_answers_says_how_many_agree_and_shows_the_worst_first() -> None:
    pendulum = harness.load("double_pendulum")
    q = np.linspace(0.1, 1.0, 24).reshape(12, 2)
    answers = pendulum.accelerations(q, 0 * q).value
    answers[3] *= 1 + 1e-9
    answers[7, 0] = np.nan
    shown = repr(pendulum.compare(q, 0 * q, answers)).splitlines()
    assert shown[0].startswith("10 of 12 answers agree with the truth; the largest backward error is ")
    assert shown[2].split()[:2] == ["7", "error"] and shown[3].split()[:2] == ["3", "disagrees"]
    assert shown[-1] == "and 2 answers more, none of them worse; .table() has all"
    assert pendulum.compare(q, 0 * q, answers)._repr_html_().count("<tr>") == 11
    assert repr(pendulum.compare(q[:1], 0 * q[:1], answers[:1])).startswith("the answer agrees with the truth")


@pytest.mark.ci
def test_a_check_is_a_table_of_records(tmp_path: Path) -> None:
    records = harness.check("bar_pendulum", states=40)
    assert {record.subject for record in records} >= {"lagrange", "mujoco/mjcf", "pinocchio/urdf"}
    assert all(isinstance(record, harness.Record) and record.verdict == harness.Verdict.AGREES for record in records)
    assert "<table" in records._repr_html_() and "mujoco/mjcf" in str(records)
    assert repr(records) == str(records) and repr(records).startswith("bar_pendulum: all 5 subjects agree.\n\n")
    assert [record.subject for record in harness.check("bar_pendulum", subjects="lagrange", states=40)] == ["lagrange"]
    wanted = {"subjects": ["mujoco/mjcf"], "states": 20}
    both = harness.check("bar_pendulum", quantities=["mass_matrix", "accelerations"], **wanted)
    assert [(record.quantity, record.verdict) for record in both] == [("accelerations", "agrees"), ("mass_matrix", "agrees")]
    with pytest.raises(InvalidRequest, match="did you mean 'mass_matrix'"):
        harness.check("bar_pendulum", quantities="mass_matix")
    with pytest.raises(InvalidModel, match="no such file"):
        harness.check("bar_pendulum", mjcf=tmp_path / "none.xml", states=40)


@pytest.mark.ci
def test_a_diagnosis_names_line_and_value(tmp_path: Path) -> None:
    model = tmp_path / "heavier.xml"
    text = BUILT_IN.model_path("bar_pendulum", "mjcf").read_text()
    model.write_text(text.replace('mass="2"', 'mass="2.0000001"'))
    causes = harness.diagnose("bar_pendulum", mjcf=model, states=40)
    assert [cause.subject for cause in causes] == ["mujoco/mjcf", "pinocchio/mjcf"]
    assert all("explains it with 2.0 " in cause.first_line for cause in causes)
    lines = repr(causes).splitlines()
    assert lines[0].startswith("bar_pendulum: the mjcf model is at fault") and lines[-1] == "  pinocchio/mjcf: as mujoco/mjcf"
    assert lines[-2] == f"  mujoco/mjcf: {causes[0].first_line}"
    assert harness.diagnose("bar_pendulum", states=40) == []


def test_a_check_of_a_file_says_which_reading_explains_an_answer() -> None:
    path = Path(__file__).parents[1] / "comparison" / "files" / "arm.urdf"
    records = harness.check(path, subjects="pinocchio/urdf", states=8)
    assert [record.verdict for record in records] == ["explained"]
    assert repr(records).startswith("arm.urdf: 1 subject") and records[0].system == str(path)
    assert "Pinocchio's ABA applies no joint damping" in repr(records) and "applies no joint damping" in records._repr_html_()


def test_robots_files_are_compared() -> None:
    folder = Path(__file__).parents[1] / "comparison" / "files"
    found = harness.compare(folder / "arm.urdf", str(folder / "arm.xml"), states=8, workers=1)
    assert [pair.same for pair in found.pairs] == [True] and found.as_expected
    assert {reading.name for subject in found.subjects for reading in subject.readings} >= {"joint damping"}
    printed, page = repr(found), found._repr_html_()
    assert all(words in text for text in (printed, page) for words in ("arm.urdf", "MuJoCo", "joint damping", "the same robot"))
    assert printed.startswith("arm.urdf and arm.xml are the same robot (")
    assert "<strong>arm.urdf and arm.xml are the same robot" in page and "<html" not in page and max(map(len, printed.split())) < 200
    with pytest.raises(InvalidInput, match="there is no such file"):
        harness.compare("nothing.urdf", workers=1)


def test_a_setting_that_is_none_is_named_with_the_nearest() -> None:
    with pytest.raises(TypeError, match=r"got an unexpected keyword argument 'state'; .*states"):
        harness.check("simple_pendulum", state=3)  # type: ignore[call-arg]
