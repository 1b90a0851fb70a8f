"""Straight-line programs: written with operators, differentiated, and evaluated in float64, double-double and balls.

Knows no system, no model file and no engine. May use ``storage`` and what is below it.

Start with ``program``, plain data, and ``terms``, in whose operators programs are written. ``derivatives`` has the one table of partial
derivatives, ``evaluation`` the one interpreter; ``kernels`` compiles programs by heyoka, beside ``machine_code``, and evaluates them in
balls. ``loops`` certifies them in double-double. ``mechanisms`` holds the equations of motion of a ``Mechanism``, whatever they come from.
"""
