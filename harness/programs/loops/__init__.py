"""Programs in double-double with proven bounds, by compiled loops over their instructions.

``interpreter`` certifies: ``encoding`` gives it a program; ``loops``, ``closing``, ``instructions``, ``solution`` and ``double_double`` are
compiled, in the words of ``language`` and ``values``, and ``machine_code`` keeps the result.
"""
