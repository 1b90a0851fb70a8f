"""Motion over time: integrators, and trajectories computed to the last digit that they are held against.

May use ``crosscheck`` and what is below it.

Start with ``trajectories`` (the truth of a motion, by Taylor's method); each integrator is a declaration in ``integrators``.
"""
