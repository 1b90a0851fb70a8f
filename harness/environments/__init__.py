"""Engines of other versions, or that are not installed beside the harness, each in an environment and an interpreter of its own.

An environment holds one engine, NumPy, and the two packages that engine files are read with; the harness itself is not installed in it.
Who runs it is ``harness.engines``.

Knows nothing of engines but names and versions. May use ``storage`` and ``errors``.

Start with ``Environment`` in ``folders``, then ``installation``, which makes one.
"""
