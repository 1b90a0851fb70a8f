"""The cross-check: every subject at the same states as the truth, judged.

May use ``certify`` and what is below it.

Start with ``run``; ``tasks`` is what worker processes do, ``judgement`` makes the record, ``expected`` says what is known.
"""
