"""The numbers that readers of optional engines make of inertias, as the engines themselves had them."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from comparison.robots import FILES, edited
from hypothesis import given
from hypothesis import strategies as st

from harness.explain import as_read
from harness.explain.as_read import fold
from harness.explain.changes.departures import departures_of
from harness.explain.changes.readings import Reading, find_readings
from harness.explain.changes.readings.pybullet import diagonalized, half_extents
from harness.files.tree import Inertia, Tree
from harness.library import Stance
from harness.trees.robot import read_robot

NUMBERS = st.floats(-1.0, 1.0, allow_subnormal=False)
IMPOSSIBLE = FILES / "impossible.urdf"
OLD_INERTIA = '<inertia ixx="0.0625" ixy="0" ixz="0" iyy="0.25" iyz="0" izz="0.0625"/>'

NEWTON = """<mujoco model="arm"><worldbody>
<body name="arm">{joints}<inertial pos="0.3 0 0" mass="{mass}" diaginertia="{inertia}"/></body>
</worldbody></mujoco>"""
NO_GRAVITY = '<option gravity="0 0 -1.62"><flag gravity="disable"/></option>'


def reading(engine: str, name: str, model_format: str = "urdf") -> Reading:
    return next(one for one in find_readings(engine, model_format) if one.name == name)


def read_by(engine: str, name: str, path: Path) -> Tree:
    return reading(engine, name, "mjcf" if path.suffix == ".xml" else "urdf").read(read_robot(path)).tree


def inertia_of(tree: Tree, body: str) -> Inertia:
    (found,) = (one.inertia for one in tree.bodies if one.name == body)
    assert found is not None
    return found


@given(*[NUMBERS] * 6)
def test_bullet_s_axes_leave_a_millionth_of_a_matrix(xx: float, yy: float, zz: float, xy: float, xz: float, yz: float) -> None:
    matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    moments, axes, rest = diagonalized(matrix)
    np.testing.assert_allclose(axes @ (np.diag(moments) + rest) @ axes.T, matrix, atol=1e-14)
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-14)
    assert not np.diag(rest).any() and np.abs(rest).max() <= 1.0001e-6 * np.abs(moments).sum()


@pytest.mark.parametrize(("product", "is_left"), [(2.0**-52, True), (1.001 * 2.0**-52, False), (1.0, False), (0.0, True)])
def test_bullet_leaves_what_is_a_rounding_of_a_millionth_of_the_trace(product: float, is_left: bool) -> None:
    """``btMatrix3x3::diagonalize``: a product of at most 2^-52 of that is no longer turned away."""
    matrix = np.diag([0.5, 1.5, 1.0])
    matrix[0, 1] = matrix[1, 0] = product * 1e-6 * np.trace(matrix)
    _, axes, rest = diagonalized(matrix)
    assert (axes == np.eye(3)).all() == is_left == (rest[0, 1] == matrix[0, 1])


@pytest.mark.parametrize(
    ("origin", "shape", "half"),
    [
        ("", "", (0.001, 0.001, 0.001)),
        ('<origin xyz="0 0 0" rpy="0.3 0 0"/>', '<box size="0.2 0.4 0.6"/>', (0.101, 0.2807233598235231, 0.34670498806994965)),
        ('<origin xyz="0 0 -0.5"/>', '<box size="0.2 0.4 0.6"/>', (0.1, 0.2, 0.3)),
        ('<origin rpy="0.3 0 0"/>', '<cylinder radius="0.3" length="1"/>', (0.303, 0.4378627634599255, 0.5698260199527787)),
        ('<origin rpy="0.3 0 0"/>', '<capsule radius="0.3" length="1"/>', (0.301, 0.5240171120667534, 0.8539252532988867)),
        ('<origin rpy="0.3 0 0"/>', '<sphere radius="0.3"/>', (0.301, 0.301, 0.301)),
    ],
)
def test_bullet_s_boxes_are_those_of_pybullet(origin: str, shape: str, half: tuple[float, ...], tmp_path: Path) -> None:
    """Half extents from what ``getDynamicsInfo`` of PyBullet 3.2.7 gives."""
    collision = f"<collision>{origin}<geometry>{shape}</geometry></collision>" if shape else ""
    path = edited(IMPOSSIBLE, tmp_path, ("</inertial>", f"</inertial>{collision}"))
    np.testing.assert_allclose(half_extents(read_robot(path).tree.bodies[1]), half, rtol=1e-14)


def test_the_three_moments_of_a_box_are_numbers_of_their_own(tmp_path: Path) -> None:
    collision = '<collision><origin xyz="0 0 -0.5"/><geometry><box size="0.2 0.4 0.6"/></geometry></collision>'
    path = edited(IMPOSSIBLE, tmp_path, ("</inertial>", f"</inertial>{collision}"))
    moments = inertia_of(read_by("pybullet", "inertia of collision shapes", path), "rod").moments
    np.testing.assert_allclose([float(one) for one in moments], [0.52 / 12, 0.4 / 12, 0.2 / 12, 0, 0, 0], rtol=1e-14)
    assert len({one.index for one in moments[:3]}) == 3  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("mass", "inertia", "expected"),
    [
        # Moments as they stand, the sphere's of 1 kg, and what is within the rounding that Drake allows.
        ("1", '<inertia ixx="0.25" ixy="0" ixz="0" iyy="0.25" iyz="0" izz="0.5"/>', (1.0, 0.25)),
        ("1", OLD_INERTIA, (1.0, 0.00153933892624)),
        ("0", OLD_INERTIA, (1.0, 0.00153933892624)),
        ("0.5", '<inertia ixx="-3e-15" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/>', (0.5, -3e-15)),
        ("0.5", '<inertia ixx="-4e-15" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/>', (0.5, 0.00048486137902)),
    ],
)
def test_drake_has_a_sphere_for_an_inertia_that_no_body_can_have(
    mass: str, inertia: str, expected: tuple[float, float], tmp_path: Path
) -> None:
    """As ``default_spatial_inertia`` of Drake 1.51.1 gives it."""
    path = edited(IMPOSSIBLE, tmp_path, ('<mass value="1"/>', f'<mass value="{mass}"/>'), (OLD_INERTIA, inertia))
    found = inertia_of(read_by("drake", "impossible inertias", path), "rod")
    np.testing.assert_allclose((float(found.mass), float(found.moments[0])), expected, rtol=1e-8)


def test_drake_puts_joints_of_a_body_in_a_row(tmp_path: Path) -> None:
    path = tmp_path / "two.xml"
    path.write_text("""<mujoco model="two"><worldbody><body name="b" pos="0 0 1"><joint name="j" axis="0 1 0"/><joint name="k"/>
    <geom size="0.1" pos="0.1 0 0"/></body><body name="b 0"><joint name="l"/><geom size="0.1"/></body></worldbody></mujoco>""")
    bodies = {body.name: body for body in read_by("drake", "several joints of a body", path).bodies}
    assert [(name, body.parent, [joint.name for joint in body.joints], len(body.pose)) for name, body in bodies.items()] == [
        ("b 1", "world", ["j"], 0),
        ("b", "b 1", ["k"], 1),
        ("b 0", "world", ["l"], bodies["b 0"].pose and 1),
    ]


@pytest.mark.parametrize(("actuator", "kept"), [("", 0.0), ("general", 0.0), ("motor", 0.5), ("position", 0.5)])
def test_drake_keeps_the_rotor_of_a_joint_that_is_driven(actuator: str, kept: float, tmp_path: Path) -> None:
    path = tmp_path / "rotor.xml"
    driven = f'<actuator><{actuator} joint="j"/></actuator>' if actuator else ""
    path.write_text(f"""<mujoco model="rotor"><worldbody><body name="b"><joint name="j" armature="0.5"/><geom size="0.1" pos="0.1 0 0"/>
    </body></worldbody>{driven}</mujoco>""")
    (joint,) = read_by("drake", "rotor inertias", path).joints
    assert float(joint.armature) == kept


def test_idyntree_drops_inertias_of_frames_alone(tmp_path: Path) -> None:
    """A link without mass at the end of fixed joints, and not one that carries another."""
    tree = read_by("idyntree", "inertia without mass", FILES / "massless_foot.urdf")
    assert {body.name: body.inertia is None for body in tree.bodies} == {"ground": True, "leg": False, "foot": True}
    toe = '<link name="toe"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>'
    joint = '<joint name="ball" type="revolute"><parent link="foot"/><child link="toe"/><limit effort="1" velocity="1"/></joint>'
    path = edited(FILES / "massless_foot.urdf", tmp_path, ("</robot>", f"{toe}{joint}</robot>"))
    assert inertia_of(read_by("idyntree", "inertia without mass", path), "foot")


@pytest.mark.parametrize("engine", ["dartpy", "pybullet"])
def test_only_links_that_move_are_given_an_inertia(engine: str, tmp_path: Path) -> None:
    tool = '<link name="tip"/><joint name="weld" type="fixed"><parent link="tool"/><child link="tip"/></joint>'
    path = edited(FILES / "arm.urdf", tmp_path, ("</robot>", f"{tool}</robot>"))
    tree = read_by(engine, "links without inertia", path)
    assert inertia_of(tree, "tip").mass == 1 and tree.bodies[0].inertia is None


def test_dampers_of_dart_act_at_the_end_of_its_step() -> None:
    before = {joint.name: joint for joint in read_robot(FILES / "arm.urdf").tree.joints}
    after = read_by("dartpy", "implicit dampers", FILES / "arm.urdf").joints
    assert [float(joint.armature) for joint in after] == pytest.approx([0.001 * float(before[joint.name].damping) for joint in after])


def test_an_aided_pybullet_has_the_inertias_of_the_file(tmp_path: Path) -> None:
    """It is loaded with URDF_USE_INERTIA_FROM_FILE; a plain one has those of boxes."""
    robot, engine = read_robot(FILES / "arm.urdf"), SimpleNamespace(reader="")
    plain, aided = (as_read.read_by(robot, "pybullet", engine, stance).robot.tree for stance in (Stance.PLAIN, Stance.AIDED))
    assert inertia_of(aided, "tool") == inertia_of(robot.tree, "tool") != inertia_of(plain, "tool")


@pytest.mark.parametrize("engine", ["mujoco", "pinocchio"])
@pytest.mark.parametrize("model_format", ["mjcf", "urdf"])
def test_a_candidate_of_a_release_reads_and_departs_as_the_release(engine: str, model_format: str) -> None:
    candidate, release = (find_readings(f"{engine}@99.0{suffix}", model_format) for suffix in ("rc1", ""))
    assert [one.name for one in candidate] == [one.name for one in release] != []
    assert departures_of(f"{engine}@99.0rc1", "") == departures_of(f"{engine}@99.0", "")


def test_the_boxes_of_pybullet_leave_no_axes_to_turn() -> None:
    """Of the inertias of the file nothing is left, so that how it turns them is no reading of a plain one."""
    applied = [one.name for one, _ in fold(read_robot(FILES / "arm.urdf"), find_readings("pybullet", "urdf")).applied]
    assert applied == ["joint damping", "inertia of collision shapes"]


@pytest.mark.parametrize(
    ("inertia", "moments"),
    [
        # As Model.body_inertia of Newton 1.8.0 has them after finalize(); of an MJCF its importer refuses the third.
        ("1e-15 1e-15 1e-15", (1.0001e-6, 1.0001e-6, 1.0001e-6)),
        ("1e-8 0.06 0.06", (1.06e-6, 0.06000105, 0.06000105)),
        ("0.01 0.02 0.05", (0.030001, 0.040001, 0.070001)),
        ("0.01 0.06 0.06", (0.01, 0.06, 0.06)),
    ],
)
def test_newton_raises_moments(inertia: str, moments: tuple[float, ...], tmp_path: Path) -> None:
    path = tmp_path / "arm.xml"
    path.write_text(NEWTON.format(joints='<joint name="pin" axis="0 1 0"/>', mass=2, inertia=inertia))
    read = inertia_of(read_by("newton", "least inertias", path), "arm")
    np.testing.assert_allclose([float(one) for one in read.moments[:3]], moments, rtol=1e-6)


@pytest.mark.parametrize(("mass", "is_dropped"), [("0", True), ("1e-9", False)])
def test_newton_drops_inertia_without_mass(mass: str, is_dropped: bool, tmp_path: Path) -> None:
    path = tmp_path / "arm.xml"
    path.write_text(NEWTON.format(joints='<joint name="pin" axis="0 1 0"/>', mass=mass, inertia="0.01 0.06 0.06"))
    assert any(inertia_of(read_by("newton", "inertia without mass", path), "arm").moments) != is_dropped


def test_newton_takes_slides_before_hinges_in_the_place_of_the_first(tmp_path: Path) -> None:
    path = tmp_path / "arm.xml"
    joints = '<joint name="swing" pos="0 0 1"/><joint name="stretch" type="slide"/><joint name="twist" pos="0 2 0"/>'
    path.write_text(NEWTON.format(joints=joints, mass=2, inertia="0.01 0.06 0.06"))
    found = reading("newton", "several joints of a body", "mjcf")
    read = found.read(read_robot(path))
    (body,) = read.tree.bodies
    assert [joint.name for joint in body.joints] == ["stretch", "swing", "twist"]
    assert {tuple(map(float, joint.anchor)) for joint in body.joints} == {(0.0, 0.0, 1.0)}
    assert read.joints == ("stretch", "swing", "twist")


def test_joints_in_another_order_are_a_change_of_their_body(tmp_path: Path) -> None:
    path = tmp_path / "arm.xml"
    joints = '<joint name="swing"/><joint name="stretch" type="slide"/>'
    path.write_text(NEWTON.format(joints=joints, mass=2, inertia="0.01 0.06 0.06"))
    count, places = reading("newton", "several joints of a body", "mjcf").places(read_robot(path))
    assert count == 1 and [place.line for place in places] == [2]


@pytest.mark.parametrize(("option", "expected"), [("", -9.81), ('<option gravity="0 0 -1.62"/>', -9.81), (NO_GRAVITY, 0.0)])
def test_newton_reads_the_flag_of_gravity_alone(option: str, expected: float, tmp_path: Path) -> None:
    path = tmp_path / "arm.xml"
    text = NEWTON.format(joints='<joint name="pin" axis="0 1 0"/>', mass=2, inertia="0.01 0.06 0.06")
    path.write_text(text.replace("<worldbody>", f"{option}<worldbody>"))
    assert float(read_by("newton", "gravity", path).gravity[2]) == expected
