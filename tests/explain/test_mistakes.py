"""Every declared mistake can be made in sound models and undone again, in both formats, and no line moves."""

from __future__ import annotations

import ast
import functools
import itertools
import math
import random
import re
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import mujoco
import numpy as np
import pytest
from catalogue import BUILT_IN, is_tied
from scipy.spatial.transform import Rotation

from harness.diagnosis.faults.campaign import is_valid
from harness.engines import load_engine
from harness.engines.interface import require_bounds
from harness.errors import InvalidModel
from harness.explain.changes import Change, mistakes
from harness.explain.changes.mistakes import Mistake, find_mistakes, mended_mistakes
from harness.explain.changes.mistakes.frames import matrix_of
from harness.explain.columns import watch
from harness.explain.fit import fit
from harness.explain.model_side import ModelSide
from harness.explain.search import OTHER_STARTS
from harness.files.model_file import ModelFile, parse_model, read_model
from harness.files.text.anatomy import anatomy
from harness.files.text.scan import Watch, find_elements, find_numbers
from harness.lagrange.derivation import load_mechanism
from harness.library import names_in
from harness.truth.compare import compare
from harness.truth.reference import Reference, ReferenceKernel
from harness.truth.sampling import generic_sample
from harness.verdict import AGREEMENT

MISTAKES = {mistake.name: mistake for mistake in mended_mistakes()}
FORMATS = ("mjcf", "urdf")
# Springs, dampers and offsets, a ball joint, links with masses apart, and the one model with products of inertia.
SYSTEMS = ("quarter_car", "coupled_oscillators", "bar_pendulum", "arm_2r", "tora", "heavy_top", "stanford_arm")
# Mistakes that reach no engine: a URDF holds no gravity, and friction is refused before.
NEVER_FELT = {("gravity", "urdf"), ("friction", "mjcf"), ("friction", "urdf")}
# Trees: answers in a loop are accelerations and gaps together, and its mistakes are planted by the campaign.
ALL = [members[0] for path in sorted(BUILT_IN.systems.glob("*.py")) if (members := names_in(path)) and not is_tied(members[0])]
NATIVE = {"mjcf": "mujoco", "urdf": "pinocchio"}
# How many mistakes of each kind are made in each model, drawn by a seed of their own; the campaign of faults makes more.
FEW = 1

TURNED = {
    "mjcf": """\
<mujoco model="turned">
  <compiler angle="radian"/>
  <worldbody>
    <body name="arm" euler="0.3 0 0">
      <joint name="hinge" axis="0 1 0" stiffness="3"
             springref="0.25" damping="0.5" armature="0.125"/>
      <inertial pos="0.5 0 0" mass="2" fullinertia="0.25 0.5 0.5 0.0625 0 0.03125"/>
      <body name="hand" pos="1 0 0" quat="0.8 0 0.6 0">
        <joint name="wrist" axis="0 0 1"/>
        <inertial pos="0.25 0 0" quat="0.8 0.6 0 0" mass="1" diaginertia="0.125 0.25 0.25"/>
      </body>
    </body>
  </worldbody>
</mujoco>
""",
    "urdf": """\
<robot name="turned">
  <link name="world"/>
  <link name="arm">
    <inertial>
      <origin xyz="0.5 0 0" rpy="0.3 0 0.2"/>
      <mass value="2"/>
      <inertia ixx="0.25" ixy="0.0625" ixz="0" iyy="0.5" iyz="0.03125" izz="0.5"/>
    </inertial>
  </link>
  <joint name="hinge" type="continuous">
    <parent link="world"/>
    <child link="arm"/>
    <origin xyz="0 0 0.5"
            rpy="0.3 0 0"/>
    <axis xyz="0 1 0"/>
    <dynamics damping="0.5"/>
  </joint>
  <gazebo reference="hinge">
    <springStiffness>3</springStiffness>
    <springReference>0.25</springReference>
  </gazebo>
</robot>
""",
}


def turned(model_format: str) -> ModelFile:
    """A model with everything that the catalogue has nowhere: turned frames, a rotor, a spring relaxed at an angle."""
    return parse_model(BUILT_IN.model_path("turned", model_format), TURNED[model_format], model_format)


@functools.cache
def healthy(name: str, model_format: str) -> ModelFile:
    return read_model(BUILT_IN.model_path(name, model_format), model_format)


