"""A model file as its author wrote it: every number and its line, changes in place, and texts for people who compare files by eye."""
