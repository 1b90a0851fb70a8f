"""The derivatives of forward and inverse dynamics, by q, v and what is given besides.

The truth comes from the energies: derivatives of the mechanism's own program, see
``harness.programs.mechanisms.dynamics_derivatives``, which says
along what positions move. No file and no engine takes part in it.

A block is a column: what one coordinate, velocity or force does to all accelerations, or to all forces. Its length is the
kinetic-energy norm |x|_M of accelerations, and |x| in the inverse of M of forces, in which metres and radians are comparable, as they are
where accelerations are judged. Columns have units of their own, so that each is judged by itself: in a norm of the whole matrix what
radians do would hide behind what metres do.

Derivatives of inverse dynamics are asked for at the accelerations that tau causes.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Hashable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.engines import Call, Calls, Model, NotOffered
from harness.engines.coordinates import rotations
from harness.programs.evaluation import values
from harness.programs.mechanisms.dynamics_derivatives import (
    forward_dynamics_derivatives,
    inverse_dynamics_derivatives,
    sizes_of_parts,
    terms_of_forces,
)
from harness.programs.mechanisms.kernel import Charts
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.program import StraightLineProgram
from harness.programs.states import States
from harness.truth.blocks import QuantityKernel
from harness.truth.compare import Certified, compare, farthest_block, in_order
from harness.truth.quantities import Quantity, Truth, TruthBasis
from harness.truth.reference import Reference, ReferenceKernel
from harness.verdict import Verdict


@dataclass(frozen=True)
class Dynamics:
    """One of the two maps whose derivatives are taken.

    Attributes:
        method: of the engine's model. given, result: what it takes beside q and v, and what it gives, as a report names them.
        write: the program of the derivatives of a chart.
    """

    method: str
    given: str
    result: str
    write: Callable[[Mechanism, StraightLineProgram, bool], StraightLineProgram]

    @property
    def is_inverse(self) -> bool:
        """True where accelerations are given."""
        return self.given == "a"


FORWARD = Dynamics("forward_dynamics_derivatives", "tau", "qdd", forward_dynamics_derivatives)
INVERSE = Dynamics("inverse_dynamics_derivatives", "a", "tau", inverse_dynamics_derivatives)


class DerivativeTruth(Truth):
    """The certified derivatives of one mechanism, whose velocities are those of engines of one convention.

    Raises:
        NotOffered: constraints tie the coordinates.
    """

    def __init__(self, dynamics: Dynamics, mechanism: Mechanism, linear_velocity_in_body: bool) -> None:
        if mechanism.constraints is not None:
            raise NotOffered("its constraints tie the joints: no derivative along one of them alone is of a motion that they allow")
        self.dynamics, self.mechanism, self.in_body = dynamics, mechanism, linear_velocity_in_body
        self.nv = mechanism.nv
        self.rows = list(coordinate_names(mechanism))
        self.parts = f"d({dynamics.result})/d(q)", f"d({dynamics.result})/d(v)", f"d({dynamics.result})/d({dynamics.given})"
        self.blocks = [f"column of {part} for {name}" for part in self.parts for name in self.rows]
        self._charts = Charts(mechanism.charts(linear_velocity_in_body))
        self._reference = ReferenceKernel(mechanism, linear_velocity_in_body)

    @property
    def key(self) -> Hashable:
        """See ``Truth``."""
        return self.dynamics.method, self.mechanism.key, self.in_body

    def evaluate(self, states: States) -> Certified:
        """Columns by q, v and the third vector, (n, 3 nv, nv)."""
        reference = self._reference.evaluate(states)
        third = reference.high if self.dynamics.is_inverse else states.tau
        factor, inputs = self._factor(reference), self._inputs(states, third)
        split = self._charts.split(states.q)
        found = in_order((self._kernels[chart].evaluate(inputs[some], norm_factor=factor[some]), some) for chart, some in split)
        return replace(found, certified=found.certified & reference.certified)

    def third(self, states: States) -> Array:
        """The third argument beside q and v, (n, nv): the applied forces, or the accelerations that they cause."""
        return self._reference.evaluate(states).high if self.dynamics.is_inverse else states.tau

    def asks(self, model: Model, states: States) -> Calls:
        """See ``Truth``."""

        def formed(answers: Sequence[Array]) -> Array:
            return np.ascontiguousarray(answers[0].transpose(0, 1, 3, 2).reshape(len(states), -1, self.nv))

        time = (states.time,) if getattr(model, "takes_time", False) else ()
        arguments = states.q, states.v, self.third(states), *time
        return Calls((Call(self.dynamics.method, arguments, (len(states), 3, self.nv, self.nv)),), formed)

    def describe(self, certified: Certified, states: States, answers: Array, model: Model) -> str:
        """The column and the row that are farthest off, and the mistake that explains all that disagrees, where one does."""
        block, nv = farthest_block(certified, answers), self.nv
        # Each component at the length that it has alone.
        errors = np.abs(certified.errors(answers)[:, block]) * np.linalg.norm(certified.norm_factor, axis=1)
        row = int(np.nan_to_num(errors[certified.certified]).max(axis=0).argmax())
        said = f"Farthest off is the {self.blocks[block]}, in the row of {self.rows[row]}"
        for mistake in MISTAKES:
            for name, undone in mistake(self, states, answers.reshape(len(answers), 3, nv, nv)):
                verdicts = compare(certified, undone.reshape(answers.shape)).verdicts[certified.certified]
                if (verdicts == Verdict.AGREES.value).all():
                    return f"{said}. {name}"
        return said

    def of_terms(self, states: States) -> dict[str, Array]:
        """Part of each term of the forces in the blocks, in float64, by its name; see ``terms_of_forces``."""
        reference, nv = self._reference.evaluate(states), self.nv
        inputs, found = self._inputs(states, reference.high), dict[str, Array]()
        factor = self._factor(reference)
        # Of forward dynamics, -M^-1 times the derivatives of the forces.
        inverse = np.linalg.inv(factor)
        solved = np.broadcast_to(np.eye(nv), inverse.shape) if self.dynamics.is_inverse else -inverse @ inverse.transpose(0, 2, 1)
        for chart, chosen in self._charts.split(states.q):
            program = terms_of_forces(self.mechanism, self._charts.programs[chart], self.in_body)
            for name, entries in values(program, np.ascontiguousarray(inputs[chosen].T)).items():
                columns = found.setdefault(name, np.zeros((len(states), 3 * nv, nv)))
                columns[chosen, : 2 * nv] = entries.T.reshape(-1, 2 * nv, nv) @ solved[chosen].transpose(0, 2, 1)
        return found

    @cached_property
    def _kernels(self) -> dict[int, QuantityKernel]:
        nv = self.nv
        blocks = np.arange(3 * nv * nv).reshape(3 * nv, nv).tolist()
        found: dict[int, QuantityKernel] = {}
        for chart, program in enumerate(self._charts.programs):
            sizes = sizes_of_parts(self.mechanism, program, self.in_body, of_accelerations=self.dynamics.is_inverse)
            found[chart] = QuantityKernel(self.dynamics.write(self.mechanism, program, self.in_body), blocks, sizes=sizes)
        return found

    def _factor(self, reference: Reference) -> Array:
        """The factor of the norm of a column, (n, nv, nv)."""
        factor = np.where(reference.certified[:, None, None], reference.norm_factor, np.eye(self.nv))
        return np.ascontiguousarray(np.linalg.inv(factor).transpose(0, 2, 1)) if self.dynamics.is_inverse else factor

    def _inputs(self, states: States, third: Array) -> Array:
        """Inputs of the programs, (n, inputs)."""
        return np.ascontiguousarray(self.mechanism.inputs(replace(states, tau=third)).T)


def coordinate_names(mechanism: Mechanism) -> Iterator[str]:
    """Name of each velocity: its joint, with the number of the velocity where the joint has several."""
    for place, joint in enumerate(mechanism.joints):
        several = mechanism.joints.count(joint) > 1
        yield f"joint {joint!r}" + (f", velocity {place - mechanism.joints.index(joint) + 1}" if several else "")


# Mistakes that an engine may make of derivatives.

# What the derivatives are by, in the order of the answers; the third is what is given beside q and v.
_BY_POSITION, _BY_VELOCITY = 0, 1
# The answers, (n, 3, nv, nv) by column and row, without a mistake, and what the mistake is.
Undone = Iterator[tuple[str, Array]]


def _with(matrices: Array, place: Any, other: Array) -> Array:
    changed = matrices.copy()
    changed[place] = other
    return changed


def _transposed(truth: DerivativeTruth, states: States, matrices: Array) -> Undone:
    for part, name in enumerate(truth.parts):
        yield f"{name} is transposed", _with(matrices, np.s_[:, part], matrices[:, part].transpose(0, 2, 1))
    yield "All matrices are transposed", matrices.transpose(0, 1, 3, 2)


def _signs(truth: DerivativeTruth, states: States, matrices: Array) -> Undone:
    parts = {name: np.s_[:, part] for part, name in enumerate(truth.parts)}
    columns = {f"The {name}": np.s_[:, block // truth.nv, block % truth.nv] for block, name in enumerate(truth.blocks)}
    for name, place in (parts | columns).items():
        yield f"{name} has the other sign", _with(matrices, place, -matrices[place])


def _terms(truth: DerivativeTruth, states: States, matrices: Array) -> Undone:
    ways = {"is missing": 1.0, "has the other sign": 2.0, "stands there twice": -1.0}
    terms = {name: columns.reshape(matrices.shape) for name, columns in truth.of_terms(states).items()}
    wholes = {f"In {truth.parts[part]} the": np.s_[:, part] for part in (_BY_POSITION, _BY_VELOCITY)} | {"The": np.s_[:]}
    blocks = enumerate(truth.blocks[: 2 * truth.nv])
    columns = {f"In the {name} the": np.s_[:, block // truth.nv, block % truth.nv] for block, name in blocks}
    for places in (wholes, columns):
        for (term, changes), (what, times) in itertools.product(terms.items(), ways.items()):
            for where, place in places.items():
                changed = _with(matrices, place, matrices[place] + times * changes[place])
                yield f"{where} derivative of the {term} {what}", changed


def _tangents(truth: DerivativeTruth, states: States, matrices: Array) -> Undone:
    mechanism = truth.mechanism
    for number, first in enumerate(mechanism.attitudes):
        quaternions, place = states.q[:, first + number :][:, :4], np.s_[:, _BY_POSITION, first : first + 3]
        turn = rotations(quaternions / np.linalg.norm(quaternions, axis=1)[:, None])
        same = np.broadcast_to(np.eye(3), turn.shape)
        ways = {
            "about the axes of its parent": turn.transpose(0, 2, 1),
            "by half its angle": 2.0 * same,
            "by twice its angle": 0.5 * same,
        }
        for name, matrix in ways.items():
            # Each of three columns is the sum of all three times a row of the matrix.
            undone = _with(matrices, place, matrix @ matrices[place])
            yield f"{truth.parts[_BY_POSITION]} turns joint {mechanism.joints[first]!r} {name}", undone


# Each gives the ways in which it may have been made, with the answers without it. Where these agree with the certified derivatives at all
# states, within the data roundoffs that an answer has, the mistake is named.
MISTAKES: tuple[Callable[[DerivativeTruth, States, Array], Undone], ...] = (_transposed, _signs, _terms, _tangents)


def _quantity(dynamics: Dynamics) -> Quantity:
    def truth(basis: TruthBasis) -> DerivativeTruth:
        return DerivativeTruth(dynamics, basis.mechanism, basis.linear_velocity_in_body)

    # To write and to compile a program takes seconds, whatever the number of states.
    return Quantity(dynamics.method, truth, is_quick=False, group="derivatives")


FORWARD_DYNAMICS_DERIVATIVES, INVERSE_DYNAMICS_DERIVATIVES = _quantity(FORWARD), _quantity(INVERSE)
