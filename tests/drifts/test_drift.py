"""Drift of two sides: what a user reads, sampled orders, versions that compile otherwise, rounding, and what is refused."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drifting import ARM, CART, HOPPER, SCALED, planted
from support import InThisProcess, harness

import harness as api
from harness.comparison.shares import exchanges, leads_through, sampled_orders
from harness.drifts import plan as plans
from harness.drifts.plan import DriftSettings, HeldSides, MovingSide, plan_of, sides_of
from harness.drifts.study import DriftStudy, PreparedDrift, drift_here, moved, prepare
from harness.engines.moving import NumberKey
from harness.errors import InvalidRequest
from harness.results.cause import DriftCause
from harness.results.drift import ENGINE, DriftRecord
from harness.show.drift import draw_drift
from harness.study import run_study


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "a.xml").write_text(CART)
    (tmp_path / "b.xml").write_text(planted("cart", [DriftCause.GEAR], [DriftCause.DAMPING]))
    return tmp_path


def sides(folder: Path, first: str = "a.xml", second: str = "b.xml") -> tuple[MovingSide, MovingSide]:
    return MovingSide(folder / first), MovingSide(folder / second)


def test_a_user_reads_the_cause_first(folder: Path) -> None:
    done = harness("drift", "a.xml", "b.xml", "--seconds", "0.1", "--json", "found.json", "--picture", "gap.svg", cwd=folder)
    assert done.returncode == 0, done.stderr
    first = done.stdout.splitlines()[0]
    assert first.startswith("b.xml has another gear than a.xml: 100 % of the gap over 0.1 s (b.xml line 19: gear ")
    assert first.endswith('Set gear="1.5" (line 19), gear="1.2" (line 20) in b.xml.')
    document = json.loads((folder / "found.json").read_text())
    assert document["summary"] == first
    [found] = document["drifts"]
    assert {share["name"] for share in found["shares"]} == {DriftCause.GEAR, DriftCause.DAMPING, ENGINE}
    assert (folder / "gap.svg").read_text().startswith("<svg")


def test_what_bears_on_nothing_is_no_cause(tmp_path: Path) -> None:
    """The reference of springs that a joint does not have, and ranges that limit nothing."""
    text = """<mujoco><worldbody><body name="box" pos="0 0 {height}"><freejoint/><geom type="box" size=".1 .1 .1"/><body name="arm">
      <joint name="hinge" {joint}/><geom type="capsule" size=".02" fromto="0 0 0 .3 0 0"/></body></body></worldbody></mujoco>"""
    (tmp_path / "a.xml").write_text(text.format(height=1.0, joint='limited="false" range="-1 1"'))
    (tmp_path / "b.xml").write_text(text.format(height=1.5, joint='limited="false" range="-2 2" frictionloss="0" solreffriction="0.1 1"'))
    assert prepare(DriftSettings(sides(tmp_path), 0.02), here=True).plan.causes == (DriftCause.TREE,)
    (tmp_path / "b.xml").write_text(text.format(height=1.5, joint='limited="true" range="-2 2" stiffness="1" springref="0.3"'))
    found = prepare(DriftSettings(sides(tmp_path), 0.02), here=True).plan.causes
    assert set(found) == {DriftCause.TREE, DriftCause.SPRINGS, DriftCause.LIMITS}


def test_the_study_finds_what_is_found_here(folder: Path) -> None:
    settings = DriftSettings(sides(folder), 0.1)
    study = DriftStudy(settings)
    list(run_study(study, InThisProcess(1)))
    assert study.problems == []
    [found] = study.result().drifts
    assert found == drift_here(settings)


def test_a_function_controls_in_python(folder: Path) -> None:
    found = api.drift(folder / "a.xml", folder / "b.xml", control=lambda t, q, v: {"drive": -q[0]}, seconds=0.08)
    assert found.ranked[0].name == DriftCause.GEAR
    assert "another gear" in repr(found)
    assert found.plot().svg.startswith("<svg")
    alike = api.drift(folder / "a.xml", by=("mujoco", "mujoco/rk4@0.004"), control=lambda t, q, v: [t, -v[1]], seconds=0.08)
    assert alike.sentence == "A and B move alike to the last digit for 0.08 s."


def test_a_function_controls_no_engine_elsewhere(folder: Path) -> None:
    with pytest.raises(InvalidRequest, match=r"for engines beside the harness, and mujoco@3\.13\.0 is not; give a table instead"):
        api.drift(folder / "a.xml", by=("mujoco", "mujoco@3.13.0"), control=lambda t, q, v: {}, seconds=0.08)


@pytest.mark.ci
def test_sampled_orders_are_near_the_exact_shares(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (folder / "b.xml").write_text(planted("cart", [DriftCause.GEAR, DriftCause.DAMPING, DriftCause.FRICTION, DriftCause.ARMATURE]))
    settings = DriftSettings(sides(folder), 0.1)
    exact = {share.name: share for share in drift_here(settings).shares}
    monkeypatch.setattr(plans, "MOST_EXACT", 3)
    found = drift_here(settings)
    assert found.orders == 2 * plans.PAIRS_OF_ORDERS
    assert sum(share.whole or 0.0 for share in found.shares) == pytest.approx(1.0, abs=1e-10)
    for share in found.shares:
        assert abs((share.whole or 0.0) - (exact[share.name].whole or 0.0)) <= 5 * share.whole_error + 1e-12
    assert any(share.whole_error for share in found.shares)


def test_shapley_values_of_a_known_game() -> None:
    """Two gloves on the left and one on the right: 1/6, 1/6 and 2/3 (Shapley's example)."""
    values = {chosen: float(chosen & 4 and chosen & 3 != 0) for chosen in range(8)}
    assert [sum(weight * change for weight, change in exchanges(values, place, 3)) for place in range(3)] == pytest.approx(
        [1 / 6, 1 / 6, 2 / 3]
    )
    # Without the subset {0} the orders that begin with it are left out: of six, four.
    del values[1]
    left = [sum(weight * change for weight, change in exchanges(values, place, 3)) for place in range(3)]
    assert left == pytest.approx([0.25, 0.25, 0.5]) and leads_through(values, 3)
    assert not leads_through({0, 1, 7}, 3) and not leads_through({0, 1, 3}, 3)
    orders = sampled_orders(4, 3, 0)
    assert all(one[::-1] == other for one, other in zip(orders[::2], orders[1::2], strict=True))
    assert all(sorted(order) == [0, 1, 2, 3] for order in orders)


def otherwise(held: HeldSides, cause: DriftCause, key: NumberKey, factor: float) -> HeldSides:
    """The same where the second side's version compiles a number otherwise."""
    changed = {**held.second[cause], key: held.second[cause][key] * factor}
    return replace(held, second=replace(held.second, by_cause={**held.second.by_cause, cause: changed}))


def test_a_version_that_compiles_a_gain_otherwise(tmp_path: Path) -> None:
    """As MuJoCo did before 3.15 with ``dampratio``: one file, of which the second engine makes another number."""
    path = tmp_path / "a.xml"
    path.write_text(HOPPER.replace('kp="20" kv="0.6"', 'kp="20" dampratio="0.7"'))
    settings = DriftSettings((MovingSide(path), replace(MovingSide(path), engine="other")), 0.2)
    beside = replace(settings, sides=(MovingSide(path), MovingSide(path)))
    held = otherwise(prepare(beside).held, DriftCause.DERIVATIVE_GAIN, ("actuator_biasprm:2", "knee_drive"), 1.4)
    made = PreparedDrift(settings, held, plan_of(settings, held), ("4", "3"))
    assert made.plan.causes == (DriftCause.DERIVATIVE_GAIN,)
    # The other version moves its own file as this one does with its number.
    [every] = [motion for chosen, motion in made.plan.motions.items() if chosen]
    assert set(every.over) == {("actuator_biasprm:2", "knee_drive")}
    answers = [
        moved(
            "mujoco",
            replace(request, motions=[replace(one, over=every.over) for one in request.motions] if engine == "other" else request.motions),
        )
        for engine, request in made.requests(64)
    ]
    found = made.drift(answers)
    assert found.ranked[0].name == DriftCause.DERIVATIVE_GAIN and found.ranked[0].whole == pytest.approx(1.0, abs=1e-12)
    [difference] = found.ranked[0].differences
    assert difference.what == "dampratio" and difference.first_place == difference.second_place == "line 22"
    first, second = (text.partition("0.7, compiled as ")[2] for text in (difference.first, difference.second))
    assert float(second) == pytest.approx(1.4 * float(first))


# Its servo is unstable at this step where no range of forces holds it.
WRIST = """<mujoco><option timestep="0.002"/><worldbody><body>
<joint name="wrist" axis="0 1 0"/><inertial pos="0 0 -0.1" mass="0.2" diaginertia="0.0005 0.0005 0.0005"/>
</body></worldbody>
<actuator><position name="servo" joint="wrist" kp="20" kv="5.13" forcerange="-3.5 3.5"/></actuator>
<keyframe><key qpos="0.3" ctrl="0.9"/></keyframe></mujoco>"""


@pytest.mark.ci
@pytest.mark.parametrize("most_exact", [10, 1])
def test_motions_between_both_sides_that_break_down_decide_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, most_exact: int
) -> None:
    """A target engine without derivative gain and with a wide range of forces: with the range alone, the first side is unstable."""
    monkeypatch.setattr(plans, "MOST_EXACT", most_exact)
    (tmp_path / "a.xml").write_text(WRIST)
    (tmp_path / "b.xml").write_text(WRIST.replace('kv="5.13" forcerange="-3.5 3.5"', 'kv="0" forcerange="-1e6 1e6"'))
    found = drift_here(DriftSettings(sides(tmp_path), 0.4))
    assert found.left_out == 1 and found.times[-1] == pytest.approx(0.4)
    shares = {share.name: share.whole or 0.0 for share in found.shares}
    assert sum(shares.values()) == pytest.approx(1.0, abs=1e-10)
    assert all(-0.5 < share < 1.5 for share in shares.values()), shares
    monkeypatch.setattr("harness.drifts.shares._BREAKS_DOWN", np.inf)
    unsound = drift_here(DriftSettings(sides(tmp_path), 0.4))
    assert unsound.times[-1] < 0.4 or max(abs(share.whole or 0.0) for share in unsound.shares) > 10


