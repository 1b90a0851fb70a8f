"""The reactions of joints: what each transmits, force and moment each a block; and what sensors of a user's file measure, each a block.

The truth is a function of q, v, tau and the numbers of the declared file, through the accelerations that its own equations of motion
have. Of these a reaction feels more than the accelerations do: a mass on an axis, or the weight of what a fixed axis carries. Where
the file holds constraints, what these bear stands beside the accelerations, by the law that the engine declares or rigid.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import replace

import numpy as np

from harness.arrays import Array
from harness.engines import Call, Calls, Model, NotOffered
from harness.files.equalities import Meeting
from harness.files.given import Given
from harness.programs.evaluation import jacobians
from harness.programs.mechanisms.constraint_forces import MULTIPLIERS
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.numbers import UNIT_ROUNDOFF
from harness.programs.program import without_unused
from harness.programs.states import States
from harness.storage import Kept
from harness.trees.bodies.spatial import FileProgram
from harness.trees.mechanism import RobotMechanism, TiedMechanism, mechanism_of, tied_mechanism
from harness.trees.quantities import forces
from harness.trees.quantities.motion import tree_motion
from harness.trees.robot import Robot
from harness.truth.blocks import Between, QuantityKernel
from harness.truth.compare import Certified
from harness.truth.quantities import ASKED_ELSEWHERE, Quantity, Truth, TruthBasis
from harness.truth.quantities.of_files import AskedMotion, FileTruth, TruthOfMotion, hold_against_energies
from harness.truth.reference import Reference, ReferenceKernel
from harness.truth.sampling import sample

# States at which the independent rows of constraints are found.
_STATES, _SEED = 4, 0


class ReactionTruth(TruthOfMotion):
    """The certified reactions of one mechanism, at the joints of one file."""

    def __init__(self, basis: TruthBasis) -> None:
        mechanism, declared = basis.mechanism, basis.declared
        if declared is None or basis.read is None:
            raise NotOffered("reactions are those of a mechanism's file, which is held against energies; a robot's file has none")
        self._declared, robot, in_body = declared, basis.robot_of(declared), basis.linear_velocity_in_body
        # Another point is a number of another file, with roundings of its own.
        points_of = basis.robot_of(basis.read).tree if basis.has_other_points else None
        own, rigid, bearing = _motion(robot, basis)
        self._transmitting = forces.transmitting_joints(robot.tree)
        if not self._transmitting:
            raise NotOffered("no joint of the mechanism transmits anything: all are free")
        nq, nv = mechanism.nq, mechanism.nv
        super().__init__(
            basis,
            tree_motion(robot.tree, basis.joints, in_body, multipliers=len(bearing)),
            lambda motion: forces.reactions(motion, points_of, declared.constraints, bearing),
            slice(nq + nv, nq + 2 * nv + len(bearing)),
        )
        self._energies, self._reference = ReferenceKernel(mechanism, in_body), ReferenceKernel(own, in_body)
        self._rigid = self._reference if rigid is own else ReferenceKernel(rigid, in_body)
        self._motion = MotionOfForces(self._reference, self._written, range(len(bearing)), rigid.given)

    @property
    def key(self) -> Hashable:
        """See ``Truth``; with the law of constraints."""
        return super().key, self._reference.mechanism.key

    def evaluate(self, states: States) -> Certified:
        """Forces of all joints that transmit something, then moments, (n, 2 joints, 3) [N, N m].

        Raises:
            InvalidModel: the accelerations of the declared file are not those of the energies.
        """
        reference = self._reference.evaluate(states)
        rigid = reference if self._rigid is self._reference else self._rigid.evaluate(states)
        hold_against_energies(self._declared, self._energies, states, rigid)
        between = self._motion.at(states, reference)
        return self._evaluated(states, between.high, between)

    def asks(self, model: Model, states: States) -> Calls:
        """See ``Truth``; of joints in the order of ``evaluate``."""
        joints = self._basis.joints

        def formed(answers: Sequence[Array]) -> Array:
            found = answers[0][:, [joints.index(name) for name in self._transmitting]]
            return np.concatenate([found[:, :, :3], found[:, :, 3:]], axis=1)

        return Calls((Call("reactions", (states.q, states.v, states.tau), (len(states), len(joints), 6)),), formed)


class MotionOfForces:
    """The accelerations of a mechanism, and multipliers of rows of its constraints, as values between of a program of its tree.

    ``written`` takes q, v, the accelerations, the multipliers of ``rows``, the time, and numbers of the file. ``given`` are the numbers of
    the file that are the first parameters of the mechanism.
    """

    def __init__(self, reference: ReferenceKernel, written: FileProgram, rows: Sequence[int], given: Sequence[Given]) -> None:
        mechanism = self.mechanism = reference.mechanism
        first, known = mechanism.nq + 2 * mechanism.nv + 1, {value.key: place for place, value in enumerate(given)}
        # Of parameters of the program their places among its inputs, and among those of the mechanism.
        own = enumerate(written.parameters, start=first + len(rows))
        self._numbers = [(place, first + known[value.key]) for place, value in own if value.key in known]
        self._reference, self._inputs = reference, len(written.program.inputs)
        self._bearing: QuantityKernel | None = None
        if rows:
            outputs = {MULTIPLIERS: tuple(mechanism.program.outputs[MULTIPLIERS][row] for row in rows)}
            self._bearing = QuantityKernel(without_unused(replace(mechanism.program, outputs=outputs)), [[row] for row in range(len(rows))])

    def at(self, states: States, reference: Reference, parameters: Array | None = None) -> Between:
        """The values with their derivatives by all inputs of the equations of motion, whose accelerations are ``reference``.

        ``parameters`` as of ``Mechanism.inputs``.
        """
        nv, inputs = states.v.shape[1], np.ascontiguousarray(self.mechanism.inputs(states, parameters).T)
        # |x_i| is at most |x|_M times the root of the diagonal entry of M^-1; twice that covers the rounding of the factor of M.
        inverse = reference.inverse_factor()
        radius = 2.0 * reference.radius[:, None] * np.linalg.norm(inverse, axis=2)
        columns = self._reference.derivatives(states, reference.high, parameters)
        slopes = inverse @ (inverse.transpose(0, 2, 1) @ columns)
        bearing = self._multipliers(inputs)
        slopes = np.concatenate([slopes, bearing.slopes], axis=1)
        # What one unit roundoff of twice the kinetic energy as a torque on each rotating coordinate does.
        rotating = states.q.shape[1] + nv + np.flatnonzero(self.mechanism.rotating)
        shares = np.asarray(reference.twice_the_energy(states.v)[:, None, None] * slopes[:, :, rotating])
        felt, further = self._as_inputs(states, slopes)
        return Between(
            high=np.concatenate([reference.high, bearing.high], axis=1),
            low=np.concatenate([reference.low, bearing.low], axis=1),
            radius=np.concatenate([radius, bearing.radius], axis=1),
            further=inputs[:, further],
            slopes=felt,
            shares=shares,
            certified=reference.certified & bearing.certified,
        )

    def _multipliers(self, inputs: Array) -> Between:
        """Multipliers of the rows of constraints, with their derivatives by the inputs of the equations of motion; none for a tree."""
        none = Between.none(*inputs.shape)
        if self._bearing is None:
            return none
        # Imported late: a tree needs nothing of it.
        from harness.truth.declared import DeclaredMechanism, lost

        found = self._bearing.evaluate(inputs)
        slopes = jacobians(self._bearing.program, np.ascontiguousarray(inputs.T))[MULTIPLIERS].transpose(2, 0, 1)
        high, low, radius = found.high[:, :, 0], found.low[:, :, 0], found.radius
        if isinstance(self.mechanism, DeclaredMechanism):
            radius = radius + lost(self.mechanism) * UNIT_ROUNDOFF**2 * found.sensitivity
        return replace(none, high=high, low=low, radius=radius, slopes=slopes, certified=found.certified)

    def _as_inputs(self, states: States, slopes: Array) -> tuple[Array, list[int]]:
        """Derivatives by the inputs of the program, and by what else the motion depends on; and the places of the latter."""
        nq, nv = states.q.shape[1], states.v.shape[1]
        # Inputs of the motion are q, v, tau and time, and then its parameters, of which the program takes some directly.
        taken, time = {place for _, place in self._numbers}, nq + 2 * nv
        further = [*range(nq + nv, time), *(place for place in range(time + 1, slopes.shape[2]) if place not in taken)]
        felt = np.zeros((*slopes.shape[:2], self._inputs))
        felt[:, :, : nq + nv] = slopes[:, :, : nq + nv]
        felt[:, :, nq + nv + slopes.shape[1]] = slopes[:, :, time]
        for place, other in self._numbers:
            felt[:, :, place] = slopes[:, :, other]
        return np.concatenate([felt, slopes[:, :, further]], axis=2), further


def _motion(robot: Robot, basis: TruthBasis) -> tuple[Mechanism, RobotMechanism, Sequence[int]]:
    """The declared file's mechanism: by its engine's law, and rigid; and the rows of constraints that bear something."""
    mechanism, declared = basis.mechanism, basis.declared
    if mechanism.constraints is None or declared is None:
        tree = mechanism_of(robot)
        return tree, tree, ()
    constraints, rows = mechanism.constraints, declared.constraints

    def write() -> TiedMechanism:
        return tied_mechanism(robot, rows, constraints, sample(mechanism, _STATES, _SEED))

    try:
        # Written once per process, whoever reads which file.
        tied = _TIED.get((declared.text, declared.format, mechanism.key, robot.joints), write)
    except ValueError as problem:
        raise NotOffered(str(problem)) from problem
    if basis.softened is None and not tied.is_determined:
        raise NotOffered("rows of its constraints follow from others, so that nothing says how rigid joints share what they bear")
    return tied.mechanism if basis.softened is None else basis.softened(tied.mechanism), tied.mechanism, tied.bearing


class SensorTruth(TruthOfMotion):
    """The certified values of the sensors in a user's file, of which ``places`` are judged among ``count``, with all on that is read of it.

    The accelerations are those of the equations of motion, or the optimum that the engine documents for dry friction, limits and
    equalities; forces of actuators are those of the state's own controls.
    """

    def __init__(self, basis: TruthBasis, places: Sequence[int], count: int) -> None:
        # Imported late, as most files have none.
        from harness.trees.quantities.sensors import sensors
        from harness.truth.declared import DeclaredMechanism

        own, in_body = basis.mechanism, basis.linear_velocity_in_body
        assert isinstance(own, RobotMechanism)
        mechanism = own if basis.softened is None else basis.softened(own)
        names = () if mechanism.softened is None else mechanism.softened.rows
        ties = {one.name: one.rows for one in basis.ties if isinstance(one.rows, Meeting) and one.name in names}
        rows = [row for row, name in enumerate(names) if name in ties]
        first = own.nq + own.nv
        super().__init__(
            basis,
            tree_motion(own.robot.tree, basis.joints, in_body, multipliers=len(rows)),
            lambda motion: sensors(motion, {name: ties[name] for name in dict.fromkeys(names[row] for row in rows)}),
            slice(first, first + own.nv + len(rows)),
        )
        self._places, self._count = list(places), count
        self._reference = ReferenceKernel(mechanism, in_body)
        self._declared = mechanism if isinstance(mechanism, DeclaredMechanism) else None
        given = own.given if self._declared is None else self._declared.given
        self._motion = MotionOfForces(self._reference, self._written, rows, given)
        # Inputs of actuators and sides of their ranges are each state's own.
        changing = frozenset[int]() if own.actuation is None else own.actuation.own
        columns = {value.key: column for column, value in enumerate(given) if column in changing}
        self._own = [(place, columns[one.key]) for place, one in enumerate(self._written.parameters) if one.key in columns]

    @property
    def key(self) -> Hashable:
        """See ``Truth``; with the law of constraints."""
        return super().key, self._reference.mechanism.key

    def asked_at(self, states: States, share: float = ASKED_ELSEWHERE) -> States:
        """See ``Truth``: where constraints act, they are felt near closed equalities and beyond limits alone."""
        if self._declared is None or not share:
            return states
        from harness.truth.displaced import felt

        return felt(self._declared, states, share)

    def evaluate(self, states: States) -> Certified:
        """See ``Truth``; (n, sensors, 3) [m/s^2, m/s, rad/s, rad/s^2, N, N m]."""
        mechanism, unit_roundoff = self._reference.mechanism, self._basis.unit_roundoff
        parameters = mechanism.parameters_at(states)
        found, across = self._at(states, parameters), mechanism.across(states, parameters, unit_roundoff)
        kinks = np.flatnonzero((across != parameters).any(axis=1) & found.certified)
        if len(kinks):
            # Half an ulp may lead a force across a bound, where another slope holds.
            found.sensitivity[kinks] = np.maximum(found.sensitivity[kinks], self._at(states[kinks], across[kinks]).sensitivity)
        return found

    def _at(self, states: States, parameters: Array) -> Certified:
        between = self._motion.at(states, self._reference.evaluate(states, parameters, roughly=True), parameters)
        numbers = np.tile(self._written.numbers, (len(states), 1))
        for place, column in self._own:
            numbers[:, place] = parameters[:, column]
        inputs = np.concatenate([states.q, states.v, between.high, states.time[:, None], numbers], axis=1)
        return self._kernel.evaluate(inputs, between)

    def asks(self, model: Model, states: States) -> Calls:
        """See ``Truth``."""
        given = states.q, states.v, states.tau, states.control, states.activation
        call = Call("driven_sensors", given, (len(states), self._count, 3))
        return Calls((call,), lambda answers: np.ascontiguousarray(answers[0][:, self._places]))


def _sensors(basis: TruthBasis) -> Truth:
    tree = basis.robot_of(basis.declared).tree
    known = tree.sensors
    if not known:
        raise NotOffered("the file has no sensor that the motion of its bodies or its actuators decide")
    # Most files have none.
    from harness.trees.quantities.sensors import sensors, why_not_judged

    places = [place for place, one in enumerate(known) if not why_not_judged(tree, one)]
    if not places:
        raise NotOffered(why_not_judged(tree, known[0]))
    if tree.actuators or basis.softened is not None:
        return SensorTruth(basis, places, len(known))

    def asks(model: Model, motion: AskedMotion) -> Calls:
        call = Call("sensors", (motion.q, motion.v, motion.qdd), (len(motion.q), len(known), 3))
        return Calls((call,), lambda answers: np.ascontiguousarray(answers[0][:, places]))

    return FileTruth(basis, sensors, asks)


_TIED: Kept[TiedMechanism] = Kept(64)
REACTIONS = Quantity("reactions", ReactionTruth, has_laws=True)
# No mechanism's model has any.
SENSORS = Quantity("sensors", _sensors, is_quick=False, takes_all=True)
