"""Cost and error of quantities beyond accelerations on one system, by how many states are asked for at once.

Of a subject the engine's own calls are timed; what makes their arguments, or arranges answers for the comparison, is not. Errors are
those of the cross-check, at the same states for each number of states at once, so that they differ only where the engine's answers do.

Every way of computing derivatives by q and v has errors over the steps of differences. An error is relative: the length of the error of a
matrix over the length of the matrix. Columns have the norm by which ``harness.truth.quantities.derivatives`` judges them, each taken at
the unit of its coordinate that moves with the kinetic energy of one half joule. A step is best where the median over the states is least.

Growth is that of cost and error over the sizes of a family: of each way of computing accelerations, and of a robot's certified truth. The
robot is a fixed trunk with arms of seven joints each, no two of whose axes are parallel, so that no part of the equations vanishes. Its
equations are written by recursion over the file; a chain of so many bodies would take Lagrange's way an hour.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.bench.costs import MINIMUM_COUNT, Effort, acceleration_costs, cost_of_each, measure, shared_fields
from harness.bench.methods import Method
from harness.crosscheck.assignment import Assignment, load_audited
from harness.crosscheck.scene import Scene
from harness.crosscheck.stages import Truths
from harness.engines import Calls, Model, Subject, load_engine, runs_elsewhere
from harness.library import Library
from harness.programs.states import States
from harness.results.benchmark import DerivativeCost, Growth, QuantityCost
from harness.study import Note
from harness.trees.mechanism import mechanism_of
from harness.trees.robot import read_robot
from harness.truth.compare import Certified, compare
from harness.truth.quantities import Quantity
from harness.truth.quantities.derivatives import FORWARD, INVERSE, DerivativeTruth
from harness.truth.reference import ReferenceKernel
from harness.truth.sampling import generic_sample

# Numbers of states that are asked for at once.
SIZES = (1, 10, 100, 1000, 10_000)
# States at which errors of derivatives are measured, and how often each is timed at least.
STATES, LEAST_COUNT = 32, 3
FAMILY = "chain"
# Where a state costs this many times what the cheapest costs, at most half is the call's own.
HIDDEN_BELOW = 2.0
FEWEST_SIZES = 2
FEWEST_STATES = 64


def quantity_costs(scene: Scene, quantity: Quantity, subjects: Sequence[Subject], effort: Effort, note: Note) -> list[QuantityCost]:
    """Costs of each subject, in their order: one for each number of states that are asked for at once.

    A subject that does not offer the quantity, or that fails, has one entry with the reason as its note.
    """
    mechanism, states = scene.mechanism, effort.states(scene.mechanism)
    truths = Truths(states[: effort.judged])

    def costs(subject: Subject) -> Iterator[dict[str, Any]]:
        assignment = Assignment(scene.library, subject, mechanism, scene.models.get(subject.format), quantity=quantity.name)
        model, truth = load_audited(assignment), assignment.truth
        elsewhere = runs_elsewhere(load_engine(scene.library, subject.engine))
        remark = "times hold the exchange with the process of its environment" if elsewhere else ""
        certified = truths.of(truth)
        for count in effort.counts:
            batch, judged = states[:count], len(certified)
            again = partial(calls_at(truth.asks(model, batch), batch.q), model)
            first = truth.answers(model, batch)
            rest = [truth.answers(model, states[start : min(start + count, judged)]) for start in range(count, judged, count)]
            comparison = compare(certified, np.concatenate([first, *rest])[:judged])
            times = measure(again, MINIMUM_COUNT, effort.minimum_seconds)
            yield {"states": count, **shared_fields(comparison, certified.certified, times, count, remark)}

    def about(subject: Subject) -> dict[str, Any]:
        named = {"system": mechanism.name, "quantity": quantity.name, "method": str(subject)}
        return named | {"states": 0, "seconds_per_state": None}

    return cost_of_each(QuantityCost, subjects, about, costs, note)


def calls_at(asked: Calls, q: Array) -> Callable[[Model], None]:
    """Function that asks a model at positions ``q``, (n, nq), and nothing at others, as at zero for the engine's own frames."""
    calls = [call for call in asked.each if np.array_equal(call.arguments[0], q)]
    # An engine may write into what it is given.
    given = [(call.method, [np.array(one) if isinstance(one, np.ndarray) else one for one in call.arguments]) for call in calls]

    def again(model: Model) -> None:
        for method, arguments in given:
            getattr(model, method)(*arguments)

    return again


