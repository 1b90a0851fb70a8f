"""A mechanism's model in Pinocchio: accelerations by ``aba``, or by what holds its constraints; what it holds; and its reproducer.

Joints, bodies and springs that it holds after loading are placed in the world by Pinocchio's own kinematics.

Source: Featherstone, Rigid Body Dynamics Algorithms, sections 4.4 (joint models) and 7.3; Pinocchio 4 documentation.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np
import pinocchio

from harness.arrays import Array
from harness.engines import HeldBody, HeldJoint, HeldModel, HeldSpring, LoadedModel, Terms, Unsupported
from harness.engines.adapters.pinocchio import mjcf
from harness.engines.adapters.pinocchio.constraints import LoopConstraints, MimicJoints
from harness.engines.adapters.pinocchio.forces import ForceElements, places_of
from harness.engines.adapters.pinocchio.quantities import PinocchioQuantities
from harness.engines.adapters.pinocchio.solver import Solver
from harness.engines.adapters.pinocchio.versions import armature, parent_joint, read_urdf, reasons, set_armature, states
from harness.engines.request import AskedJoint, in_columns
from harness.errors import InvalidModel
from harness.files.equalities import Linkage
from harness.files.joint_kinds import JointKind
from harness.files.model_file import JointDamper, JointSpring, ModelFile

_KINDS = {"JointModelSpherical": JointKind.BALL, "JointModelFreeFlyer": JointKind.FREE, "JointModelPlanar": JointKind.PLANAR}


def load(file: ModelFile, joints: Sequence[str], gravity: float) -> PinocchioModel:
    """See ``harness.engines.Engine.load``."""
    if file.format == "mjcf":
        model = mjcf.read(file)
        model.gravity.linear = np.array(file.gravity)
        return PinocchioModel(model, joints, file)
    _refuse_mimics(file, joints)
    # Pinocchio passes over Drake's ball joint, and hangs the root link by whatever joint it is given.
    root = () if file.ball_joint is None else (pinocchio.JointModelSpherical(), file.ball_joint)
    with reasons(ValueError):
        model = read_urdf(file.text, *root)
    model.gravity.linear = np.array([0.0, 0.0, -gravity])
    velocities = [model.joints[model.getJointId(one.name)].idx_v for one in file.armatures]
    set_armature(model, velocities, [float(one.armature) for one in file.armatures])
    return PinocchioModel(model, joints, file, MimicJoints(model, file, root) if file.mimics else None)


def _refuse_mimics(file: ModelFile, joints: Sequence[str]) -> None:
    """Raises Unsupported for followers that nobody asks the accelerations of, and for those beside a loop."""
    for one in file.mimics:
        assert isinstance(one.says, Linkage)
        who = f"line {one.line}: joint {one.name!r} mimics {one.says.leader!r}"
        if one.name not in joints:
            raise Unsupported(f"{who}, and aba refuses such a model")
        if len(file.constraints) > len(file.mimics):
            raise Unsupported(f"{who} in a model with a loop, and constraintDynamics refuses that")


class PinocchioModel(PinocchioQuantities):
    """A ``pinocchio.Model`` with the force elements and the constraints of its file, which are None where it has none."""

    def __init__(self, model: Any, joints: Sequence[str], file: ModelFile, mimics: MimicJoints | None = None) -> None:
        # What the file means is not asked for: to read it here takes longer than all else that a load does.
        joints_of_file = in_columns([AskedJoint(name, kind, (), (), carrier=carrier) for name, (kind, carrier) in file.joints.items()])
        elements = ForceElements(model, file.force_elements, places_of(model, joints_of_file))
        super().__init__(model, joints, elements, mimics or (LoopConstraints(model, file.constraints) if file.constraints else None))
        self._file = file
        # What both solve with.
        self.factorises_mass_matrix = self.constraints is not None

    def solved_by(self, solver: Solver) -> PinocchioModel:
        """The same model whose constraints another solver holds.

        Raises:
            Unsupported: the model has no constraints that a solver holds.
        """
        if not isinstance(self.constraints, LoopConstraints):
            raise Unsupported("no constraint of the model is left to a solver")
        other = copy.copy(self)
        other.constraints = self.constraints.solved_by(solver)
        return other

    def by_default(self) -> tuple[PinocchioModel, str, str] | None:
        """See ``harness.engines.interface``."""
        if not isinstance(self.constraints, LoopConstraints):
            return None
        own, default = self.constraints.solver, Solver(mu=None)
        return self.solved_by(default), f"{own.algorithm} with {own.told}", default.told

    def loaded(self) -> LoadedModel:
        model = self.model
        joints = {name: (place.nq, place.nv) for name, place in self.force_elements.places.items()}
        mass = float(sum(inertia.mass for inertia in list(model.inertias)[1:]))
        return LoadedModel(joints, tuple(map(float, model.gravity.linear)), mass)

    def held(self, positions: Mapping[str, float] | None = None, steps: Mapping[str, Sequence[float]] | None = None) -> HeldModel:
        """See ``harness.engines``; springs and dampers are those the harness adds."""
        return _held(self.model, self.force_elements, positions or {}, steps or {})

    @cached_property
    def addresses(self) -> tuple[list[int], list[int]]:
        """Places of the joints, in their order.

        Raises:
            InvalidModel: a joint stands in Pinocchio's q as the cosine and sine of its position.
        """
        for name in self._joints:
            place = self.force_elements.places[name]
            if (place.nq, place.nv) == (2, 1):
                problem = f"joint {name!r} is continuous, which Pinocchio gives two positions, expected one; make it revolute"
                raise InvalidModel(self._file.path, self._file.joint_lines.get(name, self._file.root_line), problem)
        return super().addresses

    def forward_dynamics(self, q: Array, v: Array, tau: Array) -> Array:
        columns = self.pulled(q, v, tau)
        if self.constraints is not None:
            return self._vectors(self.constraints.accelerations(columns))
        accelerations = np.empty((len(q), self.model.nv))
        for state, inputs in enumerate(states(*columns)):
            accelerations[state] = pinocchio.aba(self.model, self._data, *inputs)
        return self._vectors(accelerations)

    @property
    def is_tied(self) -> bool:
        """See ``harness.engines``."""
        return self.constraints is not None

    def gaps(self, q: Array) -> dict[str, Array]:
        """See ``harness.engines``; of the frames where Pinocchio has its constraints."""
        still = np.zeros((len(q), self.model.nv))
        return {} if self.constraints is None else self.constraints.gaps(self.columns(q, still, still)[0])

    def reactions(self, q: Array, v: Array, tau: Array) -> Array:
        """See ``harness.engines.interface``: ``data.f`` of ``rnea`` at the accelerations of ``aba``.

        It is what a joint transmits to its body, in the frame of the joint. Springs between points, which neither algorithm knows,
        are added to the forces on joints for ``aba``, and are external forces on bodies for ``rnea``, as are those of constraints.
        Source: Pinocchio documentation, ``rnea`` and ``Data::f``; Featherstone, section 5.3.
        """
        model, data, found = self.model, self._data, np.empty((len(q), len(self.numbers), 6))
        for state, inputs in enumerate(states(*self.pulled(q, v, tau))):
            outside = self.force_elements.on_bodies(*inputs[:2])
            if self.constraints is None:
                accelerations = pinocchio.aba(model, data, *inputs)
            else:
                accelerations, of_constraints = self.constraints.with_forces_on_bodies(inputs)
                outside = [one + other for one, other in zip(outside, of_constraints, strict=True)]
            pinocchio.rnea(model, data, *inputs[:2], accelerations, outside)
            pinocchio.updateGlobalPlacements(model, data)
            for place, joint in enumerate(self.numbers):
                turn, transmitted = data.oMi[joint].rotation, data.f[joint]
                found[state, place] = *(turn @ transmitted.linear), *(turn @ transmitted.angular)
        return found

    def terms(self, q: Array, v: Array, tau: Array) -> Terms:
        """Terms as Pinocchio computes them: M of composite rigid bodies with armature, velocity by inverse dynamics without gravity.

        Passive are the force elements that the harness adds to ABA, which applies none, and the forces of constraints.
        Source: Featherstone, Rigid Body Dynamics Algorithms, chapters 5 (inverse dynamics) and 6 (composite rigid bodies).
        """
        weightless = copy.copy(self)
        weightless.model = self.model.copy()
        weightless.model.gravity.linear = np.zeros(3)
        configuration, velocity, force = self.columns(q, v, tau)
        passive = self.force_elements.generalised_forces(configuration, velocity)
        if self.constraints is not None:
            passive = passive + self.constraints.generalised_forces((configuration, velocity, force + passive)).T
        return Terms(self.mass_matrix(q), weightless.bias(q, v), self.gravity(q), self._vectors(passive.T), self._vectors(force.T))

    def reproducer(self, source: str, q: Array, v: Array, tau: Array, certified: Array) -> str:
        """See ``harness.hard.worst_cases``; what the harness adds for ABA is part of tau."""
        configuration, velocity, force = self.columns(q[None], v[None], tau[None])
        added = self.force_elements.generalised_forces(configuration, velocity)
        expected = np.zeros(self.model.nv)
        expected[self.addresses[1]] = certified
        inputs = ", ".join(str(column[:, 0].tolist()) for column in (configuration, velocity, force + added))
        inertias = armature(self.model)
        added_inertia = f"; m.armature[:] = {inertias.tolist()}" if inertias.any() else ""
        made, call = ("", "pin.aba(m, m.createData(), q, v, tau)") if self.constraints is None else self.constraints.reproducer(source)
        remark = "  # springs and dampers, which ABA does not apply, are in tau" if added.any() else ""
        return (
            f"{self._reading(source)}; m.gravity.linear = np.array({self.model.gravity.linear.tolist()}){added_inertia}\n"
            f"q, v, tau = map(np.array, ({inputs})){remark}\n"
            f"{made}print({call}.tolist(), {expected.tolist()}, sep='\\n')  # engine, certified\n"
        )

    def _reading(self, source: str) -> str:
        """Python text that reads the model into ``m``."""
        if self._file.format == "mjcf":
            # This reader takes files only.
            write = f"f = tempfile.NamedTemporaryFile('w'); f.write({source}); f.flush()"
            return f"import numpy as np, pinocchio as pin, tempfile; {write}; m = pin.buildModelFromMJCF(f.name)"
        # Only the harness puts a ball joint at the root; see ``load``.
        ball = f", pin.JointModelSpherical(), {self.model.names[1]!r}" if self.model.joints[1].shortname() == "JointModelSpherical" else ""
        return f"import numpy as np, pinocchio as pin; m = pin.buildModelFromXML({source}{ball})"


def _held(model: Any, added: ForceElements, positions: Mapping[str, float], steps: Mapping[str, Sequence[float]]) -> HeldModel:
    """``model`` in the configuration of ``Model``, which leaves composite joints at zero; their parts share one ``moved``.

    ``added`` is what the harness adds to ABA.
    """
    elements, places, data = added.elements, added.places, model.createData()
    if not hasattr(data, "joints"):
        raise Unsupported(f"Pinocchio {pinocchio.__version__} does not show how its joints move")
    configuration, velocity = pinocchio.neutral(model), np.zeros(model.nv)
    for name, value in positions.items():
        configuration[places[name].idx_q] = value
    for name, step in steps.items():
        velocity[places[name].idx_v : places[name].idx_v + len(step)] = step
    if steps:
        configuration = pinocchio.integrate(model, configuration, velocity)
    pinocchio.forwardKinematics(model, data, configuration)
    body_names = {parent_joint(frame): frame.name for frame in reversed(model.frames) if frame.type == pinocchio.FrameType.BODY}
    names = {place.idx_v: name for name, place in places.items()}
    joints: dict[str, HeldJoint] = {}
    bodies: dict[str, HeldBody] = {}
    # The last joint of each of Pinocchio's, which may be composed of several.
    last = [""]
    for number in range(1, model.njoints):
        after, above = data.oMi[number], model.parents[number]
        # Not from Jacobians, which rotations that are off by roundings enter three times.
        motions = np.array(data.joints[number].S).reshape(6, -1)
        parent, frame = last[above], data.oMi[above] * model.jointPlacements[number]
        first = model.joints[number].idx_v
        for part, shift in _parts(model.joints[number]):
            frame = frame * shift
            name = names[part.idx_v]
            column = motions[:, part.idx_v - first]
            linear, angular = after.rotation @ column[:3], after.rotation @ column[3:]
            kind = _KINDS.get(part.shortname(), JointKind.HINGE if angular.any() else JointKind.SLIDE)
            turning = not kind.is_single
            springs = [element for element in elements if isinstance(element, JointSpring) and element.joint == name]
            joints[name] = HeldJoint(
                kind=kind,
                parent=parent,
                anchor=frame.translation.copy(),
                moved=after.translation.copy(),
                axis=np.zeros(3) if turning else angular if kind == JointKind.HINGE else linear,
                armature=float(armature(model)[part.idx_v]),
                damping=sum(element.damping for element in elements if isinstance(element, JointDamper) and element.joint == name),
                stiffness=sum(element.stiffness for element in springs),
                spring_reference=springs[-1].reference if springs else 0.0,
                frame=frame.rotation.copy() if turning else np.eye(3),
            )
            parent = name
        last.append(parent)
        inertia, turned = model.inertias[number], after.rotation.astype(np.longdouble)
        about_centre = (turned @ inertia.inertia @ turned.T).astype(np.float64)
        bodies[parent] = HeldBody(float(inertia.mass), after.act(inertia.lever), about_centre, body_names.get(number, ""))
    springs_between_points = tuple(
        HeldSpring(ends, spring.stiffness, spring.damping, spring.free_length)
        for spring, ends in added.ends_of_point_springs(configuration)
        if spring.stiffness or spring.damping
    )
    return HeldModel(model.gravity.linear.copy(), joints, bodies, springs_between_points)


def _parts(joint: Any) -> Iterator[tuple[Any, Any]]:
    """The joints that make up one of Pinocchio's, each with its frame in the one before at zero."""
    if joint.shortname() != "JointModelComposite":
        yield joint, pinocchio.SE3.Identity()
        return
    composite = joint.extract()
    yield from zip(composite.joints, composite.jointPlacements, strict=True)
