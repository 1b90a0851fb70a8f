"""Inverse weights of model files, against those of models that MuJoCo has compiled."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from harness.engines import load_engine
from harness.explain.changes.departures import only_slides
from harness.files.model_file import parse_model, read_model
from harness.files.rules import InverseWeight
from harness.library import Library
from harness.trees.inverse_weights import inverse_weights, inverse_weights_of
from harness.trees.robot import read_robot, tree_of

LIBRARY = replace(Library.built_in(), calls_engines_here=True)

WEIGHED = [
    "four_bar",
    "slider_crank",
    "arm_3r",
    "cart_pendulum",
    "coupled_oscillators",
    "free_body",
    "puma_560",
    "furuta_pendulum.full_inertia",
    "arm_3r.fusestatic",
]


@pytest.mark.parametrize("name", WEIGHED)
def test_inverse_weights_are_those_of_the_compiled_model(name: str) -> None:
    file = read_model(LIBRARY.model_path(name, "mjcf"), "mjcf")
    model = load_engine(LIBRARY, "mujoco").load(file, tuple(file.joint_lines), 9.81).model  # type: ignore[attr-defined]
    bodies, joints = (
        [model.body(number).name for number in range(1, model.nbody)],
        [model.joint(number).name for number in range(model.njnt)],
    )
    wanted = [InverseWeight(kind, body) for body in bodies for kind in ("translation", "rotation")]  # type: ignore[arg-type]
    found = inverse_weights(file, [*wanted, *(InverseWeight("joint", joint) for joint in joints)])
    # By the program a body that only slides weighs as its mass.
    tree = tree_of(file, 0.0)
    sliders = {
        name: body.name for body in tree.bodies if only_slides(tree, body) for name in (body.name, *(one.name for one in body.joints))
    }
    masses = inverse_weights(file, [InverseWeight("mass", body) for body in sliders.values()])
    for one, documented in found.items():
        departs = one.of in sliders and one.kind != "rotation"
        value = masses[InverseWeight("mass", sliders[one.of])] if departs else documented
        compiled = model.joint(one.of).id if one.kind == "joint" else model.body(one.of).invweight0[int(one.kind == "rotation")]
        if one.kind == "joint":
            compiled = model.dof_invweight0[model.jnt_dofadr[compiled]]
        assert value == pytest.approx(compiled, rel=_solve_error(model))


@pytest.mark.parametrize("name", ["arm_3r", "cart_pendulum", "puma_560"])
def test_inverse_weights_are_the_same_wherever_a_model_stands(name: str) -> None:
    path = LIBRARY.model_path(name, "mjcf")
    text = path.read_text(encoding="utf-8")
    moved = text.replace("<worldbody>", '<worldbody><frame pos="0.5 -1.25 2" euler="10 20 30">').replace(
        "</worldbody>", "</frame></worldbody>"
    )
    weights = []
    for file in (parse_model(path, text, "mjcf"), parse_model(path, moved, "mjcf")):
        bodies = [body.name for body in tree_of(file, 0.0).bodies]
        wanted = [InverseWeight(kind, body) for body in bodies for kind in ("translation", "rotation")]  # type: ignore[arg-type]
        weights.append([*inverse_weights(file, [*wanted, *(InverseWeight("joint", joint) for joint in file.joint_lines)]).values()])
    assert weights[1] == pytest.approx(weights[0], rel=1e-11)


# Bodies of one or several shapes, whose axes of inertia MuJoCo's compiler finds by diagonalising a sum.
SHAPES = {
    "one": '<geom type="box" size=".1 .2 .3"/>',
    "one beside": '<geom type="box" size=".1 .2 .3" pos="0 0 .1"/>',
    "in one place, rising": '<geom type="box" size=".1 .1 .2"/><geom type="box" size=".3 .2 .1"/>',
    "in one place, falling": '<geom type="sphere" size=".05"/><geom type="cylinder" size=".05 .05"/>',
    "on both sides, rising": '<geom size=".1" pos=".3 0 0"/><geom size=".1" pos="-.3 0 0"/>',
    "on both sides, falling": '<geom size=".1" pos="0 0 .3"/><geom size=".1" pos="0 0 -.3"/>',
    "on both sides, askew": '<geom size=".1" pos="0 .1 .3"/><geom size=".1" pos="0 -.1 -.3"/>',
    "on both sides, askew by a rounding": '<geom size=".1" pos="0 1e-16 .3"/><geom size=".1" pos="0 -1e-16 -.3"/>',
    "on both sides, askew and light": '<geom size=".1" pos="0 .1 .3" mass="1e-11"/><geom size=".1" pos="0 -.1 -.3" mass="1e-11"/>',
    "rising by less than it sorts": '<inertial pos="0 0 0" mass="1" fullinertia=".3 .3000000000001 .1 0 0 0"/>',
    "rising by more": '<inertial pos="0 0 0" mass="1" fullinertia=".3 .3000000000100 .1 0 0 0"/>',
    "on one side": '<geom size=".1" pos="0 0 .3"/><geom size=".1" pos="0 0 .2"/>',
    "beside one without mass": '<geom size=".1"/><geom size=".1" pos="0 0 .3" mass="0"/>',
}


@pytest.mark.parametrize("shapes", SHAPES.values(), ids=SHAPES)
def test_a_body_of_shapes_only_slides_where_the_compiler_says_so(tmp_path: Path, shapes: str) -> None:
    import mujoco

    text = f'<mujoco><worldbody><body name="sled"><joint type="slide" axis="1 0 0"/>{shapes}</body></worldbody></mujoco>'
    (path := tmp_path / "sled.xml").write_text(text)
    tree = read_robot(path).tree
    assert only_slides(tree, tree.bodies[-1]) == (mujoco.MjModel.from_xml_string(text).body("sled").simple == 2)


def test_a_body_without_mass_is_weighed_where_the_program_has_its_centre(tmp_path: Path) -> None:
    """With an inertial of no mass it is where the file puts it."""
    import mujoco

    for inertial, kind in (("", "position"), ('<inertial pos="0 0 0" mass="0" diaginertia="0 0 0"/>', "translation")):
        (path := tmp_path / "arm.xml").write_text(f"""<mujoco><worldbody><body><joint axis="0 1 0"/>
        <inertial pos=".3 0 0" mass="1" diaginertia="1 1 1"/>
        <body name="hand" pos="0 .1 .4" euler="20 0 0">{inertial}<geom size=".1" mass="0"/></body></body></worldbody></mujoco>""")
        [found] = inverse_weights_of(read_robot(path).tree, [InverseWeight(kind, "hand")], False).values()  # type: ignore[arg-type]
        assert found == pytest.approx(mujoco.MjModel.from_xml_path(str(path)).body("hand").invweight0[0], rel=1e-13)


FREE = """<mujoco>
  <worldbody>
    <site name="hook" pos="0 0 1"/>
    <body name="weight" pos=".3 0 .2" euler="0 0 30"><freejoint/><geom type="box" size=".1 .2 .1"/><site name="top" pos=".1 .1 .1"/></body>
    <body name="balloon" pos="-.2 .1 .2" euler="20 0 0"><freejoint/><geom size=".1 "/><site name="knot" pos="0 0 -.17"/></body>
  </worldbody>
  <tendon>
    <spatial range="0 .6"><site site="knot"/><site site="top"/></spatial>
    <spatial range="0 .6"><site site="hook"/><site site="top"/><site site="knot"/></spatial>
  </tendon>
