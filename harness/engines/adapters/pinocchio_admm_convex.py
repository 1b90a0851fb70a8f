"""Pinocchio over one step as ``pinocchio_admm`` has it, with ``solve_ncp`` off: its contacts are those of the convex problem.

See ``harness.engines.adapters.pinocchio.stepping``.
"""

from __future__ import annotations

from harness.engines.adapters.pinocchio.stepper import PinocchioStepper

ENGINE = PinocchioStepper("ADMM", is_convex=True)
