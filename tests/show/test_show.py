"""``harness show``: what the files say, what engines hold, and a picture from the engines' own kinematics."""

from __future__ import annotations

import re
import shutil
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import lxml.html
import numpy as np
import pytest
from support import harness

from harness.commands.new import write_example
from harness.engines import load_engine
from harness.files.model_file import parse_model, read_model
from harness.files.text.joint_table import joint_rows
from harness.lagrange.derivation import load_mechanism
from harness.library import MODEL_SUFFIXES, Library
from harness.show.picture import draw
from harness.show.placement import CORNER, Pose, choose_view, place

# The view a reader of the mechanism would choose.
VIEWS = {
    "cart_pendulum": "x-z plane",
    "tora": "x-y plane",
    "scara": CORNER.name,
    "gyroscope_gimbals": CORNER.name,
    "heavy_top": CORNER.name,
}


def placements(name: str, model_format: str) -> tuple[Pose, Pose]:
    library = Library.built_in()
    model = read_model(library.model_path(name, model_format), model_format)
    mechanism = load_mechanism(library, name)
    engine = load_engine(library, {"mjcf": "mujoco", "urdf": "pinocchio"}[model_format])
    placed = place(engine.load(model, mechanism.joints, mechanism.gravity), mechanism)
    assert placed is not None
    return placed


@pytest.fixture
def library(tmp_path: Path) -> Path:
    write_example(tmp_path, "example", 2)
    return tmp_path


@pytest.mark.parametrize("name", ["cart_pendulum", "stanford_arm", "heavy_top", "chain_3"])
def test_show_tells_joints_and_what_engines_hold(tmp_path: Path, name: str) -> None:
    done = harness("show", name, "--html", "page.html", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    for fragment in ("Equations of motion", "Parameters:", "After loading:"):
        assert fragment in done.stdout
    for subject in ("mujoco/mjcf", "pinocchio/urdf"):
        assert re.search(rf"^ +{subject} .* as the system says$", done.stdout, re.MULTILINE), done.stdout
    page = (tmp_path / "page.html").read_text()
    (sound,) = re.findall(r"^  (sound: .*)$", done.stdout, re.MULTILINE)
    assert sound in page
    assert page.count("<svg") == 2
    assert "<math" in page or "kinetic, potential = energies(" in page
    assert not re.search(r"""src=|href="[^#]|<link""", page)


@pytest.mark.parametrize(("name", "words"), [("chain_6", "def system(n: int)"), ("scara", "def energies(links")])
def test_long_equations_are_shown_by_their_energies(name: str, words: str) -> None:
    mechanism = load_mechanism(Library.built_in(), name)
    assert not mechanism.equations_text and words in mechanism.energies_text
    assert "Source:" not in mechanism.energies_text.partition("# _serial_arm.py")[0] and "kinetic" in mechanism.energies_text
    assert not load_mechanism(Library.built_in(), "collar").energies_text


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("arm_2r", "2 by Lagrange; 22 with every body free: 6 accelerations of each of 2 bodies, and 10 reactions"),
        ("heavy_top", "3 by Lagrange; 9 with every body free: 6 accelerations of its body, and 3 reactions"),
        (
            "four_bar",
            "5 by Lagrange, 2 of them forces of constraints; 35 with every body free: 6 accelerations of each of 3 bodies, "
            "15 reactions, and 2 forces of constraints",
        ),
    ],
)
def test_equations_and_unknowns_are_counted_both_ways(name: str, said: str) -> None:
    assert f"Equations and unknowns: {said}\n" in harness("show", name).stdout


@pytest.mark.ci
def test_the_page_has_landmarks_contents_and_captions(library: Path) -> None:
    harness("show", "example", "--library", ".", "--html", "page.html", cwd=library)
    page = lxml.html.fromstring((library / "page.html").read_text())
    assert [child.tag for child in page.body] == ["header", "nav", "main"]
    assert [link.get("href") for link in page.xpath("//nav/ul/li/a")] == [f"#{anchor}" for anchor in page.xpath("//main//h2/@id")]
    assert page.xpath("//table") and all(table[0].tag == "caption" for table in page.xpath("//table"))
    assert all(head.get("scope") and head.text_content().strip() for head in page.xpath("//th"))
    assert len(page.xpath("//*[@id]")) == len(set(page.xpath("//@id")))


