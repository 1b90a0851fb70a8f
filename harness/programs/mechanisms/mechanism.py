"""A system after its derivation, and its constraints, as plain data: what every later stage needs, without SymPy."""

from __future__ import annotations

import functools
from collections import Counter
from collections.abc import Collection, Hashable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from harness.arrays import Array
from harness.programs.program import ENERGY_OUTPUTS, StraightLineProgram, used_instructions, without_unused
from harness.programs.states import States
from harness.programs.terms import Builder

if TYPE_CHECKING:
    from harness.programs.mechanisms.kernel import MechanismKernel

# Outputs of the rows' program.
RESIDUAL, JACOBIAN, RATE, BIAS = "residual", "jacobian", "rate", "bias"
# Outputs of the program of actuators, beside ``BIAS``.
GAIN, MOMENTS = "gain", "moments"


@dataclass(frozen=True, kw_only=True)
class Constraints:
    """The rows that tie the coordinates of a mechanism's tree.

    Attributes:
        rows: the name of its constraint for each of the m rows; those that hold positions (holonomic) stand before rolling ones.
        redundant: for each row, whether it follows from the others.
        holonomic: how many rows hold positions.
        positions: places of the coordinates that the holonomic rows determine, one for each that is not redundant.
        rates: places of the coordinates whose rates the rows determine; those of ``positions`` come first.
        assembly: position of each coordinate in one configuration in which all rows hold, to about three digits.
        program: its inputs are the mechanism's; its outputs ``residual``, the holonomic rows, ``jacobian``, (m, nv) by rows, by which
            v changes each row, ``rate``, J v, and ``bias``, J' v, (m,) each.
        tree: the equations of motion without the constraints.
    """

    rows: tuple[str, ...]
    redundant: tuple[bool, ...]
    holonomic: int
    positions: tuple[int, ...]
    rates: tuple[int, ...]
    assembly: tuple[float, ...]
    program: StraightLineProgram
    tree: StraightLineProgram

    @functools.cached_property
    def placing(self) -> StraightLineProgram:
        """The part of ``program`` that has ``residual`` and ``jacobian`` alone, in this order, which is all that closing takes."""
        return without_unused(replace(self.program, outputs={name: self.program.outputs[name] for name in (RESIDUAL, JACOBIAN)}))

    @property
    def independent(self) -> tuple[int, ...]:
        """The numbers of the rows that are not redundant."""
        return tuple(number for number, redundant in enumerate(self.redundant) if not redundant)

    @property
    def determined_by(self) -> dict[int, str]:
        """The place of each coordinate whose position is determined, and the constraint that does."""
        return {place: self.rows[row] for place, row in zip(self.positions, self.independent, strict=False)}

    @property
    def names(self) -> tuple[str, ...]:
        """The constraints, in their order."""
        return tuple(dict.fromkeys(self.rows))

    def first(self, count: int) -> Constraints | None:
        """The first rows alone, all of which hold positions; None of none."""
        return self.some(range(count)) if count else None

    def some(self, numbers: Sequence[int]) -> Constraints:
        """Some rows alone, all of which hold positions."""
        nv, outputs = len(self.assembly), self.program.outputs
        chosen = {name: tuple(outputs[name][row] for row in numbers) for name in (RESIDUAL, RATE, BIAS)}
        chosen[JACOBIAN] = tuple(place for row in numbers for place in outputs[JACOBIAN][row * nv : (row + 1) * nv])
        program = replace(self.program, outputs={name: chosen[name] for name in (RESIDUAL, JACOBIAN, RATE, BIAS)})
        rows, redundant = tuple(self.rows[row] for row in numbers), tuple(self.redundant[row] for row in numbers)
        return replace(self, rows=rows, redundant=redundant, holonomic=len(rows), program=program)

    def beside(self, others: Constraints) -> Constraints:
        """These rows, which hold positions, and then others of the same tree, which need not hold."""
        builder = Builder(self.program.inputs)
        own, further = (builder.append(one.program) for one in (self, others))
        program = without_unused(builder.program({name: [*own[name], *further[name]] for name in (RESIDUAL, JACOBIAN, RATE, BIAS)}))
        rows, redundant = (*self.rows, *others.rows), (*self.redundant, *others.redundant)
        return replace(self, rows=rows, redundant=redundant, holonomic=len(rows), program=program)

    def on(self, tree: StraightLineProgram) -> Constraints:
        """The same rows beside other forces of the tree, whose program has further inputs behind its own."""
        return replace(self, program=replace(self.program, inputs=tree.inputs), tree=tree)

    @property
    def key(self) -> Hashable:
        """Equal for equal constraints."""
        plain = self.rows, self.redundant, self.holonomic, self.positions, self.rates, self.assembly
        return *plain, self.program.key, self.tree.key

    def checked(self, nv: int) -> Constraints:
        """The constraints after a look at their sizes.

        Raises:
            ValueError: a part does not fit the others, or the nv coordinates.
        """
        m, independent = len(self.rows), self.independent
        of_positions = sum(row < self.holonomic for row in independent)
        sizes = {name: len(places) for name, places in self.program.checked().outputs.items()}
        fits = (
            sizes == {RESIDUAL: self.holonomic, JACOBIAN: m * nv, RATE: m, BIAS: m}
            and len(self.redundant) == m
            and (len(self.positions), len(self.rates), len(self.assembly)) == (of_positions, len(independent), nv)
            and all(0 <= place < nv for place in self.rates)
            and self.rates[:of_positions] == self.positions
            and self.tree.checked().inputs == self.program.inputs
        )
        if not fits:
            raise ValueError("the constraints do not fit the coordinates")
        return self


