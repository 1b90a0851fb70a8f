"""A model file as elements, each with its place: ``xml`` parses it, ``source`` finds elements and reads their numbers.

``stage`` composes a USD file into prims, whose lines ``layer_lines`` finds; it is the one module that imports ``pxr``.
"""
