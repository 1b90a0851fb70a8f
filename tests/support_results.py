"""A run, a record and a system card for the tests of results."""

from __future__ import annotations

import math

from harness.results.cross_check import SystemCard
from harness.results.records import Record
from harness.results.run import Run

RUN = Run(
    started="2026-01-31T02:00:00+00:00", versions={"harness": "0.1.0", "mujoco": "4.0"}, machine={"processor": "16 cores"}, seed=7,
    profile="nightly", states=1000, library="built-in", command="harness report --profile nightly",
)  # fmt: skip
RECORD = Record(
    system="arm_2r", subject="mujoco/mjcf", states=1000, verdict="disagrees", expected="agrees", backward_error=math.inf,
    relative_error=1e-17, worst_state={"q": [0.1, -2.5], "v": [1e300, 5e-324], "tau": [0.0, -0.0]}, seconds_per_state=2e-6,
    message="two\nlines", median_backward_error=0.3, distribution={"exact": 1, "-3": 990, "inf": 9},
    verdict_counts={"agrees": 991, "disagrees": 9}, replay="harness check arm_2r",
)  # fmt: skip
CARD = SystemCard(
    name="arm_2r", description="Planar two-link arm", source="Spong 7.3", coordinates=[{"name": "q1", "joint": "shoulder"}],
    parameters=[{"name": "m1", "value": 3.0, "unit": "kg"}], equations_mathml="<math><mi>x</mi></math>", equations_text="x",
    operations=12, derivation_seconds=0.5, reference_seconds_per_state=4e-5, compilation_seconds=0.25,
)  # fmt: skip