@dataclass(frozen=True, kw_only=True)
class Driving:
    """The laws of the actuators of a mechanism, which are no part of its program.

    Attributes:
        names: of the k actuators, under which an MJCF holds them, in the order of the controls of a state.
        control_ranges, force_ranges: for each the parameters (lowest, highest) that hold its control and its force; None for none.
        program: its inputs are the mechanism's; its outputs ``gain`` and ``bias``, (k,) each, of the forces gain control + bias [N or N m],
            and ``moments``, (k, nv) by rows, the generalised forces of forces of 1.
    """

    names: tuple[str, ...]
    control_ranges: tuple[tuple[str, str] | None, ...]
    force_ranges: tuple[tuple[str, str] | None, ...]
    program: StraightLineProgram

    @property
    def rows(self) -> tuple[str, ...]:
        """The actuators as they are told."""
        return tuple(f"actuator {name}" for name in self.names)

    @property
    def key(self) -> Hashable:
        """Equal for equal laws."""
        return self.names, self.control_ranges, self.force_ranges, self.program.key

    def checked(self, nv: int) -> Driving:
        """The laws after a look at their sizes; raises as ``Constraints.checked``."""
        count = len(self.names)
        sizes = {name: len(places) for name, places in self.program.checked().outputs.items()}
        fits = sizes == {GAIN: count, BIAS: count, MOMENTS: count * nv}
        if not fits or {len(self.control_ranges), len(self.force_ranges)} != {count}:
            raise ValueError("the actuators do not fit the coordinates")
        return self


