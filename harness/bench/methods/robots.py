"""Accelerations of a robot's file: the engines that read it, aided as in a check, and the harness's own program.

Conversions into an engine's conventions, and forces that the harness supplies to it, are made before anything is timed.
"""

from __future__ import annotations

from functools import partial

from harness.arrays import Array
from harness.bench.methods import Method, Prepared
from harness.crosscheck.scene import Scene
from harness.engines.loaded_file import AidedModel
from harness.library import ROBOTS
from harness.programs.mechanisms.kernel import MechanismKernel
from harness.programs.states import States

COUPLED = "joints that mimic others are eliminated in Python, from the engine's own M and forces"


def _aided(engine: str, scene: Scene, states: States) -> Prepared:
    model: AidedModel = scene.load(engine, "file")
    run = model.prepare(states.q, states.v, states.tau)
    return Prepared(run.compute, lambda: model.ordered(run.accelerations()), COUPLED if model.is_coupled else "")


def _recursion(scene: Scene, states: States) -> Prepared:
    kernel = MechanismKernel(scene.mechanism)
    columns, compiled = kernel.inputs(states.q, states.v, states.tau), kernel.compiled
    last: list[Array] = []

    def compute() -> None:
        last[:] = [compiled.accelerations(columns)]

    return Prepared(compute, lambda: last[0].T)


MUJOCO = Method("mujoco on the file, aided", "file", partial(_aided, "mujoco"), loop="Python", growth="up to 3", of=(ROBOTS,))
PINOCCHIO = Method("pinocchio on the file, aided", "file", partial(_aided, "pinocchio"), loop="Python", growth="1", of=(ROBOTS,))
RECURSION = Method("recursion float64", "equations", _recursion, loop="machine code", growth="up to 3", of=(ROBOTS,))
