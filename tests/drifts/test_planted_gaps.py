"""Gaps that are planted in one side of a drift: the planted cause has most of the gap, and the shares sum to it."""

from __future__ import annotations

import itertools
import re
from collections.abc import Collection, Sequence
from pathlib import Path

import numpy as np
import pytest
from drifting import INTEGRATORS, ROBOTS, SCALED, SMALL, SMALLEST, planted

from harness.drifts.plan import DriftSettings, MovingSide
from harness.drifts.study import drift_here, prepare
from harness.engines.moving import Control
from harness.results.cause import DriftCause
from harness.results.drift import ENGINE, DriftRecord

# Causes that differ a little beside the planted one.
BESIDE = (DriftCause.GAIN, DriftCause.ARMATURE, DriftCause.DAMPING, DriftCause.FORCE_RANGE)
SUMS = 1e-10
ACTUATORS = {"arm": {f"servo{number}": 0.7 for number in range(6)}, "hopper": {"hip_drive": 0.9, "knee_drive": -1.2}}
ACTUATORS["cart"] = {"drive": 0.8, "twist": 1.5}
# A step of each file [s].
STEPS = {"arm": 0.002, "hopper": 0.002, "cart": 0.004}


def waves(robot: str) -> Control:
    """Targets that swing four times a second, an actuator each a little later than the last one."""
    times, names = np.arange(0, 1, 0.01), tuple(ACTUATORS[robot])
    values = [size * np.cos(8 * times - place) for place, size in enumerate(ACTUATORS[robot].values())]
    return Control(names, times, np.transpose(values))


def drift(
    folder: Path, robot: str, causes: Collection[DriftCause], small: Collection[DriftCause] = (), seconds: float = 0.4
) -> DriftRecord:
    first, second = folder / "a.xml", folder / "b.xml"
    first.write_text(ROBOTS[robot])
    second.write_text(planted(robot, causes, small, SMALL if len(causes) < 2 else SMALLEST))
    delay = STEPS[robot] if DriftCause.DELAY in causes else 0.0
    return drift_here(DriftSettings((MovingSide(first), MovingSide(second, delay=delay)), seconds, waves(robot)))


def plants(robot: str) -> list[DriftCause]:
    """The causes that can be planted in a robot."""
    return [
        *(cause for cause, (pattern, _) in SCALED.items() if re.search(pattern, ROBOTS[robot])),
        DriftCause.INTEGRATOR,
        DriftCause.DELAY,
    ]


def hold_sums(found: DriftRecord) -> None:
    for rows in (
        zip(*(share.positions for share in found.shares), strict=True),
        zip(*(share.velocities for share in found.shares), strict=True),
    ):
        for row in rows:
            parts = [part for part in row if part is not None]
            assert not parts or sum(parts) == pytest.approx(1.0, abs=SUMS)
    assert sum(share.whole or 0.0 for share in found.shares) == pytest.approx(1.0, abs=SUMS)


def names(found: DriftRecord) -> Sequence[str]:
    return [share.name for share in found.ranked]


def hold_alone(found: DriftRecord, cause: DriftCause) -> None:
    assert names(found)[0] == cause
    hold_sums(found)
    # The same engine moves both files, so that numbers are all that differs.
    [left] = [share for share in found.shares if share.name == ENGINE]
    assert left.positions == [0.0] * len(found.times)


def test_there_are_eleven_kinds_of_gaps() -> None:
    assert len({cause for robot in ROBOTS for cause in plants(robot)}) == 12
    assert set(INTEGRATORS) == set(ROBOTS)


# At the desk one of each kind, on one robot.
DESK = {
    DriftCause.GAIN: "arm",
    DriftCause.FORCE_RANGE: "cart",
    DriftCause.DERIVATIVE_GAIN: "cart",
    DriftCause.GEAR: "hopper",
    DriftCause.ARMATURE: "cart",
}
DESK |= {
    DriftCause.FRICTION: "cart",
    DriftCause.LIMITS: "hopper",
    DriftCause.STEP: "cart",
    DriftCause.CONTACT_LAW: "hopper",
    DriftCause.INTEGRATOR: "cart",
}
DESK |= {DriftCause.DELAY: "hopper", DriftCause.DAMPING: "cart"}


@pytest.mark.parametrize("cause", DESK)
def test_a_planted_cause_is_first(tmp_path: Path, cause: DriftCause) -> None:
    beside = BESIDE[:2] if cause in BESIDE[:2] else BESIDE[1:2]
    hold_alone(drift(tmp_path, DESK[cause], [cause], beside, seconds=0.3), cause)


