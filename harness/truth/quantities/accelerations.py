"""Accelerations: one block, whose length is the kinetic-energy norm.

They are those of the equations of a mechanism. *Rigid* truth holds constraints exactly. Where an engine declares that it solves another
problem, in which constraints give by numbers of the model file, its answers are held against that *declared* problem, and how far they
are from rigid is a property of the model.

Beside them stand gaps: what a model's constraints leave open where its system closes them. Where a loop is held on the ground stands in
no Jacobian. So an engine that holds constraints rigid has the right accelerations of a loop that closes elsewhere, until it moves.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from harness.arrays import Array
from harness.engines import Calls, Model, asked_accelerations, asked_accelerations_and_gaps, factorises_mass_matrix, gaps_of
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.numbers import UNIT_ROUNDOFF
from harness.programs.states import States
from harness.results.records import ACCELERATIONS as NAME
from harness.storage import Kept
from harness.trees.mechanism import RobotMechanism
from harness.truth.compare import Comparison, Flags, compare
from harness.truth.quantities import ASKED_ELSEWHERE, Quantity, Truth, TruthBasis
from harness.truth.reference import Reference, ReferenceKernel, asked_at
from harness.verdict import AGREEMENT

if TYPE_CHECKING:
    from harness.truth.far_links import FarLinks

# Weight of a row that data leave no room at all, as where all joints stand at zero: what is open there counts, and zero times it is zero.
_LARGEST = 2.0**900
# The rows of each constraint, (n, rows), by name; none where a model has no constraints, or its engine does not say them.
Gaps = Mapping[str, Array]


def with_gaps(answers: Array, gaps: Gaps, closing: Flags) -> Array:
    """Accelerations of a model, (n, nv), and behind them the rows of all constraints at states that close them, ``closing``, (n,).

    Elsewhere they are zero: there accelerations feel what rows leave, whichever axes an engine has these in.
    """
    return np.hstack([answers, *(rows * closing[:, None] for rows in gaps.values())]) if gaps else answers


def beside_gaps(reference: Reference, mechanism: Mechanism, states: States, gaps: Gaps) -> Reference:
    """The reference of answers with gaps: all rows are zero, and one data roundoff of a constraint counts as one of the accelerations.

    A state that does not close the constraints has no rows to be held against.
    """
    if not gaps:
        return reference
    n, nv = reference.high.shape
    units, counted = _units(mechanism, states, gaps), closing_of(mechanism, states)
    with np.errstate(divide="ignore"):
        counts = {name: counted * np.minimum(reference.data_roundoff / unit, _LARGEST) for name, unit in units.items()}
    weights = np.hstack([np.repeat(counts[name][:, None], rows.shape[1], axis=1) for name, rows in gaps.items()])
    factor = np.zeros((n, nv + weights.shape[1], nv + weights.shape[1]))
    factor[:, :nv, :nv] = reference.norm_factor
    own = np.arange(nv, factor.shape[1])
    factor[:, own, own] = weights
    none = np.zeros_like(weights)
    high, low = (np.hstack([part, none]) for part in (reference.high, reference.low))
    return replace(reference, high=high, low=low, norm_factor=factor)


def remark_on(mechanism: Mechanism, states: States, gaps: Gaps) -> str:
    """A sentence on the constraint that is open by more than data explain, where it is widest; "" where none is."""
    if not gaps:
        return ""
    units, counted = _units(mechanism, states, gaps), closing_of(mechanism, states)
    sizes = {name: counted * np.linalg.norm(rows, axis=1) for name, rows in gaps.items()}
    with np.errstate(divide="ignore", invalid="ignore"):
        largest = {name: float(np.nan_to_num(size / units[name], nan=0.0).max(initial=0.0)) for name, size in sizes.items()}
    name = max(largest, key=lambda name: largest[name])
    if not largest[name] > AGREEMENT:
        return ""
    return f"Constraint {name!r} is open by {sizes[name].max():.3g} where the system closes it ({largest[name]:.3g} data roundoffs)"


def _units(mechanism: Mechanism, states: States, gaps: Gaps) -> dict[str, Array]:
    """The data roundoff of each constraint, (n,), of the length of its rows."""
    constraints = mechanism.constraints
    assert constraints is not None
    # Imported late: a tree needs nothing of it.
    from harness.truth.manifold import rows_left

    _, by_data = rows_left(mechanism, states)
    owners = np.array(constraints.rows[: constraints.holonomic])
    return {name: np.linalg.norm(by_data[:, : constraints.holonomic][:, owners == name], axis=1) for name in gaps}


def closing_of(mechanism: Mechanism, states: States) -> Flags:
    """``harness.truth.manifold.closes``, which a tree does not import."""
    if mechanism.constraints is None:
        return np.ones(len(states), dtype=np.bool_)
    from harness.truth.manifold import closes

    return closes(mechanism, states)


@dataclass(frozen=True, eq=False)
class AccelerationTruth(Truth):
    """Equations, the frame of the linear velocity of free joints, and the precision of whom they judge.

    Attributes:
        linear_velocity_in_body: whether that is the body's frame, not the joint's.
        unit_roundoff: of the numbers that an engine computes with.
        factorises: whether the engine declares that it factorises M.
        far_links: of a user's file, whose engine forms inertias about a point far from its bodies; None of all others.
        rigid: the truth that holds rigid what gives here; None where nothing does, and of a user's file.
        is_of_file: whether what gives is of a user's file.
    """

    mechanism: Mechanism
    linear_velocity_in_body: bool = False
    unit_roundoff: float = UNIT_ROUNDOFF
    factorises: bool = False
    rigid: AccelerationTruth | None = None
    far_links: FarLinks | None = None
    is_of_file: bool = False
    blocks = ()

    @property
    def key(self) -> Hashable:
        """See ``Truth``."""
        return self.mechanism.key, self.linear_velocity_in_body, self.unit_roundoff

    @property
    def kernel(self) -> ReferenceKernel:
        """The certified kernel, compiled once per process."""
        return _KERNELS.get(self.key, lambda: ReferenceKernel(self.mechanism, self.linear_velocity_in_body, self.unit_roundoff))

    @property
    def is_compiled(self) -> bool:
        """See ``Truth``."""
        return self.key in _KERNELS

    def asked_at(self, states: States, share: float = ASKED_ELSEWHERE) -> States:
        """See ``Truth``: a declared truth is asked off the manifold as well, on which its law is hardly felt."""
        if not share or (self.rigid is None and not self.is_of_file):
            return states
        # Imported late: a tree needs nothing of it.
        from harness.truth.declared import DeclaredMechanism
        from harness.truth.displaced import felt, opened, pressed

        assert isinstance(self.mechanism, DeclaredMechanism)
        if self.is_of_file:
            return felt(self.mechanism, states, share)
        if self.mechanism.constraints is not None:
            states = opened(self.mechanism, states, share)
        return states if self.mechanism.bounded is None else pressed(self.mechanism, states, share)

    def evaluate(self, states: States) -> Reference:
        """See ``Truth``."""
        return self.kernel.evaluate(states)

    def asks(self, model: Model, states: States) -> Calls:
        """See ``Truth``."""
        return asked_accelerations(model, self._as_taken(states))

    def may_lose_digits(self, model: Model) -> bool:
        """True if the engine factorises M, or declares it of the model that it has loaded."""
        return self.factorises or factorises_mass_matrix(model)

    def judge(self, certified: Any, states: States, answers: Array, model: Model) -> Comparison:
        """See ``Truth``; what the model's constraints leave open counts beside the accelerations.

        An answer is unstable too where the links of a user's file are too far from one another for what its engine documents.
        """
        return self._judge(certified, states, answers, gaps_of(model, self._as_taken(states)), model)

    def asks_all(self, model: Model, states: States) -> Calls:
        """See ``Truth``: what constraints leave open, too."""
        return asked_accelerations_and_gaps(model, self._as_taken(states))

    def _as_taken(self, states: States) -> States:
        return asked_at(states, self.unit_roundoff, self.mechanism.attitudes)

    def judge_all(self, certified: Any, states: States, found: tuple[Array, Gaps], model: Model) -> Comparison:
        """See ``Truth``."""
        return self._judge(certified, states, *found, model)

    def _judge(self, certified: Any, states: States, answers: Array, gaps: Gaps, model: Model) -> Comparison:
        states = self._as_taken(states)
        found = compare(beside_gaps(certified, self._own, states, gaps), np.hstack([answers, *gaps.values()]), self.may_lose_digits(model))
        return found if self.far_links is None else self.far_links.excused(found, certified, states, answers)

    def describe(self, certified: Any, states: States, answers: Array, model: Model) -> str:
        """See ``Truth``: the constraint that is open by more than data explain, where one is."""
        states = self._as_taken(states)
        return remark_on(self._own, states, gaps_of(model, states))

    @property
    def _own(self) -> Mechanism:
        return self.mechanism if self.rigid is None else self.rigid.mechanism


def with_all(mechanism: Mechanism) -> Mechanism:
    """The mechanism with its actuators, and with rigid dry friction and limits, where it has some."""
    mechanism = _driven(mechanism)
    if mechanism.bounded is None:
        return mechanism
    # Imported late: a smooth mechanism needs nothing of it.
    from harness.truth.optimum import held_rigid

    return held_rigid(mechanism)


def _driven(mechanism: Mechanism) -> Mechanism:
    if mechanism.driving is None:
        return mechanism
    from harness.programs.mechanisms.driven import driven

    return driven(mechanism)


def reference_kernel(mechanism: Mechanism, linear_velocity_in_body: bool) -> ReferenceKernel:
    """The certified kernel of a mechanism's own equations, compiled once per process."""
    return AccelerationTruth(mechanism, linear_velocity_in_body and bool(mechanism.charts_in_body)).kernel


