"""Engines: programs that return accelerations, each one a file of ``adapters`` or in a library's ``engines/``.

An engine file defines ``ENGINE``, an object with the attributes of ``Engine``, and imports the program
it wraps only inside its methods, so that finding engines costs nothing. A library's own engine files are run by worker
processes alone; what the harness itself has to know of them is ``engine_files``.

Knows no equation. May use ``results`` and what is below it.

Start with ``Engine`` and ``Model``, the protocol, then with ``adapters``, one for each engine; ``elsewhere`` runs those in environments of
their own.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Protocol

from harness.arrays import Array
from harness.engines.calls import (
    Call,
    Calls,
    accelerations,
    accelerations_and_gaps,
    asked_accelerations,
    asked_accelerations_and_gaps,
    driving_of,
    factorises_mass_matrix,
    gaps_of,
    loaded_and_asked,
    process_of,
    require_offered,
    timed_answers_of,
    timed_answers_of_each,
)
from harness.engines.engine import EQUATIONS, FORMATS, Engine, Subject, require_model
from harness.engines.files import (
    LOADING_SECONDS,
    EngineFile,
    describe_engines,
    engine_files,
    engine_paths,
    file_engine,
    file_engines,
    installed_version,
    load_engine,
    load_model,
    runs_elsewhere,
)
from harness.engines.interface import (
    HeldBody,
    HeldJoint,
    HeldModel,
    HeldSpring,
    InvalidAnswer,
    LoadedModel,
    Misread,
    NotOffered,
    Terms,
    Unsupported,
)
from harness.environments import environment_of, split_name
from harness.errors import InvalidRequest
from harness.files.rules import ConstraintLaw, Impedance, ImplicitPart, InverseWeight, StepRule
from harness.library import Library, nearest

__all__ = [
    "EQUATIONS",
    "FORMATS",
    "LOADING_SECONDS",
    "Call",
    "Calls",
    "ConstraintLaw",
    "Engine",
    "EngineFile",
    "HeldBody",
    "HeldJoint",
    "HeldModel",
    "HeldSpring",
    "Impedance",
    "ImplicitPart",
    "InvalidAnswer",
    "InverseWeight",
    "LoadedModel",
    "Misread",
    "Model",
    "NotOffered",
    "StepRule",
    "Subject",
    "Terms",
    "Unsupported",
    "accelerations",
    "accelerations_and_gaps",
    "asked_accelerations",
    "asked_accelerations_and_gaps",
    "asked_of",
    "describe_engines",
    "driving_of",
    "engine_files",
    "engine_paths",
    "factorises_mass_matrix",
    "file_engine",
    "file_engines",
    "gaps_of",
    "installed_version",
    "is_native",
    "known_subjects",
    "load_engine",
    "load_model",
    "loaded_and_asked",
    "process_of",
    "require_model",
    "require_offered",
    "runs_elsewhere",
    "select_subjects",
    "subjects",
    "subjects_beside",
    "subjects_of",
    "timed_answers_of",
    "timed_answers_of_each",
]


class Model(Protocol):
    """A mechanism loaded into an engine.

    One that is asked through a pipe has ``process`` and ``answers_of_each``, see ``harness.engines.calls``.

    An engine may also offer what ``harness.engines.interface`` lists; ``gaps(q) -> Mapping[str, Array]``: what the rows of
    each of the file's constraints leave at positions q, (n, rows) [m or rad], by the constraint's name, with ``is_tied``, whether the file
    has any; ``terms(q, v, tau) -> Terms``, arguments and columns as in ``forward_dynamics``; and
    ``held(positions, steps) -> HeldModel``; what it does not offer is not judged. Both arguments of ``held`` are by joint
    and may be left out. Every joint is at zero, or at ``positions`` [m or rad] for one of one position; then it is moved by
    ``steps`` along its velocities.
    """

    def loaded(self) -> LoadedModel | None:
        """The quantities the audit compares; None where there is no model file to audit."""

    def forward_dynamics(self, q: Array, v: Array, tau: Array) -> Array:
        """qdd, (n, nv), at q of shape (n, nq) and v, tau (n, nv); columns follow the joints given to ``load``.

        A rotation stands in q as (w, x, y, z), its velocity in v in the body's frame, both behind the
        position of a free joint.
        """


def subjects(library: Library) -> list[Subject]:
    """Every subject that is asked where none is named, sorted.

    None of versions, of optional engines that are installed nowhere, or of engines that are asked by name alone.
    """
    files = engine_files(library).items()
    others = {name for name, file in files if file.is_asked_by_name or (file.optional and file.version is None)}
    return [one for one in known_subjects(library) if one.engine not in others]


def subjects_beside(library: Library) -> list[Subject]:
    """Those of ``subjects`` whose engine is beside the harness: what is found by them does not depend on which environments there are."""
    return [one for one in subjects(library) if not engine_files(library)[one.engine].elsewhere]


def known_subjects(library: Library) -> list[Subject]:
    """Every subject of every engine, installed or not, sorted; not those of versions."""
    return [subject for subject in _all_subjects(library) if not split_name(subject.engine)[1]]


def subjects_of(library: Library, engine: str) -> list[Subject]:
    """The subjects of one engine, or of one version of it."""
    return [subject for subject in _all_subjects(library) if subject.engine == engine]


def _all_subjects(library: Library) -> list[Subject]:
    return sorted(
        Subject(name, model_format)
        for name, file in engine_files(library).items()
        for model_format in (file.of_users if library.reads_files else file.formats)
    )


def asked_of(library: Library, name: str, among: Sequence[Subject], more: Collection[str] = ()) -> list[Subject]:
    """Those of ``among`` that can be asked of a system, or of a variant: of that, readers of its formats and of ``more``."""
    formats = {*library.formats_of(name), *more, *([] if library.is_variant(name) else [EQUATIONS])}
    return [subject for subject in among if subject.format in formats]


def is_native(library: Library, subject: Subject) -> bool:
    """True where the format is the engine's own; a question about engines, and not about readers, goes to such subjects."""
    formats = engine_files(library)[subject.engine].formats
    # A user has one file, and asks about every engine that reads it.
    return subject.format in (formats if library.reads_files else formats[:1])


def select_subjects(library: Library, names: Sequence[str], native_only: bool = False) -> list[Subject]:
    """The subjects called ``names``, of which one without a format is every subject of an engine, as ``mujoco@3.13.0``.

    For none they are all, or those that are native and beside the harness.

    What is found of an engine does not depend on which environments there are, therefore; what is asked of them is asked by name.

    Raises:
        InvalidRequest: a name no subject has; the message gives the nearest one, or how to make its environment.
    """
    known = {str(subject): subject for subject in _all_subjects(library)}
    asked: list[str] = []
    for name in names:
        called, separator, model_format = name.partition("/")
        engine, version = split_name(called)
        if name not in known and version and engine in engine_files(library):
            called = environment_of(engine, version).name
        name = called + separator + model_format
        found = [name] if name in known else [one for one, subject in known.items() if subject.engine == name]
        if not found:
            raise InvalidRequest(f"no subject is called {name!r}; {nearest(name, known)}")
        asked += found
    chosen = [known[name] for name in dict.fromkeys(asked)]
    if chosen or not native_only:
        return chosen or subjects(library)
    return [one for one in subjects_beside(library) if is_native(library, one)]
