"""A model file as its format's documentation gives it meaning: a tree of bodies, and its equations of motion by recursion.

It is a second truth beside a system's energies. It needs a model file and nothing else, and shares no expression with
Lagrange's equations.

Asks no engine. May use ``models``, ``equations`` and what is below them.

Start with ``tree``, the plain data; ``mjcf`` and ``urdf`` read it, ``recursion`` writes its program in the vectors of ``spatial``,
and ``accelerations`` evaluates that in balls.
"""
