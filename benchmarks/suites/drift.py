"""What the division of a gap between two motions costs: every subset of the causes is moved."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

from benchmarks.benchmark import REFERENCE_WORK, Benchmark, Measure, cpu, reference_work

# Of the reference work, which took 1.6 ms of CPU time where the bar was set: 60 s.
DIVIDED = 37_500.0
SECONDS = 1.0
# Numbers of the arm's file, and others that make eight causes.
OTHERWISE = (
    ('kp="60"', 'kp="50"'),
    ('kv="4"', 'kv="3"'),
    ('gear="1"', 'gear="1.2"'),
    ("-30 30", "-20 20"),
    ('damping="8"', 'damping="6"'),
    ('range="-2 2"', 'range="-1 1"'),
    ('armature="0.1"', 'armature="0.2"'),
    ('frictionloss="0.2"', 'frictionloss="0.4"'),
)


def benchmarks() -> Iterator[Benchmark]:
    yield Benchmark("drift/eight causes of an arm", divided, REFERENCE_WORK, DIVIDED, rounds=1, warm=False)


def divided() -> tuple[Measure, Measure]:
    from harness.drifts.plan import DriftSettings, MovingSide
    from harness.drifts.study import drift_here

    folder = tempfile.TemporaryDirectory()
    text = Path("harness/robots/arm.xml").read_text(encoding="utf-8").replace(' damping="', ' armature="0.1" frictionloss="0.2" damping="')
    joints = ("base_yaw", "shoulder_pitch", "elbow_pitch", "forearm_roll", "wrist_bend", "flange_roll")
    servos = "".join(f'<position joint="{joint}" kp="60" kv="4" gear="1" forcerange="-30 30"/>' for joint in joints)
    key = '<keyframe><key qpos="0.1 0.2 0.3 0.1 0.2 0.3" ctrl="1 1 -1 1 1 -1"/></keyframe>'
    text = text.replace("</mujoco>", f"<actuator>{servos}</actuator>{key}</mujoco>")
    sides = [Path(folder.name, name) for name in ("a.xml", "b.xml")]
    sides[0].write_text(text, encoding="utf-8")
    for before, after in OTHERWISE:
        assert before in text
        text = text.replace(before, after)
    sides[1].write_text(text, encoding="utf-8")

    def divide() -> None:
        found = drift_here(DriftSettings((MovingSide(sides[0]), MovingSide(sides[1])), SECONDS))
        assert (len(found.joints), len(found.shares), found.orders) == (len(joints), len(OTHERWISE) + 1, 0)
        # The files are read until the last round has ended.
        assert folder.name

    return cpu(divide), cpu(reference_work())
