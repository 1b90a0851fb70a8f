"""A system after its derivation, as plain data: what every later stage needs, without SymPy."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from harness.kernels import Array
from harness.program import StraightLineProgram, check_lists
from harness.states import States


@dataclass(frozen=True, kw_only=True)
class Mechanism:
    """One derived system.

    Attributes:
        name: file stem of the system, and of its models.
        description, source: from the system file's docstring.
        coordinates, joints: names of the nv coordinates and of the joints that carry them.
        parameters: (name, value, unit) in the program's input order.
        gravity: acceleration of gravity [m/s^2] along -z; 0 where the mechanism feels none.
        total_mass: sum of all moving masses [kg].
        rotating: for each coordinate, whether it is an angle.
        position_ranges, rate_ranges: (lowest, highest) per coordinate; None for an unbounded angle.
        force_ranges: (lowest, highest) applied force per coordinate [N or N m].
        program: the equations of motion; see ``harness.kernels`` for its inputs and outputs.
        equations_text, equations_mathml: the equations for people.
        derivation_seconds: what deriving and assembling them cost.
    """

    name: str
    description: str
    source: str
    coordinates: tuple[str, ...]
    joints: tuple[str, ...]
    parameters: tuple[tuple[str, float, str], ...]
    gravity: float
    total_mass: float
    rotating: tuple[bool, ...]
    position_ranges: tuple[tuple[float, float] | None, ...]
    rate_ranges: tuple[tuple[float, float], ...]
    force_ranges: tuple[tuple[float, float], ...]
    program: StraightLineProgram
    equations_text: str
    equations_mathml: str
    derivation_seconds: float

    @property
    def nv(self) -> int:
        """Degrees of freedom."""
        return len(self.coordinates)

    @property
    def parameter_values(self) -> tuple[float, ...]:
        return tuple(value for _, value, _ in self.parameters)

    @property
    def key(self) -> Hashable:
        """Equal for mechanisms with equal equations, joints and parameter values."""
        outputs = tuple(sorted((name, tuple(indices)) for name, indices in self.program.outputs.items()))
        return self.name, self.joints, self.parameters, self.gravity, self.total_mass, self.program.instructions, outputs

    def inputs(self, states: States) -> Array:
        """The program's inputs at ``states``, (number of inputs, n), one column a state."""
        values = np.array(self.parameter_values)[:, None]
        return np.ascontiguousarray(
            np.vstack([states.q.T, states.v.T, states.tau.T, states.time[None, :], np.broadcast_to(values, (len(values), len(states)))])
        )

    def to_json(self) -> dict[str, Any]:
        """A JSON object that ``from_json`` turns back into an equal mechanism."""
        return {**vars(self), "program": self.program.to_json()}

    @classmethod
    def from_json(cls, data: Mapping[str, Any]) -> Mechanism:
        """Read a mechanism back, trusting nothing in it.

        Raises:
            ValueError: a part is missing, of another type or contradicts the others.
        """
        try:
            check_lists(data, ("coordinates", "joints", "parameters", "rotating", "position_ranges", "rate_ranges", "force_ranges"))
            mechanism = cls(
                **{
                    **data,
                    "coordinates": tuple(data["coordinates"]),
                    "joints": tuple(data["joints"]),
                    "parameters": tuple((name, float(value), unit) for name, value, unit in data["parameters"]),
                    "rotating": tuple(bool(angle) for angle in data["rotating"]),
                    "position_ranges": tuple(
                        bounds if bounds is None else (float(bounds[0]), float(bounds[1])) for bounds in data["position_ranges"]
                    ),
                    "rate_ranges": tuple((float(low), float(high)) for low, high in data["rate_ranges"]),
                    "force_ranges": tuple((float(low), float(high)) for low, high in data["force_ranges"]),
                    "program": StraightLineProgram.from_json(data["program"]),
                }
            )
        except (TypeError, KeyError, IndexError, OverflowError) as error:
            raise ValueError(f"not a mechanism: {error!r}") from error
        texts = [mechanism.name, mechanism.description, mechanism.source, mechanism.equations_text, mechanism.equations_mathml]
        texts += [text for name, _, unit in mechanism.parameters for text in (name, unit)]
        if not all(isinstance(text, str) for text in (*texts, *mechanism.coordinates, *mechanism.joints)):
            raise ValueError("a name or text of the mechanism is not a string")
        if not all(type(number) in (int, float) for number in (mechanism.gravity, mechanism.total_mass, mechanism.derivation_seconds)):
            raise ValueError("gravity, total_mass or derivation_seconds is not a number")
        nv = mechanism.nv
        per_coordinate = ("joints", "rotating", "position_ranges", "rate_ranges", "force_ranges")
        if any(len(getattr(mechanism, name)) != nv for name in per_coordinate):
            raise ValueError("joints or ranges do not fit the coordinates")
        sizes = {name: len(mechanism.program.outputs.get(name, ())) for name in ("velocity", "gravity", "passive")}
        if set(sizes.values()) != {nv} or len(mechanism.program.outputs.get("mass", ())) != nv * (nv + 1) // 2:
            raise ValueError("the program's outputs do not fit the coordinates")
        if len(mechanism.program.inputs) != 3 * nv + 1 + len(mechanism.parameters):
            raise ValueError("the program's inputs do not fit coordinates and parameters")
        return mechanism
