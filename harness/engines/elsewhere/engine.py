"""An engine that runs in an environment of its own, behind the attributes of its engine file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from harness.engines.engine import handed_over
from harness.environments.folders import Environment
from harness.files.model_file import ModelFile

if TYPE_CHECKING:
    from harness.engines import Engine, Model
    from harness.programs.mechanisms.mechanism import Mechanism


class EngineElsewhere:
    """An ``Engine`` whose models are loaded by the interpreter of an environment; what else it says is said by its engine file here."""

    def __init__(self, engine: Engine, path: Path, module: str, environment: Environment) -> None:
        self.requires, self.formats = engine.requires, engine.formats
        self.environment = environment
        self._engine, self._path, self._module = engine, path, module

    def load(self, source: ModelFile | Mechanism, joints: Sequence[str], gravity: float) -> Model:
        """See ``harness.engines.Engine``; raises what the engine file raises."""
        # Imported late: the interpreter imports this module, and asks no other.
        from harness.engines.elsewhere.interpreter import interpreter_of

        interpreter = interpreter_of(self.environment)
        return interpreter.load(self._path, self._module, self.environment.engine, (handed_over(source), joints, gravity))

    def evaluate(self, method: str, *arguments: Any) -> Any:
        """What a method of the engine file's ``ENGINE`` returns in the environment, or raises there."""
        from harness.engines.elsewhere.interpreter import interpreter_of

        interpreter = interpreter_of(self.environment)
        return interpreter.evaluate(self._path, self._module, self.environment.engine, method, arguments)

    def __getattr__(self, name: str) -> Any:
        # Copies and pickles ask before ``__init__`` has run.
        if name.startswith("_"):
            raise AttributeError(name)
        return getattr(self._engine, name)