@functools.cache
def bench(name: str, model_format: str) -> tuple[Watch, Reference]:
    """The format's own engine on a sound model, and the truth at the same states."""
    mechanism, engine = load_mechanism(BUILT_IN, name), load_engine(BUILT_IN, NATIVE[model_format])
    states = generic_sample(mechanism, 32, 3)
    reference = ReferenceKernel(mechanism, engine.linear_velocity_in_body).evaluate(states)
    return watch(engine, mechanism, healthy(name, model_format), states), reference


def mended(mistake: Mistake, watched: Watch, reference: Reference, planted: Change) -> Iterator[str]:
    """What its mends make of a mistake: those without a free value, then those with one, at every number of the sound file and fitted."""
    model = watched.model
    wrong = parse_model(model.path, planted.text(1.0), model.format)
    numbers = find_numbers(model.text, model.format)
    values = {sign * number.value for number in numbers for sign in (1.0, -1.0)}
    # Half of a mass moved is too far for a fit from none.
    values |= {0.5 * number.value for number in numbers if "mass" in (number.element, number.attribute)}
    candidates = list(mistake.mend(wrong))
    yield from (candidate.text(0.0) for candidate in candidates if candidate.start is None)
    places = {place.key[:2] for place in planted.places}
    free = [candidate for candidate in candidates if candidate.start is not None and candidate.place.key[:2] in places]
    yield from (candidate.text(value) for candidate in free for value in sorted(values))
    yield from (candidate.text(value) for candidate in free for value in _fitted(watched, reference, candidate))


def _fitted(watched: Watch, reference: Reference, candidate: Change) -> Iterator[float]:
    """The value that a diagnosis fits, for shares and angles that stand in no file, from no change."""
    side = ModelSide(watched, reference)
    assert candidate.start is not None
    value = fit(partial(side.residual_at, candidate), partial(side.slope, candidate), candidate.start, None, candidate.scale)
    if value is not None:
        yield value


def agrees(watched: Watch, reference: Reference, text: str) -> bool:
    answers = watched.accelerations(text)
    return answers is not None and bool((compare(reference, answers).backward_error <= AGREEMENT).all())


def changes_the_dynamics(watched: Watch, text: str) -> bool:
    movement = watched.movement(text)
    return movement is not None and movement > 1e-10


def undone(mistake: Mistake, name: str, model_format: str, statement: str = "") -> Iterator[tuple[Change, bool]]:
    """Valid mistakes of which ``statement`` is said and that change the dynamics, in an order drawn by a seed; whether some mend helps."""
    watched, reference = bench(name, model_format)
    mistakes = [planted for planted in mistake.plant(watched.model) if statement in planted.statement]
    random.Random(f"{mistake.name} {name} {model_format}").shuffle(mistakes)
    for planted in mistakes:
        text = planted.text(1.0)
        if is_valid(watched.model, text) and changes_the_dynamics(watched, text):
            yield planted, any(agrees(watched, reference, mend) for mend in mended(mistake, watched, reference, planted))


def test_every_hypothesis_is_found_by_its_name() -> None:
    assert len(MISTAKES) >= 17
    assert all(name == mistake.name and mistake.title and mistake.source for name, mistake in MISTAKES.items())
    asked = "axis sign damping spring parallel_axis inertia_entries products inertial_rotation degrees armature friction gravity"
    assert {*asked.split(), "joint_order", "frame_offset", "bodies_fused", "units", "frame_rotation"} <= set(MISTAKES)


@pytest.mark.parametrize("model_format", FORMATS)
@pytest.mark.parametrize("name", MISTAKES)
def test_a_mistake_is_undone_by_a_mend_of_its_own_mistake(name: str, model_format: str) -> None:
    count = 0
    for system in SYSTEMS:
        found = list(itertools.islice(undone(MISTAKES[name], system, model_format), FEW))
        # What stands in the file as zero is one of its numbers, each of which every diagnosis tries anyway.
        assert [planted for planted, back in found if not back and not _is_number(planted)] == [], system
        count += sum(back for _, back in found)
    assert (count == 0) == ((name, model_format) in NEVER_FELT)


