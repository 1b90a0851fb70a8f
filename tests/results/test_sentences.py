"""What results say where little is known, much changed, or a file came or went, in the words that users read."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from support_results import RECORD

from harness.files.findings import LeftOut
from harness.results.comparison import FileRecord, FilesComparison, PairRecord, SubjectRecord
from harness.results.detail import Detail
from harness.results.hard_states import SearchResult, as_lines
from harness.results.measured import MeasuredNumber, MeasuredRecord
from harness.results.readings import lines_text
from harness.results.records import Records, Representative
from harness.results.shapes import ShapesRecord
from harness.results.survey_conclusion import conclude_changes
from harness.results.switched_on import SwitchedOnRecord, switched_on_text
from harness.results.table import seconds_text
from harness.results.trend import RunChange, run_changes
from harness.results.trend_numbers import MEDIAN, PERCENTILE_99, WORST
from harness.results.upgrade import FILE, Asked, CompiledChange, Upgraded

MASS = MeasuredNumber(cause="mass", owner="body arm", what="mass", place="line 4", value=2.0, fitted=2.5, explained=0.6, error=0.0123)
DAMPING = replace(MASS, owner="joint pin", what="damping", place="", value=0.1, fitted=0.30001, explained=0.925)
LOG = MeasuredRecord(
    path="arm.xml", log="log.csv", mover="mujoco", joints=["pin"], seconds=2.0, gap=0.1234, numbers=(MASS, DAMPING), motions=9
)  # fmt: skip


def test_a_log_is_told_with_the_numbers_that_explain_it_at_once_and_what_it_does_not_tell_apart() -> None:
    size = "log.csv is 0.12 of its way from the motion of arm.xml over 2 s."
    assert LOG.sentence == f"{size[:-1]}. No number of the file explains more of that than the noise of the log may make."
    assert replace(LOG, numbers=(replace(MASS, explained=0.049),)).sentence == f"{size} No number of the file explains 5 % of that alone."
    mass = replace(MASS, alike=("a", "b", "c", "d"), groups=(("gear", "kp"), ("armature",), ("kv",)))
    assert replace(LOG, together=(mass,)).sentence == (
        f"{size} Mass of body arm 2.5 in place of 2 (line 4) explains 60 % of the gap. The log does not tell it from a, b, c and 1 more. "
        "Not identifiable together: mass of body arm, gear and kp (and 2 other groups)."
    )
    both = replace(LOG, together=(MASS, DAMPING))
    assert both.sentence == (
        f"{size} Mass of body arm 2.5 in place of 2 (line 4) and damping of joint pin 0.3 in place of 0.1 explain 92 % of the gap "
        "together; the first alone 60 %."
    )
    head, *rows = str(replace(both, together=(mass, DAMPING)).joint_table).splitlines()
    assert head.split("  ")[0] == "numbers at once" and head.endswith("not identifiable together with")
    assert [" ".join(row.split()) for row in rows] == [
        "mass of body arm 2 2.5 +- 0.01 60.0 % a; b; c; d; gear and kp; armature; kv",
        "damping of joint pin 0.1 0.3 +- 0.01 92.5 %",
    ]


VERSIONS = Upgraded(engine="MuJoCo", before="1", now="2", noun=FILE)


def asked(system: str, before: float, now: float, **more: object) -> Asked:
    own = replace(RECORD, system=system, verdict="agrees", expected="agrees")
    grown = RunChange(system=system, subject=own.subject, what=MEDIAN, before=f"{before:g}", now=f"{now:g}", is_worse=now > before)
    return Asked(before=own, now=own, changes=[grown], **more)  # type: ignore[arg-type]


def test_rounding_that_grew_is_told_with_the_largest_and_counts_against_nobody() -> None:
    found = replace(VERSIONS, asked=[asked("a.xml", 1, 3), asked("b.xml", 2, 30), asked("c.xml", 9, 1)])
    assert found.is_fine(allows_left_out=False) and not any(one.is_worse for one in found.asked)
    assert [*found.lines(allows_left_out=False)] == [
        "No: MuJoCo 2 changes none of 3 files against 1; accelerations are the same to rounding",
        "",
        "rounding: the median error of 2 of 3 grew, the largest that of b.xml from 2 to 30 data roundoffs; up to 64 agrees",
    ]


def test_what_no_version_was_asked_about_is_told_with_lines_or_counts_and_is_not_fine() -> None:
    left = [LeftOut("tendons", (7, 3), True), LeftOut("fluid", (9,), True)]
    one = replace(VERSIONS, asked=[asked("a.xml", 1, 1, left_out=left)])
    assert one.not_compared == "not compared: tendons, lines 3, 7; fluid, line 9"
    assert (one.is_fine(False), one.is_fine(True)) == (False, True)
    assert [*one.lines(False)][1] == f"{one.not_compared} (exit status 1; --allow-uncompared accepts it)"
    assert [*one.lines(True)][1] == one.not_compared
    silent = replace(RECORD, system="c.xml", verdict="unsupported")
    several = replace(one, asked=[*one.asked, asked("b.xml", 1, 1, left_out=left[:1]), Asked(before=silent, now=silent)])
    assert several.not_compared == "not compared: tendons of 2 files; fluid of 1 file; neither version answers about c.xml"


def test_compiled_numbers_that_changed_less_are_counted() -> None:
    numbers = [
        CompiledChange(
            system="a.xml", subject="mujoco/mjcf", quantity=f"q{n}", part="", owners=["x"], before=1.0, now=2.0, size=0.5, felt=True
        )
        for n in range(12)
    ]
    found = replace(VERSIONS, asked=[asked("a.xml", 1, 1, numbers=numbers)])
    brief, whole = ([*found.lines(True, detail)] for detail in (Detail.BRIEF, Detail.ALL))
    assert found.headline.startswith("Yes: MuJoCo 2 changes a.xml against 1: compiled numbers by up to 50 % (")
    shown = sum(" of x " in line for line in brief[1:])
    assert brief[-1] == f"  {12 - shown} more that changed less (--all)" and shown < 12
    assert sum(" of x " in line for line in whole[1:]) == 12 and not any("--all" in line for line in whole)


def subject(path: str, verdict: str) -> SubjectRecord:
    return SubjectRecord(path=path, engine="mujoco", format="mjcf", aided=False, call="", verdict=verdict, explained=verdict == "agrees")


def test_robots_against_an_earlier_state_are_told_with_what_became_of_their_files() -> None:
    files = {
        "same.xml": ("", ""), "mended.xml": ("", "line 3: no mass"), "broken.xml": ("line 4: no name", ""), "moved.xml": ("", ""),
        "bad.xml": ("line 5: no joint", None), "fresh.xml": ("", None), "gone.xml": (None, ""), "paired.xml": ("", ""),
    }  # fmt: skip
    found = FilesComparison()
    for name, problems in files.items():
        for folder, problem in zip(("", "old/"), problems, strict=True):
            if problem is not None:
                found.files.append(FileRecord(path=folder + name, problem=problem))
                verdict = "disagrees" if (folder, name) == ("", "moved.xml") else "agrees"
                found.subjects += [] if problem else [subject(folder + name, verdict)]
    found.pairs.append(PairRecord(first="old/paired.xml", second="paired.xml", same=False, problem="joint pin is in one alone"))
    now = [name for name, (problem, _) in files.items() if problem is not None]
    before = {name: f"old/{name}" for name, (_, problem) in files.items() if problem is not None}
    told = conclude_changes(found, now, before, "main")
    assert told.sentence == "7 of 8 robots differ from main: bad.xml, broken.xml, fresh.xml, gone.xml and 3 more."
    rows = dict(row.split(": ", 1) for row in told.rows if not row.startswith("  "))
    assert rows.keys() == files.keys() - {"same.xml"}
    assert rows["mended.xml"] == "can be read; before: line 3: no mass."
    assert rows["broken.xml"] == "cannot be read: line 4: no name."
    assert rows["bad.xml"] == "new; it cannot be read: line 5: no joint."
    assert (rows["fresh.xml"], rows["gone.xml"], rows["moved.xml"]) == ("new.", "no longer there.", "the same robot as before.")
    assert "joint pin is in one alone" in rows["paired.xml"]
    assert "  engines: mujoco/mjcf agrees; each outcome is as before" in told.rows and "  engines: none was asked" in told.rows
    assert conclude_changes(found, ["same.xml"], {"same.xml": "old/same.xml"}, "main").sentence == "1 robot: none differs from main."


def test_a_solver_that_ends_elsewhere_is_told_with_what_it_leaves() -> None:
    about = SwitchedOnRecord(path="a.xml", engine="mujoco", format="mjcf", parts=[], verdict="explained")
    own = replace(about, backward_error=900.0, to_the_end=2.0)
    stops = "stops its solver 900 data roundoffs before the solution that it documents"
    beside = replace(own, fault="It stops early", remedy="set iterations")
    assert switched_on_text(beside) == (
        "ends 900 data roundoffs beside the solution that it documents, and 2.00 with other settings. It stops early: set iterations"
    )
    assert switched_on_text(own) == f"{stops}, and 2.00 where it goes on to the end"
    share = replace(own, left=0.25, remedy="ask less of it")
    assert switched_on_text(share) == f"{stops}, by 25 % of the tolerance that it documents: ask less of it"


def test_states_without_truth_are_counted_in_a_search() -> None:
    name = "mujoco/mjcf"
    found = SearchResult(states={name: 2000}, undecided={name: 1200}, worst={name: 3.21}, place=Path("found.json"))
    told = "mujoco/mjcf: 2,000 states tried, 1,200 of them without certified truth; the worst had 3.21 data roundoffs"
    assert told in as_lines(found)
    assert told.replace(", 1,200 of them without certified truth", "") in as_lines(replace(found, undecided={name: 0}))


@pytest.mark.parametrize(("error", "size"), [(None, "no backward error"), (81.25, "backward error 81.2 data roundoffs")])
def test_the_simplest_state_is_told_with_or_without_an_error(error: float | None, size: str) -> None:
    shown = Representative(state=RECORD.worst_state, backward_error=error, replay="harness check arm_2r --state '{}'")
    assert f"  the simplest state that shows it: {size}" in replace(RECORD, representative=shown).explanation.splitlines()


def test_origins_are_ranges_over_the_records_that_say_them() -> None:
    some, more = (replace(RECORD, origins={"sampled": sampled, "stored": 3}) for sampled in (900, 1000))
    assert Records([RECORD]).origins == ""
    assert Records([RECORD, some, more]).origins == (
        "states: 900 to 1,000 sampled, 0 searched for by hypothesis; on top 3 stored with the system, "
        "0 simplest failing ones of this run and earlier ones"
    )


def test_shapes_that_an_engine_finds_are_told_in_a_sentence() -> None:
    found = ShapesRecord(verdict="agrees", contacts=0, given=0, error=0.0)
    assert found.text == "no shapes touch, and none do by the file"
    assert replace(found, given=2).text == "no contact is of shapes with a closed form; 2 contacts of other shapes taken as found"
    assert replace(found, contacts=1, given=1, error=3.0, rule="It cuts corners").text == (
        "1 contact within 3.00 roundoffs of where the engine's own rule has them; 1 contact of other shapes taken as found. It cuts corners"
    )
    assert replace(found, rest=["a is apart"]).text == "other contacts than the file has: a is apart"
    assert replace(found, rest=["a is apart", "b", "c"]).text == "other contacts than the file has: a is apart, and 2 further differences"


def test_lines_and_times_that_are_none_have_words() -> None:
    assert [lines_text(lines, 2) for lines in ((), (3,), (5, 3, 5), (9, 1, 4))] == [
        "no line of the file", "line 3", "lines 3, 5", "lines 1, 4 and 1 more",
    ]  # fmt: skip
    assert [seconds_text(time) for time in (None, 2.0, 2e-3, 2e-6, 2e-9)] == ["-", "2.00 s", "2.00 ms", "2.00 µs", "2.00 ns"]


def test_errors_of_answers_to_different_questions_are_no_changes() -> None:
    was, now = (replace(RECORD, verdict=verdict, backward_error=error) for verdict, error in (("disagrees", 1e6), ("explained", 1.0)))
    assert "worst backward error" in {one.what for one in run_changes([was], [replace(now, verdict="agrees")])}
    assert {one.what for one in run_changes([was], [now])} & {MEDIAN, PERCENTILE_99, WORST} == set()
