"""The harness's own calls of engines: its bulk check without certification, and robots' files with what a check supplies.

A check converts an engine's accelerations and compares them with references that are computed beforehand. Divided by the cost of the
engine's own call its cost is the price of being checked. Of a robot's file conversions into an engine's conventions, and forces that the
harness supplies to it, are made before anything is timed.
"""

from __future__ import annotations

from functools import partial

from harness.arrays import Array
from harness.bench.methods import Method, Prepared, truth_of_engine
from harness.crosscheck.scene import Scene
from harness.engines import accelerations
from harness.engines.loaded_file import AidedModel
from harness.library import CONSTRAINED, MECHANISMS, ROBOTS
from harness.programs.states import States
from harness.truth.compare import compare

CHECKED = "the engine's accelerations with their conversions, compared with references at hand"
COUPLED = "joints that mimic others are eliminated in Python, from the engine's own M and forces"


def _check(engine: str, model_format: str, scene: Scene, states: States) -> Prepared:
    model, truth = scene.load(engine, model_format), truth_of_engine(scene, engine, model_format)
    reference = truth.kernel.evaluate(states)

    def checked() -> Array:
        found = accelerations(model, states)
        compare(reference, found)
        return found

    return Prepared.keeping(checked, lambda found: found, CHECKED, truth=None if truth.rigid is None else truth)


def _aided(engine: str, scene: Scene, states: States) -> Prepared:
    model: AidedModel = scene.load(engine, "file")
    run = model.prepare(states.q, states.v, states.tau)
    return Prepared(run.compute, lambda: model.ordered(run.accelerations()), COUPLED if model.is_coupled else "")


METHODS = [
    *(
        Method(f"harness check of {engine}", own, partial(_check, engine, own), loop, growth, in_body, of=(MECHANISMS, CONSTRAINED))
        for engine, own, loop, growth, in_body in (
            ("mujoco", "mjcf", "MuJoCo", "up to 3", False),
            ("pinocchio", "urdf", "Python", "1", True),
        )
    ),
    *(
        Method(f"{engine} on the file, aided", "file", partial(_aided, engine), "Python", growth, of=(ROBOTS,))
        for engine, growth in (("mujoco", "up to 3"), ("pinocchio", "1"))
    ),
]