DOUBLE = """<mujoco><option timestep="0.01" integrator="RK4"/><worldbody>
<body><joint name="one" axis="0 1 0"/><inertial pos="0 0 -0.5" mass="1" diaginertia="0.01 0.01 0.01"/>
<body pos="0 0 -1"><joint name="two" axis="0 1 0" armature="1e-3"/><inertial pos="0 0 -0.5" mass="1" diaginertia="0.01 0.01 0.01"/></body>
</body></worldbody><keyframe><key qpos="2.5 -1"/></keyframe></mujoco>"""


def test_no_share_is_claimed_where_rounding_is_as_large(tmp_path: Path) -> None:
    (tmp_path / "a.xml").write_text(DOUBLE)
    (tmp_path / "b.xml").write_text(DOUBLE.replace('armature="1e-3"', 'armature="1.000000000001e-3"'))
    found = drift_here(DriftSettings(sides(tmp_path), 0.5))
    assert all(share.whole is None and not any(share.positions) for share in found.shares)
    assert "no share is claimed" in found.sentence
    assert found.horizon is not None
    drawn = draw_drift(found).svg
    (at, width), axis = (
        re.findall(r'<rect x="([\d.]+)" y="[\d.]+" width="([\d.]+)"', drawn)[0],
        re.findall(r'd="M([\d.]+) [\d.]+H([\d.]+)"', drawn),
    )
    left, right = map(float, axis[0])
    # Grey from the horizon to the end.
    assert float(at) == pytest.approx(left + found.horizon / found.times[-1] * (right - left), abs=0.1)
    assert float(at) + float(width) == pytest.approx(right, abs=0.2) and ">grey: rounding alone<" in drawn
    assert "rounding alone" not in draw_drift(replace(found, horizon=None)).svg
    assert repr(draw_drift(found)) == f"<{draw_drift(found).title}; a notebook shows it, and save(path) writes it to an SVG file>"
    assert draw_drift(found)._repr_svg_() == drawn
    far = drift_here(DriftSettings(sides(tmp_path, "a.xml", "a.xml"), 0.1))
    assert not any(far.of_positions) and any(far.rounding)


