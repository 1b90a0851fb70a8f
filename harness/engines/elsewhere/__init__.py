"""Engines in processes of their own: the interpreter of one, what passes to it and back, and its models behind the usual methods."""
