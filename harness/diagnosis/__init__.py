"""The diagnosis of a record that is not as expected: the party at fault, the term, the line, and the value that explains it.

May use ``crosscheck`` and what is below it.

Start with ``causes``: one cause per record, from the diagnosis of one subject in ``subject``. ``faults`` plants the mistakes that
``harness.explain`` looks for, and others, and counts what is caught and named.
"""
