"""One mechanism with its equations and its models: what a method or an integrator is prepared from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from harness.engines import Subject, Unsupported, load_model
from harness.files.model_file import ModelFile
from harness.library import Library
from harness.programs.mechanisms.mechanism import Mechanism


@dataclass(frozen=True)
class Scene:
    """A mechanism of a library.

    Attributes:
        library: where it is from, and where engines are found. mechanism: its equations.
        models: model format, "mjcf" or "urdf", to the validated model file; a format without a file is missing.
    """

    library: Library
    mechanism: Mechanism
    models: Mapping[str, ModelFile]

    @classmethod
    def of(cls, library: Library, name: str) -> Scene:
        """The scene of system ``name``.

        Raises:
            harness.errors.InvalidSystem: the system file cannot be derived.
            harness.errors.InvalidModel: a model file is no well-formed, physical model.
        """
        from harness.files.model_file import read_model
        from harness.lagrange.derivation import load_mechanism

        paths = {form: path for form, path in library.validated_models(name).items() if library.has_model(name, form)}
        models = {model_format: read_model(path, model_format) for model_format, path in paths.items()}
        return cls(library, load_mechanism(library, name), models)

    def load(self, engine: str, model_format: str) -> Any:
        """The engine's own model of the scene, as ``harness.engines.load_model`` gives it; of a robot, that of its one file.

        Raises:
            harness.engines.Unsupported: the scene has no model of that format, or the engine cannot express it.
            harness.errors.InvalidModel: the engine refuses the model.
        """
        if self.mechanism.handed_to_engines is not self.mechanism:
            return load_model(self.library, Subject(engine, model_format), self.mechanism, None)
        if model_format not in self.models:
            raise Unsupported(f"{self.mechanism.name} has no {model_format.upper()} model")
        return load_model(self.library, Subject(engine, model_format), self.mechanism, self.models[model_format])


def with_parameters(mechanism: Mechanism, changed: Mapping[str, float]) -> Mechanism:
    """The mechanism with other values of the parameters named in ``changed``, and the same program."""
    return replace(mechanism, parameters=tuple((name, changed.get(name, value), unit) for name, value, unit in mechanism.parameters))
