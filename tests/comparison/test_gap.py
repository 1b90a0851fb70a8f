"""What the gap between two motions is made of: shares that sum to it, and causes that are found where they were planted."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import flint
import numpy as np
import pytest
from catalogue import BUILT_IN
from support import InThisProcess, harness

from harness.comparison.gap_study import GapSettings, GapStudy, beside_the_harness
from harness.comparison.robot_library import engines_of_files
from harness.engines.moving import MovedBy
from harness.errors import InvalidRequest
from harness.files.rules import ImplicitPart, StepRule
from harness.results.gap import DYNAMICS, INTEGRATOR, STEP, Gap
from harness.study import run_study
from harness.trees.recursion import step_forces
from harness.trees.robot import read_robot
from harness.trees.steps import DeclaredMotion

BESIDE = ("first engine beside its rule", "second engine beside its rule")
ONE_PERCENT = 0.01
TWO_LINKS = """
<mujoco model="two links">
  <compiler angle="radian"/>
  <option gravity="0 0 -9.81" timestep="0.004"/>
  <worldbody>
    <body name="upper">
      <joint name="shoulder" type="hinge" axis="0 1 0" damping="0.2"/>
      <inertial pos="0 0 -0.25" mass="1" diaginertia="0.02 0.02 0.001"/>
      <body name="lower" pos="0 0 -0.5">
        <joint name="elbow" type="hinge" axis="0 1 0" damping="0.1"/>
        <inertial pos="0 0 -0.2" mass="0.7" diaginertia="0.01 0.01 0.0005"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""


@pytest.fixture
def two_links(tmp_path: Path) -> Path:
    path = tmp_path / "two_links.xml"
    path.write_text(TWO_LINKS)
    return path


@pytest.fixture
def heavier(tmp_path: Path) -> Path:
    path = tmp_path / "heavier.xml"
    path.write_text(TWO_LINKS.replace('mass="0.7"', 'mass="0.71"'))
    return path


def moved_by(text: str) -> MovedBy:
    return beside_the_harness(MovedBy.parsed(text))


def gap_of(first: Path, second: Path, *by: str, steps: int = 40, **further: Any) -> Gap:
    study = GapStudy(GapSettings((first, second), (moved_by(by[0]), moved_by(by[-1])), steps, **further))
    list(run_study(study, InThisProcess(1)))
    if study.problems:
        raise study.problems[0]
    (found,) = study.result().gaps
    return found


def shares(gap: Gap) -> dict[str, tuple[float, float]]:
    return {share.name: (share.positions, share.velocities) for share in gap.shares}


def follow_their_rules(gap: Gap) -> bool:
    beside = [share for share in gap.shares if share.name in BESIDE]
    return all(one.of_positions <= 1e-12 * gap.moved and one.of_velocities <= 1e-12 * gap.speed for one in beside)


def model(name: str) -> Path:
    return BUILT_IN.model_path(name, "mjcf")


# Files of the catalogue with a pair of movers each: chains, springs between points, rotations; and all five integrators.
PAIRS = {
    "collar": ("mujoco/Euler", "mujoco/discrete"),
    "coupled_oscillators": ("mujoco/implicit@0.01", "mujoco/discrete@0.005"),
    "free_body": ("mujoco/RK4", "mujoco/implicit"),
    "heavy_top": ("mujoco/implicitfast@0.001", "pinocchio/Euler@0.002"),
    "double_pendulum": ("mujoco/RK4", "pinocchio/RK4"),
    "torsional_pendulum": ("mujoco/Euler", "pinocchio/Euler@0.004"),
}


@pytest.mark.parametrize("name", PAIRS)
def test_shares_sum_to_the_gap(name: str) -> None:
    gap = gap_of(model(name), model(name), *PAIRS[name])
    assert gap.of_positions > 0 and gap.of_velocities > 0
    for part in zip(*shares(gap).values(), strict=True):
        assert sum(part) == pytest.approx(1.0, abs=ONE_PERCENT / 1e4)
    # What is computed with an engine's accelerations follows its rule too, but for rounding.
    assert follow_their_rules(gap)


def test_each_cause_alone_has_all_of_the_gap(two_links: Path, heavier: Path) -> None:
    alone = {
        DYNAMICS: gap_of(two_links, heavier, "mujoco/implicit"),
        INTEGRATOR: gap_of(two_links, two_links, "mujoco/implicit", "mujoco/Euler"),
        STEP: gap_of(two_links, two_links, "mujoco/implicit", "mujoco/implicit@0.001"),
    }
    for cause, gap in alone.items():
        for name, part in shares(gap).items():
            assert part == pytest.approx((1.0, 1.0) if name == cause else (0.0, 0.0), abs=1e-6), (cause, name)
    # A mass that is wrong by a hundredth, and an integrator of first order in place of another, are far beyond rounding.
    assert all(gap.of_velocities > 1e-3 * gap.speed for gap in alone.values())


