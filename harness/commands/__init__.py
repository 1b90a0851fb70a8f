"""The commands of ``harness``: every module here holds one, called ``command``, and says in which of ``SECTIONS`` it is listed.

A command reads options, runs a study and prints its result; it computes nothing itself. May use ``night`` and what is below it.

Start with ``check``; ``frame`` holds what they share: the bracket around each, its options and exit statuses, and what it prints.
"""

SECTIONS = ROBOT, MECHANISM, ENGINES, STUDIES = "Your robot", "Your mechanism", "Engines and versions", "Studies and reports"
