"""Engines: programs that return accelerations, each one a file here or in a library's ``engines/``.

An engine file defines ``ENGINE``, an object with the attributes of ``Engine``, and imports the program
it wraps only inside its methods, so that finding engines costs nothing.

Knows no equation. May use ``models`` and what is below it.

Start with ``Engine`` and ``Model``, the protocol, then with ``pinocchio``, which follows it.
"""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from harness.engines._protocol import (
    EQUATIONS,
    Engine,
    HeldBody,
    HeldJoint,
    HeldModel,
    HeldSpring,
    LoadedModel,
    Model,
    Subject,
    Terms,
    Unsupported,
)
from harness.errors import InvalidInput, InvalidModel, InvalidRequest
from harness.library import Library, nearest, run_file
from harness.models.model_file import ModelFile

if TYPE_CHECKING:
    from harness.equations.mechanism import Mechanism

__all__ = [
    "EQUATIONS",
    "Engine",
    "HeldBody",
    "HeldJoint",
    "HeldModel",
    "HeldSpring",
    "LoadedModel",
    "Model",
    "Subject",
    "Terms",
    "Unsupported",
    "engine_names",
    "installed_version",
    "is_native",
    "linear_velocity_in_body",
    "load_engine",
    "load_model",
    "require_model",
    "select_subjects",
    "subjects",
]


def engine_names(library: Library) -> list[str]:
    """Names of all engine files, sorted: those of the harness and those of the library."""
    folders = Library.built_in().engines, library.engines
    return sorted({path.stem for folder in folders for path in folder.glob("*.py") if not path.stem.startswith("_")})


def load_engine(library: Library, name: str) -> Engine:
    """The engine called ``name``; a library's own engine wins over the harness's.

    Raises:
        InvalidInput: the engine file raises or defines no ``ENGINE``.
        InvalidRequest: there is no such engine.
    """
    own = library.engines / f"{name}.py"
    built_in = Library.built_in().engines / f"{name}.py"
    if library.engines != built_in.parent and own.is_file():
        module = run_file(own, f"_harness_engine_{name}")
    elif built_in.is_file():
        module = importlib.import_module(f"harness.engines.{name}")
    else:
        raise InvalidRequest(f"no engine is called {name!r}; {nearest(name, engine_names(library))}")
    engine: Engine | None = getattr(module, "ENGINE", None)
    if engine is None:
        raise InvalidInput(own if own.is_file() else built_in, None, "defines no ENGINE; see CONTRIBUTING, add an engine")
    return engine


def load_model(library: Library, subject: Subject, mechanism: Mechanism, model: ModelFile | None) -> Model:
    """The mechanism as the subject's engine loads it, from ``model`` or, for equations, as it is.

    Raises:
        InvalidModel: the engine refuses the model.
        Unsupported: the engine cannot express the mechanism.
    """
    source = mechanism if model is None else model
    try:
        return load_engine(library, subject.engine).load(source, mechanism.joints, mechanism.gravity)
    except ValueError as error:
        if model is None:
            raise
        raise InvalidModel(model.path, None, f"{subject.engine} refuses it: {error}") from error


def linear_velocity_in_body(engine: Engine) -> bool:
    """True where the engine gives the linear velocity of a free joint in the body's own frame."""
    return bool(getattr(engine, "linear_velocity_in_body", False))


def installed_version(engine: Engine) -> str | None:
    """Version of the program behind an engine, without importing it; None where it is not installed."""
    import importlib.metadata

    module, distribution = engine.requires
    if importlib.util.find_spec(module) is None:
        return None
    try:
        return importlib.metadata.version(distribution)
    except importlib.metadata.PackageNotFoundError:
        return None


def subjects(library: Library) -> list[Subject]:
    """Every subject of every engine, sorted by name."""
    return sorted(Subject(name, model_format) for name in engine_names(library) for model_format in load_engine(library, name).formats)


def is_native(library: Library, subject: Subject) -> bool:
    """True where the format is the engine's own; a question about engines, and not about readers, goes to such subjects."""
    return load_engine(library, subject.engine).formats[0] == subject.format


def select_subjects(library: Library, names: Sequence[str], native_only: bool = False) -> list[Subject]:
    """The subjects called ``names``; for none all of them, or those that are native.

    Raises:
        InvalidRequest: a name no subject has; the message gives the nearest one.
    """
    known = {str(subject): subject for subject in subjects(library)}
    for name in names:
        if name not in known:
            raise InvalidRequest(f"no subject is called {name!r}; {nearest(name, known)}")
    chosen = [known[name] for name in dict.fromkeys(names)]
    return chosen or [subject for subject in known.values() if not native_only or is_native(library, subject)]


def require_model(source: Any, engine: str) -> ModelFile:
    """``source`` as a model file; the error of an engine that was handed equations."""
    if not isinstance(source, ModelFile):
        raise TypeError(f"{engine} reads model files, not {type(source).__name__}")
    return source