def test_what_an_engine_does_not_read_is_dynamics(two_links: Path) -> None:
    gap = gap_of(two_links, two_links, "mujoco/Euler", "pinocchio/Euler")
    assert gap.second.readings == ("Pinocchio's ABA applies no joint damping",)
    assert gap.second.length == gap.first.length == 0.004
    assert shares(gap)[DYNAMICS] == pytest.approx((1.0, 1.0), abs=0.05)
    assert shares(gap)[STEP] == (0.0, 0.0)


@pytest.mark.ci
def test_two_causes_share_the_gap_alike_from_either_side(two_links: Path, heavier: Path) -> None:
    forth = gap_of(two_links, heavier, "mujoco/RK4", "mujoco/Euler@0.002")
    back = gap_of(heavier, two_links, "mujoco/Euler@0.002", "mujoco/RK4", steps=80)
    assert (back.first.steps, back.second.steps) == (80, 40)
    for name in (DYNAMICS, INTEGRATOR, STEP):
        # The coordinates at either end differ by what the gap itself bends.
        assert shares(forth)[name] == pytest.approx(shares(back)[name], abs=ONE_PERCENT)
    assert max(share.by_order for share in forth.shares) > ONE_PERCENT
    assert any("with their order" in remark for remark in forth.remarks)


def test_no_gap_has_no_shares(two_links: Path) -> None:
    gap = gap_of(two_links, two_links, "mujoco/implicit")
    assert gap.of_positions == 0 and set(shares(gap).values()) == {(0.0, 0.0)}


