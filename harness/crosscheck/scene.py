"""One mechanism with its equations and its models: what a method or an integrator is prepared from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from harness.crosscheck.assignment import Assignment
from harness.engines import Subject, Unsupported, load_model
from harness.files.model_file import ModelFile
from harness.library import Library, Stance
from harness.programs.mechanisms.mechanism import Mechanism, smooth
from harness.trees.mechanism import RobotMechanism


@dataclass(frozen=True)
class Scene:
    """A mechanism of a library.

    Attributes:
        library: where it is from, and where engines are found, which are called in this process. mechanism: its smooth equations.
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
        return cls(replace(library, calls_engines_here=True), smooth(load_mechanism(library, name)), models)

    def load(self, engine: str, model_format: str) -> Any:
        """The engine's own model of the scene, as ``harness.engines.load_model`` gives it; of a robot, that of its one file.

        Raises:
            harness.engines.Unsupported: the scene has no model of that format, or the engine cannot express it.
            harness.errors.InvalidModel: the engine refuses the model.
        """
        asked = self.asked(engine, model_format)
        return load_model(asked.library, asked.subject, asked.mechanism, asked.model)

    def asked(self, engine: str, model_format: str) -> Assignment:
        """An engine with the scene's model of a format; of a robot, with its one file. Raises Unsupported as ``load``."""
        if not self.library.reads_files and model_format not in self.models:
            raise Unsupported(f"{self.mechanism.name} has no {model_format.upper()} model")
        return Assignment(self.library, Subject(engine, model_format), self.mechanism, self.models.get(model_format))

    @property
    def aided(self) -> Scene:
        """The same whose engines are supplied with what they leave out of a user's file."""
        own, aided = self.mechanism, Stance.AIDED
        if self.library.stance == aided or not isinstance(own, RobotMechanism):
            return self
        from harness.explain.meant import request_of

        return replace(self, library=replace(self.library, stance=aided), mechanism=replace(own, request=request_of(own.robot, aided)))


def with_parameters(mechanism: Mechanism, changed: Mapping[str, float]) -> Mechanism:
    """The mechanism with other values of the parameters named in ``changed``, and the same program."""
    return replace(mechanism, parameters=tuple((name, changed.get(name, value), unit) for name, value, unit in mechanism.parameters))
