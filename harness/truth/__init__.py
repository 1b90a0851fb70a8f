"""States to certified truth: accelerations with proven bounds, their data roundoff, the terms, and the comparison with an answer.

May use ``trees`` and what is below it.

Start with ``reference`` and ``compare``; ``sampling`` makes the states. ``reference`` certifies in double-double, by the loops of
``harness.programs.loops``, and where that is not enough by ``balls``. ``blocks`` certifies the outputs of any program in blocks.
``quantities`` holds a module for each quantity that engines compute. ``componentwise`` says what error the norm hides, ``far_links`` what
an engine loses at links far from the centre of their tree; ``terms`` certifies each term by itself. ``constraints`` closes the states of
a mechanism with constraints.
"""
