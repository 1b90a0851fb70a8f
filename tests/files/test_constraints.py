"""Constraints of model files: what is read, and that every malformed one is refused at its line."""

from __future__ import annotations

import math
import pickle
import re
from pathlib import Path

import pytest

from harness.errors import InvalidModel
from harness.files.document.source import whole
from harness.files.document.xml import parse_document
from harness.files.equalities import Equality, Linkage, Meeting, SolverParameters, Sum, TendonLinkage, Weld
from harness.files.facts import in_radians, point_of, turn_of
from harness.files.model_file import ModelFile, parse_model, read_model
from harness.files.reading import read as read_meaning
from harness.files.text.anatomy import anatomy
from harness.files.text.lines import JOINT, SPRING_LENGTH, lines_of
from harness.files.text.scan import find_numbers
from harness.library import Library

LIBRARY = Library.built_in()
CONNECT = '<connect name="closure" site1="coupler_end" site2="follower_end"/>'
CORD = '<spatial name="cord"><site site="coupler_end"/><site site="follower_end"/></spatial>'
SUM = '<fixed name="sum"><joint joint="crank" coef="2"/><joint joint="follower" coef="1"/></fixed>'
TENDONS = ("</worldbody>", f"</worldbody><tendon>{CORD}{SUM}</tendon>")
MIMIC = ('<child link="follower"/>', '<child link="follower"/><mimic joint="coupler" multiplier="-2" offset="0.5"/>')


def four_bar(model_format: str, *changes: tuple[str, str]) -> ModelFile:
    plain = read_model(LIBRARY.model_path("four_bar", model_format), model_format)
    text = plain.text
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return parse_model(Path(f"model.{model_format}"), text, model_format)


def only(file: ModelFile) -> Equality:
    (constraint,) = file.constraints
    return constraint


def line(model_format: str, text: str) -> int:
    """The line of the four-bar on which a text stands."""
    lines = four_bar(model_format).text.splitlines()
    return next(number for number, content in enumerate(lines, start=1) if text in content)


COUPLER_END, FOLLOWER_END = ("coupler", (1.5, 0.0, 0.0)), ("follower", (1.3, 0.0, 0.0))
PLACE = line("mjcf", "<connect")


def said(constraint: Equality) -> tuple[object, ...]:
    """The numbers and names of what a constraint says, as plain data."""
    says = constraint.says
    if isinstance(says, Meeting):
        scale = (float(says.torque_scale),) if isinstance(says, Weld) else ()
        return constraint.couples, [(body, point_of(pose)) for body, pose in says.ends], *scale
    assert isinstance(says, Linkage | TendonLinkage)
    coefficients = tuple(map(float, says.coefficients))
    if isinstance(says, Linkage):
        return constraint.couples, says.joint, says.leader, coefficients
    lengths = [
        (one.name, tuple((name, float(part) if isinstance(one, Sum) else point_of(part)) for name, part in vars(one)[field]))
        for one in says.tendons
        for field in ("terms" if isinstance(one, Sum) else "points",)
    ]
    return constraint.couples, lengths, coefficients


@pytest.mark.parametrize(
    ("element", "name", "softness", "expected"),
    [
        (CONNECT, "closure", SolverParameters(), ("point", [COUPLER_END, FOLLOWER_END])),
        (
            '<weld name="w" site1="follower_end" site2="coupler_end" torquescale="0.5" solref="-100 -20"/>',
            "w",
            SolverParameters((-100.0, -20.0)),
            ("frame", [FOLLOWER_END, COUPLER_END], 0.5),
        ),
        (
            '<joint name="j" joint1="crank" joint2="follower" polycoef="0.5 2" solimp="0.8 0.9"/>',
            "j",
            SolverParameters(solimp=(0.8, 0.9, 0.001, 0.5, 2.0)),
            ("joint", "crank", "follower", (0.5, 2.0, 0.0, 0.0, 0.0)),
        ),
        ('<joint name="j" joint1="crank"/>', "j", SolverParameters(), ("joint", "crank", None, (0.0, 1.0, 0.0, 0.0, 0.0))),
        (
            '<tendon name="t" tendon1="cord" tendon2="sum" polycoef="0 1 2 3 4"/>',
            "t",
            SolverParameters(),
            (
                "tendon",
                [("cord", (COUPLER_END, FOLLOWER_END)), ("sum", (("crank", 2.0), ("follower", 1.0)))],
                (0.0, 1.0, 2.0, 3.0, 4.0),
            ),
        ),
    ],
)
def test_what_is_read_from_equality(element: str, name: str, softness: SolverParameters, expected: tuple[object, ...]) -> None:
    file = four_bar("mjcf", TENDONS, (CONNECT, element))
    read = only(file)
    assert (read.name, read.line, read.softness, said(read)) == (name, PLACE, softness, expected)
    assert pickle.loads(pickle.dumps(file)) == file


