"""The harness's own calls of engines: its bulk check without certification, and users' files as a check asks about them.

A check converts an engine's accelerations and compares them with references that are computed beforehand. Divided by the cost of the
engine's own call its cost is the price of being checked. Of a robot's file conversions into an engine's conventions, and forces that the
harness supplies to it, are made before anything is timed.
"""

from __future__ import annotations

from functools import partial
from typing import cast

from harness.arrays import Array
from harness.bench.methods import Method, Prepared, truth_of_engine
from harness.crosscheck.assignment import load_audited
from harness.crosscheck.scene import Scene
from harness.engines import Unsupported, accelerations
from harness.engines.loaded_file import FileModel
from harness.library import CONSTRAINED, MECHANISMS, ROBOTS
from harness.programs.states import States
from harness.results.table import error_text
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


def _on_file(engine: str, scene: Scene, states: States) -> Prepared:
    """The engine held against the file; where its reader makes something else of that, the note says what, and what that leaves."""
    asked = scene.asked(engine, "file")
    model, read = cast("FileModel", load_audited(asked)), asked.as_read
    own = asked.into(states)
    run = model.prepare(own.q, own.v, own.tau)
    columns: list[int] | slice | None = slice(None)
    notes = [COUPLED] * model.is_coupled
    if read is not asked:
        columns = asked.file_as_read.columns(asked.asked)
        run.compute()
        left = compare(read.truth.evaluate(own), model.ordered(run.accelerations())).known("backward_error").max(initial=0.0)
        sentences = "; ".join(reading.sentence for reading, _ in asked.file_as_read.folded.applied)
        notes.append(f"explained: {sentences}; that leaves {error_text(float(left))} data roundoffs")
    if columns is None:
        raise Unsupported("; ".join(["its reader takes joints away, so that nothing is held against the file", *notes]))
    return Prepared(run.compute, lambda: model.ordered(run.accelerations())[:, columns], "; ".join(notes))


METHODS = [
    *(
        Method(f"harness check of {engine}", own, partial(_check, engine, own), loop, growth, in_body, of=(MECHANISMS, CONSTRAINED))
        for engine, own, loop, growth, in_body in (
            ("mujoco", "mjcf", "MuJoCo", "up to 3", False),
            ("pinocchio", "urdf", "Python", "1", True),
        )
    ),
    *(
        Method(f"{engine} on the file", "file", partial(_on_file, engine), "Python", growth, of=(ROBOTS,))
        for engine, growth in (("mujoco", "up to 3"), ("pinocchio", "1"))
    ),
]