def test_a_body_counted_in_a_parent_without_mass_is_taken_out_again() -> None:
    """What rounding leaves of the parent is neither a mass with a centre nor a product of inertia."""
    found = undone(MISTAKES["bodies_fused"], "puma_560", "mjcf", "link2 counted in link1")
    assert [back for _, back in found] == [True, True]


@pytest.mark.parametrize("share", [0.25, 1.9])
def test_a_flat_body_whose_parts_get_their_parallel_axes_is_one_that_mujoco_accepts(share: float) -> None:
    """One moment of it is the sum of the others, and rounding makes it more."""
    model = healthy("stanford_arm", "mjcf")
    (completed,) = (
        change for change in MISTAKES["bodies_fused"].mend(model) if change.statement == "parts of link4 without their parallel axes"
    )
    for part in range(1, 21):
        mujoco.MjModel.from_xml_string(completed.text(share * part / 20))


def _is_number(planted: Change) -> bool:
    """True where one number was set to zero."""
    return planted.statement == "left out" and len(planted.places) == 1 and "0" in planted.places[0].found.split()


@pytest.mark.nightly(nights=4)
@pytest.mark.parametrize("model_format", FORMATS)
@pytest.mark.parametrize("name", MISTAKES)
def test_mistakes_are_undone_in_every_tree(name: str, model_format: str) -> None:
    for system in ALL:
        if BUILT_IN.model_path(system, model_format).is_file():
            lost = [planted for planted, back in undone(MISTAKES[name], system, model_format) if not back]
            assert [planted for planted in lost if not _is_number(planted)] == [], system


@pytest.mark.parametrize("model_format", FORMATS)
@pytest.mark.parametrize("name", MISTAKES)
def test_no_line_moves_and_the_places_are_those_of_the_planted_text(name: str, model_format: str) -> None:
    for model in [*(healthy(system, model_format) for system in SYSTEMS), turned(model_format)]:
        for planted in MISTAKES[name].plant(model):
            text = planted.text(1.0)
            assert text != model.text
            assert text.count("\n") == model.text.count("\n")
            lines, before = text.splitlines(), model.text.splitlines()
            # A place that lost its value may be named by the line of the element that lacks it.
            written = {line for line, (new, old) in enumerate(zip(lines, before, strict=True), start=1) if not _only_lost(new, old)}
            assert written <= {place.line for place in planted.places} | _along(model), planted
            assert all(1 <= place.line <= len(lines) for place in planted.places)


def _only_lost(new: str, old: str) -> bool:
    """True where a line is another less a part."""
    start = next((place for place, (one, other) in enumerate(zip(new, old, strict=False)) if one != other), len(new))
    return old.endswith(new[start:]) and len(new) <= len(old)


def _along(model: ModelFile) -> set[int]:
    """Lines that may change besides: the stage of a force that is left in, the limit of a joint that is driven, a name space."""
    lines = enumerate(model.text.splitlines(), start=1)
    return {line for line, text in lines if any(word in text for word in ("<flag", "<limit", "<robot"))}


@pytest.mark.parametrize("model_format", FORMATS)
def test_planted_texts_are_valid_but_where_the_mistake_itself_is_refused(model_format: str) -> None:
    model = turned(model_format)
    refused = {name for name, one in MISTAKES.items() for planted in one.plant(model) if not is_valid(model, planted.text(1.0))}
    # Negative moments and springs are no model's.
    assert refused <= {"parallel_axis", "sign", "inertia_entries", "bodies_fused"}


@pytest.mark.parametrize("model_format", FORMATS)
def test_friction_is_refused_where_it_stands_and_so_has_no_mend(model_format: str) -> None:
    model, friction, without = turned(model_format), MISTAKES["friction"], load_mechanism(BUILT_IN, "atwood")
    plants = list(friction.plant(model))
    assert {planted.places[0].attribute for planted in plants} == {{"mjcf": "frictionloss", "urdf": "friction"}[model_format]}
    for planted in plants:
        place = planted.places[0]
        elements = find_elements(planted.text(1.0), model_format)
        holder = next(one for one in elements if one.tag == place.element and any(part.line == place.line for part in one.attributes))
        with pytest.raises(InvalidModel, match=r"dry friction of joint .* is none that the system has") as refused:
            require_bounds(parse_model(model.path, planted.text(1.0), model_format), without)
        assert refused.value.line == holder.line
        # Past that it would be a mend that no diagnosis ever makes.
        assert list(friction.mend(replace(model, text=planted.text(1.0)))) == []


