"""The commands of ``harness``: every module here holds one, called ``command``.

A command reads options, runs a study and prints its result; it computes nothing itself. May use ``night`` and what is below it.

Start with ``check``; ``frame`` holds what they share: the bracket around each, its options and exit statuses, and what it prints.
"""
