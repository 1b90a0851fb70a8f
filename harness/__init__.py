"""Certified cross-checks of rigid-body dynamics: textbook Lagrangians against physics engines."""

__version__ = "0.1.0"
