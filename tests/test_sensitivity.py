"""A relative change of 1e-11 of any number in any model that enters the equations turns the check red.

Every model of the library is walked, number by number; a number is live where changing it by 1e-3 moves
an acceleration.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from harness.derivation import load_mechanism
from harness.engines import Subject, load_engine, subjects
from harness.errors import InvalidModel
from harness.library import Library
from harness.models import ModelFile, read_model
from harness.run import CrossCheck, Settings
from harness.states import sample
from harness.workers import Outcome, Task, Workers

LIBRARY = Library.built_in()
PAIRS = [(name, subject) for name in LIBRARY.system_names() for subject in subjects(LIBRARY) if subject.format != "equations"]
CHANGE = 1e-11
VISIBLE_CHANGE = 1e-3
# Number in an attribute's value or in an element's text; comments are blanked out before.
QUOTED = re.compile(r'"([^"<>]*)"|>([^<>]*)<')
NUMBER = re.compile(r"(?<![\w.+-])[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?(?![\w.])")


class InThisProcess(Workers):
    """Runs tasks here and now: no engine of this test crashes."""

    def run(self, tasks: object) -> Iterator[Outcome]:
        for task in tasks:  # type: ignore[attr-defined]
            assert isinstance(task, Task)
            try:
                yield Outcome(task, value=task.function(*task.arguments, lambda text: None))
            except Exception as error:
                yield Outcome(task, exception=error)


def numbers(text: str) -> list[tuple[int, int]]:
    """(start, end) of every number other than zero in the model, outside comments and declarations."""
    blank = re.sub(r"<!--.*?-->|<\?.*?\?>", lambda match: " " * len(match[0]), text, flags=re.DOTALL)
    spans = []
    for quoted in QUOTED.finditer(blank):
        group = 1 if quoted[1] is not None else 2
        spans += [(quoted.start(group) + number.start(), quoted.start(group) + number.end()) for number in NUMBER.finditer(quoted[group])]
    return [(start, end) for start, end in spans if float(blank[start:end]) != 0]


def scaled(text: str, spans: list[tuple[int, int]], factor: float) -> str:
    for start, end in sorted(spans, reverse=True):
        text = text[:start] + repr(float(text[start:end]) * factor) + text[end:]
    return text


def accelerations(name: str, subject: Subject, model: ModelFile) -> np.ndarray:
    mechanism = load_mechanism(LIBRARY, name)
    states = sample(mechanism, 32, seed=7)
    loaded = load_engine(LIBRARY, subject.engine).load(model, mechanism.joints, mechanism.gravity)
    return loaded.forward_dynamics(states.q, states.v, states.tau)


def check(name: str, subject: Subject, path: Path) -> tuple[CrossCheck, str]:
    settings = Settings(library=LIBRARY, names=[name], subjects=[str(subject)], stand_ins={subject.format: path}, examples=None)
    cross_check = CrossCheck(settings, InThisProcess())
    (record,) = cross_check.records()
    assert (record.system, record.subject) == (name, str(subject))
    return cross_check, record.verdict


@pytest.mark.parametrize(("name", "subject"), PAIRS, ids=[f"{name}-{subject}" for name, subject in PAIRS])
def test_a_change_of_1e_11_of_any_live_number_is_seen(name: str, subject: Subject, tmp_path: Path) -> None:
    path = LIBRARY.model_path(name, subject.format)
    text = path.read_text()
    healthy = accelerations(name, subject, read_model(path, subject.format))
    changed = tmp_path / path.name
    live, unseen = 0, []
    for span in numbers(text):
        # Physics may forbid one number to change alone, as one moment of a thin rod; then those of its element change together.
        element = [other for other in numbers(text) if text.rfind("<", 0, other[0]) == text.rfind("<", 0, span[0])]
        for spans in ([span], element):
            changed.write_text(scaled(text, spans, 1 + VISIBLE_CHANGE))
            try:
                moved = accelerations(name, subject, read_model(changed, subject.format))
            except (InvalidModel, ValueError):
                continue
            if np.array_equal(moved, healthy):
                break
            live += 1
            changed.write_text(scaled(text, spans, 1 + CHANGE))
            cross_check, verdict = check(name, subject, changed)
            if cross_check.problems or verdict not in ("disagrees", "unstable"):
                line = text.count("\n", 0, span[0]) + 1
                unseen.append(f"line {line}: {text[span[0] : span[1]]} gives {verdict} {cross_check.problems}")
            break
    assert not unseen
    # Mass, and whatever brings the mechanism back: nothing here moves by less than two numbers.
    assert live >= 2


def test_the_unchanged_models_agree() -> None:
    for name, subject in PAIRS:
        cross_check, verdict = check(name, subject, LIBRARY.model_path(name, subject.format))
        assert verdict == "agrees"
        assert not cross_check.problems


def test_the_walk_finds_numbers_in_attributes_and_texts() -> None:
    text = '<?xml version="1.0"?>\n<!-- k = "3" -->\n<a x="1 0 -2.5e-3" name="link2"><k>270</k></a>'
    assert [text[start:end] for start, end in numbers(text)] == ["1", "-2.5e-3", "270"]
