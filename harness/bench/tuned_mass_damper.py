"""The tuned mass damper of the text, computed again: how far the cart still swings, and whether the energy adds up.

The text holds the bar vertical, pushes the cart to 3 cm, releases both, and integrates 20 s by Euler-Cromer with
steps of 0.1 ms for three dampers. Its energy check adds up c theta'^2 dt over the rates at the ends of the steps.
Here the same is done from the equations, by Euler's semi-implicit method wherever an engine offers it, and along
the reference motion, at the same instants.

Source: The Euler-Lagrange equations (chapter 7.9), example 4, step 2.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from decimal import Decimal

import numpy as np

from harness.arrays import Array
from harness.crosscheck.scene import Scene, with_parameters
from harness.engines import EQUATIONS
from harness.files.model_file import parse_model
from harness.files.text.scan import find_numbers, with_values
from harness.library import Library
from harness.motion.integrators import Integrator, integrators
from harness.motion.taylor import Taylor
from harness.motion.trajectories import Start
from harness.programs.mechanisms.kernel import EnergyKernel
from harness.programs.mechanisms.mechanism import Mechanism
from harness.results.motion_benchmark import Figure
from harness.study import Note

SYSTEM, DAMPING = "cart_pendulum", "c"
STEP, STEPS = 1e-4, 199_999
# The text looks at the cart from here on [s].
LATE = 18.0
# The text's method, by this word in an integrator's name.
METHOD = "Euler"
# Where no energy is balanced, each so-many-th state is enough, which the equations reach in one call: it misses 8e-6 of an amplitude.
EVERY = 16


@dataclass(frozen=True)
class Ride:
    """One motion of the cart: times (n,) [s], position (n,) of the cart [m], energy (n,) [J], dissipated energy (n,) [J]."""

    times: Array
    position: Array
    energy: Array
    dissipated: Array


def amplitude(ride: Ride) -> float:
    """Largest |x| after 18 s [cm]."""
    return float(100 * np.abs(ride.position[ride.times > LATE]).max())


def mismatch(ride: Ride) -> float:
    """Largest |(E0 - E) - dissipated energy| [J]."""
    return float(np.abs(ride.energy[0] - ride.energy - ride.dissipated).max())


@dataclass(frozen=True)
class Printed:
    """A figure as the text prints it: for the damper ``damping`` [N m s], ``figure`` with all its digits."""

    measure: Callable[[Ride], float]
    damping: float
    figure: str
    unit: str
    what: str


PRINTED = (
    Printed(amplitude, 0.0, "2.98", "cm", "largest |x| after 18 s"),
    Printed(amplitude, 0.2, "0.01", "cm", "largest |x| after 18 s"),
    Printed(amplitude, 2.0, "1.19", "cm", "largest |x| after 18 s"),
    Printed(mismatch, 0.2, "3.0e-5", "J", "largest energy mismatch"),
)


def figures(library: Library, note: Note) -> list[Figure]:
    """Every printed figure by every way of computing it; none for a library without the system."""
    if SYSTEM not in library.system_names():
        return []
    original = Scene.of(library, SYSTEM)
    found: list[Figure] = []
    scenes = {printed.damping: with_damping(original, printed.damping) for printed in PRINTED}
    balanced = {printed.damping for printed in PRINTED if printed.measure is mismatch}
    truths = {damping: true_ride(scene.mechanism) for damping, scene in scenes.items()}
    for integrator in integrators():
        if METHOD not in integrator.name or integrator.format not in (EQUATIONS, *original.models):
            continue
        rides = {}
        for damping, scene in scenes.items():
            note(f"{integrator.name} on {SYSTEM} with {DAMPING} = {damping}")
            rides[damping] = ride(scene, integrator, 1 if damping in balanced else EVERY)
        found += [_figure(printed, integrator.name, rides, truths) for printed in PRINTED]
    return found


def with_damping(scene: Scene, damping: float) -> Scene:
    """The scene with another damper [N m s] in its equations and in its models.

    Raises:
        ValueError: the mechanism has no parameter ``c``, or a model not exactly one damper.
    """
    mechanism = scene.mechanism
    if DAMPING not in [name for name, _, _ in mechanism.parameters]:
        raise ValueError(f"{mechanism.name} has no parameter {DAMPING!r}")
    models = {}
    for model_format, model in scene.models.items():
        dampers = [number for number in find_numbers(model.text, model.format) if number.attribute == "damping"]
        if len(dampers) != 1:
            raise ValueError(f"{model.path.name} has {len(dampers)} dampers; expected one")
        models[model_format] = parse_model(model.path, with_values(model.text, {dampers[0]: damping}), model.format)
    return Scene(scene.library, with_parameters(mechanism, {DAMPING: damping}), models)


def ride(scene: Scene, integrator: Integrator, every: int = 1) -> Ride:
    """The text's motion by ``integrator``, of which each ``every``-th state is kept.

    The energy that the damper takes is the text's sum where every state is kept, else one over longer intervals.
    """
    mechanism = scene.mechanism
    path = integrator.prepare(scene)(Start.of(mechanism, STEPS * STEP), STEP, STEPS, every)
    (damping,) = (value for name, value, _ in mechanism.parameters if name == DAMPING)
    dissipated = np.concatenate([[0.0], np.cumsum(damping * path.v[1:, 1] ** 2 * np.diff(path.times))])
    return Ride(path.times, path.q[:, 0], EnergyKernel(mechanism).along(path.q, path.v).energy, dissipated)


def true_ride(mechanism: Mechanism) -> Ride:
    """The reference motion at the same instants; the work of the damper is integrated along."""
    times = np.arange(STEPS + 1, dtype=np.float64) * STEP
    start = Start.of(mechanism, STEPS * STEP)
    found = Taylor(mechanism).solve(start.q, start.v, times)
    assert found.work is not None
    return Ride(times, found.q[:, 0], EnergyKernel(mechanism).along(found.q, found.v).energy, -found.work)


def _figure(printed: Printed, way: str, rides: Mapping[float, Ride], truths: Mapping[float, Ride]) -> Figure:
    computed, truth = printed.measure(rides[printed.damping]), printed.measure(truths[printed.damping])
    reproduced = rounds_to(computed, printed.figure)
    return Figure(
        system=SYSTEM,
        what=f"{printed.what}, {DAMPING} = {printed.damping:g} N m s, {way} with steps of {STEP:g} s",
        unit=printed.unit,
        printed=float(printed.figure),
        computed=computed,
        truth=truth,
        reproduced=reproduced,
        remark="" if reproduced else _remark(printed, computed, truth, truths[printed.damping]),
    )


def rounds_to(computed: float, printed: str) -> bool:
    """True if a number, rounded to the digits of a printed one, is that one."""
    return math.isfinite(computed) and Decimal(computed).quantize(Decimal(printed)) == Decimal(printed)


def _remark(printed: Printed, computed: float, truth: float, true: Ride) -> str:
    unit = printed.unit
    text = f"the text prints {printed.figure} {unit}; this way gives {computed:.2g} {unit}, the reference motion {truth:.2g} {unit}"
    # The least number that rounds to the print.
    last_digit = int(Decimal(printed.figure).as_tuple().exponent)
    least = float(Decimal(printed.figure) - Decimal(5).scaleb(last_digit - 1))
    beyond = np.flatnonzero(100 * np.abs(true.position) >= least)
    if printed.measure is amplitude and truth < least and len(beyond):
        text += (
            f"; |x| of the reference motion last reaches {least:.2g} {unit}, which rounds to the print, at {true.times[beyond[-1]]:.2f} s"
        )
    return text
