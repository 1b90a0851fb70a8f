"""Plain data of every study, and the history they are kept in.

Imports nothing that computes. May use ``files`` and what is below it.

Start with ``records``; ``history`` stores all of them, the report reads them.
"""