def test_a_constraint_of_the_world_and_a_turned_site() -> None:
    weld = '<weld name="w" site1="here" site2="follower_end"/>'
    site = (
        "<worldbody>",
        '<default><default class="turned"><site quat="0 1 0 0"/></default></default><worldbody><site name="here" class="turned"/>',
    )
    read = only(four_bar("mjcf", site, (CONNECT, weld)))
    assert said(read)[:2] == ("frame", [("world", (0.0, 0.0, 0.0)), FOLLOWER_END])
    assert isinstance(read.says, Weld)
    assert turn_of(read.says.first) == (0.0, 1.0, 0.0, 0.0)


def test_softness_comes_from_default_classes_number_by_number() -> None:
    """As MuJoCo compiles it."""
    import mujoco

    classes = (
        '<default><equality solref="0.04 0.5" solimp="0.7 0.8 0.002"/><joint armature="0.1"/>'
        '<default class="hard"><equality solimp="0.99"/></default></default>'
    )
    file = four_bar("mjcf", ("<worldbody>", f"{classes}<worldbody>"), ('name="closure"', 'name="closure" class="hard" solref="0.03"'))
    read, compiled = only(file).softness, mujoco.MjModel.from_xml_string(file.text)
    assert read == SolverParameters((0.03, 0.5), (0.99, 0.8, 0.002, 0.5, 2.0))
    assert (read.solref, read.solimp) == (tuple(compiled.eq_solref[0]), tuple(compiled.eq_solimp[0]))


@pytest.mark.parametrize(("unit", "factor"), [("radian", 1.0), ("degree", math.pi / 180)])
def test_a_coupling_is_measured_from_the_references_of_its_joints(unit: str, factor: float) -> None:
    changes = (
        ('angle="radian"', f'angle="{unit}"'),
        ('name="crank" type="hinge"', 'name="crank" type="hinge" ref="0.5"'),
        (CONNECT, '<joint name="j" joint1="coupler" joint2="crank"/>'),
    )
    file = four_bar("mjcf", *changes)
    read = only(file)
    tree = read_meaning(parse_document(file.path, file.text, "mujoco")).tree
    (crank,) = (joint for joint in tree.joints if joint.name == "crank")
    assert said(read)[1:3] == ("coupler", "crank")
    assert in_radians(crank, "reference") == 0.5 * factor


def test_what_is_read_from_urdf() -> None:
    at = line("urdf", "<drake:ball_constraint name")
    read = only(four_bar("urdf"))
    assert (read.name, read.line, read.softness, said(read)) == ("closure", at, None, ("point", [COUPLER_END, FOLLOWER_END]))
    file = four_bar("urdf", MIMIC)
    coupling = file.constraints[1]
    assert (coupling.name, coupling.line, coupling.softness) == ("follower", file.mimics[0].line, None)
    assert [said(one)[0] for one in file.constraints] == ["point", "joint"]
    assert said(coupling)[1:] == ("follower", "coupler", (0.5, -2.0, 0.0, 0.0, 0.0))


