"""MuJoCo with a file's equalities and actuators on is held against what it documents, whether loops are closed or not."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from comparison.robots import FILES, edited, line_of, meant_by
from support import call_engines_here

from harness.comparison.case import AskedEngine
from harness.comparison.switched_on import judge_switched_on, pose, with_verdict
from harness.engines.adapters.mujoco import acting as adapter
from harness.engines.request import EngineAnswers
from harness.explain import file_case
from harness.explain.documented import documented
from harness.explain.meant import Meant, driven
from harness.explain.touching import put
from harness.files.findings import FRICTION, LIMITS
from harness.programs.states import States
from harness.report.comparison import sections
from harness.results.comparison import FileRecord, FilesComparison, SubjectRecord
from harness.results.switched_on import SwitchedOnRecord, switched_on_text
from harness.verdict import AGREEMENT, Verdict

FOUR_BAR = FILES / "four_bar.xml"
LINES = ('name="loop"', 'name="cam"', 'name="rope"', 'name="gear"', 'name="winch"', 'name="brake"')


def held_by(path: Path, engine: str = "mujoco") -> SwitchedOnRecord:
    return judge_switched_on(meant_by(path), engine)


def without_names(own: Meant) -> SwitchedOnRecord:
    """Which number is wrong takes long, and is asked by tests of its own."""
    record, posed = pose(own, "mujoco")
    assert posed is not None
    return with_verdict(record, posed.case, posed.asked, posed.answers, names=False)


@functools.cache
def of_four_bar() -> SwitchedOnRecord:
    """What is told of the file as it is, which no test changes."""
    return held_by(FOUR_BAR)


@pytest.mark.parametrize("name", ["mimic.urdf", "four_bar.urdf"])
def test_mujoco_holds_equalities_as_it_documents(name: str) -> None:
    record = held_by(FILES / name)
    assert (record.verdict, record.explained, record.message, record.departures) == (Verdict.AGREES, True, "", [])
    assert record.backward_error is not None and record.backward_error <= AGREEMENT
    # They are no small matter, so that agreement is not that of the tree alone.
    assert record.together is not None and record.together > 1e-3


def assert_departs(record: SwitchedOnRecord, *departures: str) -> None:
    """It is not the documented optimum, and is that by what is known of the program."""
    assert (record.explained, record.message, record.to_the_end) == (True, "", None)
    assert [one.name for one in record.departures] == list(departures) and all((one.alone or 0.0) > 1e-6 for one in record.departures)
    assert record.backward_error is not None and record.backward_error <= AGREEMENT and record.verdict == Verdict.DISAGREES


@pytest.mark.ci
def test_a_curved_coupling_departs_from_the_documentation_with_its_line_and_effect() -> None:
    """With a linear one in its place MuJoCo agrees."""
    record = of_four_bar()
    assert_departs(record, "J' v of couplings")
    assert record.departures[0].lines == (line_of(FOUR_BAR, 'name="cam"'),)
    told = switched_on_text(record)
    assert told.startswith("departs from its documentation by ") and "% of qdd (1 equality, line 37). MuJoCo leaves J' v out of" in told


def test_a_curved_coupling_that_is_made_linear_agrees(tmp_path: Path) -> None:
    record = held_by(edited(FOUR_BAR, tmp_path, ('polycoef="0.125 0.5 0.25"', 'polycoef="0.125 0.5 0"')))
    assert (record.verdict, record.departures) == (Verdict.AGREES, [])


ONE_JOINT = """<mujoco><option gravity="0 0 -9"/><worldbody><geom type="plane" size="1 1 1" contype="{collides}" conaffinity="{collides}"/>
  <body pos="0.1 0 0.09">
    <joint {joint}/>
    <geom type="sphere" size="0.1" mass="2"/>
  </body>