@pytest.mark.ci
def test_values_are_shown_in_full_and_joints_with_their_lines(tmp_path: Path) -> None:
    done = harness("show", "puma_560", cwd=tmp_path)
    model = read_model(Library.built_in().model_path("puma_560", "mjcf"), "mjcf")
    for joint, line in model.joint_lines.items():
        assert re.search(rf"^  {joint} +mjcf +hinge .* {line}$", done.stdout, re.MULTILINE)
    for symbol, value, _ in load_mechanism(Library.built_in(), "puma_560").parameters:
        shown = re.search(rf"^  {symbol} +(\S+)", done.stdout, re.MULTILINE)
        assert shown is not None and float(shown[1]) == value


def test_a_row_holds_what_the_file_says() -> None:
    library = Library.built_in()
    slide, pin = joint_rows(read_model(library.model_path("cart_pendulum", "mjcf"), "mjcf"))
    assert (slide.kind, slide.axis, slide.body, slide.mass, slide.stiffness, slide.damping) == ("slide", "1 0 0", "cart", "10", "270", "")
    assert (pin.kind, pin.axis, pin.origin, pin.mass, pin.damping) == ("hinge", "0 -1 0", "(0 0 0)", "1", "0.2")
    slide, pin = joint_rows(read_model(library.model_path("cart_pendulum", "urdf"), "urdf"))
    assert (slide.kind, slide.stiffness, pin.kind, pin.damping) == ("prismatic", "270", "revolute", "0.2")


def test_a_missing_model_costs_its_own_part_only(library: Path) -> None:
    (library / "urdf" / "example.urdf").unlink()
    done = harness("show", "example", "--library", ".", "--html", "page.html", cwd=library)
    assert done.returncode == 2
    assert "example.urdf" in done.stderr and "Traceback" not in done.stderr
    assert "q1''" in done.stdout
    assert "no valid urdf model" in done.stdout
    assert re.search(r"^ +mujoco/mjcf .* as the system says$", done.stdout, re.MULTILINE)
    assert (library / "page.html").read_text().count("<svg") == 2


def test_an_invalid_model_is_told_with_its_line_and_the_urdf_gives_the_picture(library: Path) -> None:
    model = library / "mjcf" / "example.xml"
    model.write_text(model.read_text().replace('mass="3"', 'mass="NaN"'))
    done = harness("show", "example", "--library", ".", "--html", "page.html", cwd=library)
    assert done.returncode == 2
    assert re.search(r"example.xml:\d+: .*NaN", done.stderr)
    assert (library / "page.html").read_text().count("<svg") == 2


def test_without_any_model_the_equations_are_left(library: Path) -> None:
    shutil.rmtree(library / "mjcf")
    shutil.rmtree(library / "urdf")
    done = harness("show", "example", "--library", ".", "--html", "page.html", cwd=library)
    assert done.returncode == 2
    assert "q1''" in done.stdout and "Traceback" not in done.stderr
    assert "<svg" not in (library / "page.html").read_text()


def test_what_an_engine_holds_is_held_against_the_system(library: Path) -> None:
    model = library / "mjcf" / "example.xml"
    model.write_text(model.read_text().replace('mass="3"', 'mass="4"'))
    done = harness("show", "example", "--library", ".", cwd=library)
    assert done.returncode == 2
    assert re.search(r"^ +mujoco/mjcf .* 10 +the moving bodies have 10 kg in all, expected 9 kg", done.stdout, re.MULTILINE)


def test_what_the_engines_hold_is_compared_joint_by_joint(library: Path) -> None:
    model = library / "urdf" / "example.urdf"
    text = model.read_text()
    found = re.search(r'<origin xyz="([^"]*)"', text[text.index("<joint") :])
    assert found is not None
    model.write_text(text.replace(found[0], '<origin xyz="0 0 -0.123"'))
    done = harness("show", "example", "--library", ".", "--html", "page.html", cwd=library)
    assert done.returncode == 0, done.stderr
    assert re.search(r"^  anchor of \w+ is .*, but .*-0\.123 .* ulps; .*example\.urdf:\d+$", done.stdout, re.MULTILINE)
    assert "sound:" not in done.stdout
    assert "-0.123 (" in (library / "page.html").read_text()


FATAL_ENGINE = """
import os

from harness.engines import Engine

class Engine(Engine):
    requires = ("{module}", "numpy")
    formats = ("mjcf",)

    def load(self, source, joints, gravity):
        os.abort()

ENGINE = Engine()
"""


