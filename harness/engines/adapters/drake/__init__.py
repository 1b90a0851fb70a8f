"""Drake's ``MultibodyPlant`` in continuous time, on a URDF or MJCF model: accelerations of its articulated-body algorithm.

Drake has a free joint's angular velocity along the axes of its parent, and a ball joint as roll, pitch and yaw; both are turned into
the body's own axes. The root link of a URDF is welded. What its parser passes over is added as Drake's own parts: springs as force
elements, and rotors, which are those of actuators in Drake (``files``). Gravity is the file's, or for a URDF the harness's.

Source: Drake documentation, drake::multibody::Parser and MultibodyPlant, ``get_generalized_acceleration_output_port`` and
``get_reaction_forces_output_port``; drake::multibody::BallRpyJoint and QuaternionFloatingJoint.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from harness.arrays import Array
from harness.engines import Engine, ImplicitPart, LoadedModel, NotOffered, StepRule, Unsupported
from harness.engines.adapters.drake.files import CONTINUOUS, FINALIZE, Building, building, built, floating_bodies, made
from harness.engines.coordinates import BALL, FREE
from harness.engines.loaded_file import LoadedFile, refuse_joints
from harness.engines.moving import MotionsRequest, Moved, moved_as_they_stand
from harness.engines.request import Refused, Request
from harness.engines.state_by_state import StateByState
from harness.files.findings import EFFORT, EQUALITIES, FRICTION, LIMITS, TENDON_LIMITS, TRANSMISSIONS
from harness.files.joint_kinds import JointKind
from harness.files.model_file import ModelFile

if TYPE_CHECKING:
    from harness.engines.adapters.drake.derivatives import DifferentiatedPlant

# Of a discrete plant [s]; no file of a mechanism says it.
_TIME_STEP = 0.001
_SIZES = {"revolute": (1, 1), "prismatic": (1, 1), "ball_rpy": BALL, "quaternion_floating": FREE}


class DrakeModel(StateByState):
    """A plant with a context for its states; ``names`` are the free joints, which Drake names after their bodies, by body."""

    rotation_first = True
    applies_dampers = True
    applies_springs = True

    def __init__(self, built_by: Building, names: Mapping[str, str], request: Request) -> None:
        self._building = built_by
        # A diagram lives as long as what is of it.
        self.made = made(built_by)
        self.plant, self.context = plant, _ = self.made["p"], self.made["c"]
        joints = [plant.get_joint(index) for index in plant.GetJointIndices()]
        self.moving = {names.get(joint.name(), joint.name()): joint for joint in joints if joint.num_velocities()}
        unknown = {joint.type_name() for joint in self.moving.values()} - set(_SIZES)
        if unknown and request.text is not None:
            raise Unsupported(f"joints of the kinds {', '.join(sorted(unknown))} are not known to the harness's adapter of Drake")
        super().__init__(request, {name: joint.velocity_start() for name, joint in self.moving.items()}, plant.num_velocities())
        # An actuator has what the harness supplies.
        self.armature[:] = 0.0

    def loaded(self) -> LoadedModel:
        plant = self.plant
        sizes = {name: _SIZES[joint.type_name()] for name, joint in self.moving.items()}
        gravity = tuple(plant.gravity_field().gravity_vector().tolist())
        fixed = {body.index() for body in plant.GetBodiesWeldedTo(plant.world_body())}
        bodies = (plant.get_body(index) for instance in _instances(plant) for index in plant.GetBodyIndices(instance))
        return LoadedModel(sizes, gravity, float(sum(body.get_mass(self.context) for body in bodies if body.index() not in fixed)))

    @cached_property
    def _differentiated(self) -> DifferentiatedPlant:
        from harness.engines.adapters.drake.derivatives import DifferentiatedPlant

        return DifferentiatedPlant(self.plant, self.columns)

    def _own_positions(self, q: Array) -> Array:
        from pydrake.common.eigen_geometry import Quaternion
        from pydrake.math import RollPitchYaw

        positions = self.plant.GetDefaultPositions()
        for name, size in self.columns.sizes.items():
            given, start = q[self.columns.spans(name)[0]], self.moving[name].position_start()
            if size == BALL:
                given = RollPitchYaw(Quaternion(given / np.linalg.norm(given))).vector()
            elif size == FREE:
                given = np.concatenate([given[3:], given[:3]])
            positions[start : start + len(given)] = given
        return np.asarray(positions)

    def _states(self, q: Array, v: Array, tau: Array) -> Iterator[tuple[Array, Array, Array, Array]]:
        """Drake's own q, v and tau of each state, and the matrix that takes its accelerations to those of the harness."""
        for position, velocity, force in zip(q, v, tau, strict=True):
            turn = self.columns.turn(position, self.places, self.width, self.rotation_first)
            yield self._own_positions(position), velocity @ turn, force @ turn, turn

    def _go_to(self, q: Array, v: Array) -> None:
        self.plant.SetPositions(self.context, self._own_positions(q))
        self.plant.SetVelocities(self.context, v)

    def _accelerations(self, force: Array) -> Array:
        self.plant.get_applied_generalized_force_input_port().FixValue(self.context, force)
        try:
            return np.asarray(self.plant.get_generalized_acceleration_output_port().Eval(self.context))
        except RuntimeError as error:
            raise Refused(" ".join(str(error).split())) from error

    def _mass_matrix(self) -> Array:
        return np.asarray(self.plant.CalcMassMatrix(self.context))

    def _bias(self) -> Array:
        # Gravity, springs and dampers are force elements.
        return np.asarray(self.plant.CalcBiasTerm(self.context) - _of_elements(self.plant, self.context))

    def forward_dynamics_derivatives(self, q: Array, v: Array, tau: Array) -> Array:
        """See ``harness.engines.interface``; of the accelerations' output port."""
        return self._differentiated.forward(self._states(q, v, tau))

    def inverse_dynamics_derivatives(self, q: Array, v: Array, qdd: Array) -> Array:
        """See ``harness.engines.interface``; of ``CalcInverseDynamics`` beside force elements, which have the dampers of joints too."""
        # Accelerations turn between frames as forces do.
        return self._differentiated.inverse(self._states(q, v, qdd))

    def reactions(self, q: Array, v: Array, tau: Array) -> Array:
        """See ``harness.engines.interface``: the output port of reaction forces, each about and along the axes of the child's frame."""
        plant, context, names = self.plant, self.context, list(self.columns.sizes)
        found = np.empty((len(q), len(names), 6))
        port = plant.get_reaction_forces_output_port()
        indices = plant.GetJointIndices()
        ordinals = {name: indices.index(joint.index()) for name, joint in self.moving.items()}
        for state, (*own, _) in enumerate(self._states(q, v, tau)):
            _set(plant, context, *own)
            forces = port.Eval(context)
            for place, name in enumerate(names):
                turn = self.moving[name].frame_on_child().CalcPoseInWorld(context).rotation().matrix()
                force = forces[ordinals[name]]
                found[state, place] = *(turn @ force.translational()), *(turn @ force.rotational())
        return found

    def step(self, q: Array, v: Array, tau: Array, length: float, integrator: str) -> Array:
        """See ``harness.engines.interface``: the periodic update of the plant that is made with this time step.

        Raises:
            NotOffered: a joint turns about a point, which Drake steps in other coordinates.
        """
        if {BALL, FREE} & set(self.columns.sizes.values()):
            raise NotOffered("Drake steps rotations about a point by the rates of their coordinates, of which no rule is declared")
        # With sampled outputs the update is not one of the discrete state alone.
        plant = built(self._building.replaced(CONTINUOUS, f"MultibodyPlant({length!r}); p.SetUseSampledOutputPorts(False)"))
        context, nq, found = plant.CreateDefaultContext(), plant.num_positions(), np.empty((len(q), q.shape[1] + v.shape[1]))
        positions = [self.moving[name].position_start() for name in self.columns.sizes]
        velocities = [self.places[name] for name in self.columns.sizes]
        for state, (*own, _) in enumerate(self._states(q, v, tau)):
            _set(plant, context, *own)
            after = plant.EvalUniquePeriodicDiscreteUpdate(context).value()
            found[state] = [*after[positions], *after[nq:][velocities]]
        return found

    def _parts_of_bias(self) -> tuple[Array, Array, Array]:
        """``CalcBiasTerm``, ``CalcGravityGeneralizedForces`` and ``CalcForceElementsContribution``, which has the dampers of joints too.

        Force elements contain gravity, which is not to be what is left of a difference.
        """
        plant, (weightless, context) = self.plant, _weightless(self._building)
        weightless.SetPositionsAndVelocities(context, plant.GetPositionsAndVelocities(self.context))
        gravity = -plant.CalcGravityGeneralizedForces(self.context)
        return plant.CalcBiasTerm(self.context), gravity, -_of_elements(weightless, context)

    def reproducer(self, source: str, q: Array, v: Array, tau: Array, certified: Array) -> str:
        """See ``harness.hard.worst_cases``."""
        ((*own, turn),) = self._states(q[None], v[None], tau[None])
        positions, velocities, forces = (values.tolist() for values in own)
        text = self._building.text
        return (
            f"x = {source if text == self.request.text else repr(text)}; {self._building.statements}; c = p.CreateDefaultContext()\n"
            f"p.SetPositions(c, {positions}); p.SetVelocities(c, {velocities}); "
            f"p.get_applied_generalized_force_input_port().FixValue(c, {forces})\n"
            f"print(p.get_generalized_acceleration_output_port().Eval(c).tolist(), {(certified @ turn).tolist()}, sep='\\n')"
            "  # engine, certified\n"
        )