MALFORMED_MJCF = {
    "no name": (' name="closure"', "", PLACE, "<connect> has no name; add one"),
    "one name twice": (CONNECT, f"{CONNECT}\n{CONNECT}", PLACE + 1, f"repeats the name of line {PLACE}"),
    "no site": ('site1="coupler_end"', "", PLACE, "has no attribute 'site1'; add it"),
    "unknown site": ('site1="coupler_end"', 'site1="coupler_ende"', PLACE, "did you mean 'coupler_end'?"),
    "anchor": (
        'site1="coupler_end" site2="follower_end"',
        'body1="coupler" anchor="1 0 0"',
        PLACE,
        'body1="coupler" takes one of its points',
    ),
    "relpose": ("<connect", '<weld relpose="0 0 0 1 0 0 0"', PLACE, "takes one of its points from the zero position"),
    "one body": ('site2="follower_end"', 'site2="coupler_end"', PLACE, "holds two sites of body 'coupler' together"),
    "switched off": ("<connect", '<connect active="false"', PLACE, 'is switched off by active="false"'),
    "stage switched off": ("<flag", '<flag equality="disable"', PLACE, 'is switched off by <flag equality="disable">'),
    "pipeline switched off": ("<flag", '<flag constraint="disable"', PLACE, 'is switched off by <flag constraint="disable">'),
    "no constraint": (CONNECT, "", PLACE - 1, "<equality> holds no constraint; remove it"),
    "mixed solref": ("<connect", '<connect solref="0.02 -1"', PLACE, "mixes signs; expected both positive, or none"),
    "mixed solref with its default": (
        "<connect",
        '<connect solref="-100"',
        PLACE,
        'has solref="-100 1" with its default class, which mixes signs',
    ),
    "long solimp": ("<connect", '<connect solimp="1 2 3 4 5 6"', PLACE, "holds 6 numbers; expected 1 to 5"),
    "solimp with a word": ("<connect", '<connect solimp="stiff"', PLACE, "contains 'stiff'"),
    "distance": ("<connect", "<distance", PLACE, "is a constraint that MuJoCo knows no more"),
    "of a flex": ("<connect", "<flexvert", PLACE, "is deformable"),
    "unknown kind": ("<connect", "<conect", PLACE, "did you mean 'connect'?"),
    "part of a constraint": (CONNECT, CONNECT.replace("/>", "><joint/></connect>"), PLACE, "<joint> in <connect"),
    "site in a frame": (
        '<site name="follower_end" pos="1.3 0 0"/>',
        '<frame><site name="follower_end" pos="1.3 0 0"/></frame>',
        line("mjcf", 'name="follower_end"'),
        "stands in a <frame>, which is not read; write its pose in its body",
    ),
    "unknown joint": (CONNECT, '<joint name="j" joint1="cranc"/>', PLACE, "did you mean 'crank'?"),
    "joint with itself": (CONNECT, '<joint name="j" joint1="crank" joint2="crank"/>', PLACE, "couples joint 'crank' to itself"),
    "unknown tendon": (CONNECT, '<tendon name="t" tendon1="cord"/>', PLACE, "names nothing in this file"),
    "turned otherwise": (
        'site name="follower_end" pos="1.3 0 0"/>',
        'site name="follower_end" pos="1.3 0 0" zaxis="1 0 0"/>',
        line("mjcf", 'name="follower_end"'),
        "is turned by 'zaxis', which is not read there; write a quat",
    ),
    "iterations": ("<option", '<option iterations="2.5"', line("mjcf", "<option"), "is no number of times"),
    "solver": ("<option", '<option solver="newton"', line("mjcf", "<option"), "did you mean 'Newton'?"),
}


@pytest.mark.parametrize(
    ("text", "refused"),
    [
        ('<option timestep="0.001"/>', '<option timestep="0.001"> is for constraints, of which the file has none; remove it'),
        ('<option solver="CG"/>', '<option solver="CG"> is for constraints'),
        ('<option><flag diagexact="enable"/></option>', "<flag diagexact> is for constraints"),
    ],
)
def test_an_option_for_constraints_is_refused_without_them(text: str, refused: str) -> None:
    with pytest.raises(InvalidModel, match=refused):
        four_bar("mjcf", (f"<equality>\n    {CONNECT}\n  </equality>", text))


@pytest.mark.parametrize(
    ("element", "missing"),
    [
        (CONNECT, "site1"),
        (CONNECT, "site2"),
        ('<weld name="closure" site1="coupler_end" site2="follower_end"/>', "site1"),
        ('<weld name="closure" site1="coupler_end" site2="follower_end"/>', "site2"),
        ('<joint name="closure" joint1="crank"/>', "joint1"),
        ('<tendon name="closure" tendon1="cord"/>', "tendon1"),
    ],
)
def test_a_constraint_that_names_nothing_is_told_what_to_add(element: str, missing: str) -> None:
    """Before anything is made of it: readers ask for other attributes where this one is not there."""
    tag = element.split()[0].removeprefix("<")
    with pytest.raises(InvalidModel, match=rf": <{tag} name=\"closure\"> has no attribute '{missing}'; add it$"):
        four_bar("mjcf", TENDONS, (CONNECT, re.sub(rf' {missing}="[^"]*"', "", element)))


BALL = line("urdf", "<drake:ball_constraint name")
MALFORMED_URDF = {
    "no name": (' name="closure"', "", BALL, "has no name; add one"),
    "no point": ('<drake:ball_constraint_p_AP value="1.5 0 0"/>', "", BALL, "has no <drake:ball_constraint_p_AP>; add it"),
    "no value": ('p_AP value="1.5 0 0"', "p_AP", BALL + 2, "has no attribute 'value'"),
    "point short": ('p_AP value="1.5 0 0"', 'p_AP value="1.5 0"', BALL + 2, "holds 2 numbers; expected 3"),
    "unknown link": ('body_A name="coupler"', 'body_A name="copler"', BALL + 1, "did you mean 'coupler'?"),
    "one link": ('body_A name="coupler"', 'body_A name="follower"', BALL, "holds two points of link 'follower' together"),
    "part twice": ("constraint_p_AP", "constraint_p_BQ", BALL + 4, "second <drake:ball_constraint_p_BQ>"),
    "part misspelt": ("constraint_p_AP", "constraint_p_AQ", BALL + 2, "did you mean"),
    "bushing": ("<drake:ball_constraint name", "<drake:linear_bushing_rpy name", BALL, "is a force element that is not read"),
    "other constraint": ("<drake:ball_constraint name", "<drake:tendon_constraint name", BALL, "did you mean 'drake:ball_constraint'?"),
}


