"""Two versions of an engine on the same mechanisms or robots' files: what changed between them, and which version changed it.

May use ``comparison`` and what is below it. Results are plain data of ``harness.results.upgrade``, which says them in sentences.

Start with ``study``, which asks both versions, holds their records against each other, and finds the first version that changed
something. ``portraits`` has what one version makes of a file: the numbers that it holds after loading, and its accelerations.
"""
