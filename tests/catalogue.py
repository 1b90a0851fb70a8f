"""The systems that tests run over, and how many states they take; it imports nothing that takes long."""

from __future__ import annotations

import os

from harness.library import MODEL_SUFFIXES, Library, member_of

BUILT_IN = Library.built_in()
# CI takes minutes longer than a run at the desk, which takes fewer states and a seeded sample of what is alike.
IN_CI = bool(os.environ.get("CI"))
STATES = 1000 if IN_CI else 100


def turns_freely(name: str) -> bool:
    """Whether a built-in system has a ball or free joint, whose positions and velocities are not those of its text."""
    path = BUILT_IN.system_path(name)
    return path.is_file() and "Attitude(" in path.read_text()


def is_tied(name: str, library: Library = BUILT_IN) -> bool:
    """Whether a system has constraints beside its joints; without deriving it, since every process asks while it collects the tests."""
    path = library.system_path(name)
    member = member_of(path)
    return "constraints=" in (path if member is None else member[0]).read_text(encoding="utf-8")


# Systems whose joints carry their coordinates themselves.
PLAIN = [name for name in BUILT_IN.system_names() if not turns_freely(name)]
VARIANTS = BUILT_IN.variant_names()
# Every model file: of a system's own and of its variants.
MODELS = [
    (name, model_format)
    for name in [*BUILT_IN.system_names(), *VARIANTS]
    for model_format in MODEL_SUFFIXES
    if BUILT_IN.has_model(name, model_format)
]
MODELLED = [name for name in BUILT_IN.system_names() if all(BUILT_IN.has_model(name, form) for form in MODEL_SUFFIXES)]
# Those whose tree is all that moves.
TREES = [name for name in MODELLED if not is_tied(name)]
