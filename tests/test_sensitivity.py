"""A relative change of 1e-11 of any number in any model that enters the equations turns the check red.

Every model of the library is walked, number by number; a number is live where changing it by 1e-3 moves
an acceleration.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from harness import tasks
from harness.attributes import Watch, find_elements, scaled
from harness.derivation import load_mechanism
from harness.engines import Subject, load_engine, subjects
from harness.library import Library
from harness.models import ModelFile, read_model
from harness.records import Record
from harness.run import DEFAULT_STATES, CrossCheck, Settings
from harness.states import sample
from harness.workers import Outcome, Task, Workers

LIBRARY = Library.built_in()
# The members of a family hold the same numbers; the smallest stands for all.
NAMES = [LIBRARY.names_in(path)[0] for path in sorted(LIBRARY.systems.glob("*.py")) if LIBRARY.names_in(path)]
PAIRS = [(name, subject) for name in NAMES for subject in subjects(LIBRARY) if subject.format != "equations"]
CHANGE = 1e-11
VISIBLE_CHANGE = 1e-3


class InThisProcess(Workers):
    """Runs tasks here and now: no engine of this test crashes."""

    def run(self, work: object) -> Iterator[Outcome]:
        for task in work:  # type: ignore[attr-defined]
            assert isinstance(task, Task)
            try:
                yield Outcome(task, value=task.function(*task.arguments, lambda text: None))
            except Exception as error:
                yield Outcome(task, exception=error)


def watch(name: str, subject: Subject, path: Path) -> Watch:
    mechanism = load_mechanism(LIBRARY, name)
    states = sample(mechanism, 32, seed=7)
    engine = load_engine(LIBRARY, subject.engine)

    def answer(model: ModelFile) -> np.ndarray:
        return engine.load(model, mechanism.joints, mechanism.gravity).forward_dynamics(states.q, states.v, states.tau)

    return Watch(read_model(path, subject.format), answer)


class BulkOnly(Settings):
    """The sampled states of a default run without those that hypothesis searches for."""

    @property
    def searched(self) -> int:
        return 0


def check(name: str, subject: Subject, path: Path, kind: type[Settings] = Settings) -> tuple[CrossCheck, Record]:
    states = DEFAULT_STATES if kind is Settings else DEFAULT_STATES - Settings(library=LIBRARY).searched
    stand_ins = {subject.format: path}
    settings = kind(library=LIBRARY, names=[name], subjects=[str(subject)], stand_ins=stand_ins, states=states, examples=None)
    cross_check = CrossCheck(settings, InThisProcess())
    (record,) = cross_check.records()
    assert (record.system, record.subject) == (name, str(subject))
    return cross_check, record


def is_seen(name: str, subject: Subject, path: Path) -> bool:
    """Whether a default run turns red; most changes show before the search begins."""
    for kind in (BulkOnly, Settings):
        cross_check, record = check(name, subject, path, kind)
        if record.verdict in ("disagrees", "unstable") and not record.as_expected and not cross_check.problems:
            return True
    return False


@pytest.fixture(autouse=True)
def without_superfluous_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every changed model would be searched for them again."""
    monkeypatch.setattr(tasks, "find_superfluous", lambda assignment, note: [])


@pytest.mark.parametrize(("name", "subject"), PAIRS, ids=[f"{name}-{subject}" for name, subject in PAIRS])
def test_a_change_of_1e_11_of_any_live_number_is_seen(name: str, subject: Subject, tmp_path: Path) -> None:
    watched = watch(name, subject, LIBRARY.model_path(name, subject.format))
    text = watched.model.text
    changed = tmp_path / watched.model.path.name
    live, unseen = 0, []
    for element in find_elements(text, subject.format):
        together = [number for attribute in element.attributes for number in attribute.numbers if number.value != 0]
        for number in together:
            # Physics may forbid one number to change alone, as one moment of a thin rod; then those of its element change together.
            for numbers in ([number], together):
                moved = watched.accelerations(scaled(text, numbers, 1 + VISIBLE_CHANGE))
                if moved is None:
                    continue
                if np.array_equal(moved, watched.healthy):
                    break
                live += 1
                changed.write_text(scaled(text, numbers, 1 + CHANGE))
                if not is_seen(name, subject, changed):
                    unseen.append(f"line {number.line}: {number.value}")
                break
    assert not unseen
    # Mass, and whatever brings the mechanism back: nothing here moves by less than two numbers.
    assert live >= 2


def test_the_unchanged_models_agree() -> None:
    for name, subject in PAIRS:
        cross_check, record = check(name, subject, LIBRARY.model_path(name, subject.format))
        assert record.as_expected
        assert not cross_check.problems
