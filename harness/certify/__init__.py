"""States to certified truth: accelerations in balls, their data roundoff, the terms, and the comparison with an answer.

May use ``engines`` and what is below it.

Start with ``reference`` and ``compare``; ``sampling`` makes the states, ``terms`` certifies each term by itself.
"""
