"""The one number whose other value explains a subject's wrong answers.

A factorisation of an ill-conditioned M loses digits, and accelerations within that are ``unstable``. A wrong number hides there: on a
chain of twelve bars a mass that is off by 1e-10 stays within. But it moves the answers at all states alike; see
``harness.explain.fit``. Of another quantity accelerations may agree all the same: a centre of mass along a fixed axis is felt by a
reaction alone. A number of the file explains its answers that makes them agree at all states.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from harness.crosscheck.assignment import Assignment, acceleration_truth_of, declared_model, load_audited, reference_kernel_of, touches
from harness.crosscheck.solvers import endings_of
from harness.engines import accelerations, gaps_of, load_engine
from harness.engines.request import EngineAnswers, by_joint
from harness.engines.tree_request import asked_joints
from harness.explain.changes.numbers import numeric_changes
from harness.explain.columns import ChangeColumn, Whitening, diagnostic_states, find_columns, parameter_derivatives, watch
from harness.explain.documented import all_judged
from harness.explain.file_case import FileCase
from harness.explain.fit import Projection, explaining_directions
from harness.explain.meant import STATES, Meant, meant, reference_of
from harness.explain.model_side import explaining_numbers
from harness.explain.touching import Touching
from harness.files.text.scan import Watch, tag, written
from harness.programs.states import States
from harness.study import Note
from harness.trees.mechanism import RobotMechanism
from harness.truth.quantities.accelerations import beside_gaps
from harness.truth.reference import Reference

# At rest and moving, of which each state adds six equations a joint; and how many numbers that explain are named.
STATES_OF_QUANTITIES, NAMED = 32, 3


@dataclass(frozen=True)
class Explanation:
    """One number whose other value explains the errors at all states.

    Attributes:
        number: where it stands and what is there, as ``line 18 <inertial mass="1.5">``, or a parameter of the system.
        change: of its value, that the accelerations show. effect, significance: as of ``harness.explain.fit.NumberDirection``.
    """

    number: str
    change: float
    effect: float
    significance: float

    @property
    def sentence(self) -> str:
        return (
            f"One number explains the errors of all states, so that they are no lost digits: {self.number} is too "
            f"{'large' if self.change > 0 else 'small'} by {abs(self.change):.3g}, which moves accelerations by up to "
            f"{self.effect:.3g} data roundoffs ({self.significance:.3g} standard errors)."
        )


def explain(assignment: Assignment, seed: int, worst: States, note: Note) -> str:
    """A sentence on the numbers that explain the subject's errors at the states of a diagnosis and its worst ones; "" where none does.

    Raises:
        InvalidModel: a file is no truth, or the engine refuses it. harness.engines.Unsupported: the engine cannot express it.
    """
    if not assignment.asked.is_default:
        return explain_difference(assignment, seed)
    if assignment.library.reads_files:
        return explain_by_file(assignment, seed, worst)
    found = explain_lost_digits(assignment, seed, worst)
    return "" if found is None else found.sentence


def explain_by_file(assignment: Assignment, seed: int, worst: States) -> str:
    """Cause of the errors that an engine's readings of a user's file leave, at the states of a comparison and the worst ones.

    That is a number of the file by whose other value they are right, or a reading that does not hold, or where they differ; "" where
    digits are lost and no more. Contacts are no numbers of a file: with these on, whether it is right without is said.
    """
    if touches(assignment):
        apart = Assignment.of(replace(assignment.library, touches=False), assignment.system, assignment.subject)
        return explain_by_file(apart, seed, worst) or "it is only with contacts on that it is not what its documentation gives"
    asked, mechanism = assignment.as_read, assignment.mechanism
    assert isinstance(mechanism, RobotMechanism) and isinstance(asked.mechanism, RobotMechanism)
    engine, robot, truth = load_engine(assignment.library, assignment.subject.engine), asked.mechanism.robot, acceleration_truth_of(asked)
    found = meant(mechanism.robot, STATES, seed)
    states = assignment.into(States.concatenate([assignment.truth.asked_at(found.states), worst]))
    # A solver that stops early leaves what has no number of the file for its cause.
    model = next((ended for ended, _, _ in endings_of(asked, load_audited(asked))), load_audited(asked))
    answers, every = truth.answers(model, states), np.ones(len(states), dtype=np.bool_)
    judged = truth.judge(truth.evaluate(states), states, answers, model)
    at = Meant(robot, states, reference_of(robot).evaluate(states))
    acting = all_judged(robot, engine) if assignment.acts else []
    case = FileCase(found, engine, assignment.file_as_read.folded, at, acting, Touching.nowhere(len(states)), every)
    by_name = EngineAnswers(by_joint(asked_joints(robot.tree, robot.joints), answers))
    return "; ".join(case.left(by_name, judged))


def _with_worst(assignment: Assignment, seed: int, worst: States) -> States:
    """The states of a diagnosis, and those that the errors to be explained were found at: the others may feel less of it."""
    return States.concatenate([assignment.truth.asked_at(diagnostic_states(assignment.mechanism, seed)), worst])


def explain_lost_digits(assignment: Assignment, seed: int, worst: States) -> Explanation | None:
    """The number that explains the subject's accelerations; None where none does; raises as ``explain``."""
    mechanism, model = assignment.mechanism, assignment.model
    kernel, states = reference_kernel_of(assignment), _with_worst(assignment, seed, worst)
    reference = kernel.evaluate(states)
    if model is not None:
        reference = beside_gaps(reference, mechanism, states, gaps_of(load_audited(assignment), states))
    whitening = Whitening(reference)
    if model is None:
        residual = whitening.residual(accelerations(load_audited(assignment), states))
        # Those behind the text's own are of what states have of their own.
        slopes = parameter_derivatives(kernel, states, reference, kernel.mechanism.parameter_values)[: len(mechanism.parameters)]
        columns = [np.nan_to_num(whitening.change(slope)) for slope in slopes]

        def number(index: int) -> str:
            name, value, unit = mechanism.parameters[index]
            return f"{name} = {value!r} {unit}".strip()

    else:
        watched = watch(load_engine(assignment.library, assignment.subject.engine), mechanism, model, states)
        residual = whitening.residual(watched.healthy)
        found = written_columns(watched, reference)
        columns = [column.values for column in found]

        def number(index: int) -> str:
            place = found[index].change.place
            return f"line {place.line} {tag(place, written(model.text, model.format, place))}"

    for strongest in explaining_directions([Projection.of(reference, residual, columns)]):
        return Explanation(number(strongest.index), strongest.change, strongest.effect, strongest.significance)
    return None


