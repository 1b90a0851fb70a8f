"""Pinocchio over one step with dry friction, limits and contacts, by its projected Gauss-Seidel method.

See ``harness.engines.adapters.pinocchio.stepping``.
"""

from __future__ import annotations

from harness.engines.adapters.pinocchio.stepper import PinocchioStepper

ENGINE = PinocchioStepper("PGS")
