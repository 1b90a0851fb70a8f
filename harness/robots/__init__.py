"""A robot's file as its format's documentation gives it meaning: a tree of bodies, and its equations of motion by recursion.

It is a second truth beside a system's energies. It needs a model file and nothing else, and shares no expression with
Lagrange's equations.

Asks no engine. What meshes weigh, which no file states, is given by who reads the file. May use ``files``,
``equations`` and what is below them.

Start with ``robot``: ``read_robot`` gives a ``Robot``, whose tree is the plain data, with what is left out and what no body can
have. ``bounds`` raises what weighs too little. ``kinematics`` has the joints of a tree as ``nodes``, data of which everything else is a
function: ``recursion`` writes its equations of motion in the axes of the bodies, ``mechanism`` makes a mechanism of them, for all that
works on mechanisms, and ``accelerations`` evaluates them in balls. All are written in terms of ``harness.equations.term``.

``world_motion`` has the bodies as they move along the world's axes. From it ``motion_quantities``, ``force_quantities``, ``regressor``
and ``reactions`` write what engines compute besides, and ``constraints`` the rows of what the file ties beside its joints.
``steps`` writes the state after one step of an integrator by its rule, of the forces of ``step_forces``.

Certified accelerations at states are those of ``harness.certify.reference``.
"""