# What must change too for the rest of the file to stand.
ALONG = {
    "turned otherwise": ("<connect", "<weld"),
    "bushing": ("</drake:ball_constraint>", "</drake:linear_bushing_rpy>"),
    "other constraint": ("</drake:ball_constraint>", "</drake:tendon_constraint>"),
}
MALFORMED = [("mjcf", name) for name in MALFORMED_MJCF] + [("urdf", name) for name in MALFORMED_URDF]


@pytest.mark.parametrize(("model_format", "name"), MALFORMED, ids=map("-".join, MALFORMED))
def test_a_malformed_constraint_is_refused_at_its_line(model_format: str, name: str) -> None:
    old, new, at, problem = {"mjcf": MALFORMED_MJCF, "urdf": MALFORMED_URDF}[model_format][name]
    with pytest.raises(InvalidModel) as caught:
        four_bar(model_format, (old, new), *([ALONG[name]] if name in ALONG else []))
    assert (caught.value.line, problem in str(caught.value)) == (at, True), caught.value


def test_two_constraints_of_a_urdf_have_two_names() -> None:
    with pytest.raises(InvalidModel, match="has the name of a joint that mimics another"):
        four_bar("urdf", MIMIC, ('constraint name="closure"', 'constraint name="follower"'))


@pytest.mark.parametrize("model_format", ["mjcf", "urdf"])
def test_the_points_of_a_loop_are_numbers_and_vectors_that_a_diagnosis_can_change(model_format: str) -> None:
    file = four_bar(model_format)
    numbers = {(number.value, number.line) for number in find_numbers(file.text, model_format)}
    at = [
        line(model_format, text) for text in {"mjcf": ('"coupler_end" pos', '"follower_end" pos'), "urdf": ("p_AP", "p_BQ")}[model_format]
    ]
    assert {(1.5, at[0]), (1.3, at[1])} <= numbers
    assert [slot.place.line for slot in anatomy(file).positions if slot.place.element != "joint"] == at


def test_softness_is_numbers_that_a_diagnosis_can_change() -> None:
    file = four_bar("mjcf", ("<connect", '<connect solref="0.03 0.9" solimp="0.8 0.91"'), ("<option", '<option timestep="0.003"'))
    values = {number.value for number in find_numbers(file.text, "mjcf")}
    assert {0.03, 0.9, 0.8, 0.91, 0.003} <= values


def test_a_joint_is_found_beside_a_coupling_of_its_name() -> None:
    coupling = '<equality><joint name="crank" joint1="crank"/></equality>'
    file = four_bar("mjcf", ("<worldbody>", f"{coupling}<worldbody>"))
    assert lines_of(file, JOINT, "crank") == (file.joint_lines["crank"],) != (file.constraints[0].line,)


def test_a_tendon_that_is_spring_or_damper_alone_counts_as_a_spring_and_one_that_is_neither_does_not() -> None:
    sites = '<site site="coupler_end"/><site site="follower_end"/>'
    kinds = ("", 'damping="2"', 'stiffness="3"', 'stiffness="1" damping="1"')
    tendons = "".join(f'\n<spatial springlength="0.5" {kind}>{sites}</spatial>' for kind in kinds)
    file = four_bar(
        "mjcf", ("</worldbody>", f"</worldbody><tendon>{tendons}</tendon>"), (' spring="disable"', ""), (' damper="disable"', "")
    )
    slack = next(number for number, line in enumerate(file.text.splitlines(), 1) if line.startswith('<spatial springlength="0.5" >'))
    found = [lines_of(file, SPRING_LENGTH, str(number))[0] for number in (1, 2, 3)]
    assert found == [slack + 1, slack + 2, slack + 3]


@pytest.mark.parametrize(
    ("system", "element"),
    [
        ("four_bar", "drake:ball_constraint_p_AP"),
        ("four_bar", "drake:ball_constraint_p_BQ"),
        ("collar", "drake:linear_spring_damper_p_AP"),
        ("collar", "drake:linear_spring_damper_p_BQ"),
    ],
)
def test_a_point_of_a_urdf_must_be_given(system: str, element: str) -> None:
    path = LIBRARY.model_path(system, "urdf")
    without = re.sub(rf"<{element} value=\"[^\"]*\"", f"<{element}", path.read_text())
    assert without != path.read_text()
    with pytest.raises(InvalidModel, match=f"<{element}> has no attribute 'value'"):
        parse_model(path, without, "urdf")


@pytest.mark.parametrize(("value", "is_taken"), [(0.0, False), (1.0, True), (1.5, False), (2.0, True)])
def test_a_number_of_times_is_one_or_more(value: float, is_taken: bool) -> None:
    assert (whole((value,)) is None) == is_taken