</mujoco>"""


def test_tendons_between_free_bodies_are_weighed_where_the_file_puts_these(tmp_path: Path) -> None:
    import mujoco

    (path := tmp_path / "balloon.xml").write_text(FREE)
    tree, model = read_robot(path).tree, mujoco.MjModel.from_xml_string(FREE)
    tendons = [one.tendon for one in tree.tendons]
    found = inverse_weights_of(tree, [InverseWeight("tendon", one.name) for one in tendons], False, tendons)
    assert [*found.values()] == pytest.approx(model.tendon_invweight0, rel=1e-13)


def test_the_mean_of_a_body_that_slides_along_one_axis_is_a_third_of_what_the_program_has() -> None:
    file = read_model(LIBRARY.model_path("slider_crank", "mjcf"), "mjcf")
    model = load_engine(LIBRARY, "mujoco").load(file, tuple(file.joint_lines), 9.81).model  # type: ignore[attr-defined]
    [documented] = inverse_weights(file, [InverseWeight("translation", "slider")]).values()
    assert (documented, model.body("slider").invweight0[0]) == (pytest.approx(1 / 6), 0.5)


def _solve_error(model: Any) -> float:
    """What a solve with M may lose: its condition, unit roundoffs and its size."""
    import mujoco

    data, mass = mujoco.MjData(model), np.empty((model.nv, model.nv))
    mujoco.mj_forward(model, data)
    mujoco.mj_fullM(model, data, mass)
    scale = 1 / np.sqrt(np.diag(mass))
    return float(8 * model.nv * np.linalg.cond(mass * np.outer(scale, scale)) * 2.0**-53)


def test_a_tendon_has_the_inverse_weight_of_its_length() -> None:
    """One straight between two points, and one on a sum of joints."""
    path = LIBRARY.model_path("four_bar", "mjcf")
    tendons = (
        '<tendon><spatial name="cord"><site site="hook"/><site site="coupler_end"/></spatial>'
        '<fixed name="sum"><joint joint="crank" coef="2"/><joint joint="follower" coef="-0.5"/></fixed></tendon>'
        '<equality><tendon name="tie" tendon1="cord" tendon2="sum"/></equality>'
    )
    text = path.read_text(encoding="utf-8").replace("<worldbody>", '<worldbody><site name="hook" pos="0.5 0.25 1.5"/>')
    file = parse_model(path, text.replace("</worldbody>", f"</worldbody>{tendons}"), "mjcf")
    model = load_engine(LIBRARY, "mujoco").load(file, tuple(file.joint_lines), 9.81).model  # type: ignore[attr-defined]
    found = inverse_weights(file, [InverseWeight("tendon", "cord"), InverseWeight("tendon", "sum")])
    assert [*found.values()] == pytest.approx(model.tendon_invweight0.tolist(), rel=_solve_error(model))


def test_the_world_has_none_and_a_singular_zero_position_is_refused() -> None:
    four_bar, pendulum = (read_model(LIBRARY.model_path(name, "urdf"), "urdf") for name in ("four_bar", "spring_pendulum"))
    assert inverse_weights(four_bar, [InverseWeight("translation", "world")]) == {InverseWeight("translation", "world"): 0.0}
    with pytest.raises(ValueError, match="has no inverse in the zero position"):
        inverse_weights(pendulum, [InverseWeight("joint", "pin")])
