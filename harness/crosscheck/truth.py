"""What the answers of a subject are held against: the equations of its mechanism, or of one whose constraints give by a declared law.

``rigid`` truth holds constraints exactly. An engine may document that it solves another problem, in which constraints give by numbers
of the model file. Its answers are held against that *declared* problem, and how far they are from rigid is a property of the model.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace

from harness.certify.reference import ReferenceKernel
from harness.equations.constraint_forces import Softness, softened_program
from harness.equations.mechanism import Mechanism
from harness.storage import Kept


@dataclass(frozen=True, eq=False)
class Truth:
    """Equations, and the frame of the linear velocity of free joints; equal where the equations are.

    Attributes:
        linear_velocity_in_body: whether that is the body's frame, not the joint's.
        is_declared: whether constraints give by a law of the model file.
    """

    mechanism: Mechanism
    linear_velocity_in_body: bool = False
    is_declared: bool = False

    @property
    def key(self) -> Hashable:
        return self.mechanism.key, self.linear_velocity_in_body

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Truth) and self.key == other.key

    def __hash__(self) -> int:
        return hash(self.key)

    @property
    def kernel(self) -> ReferenceKernel:
        """The certified kernel, compiled once per process."""
        return _KERNELS.get(self.key, lambda: ReferenceKernel(self.mechanism, self.linear_velocity_in_body))

    @property
    def is_known(self) -> bool:
        """True if this process has compiled the kernel."""
        return self.key in _KERNELS


def reference_kernel(mechanism: Mechanism, linear_velocity_in_body: bool) -> ReferenceKernel:
    """The certified kernel of a mechanism's own equations, compiled once per process."""
    return Truth(mechanism, linear_velocity_in_body and bool(mechanism.charts_in_body)).kernel


def softened(mechanism: Mechanism, rows: Sequence[Softness]) -> Mechanism:
    """The mechanism whose constraints give by ``rows``, one law for each row, whose numbers are its last parameters."""

    def write() -> Mechanism:
        assert mechanism.constraints is not None
        program, numbers = softened_program(mechanism.constraints, rows)
        return replace(mechanism, program=program, parameters=(*mechanism.parameters, *((name, value, "") for name, value in numbers)))

    return _SOFTENED.get((mechanism.key, tuple(rows)), write)


_KERNELS: Kept[ReferenceKernel] = Kept(64)
_SOFTENED: Kept[Mechanism] = Kept(64)
