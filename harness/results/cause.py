"""The causes that two simulated motions of one robot differ by."""

from __future__ import annotations

from enum import StrEnum


class DriftCause(StrEnum):
    """A group of numbers that an engine holds after loading a file, or of settings by which its user moves it."""

    TREE = "tree and inertias"
    SPRINGS = "springs"
    DAMPING = "damping"
    ARMATURE = "armature"
    FRICTION = "dry friction"
    LIMITS = "joint limits"
    EQUALITIES = "equalities"
    GAIN = "actuator gain"
    DERIVATIVE_GAIN = "derivative gain"
    GEAR = "gear"
    ACTIVATION = "actuator dynamics"
    CONTROL_RANGE = "control range"
    FORCE_RANGE = "force range"
    DELAY = "control delay"
    DECIMATION = "control period"
    CONTACT_GEOMETRY = "contact geometry"
    CONTACT_LAW = "contact law"
    SOLVER = "solver"
    INTEGRATOR = "integrator"
    STEP = "step length"
