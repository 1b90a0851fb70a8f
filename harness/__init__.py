"""Certified cross-checks of rigid-body dynamics: textbook Lagrangians against physics engines.

Read a mechanism, and evaluate its certified accelerations:

    harness.mechanisms()                                     # their names
    pendulum = harness.load("double_pendulum")               # a notebook shows a card with a picture
    pendulum.joints, pendulum.parameters, pendulum.picture()
    pendulum.M, pendulum.C, pendulum.g, pendulum.latex       # SymPy, and the equations in LaTeX
    truth = pendulum.accelerations(q=[0.3, -0.2], v=[1.0, 0.5])
    truth.value, truth.error_bound                           # the truth is certainly within the bound
    pendulum.derivatives([0.3, -0.2], [1.0, 0.5]).by_velocity
    pendulum.mass_matrix(q), pendulum.bias(q, v), pendulum.inverse_dynamics(q, v, qdd)
    pendulum.with_parameters(l1=2.0).simulate(q, v, seconds=10).plot()

Hold engines, model files, or your own program against that truth:

    harness.check("double_pendulum")                         # a table of records
    harness.check("double_pendulum", mjcf="mine.xml")
    harness.check("double_pendulum", quantities="mass_matrix")
    harness.check("robot.urdf")                              # a robot's file is its own truth
    harness.diagnose("double_pendulum", mjcf="mine.xml")     # which line is wrong, and the value that explains it
    harness.compare("double_pendulum", q, v, accelerations)  # backward errors and verdicts of anybody's answers
    harness.compare("robot.urdf", "robot.xml")               # engines on a robot's files, readings, and what differs
    harness.drift("isaac.xml", "mine.xml", control=f)        # why a controlled robot moves otherwise in the second file
    harness.drift_from_log("robot.xml", "measured.csv")      # which number of the file would explain a log

Write a mechanism down with ``System`` over the time ``TIME``; ball and free joints take an ``Attitude``, loops and
rolling a ``Constraint``, motors and servos an ``Actuator``, surfaces that may touch a ``Contact``. ``harness.load(SYSTEM)`` needs no files.
The command line is ``harness --help``. Everything is loaded on first use.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from harness.version import __version__

if TYPE_CHECKING:
    from harness.api import check, compare, diagnose, load, mechanisms
    from harness.api.drifting import drift, drift_from_log
    from harness.lagrange.actuator import Actuator
    from harness.lagrange.constraint import Constraint, Contact
    from harness.lagrange.euler_angles import Attitude, body_rates, rotation
    from harness.lagrange.system import TIME, System
    from harness.library import Library
    from harness.results.records import Record, Records
    from harness.verdict import Verdict

_HOMES = {
    "harness.api": ("check", "compare", "diagnose", "load", "mechanisms"),
    "harness.api.drifting": ("drift", "drift_from_log"),
    "harness.lagrange.actuator": ("Actuator",),
    "harness.lagrange.constraint": ("Constraint", "Contact"),
    "harness.lagrange.euler_angles": ("Attitude", "body_rates", "rotation"),
    "harness.lagrange.system": ("TIME", "System"),
    "harness.library": ("Library",),
    "harness.results.records": ("Record", "Records"),
    "harness.verdict": ("Verdict",),
}
__all__ = [
    "TIME",
    "Actuator",
    "Attitude",
    "Constraint",
    "Contact",
    "Library",
    "Record",
    "Records",
    "System",
    "Verdict",
    "__version__",
    "body_rates",
    "check",
    "compare",
    "diagnose",
    "drift",
    "drift_from_log",
    "load",
    "mechanisms",
    "rotation",
]


def __getattr__(name: str) -> Any:
    for home, names in _HOMES.items():
        if name in names:
            return getattr(import_module(home), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
