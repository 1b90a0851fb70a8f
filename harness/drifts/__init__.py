"""Drift: two simulated motions of one robot from one start under one control, and what their gap is due to.

Everything is on that the files say. What differs is exchanged between the two sides by causes (``harness.results.cause.DriftCause``),
in all subsets, and the gap is divided among them by Shapley values in the kinetic-energy norm. May use ``comparison`` and what is below it.

Start with ``study``. ``plan`` finds the causes that differ and says which motions are needed; ``shares`` makes the division of them;
``lines`` finds the lines of the files where a cause differs; ``control`` reads tables of controls.
"""
