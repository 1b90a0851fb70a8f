"""Energies to compiled programs: what a system file says, its equations of motion, and the kernels that evaluate them.

Knows no model file and no engine. May use ``library`` and what is below it.

Start with ``system`` (what an author declares), ``derivation`` (from file to ``Mechanism``, through the cache) and
``mechanism`` (what every later stage is given). ``lagrange`` derives, ``program`` is the one form that ``kernels`` compiles.
``constraint`` declares what ties coordinates, ``constraints`` are its rows, and ``constraint_forces`` what holds them.
"""
