"""A program of three lines in an engine's own Python API that prints what it answers beside the certified value.

It holds the model, so that it can be pasted into the engine's issue tracker, and needs nothing but the engine.
The engine's file writes it, by a method ``reproducer`` of its model; see ``Reproducible``.
"""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from harness.arrays import Array
from harness.crosscheck.assignment import Assignment, load_audited, reference_kernel_of
from harness.files.text.scan import compact
from harness.programs.states import States


@runtime_checkable
class Reproducible(Protocol):
    """The method of an engine's model where its answers can be reproduced without the harness."""

    def reproducer(self, source: str, q: Array, v: Array, tau: Array, certified: Array) -> str:
        """Python text that prints two lines: the engine's accelerations, then ``certified``, as lists in the engine's order.

        ``source`` is a Python expression for the text of the model. q of shape (nq,), v, tau and certified (nv,) [SI] are in the
        order of the joints given to ``load``.
        """


def reproduce(assignment: Assignment, state: States) -> str:
    """The program for one state; "" where the subject's engine offers none, and for what are no accelerations.

    Raises:
        InvalidModel: as ``harness.crosscheck.assignment.load_audited``.
    """
    if not assignment.asked.is_default:
        return ""
    model = load_audited(assignment)
    if not isinstance(model, Reproducible) or assignment.model is None:
        return ""
    certified = reference_kernel_of(assignment).evaluate(state).high[0]
    return model.reproducer(repr(compact(assignment.model.text)), state.q[0], state.v[0], state.tau[0], certified)
