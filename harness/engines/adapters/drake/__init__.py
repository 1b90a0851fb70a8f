"""Drake's ``MultibodyPlant`` in continuous time, on a URDF or MJCF model: accelerations of its articulated-body algorithm.

Drake has a free joint's angular velocity along the axes of its parent, and a ball joint as roll, pitch and yaw; both are turned into
the body's own axes here. Springs that its parser passes over are added as Drake's own force elements
(``harness.engines.adapters.drake.files``). Gravity is the file's, or for a URDF the harness's.

Source: Drake documentation, drake::multibody::MultibodyPlant, ``get_generalized_acceleration_output_port`` and
``get_reaction_forces_output_port``; drake::multibody::BallRpyJoint and QuaternionFloatingJoint.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from harness.arrays import Array
from harness.engines import LoadedModel, NotOffered, Part, StepRule, Terms, Unsupported, require_model
from harness.engines.adapters.drake.derivatives import DifferentiatedPlant
from harness.engines.adapters.drake.files import (
    armatures_passed_over,
    floating_bodies,
    refuse,
    refused_warnings,
    springs_at_world,
    text_for_parser,
)
from harness.engines.rotations import BALL, FREE, Columns
from harness.models.model_file import JointSpring, ModelFile, PointSpring

if TYPE_CHECKING:
    from harness.equations.mechanism import Mechanism

# Of a discrete plant [s]; no file of a mechanism says it.
_TIME_STEP = 0.001
_SIZES = {"revolute": (1, 1), "prismatic": (1, 1), "ball_rpy": BALL, "quaternion_floating": FREE}


class DrakeModel:
    """A plant, made by the Python text ``building`` of the text of a model ``x``, with a context for its states."""

    def __init__(self, text: str, building: str, names: Mapping[str, str], joints: Sequence[str], edited: bool) -> None:
        self._text, self._building, self._edited = text, building, edited
        self.plant = self._build(building)
        self._context = self.plant.CreateDefaultContext()
        plant = self.plant
        by_name = {plant.get_joint(index).name(): plant.get_joint(index) for index in plant.GetJointIndices()}
        moving = {name: joint for name, joint in by_name.items() if joint.num_velocities()}
        for name, body in names.items():
            moving[name] = moving.pop(body)
        if unknown := {joint.type_name() for joint in moving.values()} - set(_SIZES):
            raise Unsupported(f"joints of the kinds {', '.join(sorted(unknown))} are not known to the harness's adapter of Drake")
        self.joints = moving
        self._order = list(dict.fromkeys(joints))

    def _build(self, building: str) -> Any:
        names: dict[str, Any] = {"x": self._text}
        with refused_warnings():
            # The very text that a reproducer prints: what it shows is what was done.
            exec(building, names)
        return names["p"]

    def loaded(self) -> LoadedModel:
        plant = self.plant
        sizes = {name: _SIZES[joint.type_name()] for name, joint in self.joints.items()}
        x, y, z = plant.gravity_field().gravity_vector().tolist()
        fixed = {body.index() for body in plant.GetBodiesWeldedTo(plant.world_body())}
        bodies = (plant.get_body(index) for instance in _instances(plant) for index in plant.GetBodyIndices(instance))
        return LoadedModel(sizes, (x, y, z), float(sum(body.get_mass(self._context) for body in bodies if body.index() not in fixed)))

    def _columns(self) -> Columns:
        return Columns(self._order, {name: _SIZES[joint.type_name()] for name, joint in self.joints.items()})

    @cached_property
    def _differentiated(self) -> DifferentiatedPlant:
        return DifferentiatedPlant(self.plant, self._columns())

    def _states(self, q: Array, v: Array, tau: Array) -> Iterator[tuple[Array, Array, Array, Array]]:
        """Drake's own q, v and tau of each state, and the matrix that takes its accelerations to those of the harness."""
        from pydrake.common.eigen_geometry import Quaternion
        from pydrake.math import RollPitchYaw

        plant, columns = self.plant, self._columns()
        places = {name: joint.velocity_start() for name, joint in self.joints.items()}
        for state in range(len(q)):
            positions = np.zeros(plant.num_positions())
            for name, size in columns.sizes.items():
                given, start = q[state, columns.spans(name)[0]], self.joints[name].position_start()
                if size == BALL:
                    given = RollPitchYaw(Quaternion(given / np.linalg.norm(given))).vector()
                elif size == FREE:
                    given = np.concatenate([given[3:], given[:3]])
                positions[start : start + len(given)] = given
            turn = columns.turn(q[state], places, plant.num_velocities(), rotation_first=True)
            yield positions, v[state] @ turn, tau[state] @ turn, turn

    def _set(self, plant: Any, context: Any, q: Array, v: Array, tau: Array) -> None:
        plant.SetPositions(context, q)
        plant.SetVelocities(context, v)
        plant.get_applied_generalized_force_input_port().FixValue(context, tau)

    def forward_dynamics(self, q: Array, v: Array, tau: Array) -> Array:
        plant, context, answer = self.plant, self._context, np.empty(v.shape)
        port = plant.get_generalized_acceleration_output_port()
        for state, (*own, turn) in enumerate(self._states(q, v, tau)):
            self._set(plant, context, *own)
            answer[state] = turn @ port.Eval(context)
        return answer

    def forward_dynamics_derivatives(self, q: Array, v: Array, tau: Array) -> Array:
        """See ``harness.engines.interface``; of the accelerations' output port."""
        return self._differentiated.forward(self._states(q, v, tau))

    def inverse_dynamics_derivatives(self, q: Array, v: Array, qdd: Array) -> Array:
        """See ``harness.engines.interface``; of ``CalcInverseDynamics`` beside force elements, which have the dampers of joints too."""
        # Accelerations turn between frames as forces do.
        return self._differentiated.inverse(self._states(q, v, qdd))

    def reactions(self, q: Array, v: Array, tau: Array) -> Array:
        """See ``harness.engines.interface``: the output port of reaction forces, each about and along the axes of the child's frame."""
        plant, context = self.plant, self._context
        found = np.empty((len(q), len(self._order), 6))
        port = plant.get_reaction_forces_output_port()
        indices = plant.GetJointIndices()
        ordinals = {name: indices.index(joint.index()) for name, joint in self.joints.items()}
        for state, (*own, _) in enumerate(self._states(q, v, tau)):
            self._set(plant, context, *own)
            forces = port.Eval(context)
            for place, name in enumerate(self._order):
                joint = self.joints[name]
                turn = joint.frame_on_child().CalcPoseInWorld(context).rotation().matrix()
                force = forces[ordinals[name]]
                found[state, place] = *(turn @ force.translational()), *(turn @ force.rotational())
        return found

    def step(self, q: Array, v: Array, tau: Array, length: float, integrator: str) -> Array:
        """See ``harness.engines.interface``: the periodic update of the plant that is made with this time step.

        Raises:
            NotOffered: a joint turns about a point, which Drake steps in other coordinates.
        """
        if {BALL, FREE} & {_SIZES[joint.type_name()] for joint in self.joints.values()}:
            raise NotOffered("Drake steps rotations about a point by the rates of their coordinates, of which no rule is declared")
        # With sampled outputs the update is not one of the discrete state alone.
        plant = self._build(self._building.replace(_CONTINUOUS, f"MultibodyPlant({length!r}); p.SetUseSampledOutputPorts(False)"))
        context, nq, found = plant.CreateDefaultContext(), plant.num_positions(), np.empty((len(q), q.shape[1] + v.shape[1]))
        positions = [self.joints[name].position_start() for name in self._order]
        velocities = [self.joints[name].velocity_start() for name in self._order]
        for state, (*own, _) in enumerate(self._states(q, v, tau)):
            self._set(plant, context, *own)
            after = plant.EvalUniquePeriodicDiscreteUpdate(context).value()
            found[state] = [*after[positions], *after[nq:][velocities]]
        return found

    def terms(self, q: Array, v: Array, tau: Array) -> Terms:
        """Terms as Drake computes them: the mass matrix with reflected inertias, the bias term, gravity, force elements and dampers.

        Source: Drake documentation, ``CalcMassMatrix``, ``CalcBiasTerm``, ``CalcGravityGeneralizedForces``,
        ``CalcForceElementsContribution``, which has the dampers of joints too.
        """
        from pydrake.multibody.tree import MultibodyForces

        plant, context = self.plant, self._context
        # Force elements contain gravity, which is not to be what is left of a difference.
        weightless = self._build(
            self._building.removesuffix("p.Finalize()") + "p.mutable_gravity_field().set_gravity_vector([0.0] * 3); p.Finalize()"
        )
        without_gravity, forces = weightless.CreateDefaultContext(), MultibodyForces(weightless)
        count = plant.num_velocities()
        mass, (velocity, gravity, passive, applied) = np.empty((len(q), count, count)), np.empty((4, *v.shape))
        for state, (*own, turn) in enumerate(self._states(q, v, tau)):
            self._set(plant, context, *own)
            self._set(weightless, without_gravity, *own)
            forces.SetZero()
            weightless.CalcForceElementsContribution(without_gravity, forces)
            mass[state] = turn @ plant.CalcMassMatrix(context) @ turn.T
            velocity[state] = turn @ plant.CalcBiasTerm(context)
            gravity[state] = -(turn @ plant.CalcGravityGeneralizedForces(context))
            passive[state] = turn @ weightless.CalcGeneralizedForces(without_gravity, forces)
            applied[state] = tau[state]
        return Terms(mass, velocity, gravity, passive, applied)

    def reproducer(self, source: str, q: Array, v: Array, tau: Array, certified: Array) -> str:
        """See ``harness.hard.reproducer``."""
        ((*own, turn),) = self._states(q[None], v[None], tau[None])
        positions, velocities, forces = (values.tolist() for values in own)
        return (
            f"x = {repr(self._text) if self._edited else source}; {self._building}; c = p.CreateDefaultContext()\n"
            f"p.SetPositions(c, {positions}); p.SetVelocities(c, {velocities}); "
            f"p.get_applied_generalized_force_input_port().FixValue(c, {forces})\n"
            f"print(p.get_generalized_acceleration_output_port().Eval(c).tolist(), {(certified @ turn).tolist()}, sep='\\n')"
            "  # engine, certified\n"
        )


