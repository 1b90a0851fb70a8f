"""The change of a model or of its truth that explains an engine's answers: what may be wrong, and which of it is.

May use ``truth`` and what is below it. No study stands here: a cross-check, a comparison of files and a campaign of planted faults ask
for the same explanations.

Start with ``changes``: what may be wrong, as data found by name. ``search`` finds the change that explains; ``model_side`` asks an engine
about changed texts of a file, ``textbook_side`` the certified truth about other numbers. ``columns`` are derivatives of answers.
``pattern`` infers the party at fault from who agrees, ``terms`` says which terms or blocks are wrong. ``meant`` is the truth of a file,
``as_read`` the file as an engine reads it, and ``file_numbers`` finds the numbers of a file that explain what is left.
"""
