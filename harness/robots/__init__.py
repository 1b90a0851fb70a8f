"""A robot's file as its format's documentation gives it meaning: a tree of bodies, and its equations of motion by recursion.

It is a second truth beside a system's energies. It needs a model file and nothing else, and shares no expression with
Lagrange's equations.

Asks no engine. What meshes weigh, which no file states, is given by who reads the file. May use ``models``,
``equations`` and what is below them.

Start with ``robot``: ``read_robot`` gives a ``Robot``, whose tree is the plain data, with what is left out and what no body can
have. ``bounds`` raises what weighs too little; ``recursion``
writes its program in the vectors of ``spatial`` and the joints of ``nodes``; ``mechanism`` makes a mechanism of it, for all that works
on mechanisms, and ``accelerations`` evaluates it in balls.

``free_bodies`` and ``reactions`` write other programs of the same tree, from the bodies as ``world_motion`` has them in the world: every
body kept free, and what each joint transmits. ``constraints`` has the rows of what the file ties beside its joints.
``steps`` writes the state after one step of an integrator by its rule, of the forces of ``step_forces``.

Certified accelerations at states are those of ``harness.certify.robot_reference``.
"""
