"""MJCF and URDF files as text and as meaning: read, validated, and changed in place.

Knows no equation and no engine. May use ``files`` and what is below it.

Start with ``model_file`` (``read_model``); ``checks`` holds a file against the tables of ``formats`` and ``refusals``;
``mjcf`` and ``urdf`` read the tree of a file from the elements of a ``source``;
``text`` finds every number and its line; ``anatomy`` names bodies, joints and inertias in either format.
"""
