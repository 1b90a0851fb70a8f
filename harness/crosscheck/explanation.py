"""What a subject's lost digits come from: the conditioning of M, or one number that it reads otherwise than the system says.

A factorisation of an ill-conditioned M loses digits, and an answer within that is ``unstable``. A wrong number hides there:
on a chain of twelve bars a mass that is off by 1e-10 stays within. But it moves the answers at all states alike; see
``harness.certify.one_number``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from harness.certify.gaps import beside_gaps, gaps_of
from harness.certify.one_number import Projection, explaining_directions
from harness.certify.parameter_columns import parameter_derivatives
from harness.certify.reference import Reference
from harness.crosscheck.assignment import Assignment, load_audited, reference_kernel_of
from harness.crosscheck.perturbation import Column, Whitening, diagnostic_states, find_columns, numeric_candidates, watch
from harness.crosscheck.tasks import Note
from harness.engines import accelerations, load_engine
from harness.models.text import Watch, tag, written


@dataclass(frozen=True)
class Explanation:
    """One number whose other value explains the errors at all states.

    Attributes:
        number: where it stands and what is there, as ``line 18 <inertial mass="1.5">``, or a parameter of the system.
        change: of its value, that the accelerations show. effect, significance: as of ``harness.certify.one_number.Direction``.
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


def written_columns(watched: Watch, reference: Reference) -> list[Column]:
    """The columns of the numbers of a model but 0, which says that something is not there and has no digits to be wrong in."""
    return find_columns(watched.accelerations, reference, [one for one in numeric_candidates(watched.model) if one.start])


def explain(assignment: Assignment, seed: int, note: Note) -> Explanation | None:
    """The number that explains the subject's errors at the states of a diagnosis; None where none does.

    Raises:
        InvalidModel: the engine refuses the model. harness.engines.Unsupported: the engine cannot express it.
    """
    mechanism, model = assignment.mechanism, assignment.model
    kernel, states = reference_kernel_of(assignment), diagnostic_states(mechanism, seed)
    reference = kernel.evaluate(states)
    if model is not None:
        reference = beside_gaps(reference, mechanism, states, gaps_of(load_audited(assignment), states))
    whitening = Whitening(reference)
    if model is None:
        residual = whitening.residual(accelerations(load_audited(assignment), states))
        slopes = parameter_derivatives(kernel, states, reference, mechanism.parameter_values)
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
            place = found[index].candidate.place
            return f"line {place.line} {tag(place, written(model.text, model.format, place))}"

    for strongest in explaining_directions([Projection.of(reference, residual, columns)]):
        return Explanation(number(strongest.index), strongest.change, strongest.effect, strongest.significance)
    return None