_PLANT = "p = MultibodyPlant(0.0); Parser(p).AddModels(PATH); "
_ACCELERATIONS = "p.Finalize(); p.get_generalized_acceleration_output_port().Eval(c)"


class DrakeEngine(Engine):
    title = "Drake"
    requires = ("pydrake", "drake")
    formats: tuple[str, ...] = ("urdf", "mjcf")
    optional = True
    supplied: Mapping[str, str] = dict.fromkeys(
        formats,
        "gravity, springs and rotor inertias of joints, and springs between points, are supplied from the file; dampers are its own",
    )
    beside_tau: Mapping[str, str] = {
        EFFORT: (
            "Drake bounds inputs of actuators by effort, and generalised forces by none; its dynamics have no velocity limits "
            "(https://github.com/RobotLocomotion/drake/pull/24110)"
        ),
        TRANSMISSIONS: 'Drake makes an actuator of each, at a mechanicalReduction of 1 (Drake documentation, "Parsing model files", URDF)',
    }
    why_off: Mapping[str, str] = {
        EQUALITIES: "it holds equalities in discrete time steps alone, and has no acceleration at a state with them",
        FRICTION: "Drake applies dry friction in discrete time steps alone",
        LIMITS: "it has joint limits in discrete time steps alone",
        TENDON_LIMITS: "its parser knows no tendons",
    }
    why_no_constraints = "Drake holds constraints in discrete time steps alone, and has no acceleration at a state with them"
    call: Mapping[str, str] = {
        "urdf": f"{_PLANT}p.WeldFrames(p.world_frame(), p.GetFrameByName(ROOT)); {_ACCELERATIONS}",
        "mjcf": _PLANT + _ACCELERATIONS,
    }

    def step_rules(self, file: ModelFile) -> tuple[StepRule, ...]:
        """One rule, of a plant in discrete time: (M + h D) a = f, v' = v + h a, q' = q + h N(q) v', with limits as of ``step_law``.

        D is the diagonal matrix of the dampers of joints; reflected inertias are in M, and all other forces are those at the start.

        Source: Drake, multibody/plant/compliant_contact_manager.cc, ``CalcAccelerationsDueToNonConstraintForcesCache``, and
        discrete_update_manager.cc, ``DoCalcDiscreteValues``, of v1.51.1; the class documentation of ``MultibodyPlant`` says that the update
        is periodic and gives no formula.
        """
        from harness.engines.adapters.drake.step_law import limit

        return (StepRule("discrete", _TIME_STEP, frozenset({ImplicitPart.JOINT_DAMPERS}), limited=limit(_TIME_STEP)),)

    def read(self, request: Request) -> LoadedFile:
        floating = floating_bodies(request)
        # A plain one has ball joints that the harness has not asked about.
        balls = [joint.name for joint in request.joints if joint.kind == JointKind.BALL and request.aid is not None]
        refuse_joints(request, "Drake", [*floating, *balls])
        try:
            return self.model(building(request), {body: joint for joint, body in floating.items()}, request)
        except RuntimeError as error:
            raise Refused(" ".join(str(error).split())) from error

    def model(self, built_by: Building, names: Mapping[str, str], request: Request) -> LoadedFile:
        """The model of a request; raises RuntimeError as Drake does, and as ``built``."""
        return DrakeModel(built_by, names, request)

    def moved(self, request: MotionsRequest) -> Moved:
        """See ``harness.engines.Engine``; of files as they stand."""
        from harness.engines.adapters.drake.simulated import simulated

        return moved_as_they_stand(self.title, request, simulated)


def _set(plant: Any, context: Any, q: Array, v: Array, tau: Array) -> None:
    plant.SetPositions(context, q)
    plant.SetVelocities(context, v)
    plant.get_applied_generalized_force_input_port().FixValue(context, tau)


@lru_cache(maxsize=1)
def _weightless(building: Building) -> tuple[Any, Any]:
    """The plant without gravity, and a context for its states; kept for the next state."""
    plant = built(building.replaced(FINALIZE, f"p.mutable_gravity_field().set_gravity_vector([0.0] * 3); {FINALIZE}"))
    return plant, plant.CreateDefaultContext()


def _of_elements(plant: Any, context: Any) -> Array:
    """Generalised forces of force elements, which contain gravity and the dampers of joints."""
    from pydrake.multibody.tree import MultibodyForces

    forces = MultibodyForces(plant)
    plant.CalcForceElementsContribution(context, forces)
    return np.asarray(plant.CalcGeneralizedForces(context, forces))


def _instances(plant: Any) -> Iterator[Any]:
    from pydrake.multibody.tree import ModelInstanceIndex

    yield from (ModelInstanceIndex(number) for number in range(plant.num_model_instances()))


ENGINE = DrakeEngine()