def test_an_engine_that_leaves_its_rule_shows_in_its_own_share(two_links: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Planted: MuJoCo's Euler with explicit dampers, which its declared rule takes implicitly."""
    from harness.engines.adapters.mujoco import law

    def wrong(rule: StepRule) -> StepRule:
        return replace(rule, implicit=rule.implicit | {ImplicitPart.VELOCITY_TERMS}) if rule.name == "Euler" else rule

    plain = law.rules_in
    monkeypatch.setattr(law, "rules_in", lambda root: tuple(map(wrong, plain(root))))
    gap = gap_of(two_links, two_links, "mujoco/Euler", "mujoco/RK4")
    found = shares(gap)
    assert abs(found[BESIDE[0]][0]) > 0.05 and abs(found[BESIDE[1]][0]) < 1e-9
    assert sum(part for part, _ in found.values()) == pytest.approx(1.0, abs=ONE_PERCENT)


def oscillator(rule: Callable[[Fraction, Fraction], tuple[Fraction, Fraction]], steps: int) -> tuple[float, float]:
    q, v = Fraction(0.25), Fraction(-0.5)
    for _ in range(steps):
        q, v = rule(q, v)
    return float(q), float(v)


def test_the_declared_motion_is_that_of_a_map_in_rationals(tmp_path: Path) -> None:
    """A mass on a spring and damper, for which each rule is a quotient of numbers; over 80 steps 128 bits lose more than half of theirs."""
    path = tmp_path / "slider.xml"
    path.write_text(
        """<mujoco><option gravity="0 0 0"/><worldbody><body><joint name="slider" type="slide" axis="1 0 0" stiffness="40" damping="3"/>
        <inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/></body></worldbody></mujoco>"""
    )
    robot = read_robot(path)
    forces, h, mass, stiffness, damping = step_forces(robot.tree, robot.joints), Fraction(2.0**-2), 2, 40, 3
    rules = {
        frozenset[ImplicitPart](): Fraction(mass),
        frozenset({ImplicitPart.JOINT_DAMPERS}): mass + h * damping,
        frozenset({ImplicitPart.JOINT_DAMPERS, ImplicitPart.JOINT_SPRINGS}): mass + h * damping + h * h * stiffness,
    }
    for implicit, effective in rules.items():
        ahead = h * stiffness if ImplicitPart.JOINT_SPRINGS in implicit else 0

        def one(q: Fraction, v: Fraction, effective: Fraction = effective, ahead: Fraction = Fraction(ahead)) -> tuple[Fraction, Fraction]:
            v = v + h * (-stiffness * q - damping * v - ahead * v) / effective
            return q + h * v, v

        (q,), (v,) = DeclaredMotion(forces, (), StepRule("one", float(h), implicit)).end([0.25], [-0.5], 80)
        with flint.ctx.workprec(256):
            assert (float(q), float(v)) == oscillator(one, 80)
            assert q.rad() < 2.0**-75 and v.rad() < 2.0**-75


def test_an_engine_follows_the_declared_motion_for_many_steps() -> None:
    """Rounding alone is between them, which a mechanism that is not chaotic does not amplify."""
    gap = gap_of(model("heavy_top"), model("heavy_top"), "mujoco/implicitfast", "mujoco/RK4", steps=200)
    assert follow_their_rules(gap)


REFUSED = {
    ("mujoco/RK4@x", "mujoco/RK4"): r"expected ENGINE\[@VERSION\]\[/INTEGRATOR\[@SECONDS\]\]",
    ("mujoco/RK4@0", "mujoco/RK4"): r"expected ENGINE\[@VERSION\]\[/INTEGRATOR\[@SECONDS\]\]",
    ("mujocco/RK4", "mujoco/RK4"): "no engine is called 'mujocco'; .*mujoco",
    ("idyntree/RK4", "mujoco/RK4"): "idyntree is not installed beside the harness",
    ("mujoco/RK5", "mujoco/RK4"): "no integrator is called 'RK5'; .*RK4",
    ("pinocchio/implicit", "mujoco/RK4"): "no integrator of one's own by pinocchio's accelerations is called 'implicit'",
    ("mujoco/RK4@0.003", "mujoco/RK4@0.002"): "5 steps of 0.003 s are no whole number of steps of 0.002 s",
}


@pytest.mark.parametrize("by", REFUSED, ids=" ".join)
def test_what_makes_no_pair_of_motions_is_refused(by: tuple[str, str], two_links: Path) -> None:
    with pytest.raises(InvalidRequest, match=REFUSED[by]):
        gap_of(two_links, two_links, *by, steps=5)


def test_files_that_no_rule_moves_are_refused(two_links: Path) -> None:
    with pytest.raises(InvalidRequest, match="ties joints beside its tree"):
        gap_of(model("four_bar"), model("four_bar"), "mujoco/RK4")
    with pytest.raises(InvalidRequest, match="the files are not one robot"):
        gap_of(two_links, model("heavy_top"), "mujoco/RK4")
    with pytest.raises(InvalidRequest, match="the start has 1 positions and 2 velocities; expected 2 and 2"):
        gap_of(two_links, two_links, "mujoco/RK4", start='{"q": [0], "v": [0, 0]}')
    for start in ('{"q": [0, 0]}', '{"q": ["up", 0], "v": [0, 0]}', "0", "up"):
        with pytest.raises(InvalidRequest, match=r': expected {"q": \[...\], "v": \[...\]}'):
            gap_of(two_links, two_links, "mujoco/RK4", start=start)
    with pytest.raises(InvalidRequest, match="the motion of pinocchio by RK4 breaks down within 5 steps"):
        gap_of(two_links, two_links, "pinocchio/RK4@0.001", steps=5, start='{"q": [0, 0], "v": [1e200, 1e200]}')
    with pytest.raises(InvalidRequest, match=r"a rotation turns by .* rad in a step of 0.5 s; expected up to 2"):
        spinning = '{"q": [0, 0, 0, 1, 0, 0, 0], "v": [0, 0, 0, 0, 0, 9]}'
        gap_of(model("free_body"), model("free_body"), "mujoco/RK4@0.5", "mujoco/Euler@0.5", steps=2, start=spinning)
    with pytest.raises(InvalidRequest, match="hinges and slides alone"):
        gap_of(model("heavy_top"), model("heavy_top"), "mujoco/RK4", "pinocchio/RK4")


@pytest.mark.usefixtures("in_this_process")
def test_the_command_prints_the_shares_and_writes_them(two_links: Path, tmp_path: Path) -> None:
    start = '{"q": [0.5, 0.1], "v": [0, 0]}'
    by = ["--by", "mujoco/Euler", "--by", "mujoco/RK4"]
    done = harness("compare", str(two_links), "--steps", "10", *by, "--start", start, "--json", str(tmp_path / "gap.json"))
    assert done.returncode == 0, done.stderr
    assert re.search(r"^integrator +100\.00 % +100\.00 %", done.stdout, re.MULTILINE)
    (written,) = json.loads((tmp_path / "gap.json").read_text())["gaps"]
    assert written["start"] == {"q": [0.5, 0.1], "v": [0.0, 0.0]}
    assert sum(share["positions"] for share in written["shares"]) == pytest.approx(1.0, abs=ONE_PERCENT)
    for wrong in ([*by], ["--steps", "10", *by, "--by", "mujoco/RK4"]):
        assert harness("compare", str(two_links), *wrong).returncode == 2


def test_every_rule_of_one_s_own_is_a_rule_that_an_engine_can_follow() -> None:
    from harness.comparison.gap import OWN_RULES

    assert {rule.name for rule in OWN_RULES} == {"Euler", "RK4"}
    assert all(np.isclose(sum(map(float, rule.weights)), 1.0) for rule in OWN_RULES if rule.stages)
    assert not engines_of_files()["pinocchio"].own_rules(None, "urdf")


@pytest.mark.usefixtures("in_this_process")
@pytest.mark.parametrize(("option", "integrator"), [("", "Euler"), ('integrator="RK4" ', "RK4")])
def test_without_by_the_first_two_engines_move_a_file_as_it_says(option: str, integrator: str, two_links: Path) -> None:
    two_links.write_text(TWO_LINKS.replace("<option ", f"<option {option}"))
    done = harness("compare", str(two_links), "--steps", "10")
    assert done.returncode == 0, done.stderr
    assert f"mujoco/{integrator}, 10 steps" in done.stdout and "pinocchio/Euler, 10 steps" in done.stdout
    for wrong in (["--by", "mujoco/Euler"], ["--subject", "mujoco/mjcf"]):
        assert harness("compare", str(two_links), "--steps", "10", *wrong).returncode == 2
