"""Cost against error: of accelerations by every method, and of motions by every integrator.

May use ``comparison``, ``motion``, ``crosscheck`` and what is below them.

Start with ``study`` (what a benchmark measures); each way of computing accelerations is a declaration in ``methods``.
"""
