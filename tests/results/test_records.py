"""Records explain themselves, their tables show everywhere, and their JSON is strict."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from support_results import CARD, RECORD, RUN

from harness.errors import InvalidInput
from harness.results.plain_json import to_json
from harness.results.records import Records
from harness.storage import write_atomically

AGREEING = replace(RECORD, subject="lagrange", verdict="agrees", backward_error=1.5, verdict_counts={"agrees": 1000})


def test_records_stand_by_system_and_subject_and_are_a_sequence() -> None:
    records = Records([RECORD, AGREEING])
    assert list(records) == [AGREEING, RECORD] and records[0] == AGREEING and len(records) == 2
    assert records[1:] == [RECORD] and isinstance(records[1:], Records)
    assert records.unexpected == [RECORD] and records != [RECORD]


def test_a_table_of_records_is_the_same_in_a_terminal_and_in_a_notebook() -> None:
    records = Records([RECORD, AGREEING])
    lines = str(records).splitlines()
    assert lines[0].split()[:4] == ["system", "subject", "states", "verdict"]
    assert lines[1].split() == ["arm_2r", "lagrange", "1,000", "agrees", "1.50", "1.00e-17", "2.00", "µs"]
    assert "disagrees (expected agrees)" in lines[2] and " inf " in lines[2]
    page = records._repr_html_()
    assert all(word in page for word in ("arm_2r", "lagrange", "disagrees (expected agrees)", "1.00e-17", "2.00 µs"))


def test_an_unexpected_record_says_how_to_go_on() -> None:
    lines = replace(RECORD, expected="unstable", expected_reason="known", expected_link="a page").explanation.splitlines()
    assert lines[0] == "arm_2r mujoco/mjcf: disagrees, expected unstable"
    assert "  expected because known (a page)" in lines and lines[-1] == "  replay: harness check arm_2r"


def test_a_known_misreading_is_red_where_it_is_expected_too() -> None:
    misread = replace(RECORD, verdict="misreads", expected="misreads")
    assert misread.as_expected and misread.is_noteworthy
    shown = Records([misread]).brief().terminal()
    styles = {str(style) for column in shown.columns for cell in column.cells if (style := getattr(cell, "style", ""))}
    assert misread.marked_verdict.value == "misreads (as expected)" and styles == {"red"}
    assert json.loads(to_json(RUN, [misread]))["records"][0]["verdict"] == "misreads"


def test_constraints_that_give_have_a_word_and_a_colour_of_their_own() -> None:
    soft = replace(AGREEING, from_rigid=2.58)
    shown = Records([soft]).brief().terminal()
    assert soft.as_expected and soft.marked_verdict.value == "soft, as documented: 258 % from rigid"
    assert {str(style) for column in shown.columns for cell in column.cells if (style := getattr(cell, "style", ""))} == {"cyan"}
    assert replace(soft, from_rigid=1e-15).marked_verdict.value == "agrees"


def test_json_is_strict_and_keeps_the_contract() -> None:
    document = json.loads(to_json(RUN, [RECORD, replace(RECORD, relative_error=math.nan)], [CARD]), parse_constant=pytest.fail)
    assert document["harness"] == RUN.versions
    assert document["run"]["seed"] == 7
    first, second = document["records"]
    contract = "system subject states verdict expected backward_error relative_error worst_state seconds_per_state message"
    assert set(contract.split()) <= set(first)
    assert (first["backward_error"], second["relative_error"]) == ("inf", "nan")
    assert first["worst_state"] == RECORD.worst_state
    assert not first["as_expected"]
    assert document["systems"][0]["name"] == "arm_2r"


def test_json_takes_numpy_numbers() -> None:
    import numpy as np

    values: dict[str, Any] = {"states": np.int64(3), "backward_error": np.float32(0.5)}
    record = replace(RECORD, worst_state={"q": [np.float64(0.1)], "v": [], "tau": []}, **values)
    data = json.loads(to_json(RUN, [record]))["records"][0]
    assert (data["states"], data["backward_error"], data["worst_state"]["q"]) == (3, 0.5, [0.1])


def test_a_file_is_replaced_whole_or_not_at_all(tmp_path: Path) -> None:
    target = tmp_path / "records.json"
    target.write_text("old")
    with pytest.raises(TypeError):
        write_atomically(target, to_json(RUN, [replace(RECORD, message=object())]))  # type: ignore[arg-type]
    assert target.read_text() == "old"
    write_atomically(target, to_json(RUN, [RECORD]))
    assert json.loads(target.read_text())["records"]
    assert list(tmp_path.iterdir()) == [target]


def test_writing_follows_links_and_spares_devices(tmp_path: Path) -> None:
    (tmp_path / "real").write_text("old")
    (tmp_path / "link").symlink_to("real")
    write_atomically(tmp_path / "link", "new")
    assert (tmp_path / "link").is_symlink() and (tmp_path / "real").read_text() == "new"
    write_atomically("/dev/null", "nothing")
    assert not Path("/dev/null").is_file()
    with pytest.raises(InvalidInput, match="folder that exists"):
        write_atomically(tmp_path / "absent" / "file", "text")


def test_records_and_runs_reject_what_a_report_could_not_show() -> None:
    with pytest.raises(ValueError, match="no verdict"):
        replace(RECORD, verdict="fine")
    with pytest.raises(ValueError, match="expected UTC"):
        replace(RUN, started="2026-01-31T02:00:00")
    with pytest.raises(ValueError, match="without a path"):
        replace(RUN, library="some/where")
