"""Adapters: one engine each, a module or a folder that defines ``ENGINE``, found by its name, which is the engine's.

What is particular to an engine's conventions, readers and versions stays in its module or folder.
"""
