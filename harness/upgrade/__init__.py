"""Two versions of an engine on the same mechanisms and robots: what changed between them, and which version changed it.

May use ``diagnosis`` and what is below it.

Start with ``study``, which asks both versions. What counts as a change is said by ``harness.results.trend``; It finds
the terms and readings that changed, and the first version that changed something.
"""
