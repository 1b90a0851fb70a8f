"""From a USD stage to its tree of bodies. Start with ``reading``; ``harness.files.document.stage`` has the prims."""
