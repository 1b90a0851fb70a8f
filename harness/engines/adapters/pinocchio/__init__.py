"""Pinocchio's articulated-body algorithm on a URDF or MJCF model, as ``pinocchio.aba`` computes it.

``abaInParallel`` is faster, but not the same algorithm: it works in the world's frame, where an inertia
about a joint is what is left of one about the origin, and loses digits that ``aba`` keeps.

ABA applies no springs and dampers; those the file declares are added to the applied forces by
``harness.engines.adapters.pinocchio.forces``. The reflected inertias a URDF declares become the model's armature, which ABA
adds to a joint's own inertia. A URDF holds no gravity, so the harness gives it; an MJCF does, and Pinocchio's
reader passes over it, as over much else that ``harness.engines.adapters.pinocchio.mjcf`` refuses by name.

A model with constraints is computed by ``pinocchio.constraintDynamics`` instead, with the settings that
``harness.engines.adapters.pinocchio.constraints`` names and the reasons for them; the constraints are those of the file. Joints that mimic
others are left to ``harness.engines.adapters.pinocchio.mimics``, since all forward dynamics refuse them.

Source: Featherstone, Rigid Body Dynamics Algorithms, section 7.3; Pinocchio 4 documentation.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.engines import Engine, HeldModel, LoadedModel, Terms, Unsupported
from harness.engines.adapters.pinocchio import held, mjcf, robot
from harness.engines.adapters.pinocchio.constraints import LoopConstraints, Solver
from harness.engines.adapters.pinocchio.forces import ForceElements, joint_places
from harness.engines.adapters.pinocchio.mimics import MimicJoints
from harness.engines.adapters.pinocchio.quantities import PinocchioQuantities
from harness.engines.adapters.pinocchio.versions import armature, read_urdf, set_armature
from harness.engines.reading import captured_standard_error
from harness.engines.request import Request
from harness.errors import InvalidModel
from harness.files.equalities import Linkage
from harness.files.model_file import ModelFile


class PinocchioModel(PinocchioQuantities):
    """A ``pinocchio.Model`` with the force elements and the constraints of its file, which are None where it has none."""

    def __init__(
        self,
        model: Any,
        joints: Sequence[str],
        file: ModelFile,
        composites: Mapping[str, Sequence[str]] | None = None,
        mimics: MimicJoints | None = None,
    ) -> None:
        self.model = model
        self._joints = joints
        self._file = file
        self.force_elements: ForceElements = ForceElements(model, file.force_elements, joint_places(model, composites or {}))
        self.constraints = mimics or (LoopConstraints(model, file.constraints) if file.constraints else None)
        # What both solve with.
        self.factorises_mass_matrix = self.constraints is not None
        self._data = model.createData()

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

    def loaded(self) -> LoadedModel:
        model = self.model
        joints = {name: (place.nq, place.nv) for name, place in self.force_elements.places.items()}
        gravity = tuple(float(component) for component in model.gravity.linear)
        mass = float(sum(inertia.mass for inertia in list(model.inertias)[1:]))
        return LoadedModel(joints, (gravity[0], gravity[1], gravity[2]), mass)

    def held(self, positions: Mapping[str, float] | None = None, steps: Mapping[str, Sequence[float]] | None = None) -> HeldModel:
        """See ``harness.engines``; springs and dampers are those the harness adds."""
        return held.held(self.model, self.force_elements, positions or {}, steps or {})

    @cached_property
    def addresses(self) -> tuple[list[int], list[int]]:
        """Position and velocity indices of the joints, in their order; Pinocchio's quaternions end with w.

        Raises:
            InvalidModel: a joint stands in Pinocchio's q as the cosine and sine of its position.
        """
        positions: list[int] = []
        velocities: list[int] = []
        for name in dict.fromkeys(self._joints):
            joint = self.force_elements.places[name]
            if (joint.nq, joint.nv) == (2, 1):
                problem = f"joint {name!r} is continuous, which Pinocchio gives two positions, expected one; make it revolute"
                raise InvalidModel(self._file.path, self._file.joint_lines.get(name, self._file.root_line), problem)
            indices = list(range(joint.idx_q, joint.idx_q + joint.nq))
            if joint.nq > joint.nv:
                indices[-4:] = [indices[-1], *indices[-4:-1]]
            positions += indices
            velocities += range(joint.idx_v, joint.idx_v + joint.nv)
        return positions, velocities

    def columns(self, q: Array, v: Array, tau: Array) -> tuple[Array, Array, Array]:
        """Pinocchio's own (nq, n), (nv, n) and (nv, n), one contiguous column a state; force elements are not added."""
        positions, velocities = self.addresses
        configuration, velocity, force = (np.zeros((size, len(q)), order="F") for size in (self.model.nq, self.model.nv, self.model.nv))
        configuration[positions], velocity[velocities], force[velocities] = q.T, v.T, tau.T
        return configuration, velocity, force

    def forward_dynamics(self, q: Array, v: Array, tau: Array) -> Array:
        import pinocchio

        configuration, velocity, force = self.columns(q, v, tau)
        force += self.force_elements.generalised_forces(configuration, velocity)
        if self.constraints is not None:
            return np.ascontiguousarray(self.constraints.accelerations((configuration, velocity, force))[:, self.addresses[1]])
        accelerations = np.empty((len(q), self.model.nv))
        # Rows of a transpose cost half of what columns cost.
        for state, inputs in enumerate(zip(configuration.T, velocity.T, force.T, strict=True)):
            accelerations[state] = pinocchio.aba(self.model, self._data, *inputs)
        return np.ascontiguousarray(accelerations[:, self.addresses[1]])

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
        import pinocchio

        model, data = self.model, self._data
        configuration, velocity, force = self.columns(q, v, tau)
        force += self.force_elements.generalised_forces(configuration, velocity)
        found = np.empty((len(q), len(self.numbers), 6))
        for state, inputs in enumerate(zip(configuration.T, velocity.T, force.T, strict=True)):
            outside = self.force_elements.on_bodies(*inputs[:2])
            if self.constraints is None:
                accelerations = pinocchio.aba(model, data, *inputs)
            else:
                accelerations, held = self.constraints.with_forces_on_bodies(inputs)
                outside = [one + other for one, other in zip(outside, held, strict=True)]
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
        import pinocchio

        model, velocities = self.model, self.addresses[1]
        weightless = model.copy()
        weightless.gravity.linear = np.zeros(3)
        data, without_gravity = model.createData(), weightless.createData()
        configuration, velocity, force = self.columns(q, v, tau)
        passive = self.force_elements.generalised_forces(configuration, velocity)
        if self.constraints is not None:
            passive = passive + self.constraints.generalised_forces((configuration, velocity, force + passive)).T
        mass, (bias, gravity) = np.empty((len(q), model.nv, model.nv)), np.empty((2, len(q), model.nv))
        for state, (position, rate) in enumerate(zip(configuration.T, velocity.T, strict=True)):
            upper = np.triu(pinocchio.crba(model, data, position))
            mass[state] = upper + np.triu(upper, 1).T
            bias[state] = pinocchio.nonLinearEffects(weightless, without_gravity, position, rate)
            gravity[state] = pinocchio.computeGeneralizedGravity(model, data, position)
        vectors = (np.ascontiguousarray(vector[:, velocities]) for vector in (bias, gravity, passive.T, force.T))
        return Terms(np.ascontiguousarray(mass[:, velocities][:, :, velocities]), *vectors)

    def reading(self, source: str) -> str:
        """Python text that reads the model into ``m``."""
        if self._file.format == "mjcf":
            # This reader takes files only.
            write = f"f = tempfile.NamedTemporaryFile('w'); f.write({source}); f.flush()"
            return f"import numpy as np, pinocchio as pin, tempfile; {write}; m = pin.buildModelFromMJCF(f.name)"
        # Only the harness puts a ball joint at the root; see ``load``.
        ball = f", pin.JointModelSpherical(), {self.model.names[1]!r}" if self.model.joints[1].shortname() == "JointModelSpherical" else ""
        return f"import numpy as np, pinocchio as pin; m = pin.buildModelFromXML({source}{ball})"

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
            f"{self.reading(source)}; m.gravity.linear = np.array({self.model.gravity.linear.tolist()}){added_inertia}\n"
            f"q, v, tau = map(np.array, ({inputs})){remark}\n"
            f"{made}print({call}.tolist(), {expected.tolist()}, sep='\\n')  # engine, certified\n"
        )


