"""A mechanism as a notebook shows it: card, LaTeX, picture; its joints and parameters; and a ``System`` without files."""

from __future__ import annotations

import re
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from catalogue import BUILT_IN
from support import InThisProcess
from sympy.physics.mechanics import dynamicsymbols

import harness
from harness.errors import InvalidRequest
from harness.lagrange.derivation import load_atlas, load_mechanism, load_system, mechanism_of_charts, with_values_of
from harness.truth.sampling import generic_sample

ARM = Path(__file__).parents[1] / "comparison" / "files" / "arm.urdf"


@pytest.fixture(autouse=True)
def in_this_process(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("harness.workers.Workers", InThisProcess)


def system(name: str) -> harness.System:
    return load_atlas(BUILT_IN.system_path(name))[0][0]


@pytest.mark.parametrize("name", ["double_pendulum", "puma_560", "four_bar", "heavy_top"])
def test_a_card_is_short_and_says_what_the_mechanism_is(name: str) -> None:
    shown, mechanism = harness.load(name), load_mechanism(BUILT_IN, name)
    text, page = repr(shown), shown._repr_html_()
    assert text.startswith(f"{name}: ") and text.count("\n") < 16 and max(map(len, text.splitlines())) <= 100
    assert len(page) < 20_000 and page.count("<svg") == 1 and "\\ddot" not in page and not hasattr(shown, "_repr_latex_")
    for words in (" ".join(text.split()), page.replace("\N{NO-BREAK SPACE}", " ")):
        assert f"{mechanism.program.operations:,} operations" in words
        for joint in mechanism.joints:
            assert joint in words
        for parameter, value, unit in mechanism.parameters:
            assert f"{parameter} = {value:.17g}".rstrip("0") in words or f"{parameter} = {value!r}".removesuffix(".0") + f" {unit}" in words


def test_the_card_of_a_robot_counts_the_numbers_of_its_file(tmp_path: Path) -> None:
    robot = harness.load(ARM)
    assert f"{robot.mechanism.program.operations:,} operations, by recursion over the bodies of the file" in repr(robot)
    assert "<svg" not in robot._repr_html_()
    with pytest.raises(InvalidRequest, match=r"arm.urdf: no picture, for one is drawn of a mechanism with model files"):
        robot.picture()


@pytest.mark.parametrize("name", ["heavy_top", "double_pendulum", "cart_pendulum", "gyroscope_gimbals", "four_bar", "free_body"])
def test_latex_has_each_name_as_sympy_writes_it(name: str) -> None:
    loaded = harness.load(name)
    accented = set(re.findall(r"\\d?dot\{(.+?)\}", loaded.latex))
    assert accented == {sp.latex(sp.Symbol(q.name)).partition("_")[0] for q in loaded.equations.coordinates}
    assert loaded.latex._repr_latex_() == f"$${loaded.latex}$$"


def test_greek_letters_stand_under_their_accents() -> None:
    latex = harness.load("heavy_top").latex
    assert r"\dot{\phi}" in latex and r"\ddot{\psi}" in latex and "{phi}" not in latex
    assert r"\ddot{q}_{1}" in harness.load("double_pendulum").latex


@pytest.mark.ci
def test_what_is_too_long_to_typeset_is_a_text() -> None:
    arm = harness.load("stanford_arm")
    assert len(arm.latex) > 20_000 and arm.latex._repr_latex_() is None


def test_joints_and_parameters_have_names_values_and_units() -> None:
    assert harness.load("heavy_top").joints == {"pivot": ("phi", "theta", "psi")}
    assert harness.load("cart_pendulum").joints == {"slide": ("x",), "pin": ("theta",)}
    assert harness.load("double_pendulum").parameters["l1"] == (1.5, "m")
    assert list(harness.load(ARM).joints) == list(harness.load(ARM).mechanism.joints)


def test_all_names_of_a_library_are_told(tmp_path: Path) -> None:
    assert harness.mechanisms() == BUILT_IN.system_names()
    (tmp_path / "systems").mkdir()
    (tmp_path / "systems" / "own.py").touch()
    assert harness.mechanisms(tmp_path) == ["own"]


@pytest.mark.ci
@pytest.mark.parametrize("name", ["double_pendulum", "four_bar", "heavy_top", "chain_3", "free_body"])
def test_other_values_give_the_mechanism_that_would_be_derived_from_them(name: str) -> None:
    """To the last bit of every field, which the derivation of a changed system has."""
    atlas, _ = load_atlas(BUILT_IN.system_path(name))
    changed = [replace(one, parameters={s: (1.25 * value, unit) for s, (value, unit) in one.parameters.items()}) for one in atlas]
    derived = mechanism_of_charts(changed, name)
    found = with_values_of(mechanism_of_charts(atlas, name), changed[0])
    assert replace(found, derivation_seconds=0.0) == replace(derived, derivation_seconds=0.0)
    names = {symbol.name: value for symbol, (value, _) in changed[0].parameters.items()}
    loaded = harness.load(name).with_parameters(names)
    assert {one: value for one, (value, _) in loaded.parameters.items()} == names
    states = generic_sample(derived, 4, seed=1)
    assert np.array_equal(loaded.accelerations(states.q, states.v).value, harness.load(changed[0]).accelerations(states.q, states.v).value)


def test_other_values_are_named_and_have_no_picture() -> None:
    pendulum = harness.load("double_pendulum")
    longer = pendulum.with_parameters(l1=2).with_parameters({"m2": 3.0})
    assert repr(longer).startswith("double_pendulum with m2 = 3 kg, l1 = 2 m: ") and "<svg" not in longer._repr_html_()
    assert pendulum.parameters["l1"].value == 1.5
    with pytest.raises(InvalidRequest, match="no picture, for its parameters are not those of its models"):
        longer.picture()


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"l3": 1.0}, "double_pendulum has no parameter 'l3'; expected one of 'm1'"),
        ({"l1": -1.0}, "double_pendulum: parameter l1 holds -1, and l1 is declared positive"),
        ({"l1": "2"}, "double_pendulum: parameter l1 is '2'; expected a finite number"),
        ({"l1": float("nan")}, "parameter l1 is nan; expected a finite number"),
    ],
)
def test_values_that_cannot_be_are_refused(values: dict[str, float], message: str) -> None:
    with pytest.raises(InvalidRequest, match=message):
        harness.load("double_pendulum").with_parameters(values)