class DrakeEngine:
    requires = ("pydrake", "drake")
    formats = ("urdf", "mjcf")
    optional = True

    def step_rules(self, file: ModelFile) -> tuple[StepRule, ...]:
        """One rule, of the free motion of a plant in discrete time: (M + h D) a = f, v' = v + h a, q' = q + h N(q) v'.

        D is the diagonal matrix of the dampers of joints; reflected inertias are in M, and all other forces are those at the start.

        Source: Drake, multibody/plant/compliant_contact_manager.cc, ``CalcAccelerationsDueToNonConstraintForcesCache``, and
        discrete_update_manager.cc, ``DoCalcDiscreteValues``, of v1.51.1; the class documentation of ``MultibodyPlant`` says that the update
        is periodic and gives no formula.
        """
        return (StepRule("discrete", _TIME_STEP, frozenset({Part.JOINT_DAMPERS})),)

    def load(self, source: ModelFile | Mechanism, joints: Sequence[str], gravity: float) -> DrakeModel:
        file = require_model(source, "drake")
        refuse(file)
        names, text = floating_bodies(file), text_for_parser(file)
        vector = [0.0, 0.0, -gravity] if file.gravity is None else list(file.gravity)
        building = "; ".join([*_building(file), f"p.mutable_gravity_field().set_gravity_vector({vector})", "p.Finalize()"])
        try:
            return DrakeModel(text, building, names, joints, edited=text != file.text)
        except RuntimeError as error:
            raise ValueError(" ".join(str(error).split())) from error


