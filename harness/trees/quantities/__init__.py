"""Quantities of a tree that engines compute beside accelerations, along the world's axes."""
