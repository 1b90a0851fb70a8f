"""A number of dry friction or of limits that an engine has otherwise than the file is named, with the value that it has there."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from comparison.robots import FILES, edited, meant_by

from harness.comparison import switched_on
from harness.comparison.robot_library import ask_engine
from harness.comparison.switched_on import judge_switched_on
from harness.verdict import AGREEMENT

# A hinge with both, another with dry friction, and a tendon with both.
RUBBING = FILES / "rubbing.xml"
NIGHTLY = pytest.mark.nightly
PLANTED = {
    "frictionloss": ('frictionloss=".4"', 'frictionloss=".41"', "joint frictionloss = 0.4: the engine behaves as with 0.41,"),
    "solref": ('solreflimit="-300 -20"', 'solreflimit="-301 -20"', "joint solreflimit = -300: the engine behaves as with -301,"),
    "solimp": ('".8 .9 .05 .4 3"', '".8 .91 .05 .4 3"', "joint solimplimit [1] = 0.9: the engine behaves as with 0.91,"),
    "margin": ('margin=".1"', 'margin=".101"', "joint margin = 0.1: the engine behaves as with 0.101,"),
    "range": ('range="-1 1.2"', 'range="-1 1.21"', "joint range [1] = 1.2: the engine behaves as with 1.21,"),
    "frictionloss of a tendon": ('frictionloss=".3"', 'frictionloss=".31"', "fixed frictionloss = 0.3: the engine behaves as with 0.31,"),
    "range of a tendon": ('range="-.5 .5"', 'range="-.5 .51"', "fixed range [1] = 0.5: the engine behaves as with 0.51,"),
}


@pytest.mark.parametrize("name", [name if name == "frictionloss" else pytest.param(name, marks=NIGHTLY) for name in PLANTED])
def test_a_planted_number_is_named_first(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    old, new, named = PLANTED[name]
    # A ball joint's limit has a departure of its own.
    path = edited(RUBBING, tmp_path, (' type="ball" range="0 .8"', ' axis="1 0 0"'))
    (wrong := tmp_path / "wrong.xml").write_text(path.read_text().replace(old, new))
    assert path.read_text().count(old) == 1

    def asked(engine: str, question: Any) -> Any:
        return ask_engine(engine, replace(question, request=replace(question.request, path=wrong)))

    monkeypatch.setattr(switched_on, "ask_engine", asked)
    record = judge_switched_on(meant_by(path), "mujoco")
    assert not record.explained and record.backward_error is not None and record.backward_error > 10 * AGREEMENT
    assert named in record.rest[0], record.rest
