"""An actuator as a system file declares it: a force along a length, which a control drives."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass

import sympy as sp
from sympy.core.function import AppliedUndef
from sympy.physics.mechanics import dynamicsymbols

Range = tuple[sp.Symbol, sp.Symbol]


@dataclass(frozen=True, kw_only=True)
class Actuator:
    """A motor, a servo, or a muscle that pulls a tendon.

    Attributes:
        control: the symbol of its control, which is an input beside the applied forces and has no value among the parameters.
        force: along the length that it drives [N or N m], linear in the control: an expression of the joints' positions, rates, parameters.
        moments: coordinate to its moment arm, by which the force acts on its joint: the derivative of the length by the joint's position,
            as the ratio of a gear.
        control_range, force_range: the parameters (lowest, highest) in which control and force are held; None where nothing holds them.

    Source: Spong, Hutchinson, Vidyasagar, Robot Modeling and Control, chapter 6 (motors, gears and servos at the joints).
    """

    control: sp.Symbol
    force: sp.Expr
    moments: Mapping[sp.Expr, sp.Expr]
    control_range: Range | None = None
    force_range: Range | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "force", sp.sympify(self.force))
        object.__setattr__(self, "moments", {q: sp.sympify(arm) for q, arm in self.moments.items()})

    @property
    def gain(self) -> sp.Expr:
        """The force per unit of control."""
        return sp.diff(self.force, self.control)

    @property
    def bias(self) -> sp.Expr:
        """The force at a control of zero."""
        return self.force.subs(self.control, 0)

    @property
    def ranges(self) -> tuple[Range, ...]:
        """Those that hold something."""
        return tuple(bounds for bounds in (self.control_range, self.force_range) if bounds is not None)

    @property
    def symbols(self) -> set[sp.Basic]:
        """The symbols in its law, its control aside."""
        own = sp.Tuple(self.force, *self.moments.values(), *(bound for bounds in self.ranges for bound in bounds))
        return set(own.free_symbols) - {self.control}

    def contradictions(
        self, coordinates: Collection[sp.Expr], rates: Collection[sp.Expr], parameters: Mapping[sp.Symbol, tuple[float, str]]
    ) -> Iterator[str]:
        """Contradictions of the declaration, over the coordinates, rates and parameters of a system."""
        if not isinstance(self.control, sp.Symbol) or self.control in parameters:
            yield f"has the control {self.control}; expected a symbol that is no parameter"
        if self.gain == 0 or self.control in self.gain.free_symbols:
            yield f"has the force {self.force}; expected an expression linear in its control {self.control}"
        yield from (f"acts on {q}, which is no coordinate" for q in self.moments if q not in coordinates)
        if not self.moments:
            yield "acts on nothing; expected {coordinate: moment arm}"
        strange = sorted(self.symbols - {*parameters, dynamicsymbols._t}, key=str)
        yield from (f"contains {symbol}, which has no value; add it to parameters" for symbol in strange)
        functions = sp.Tuple(self.force, *self.moments.values()).atoms(sp.Derivative, AppliedUndef)
        yield from (f"contains {one}; expected coordinates and their first rates" for one in functions - {*coordinates, *rates})
        for low, high in self.ranges:
            if {low, high} <= {*parameters} and not parameters[low][0] < parameters[high][0]:
                yield f"has the range {parameters[low][0]:g} to {parameters[high][0]:g}; expected the lowest first"
