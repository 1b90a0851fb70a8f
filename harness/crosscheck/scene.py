"""One mechanism with its equations and its models: what a method or an integrator is prepared from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from harness.equations.mechanism import Mechanism
from harness.library import MODEL_SUFFIXES, Library
from harness.models.model_file import ModelFile


@dataclass(frozen=True)
class Scene:
    """A mechanism of a library.

    Attributes:
        library: where it is from, and where engines are found.
        mechanism: its equations.
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
        from harness.equations.derivation import load_mechanism
        from harness.library import member_of
        from harness.models.model_file import read_model

        paths = {model_format: library.model_path(name, model_format) for model_format in MODEL_SUFFIXES}
        found = {model_format: read_model(path, model_format) for model_format, path in paths.items() if path.is_file() or member_of(path)}
        return cls(library, load_mechanism(library, name), found)
