"""Accelerations: one block, whose length is the kinetic-energy norm.

They are those of the equations of a mechanism. *Rigid* truth holds constraints exactly. Where an engine declares that it solves another
problem, in which constraints give by numbers of the model file, the *declared* truth is that of ``harness.certify.softness``.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.certify.compare import Comparison, compare
from harness.certify.far_links import FarLinks
from harness.certify.gaps import beside_gaps, gaps_of, remark_on, with_gaps
from harness.certify.numbers import UNIT_ROUNDOFF
from harness.certify.quantities import Quantity, Question, Truth
from harness.certify.reference import Reference, ReferenceKernel
from harness.engines import Model, accelerations, factorises_mass_matrix
from harness.equations.mechanism import Mechanism
from harness.equations.states import States
from harness.results.records import ACCELERATIONS as NAME
from harness.robots.mechanism import RobotMechanism
from harness.storage import Kept
from harness.verdict import Verdict


@dataclass(frozen=True, eq=False)
class AccelerationTruth(Truth):
    """Equations, the frame of the linear velocity of free joints, and the precision of whom they judge; equal where these are.

    Attributes:
        linear_velocity_in_body: whether that is the body's frame, not the joint's.
        unit_roundoff: of the numbers that an engine computes with.
        factorises: whether the engine declares that it factorises M.
        far_links: of a user's file, whose engine forms inertias about the centre of a whole tree; None of all others.
        rigid: the truth that holds rigid what gives here; None where nothing does.
    """

    mechanism: Mechanism
    linear_velocity_in_body: bool = False
    unit_roundoff: float = UNIT_ROUNDOFF
    factorises: bool = False
    rigid: AccelerationTruth | None = None
    far_links: FarLinks | None = None
    blocks = ()

    @property
    def key(self) -> Hashable:
        """See ``Truth``."""
        return self.mechanism.key, self.linear_velocity_in_body, self.unit_roundoff

    def __eq__(self, other: object) -> bool:
        return isinstance(other, AccelerationTruth) and self.key == other.key

    def __hash__(self) -> int:
        return hash(self.key)

    @property
    def kernel(self) -> ReferenceKernel:
        """The certified kernel, compiled once per process."""
        return _KERNELS.get(self.key, lambda: ReferenceKernel(self.mechanism, self.linear_velocity_in_body, self.unit_roundoff))

    @property
    def is_compiled(self) -> bool:
        """See ``Truth``."""
        return self.key in _KERNELS

    def evaluate(self, states: States) -> Reference:
        """See ``Truth``."""
        return self.kernel.evaluate(states)

    def answers(self, model: Model, states: States) -> Array:
        """See ``Truth``."""
        return accelerations(model, states)

    def may_lose_digits(self, model: Model) -> bool:
        """True if the engine factorises M, or declares it of the model that it has loaded."""
        return self.factorises or factorises_mass_matrix(model)

    def judge(self, certified: Any, states: States, answers: Array, model: Model) -> Comparison:
        """See ``Truth``; what the model's constraints leave open counts beside the accelerations.

        An answer is unstable too where the links of a user's file are too far from one another for what its engine documents.
        """
        gaps = gaps_of(model, states)
        found = compare(beside_gaps(certified, self._own, states, gaps), with_gaps(answers, gaps), self.may_lose_digits(model))
        disagree = found.verdicts == Verdict.DISAGREES.value
        if self.far_links is None or not disagree.any():
            return found
        lost = disagree & self.far_links.explain(certified, states, answers)
        return replace(found, verdicts=np.where(lost, Verdict.UNSTABLE.value, found.verdicts))

    def describe(self, certified: Any, states: States, answers: Array, model: Model) -> str:
        """See ``Truth``: the constraint that is open by more than data explain, where one is."""
        return remark_on(self._own, states, gaps_of(model, states))

    @property
    def _own(self) -> Mechanism:
        return self.mechanism if self.rigid is None else self.rigid.mechanism


def reference_kernel(mechanism: Mechanism, linear_velocity_in_body: bool) -> ReferenceKernel:
    """The certified kernel of a mechanism's own equations, compiled once per process."""
    return AccelerationTruth(mechanism, linear_velocity_in_body and bool(mechanism.charts_in_body)).kernel


def _truth(question: Question) -> AccelerationTruth:
    about = question.linear_velocity_in_body, question.unit_roundoff, question.factorises
    mechanism, far_links = question.mechanism, None
    if question.is_about_tree and isinstance(mechanism, RobotMechanism):
        far_links = _FAR_LINKS.get(mechanism.key, lambda: FarLinks(mechanism.robot))
    rigid = AccelerationTruth(mechanism, *about, far_links=far_links)
    return rigid if question.softened is None else AccelerationTruth(question.softened(question.mechanism), *about, rigid)


_KERNELS: Kept[ReferenceKernel] = Kept(64)
_FAR_LINKS: Kept[FarLinks] = Kept(64)
ACCELERATIONS = Quantity(
    NAME, _truth, is_of_file=False, has_laws=True, is_default=True, is_quick=False, is_searched=True, is_asked_again=True
)
