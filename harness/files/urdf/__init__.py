"""From a URDF to its tree of bodies. Start with ``reading``."""
