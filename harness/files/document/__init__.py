"""A model file as elements, each with its place: ``xml`` parses it, ``source`` finds elements and reads their numbers.

``on_disk`` looks at the files that elements name, before anybody opens one.
"""
