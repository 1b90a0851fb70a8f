"""The fault campaign: mistakes planted in sound models, what the check catches of them, and what the diagnosis names.

Start with ``campaign``, which also finds the smallest change of each number that is caught, and asks a ``bench``; ``summary`` holds the
bars.
"""
