"""MJCF and URDF files as text and as meaning: read, validated, and changed in place.

Knows no equation and no engine. May use ``library`` and what is below it.

Start with ``reading``: ``read`` gives what a file means, a ``tree`` whose joints have the kinds of ``joint_kinds``, and the
``equalities`` beside it. ``model_file`` is the reading of a mechanism's model, held against ``lint``; ``facts`` are its forces in float64.
``mjcf`` and ``urdf`` read a tree from the elements of a ``document``; ``text`` finds every number and its line, and writes others in
its place. ``rules`` are what engines document of constraints and steps, as plain data.
"""