@dataclass(frozen=True)
class _Truth:
    """Derivatives that methods of one kind are held against; ``weights``, (n, nv), are of the columns by q and by v."""

    truth: DerivativeTruth
    certified: Certified
    weights: Array

    @classmethod
    def of(cls, scene: Scene, is_inverse: bool, in_body: bool, states: States) -> _Truth:
        truth = DerivativeTruth(INVERSE if is_inverse else FORWARD, scene.mechanism, in_body)
        certified = truth.evaluate(states)
        factor = np.linalg.inv(certified.norm_factor).transpose(0, 2, 1) if is_inverse else certified.norm_factor
        return cls(truth, certified, 1 / np.linalg.norm(factor, axis=1))

    def errors(self, answers: Array) -> Array:
        """Relative errors, (n,), the larger one of both matrices, of answers (n, 2, nv, nv); of states that are certified alone."""
        nv = answers.shape[3]
        columns = np.ascontiguousarray(answers.transpose(0, 1, 3, 2)).reshape(len(answers), 2 * nv, nv)
        high, low = (values[:, : 2 * nv] for values in (self.certified.high, self.certified.low))
        error, size = (self._lengths(values) for values in ((columns - high) - low, high))
        # What is zero, as what friction does where there is none, is no yardstick.
        relative = np.divide(error, size, out=np.zeros_like(error), where=size > 0)
        return np.asarray(relative.max(axis=1)[self.certified.certified])

    def _lengths(self, columns: Array) -> Array:
        """(n, 2) lengths of the matrices by q and by v, whose columns are (n, 2 nv, nv)."""
        lengths = np.linalg.norm(columns @ self.certified.norm_factor.transpose(0, 2, 1), axis=2).reshape(len(columns), 2, -1)
        return np.asarray(np.linalg.norm(lengths * self.weights[:, None], axis=2))


def derivative_costs(scene: Scene, methods: Sequence[Method], effort: Effort, note: Note) -> list[DerivativeCost]:
    """One measurement per method, in their order: errors over the steps, and costs at the best step.

    A method that cannot do the system, or that fails, has an entry with the reason as its note.
    """
    mechanism, states = scene.mechanism, effort.states(scene.mechanism)
    few = states[: effort.judged]
    truths: dict[tuple[bool, bool], _Truth] = {}

    def cost(method: Method) -> Iterator[dict[str, Any]]:
        of = method.is_inverse, method.linear_velocity_in_body and bool(mechanism.charts_in_body)
        if of not in truths:
            truths[of] = _Truth.of(scene, *of, few)
        truth, third = truths[of], truths[of].truth.third(states)
        errors = [truth.errors(method.prepare(scene, few, third[: len(few)], step)()) for step in method.steps or (0.0,)]
        medians = [float(np.median(one)) for one in errors]
        best = int(np.argmin(medians))
        step = method.steps[best] if method.steps else 0.0
        seconds = []
        for count in effort.counts:
            compute = method.prepare(scene, states[:count], third[:count], step)
            seconds.append(float(np.median(measure(compute, LEAST_COUNT, effort.minimum_seconds))) / count)
        yield {
            "steps": list(method.steps),
            "errors": medians,
            "worst_errors": [float(one.max(initial=0.0)) for one in errors],
            "best_step": step or None,
            "error": medians[best],
            "states": list(effort.counts),
            "seconds_per_state": seconds,
        }

    def about(method: Method) -> dict[str, Any]:
        return {"system": mechanism.name, "method": method.name, "of": "tau" if method.is_inverse else "qdd", "loop": method.loop}

    return cost_of_each(DerivativeCost, methods, about, cost, note)


