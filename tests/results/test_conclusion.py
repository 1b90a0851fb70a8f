"""The answer of a comparison in a sentence, with the rows that matter: what it says, and how long it is at worst."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

from harness.commands.frame.terminal import print_sections
from harness.files.findings import Impossible, LeftOut
from harness.report.comparison import told
from harness.results.comparison import (
    FileDifference,
    FileRecord,
    FilesComparison,
    LockedJoint,
    PairRecord,
    SubjectRecord,
)
from harness.results.conclusion import conclude
from harness.results.detail import Detail
from harness.results.pair_conclusion import conclude_pair, summary
from harness.results.readings import Effect, explanation, share_text
from harness.results.survey_conclusion import conclude_survey, outcome_text
from harness.results.switched_on import SwitchedOnPart, SwitchedOnRecord

FILE = FileRecord(path="/robots/r.urdf", format="urdf", bodies=3, joints=2, degrees_of_freedom=2, total_mass=5.0, states=64)


def effect(name: str = "joint damping", alone: float | None = 0.47, **given: Any) -> Effect:
    about = {"sentence": f"Pinocchio applies no {name}", "remedy": "add -d v to tau", "lines": (9, 25), "concerns": "joints", "source": "s"}
    return Effect(name=name, alone=alone, **{**about, **given})


def subject(engine: str, title: str, verdict: str = "agrees", explained: bool = True, **given: Any) -> SubjectRecord:
    about: dict[str, Any] = {"path": FILE.path, "format": "urdf", "aided": False, "call": "call()", "backward_error": 2.5}
    return SubjectRecord(engine=engine, title=title, verdict=verdict, explained=explained, **{**about, **given})


MIMIC = effect("mimic joints", 0.14, sentence="MuJoCo holds a mimic joint by a soft constraint", remedy="keep it on", lines=(3,))
WORLDS = effect("further worlds", None, sentence="its reader reads a world twice", remedy="write one")
AGREES = subject("mujoco", "MuJoCo")
DAMPED = subject("pinocchio", "Pinocchio", "disagrees", readings=[effect()], left=0.6, relative_error=0.71)
MIMICS = subject("mujoco", "MuJoCo", "disagrees", readings=[MIMIC], left=3.5)
ALSO = subject("pinocchio", "Pinocchio", "disagrees", readings=[MIMIC], left=1.5)
SAID = "Pinocchio applies no joint damping (47 % of qdd): add -d v to tau."
SENTENCES = {
    "all agree": ([AGREES, subject("pinocchio", "Pinocchio")], "MuJoCo and Pinocchio agree with the file to rounding."),
    "one agrees": ([AGREES, DAMPED], f"MuJoCo agrees with the file, and Pinocchio does not. {SAID}"),
    "none agrees": (
        [MIMICS, DAMPED],
        f"MuJoCo and Pinocchio disagree with each other and with the file. {SAID} MuJoCo holds a mimic joint by a soft constraint (14 %).",
    ),
    "alike": ([MIMICS, ALSO], "MuJoCo and Pinocchio agree with each other, and not with the file. MuJoCo holds"),
    "one engine": ([DAMPED], f"Pinocchio does not agree with the file. {SAID}"),
    "unexplained": (
        [AGREES, subject("pinocchio", "Pinocchio", "disagrees", False, relative_error=0.06)],
        "MuJoCo agrees with the file, and Pinocchio does not. No known reading explains Pinocchio (6 % of qdd).",
    ),
    "refused": (
        [subject("mujoco", "MuJoCo", "unsupported", message="mass is 0"), subject("pinocchio", "Pinocchio")],
        "Pinocchio agrees with the file to rounding. MuJoCo refuses the file: mass is 0.",
    ),
    "refused for its inertias": (
        [subject("mujoco", "MuJoCo", "unsupported", message="A + B < C")],
        "no engine gives an answer that can be judged. MuJoCo refuses the file: A + B < C; "
        "write inertias that a body can have (lines 1, 2, 3 and 1 more).",
    ),
    "died": (
        [subject("mujoco", "MuJoCo", "error", False, message="it aborted")],
        "no engine gives an answer that can be judged. MuJoCo fails on the file: it aborted.",
    ),
    "without an answer, for its inertias": (
        [subject("pinocchio", "Pinocchio", "error", False, rest=["it answers with finite numbers at no state"])],
        "no engine gives an answer that can be judged. Pinocchio fails on the file: it answers with finite numbers at no state; "
        "write inertias that a body can have (lines 1, 2, 3 and 1 more).",
    ),
    "undecided": (
        [subject("mujoco", "MuJoCo", "undecided", message="M is singular")],
        "no engine gives an answer that can be judged. MuJoCo cannot be judged: M is singular.",
    ),
    "another robot": (
        [subject("pinocchio", "Pinocchio", "disagrees", another_robot="it drops every joint")],
        "no engine gives an answer that can be judged. Pinocchio reads another robot: it drops every joint.",
    ),
    "another robot by a reading that is known": (
        [AGREES, subject("pinocchio", "Pinocchio", "disagrees", another_robot="it has j1 (world 2)", readings=[MIMIC, WORLDS])],
        "MuJoCo agrees with the file to rounding. Pinocchio reads another robot (its reader reads a world twice): write one.",
    ),
    "digits lost": (
        [AGREES, subject("pinocchio", "Pinocchio", "unstable", lost_digits="at 3 of 64 states", relative_error=1e-9)],
        "MuJoCo and Pinocchio agree with the file but for lost digits. Pinocchio loses digits (1e-07 % of qdd).",
    ),
    "a version": (
        [subject("mujoco@3.13.0", "MuJoCo", "disagrees", readings=[MIMIC])],
        "MuJoCo 3.13.0 does not agree with the file. MuJoCo holds a mimic joint by a soft constraint (14 % of qdd): keep it on.",
    ),
    "nobody asked": ([], "no engine was asked."),
}


@pytest.mark.parametrize("case", SENTENCES)
def test_the_first_sentence_answers_whether_the_engines_agree(case: str) -> None:
    subjects, sentence = SENTENCES[case]
    impossible = [Impossible(f"link {line}", line, "A + B < C", (1.0,), 0.1, (1.0,)) for line in (1, 2, 3, 4)]
    file = replace(FILE, impossible=impossible) if "inertias" in case else FILE
    found = FilesComparison(files=[file], subjects=subjects)
    assert conclude(found, file).sentence.startswith(f"r.urdf: {sentence}")
    assert summary(found) == conclude(found, file).sentence


def test_what_is_switched_on_stands_in_the_first_sentence_where_it_is_felt() -> None:
    parts = [SwitchedOnPart(what="actuators", kind="motor", line=line) for line in (3, 4)]
    about: dict[str, Any] = {"path": FILE.path, "engine": "mujoco", "title": "MuJoCo", "format": "urdf", "parts": parts}
    wrong = SwitchedOnRecord(**about, verdict="disagrees", explained=False, backward_error=1e9, together=0.5)
    right = replace(wrong, verdict="agrees", explained=True, backward_error=2.0)
    still = replace(right, together=1e-15)
    apart = "its documentation, 50 % of qdd away from the file without them. With all of it off MuJoCo agrees with the file"
    for record, said in ((wrong, f"is 1.00e+09 data roundoffs away from {apart}"), (right, f"agrees with {apart}")):
        found = conclude(FilesComparison(files=[FILE], subjects=[AGREES], switched_on=[record]), FILE)
        assert found.sentence.startswith(f"r.urdf: With the file's 2 actuators on MuJoCo {said}")
    found = conclude(FilesComparison(files=[FILE], subjects=[AGREES], switched_on=[still]), FILE)
    assert found.sentence.startswith("r.urdf: MuJoCo agrees with the file")
    assert any(str(row).startswith("With the file's 2 actuators on MuJoCo agrees") for row in found.rows)


def test_a_row_has_effect_lines_and_remedy() -> None:
    still = effect("nothing", 0.0, sentence="Pinocchio drops a name")
    tiny = [effect(f"reading {number}", 1e-4, sentence=f"Pinocchio does {number}") for number in range(5)]
    found = FilesComparison(files=[FILE], subjects=[replace(DAMPED, readings=[*tiny, still, effect()])])
    rows = conclude(found, FILE).rows
    assert rows[0] == "  47 %  Pinocchio applies no joint damping (2 joints, lines 9, 25): add -d v to tau"
    assert rows[1:3] == ("5 more below 0.001 of the largest (--all)", "1 reading without an effect (--all)")
    assert "nothing  Pinocchio drops a name (2 joints, lines 9, 25): add -d v to tau" in conclude(found, FILE, Detail.ALL).rows
    assert sum("Pinocchio does" in str(row) for row in conclude(found, FILE, Detail.ALL).rows) == 5


def test_what_is_left_out_is_one_line_of_counts_or_all_of_it() -> None:
    file = replace(FILE, left_out=[LeftOut("contacts", (3, 4), True), LeftOut("safety controllers", (9,), False)])
    found = FilesComparison(files=[file], subjects=[AGREES])
    assert conclude(found, file).rows[-1] == "Not compared: contacts (2), 1 element that moves nothing"
    assert conclude(found, file, Detail.ALL).rows[-2:] == (
        "Not compared: contacts, 2, lines 3, 4: would move it",
        "Not compared: safety controllers, 1, line 9: no acceleration feels it at given tau",
    )


def test_readings_in_a_cell() -> None:
    readings = [effect("a", 0.14), effect("b", 0.47), effect("c", 1e-5), effect("d", 0.0)]
    assert explanation(readings) == "b 47 %, a 14 %, 1 more"
    assert explanation(readings, 1) == "b 47 %, 2 more"
    assert outcome_text(replace(DAMPED, readings=readings)) == "explained: b 47 %, a 14 %, 1 more"
    assert outcome_text(subject("mujoco", "MuJoCo", "disagrees", False, relative_error=0.06)) == "unexplained 6 %"


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (0.47, "47 %"),
        (0.00123, "0.12 %"),
        (5e-9, "5e-07 %"),
        (1.0, "100 %"),
        (3.34, "334 %"),
        (37.9, "38 times"),
        (12345.0, "1e+04 times"),
        (math.inf, "joints lost"),
        (None, "unknown"),
    ],
)
def test_a_share_is_a_percentage_below_ten_times(change: float | None, text: str) -> None:
    assert share_text(change) == text


def difference(kind: str, owner: str, alone: float | None, first: str = "10", second: str = "0.1") -> FileDifference:
    return FileDifference(
        what=f"{kind} of {owner}", first=first, second=second, first_place="r.urdf:12", second_place="r.urdf:34", alone=alone
    )


PAIR = PairRecord(first="/old/r.urdf", second="/new/r.urdf", same=False, alike=False, backward_error=1e12, relative_error=0.5)


def test_equal_kinds_of_differences_are_one_row() -> None:
    dampings = [difference("damping", f"joint j{number}", 0.4 / (number + 1)) for number in range(7)]
    masses = [difference("mass", f"link l{number}", 0.1, str(number)) for number in range(3)]
    tiny = [difference("armature", "joint j1", 1e-5)]
    pair = replace(PAIR, differences=[*dampings, *masses, *tiny])
    found = conclude_pair(pair)
    said = "damping of 7 joints, 10 (old/r.urdf:12) against 0.1 (new/r.urdf:34), changes qdd by 40 % (in all 50 %)"
    assert found.sentence == f"old/r.urdf and new/r.urdf differ: {said}."
    table, others = found.rows
    assert [row[0] for row in table.rows] == ["damping of 7 joints", "mass of link l0 and 2 more"]  # type: ignore[union-attr]
    assert others == "1 more below 0.001 of the largest (--all)"
    whole = conclude_pair(pair, Detail.ALL)
    assert len(whole.rows[0].rows) == 11 and whole.sentence == found.sentence  # type: ignore[union-attr]


def test_two_files_of_one_robot() -> None:
    same = replace(PAIR, same=True, alike=True, backward_error=2.0, relative_error=0.0)
    apart, held = "(2.00 data roundoffs apart, 64 are allowed)", "limits, dry friction, equalities"
    assert conclude_pair(same).sentence == f"old/r.urdf and new/r.urdf are the same robot {apart}, {held}, contacts and actuators included."
    partly = replace(same, not_held=["contacts (3 and 1)"])
    told = f"{apart}, limits, dry friction and equalities included; not compared: contacts (3 and 1)."
    assert conclude_pair(partly).sentence == f"old/r.urdf and new/r.urdf are the same robot {told}"
    unfelt = replace(same, differences=[difference("mass", "link foot", 0.0)])
    assert "they differ in numbers that no acceleration feels, most in mass of link foot, 10" in conclude_pair(unfelt).sentence
    joint = LockedJoint(name="finger", why="only new/r.urdf moves it", asked=False, first_place="", second_place="r.urdf:7")
    but = conclude_pair(replace(same, same=False, locked=[joint]))
    assert "are the same robot but for 1 joint that the files do not share" in but.sentence
    assert but.rows[0] == "finger (r.urdf:7) stands still in what is compared: only new/r.urdf moves it"
    assert "cannot be compared: why." in conclude_pair(replace(PAIR, problem="why")).sentence


def test_a_survey_counts_robots_by_what_is_to_be_done() -> None:
    others = [replace(FILE, path=f"/robots/{name}.urdf") for name in "abc"]
    bad = FileRecord(path="/robots/bad.urdf", problem="line 3: no")
    subjects = [AGREES, replace(DAMPED, path=others[0].path), replace(DAMPED, path=others[1].path, explained=False), AGREES]
    subjects[3] = subject("mujoco", "MuJoCo", "unsupported", path=others[2].path)
    found = conclude_survey(FilesComparison(files=[FILE, *others, bad], subjects=subjects))
    assert found.sentence == (
        "5 robots: 1 cannot be read; 1 has an answer that no known reading explains; 1 is not answered by every engine; "
        "on 1 an engine differs from the file for a known reason; every engine agrees on 1."
    )
    assert found.rows == ["MuJoCo: agrees 1; refused 1", "Pinocchio: explained 1 (joint damping 1); unexplained 1 (joint damping 1)"]


def test_a_survey_says_what_becomes_of_answers_that_are_not_as_documented() -> None:
    """A reader would take those that a solver leaves early for wrong ones."""
    sound = SwitchedOnRecord(
        path="r.urdf",
        engine="mujoco",
        format="mjcf",
        parts=[SwitchedOnPart(what="joint limits", kind="joint", line=3)],
        verdict="agrees",
        relative_error=1e-16,
    )
    stops = replace(sound, verdict="disagrees", backward_error=1e12, relative_error=2.3, to_the_end=1.5, remedy="set iterations")
    departs = replace(sound, departures=[effect("some law", 0.1)])
    both = replace(stops, departures=departs.departures)
    wrong = replace(sound, verdict="disagrees", explained=False)
    found = FilesComparison(files=[FILE], subjects=[AGREES], switched_on=[sound, stops, both, departs, wrong])
    assert (
        "With joint limits on, 1 of 5 answers agree with the documentation of the engine, "
        "2 end where the solver stops before its solution, up to 230 % of qdd from it, "
        "1 departs from it for a known reason, 1 is unexplained; they move"
    ) in conclude_survey(found).sentence
    found.switched_on[:] = [sound]
    assert "1 of 1 answers agree with the documentation of the engine; they move" in conclude_survey(found).sentence


def worst(path: str) -> FilesComparison:
    """A file of which there is as much to say as can be."""
    readings = [effect(f"reading {number}", 0.5, sentence=f"Pinocchio does {number}") for number in range(50)]
    impossible = [Impossible(f"link {number}", number, "A + B < C", (1.0,), 0.1, (1.0,)) for number in range(99)]
    file = replace(
        FILE, path=path, impossible=impossible, left_out=[LeftOut(f"part {number}", (1, 2), number % 2 == 0) for number in range(30)]
    )
    about: dict[str, Any] = {
        "path": path,
        "rest": ["a sentence of the rest"] * 9,
        "notes": ("one: note", "two: notes"),
        "lost_digits": "at 3",
    }
    subjects = [
        subject(f"engine{number}", f"Engine {number}", "disagrees", number % 2 == 0, readings=readings, aided=aided, **about)
        for number in range(8)
        for aided in (False, True)
    ]
    subjects.append(subject("last", "Last", "unsupported", path=path, message="because " * 500))
    held = [SwitchedOnRecord(path=path, engine=f"engine{number}", format="urdf", parts=[], explained=False) for number in range(8)]
    return FilesComparison(files=[file], subjects=subjects, switched_on=held)


def printed(found: FilesComparison, detail: Detail, capsys: pytest.CaptureFixture[str]) -> list[str]:
    print_sections(told(found, detail))
    return capsys.readouterr().out.splitlines()


def test_one_file_is_told_in_15_lines_at_worst(capsys: pytest.CaptureFixture[str]) -> None:
    lines = printed(worst(FILE.path), Detail.BRIEF, capsys)
    assert len(lines) <= 15 and len(lines[0]) < 1000
    assert lines[0].startswith("r.urdf: ") and "--verbose" in lines[-1]
    assert len(printed(worst(FILE.path), Detail.ALL, capsys)) > 60
    assert len(printed(worst(FILE.path), Detail.VERBOSE, capsys)) > 300


@pytest.mark.parametrize("files", [2, 3])
def test_a_pair_is_told_in_30_lines_at_worst(files: int, capsys: pytest.CaptureFixture[str]) -> None:
    paths = [f"/{number}/r.urdf" for number in range(files)]
    found = FilesComparison()
    for path in paths:
        one = worst(path)
        one.files[0] = replace(one.files[0], total_mass=len(found.files))
        found.extend(one)
    locked = [
        LockedJoint(name=f"joint {number}", why=f"why {number % 2}", asked=False, first_place="", second_place="r.urdf:1")
        for number in range(40)
    ]
    differences = [difference(f"kind {number % 40}", f"joint {number}", 0.5) for number in range(400)]
    for path in paths[1:]:
        pair = replace(PAIR, first=paths[0], second=path, locked=locked, differences=differences, remarks=["joint a is b by place"] * 30)
        found.pairs.append(pair)
    lines = printed(found, Detail.BRIEF, capsys)
    assert len(lines) <= 30 * (files - 1)
    assert lines[0].startswith("0/r.urdf and 1/r.urdf differ: kind 0 of 10 joints, 10 (0/r.urdf:12) against 0.1 (1/r.urdf:34)")
    assert max(map(len, lines)) < 1000