def written_columns(watched: Watch, reference: Reference) -> list[ChangeColumn]:
    """The columns of the numbers of a model but 0, which says that something is not there and has no digits to be wrong in."""
    return find_columns(watched.accelerations, reference, [one for one in numeric_changes(watched.model) if one.start])


def explain_difference(assignment: Assignment, seed: int) -> str:
    """A sentence on the numbers of the file, each of which makes the subject's answers agree; raises as ``explain``.

    "" for a subject without a file, or where no single number does.
    """
    model = assignment.model
    if model is None:
        return ""
    states = diagnostic_states(assignment.mechanism, seed, STATES_OF_QUANTITIES)
    engine, truth = load_engine(assignment.library, assignment.subject.engine), assignment.truth
    watched = watch(engine, assignment.mechanism, model, states, truth.asks)
    found = []
    for one in explaining_numbers(watched, truth.evaluate(states))[:NAMED]:
        how = f" {one.statement}" if one.statement else ""
        found.append(f"line {one.place.line}: {one.value!r} in the place of {one.place.found} in {one.tag}{how}")
    if not found:
        return ""
    declared = declared_model(assignment.library, assignment.system or assignment.mechanism.name)
    rest = f"; so does {' or '.join(found[1:])}" if found[1:] else ""
    return f"{found[0]} makes the {assignment.quantity} those of the numbers in {declared.path.name}{rest}."
