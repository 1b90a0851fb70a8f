"""Programs in double-double with proven bounds, by compiled loops over their instructions.

``interpreter`` certifies, and keeps the machine code: ``encoding`` gives it a program; ``loops``, ``closing``, ``sides``,
``instructions``, ``solution`` and ``double_double`` are compiled, in the words of ``language`` and ``values``.
"""
