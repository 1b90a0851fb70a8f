"""From an MJCF to its tree of bodies. Start with ``reading``."""
