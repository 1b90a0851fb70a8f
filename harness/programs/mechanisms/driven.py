"""A mechanism with the forces of its actuators, at the controls of each state.

A control, or a force, that a range holds is ``share`` times what it would be, and each bound once where a state lies beyond it. These are
numbers that each state has of its own, as of the actuators of a file (``harness.trees.actuators``).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from harness.programs.mechanisms.actuation import Actuation
from harness.programs.mechanisms.clamps import Clamp
from harness.programs.mechanisms.constraint_forces import by_multipliers, constrained_program
from harness.programs.mechanisms.mechanism import BIAS, GAIN, MOMENTS, Driving, Mechanism
from harness.programs.mechanisms.zones import Zones
from harness.programs.program import StraightLineProgram, without_unused
from harness.programs.terms import Builder, Term, vector
from harness.storage import Kept

_DRIVEN: Kept[Mechanism] = Kept(64)
_PARTS = ("share", "constant", "times below", "times above")
Range = tuple[str, str] | None


def driven(mechanism: Mechanism) -> Mechanism:
    """The mechanism whose actuators act, with controls and sides of ranges behind its parameters; itself without actuators."""
    driving = mechanism.driving
    return mechanism if driving is None else _DRIVEN.get(mechanism.key, lambda: _driven(mechanism, driving))


@dataclass
class _Writer:
    """Writes what ranges hold.

    Attributes:
        builder: of the mechanism's program. first: the number of inputs before its parameters. values: of its parameters, by their names.
        forces: those that ranges hold, without these.
    """

    builder: Builder
    first: int
    values: dict[str, float]
    forces: list[tuple[Term, Clamp]] = field(default_factory=list)

    def input(self, name: str) -> Term:
        return self.builder.inputs[self.builder.names.index(name)]

    def held(self, what: str, bounds: tuple[str, str], raw: Term) -> tuple[Term, Clamp]:
        """A term within a range, and the numbers by which it is held."""
        names = [f"{part} of {what}" for part in _PARTS] + list(bounds)
        columns = [self.builder.names.index(name) - self.first for name in names]
        share, constant, below, above, low, high = map(self.input, names)
        clamp = Clamp(columns[0], columns[1], self.values[bounds[0]], self.values[bounds[1]], tuple(columns[2:]))
        return share * raw + (constant + (below * low + above * high)), clamp


def _own(driving: Driving) -> Iterator[tuple[str, float]]:
    """The numbers that each state has of its own, by their names, each with its value where nothing is beyond its range."""
    for name, *ranges in zip(driving.names, driving.control_ranges, driving.force_ranges, strict=True):
        yield f"control of {name}", 0.0
        for what, bounds in zip(("control", "force"), ranges, strict=True):
            if bounds is not None:
                yield from ((f"{part} of {what} of {name}", float(part == "share")) for part in _PARTS)


def _driven(mechanism: Mechanism, driving: Driving) -> Mechanism:
    tied, bounded = mechanism.constraints, mechanism.bounded
    # What ranges hold is of joints of one coordinate, and so the same in every chart.
    tree, actuation = _with_forces(mechanism, driving, mechanism.program if tied is None else tied.tree)
    others, in_body = (
        tuple(_with_forces(mechanism, driving, program)[0] for program in charts)
        for charts in (mechanism.other_charts, mechanism.charts_in_body)
    )
    tied = None if tied is None else tied.on(tree)
    return replace(
        mechanism,
        driving=None,
        parameters=(*mechanism.parameters, *((name, value, "") for name, value in _own(driving))),
        program=tree if tied is None else constrained_program(tied, by_multipliers),
        constraints=tied,
        bounded=None if bounded is None else bounded.on(tree),
        actuation=actuation,
        other_charts=others,
        charts_in_body=in_body,
    )


def _with_forces(mechanism: Mechanism, driving: Driving, program: StraightLineProgram) -> tuple[StraightLineProgram, Actuation]:
    """The equations of motion of a tree with the forces of its actuators, and what each state gives to these."""
    nv, own = mechanism.nv, list(_own(driving))
    builder = Builder((*program.inputs, *(name for name, _ in own)))
    writer = _Writer(builder, len(program.inputs) - len(mechanism.parameters), {name: value for name, value, _ in mechanism.parameters})
    outputs, laws, controls = builder.append(program), builder.append(driving.program), dict[int, Clamp]()
    passive = vector(outputs["passive"])
    for number, (name, of_control, of_force) in enumerate(zip(driving.names, driving.control_ranges, driving.force_ranges, strict=True)):
        given = writer.input(f"control of {name}")
        if of_control is not None:
            given, controls[number] = writer.held(f"control of {name}", of_control, given)
        force = laws[GAIN][number] * given + laws[BIAS][number]
        if of_force is not None:
            raw = force
            force, clamp = writer.held(f"force of {name}", of_force, raw)
            writer.forces.append((raw, clamp))
        passive = passive + force * vector(laws[MOMENTS][number * nv : (number + 1) * nv])
    held, clamps = [raw for raw, _ in writer.forces], tuple(clamp for _, clamp in writer.forces)
    actuation = Actuation(
        inputs=tuple(
            (builder.names.index(f"control of {name}") - writer.first, number, False) for number, name in enumerate(driving.names)
        ),
        controls=len(driving.names),
        control_ranges=tuple((number, _values(writer, bounds)) for number, bounds in enumerate(driving.control_ranges)),
        activation_ranges=(),
        clamped_controls=tuple(controls.items()),
        zones=Zones(clamps, without_unused(builder.program({"held": held}))) if held else None,
    )
    return without_unused(builder.program({**outputs, "passive": np.ravel(passive).tolist()})), actuation


def _values(writer: _Writer, bounds: Range) -> tuple[float, float] | None:
    return None if bounds is None else (writer.values[bounds[0]], writer.values[bounds[1]])
