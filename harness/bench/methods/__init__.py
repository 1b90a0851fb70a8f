"""Ways of computing accelerations, each a ``Method`` declared in a module of this package, and ``derivatives``.

A method is prepared once for a scene and its states, which loads, compiles and converts; what is timed
afterwards covers all states and nothing else.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.crosscheck.scene import Scene
from harness.library import MECHANISMS
from harness.programs.states import States
from harness.registry import Registry, select
from harness.truth.quantities.accelerations import AccelerationTruth

Accelerations = np.ndarray[Any, np.dtype[np.floating[Any]]]


@dataclass(frozen=True)
class Prepared:
    """A method ready to run on the states it was prepared with.

    Attributes:
        compute: everything that is timed, over all states.
        accelerations: (n, nv), in the order of the mechanism's coordinates, what the last ``compute`` found.
        note: what its cost means on this system where that is not plain; "" where it is.
        truth: what the answers are held against; None for the mechanism's own equations.
        reproducer: from the place of a state and the certified accelerations there to a program that needs the engine alone, as of
            ``harness.hard.reproducer``; None where there is none.
        residual: (n,) what the method itself says is left of its equations at each state; None where it says nothing.
    """

    compute: Callable[[], object]
    accelerations: Callable[[], Accelerations]
    note: str = ""
    truth: AccelerationTruth | None = None
    reproducer: Callable[[int, Array], str] | None = None
    residual: Callable[[], Array] | None = None


@dataclass(frozen=True)
class Method:
    """One way of computing accelerations.

    Attributes:
        name: for the command line and the report.
        format: what it reads: "equations", "mjcf" or "urdf".
        loop: what goes from state to state: "Python", at the cost of a call for each, or what is called once for all of them.
        prepare: loads and converts. It raises ``harness.engines.Unsupported`` where the method cannot do the system.
        growth: highest exponent of cost over the number of bodies of a chain that the algorithm allows, for
            the reader: "1", "up to 3".
        linear_velocity_in_body: whether it takes the linear velocity of a free joint in the body's frame.
        most_states: how many it is given at most, where more would only take time; None for as many as there are.
        of: what it computes, some of ``KINDS``: mechanisms with their energies and models, those with constraints, robots' files.
    """

    name: str
    format: str
    prepare: Callable[[Scene, States], Prepared]
    loop: str = ""
    growth: str = ""
    linear_velocity_in_body: bool = False
    most_states: int | None = None
    of: tuple[str, ...] = (MECHANISMS,)


@dataclass(frozen=True)
class DerivativeMethod:
    """One way of computing the derivatives of a tree's accelerations or forces by q and v.

    Attributes:
        name: for the command line and the report.
        format: what it reads: "equations", "mjcf" or "urdf".
        is_inverse: whether they are of the forces that give accelerations.
        prepare: of a scene, states, the applied forces or the accelerations (n, nv), and a step, loads and converts; what it returns is
            timed, and gives (n, 2, nv, nv), by q and by v. It raises ``harness.engines.Unsupported`` where the method cannot do the system.
        loop: what goes from state to state, as of ``Method``.
        linear_velocity_in_body: whether it takes the linear velocity of a free joint in the body's frame, and moves its position there.
        steps: of finite differences, which are tried; () for derivatives that have none.
        engine: that not everybody installs, without which it is measured by name alone; "" for a method of what is always there.
    """

    name: str
    format: str
    is_inverse: bool
    prepare: Callable[[Scene, States, Array, float], Callable[[], Array]]
    loop: str = ""
    linear_velocity_in_body: bool = False
    steps: tuple[float, ...] = ()
    engine: str = ""


_DERIVATIVE_METHODS = Registry(__name__, DerivativeMethod, "method")
_METHODS = Registry(__name__, Method, "method")


def find_derivative_methods() -> list[DerivativeMethod]:
    """Every one that a module of this package holds, sorted by name."""
    return list(_DERIVATIVE_METHODS.sorted().values())


def find_methods(of: str = MECHANISMS) -> list[Method]:
    """Every method of one of ``KINDS`` that a module of this package holds, sorted by name."""
    return [method for method in _METHODS.sorted().values() if of in method.of]


def select_methods(names: Sequence[str], of: str = MECHANISMS) -> list[Method]:
    """The methods of one of ``KINDS`` called ``names``, or all of them for none.

    Raises:
        InvalidRequest: a name no method has; the message gives the nearest one.
    """
    return select(names, {method.name: method for method in find_methods(of)}, "method")
