"""States of mechanisms with constraints: found, proved to be one configuration, and what solving for the forces there may lose.

Start with ``manifold``.
"""
