"""States to certified truth: accelerations with proven bounds, their data roundoff, the terms, and the comparison with an answer.

May use ``trees`` and what is below it.

Start with ``reference`` and ``compare``; ``sampling`` makes the states. ``reference`` certifies in double-double, by the loops of
``harness.programs.loops``, and where that is not enough by ``balls``. ``blocks`` certifies the outputs of any program in blocks.
``quantities`` holds what engines compute, each quantity a declaration. ``componentwise`` says what error the norm hides;
``terms`` certifies each term by itself. ``manifold`` closes the states of
a mechanism with constraints, which ``enclosure`` proves.
"""