</worldbody></mujoco>"""


@pytest.mark.parametrize(
    ("joint", "collides", "concerned"),
    [
        ('name="j" type="ball" range="0 30" pos="0 0 0.5"', 0, "1 limit, line 3"),
        ('name="j" type="hinge" pos="0 0 0.5" frictionloss="0.5" solimpfriction="0.5 0.9 0"', 0, "1 joint, line 3"),
        ('name="j" type="slide" axis="0 0 1"', 1, "1 contact, line 1"),
    ],
)
def test_what_a_departure_concerns_is_called_by_its_name(joint: str, collides: int, concerned: str, tmp_path: Path) -> None:
    path = tmp_path / "one.xml"
    path.write_text(ONE_JOINT.format(joint=joint, collides=collides))
    (departure,) = held_by(path).departures
    assert departure.concerned() == concerned


SLIPPING = """<mujoco><option{noslip}/><worldbody><body><joint name="a" axis="0 1 0" frictionloss="0.3" range="-20 20"/>
<inertial pos="0 0 -0.3" mass="1" diaginertia="0.01 0.01 0.01"/><body pos="0 0 -0.5"><joint name="b" axis="0 1 0" frictionloss="0.2"/>
<inertial pos="0 0 -0.3" mass="1" diaginertia="0.01 0.01 0.01"/></body></body></worldbody></mujoco>"""


@pytest.mark.parametrize("noslip", ["", ' noslip_iterations="3"'])
def test_dry_friction_of_joints_is_not_judged_after_noslip_iterations(noslip: str, tmp_path: Path) -> None:
    """They change its forces too, and not those of limits."""
    path = tmp_path / "slipping.xml"
    path.write_text(SLIPPING.format(noslip=noslip))
    record = held_by(path)
    assert (record.verdict, record.explained) == (Verdict.AGREES, True)
    reason = "goes through noslip iterations, which solve no problem that is documented" if noslip else ""
    assert {(part.what, part.why_not) for part in record.parts} == {(FRICTION, reason), (LIMITS, "")}


def test_what_is_declared_of_no_program_is_no_excuse(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(file_case, "departures_of", lambda engine, reader: [])
    record = without_names(meant_by(FOUR_BAR))
    assert not record.explained and record.backward_error is not None and record.backward_error > 1e9


def test_each_equality_is_told_with_its_line_and_what_it_does() -> None:
    parts = of_four_bar().parts
    assert [part.line for part in parts] == [line_of(FOUR_BAR, text) for text in LINES]
    assert [part.kind for part in parts] == ["connect", "joint", "connect", "tendon", "tendon", "weld"]
    assert [bool(part.why_not) for part in parts] == [False, False, False, False, True, True]
    assert all(part.alone is not None and part.alone > 1e-3 for part in parts[:4]) and parts[5].alone is None


@pytest.mark.parametrize(
    "change",
    [
        ('solref="0.03125 1"', 'solref="0.03125 1.0000001"'),
        ('solimp="0.9 0.98 0.5"', 'solimp="0.9 0.98 0.50001"'),
        ('polycoef="0.125 0.5 0.25"', 'polycoef="0.125 0.5 0.2500001"'),
        ('anchor="0.0625 0 0.25"', 'anchor="0.0625 0 0.2500001"'),
        ('pos="0.75 0 0.0625"', 'pos="0.75 0 0.0625001"'),
        ('ref="30"', 'ref="30.00001"'),
        ('joint="flap" coef="-0.75"', 'joint="flap" coef="-0.7500001"'),
    ],
)
def test_a_number_of_an_equality_that_is_another_is_felt(change: tuple[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert_felt(FOUR_BAR, edited(FOUR_BAR, tmp_path, change), monkeypatch)


def assert_felt(path: Path, changed: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The engine is asked about the file as it stands, and the optimum is that of a changed one."""
    own, other = meant_by(path), meant_by(changed)
    read = driven(other).robot
    monkeypatch.setattr(file_case, "documented", lambda _, caller, numbers, *more, mechanism=None: documented(read, caller, numbers, *more))
    record = without_names(own)
    assert not record.explained and record.backward_error is not None and record.backward_error > AGREEMENT


BESIDE = """<mujoco>
  <compiler angle="radian" fusestatic="true"/>
  <default><default class="soft"><equality solimp="0.5 0.75 0.25 0.25 3"/></default></default>
  <worldbody>
    <body name="float" pos="0.25 0.5 1" quat="1 0.5 0 0.25">
      <freejoint/>
      <inertial pos="0 0.125 0" mass="0.5" diaginertia="0.0078125 0.015625 0.01171875"/>
      <frame pos="0 0 0.25" euler="0.5 0.25 0"><site name="hook" pos="0.125 0 0"/></frame>
      <body pos="0.25 0 0">
        <inertial pos="0 0 0.125" mass="0.25" diaginertia="0.00390625 0.00390625 0.00390625"/>
        <body name="arm" pos="0 0.25 0">
          <joint name="arm" axis="0 1 0.5" ref="0.25"/>
          <inertial pos="0 0 0.125" mass="0.25" diaginertia="0.00390625 0.00390625 0.00390625"/>
          <site name="tip" pos="0 0 0.25"/>
        </body>
      </body>
    </body>
    <body name="cart"><joint name="cart" type="slide" axis="1 0 0"/><inertial pos="0 0 0" mass="2" diaginertia="1 1 1"/></body>
  </worldbody>
  <equality>
    <connect class="soft" body1="float" anchor="0.125 0 0"/>
    <connect body1="arm" body2="cart" anchor="0 0 0.5"/>
    <connect site1="hook" site2="tip"/>
    <joint joint1="cart" polycoef="0.25"/>
  </equality>
</mujoco>
"""


