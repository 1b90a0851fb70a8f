"""MuJoCo XLA in float64; see ``harness.engines._mjx``."""

from __future__ import annotations

from harness.engines._mjx import MjxEngine

ENGINE = MjxEngine(in_float64=True)
