"""Ways of computing accelerations and their derivatives, each a ``Method`` declared in a module of this package.

A method is prepared once for a scene and its states, which loads, compiles and converts; what is timed
afterwards covers all states and nothing else.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.crosscheck.assignment import acceleration_truth_of
from harness.crosscheck.scene import Scene
from harness.files.text.scan import compact
from harness.library import MECHANISMS
from harness.programs.states import States
from harness.registry import declared
from harness.truth.quantities.accelerations import AccelerationTruth

# What a method is of that computes derivatives, beside the kinds of scenes.
DERIVATIVES = "derivatives"
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
            ``harness.hard.worst_cases``; None where there is none.
        residual: (n,) what the method itself says is left of its equations at each state; None where it says nothing.
    """

    compute: Callable[[], object]
    accelerations: Callable[[], Accelerations]
    note: str = ""
    truth: AccelerationTruth | None = None
    reproducer: Callable[[int, Array], str] | None = None
    residual: Callable[[], Array] | None = None

    @classmethod
    def keeping(cls, function: Callable[[], Any], arranged: Callable[[Any], Accelerations], note: str = "", **more: Any) -> Prepared:
        """A method whose accelerations are what the last call of ``function`` returned, ``arranged`` where they are asked for."""
        last: list[Any] = []

        def compute() -> None:
            last[:] = [function()]

        return cls(compute, lambda: arranged(last[0]), note, **more)


@dataclass(frozen=True)
class Method:
    """One way of computing accelerations, or the derivatives by q and v of a tree's accelerations or forces.

    Attributes:
        name: for the command line and the report.
        format: what it reads: "equations", "mjcf" or "urdf".
        loop: what goes from state to state: "Python", at the cost of a call for each, or what is called once for all of them.
        prepare: loads and converts: a scene and states to ``Prepared``; of derivatives also the applied forces or the accelerations
            (n, nv) and a step, to what is timed and gives (n, 2, nv, nv), by q and by v. It raises ``harness.engines.Unsupported`` where
            the method cannot do the system.
        growth: highest exponent of cost over the number of bodies of a chain that the algorithm allows, for
            the reader: "1", "up to 3".
        linear_velocity_in_body: whether it takes the linear velocity of a free joint in the body's frame, and moves its position there.
        most_states: how many it is given at most, where more would only take time; None for as many as there are.
        of: what it computes, some of ``KINDS``: mechanisms with their energies and models, those with constraints, robots' files; or
            ``DERIVATIVES`` alone.
        is_inverse: of derivatives, whether they are of the forces that give accelerations.
        steps: of finite differences, which are tried; () for derivatives that have none.
        engine: that not everybody installs, without which derivatives are measured by name alone; "" for what is always there.
    """

    name: str
    format: str
    prepare: Callable[..., Any]
    loop: str = ""
    growth: str = ""
    linear_velocity_in_body: bool = False
    most_states: int | None = None
    of: tuple[str, ...] = (MECHANISMS,)
    is_inverse: bool = False
    steps: tuple[float, ...] = ()
    engine: str = ""


def find_methods(of: str = MECHANISMS) -> list[Method]:
    """Every method of one of ``KINDS``, or of ``DERIVATIVES``, that a module of this package holds, sorted by name."""
    return [method for _, method in sorted(declared(__name__, Method, "method").items()) if of in method.of]


def truth_of_engine(scene: Scene, engine: str, model_format: str) -> AccelerationTruth:
    """The problem that an engine solves on one of the scene's models; ``rigid`` is None where that is the mechanism's own."""
    return acceleration_truth_of(scene.asked(engine, model_format))


def reproducer_of(model: Any, text: str, states: States) -> Callable[[int, Array], str]:
    """``Prepared.reproducer`` of an engine's model that was loaded from ``text``."""
    return lambda at, certified: str(model.reproducer(repr(compact(text)), states.q[at], states.v[at], states.tau[at], certified))
