"""The night: every study of the harness in one run that can be killed and goes on where it was.

A night is the list of stages in ``stages``. A stage is a list of units: a system, a hard case, a file, a
model. What a unit found is stored together with the mark that it is complete, in one transaction. The answers of units under way are kept
in the cache as they come: a night that goes on asks for what was not answered.

May use ``show`` and what is below it.

Start with ``stage``, which says what a stage declares; ``course`` runs a night or goes on with one.
"""
