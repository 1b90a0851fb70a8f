"""Engines asked about robots' files, wherever they are installed."""

from __future__ import annotations

from collections.abc import Sequence

from harness.comparison.callers import CallersLibrary
from harness.comparison.questions import Answers, Question
from harness.engines import Subject, Unsupported, installed_version, load_engine, runs_elsewhere, select_subjects


def robot_subjects(names: Sequence[str] = ()) -> list[Subject]:
    """The subjects called ``names``, as ``mujoco/urdf`` or ``mujoco@3.13.0/urdf``; for none every one that is installed anywhere.

    Raises:
        InvalidRequest: a name no subject has, or whose version no environment holds.
    """
    return select_subjects(CallersLibrary.without_files(), names)


def ask_engine(engine: str, question: Question) -> Answers:
    """What an engine, or a version of it, answers: in this process, or in its environment if it is not installed beside the harness.

    What its version has no interface for is a refusal, and so is an engine that is installed nowhere.
    """
    found = load_engine(CallersLibrary.without_files(), engine)
    if installed_version(found) is None:
        return Answers(refusal=f"{found.requires[1]} is not installed; harness engines add {engine}")
    try:
        answers: Answers = found.evaluate("ask", question) if runs_elsewhere(found) else found.ask(question)  # type: ignore[attr-defined]
    except Unsupported as missing:
        return Answers(refusal=str(missing))
    return answers
