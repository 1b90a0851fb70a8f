"""A robot's file as its format's documentation gives it meaning: a tree of bodies, and its equations of motion by recursion.

It is a second truth beside a system's energies. It needs a model file and nothing else, and shares no expression with
Lagrange's equations.

Asks no engine. What meshes weigh, which no file states, is given by who reads the file. May use ``files``,
``programs`` and what is below them.

Start with ``robot``: ``read_robot`` gives a ``Robot``, whose tree is the plain data, with what is left out and what no body can
have. ``bodies`` has their frames and what they weigh. ``kinematics`` has the joints of a tree as ``nodes``, data of which everything else
is a function: ``recursion`` writes its equations of motion in the axes of the bodies, ``steps`` the state after one step of an integrator
by its rule, and ``mechanism`` makes a mechanism of them, for all that works on mechanisms.

``world_motion`` has the bodies as they move along the world's axes. From it ``quantities`` writes what engines compute besides, and
``rows`` what the file ties beside its joints.

Certified accelerations at states are those of ``harness.truth.reference``.
"""
