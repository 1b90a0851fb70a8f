"""MuJoCo XLA in float32, which is what JAX computes in by default; see ``harness.engines.adapters.mjx``."""

from __future__ import annotations

from harness.engines.adapters.mjx import MjxEngine

ENGINE = MjxEngine(in_float64=False)