@dataclass(frozen=True, kw_only=True)
class Mechanism:
    """One derived system.

    Attributes:
        name: file stem of the system, and of its models.
        description, source: from the system file's docstring.
        coordinates, joints: names of the nv coordinates and of the joints that carry them; a ball or free
            joint carries several.
        parameters: (name, value, unit) in the program's input order.
        gravity: acceleration of gravity [m/s^2] along -z; 0 where the mechanism feels none.
        total_mass: sum of all moving masses [kg].
        rotating: for each coordinate, whether it is an angle.
        position_ranges, rate_ranges: (lowest, highest) per coordinate; None for an unbounded angle.
        force_ranges: (lowest, highest) applied force per coordinate [N or N m].
        static_loads, moving_loads: per coordinate, the largest applied force that holds it at rest, or without acceleration at
            rates of its range, over a few positions [N or N m]; 0 where nothing is to be held; () where nobody asked.
        attitudes: for each ball or free joint, the place of its first angle among the coordinates; its
            rotation takes four numbers (w, x, y, z) of q and three of v.
        actuation: an ``Actuation``, what each state gives to actuators, whose forces are among the passive ones too; None without any.
        constraints: what ties the coordinates, whose forces are among the passive ones of the program; None for a tree.
        bounded: the rows of dry friction and limits, which are no part of the program, whose names are those of constraints of a file;
            None without any. dry_friction: the rows of friction, each with the parameter that bounds its force.
        driving: the laws of the actuators, which are no part of the program until ``harness.programs.mechanisms.driven`` makes them one;
            None without any. left_out: what ``smooth`` left out, as rows of ``bounded`` and ``driving`` are called.
        softened: the rows of constraints that give, those of ``constraints`` first and then those that need not hold; None without.
        stiffened: the equations of a program whose constraints give, where no acceleration is eliminated: their matrix is another than
            M, see ``harness.programs.program.SYSTEM``; None where there is nothing to be eliminated.
        program: the equations of motion; see ``harness.programs.kernels`` for its inputs and outputs.
        other_charts: the same in other Euler angles; charts_in_body: all charts with the linear velocity
            of free joints in the body's frame, () where there is no free joint.
        energy_programs: energies of the charts (program, *other_charts); see ``harness.programs.mechanisms.kernel``.
        start: (position, rate) per coordinate that computed motions start from; () where the system declares none.
        equations_text, equations_mathml: the equations for people; "" where they would be too long to be read.
        energies_text: the system's file and the helpers it imports, without docstring, where the equations are too long.
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
    attitudes: tuple[int, ...] = ()
    other_charts: tuple[StraightLineProgram, ...] = ()
    charts_in_body: tuple[StraightLineProgram, ...] = ()
    energy_programs: tuple[StraightLineProgram, ...] = ()
    start: tuple[tuple[float, float], ...] = ()
    static_loads: tuple[float, ...] = ()
    moving_loads: tuple[float, ...] = ()
    energies_text: str = ""
    constraints: Constraints | None = None
    softened: Constraints | None = None
    stiffened: StraightLineProgram | None = None
    bounded: Constraints | None = None
    dry_friction: tuple[tuple[str, str], ...] = ()
    driving: Driving | None = None
    left_out: tuple[str, ...] = ()
    actuation: Any = None

    @property
    def handed_to_engines(self) -> Any:
        """The source for an engine that takes equations; of a user's file, the request to load it."""
        return self

    @property
    def nv(self) -> int:
        """Degrees of freedom."""
        return len(self.coordinates)

    @property
    def nq(self) -> int:
        """Number of positions: one more than velocities for each ball or free joint."""
        return len(self.coordinates) + len(self.attitudes)

    @property
    def joint_sizes(self) -> dict[str, tuple[int, int]]:
        """Each joint's number of positions and of velocities, in the order of q and v."""
        turning = {self.joints[place] for place in self.attitudes}
        counts = Counter(self.joints)
        return {joint: (count + (joint in turning), count) for joint, count in counts.items()}

    def charts(self, linear_velocity_in_body: bool) -> tuple[StraightLineProgram, ...]:
        """Programs of the same equations, of which one at least is regular everywhere it can be.

        ``linear_velocity_in_body`` chooses the frame in which the linear velocity of free joints is given;
        it makes no difference without free joints.
        """
        return self.charts_in_body if linear_velocity_in_body and self.charts_in_body else (self.program, *self.other_charts)

    @functools.cached_property
    def feels_time(self) -> bool:
        """True if the equations depend on time explicitly."""
        time = ("input", self.nq + 2 * self.nv)
        # Every input is an instruction, whether an output rests on it or not.
        return any(
            program.instructions[place] == time
            for program in self.charts(linear_velocity_in_body=False)
            for place in used_instructions(program)
        )

    @property
    def parameter_values(self) -> tuple[float, ...]:
        return tuple(value for _, value, _ in self.parameters)

    @property
    def key(self) -> Hashable:
        """Equal for mechanisms with equal equations, constraints, joints and parameter values."""
        programs = tuple(program.key for program in (self.program, *self.other_charts, *self.charts_in_body))
        constraints = None if self.constraints is None else self.constraints.key
        actuation = None if self.actuation is None else self.actuation.key
        bounded = None if self.bounded is None else (self.bounded.key, self.dry_friction)
        beside = bounded, None if self.driving is None else self.driving.key
        return self.name, self.joints, self.parameters, self.gravity, self.total_mass, programs, constraints, beside, actuation

    def float64(self) -> MechanismKernel:
        """The evaluator of accelerations, terms and derivatives in float64; what it compiles stays in the process."""
        from harness.programs.mechanisms.kernel import MechanismKernel

        return MechanismKernel(self)

    def inputs(self, states: States, parameters: Array | None = None) -> Array:
        """The program's inputs at ``states``, (number of inputs, n), one column a state.

        ``parameters``, (n, number of parameters), gives each state its own; by default all have the mechanism's.
        """
        values = self.parameters_at(states) if parameters is None else parameters
        return np.ascontiguousarray(np.vstack([states.q.T, states.v.T, states.tau.T, states.time[None, :], values.T]))

    def parameters_at(self, states: States, values: Sequence[float] | Array | None = None) -> Array:
        """(n, number of parameters) at each state: ``values``, by default its own, but for what actuators and a law take from the state."""
        own = np.array(self.parameter_values if values is None else values, dtype=np.float64)
        parameters: Array = np.broadcast_to(own, (len(states), own.shape[-1]))
        return parameters if self.actuation is None else np.asarray(self.actuation.parameters_at(parameters, states))

    def across(self, states: States, parameters: Array, unit_roundoff: float) -> Array:
        """``parameters_at`` the states, with each force across the bound of its range that rounding may lead it across."""
        zones = None if self.actuation is None else self.actuation.zones
        return parameters if zones is None else np.asarray(zones.across(states.known, parameters, unit_roundoff))

    def to_json(self) -> str:
        """JSON that ``from_json`` turns back into an equal mechanism."""
        return msgspec.json.encode(self).decode()

    @classmethod
    def from_json(cls, text: str) -> Mechanism:
        """Read a mechanism back, trusting nothing in it.

        Raises:
            ValueError: a part is missing, of another type or contradicts the others.
        """
        return msgspec.json.decode(text, type=cls)._checked()

    def _checked(self) -> Mechanism:
        nv = self.nv
        per_coordinate = ("joints", "rotating", "position_ranges", "rate_ranges", "force_ranges")
        faults = {
            "joints or ranges do not fit the coordinates": any(len(getattr(self, name)) != nv for name in per_coordinate),
            "an attitude does not fit the coordinates": not all(0 <= place <= nv - 3 for place in self.attitudes),
            "the start does not fit the coordinates": len(self.start) not in (0, nv),
            "the loads do not fit the coordinates": not {len(self.static_loads), len(self.moving_loads)} <= {0, nv},
            "there is not one energy program for each chart": len(self.energy_programs) != 1 + len(self.other_charts),
        }
        for fault, is_there in faults.items():
            if is_there:
                raise ValueError(fault)
        if self.constraints is not None:
            self.constraints.checked(nv)
        if self.bounded is not None:
            self.bounded.checked(nv)
        if self.driving is not None:
            self.driving.checked(nv)
        for program in (self.program, *self.other_charts, *self.charts_in_body):
            program.checked()
            sizes = {name: len(program.outputs.get(name, ())) for name in ("velocity", "gravity", "passive")}
            if set(sizes.values()) != {nv} or len(program.outputs.get("mass", ())) != nv * (nv + 1) // 2:
                raise ValueError("the program's outputs do not fit the coordinates")
            if len(program.inputs) != self.nq + 2 * nv + 1 + len(self.parameters):
                raise ValueError("the program's inputs do not fit coordinates and parameters")
        for program, energies in zip(self.charts(linear_velocity_in_body=False), self.energy_programs, strict=True):
            energies.checked()
            expected = dict.fromkeys((*ENERGY_OUTPUTS, *(["regularity"] if "regularity" in program.outputs else [])), 1) | {"forces": nv}
            if {name: len(indices) for name, indices in energies.outputs.items()} != expected or energies.inputs != program.inputs:
                raise ValueError("an energy program does not fit its chart")
        return self


