"""The cross-check: every subject at the same states as the truth, judged.

May use ``explain`` and what is below it.

Start with ``run``, which goes on where ``loading`` ends; an ``assignment`` is a subject and what it is asked for, ``stages`` is
what worker processes do, ``judgement`` makes the record, ``expected`` says what is known. ``explanation`` tells lost digits from a
wrong number, and ``held`` what no acceleration feels.
"""
