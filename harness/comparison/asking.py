"""Engines asked about robots' files, wherever they are installed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

from harness.engines import (
    Engine,
    Subject,
    Unsupported,
    file_engine,
    file_engines,
    installed_version,
    load_engine,
    runs_elsewhere,
    select_subjects,
)
from harness.engines.request import EngineAnswers, EngineQuestion
from harness.library import Library


@dataclass(frozen=True)
class FilesLibrary(Library):
    """A library whose files engines read by themselves, as their users hand them over."""

    @classmethod
    def without_files(cls) -> Self:
        """The engines alone."""
        folder = Library.built_in().engines
        return cls("robots", folder, folder, folder, folder / "expected_verdicts.toml", folder / "hard_states")

    @property
    def reads_files(self) -> bool:
        return True

    def native(self, formats: Sequence[str]) -> Sequence[str]:
        """All: a user has one file, and asks about every engine that reads it."""
        return formats


def engine_of(name: str) -> Engine:
    """An engine that users' files are handed to, or a version of it, ``engine@version``, by whose name it goes then."""
    return file_engine(FilesLibrary.without_files(), name)


def engines_of_files() -> dict[str, Engine]:
    """All of them by name, sorted."""
    return file_engines(FilesLibrary.without_files())


def robot_subjects(names: Sequence[str] = ()) -> list[Subject]:
    """The subjects called ``names``, as ``mujoco/urdf`` or ``mujoco@3.13.0/urdf``; for none every one that is installed anywhere.

    Raises:
        InvalidRequest: a name no subject has, or whose version no environment holds.
    """
    return select_subjects(FilesLibrary.without_files(), names)


def ask_engine(engine: str, question: EngineQuestion) -> EngineAnswers:
    """What an engine, or a version of it, answers: in this process, or in its environment if it is not installed beside the harness.

    What its version has no interface for is a refusal, and so is an engine that is installed nowhere.
    """
    found: Any = load_engine(FilesLibrary.without_files(), engine)
    if installed_version(found) is None:
        return EngineAnswers(refusal=f"{found.requires[1]} is not installed; harness engines add {engine}")
    try:
        answers: EngineAnswers = found.evaluate("ask", question) if runs_elsewhere(found) else found.ask(question)
    except Unsupported as missing:
        return EngineAnswers(refusal=str(missing))
    return answers
