"""The fault campaign: mistakes planted in sound models, what the check catches of them, and what the diagnosis names.

Start with ``campaign``; ``smallest`` finds the smallest change of a number that is caught, ``summary`` holds the bars.
"""
