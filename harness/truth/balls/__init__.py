"""Evaluation in ball arithmetic, at any precision: accelerations, derivatives, motions of a rule, and factors of mass matrices."""