def _building(file: ModelFile) -> Iterator[str]:
    """Python statements that read the text ``x`` into the plant ``p``, and add what the parser passes over."""
    yield "from pydrake.multibody.plant import MultibodyPlant; from pydrake.multibody.parsing import Parser"
    yield "import pydrake.multibody.tree as t"
    yield f"p = {_CONTINUOUS}; Parser(p).AddModelsFromString(x, {'urdf' if file.format == 'urdf' else 'xml'!r})"
    read = set() if file.format == "mjcf" else {id(one) for one in file.force_elements if isinstance(one, PointSpring)}
    read -= {id(one) for one in springs_at_world(file)}
    for name, inertia in armatures_passed_over(file).items():
        yield f"p.AddJointActuator({name!r}, p.GetJointByName({name!r})).set_default_rotor_inertia({inertia!r})"
    for element in file.force_elements:
        if isinstance(element, JointSpring):
            joint = f"p.GetJointByName({element.joint!r})"
            kinds = f"(t.RevoluteSpring if {joint}.type_name() == 'revolute' else t.PrismaticSpring)"
            yield f"p.AddForceElement({kinds}({joint}, {element.reference!r}, {element.stiffness!r}))"
        elif isinstance(element, PointSpring) and id(element) not in read:
            ends = ", ".join(f"p.GetBodyByName({body!r}), {list(point)}" for body, point in element.ends)
            yield f"p.AddForceElement(t.LinearSpringDamper({ends}, {element.free_length!r}, {element.stiffness!r}, {element.damping!r}))"


def _instances(plant: Any) -> Iterator[Any]:
    from pydrake.multibody.tree import ModelInstanceIndex

    yield from (ModelInstanceIndex(number) for number in range(plant.num_model_instances()))


# Of a plant without a time step.
_CONTINUOUS = "MultibodyPlant(0.0)"
ENGINE = DrakeEngine()