def test_a_number_of_a_robot_s_file_has_another_value() -> None:
    robot = harness.load(ARM)
    mass = next(name for name in robot.parameters if "mass" in name)
    heavier = robot.with_parameters({mass: 2 * robot.parameters[mass].value})
    q = np.full(robot.mechanism.nq, 0.3)
    states = q, 0 * q[: robot.mechanism.nv]
    assert not np.array_equal(heavier.accelerations(*states).value, robot.accelerations(*states).value)
    with pytest.raises(InvalidRequest, match="is inf; expected a finite number"):
        robot.with_parameters({mass: float("inf")})


@pytest.mark.ci
@pytest.mark.parametrize("name", ["cart_pendulum", "double_pendulum", "chain_3", "four_bar"])
def test_a_system_without_files_has_the_numbers_of_the_file_s(name: str) -> None:
    own, known = harness.load(system(name)), harness.load(name)
    states = generic_sample(known.mechanism, 4, seed=2)
    assert np.array_equal(own.accelerations(states.q, states.v).value, known.accelerations(states.q, states.v).value)
    assert own.latex == known.latex and own.joints == known.joints
    assert f"{own.mechanism.program.operations:,} operations" in own._repr_html_() and "<svg" not in own._repr_html_()


def test_a_system_that_cannot_be_derived_says_why() -> None:
    x, m = dynamicsymbols("x"), sp.Symbol("m", positive=True)
    cubic = harness.System(
        coordinates={x: "slide"}, kinetic=m * x.diff(harness.TIME) ** 3, potential=sp.S.Zero, parameters={m: (1.0, "kg")}, total_mass=m
    )
    with pytest.raises(InvalidRequest, match="no equations can be derived: kinetic is not of second degree in the rates"):
        harness.load(cubic)
    with pytest.raises(InvalidRequest, match="load takes a name, a path or a System, and got 3"):
        harness.load(3)  # type: ignore[arg-type]


@pytest.mark.parametrize("function", [harness.check, harness.diagnose])
def test_a_check_of_a_system_without_files_says_which_to_write(function: object) -> None:
    for asked in (system("cart_pendulum"), harness.load(system("cart_pendulum"))):
        with pytest.raises(InvalidRequest, match=r"no model files, .*systems/NAME.py.*mjcf/NAME.xml and urdf/NAME.urdf.*harness new"):
            function(asked)  # type: ignore[operator]
    with pytest.raises(InvalidRequest, match="checked by their names; write 'collar'"):
        function(harness.load("collar"))  # type: ignore[operator]


@pytest.mark.ci
def test_pictures_and_plots_stand_alone_and_need_no_bokeh(tmp_path: Path) -> None:
    code = """
import sys
sys.modules["bokeh"] = None
import harness
if __name__ == "__main__":
    pendulum = harness.load("cart_pendulum")
    pendulum._repr_html_()
    pendulum.picture().save("picture.svg")
    pendulum.simulate([0.0, 0.5], [0.0, 0.0], 2.0).plot().save("plot.svg")
"""
    (tmp_path / "script.py").write_text(code)
    subprocess.run([sys.executable, "script.py"], cwd=tmp_path, check=True)
    picture, plot = (ElementTree.parse(tmp_path / name).getroot() for name in ("picture.svg", "plot.svg"))
    assert "svg.mechanism" in picture[0].text and "var(--" in picture[0].text  # type: ignore[operator]
    assert len([one for one in plot.iter() if one.tag.endswith("polyline")]) == 2


def test_the_equations_of_the_card_are_those_of_the_system_s_file() -> None:
    assert load_system(BUILT_IN.system_path("heavy_top"))[0].parameters == harness.load("heavy_top").system.parameters
    with pytest.raises(InvalidRequest, match=r"arm.urdf is a robot"):
        _ = harness.load(ARM).equations