@pytest.mark.parametrize("model_format", FORMATS)
def test_frames_that_are_turned_have_their_rotations_dropped_reversed_and_misread(model_format: str) -> None:
    model = turned(model_format)
    for name in ("frame_rotation", "inertial_rotation"):
        statements = [planted.statement for planted in MISTAKES[name].plant(model)]
        assert any("left in" in statement for statement in statements)
        assert any("the other way" in statement for statement in statements)
        # The other way twice is where it was.
        reversed_once = next(planted for planted in MISTAKES[name].plant(model) if "the other way" in planted.statement)
        once = parse_model(model.path, reversed_once.text(1.0), model_format)
        back = [candidate.text(0.0) for candidate in MISTAKES[name].mend(once) if "the other way" in candidate.statement]
        assert any(_same_numbers(model, once, text) for text in back)
    degrees = [planted.places[0].key for planted in MISTAKES["degrees"].plant(model)]
    assert len(set(degrees)) >= 3


def _same_numbers(model: ModelFile, once: ModelFile, text: str) -> bool:
    """True where mending ``once`` gives the orientation of ``model`` again; MJCF writes it as a quaternion."""

    def orientations(of: ModelFile) -> list[np.ndarray]:
        parts = anatomy(of)
        slots = [body.rotation for body in parts.bodies] + [inertial.rotation for inertial in parts.inertials]
        return [matrix_of(slot, parts) for slot in slots if slot is not None]

    again = orientations(parse_model(model.path, text, model.format))
    return all(np.allclose(one, other, atol=1e-15) for one, other in zip(orientations(model), again, strict=True))


@pytest.mark.parametrize("compiler", ["", 'angle="radian"', 'angle="degree" eulerseq="ZYX"'])
@pytest.mark.parametrize(
    "orientation",
    [
        'quat="1 2 -3 0.5"',
        'axisangle="1 -2 0.5 0.75"',
        'euler="0.3 -0.7 1.1"',
        'xyaxes="1 2 0.5 0 1 -2"',
        'zaxis="1 -2 0.5"',
        'zaxis="0 0 3"',
        'zaxis="0 0 -3"',
    ],
)
def test_an_orientation_is_that_which_mujoco_compiles(orientation: str, compiler: str) -> None:
    inertial = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
    body = f'<body name="b" {orientation}><joint name="j"/>{inertial}</body>'
    text = f'<mujoco model="m"><compiler {compiler}/><worldbody>{body}</worldbody></mujoco>'
    parts = anatomy(parse_model(Path("m.xml"), text, "mjcf"))
    [slot] = [body.rotation for body in parts.bodies if body.rotation is not None]
    compiled = mujoco.MjModel.from_xml_string(text).body("b").quat
    expected = Rotation.from_quat(compiled, scalar_first=True).as_matrix()
    np.testing.assert_allclose(matrix_of(slot, parts), expected, atol=1e-14)


@pytest.mark.parametrize("model_format", FORMATS)
def test_principal_axes_that_were_forgotten_stand_where_their_rotation_would(model_format: str) -> None:
    model, mistake = healthy("stanford_arm", model_format), MISTAKES["inertial_rotation"]
    (planted,) = (planted for planted in mistake.plant(model) if "principal axes" in planted.statement)
    mends = {candidate.place.key for candidate in mistake.mend(parse_model(model.path, planted.text(1.0), model_format))}
    assert mends & {place.key for place in planted.places}


@pytest.mark.ci
@pytest.mark.parametrize("model_format", FORMATS)
def test_a_free_candidate_at_its_start_is_the_file_as_it_is(model_format: str) -> None:
    for model in [*(healthy(system, model_format) for system in SYSTEMS), turned(model_format)]:
        for mistake in MISTAKES.values():
            for candidate in mistake.mend(model):
                assert candidate.scale > 0
                if candidate.start is not None:
                    assert candidate.text(candidate.start) == model.text
                    steps = (1e-3 * candidate.scale, -1e-3 * candidate.scale)
                    # Out of a parent without mass none can be taken.
                    assert any(is_valid(model, candidate.text(candidate.start + step)) for step in steps), candidate


