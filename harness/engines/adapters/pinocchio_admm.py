"""Pinocchio with dry friction and limits of joints over one step, by its alternating direction method of multipliers.

See ``harness.engines.adapters.pinocchio.stepping``.
"""

from __future__ import annotations

from harness.engines.adapters.pinocchio.stepper import PinocchioStepper

ENGINE = PinocchioStepper("ADMM")
