"""States to certified truth: accelerations in balls, their data roundoff, the terms, and the comparison with an answer.

May use ``engines`` and what is below it.

Start with ``reference`` and ``compare``; ``sampling`` makes the states, ``sensitivity`` says what half an ulp in the data does to
an answer, ``componentwise`` what error the norm hides, ``one_number`` whether one number explains the errors of all states;
``terms`` certifies each term by itself.
"""
