"""Robots: what plain and aided engines make of a file beside its certified truth, why, and whether several files say the same.

May use ``diagnosis``, ``crosscheck``, ``truth`` and what is below them. Results are plain data of ``harness.results.comparison``.

Start with ``study``, which asks everything of a file in worker processes. ``truth`` says what an engine is asked and should answer, by
the file and by the readings of ``harness.explain.changes``, by which ``judgement`` explains an answer; ``sameness`` compares files, at
the same states of joints that are each other's (``matching``), and ``constraints`` what no equation of motion of them holds.
``robot_library`` asks engines about files and makes files a library, whose engines are plain or aided, so that a cross-check, a search
and a benchmark take them.

``gap`` divides the difference of two motions among equations, integrator and step length; ``gap_study`` asks for it.
"""
