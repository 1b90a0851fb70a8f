"""From a USD stage to its tree of bodies. Start with ``reading``; ``harness.files.document.stage`` has the prims."""

# Schemas of the root of a robot, of which the second brings the first with it.
ROOTS = frozenset({"PhysicsArticulationRootAPI", "NewtonArticulationRootAPI"})
