"""Hard cases: the atlas of families with one knob, the search for states at which a subject does worst, and what explains them.

May use ``motion``, ``crosscheck`` and what is below them.

Start with ``atlas``, whose rows ``measurement`` measures, and ``search``; each family is a declaration in ``cases``.
"""