def smooth(mechanism: Mechanism) -> Mechanism:
    """The mechanism without dry friction, limits and actuators, of which quantities other than accelerations are asked."""
    return without(undriven(mechanism), () if mechanism.bounded is None else mechanism.bounded.names)


def undriven(mechanism: Mechanism) -> Mechanism:
    """The mechanism without its actuators."""
    driving = mechanism.driving
    return mechanism if driving is None else replace(mechanism, driving=None, left_out=(*mechanism.left_out, *driving.rows))


def without(mechanism: Mechanism, names: Collection[str]) -> Mechanism:
    """The mechanism without dry friction and limits of these names."""
    if mechanism.bounded is None or not names:
        return mechanism
    left = [row for row, name in enumerate(mechanism.bounded.rows) if name not in names]
    gone = tuple(name for name in mechanism.bounded.names if name in names)
    return replace(
        mechanism,
        bounded=mechanism.bounded.some(left) if left else None,
        dry_friction=tuple(one for one in mechanism.dry_friction if one[0] not in names),
        left_out=(*mechanism.left_out, *gone),
    )


def all_rows(mechanism: Mechanism) -> Constraints | None:
    """The rows of constraints, and behind them those of dry friction and limits; None without any."""
    if mechanism.constraints is None or mechanism.bounded is None:
        return mechanism.bounded or mechanism.constraints
    return mechanism.constraints.beside(mechanism.bounded)


def controls_of(mechanism: Mechanism) -> int:
    """Number of controls of a state."""
    if mechanism.driving is not None:
        return len(mechanism.driving.names)
    return 0 if mechanism.actuation is None else int(mechanism.actuation.controls)
