"""Frames, rigid bodies, and what bodies weigh after the bounds of their file."""
