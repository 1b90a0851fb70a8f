"""The meaning of model files, MJCF and URDF.

Knows no equation and no engine. May use ``library`` and what is below it.

Start with ``joint_kinds``, by which all that has joints names their kinds.
"""
