"""Integrators: ways of computing a motion, each a small declaration in a module of this package.

Every module-level ``Integrator`` of every module here is one of the harness's integrators; adding one touches
no list. Programs are imported where they are used, so that finding integrators costs nothing.

Sources: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., chapters I, VI and IX, for orders and
for energy over long times.
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from harness.crosscheck.scene import Scene
from harness.errors import InvalidRequest
from harness.library import nearest
from harness.motion.taylor import Path
from harness.motion.trajectories import Start

# From a start, in steps of so many seconds, so many of them, of which every so-many-th is kept. An adaptive
# integrator is given its relative tolerance, and the number of equal intervals of the horizon to keep.
Advance = Callable[[Start, float, int, int], Path]


@dataclass(frozen=True, kw_only=True)
class Integrator:
    """One way of computing a motion.

    Attributes:
        name: as "equations RK4".
        format: what it reads: "equations", or the model format "mjcf" or "urdf".
        order: of convergence of the state, by theory; None for one without a fixed order.
        prepare: loads and compiles for a scene; raises harness.engines.Unsupported where it cannot.
        adaptive: whether it chooses its steps by a tolerance.
        long_run: what theory says of its energy on a conservative system over many steps: "bounded",
            "secular", or "" where it is silent.
        explain: says, from runs on a scene with a step [s], where the method is not what its name promises; "" if it is.
    """

    name: str
    format: str
    order: int | None
    prepare: Callable[[Scene], Advance]
    adaptive: bool = False
    long_run: str = ""
    explain: Callable[[Scene, Start, float], str] | None = None


def integrators() -> list[Integrator]:
    """All integrators, by module and in the order of their declaration."""
    modules = [importlib.import_module(f"{__name__}.{module.name}") for module in pkgutil.iter_modules(__path__)]
    return [value for module in modules for value in vars(module).values() if isinstance(value, Integrator)]


def select_integrators(names: Iterable[str]) -> list[Integrator]:
    """The integrators called ``names``, or all for none.

    Raises:
        InvalidRequest: a name none has; the message gives the nearest one.
    """
    known = {integrator.name: integrator for integrator in integrators()}
    chosen = list(dict.fromkeys(names))
    for name in chosen:
        if name not in known:
            raise InvalidRequest(f"no integrator is called {name!r}; {nearest(name, known)}")
    return [known[name] for name in chosen] or list(known.values())