def growth(library: Library, methods: Sequence[Method], sizes: Sequence[int], effort: Effort, note: Note) -> list[Growth]:
    """Cost and error of each method over ``sizes`` of ``FAMILY``, in one process; ``effort`` is for size 1, larger members take less."""
    measured = []
    for size in sizes:
        note(f"{FAMILY}_{size}: derivation")
        scene = Scene.of(library, f"{FAMILY}_{size}")
        count = max(FEWEST_STATES, effort.most // size)
        measured.append(acceleration_costs(scene, methods, replace(effort, counts=(count,), judged=count), note)[0])
        if failed := next((cost for cost in measured[-1] if cost.failed), None):
            raise RuntimeError(f"{failed.method}: {failed.note}")
    return [
        Growth(
            family=FAMILY,
            method=method.name,
            sizes=list(sizes),
            seconds_per_state=[cost.seconds_per_state for cost in costs],
            backward_errors=[cost.backward_error for cost in costs],
            # The noise of a machine only adds, and at a few sizes one outlier would decide.
            exponent=exponent(sizes, [cost.fastest for cost in costs]),
            expected=method.growth,
        )
        for method, costs in zip(methods, zip(*measured, strict=True), strict=True)
    ]


def exponent(sizes: Sequence[int], seconds: Sequence[float | None]) -> float | None:
    """Slope of log seconds over log size by least squares, where the cost of a call no longer hides it.

    Those are the largest sizes at each of which a state costs at least ``HIDDEN_BELOW`` times what it costs
    at the cheapest; None where there are fewer than two.
    """
    known = [(size, cost) for size, cost in zip(sizes, seconds, strict=True) if cost]
    if not known:
        return None
    least = HIDDEN_BELOW * min(cost for _, cost in known)
    hidden = [place for place, (_, cost) in enumerate(known) if cost < least]
    upper = known[hidden[-1] + 1 :] if hidden else known
    if len(upper) < FEWEST_SIZES:
        return None
    logarithms = np.log(np.array(upper))
    return float(np.polyfit(logarithms[:, 0], logarithms[:, 1], 1)[0])


ROBOTS, METHOD = "arms of seven joints", "certified reference of a robot"
JOINTS = 7
# Every body's inertia is added to those below it, and M's entries are formed between all pairs of joints on a way to the trunk.
EXPECTED = "up to 3"
_INERTIAL = """<inertial><origin xyz="0.1 0.02 0.03" rpy="0.1 0.2 0.3"/><mass value="1.5"/>
  <inertia ixx="0.02" iyy="0.03" izz="0.04" ixy="0.001" ixz="0.002" iyz="0.003"/></inertial>"""
_AXES = ("1 0 0", "0 1 0", "0 0 1")


def arms(count: int) -> str:
    """The URDF of ``count`` arms."""
    names = [[f"arm_{arm}_{joint}" for joint in range(JOINTS)] for arm in range(count)]
    links = "".join(f'<link name="{name}">{_INERTIAL}</link>' for arm in names for name in arm)
    joints = "".join(
        f"""<joint name="to_{child}" type="continuous"><parent link="{parent}"/><child link="{child}"/>
        <origin xyz="0.3 0.1 0.{number}" rpy="0.4 0.5 0.6"/><axis xyz="{_AXES[place % 3]}"/></joint>"""
        for number, arm in enumerate(names)
        for place, (parent, child) in enumerate(zip(["trunk", *arm], arm, strict=False))
    )
    return f'<robot name="arms"><link name="trunk"/>{links}{joints}</robot>'


def robot_growth(counts: Sequence[int], seed: int, minimum_seconds: float, note: Callable[[str], None]) -> Growth:
    """Cost per certified state with its data roundoff [s], and largest radius [data roundoffs], of each number of arms."""
    measured: list[tuple[float, float, float | None]] = []
    for count in counts:
        note(f"{count} arms")
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "arms.urdf"
            path.write_text(arms(count))
            reference = ReferenceKernel(mechanism_of(read_robot(path)))
        states = generic_sample(reference.mechanism, FEWEST_STATES, seed)
        times = np.array(measure(partial(reference.evaluate, states), LEAST_COUNT, minimum_seconds)) / len(states)
        found = reference.evaluate(states)
        radius = float((found.radius / found.data_roundoff).max()) if found.certified.all() else None
        measured.append((float(np.median(times)), float(times.min()), radius))
    seconds, fastest, radii = zip(*measured, strict=True)
    sizes = [count * JOINTS for count in counts]
    return Growth(
        family=ROBOTS,
        method=METHOD,
        sizes=sizes,
        seconds_per_state=list(seconds),
        backward_errors=list(radii),
        exponent=exponent(sizes, fastest),
        expected=EXPECTED,
    )
