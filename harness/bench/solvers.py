"""Distances of solvers of constraints from the optimum that their engine documents, over iterations, and their cost.

A robot's file has all on that is judged, at the states at which ``compare`` judges it. The solver that the file chooses, and then each one,
goes as far as the file lets it. Then tolerances are 0, so that a solver ends where nothing changes or where its iterations do, and each is
given more of them until all of its answers agree.

Source: MuJoCo documentation, Computation, section Solver algorithms.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from harness.arrays import Array
from harness.comparison.robot_library import engine_of, robot_at
from harness.comparison.switched_on import Posed, pose
from harness.engines.request import SolverSettings
from harness.explain.meant import meant, worst
from harness.explain.switches import constraints_among
from harness.results.benchmark import SolverCost
from harness.study import Note
from harness.truth.compare import compare
from harness.verdict import Verdict

ITERATIONS = (1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1024)
_NOTHING = "the file has no limit, dry friction, equality or contact that is judged, so that nothing is left to a solver"


def solver_costs(path: Path, engine: str, states: int, seed: int, note: Note) -> Iterator[SolverCost]:
    """The costs of the file's own solver and of each that an engine has; one that says why where it is not judged there.

    Raises:
        harness.errors.InvalidModel: the file cannot be read, or is no robot.
    """
    record, posed = pose(meant(robot_at(path), states, seed), engine)
    case = None if posed is None else posed.case
    if posed is None or case is None or not (constraints_among(case.at.robot, case.judged) or case.touching.is_any.any()):
        yield SolverCost(system=str(path), engine=engine, note=record.message or _NOTHING)
        return
    yield _cost(path, posed, None)
    methods = engine_of(engine).solvers
    yield from (_cost(path, posed, SolverSettings(method)) for method in methods)
    for method in methods:
        for iterations in ITERATIONS:
            note(f"{path.name}: {method}, {iterations} iterations")
            cost = _cost(path, posed, SolverSettings(method, iterations, 0.0))
            yield cost
            if cost.is_right:
                break


def _cost(path: Path, posed: Posed, settings: SolverSettings | None) -> SolverCost:
    case, joints = posed.case, posed.case.at.robot.joints
    answers = posed.asked.with_those(case.judged, case.at, solver=settings)
    compared = compare(case.computed, answers.of(joints), factorises=True)
    known = compared.verdicts != Verdict.UNDECIDED.value
    return SolverCost(
        system=str(path),
        engine=case.caller.name,
        method="" if settings is None else settings.method,
        iterations=None if settings is None else settings.iterations,
        states=int(known.sum()),
        touching=int((case.touching.is_any & known).sum()),
        seconds_per_state=float(np.median(answers.seconds)) if answers.seconds else None,
        backward_error=worst(compared),
        median_backward_error=_median(compared.known("backward_error")),
        relative_error=worst(compared, "relative_error"),
        median_relative_error=_median(compared.known("relative_error")),
        right=int(np.isin(compared.verdicts[known], [Verdict.AGREES.value, Verdict.UNSTABLE.value]).sum()),
    )


def _median(known: Array) -> float | None:
    return float(np.median(known)) if len(known) else None