class PinocchioEngine(Engine):
    requires = ("pinocchio", "pin")
    formats = ("urdf", "mjcf")
    oldest: Mapping[str, str] = {"urdf": "2.7.0", "mjcf": "3.3.1"}
    # Wheels of that time take whatever versions of these there are.
    companions: Mapping[str, Sequence[str]] = {">=3,<4": ("cmeel-urdfdom<5", "cmeel-tinyxml2<11", "numpy<2.4")}
    linear_velocity_in_body = True
    supplied: Mapping[str, str] = dict.fromkeys(
        formats,
        "gravity, dampers, springs and rotor inertias of joints, springs between points and a ball joint are supplied from the file",
    )
    why_no_equalities = "pin.aba holds no equality, whatever its readers make of it"
    call: Mapping[str, str] = {
        "urdf": "pin.aba(m := pin.buildModelFromUrdf(PATH), m.createData(), q, v, tau)",
        "mjcf": "pin.aba(m := pin.buildModelFromMJCF(PATH), m.createData(), q, v, tau)",
    }

    def read(self, request: Request) -> robot.PinocchioFile:
        return robot.read(request)

    def load_model(self, file: ModelFile, joints: Sequence[str], gravity: float) -> PinocchioModel:
        import pinocchio

        if file.format == "mjcf":
            model, composites = mjcf.read(file)
            model.gravity.linear = np.array(file.gravity)
            return PinocchioModel(model, joints, file, composites)
        _refuse_mimics(file, joints)
        # The reader's reasons go to file descriptor 2 alone; its exceptions do not hold them.
        with captured_standard_error() as captured:
            try:
                # Pinocchio passes over Drake's ball joint, and hangs the root link by whatever joint it is given.
                root = () if file.ball_joint is None else (pinocchio.JointModelSpherical(), file.ball_joint)
                model = read_urdf(file.text, *root)
            except Exception as error:
                raise ValueError(captured() or str(error)) from error
        model.gravity.linear = np.array([0.0, 0.0, -gravity])
        velocities = [model.joints[model.getJointId(one.name)].idx_v for one in file.armatures]
        set_armature(model, velocities, [float(one.armature) for one in file.armatures])
        return PinocchioModel(model, joints, file, mimics=MimicJoints(model, file, root) if file.mimics else None)


def _refuse_mimics(file: ModelFile, joints: Sequence[str]) -> None:
    """Raises Unsupported for followers that nobody asks the accelerations of, and for those beside a loop."""
    for one in file.mimics:
        assert isinstance(one.says, Linkage)
        who = f"line {one.line}: joint {one.name!r} mimics {one.says.leader!r}"
        if one.name not in joints:
            raise Unsupported(f"{who}, and aba refuses such a model")
        if len(file.constraints) > len(file.mimics):
            raise Unsupported(f"{who} in a model with a loop, and constraintDynamics refuses that")


ENGINE = PinocchioEngine()