def _truth(basis: TruthBasis) -> AccelerationTruth:
    about = basis.linear_velocity_in_body, basis.unit_roundoff, basis.factorises
    mechanism, far_links = basis.mechanism, None
    if basis.inertias_about and isinstance(mechanism, RobotMechanism):
        # Imported late: a mechanism with equations needs nothing of it.
        from harness.truth.far_links import FarLinks

        of_engine = basis.inertias_about, basis.unit_roundoff
        far_links = _FAR_LINKS.get((mechanism.key, *of_engine), lambda: FarLinks(mechanism.robot, *of_engine))
    if basis.softened is None:
        return AccelerationTruth(with_all(mechanism), *about, far_links=far_links)
    soft, is_of_file = basis.softened(_driven(mechanism)), isinstance(mechanism, RobotMechanism)
    # Of a user's file nobody says that its constraints are meant to be rigid.
    rigid = None if is_of_file else AccelerationTruth(with_all(mechanism), *about)
    return AccelerationTruth(soft, *about, rigid, far_links, is_of_file)


_KERNELS: Kept[ReferenceKernel] = Kept(64)
_FAR_LINKS: Kept[FarLinks] = Kept(64)
ACCELERATIONS = Quantity(
    NAME, _truth, is_of_file=False, has_laws=True, is_default=True, is_quick=False, takes_all=True, is_asked_again=True
)
