"""Engines of other versions, or that are not installed beside the harness, each in an environment and an interpreter of its own.

An environment holds one engine, NumPy, and the two packages that engine files are read with (``REQUIREMENTS``); the harness itself is not
installed in it. ``Interpreter`` runs it and imports the harness's rooms ``engines`` and ``models`` there from where they are here.

Knows nothing of engines but names and versions. May use ``storage``, ``workers``, ``errors``.

Start with ``Environment`` in ``folders``, then ``installation``, which makes one, and ``interpreter``, which runs one.
"""