@pytest.mark.ci
def test_chaos_reaches_a_gap_that_is_felt_at_first(tmp_path: Path) -> None:
    (tmp_path / "a.xml").write_text(DOUBLE)
    (tmp_path / "b.xml").write_text(DOUBLE.replace('armature="1e-3"', 'armature="1.001e-3"'))
    found = drift_here(DriftSettings(sides(tmp_path), 20.0))
    assert found.ranked[0].name == DriftCause.ARMATURE
    assert found.horizon is not None and found.horizon > 2.0
    for share in found.shares:
        assert all((part is None) == (time >= found.horizon) for time, part in zip(found.times, share.positions, strict=True))
    assert found.sentence.endswith(f"From {found.horizon:g} s on rounding alone would make 1 % of the gap; no share is claimed there.")


REFUSED = {
    "other joints": (("b.xml", CART.replace('"pin"', '"hinge"')), {}, "a.xml alone moves joint 'pin'"),
    "other kinds": (("b.xml", CART.replace('name="pin"', 'name="pin" type="slide"')), {}, "joint 'pin' is of another kind in b.xml"),
    "no such start": (("b.xml", CART), {"start": {"wrist": ([0.0], [0.0])}}, "the start has joint 'wrist'"),
    "no pair": (("b.xml", CART), {"start": {"pin": 1.0}}, "the start of joint 'pin' is 1.0; expected 1 positions and 1 velocities"),
    "no numbers": (("b.xml", CART), {"start": {"pin": ("up", 0.0)}}, "the start of joint 'pin' is .*; expected 1 positions"),
    "no length": (("b.xml", CART.replace("0.004", "0.003")), {"seconds": 0.005}, "do not end together within 0.005 s; expected 0.012 s"),
    "no time": (("b.xml", CART), {"seconds": 0.0}, "a motion of 0 s; expected more than 0 s, and an end"),
    "no end": (("b.xml", CART), {"seconds": math.inf}, "a motion of inf s; expected more than 0 s, and an end"),
    "no model": (("b.xml", CART.replace("mass=", "weight=")), {}, "mujoco does not move .*b.xml: .*weight"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_sides_that_cannot_be_held_against_each_other(folder: Path, name: str) -> None:
    (file, text), further, said = REFUSED[name]
    (folder / file).write_text(text)
    with pytest.raises(InvalidRequest, match=said):
        drift_here(DriftSettings(**{"sides": sides(folder), "seconds": 0.1, **further}))  # type: ignore[arg-type]


PENDULUM = """<mujoco><compiler angle="radian"/><option timestep="0.002" integrator="implicit"/><worldbody>
<body name="upper"><joint name="one" axis="0 1 0" frictionloss="0.2" damping="0.1"/>
<inertial pos="0 0 -0.5" mass="1" diaginertia="0.01 0.01 0.01"/>
<body name="lower" pos="0 0 -1"><joint name="two" axis="0 1 0" range="-0.5 0.5"/>
<inertial pos="0 0 -0.5" mass="1" diaginertia="0.01 0.01 0.01"/></body>
</body></worldbody><actuator><position joint="two" kp="5" kv="1"/></actuator><keyframe><key qpos="0.3 0.4" ctrl="1"/></keyframe></mujoco>"""


@pytest.mark.parametrize("rule", ["", pytest.param("/RK4@0.001", marks=pytest.mark.ci)])
def test_what_another_engine_does_not_apply_is_all_of_the_gap(tmp_path: Path, rule: str) -> None:
    """Pinocchio's own steps are MuJoCo's by the same rule without what Pinocchio leaves out, but for rounding."""
    (tmp_path / "a.xml").write_text(PENDULUM)
    one = MovingSide(tmp_path / "a.xml")
    found = drift_here(DriftSettings((one, one.by(f"pinocchio{rule}")), 0.2))
    shares = {share.name: share for share in found.shares}
    applied = {DriftCause.FRICTION, DriftCause.LIMITS, DriftCause.GAIN, DriftCause.DAMPING, DriftCause.INTEGRATOR, ENGINE}
    assert shares.keys() - {DriftCause.STEP} == applied
    assert abs(shares[ENGINE].whole or 0.0) < 1e-10 < abs(shares[DriftCause.FRICTION].whole or 0.0)
    assert found.sentence.startswith("pinocchio has no actuators: ")


def test_an_engine_that_exchanges_no_numbers_is_the_second(folder: Path) -> None:
    with pytest.raises(InvalidRequest, match="pinocchio moves no first side"):
        drift_here(DriftSettings((MovingSide(folder / "a.xml", "pinocchio"), MovingSide(folder / "b.xml")), 0.1))


@pytest.mark.parametrize("text", ["mujoco/RK4@fast", "mujoco/RK4@-1", "/RK4", "a/b/c"])
def test_a_side_that_is_no_engine_is_refused(folder: Path, text: str) -> None:
    with pytest.raises(InvalidRequest, match="expected ENGINE"):
        MovingSide(folder / "a.xml").by(text)


@pytest.mark.parametrize(("delay", "decimation"), [(-0.1, 1), (math.inf, 1), (0.1, 0), (0.1, 1.5)])
def test_a_timing_that_no_control_has_is_refused(folder: Path, delay: float, decimation: float) -> None:
    said = f"a delay of {delay:g} s and a decimation of {decimation:g}: expected 0 s or more, and a whole number of steps from 1 on"
    with pytest.raises(InvalidRequest, match=said):
        MovingSide(folder / "a.xml", delay=delay, decimation=decimation)  # type: ignore[arg-type]


@pytest.mark.parametrize("given", [{"by": ()}, {"by": ("mujoco",) * 3}, {"delay": (0.1,)}, {"decimation": (1, 2, 3)}])
def test_a_drift_has_two_sides(folder: Path, given: dict[str, Any]) -> None:
    with pytest.raises(InvalidRequest, match="expected one or two who move them, and two delays and decimations"):
        sides_of((folder / "a.xml", None), **{"by": ("mujoco",), **given})
    one, other = sides_of((folder / "a.xml", None), ("mujoco", "mujoco/RK4"), (0.0, 0.1), (1, 2))
    assert (one.path, one.integrator, one.delay, one.decimation) == (folder / "a.xml", "", 0.0, 1)
    assert (other.path, other.integrator, other.delay, other.decimation) == (folder / "a.xml", "RK4", 0.1, 2)


def test_a_body_of_one_file_alone_comes_with_its_tree(folder: Path) -> None:
    gripper = '<body name="gripper" pos="0 0 -0.2"><inertial pos="0 0 0" mass="0.2" diaginertia="1e-4 1e-4 1e-4"/></body>'
    text = CART.replace('<inertial pos="0.02 0 -0.1"', f'{gripper}<inertial pos="0.02 0 -0.1"')
    text = text.replace('damping="0.05"', 'damping="0.06"')
    (folder / "b.xml").write_text(text)
    found: DriftRecord = drift_here(DriftSettings(sides(folder), 0.2))
    assert [share.name for share in found.ranked[:2]] == [DriftCause.TREE, DriftCause.DAMPING]
    assert any(one.what == "body gripper" for one in found.ranked[0].differences)
    left = next(share for share in found.shares if share.name == ENGINE)
    assert left.positions == [0.0] * len(found.times)


def test_times_are_steps_of_both_sides(folder: Path) -> None:
    one, other = sides(folder)
    found = drift_here(DriftSettings((one, other.by("mujoco/@0.003")), 0.1))
    assert all(abs(time / 0.012 - round(time / 0.012)) < 1e-12 for time in found.times)
    assert np.all(np.diff(found.times) > 0) and found.times[-1] == pytest.approx(0.096)


def test_every_cause_of_the_robots_can_be_planted() -> None:
    assert {DriftCause.GAIN, DriftCause.GEAR, DriftCause.CONTACT_LAW, DriftCause.STEP} <= SCALED.keys()


def test_a_gap_that_begins_late_is_divided_all_the_same(folder: Path) -> None:
    """Servos that saturate at first do not feel their gains: until then the gap is rounding."""
    (folder / "a.xml").write_text(ARM)
    (folder / "b.xml").write_text(ARM.replace('kv="5.13"', 'kv="5"'))
    found = drift_here(DriftSettings(sides(folder), 0.4))
    shares = next(share for share in found.shares if share.name == DriftCause.DERIVATIVE_GAIN)
    assert shares.positions[0] is None and shares.positions[-1] == pytest.approx(1.0)
    assert found.horizon is None and shares.whole == pytest.approx(1.0)


def test_a_file_in_which_nothing_moves_is_refused(folder: Path) -> None:
    (folder / "a.xml").write_text("<mujoco><worldbody><body><geom size='1'/></body></worldbody></mujoco>")
    with pytest.raises(InvalidRequest, match=r"a\.xml has no joint that moves"):
        drift_here(DriftSettings(sides(folder, "a.xml", "a.xml"), 0.1))


@pytest.mark.ci
def test_a_side_that_breaks_down_is_told(tmp_path: Path) -> None:
    """The servo is unstable at this step, at once or later; its state is finite for a while."""
    (tmp_path / "a.xml").write_text(WRIST)
    (tmp_path / "b.xml").write_text(WRIST.replace(' forcerange="-3.5 3.5"', ""))
    found = drift_here(DriftSettings(sides(tmp_path), 0.4))
    assert found.first.broken is None and found.second.broken is not None and found.second.broken < 0.4
    assert found.times[-1] < found.second.broken
    assert found.sentence.endswith(f" b.xml breaks down by {found.second.broken:g} s.")
    late = drift_here(DriftSettings(sides(tmp_path), 40.0))
    assert late.times == [] and late.second.broken == pytest.approx(0.8)
    assert late.sentence == "b.xml breaks down by 0.8 s. No share is claimed: give fewer --seconds, or shorter steps."
    alike = drift_here(DriftSettings(sides(tmp_path, "b.xml", "b.xml"), 0.4))
    assert alike.sentence.endswith(f"A breaks down by {found.second.broken:g} s. B breaks down by {found.second.broken:g} s.")
    done = harness("drift", "a.xml", "b.xml", "--seconds", "40", "--picture", "gap.svg", cwd=tmp_path)
    assert done.returncode == 0 and done.stdout.splitlines()[0] == late.sentence, done.stderr


def test_a_motion_that_feels_nothing_of_what_differs_says_so(tmp_path: Path) -> None:
    text = """<mujoco><worldbody><body><joint name="pin" axis="0 1 0"/><geom size="0.1" pos="0 0 -0.5"/></body></worldbody>
      <actuator><motor joint="pin" gear="{gear}"/></actuator><keyframe><key qpos="{start}"/></keyframe></mujoco>"""
    for start, said in (
        ("0", "Nothing moves in a.xml and b.xml for 0.1 s; give a --control, or another --start."),
        ("1", "a.xml and b.xml move alike to the last digit for 0.1 s; they differ in gear, which this motion does not feel."),
    ):
        for name, gear in (("a.xml", 1), ("b.xml", 2)):
            (tmp_path / name).write_text(text.format(gear=gear, start=start))
        assert drift_here(DriftSettings(sides(tmp_path), 0.1)).sentence == said


MESHED = """<robot name="arm"><link name="base"/><link name="rod">
<inertial><origin xyz="0 0 -0.2"/><mass value="1"/><inertia ixx="0.01" iyy="0.01" izz="0.002" ixy="0" ixz="0" iyz="0"/></inertial>
<collision><geometry><mesh filename="package://arm/meshes/rod.stl"/></geometry></collision></link>
<joint name="pin" type="continuous"><parent link="base"/><child link="rod"/><axis xyz="0 1 0"/><dynamics damping="{damping}"/></joint>
</robot>"""


def test_meshes_that_are_not_found_are_left_out_and_told(tmp_path: Path) -> None:
    for name, damping in (("a.urdf", 0.1), ("b.urdf", 0.3)):
        (tmp_path / name).write_text(MESHED.format(damping=damping))
    found = drift_here(DriftSettings(sides(tmp_path, "a.urdf", "b.urdf"), 0.1, start={"pin": ([1.0], [0.0])}))
    assert found.ranked[0].name == DriftCause.DAMPING and 'Set dynamics damping="0.1" in b.urdf.' in found.sentence
    assert all("rod.stl" in side.title and side.title.endswith("their contacts are left out") for side in (found.first, found.second))


def test_a_table_is_no_first_side_and_there_is_no_third(tmp_path: Path) -> None:
    (tmp_path / "a.xml").write_text(CART)
    (tmp_path / "log.csv").write_text("time,pin\n0,0\n")
    done = harness("drift", "log.csv", "a.xml", cwd=tmp_path)
    assert done.returncode == 2 and "log.csv is a table; give the model first" in done.stderr
    done = harness("drift", "a.xml", *["--by", "mujoco"] * 3, cwd=tmp_path)
    assert done.returncode == 2 and "--by is given once for both sides, or twice" in done.stderr
