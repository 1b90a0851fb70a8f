"""A plant in discrete time whose bodies act where they touch in points, with the contacts that Drake finds.

Its steps are those of ``DiscreteContactApproximation.kSap``, which is not the default, and all contacts are in points. Points, normals
and depths of contacts, and friction, stiffness and relaxation time of shapes, are those that Drake holds; how a contact follows from those
of its two shapes is of the documented law.

Sources: Drake documentation, ``MultibodyPlant``, "Accessing point contact parameters", ``set_discrete_contact_approximation`` and
``get_contact_results_output_port``; ``PointPairContactInfo``; ``PenetrationAsPointPair``: nhat_BA_W points from B into A.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from harness.arrays import Array
from harness.engines.adapters.drake import DrakeModel
from harness.engines.adapters.drake.files import CONTINUOUS, FINALIZE, Building
from harness.engines.adapters.drake.step_law import RELAXATION_TIME, STEP, STIFFNESS, combined, combined_friction
from harness.engines.coordinates import FREE
from harness.engines.loaded_file import LoadedFile
from harness.engines.request import Request
from harness.files.contacts import FoundContact
from harness.files.tree import WORLD

# Statements that make the plant p of a diagram d, whose shapes are in g.
_DISCRETE = (
    "from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, ContactModel, DiscreteContactApproximation; "
    f"from pydrake.systems.framework import DiagramBuilder; b = DiagramBuilder(); p, g = AddMultibodyPlantSceneGraph(b, {STEP!r}); "
    "p.SetUseSampledOutputPorts(False); p.set_contact_model(ContactModel.kPoint); "
    "p.set_discrete_contact_approximation(DiscreteContactApproximation.kSap)"
)
_TURNING = "is of a body on a joint that turns about a point, of whose inertia about Drake's axes R is made"
_FRICTIONLESS = "has no friction, of which Drake makes three rows all the same"
_MATERIAL = "material"


def in_diagram(built_by: Building) -> Building:
    """The plant in discrete time, with its shapes."""
    return built_by.replaced(f"p = {CONTINUOUS}", _DISCRETE).replaced(FINALIZE, f"{FINALIZE}; d = b.Build()")


class TouchingFile(LoadedFile):
    """A file in a plant of ``in_diagram``; ``contacts`` are those of the states that were asked last."""

    applies_dampers = True
    applies_springs = True

    def __init__(self, model: DrakeModel, request: Request) -> None:
        super().__init__(request, model.places)
        self.drake, self.plant, self.context, self.made = model, model.plant, model.context, model.made
        self._turning = set(_turned(self.plant, self.context))

    def forward_dynamics(self, q: Array, v: Array, tau: Array) -> Array:
        """See ``LoadedFile``."""
        found, contacts = np.empty((len(q), sum(len(joint.velocities) for joint in self.joints))), list[tuple[FoundContact, ...]]()
        for state in range(len(q)):
            found[state] = self.drake.forward_dynamics(q[state : state + 1], v[state : state + 1], tau[state : state + 1])[0]
            contacts.append(tuple(self._found()))
        self.contacts = contacts
        return found

    def _found(self) -> Iterator[FoundContact]:
        from pydrake.math import RotationMatrix

        results, inspector = self.plant.get_contact_results_output_port().Eval(self.context), self.made["g"].model_inspector()
        for number in range(results.num_point_pair_contacts()):
            contact = results.point_pair_contact_info(number)
            pair = contact.point_pair()
            shapes = [inspector.GetProximityProperties(one) for one in (pair.id_A, pair.id_B)]
            stiffness = [one.GetPropertyOrDefault(_MATERIAL, "point_contact_stiffness", STIFFNESS) for one in shapes]
            times = [one.GetPropertyOrDefault(_MATERIAL, "relaxation_time", RELAXATION_TIME) for one in shapes]
            friction = combined_friction(*(one.GetProperty(_MATERIAL, "coulomb_friction").dynamic_friction() for one in shapes))
            axes = RotationMatrix.MakeFromOneVector(-pair.nhat_BA_W, 2).matrix()
            bodies = [self.plant.get_body(one) for one in (contact.bodyA_index(), contact.bodyB_index())]
            first, second = (WORLD if one.index() == self.plant.world_body().index() else one.name() for one in bodies)
            turning = any(one.index() in self._turning for one in bodies)
            yield FoundContact(
                bodies=(first, second),
                point=tuple(contact.contact_point().tolist()),
                frame=tuple(axes[:, [2, 0, 1]].T.ravel().tolist()),
                distance=-float(pair.depth),
                margin=0.0,
                friction=(friction, friction),
                why_not=_TURNING if turning else "" if friction else _FRICTIONLESS,
                shapes=(inspector.GetName(pair.id_A), inspector.GetName(pair.id_B)),
                compliance=combined(stiffness, times),
            )

    def settled(self, v: Array, steps: Sequence[int]) -> tuple[Array, Array]:
        """See ``LoadedFile``."""
        from pydrake.systems.analysis import Simulator

        drake, columns = self.drake, self.drake.columns
        start = np.zeros(sum(len(joint.positions) for joint in self.request.joints))
        for name, size in columns.sizes.items():
            if size != (1, 1):
                start[self.q_columns[columns.spans(name)[0].stop - 4]] = 1.0
        found, own = np.tile(start, (len(v), 1)), v.copy()
        forces = self.plant.get_applied_generalized_force_input_port()
        for state, count in enumerate(steps):
            drake.take(start[self.q_columns], v[state, self.v_columns])
            forces.FixValue(self.context, np.zeros(drake.width))
            root = self.made["root"]
            root.SetTime(0.0)
            try:
                Simulator(self.made["d"], root).AdvanceTo(count * STEP)
            except RuntimeError:
                # A motion that grows without bound, which Drake ends by saying so.
                found[state] = np.nan
                continue
            positions, velocities = self.plant.GetPositions(self.context), self.plant.GetVelocities(self.context)
            after = np.empty(columns.nq)
            for name, size in columns.sizes.items():
                first = drake.moving[name].position_start()
                given = positions[first : first + size[0]]
                after[columns.spans(name)[0]] = np.concatenate([given[4:], given[:4]]) if size == FREE else given
            turn = columns.turn(after, drake.places, drake.width, drake.rotation_first)
            found[state, self.q_columns], own[state, self.v_columns] = after, turn @ velocities
        return found, own


def _turned(plant: Any, context: Any) -> Iterator[Any]:
    """Bodies that move with a joint of several velocities, by their index, but those that float alone and have no axes of inertia."""
    for joint in map(plant.get_joint, plant.GetJointIndices()):
        if joint.num_velocities() > 1:
            moved = plant.GetBodiesKinematicallyAffectedBy([joint.index()])
            inertia = plant.get_body(moved[0]).CalcSpatialInertiaInBodyFrame(context)
            matrix = inertia.CalcRotationalInertia().CopyToFullMatrix3()
            is_round = not inertia.get_com().any() and np.array_equal(matrix, matrix[0, 0] * np.eye(3))
            if not (joint.num_velocities() == 6 and len(moved) == 1 and is_round):
                yield from moved