@pytest.mark.ci
def test_a_crash_costs_one_line_and_a_missing_engine_is_told(library: Path) -> None:
    (library / "engines").mkdir()
    (library / "engines" / "fatal.py").write_text(FATAL_ENGINE.format(module="numpy"))
    (library / "engines" / "absent.py").write_text(FATAL_ENGINE.format(module="no_such_module"))
    done = harness("show", "example", "--library", ".", isolated=True, cwd=library)
    assert done.returncode == 3
    assert re.search(r"^ +fatal/mjcf +crashed by signal 6", done.stdout, re.MULTILINE)
    assert re.search(r"^ +absent/mjcf +not installed$", done.stdout, re.MULTILINE)
    assert re.search(r"^ +mujoco/mjcf .* as the system says$", done.stdout, re.MULTILINE)


def test_both_engines_place_the_joints_alike(modelled_name: str) -> None:
    """At zero and away from it: a wrong axis, origin or sign in a model is seen in the picture of one of them."""
    for mjcf, urdf in zip(placements(modelled_name, "mjcf"), placements(modelled_name, "urdf"), strict=True):
        for name, joint in mjcf.joints.items():
            other = urdf.joints[name]
            assert joint.kind == other.kind
            np.testing.assert_allclose(joint.moved, other.moved, atol=1e-9)
            if joint.kind in ("hinge", "slide"):
                np.testing.assert_allclose(joint.anchor, other.anchor, atol=1e-9)
                np.testing.assert_allclose(joint.axis, other.axis, atol=1e-9)
        heavy = [np.array(sorted((b.mass, *np.round(b.centre, 9)) for b in p.bodies if b.mass > 1e-9)) for p in (mjcf, urdf)]
        np.testing.assert_allclose(heavy[0], heavy[1], atol=1e-8)
        assert len(mjcf.springs) == len(urdf.springs)


@pytest.mark.parametrize("model_format", MODEL_SUFFIXES)
def test_every_mechanism_can_be_drawn_on_its_sheet(modelled_name: str, model_format: str) -> None:
    resting, moved = placements(modelled_name, model_format)
    view = choose_view([resting, moved])
    assert view.name == VIEWS.get(modelled_name, view.name)
    for svg in (draw(resting, [moved], view, 9.81), draw(moved, [resting], view, 0.0, ghost=resting)):
        root = ElementTree.fromstring(svg)
        assert "nan" not in svg and "inf" not in svg
        width, height = (float(number) for number in root.attrib["viewBox"].split()[2:])
        for circle in root.iter("{http://www.w3.org/2000/svg}circle"):
            assert 0 <= float(circle.attrib["cx"]) <= width
            assert 0 <= float(circle.attrib["cy"]) <= height


def test_a_urdf_on_one_line_has_a_row_per_joint_and_none_per_transmission() -> None:
    inertial = '<inertial><mass value="2"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>'
    text = (
        f'<robot name="r" xmlns:drake="d"><link name="world"/><link name="bar">{inertial}</link>'
        '<transmission name="gear"><type>SimpleTransmission</type><joint name="pin"/>'
        '<actuator name="motor"><drake:rotor_inertia value="0.01"/></actuator></transmission>'
        '<joint name="pin" type="revolute"><parent link="world"/><child link="bar"/><axis xyz="0 1 0"/>'
        '<limit effort="1" velocity="1"/></joint></robot>'
    )
    (row,) = joint_rows(parse_model(Path("r.urdf"), text, "urdf"))
    assert (row.joint, row.kind, row.axis, row.armature) == ("pin", "revolute", "0 1 0", "0.01")


def test_frames_around_a_body_are_shown_with_its_pose() -> None:
    library = Library.built_in()
    _, hip = joint_rows(read_model(library.model_path("acrobot.frames", "mjcf"), "mjcf"))
    assert hip.origin == (
        "quat 2 0 0 -1, body in frame 0 -0.3 0.4, xyaxes 0.6 0.8 0 -0.8 0.6 0, body in frame 0.6 0 0.3, axisangle 1 1 1 2.0943951023931953"
    )


def test_a_joint_that_mimics_another_is_none_that_moves() -> None:
    (pin,) = joint_rows(read_model(Library.built_in().model_path("simple_pendulum.mimic", "urdf"), "urdf"))
    assert pin.joint == "pin"
