"""The diagnosis of a record that is not as expected: the party at fault, the term, the line, and the value that explains it.

May use ``crosscheck`` and what is below it.

Start with ``causes``: one cause per record, from the diagnosis of one subject. ``hypotheses`` holds the mistakes that
are tried, one declaration each; ``faults`` plants the same mistakes and counts what is caught and named.
"""
