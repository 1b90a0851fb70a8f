"""A model file as elements, each with its place: ``xml`` parses it, ``source`` finds elements and reads their numbers."""
