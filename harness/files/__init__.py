"""The meaning of model files, MJCF and URDF, as plain data.

Knows no equation and no engine. May use ``library`` and what is below it.

Start with ``tree``, whose joints have the kinds of ``joint_kinds``; ``equalities`` are what a file ties beside its joints, and
``findings`` what it says besides.
"""
