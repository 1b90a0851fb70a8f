"""States to certified truth: accelerations with proven bounds, their data roundoff, the terms, and the comparison with an answer.

May use ``trees`` and what is below it.

Start with ``reference`` and ``compare``; ``sampling`` makes the states. It certifies in double-double by the loops of ``programs``;
``in_balls`` and ``reverse_mode`` give accelerations and derivatives in balls. ``componentwise`` says what error the norm hides; ``terms``
certifies each term by itself. ``manifold`` closes the states of a mechanism with constraints, by ``configurations`` and ``enclosure`` in
balls; ``rank`` says what solving for their forces may lose.
``quantity`` certifies the outputs of any program in blocks. ``quantities`` holds a module for each quantity that engines compute.
"""