@pytest.mark.ci
@pytest.mark.parametrize(("robot", "cause"), [(robot, cause) for robot in ROBOTS for cause in plants(robot)])
def test_a_planted_cause_is_first_among_others(tmp_path: Path, robot: str, cause: DriftCause) -> None:
    hold_alone(drift(tmp_path, robot, [cause], BESIDE), cause)


@pytest.mark.ci
@pytest.mark.parametrize("robot", ROBOTS)
def test_planted_pairs_are_the_first_two(tmp_path: Path, robot: str) -> None:
    for pair in itertools.combinations(plants(robot), 2):
        found = drift(tmp_path, robot, pair, BESIDE[1:2])
        hold_sums(found)
        told = [(share.name, share.whole) for share in found.ranked]
        others = [abs(share.whole or 0.0) for share in found.shares if share.name not in pair]
        assert all(abs(share.whole or 0.0) >= max(others) for share in found.shares if share.name in pair), (pair, told)


@pytest.mark.parametrize("robot", ROBOTS)
def test_a_file_and_its_copy_move_alike(tmp_path: Path, robot: str) -> None:
    found = drift(tmp_path, robot, [], seconds=0.1)
    assert not any([*found.of_positions, *found.of_velocities])
    assert found.sentence == "a.xml and b.xml move alike to the last digit for 0.1 s."


def test_an_arm_without_derivative_gain_and_force_limit(tmp_path: Path) -> None:
    first, second = tmp_path / "a.xml", tmp_path / "b.xml"
    first.write_text(ROBOTS["arm"])
    second.write_text(ROBOTS["arm"].replace('kv="5.13"', 'kv="0"').replace('forcerange="-3.5 3.5"', 'forcerange="-1e6 1e6"'))
    found = drift_here(DriftSettings((MovingSide(first), MovingSide(second)), 0.4))
    assert set(names(found)[:2]) == {DriftCause.DERIVATIVE_GAIN, DriftCause.FORCE_RANGE}
    assert "b.xml has no derivative gain" in found.sentence
    assert 'Set kv="5.13" in b.xml.' in found.sentence and 'Set forcerange="-3.5 3.5" in b.xml.' in found.sentence
    line = 1 + next(number for number, text in enumerate(ROBOTS["arm"].splitlines()) if "<position" in text)
    assert f"b.xml line {line}: kv 0; a.xml line {line}: kv 5.13" in found.sentence
    hold_sums(found)


def test_every_subset_is_moved_once(tmp_path: Path) -> None:
    found = drift(tmp_path, "cart", [DriftCause.GEAR], (DriftCause.ARMATURE, DriftCause.DAMPING), seconds=0.02)
    # Beside the eight subsets of three causes, the second side's own motion, and three of each side that are rounded anew.
    assert (found.motions, found.orders) == (2**3 + 1 + 2 * 3, 0)


def hold_mended(folder: Path, robot: str, causes: Collection[DriftCause]) -> None:
    """Make the changes of a file with other numbers one after the other, and see that nothing of the gap is left."""
    first, second = folder / "a.xml", folder / "b.xml"
    first.write_text(ROBOTS[robot])
    second.write_text(planted(robot, causes))
    settings = DriftSettings((MovingSide(first), MovingSide(second)), 0.1, waves(robot))
    changes = prepare(settings, here=True).changes
    assert changes.keys() == set(causes)
    for cause in causes:
        # Each is found anew in what the last one has made.
        for _ in changes[cause]:
            change = prepare(settings, here=True).changes[cause][0]
            assert change.kind == cause and change.path == second
            second.write_text(change.text(0.0))
    left = drift_here(settings)
    assert not any(left.of_positions) and not any(left.of_velocities) and [share.name for share in left.shares] == [ENGINE]


@pytest.mark.parametrize(("robot", "causes"), [("cart", [DriftCause.DAMPING, DriftCause.INTEGRATOR]), ("hopper", [DriftCause.GAIN])])
def test_what_is_to_be_set_ends_the_gap(tmp_path: Path, robot: str, causes: list[DriftCause]) -> None:
    hold_mended(tmp_path, robot, causes)


@pytest.mark.ci
@pytest.mark.parametrize("robot", ROBOTS)
def test_every_cause_of_a_file_is_set_by_its_changes(tmp_path: Path, robot: str) -> None:
    hold_mended(tmp_path, robot, [cause for cause in plants(robot) if cause != DriftCause.DELAY])
