"""Energy over many steps of integrators on a mechanism without its dampers: bounded, a random walk, or secular.

The growth is the slope of the largest energy error over ever longer stretches of time, on logarithmic axes.

Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., chapter IX (long-time energy conservation of
symplectic integrators) and section VIII.5 (random walk of roundings).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from harness.arrays import Array
from harness.bench.motion_cost import ROUNDINGS_PER_STEP
from harness.crosscheck.scene import Scene, with_parameters
from harness.engines import Unsupported
from harness.files.model_file import parse_model
from harness.files.text.scan import find_numbers, with_values
from harness.motion.integrators import Integrator
from harness.motion.taylor import Taylor
from harness.motion.trajectories import HORIZON, Start, drift
from harness.programs.mechanisms.kernel import EnergyKernel
from harness.programs.numbers import UNIT_ROUNDOFF
from harness.programs.program import StraightLineProgram, without_unused
from harness.results.motion_benchmark import Drift
from harness.study import Note
from harness.truth.sampling import generic_sample

# Size of the steps, and the longest that one integrator may take by its nominal time [s].
STEP, LONGEST = 1e-3, 120.0
TOLERANCE = 1e-12
KEPT = 2048
# Stretches of time, each twice as long as the one before it, that the growth is fitted over.
STRETCHES = 5
BOUNDED_BELOW, SECULAR_ABOVE = 0.25, 0.75
# An energy that is off by this share of the largest kinetic energy has been lost: what follows says nothing of its growth.
LOST = 0.3
FEWEST_STATES = 2**STRETCHES
TRIAL_STEPS = 1000


def without_dampers(scene: Scene) -> Scene:
    """The scene with the parameters of its dampers at 0, and its models with their damping at 0.

    A damper's parameter is one that the non-conservative forces depend on, and the energy does not.

    Raises:
        ValueError: non-conservative forces are left.
    """
    mechanism = scene.mechanism
    program = mechanism.energy_programs[0]
    first = len(program.inputs) - len(mechanism.parameters)
    of_dampers = _inputs_of(program, "forces") - _inputs_of(program, "energy")
    named = enumerate(mechanism.parameters, start=first)
    conservative = with_parameters(mechanism, {name: 0.0 for place, (name, _, _) in named if place in of_dampers})
    if EnergyKernel(conservative).evaluate(generic_sample(conservative, 8, seed=1)).power.any():
        raise ValueError(f"{mechanism.name} has non-conservative forces that no parameter switches off")
    undamped = {}
    for name, model in scene.models.items():
        numbers = [number for number in find_numbers(model.text, model.format) if "damping" in f"{number.element} {number.attribute}"]
        text = with_values(model.text, dict.fromkeys(numbers, 0.0))
        undamped[name] = parse_model(model.path, text, model.format)
    return Scene(scene.library, conservative, undamped)


def _inputs_of(program: StraightLineProgram, output: str) -> set[int]:
    """Indices of the inputs that an output depends on."""
    alone = without_unused(replace(program, outputs={output: program.outputs[output]}))
    return {operands[0] for operation, *operands in alone.instructions if operation == "input"}


def drifts(scene: Scene, chosen: Sequence[Integrator], steps: int, note: Note, step: float = STEP, seconds: float = LONGEST) -> list[Drift]:
    """Energy over ``steps`` steps of ``step`` [s], of the integrators that are ``chosen``.

    They are as many fewer as take ``seconds`` by the evaluations of a trial and ``Integrator.nominal_seconds``.

    Dampers are taken out of the mechanism and its models. Adaptive integrators run over the same time at
    ``TOLERANCE``. An integrator that cannot express the mechanism has no entry.
    """
    scene = without_dampers(scene)
    conservative = scene.mechanism
    start = Start.of(conservative, steps * step)
    energies = EnergyKernel(conservative)
    # One computed motion cannot be the measure of its own energy.
    truth = Taylor(conservative).solve(start.q, start.v, np.linspace(0.0, min(HORIZON, start.horizon), KEPT))
    largest_kinetic = float(energies.along(truth.q, truth.v).kinetic.max()) or 1.0
    found: list[Drift] = []
    for integrator in chosen:
        note(f"{conservative.name}: {integrator.name} over {steps} steps")
        try:
            advance = integrator.prepare(scene)
        except Unsupported:
            continue
        size, trial = TOLERANCE if integrator.adaptive else step, min(steps, TRIAL_STEPS)
        tried = integrator.run(advance, replace(start, horizon=trial * step), size, trial, 1)
        allowed = seconds * trial / (max(tried.evaluations, 1) * integrator.nominal_seconds(conservative))
        count = min(steps, max(KEPT, int(allowed) // KEPT * KEPT))
        path = integrator.run(advance, replace(start, horizon=count * step), size, count, KEPT)
        energy = energies.along(path.q, path.v, path.times).energy
        errors = np.abs(energy - energy[0]) / largest_kinetic
        growth = growth_of(path.times, errors)
        # Of rounding errors theory says nothing; on a linear system a method may leave nothing else.
        only_rounding = bool(errors.max() <= ROUNDINGS_PER_STEP * UNIT_ROUNDOFF * math.sqrt(count))
        found.append(
            Drift(
                system=conservative.name,
                integrator=integrator.name,
                step=count * step / path.evaluations if integrator.adaptive else step,
                steps=path.evaluations if integrator.adaptive else count,
                seconds=path.seconds,
                gap=drift(conservative, path),
                largest=float(errors.max()) if np.isfinite(errors).all() else math.inf,
                growth=growth,
                verdict=verdict_of(growth, errors),
                expected="" if only_rounding else integrator.long_run,
            )
        )
    return found


def growth_of(times: Array, errors: Array) -> float | None:
    """Slope of log of the largest error up to T, T/2, T/4, ... over log of the time, T the end or where the energy is lost.

    None where an error is 0, or the energy is lost at once.
    """
    lost = np.flatnonzero(~(errors < LOST))
    last = int(lost[0]) if len(lost) else len(times) - 1
    if last < FEWEST_STATES:
        return None
    ends = times[last] / 2.0 ** np.arange(STRETCHES)
    largest = [float(errors[times <= end * (1 + 1e-12)].max()) for end in ends]
    if not all(math.isfinite(value) and value > 0 for value in largest):
        return None
    return float(np.polyfit(np.log(ends), np.log(largest), 1)[0])


def verdict_of(growth: float | None, errors: Array) -> str:
    """The growth in a word; an energy that is lost before the end was not bounded, however it went."""
    if not (errors < LOST).all():
        return "secular"
    if growth is None:
        return "bounded" if not errors.any() else "secular"
    if growth > SECULAR_ABOVE:
        return "secular"
    return "bounded" if growth < BOUNDED_BELOW else "random walk"
