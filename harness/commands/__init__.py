"""The commands of ``harness``: every module here without a leading underscore holds one, called ``command``.

A command reads options, runs a study and prints its result; it computes nothing itself. May use ``night`` and what is below it.

Start with ``check``; ``_options`` holds the options and exit statuses that commands share.
"""
