"""Energies to programs: what a system file says, and its equations of motion by Lagrange. SymPy stays inside.

Knows no model file and no engine. May use ``programs`` and what is below it.

Start with ``system`` (what an author declares) and ``derivation`` (from file to mechanism, through the cache). ``equations`` derives,
``expressions`` and ``assembly`` write programs. ``constraint`` declares what ties coordinates, ``actuator`` what drives
them.
"""