def test_a_quaternion_in_the_other_order_has_the_same_numbers() -> None:
    model = turned("mjcf")
    model = parse_model(model.path, model.text.replace('quat="0.8 0 0.6 0"', 'quat="0.8 0.48 0.36 0"'), "mjcf")
    made = {change.statement: change.text(1.0) for change in MISTAKES["frame_rotation"].plant(model)}
    assert 'quat="0 0.8 0.48 0.36"' in made["quaternion with its scalar first"]
    assert 'quat="0.48 0.36 0 0.8"' in made["quaternion with its scalar last"]


def declared_statements() -> Iterator[tuple[str, str]]:
    """Module and pattern of every statement that a module of mistakes spells out."""
    for path in sorted(Path(mistakes.__file__).parent.glob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") in ("FixedChange", "FreeChange") and node.args:
                said = node.args[0]
                parts = said.values if isinstance(said, ast.JoinedStr) else [said]
                if all(isinstance(part, ast.FormattedValue) or isinstance(getattr(part, "value", None), str) for part in parts):
                    yield path.stem, "".join(re.escape(part.value) if isinstance(part, ast.Constant) else ".+" for part in parts)


@functools.cache
def made_statements() -> frozenset[str]:
    models = [turned(model_format) for model_format in FORMATS]
    models += [healthy(name, model_format) for name in SYSTEMS for model_format in FORMATS]
    every = itertools.product(find_mistakes(), models)
    return frozenset(change.statement for mistake, model in every for change in (*mistake.plant(model), *mistake.mend(model)))


@pytest.mark.parametrize("model_format", FORMATS)
def test_offsets_angles_axes_and_masses_are_all_looked_for(model_format: str) -> None:
    """What the docstrings of the mistakes promise of any file, in one that has all of it."""
    model = turned(model_format)
    statements = {change.statement for mistake in MISTAKES.values() for change in (*mistake.plant(model), *mistake.mend(model))}
    assert {"axis reversed", "y and z of the axis exchanged", "degrees for radians", "radians for degrees"} <= statements
    if model_format == "mjcf":
        assert {"offset of hand left in", "joints hinge and wrist exchanged", "angles of the whole file in the other unit"} <= statements


@pytest.mark.ci
@pytest.mark.parametrize(("module", "pattern"), sorted(set(declared_statements())))
def test_every_mistake_that_is_spelled_out_is_made_in_some_model(module: str, pattern: str) -> None:
    assert any(re.fullmatch(pattern, statement) for statement in made_statements())


def test_a_model_of_six_degrees_of_freedom_has_a_few_hundred_candidates() -> None:
    for model_format in FORMATS:
        assert 100 < sum(len(list(mistake.mend(healthy("puma_560", model_format)))) for mistake in MISTAKES.values()) < 400


def test_both_formats_make_the_same_mistakes() -> None:
    """Of a system without gravity or angles in its files, but for what only one format can say."""
    for name in ("axis", "damping", "armature", "friction", "joint_order", "parallel_axis", "frame_rotation", "inertial_rotation"):
        mjcf, urdf = (len(list(MISTAKES[name].plant(healthy("arm_2r", model_format)))) for model_format in FORMATS)
        assert mjcf == urdf > 0, name


@pytest.mark.parametrize("model_format", FORMATS)
@pytest.mark.parametrize(("name", "has_products"), [("stanford_arm", True), ("arm_2r", False)])
def test_entries_of_an_inertia_are_taken_in_another_order_where_there_are_products(
    name: str, has_products: bool, model_format: str
) -> None:
    """Moments alone that come in another order are another mistake."""
    statements = {change.statement for mistake in MISTAKES.values() for change in mistake.plant(healthy(name, model_format))}
    assert any("entries in the order of another format" in statement for statement in statements) == has_products


def test_every_factor_that_is_tried_is_tried_the_other_way_too() -> None:
    """What the author of a file multiplied by has to be divided out, and the other way round; a number that is missing has none."""
    factors = set(OTHER_STARTS) - {0.0}
    assert 0.0 in OTHER_STARTS and 1.0 not in factors and {math.degrees(1), math.radians(1), 1e3} <= factors
    assert sorted(1 / factor for factor in factors) == pytest.approx(sorted(factors), rel=1e-15)