@pytest.mark.ci
def test_bodies_that_float_and_bodies_without_joints_are_tied(tmp_path: Path) -> None:
    """By anchors, whose second point is where the first stands with all joints at their reference, and by sites in frames."""
    path = tmp_path / "float.xml"
    path.write_text(BESIDE)
    record = held_by(path)
    assert_departs(record, "inverse weight of a slider")
    assert [part.why_not for part in record.parts] == [""] * 4
    assert all(part.alone is not None and part.alone > 1e-3 for part in record.parts)


WELDS = (
    '<weld body1="arm" body2="cart"/>',
    '<weld class="soft" body1="float" body2="arm" anchor="0.125 0 0.25" relpose="0.25 0.5 0.125 0.5 0.25 0 -1" torquescale="0.375"/>',
    '<weld body1="cart" anchor="0 0.25 0" torquescale="2"/>',
    '<weld site1="hook" site2="tip" solref="-64 -8"/>',
)


def welded(folder: Path) -> Path:
    before, _, after = BESIDE.partition("<equality>\n")
    path = folder / "welded.xml"
    path.write_text(f"{before}<equality>{''.join(WELDS)}</equality>{after.partition('</equality>')[2]}")
    return path


@pytest.mark.ci
def test_welds_hold_points_and_orientations(tmp_path: Path) -> None:
    """By bodies, as they stand at the reference or are told to stand, and by turned sites; each alone, and all together."""
    record = held_by(welded(tmp_path))
    assert_departs(record, "inverse weight of a slider")
    assert [part.why_not for part in record.parts] == [""] * 4
    assert all(part.alone is not None and part.alone > 1e-3 for part in record.parts)


@pytest.mark.ci
@pytest.mark.parametrize(
    "change",
    [
        ('torquescale="0.375"', 'torquescale="0.3750001"'),
        ('anchor="0.125 0 0.25"', 'anchor="0.125 0 0.2500001"'),
        ('relpose="0.25 0.5 0.125 0.5', 'relpose="0.25 0.5 0.125 0.5000001'),
        ('euler="0.5 0.25 0"', 'euler="0.5 0.2500001 0"'),
    ],
)
def test_a_number_of_a_weld_that_is_another_is_felt(change: tuple[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path, other = welded(tmp_path), tmp_path / "other"
    other.mkdir()
    assert_felt(path, edited(path, other, change), monkeypatch)


@pytest.mark.parametrize("flag", ['<flag diagexact="enable"/>', '<flag refsafe="disable"/>'])
def test_flags_of_the_solver_are_read(flag: str, tmp_path: Path) -> None:
    path = edited(FOUR_BAR, tmp_path, ('gravity="0 0 -9.8125"/>', f'gravity="0 0 -9.8125">{flag}</option>'))
    record = held_by(edited(path, tmp_path, ('solref="0.03125 1"', 'solref="0.0025 1"')))
    assert_departs(record, "J' v of couplings")


def test_equalities_that_are_switched_off_are_told_and_not_asked(tmp_path: Path) -> None:
    path = edited(FOUR_BAR, tmp_path, ('gravity="0 0 -9.8125"/>', 'gravity="0 0 -9.8125"><flag equality="disable"/></option>'))
    record = held_by(path)
    assert record.verdict == "" and {part.why_not for part in record.parts} == {"is switched off in the file"}


def test_pinocchio_is_told_to_hold_none() -> None:
    record = held_by(FOUR_BAR, "pinocchio")
    assert "pin.aba holds no equality" in record.message and record.explained and len(record.parts) == len(LINES)


def test_a_wrong_answer_makes_the_comparison_red_and_is_printed() -> None:
    record = held_by(FOUR_BAR)
    wrong = SwitchedOnRecord(path="a.xml", engine="mujoco", format="mjcf", parts=record.parts, explained=False, message="it crashed")
    subject = SubjectRecord(path="a.xml", engine="mujoco", format="mjcf", aided=False, call="", verdict="agrees", explained=True)
    found = FilesComparison(files=[FileRecord(path="a.xml", format="mjcf")], subjects=[subject], switched_on=[wrong])
    assert not found.as_expected
    text = "\n".join(part for section in sections(found) for part in section.parts if isinstance(part, str))
    assert text.count("a.xml mujoco/mjcf: it crashed") == 1 and text.count("mujoco/mjcf: it crashed") == 2
    assert f"joint, 1, line {record.parts[1].line}; alone it moves the engine's qdd by" in text


FIRM = FILES / "firm.xml"


@pytest.mark.parametrize("is_held_apart", [True, False])
def test_a_solver_need_go_on_only_where_it_stopped_early(is_held_apart: bool) -> None:
    """One that goes on at states where it has ended already loses digits there, as beside rows without weight."""
    record, posed = pose(meant_by(FIRM), "mujoco")
    assert posed is not None and len(posed.case.at.states) > 2
    joints, (ending, *_) = posed.case.at.robot.joints, posed.case.caller.endings
    ended = posed.asked.with_those(posed.case.judged, posed.case.at, solver=ending.solver)

    def off_at(states: list[int]) -> EngineAnswers:
        factors = np.where(np.isin(np.arange(len(posed.case.at.states)), states), 1 + 1e-8, 1.0)[:, None]
        return replace(ended, accelerations={name: factors * ended.accelerations[name] for name in joints})

    class Asked:
        def with_those(self, *_: Any, **__: Any) -> EngineAnswers:
            return off_at([1] if is_held_apart else [0])

    found = with_verdict(record, posed.case, cast(AskedEngine, Asked()), off_at([0]), names=False)
    assert found.explained is is_held_apart and (found.to_the_end is not None) is is_held_apart


def test_an_answer_without_numbers_is_told_as_that() -> None:
    """It is no number of data roundoffs away, and nothing that the file says is its cause."""
    record, posed = pose(meant_by(FIRM), "mujoco")
    assert posed is not None
    broken = {name: own.copy() for name, own in posed.answers.accelerations.items()}
    broken[posed.case.at.robot.joints[0]][1] = np.nan
    found = with_verdict(record, posed.case, posed.asked, replace(posed.answers, accelerations=broken))
    assert (found.verdict, found.explained) == (Verdict.ERROR, False)
    assert switched_on_text(found) == "gives no finite acceleration at some states, where its documentation has one"
    assert found.rest == [f"a number of its answer is not finite at 1 of {found.states} states"]


def test_where_a_motion_has_broken_down_no_state_is_asked() -> None:
    states = States.at(np.zeros((4, 2)), np.zeros((4, 2)), np.zeros((4, 2)))
    led = np.array([[1.0, 2.0], [1e117, 0.0], [np.nan, 0.0], [3.0, 4.0]])
    found = put(states, np.arange(4), led, np.where(led == 3.0, -1e12, 1.0))
    assert found.q.tolist() == [[1.0, 2.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]]
    assert found.v.tolist() == [[1.0, 1.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]]


def test_a_search_along_a_line_that_stops_early_is_told_with_what_to_set(tmp_path: Path) -> None:
    """Files for MJX give it few iterations, and more of Newton's method alone lead nowhere."""
    inner = ""
    for name, axis in (("d", "1 0 0"), ("c", "0 1 0"), ("b", "1 0 0"), ("a", "0 1 0")):
        joint = f'<joint name="{name}" axis="{axis}" range="-20 20" frictionloss="0.5"/>'
        inertial = '<inertial pos="0 0 -0.15" mass="1" diaginertia="0.01 0.01 0.002"/>'
        inner = f'<body pos="0 0.1 -0.3">{joint}{inertial}{inner}</body>'
    path = tmp_path / "chain.xml"
    path.write_text(f'<mujoco><option iterations="3" ls_iterations="1"/><worldbody>{inner}</worldbody></mujoco>')
    record = without_names(meant_by(path))
    assert record.explained and record.backward_error is not None and record.backward_error > AGREEMENT
    assert record.to_the_end is not None and record.to_the_end <= AGREEMENT and 'ls_iterations="50"' in record.remedy


def test_a_solver_that_stops_early_is_told_with_what_to_set() -> None:
    record = held_by(FIRM)
    assert record.explained and record.backward_error is not None and record.backward_error > AGREEMENT
    assert record.to_the_end is not None and record.to_the_end <= AGREEMENT
    assert "stops its solver" in record.misses_optimum and 'iterations="100" tolerance="0"' in record.remedy


def test_what_a_solver_does_not_reach_in_the_end_is_not_explained_by_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert_felt(FIRM, edited(FIRM, tmp_path, ('solref="0.002 1"', 'solref="0.002 1.000001"')), monkeypatch)


DRIVEN = FILES / "driven.xml"


def test_mujoco_drives_actuators_beside_equalities_as_it_documents() -> None:
    record = held_by(DRIVEN)
    assert (record.verdict, record.explained, record.departures, record.rest) == (Verdict.AGREES, True, [], [])
    assert record.backward_error is not None and record.backward_error <= AGREEMENT and (record.together or 0.0) > 0.1
    assert [(part.what, part.kind, bool(part.why_not)) for part in record.parts] == [
        ("equalities", "joint", False),
        ("actuators", "motor", False),
        ("actuators", "position", False),
        ("actuators", "intvelocity", False),
        ("actuators", "muscle", True),
    ]
    assert [part.line for part in record.parts] == [
        line_of(DRIVEN, f'name="{name}"') for name in ("gear", "push", "servo", "winder", "biceps")
    ]
    assert all(part.alone is not None and part.alone > 1e-3 for part in record.parts[:4])
    assert record.named == "1 equality and 3 actuators"


@pytest.mark.parametrize(
    "change",
    [
        ('gear="3"', 'gear="3.0000001"'),
        ('ctrlrange="-4 4"', 'ctrlrange="-4 4.0000001"'),
        ('kp="24"', 'kp="24.000001"'),
        ('dampratio="0.75"', 'dampratio="0.7500001"'),
        ('forcerange="-5 5"', 'forcerange="-5.000001 5"'),
        ('actuatorfrcrange="-3 3"', 'actuatorfrcrange="-3 3.000001"'),
        ('kv="0.5"', 'kv="0.5000001"'),
        ('polycoef="0.125 0.5"', 'polycoef="0.125 0.5000001"'),
    ],
)
def test_a_number_of_an_actuator_that_is_another_is_felt(change: tuple[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert_felt(DRIVEN, edited(DRIVEN, tmp_path, change), monkeypatch)


def test_an_engine_that_drives_none_of_what_it_is_told_to_is_not_explained(monkeypatch: pytest.MonkeyPatch) -> None:
    drive = adapter.drive
    call_engines_here(monkeypatch)
    monkeypatch.setattr(adapter, "drive", lambda model, numbers: drive(model, ()))
    assert not without_names(meant_by(DRIVEN)).explained


def test_a_reader_that_passes_over_actuators_is_told_with_their_effect() -> None:
    record = held_by(DRIVEN, "pinocchio")
    (reading,) = record.readings
    assert (record.verdict, record.explained, reading.name, reading.count) == ("", True, "actuators", 3)
    assert reading.lines == tuple(line_of(DRIVEN, f'name="{name}"') for name in ("push", "servo", "winder"))
    assert (reading.alone or 0.0) > 0.1 and reading.remedy


# What MuJoCo is made to hold otherwise after loading, by field and place, and the number of the file that is named for it.
WRONG = {
    "gear": ({"gear": {(0, 0): 3.003}}, "motor gear = 3: the engine behaves as with 3.003"),
    "kp": ({"gainprm": {(1, 0): 24.024}, "biasprm": {(1, 1): -24.024}}, "position kp = 24: the engine behaves as with 24.024"),
    "dampratio": ({"biasprm": {(1, 2): -2.8}}, "position dampratio = 0.75: "),
    "ctrlrange": ({"ctrlrange": {(0, 1): 4.004}}, "motor ctrlrange [1] = 4: the engine behaves as with 4.004"),
    "forcerange": ({"forcerange": {(1, 1): 5.005}}, "position forcerange [1] = 5: the engine behaves as with 5.005"),
    "kv": ({"biasprm": {(2, 2): -0.5005}}, "intvelocity kv = 0.5: the engine behaves as with 0.5005"),
}


@pytest.mark.parametrize(
    ("name", "has_equality"),
    [
        # At the desk every number once, in turn beside an equality and without one.
        pytest.param(name, has_equality, marks=pytest.mark.ci if (place + has_equality) % 2 else ())
        for place, name in enumerate(WRONG)
        for has_equality in (True, False)
    ],
)
def test_a_number_that_the_engine_holds_otherwise_is_named(
    name: str, has_equality: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drive, (numbers, named) = adapter.drive, WRONG[name]

    def driven_wrong(model: Any, acting: Sequence[int]) -> None:
        drive(model, acting)
        for field, values in numbers.items():
            for place, value in values.items():
                getattr(model, f"actuator_{field}")[place] = value

    call_engines_here(monkeypatch)
    monkeypatch.setattr(adapter, "drive", driven_wrong)
    path = DRIVEN if has_equality else edited(DRIVEN, tmp_path, ("<equality>", "<!--"), ("</equality>", "-->"))
    record = held_by(path)
    assert not record.explained and record.rest and named in record.rest[0], record.rest
