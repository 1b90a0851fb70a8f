"""Stages of motions with contacts: each is the mechanism with its shapes, its knob is turned by a layer, and PhysX moves it."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from catalogue import BUILT_IN
from lxml import etree
from pxr import Usd, UsdGeom, UsdPhysics, UsdShade
from rigid_motions import distances, of_setting

from harness.comparison.sameness import hold_against
from harness.explain.meant import meant
from harness.hard.cases.rigid import BALL, BLOCK, DISC, ROLLING, SPHERE, STACK, TOP
from harness.hard.rigid_case import RigidCase
from harness.hard.touching import rigid_cases
from harness.hard.touching_files import FORMATS, stage_of
from harness.results.comparison import FileDifference
from harness.trees.robot import read_robot

CASES = [case for case in rigid_cases().values() if case.of_usd is not None]
# PhysX holds a spring by a drive, which the harness reads as an actuator.
SPRING, SERVO = ' stiffness="0.0056"', '<actuator><position joint="spring" kp="0.0056"/></actuator>'


def turned(case: RigidCase, value: float, folder: Path, model_format: str = "usd") -> Path:
    written = FORMATS[model_format]
    source = written.source(case)
    # OpenUSD keeps layers by their paths.
    path = folder / f"{value!r}" / source.name
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(written.turned(source, case, value, {}))
    return path


def named(case: RigidCase) -> str:
    return case.name


def twin(case: RigidCase, folder: Path) -> Path:
    """The MJCF of the last value of a case, whose springs are servos."""
    path = turned(case, case.values[-1], folder, "mjcf")
    text = path.read_text()
    if SPRING in text:
        path.write_text(text.replace(SPRING, "").replace("</worldbody>", f"</worldbody>{SERVO}"))
    return path


def differing(one: Path, other: Path) -> list[FileDifference]:
    """Numbers that accelerations feel by more than bodies of 1e-15 kg between joints."""
    found = hold_against(meant(read_robot(one), 8, 0), read_robot(other), {})
    assert found.same or found.differences
    return [] if found.same else [number for number in found.differences if number.alone is None or number.alone > 1e-12]


@pytest.mark.parametrize("case", CASES, ids=named)
def test_a_stage_is_the_mechanism(case: RigidCase, tmp_path: Path) -> None:
    """Joints, masses and moments, those that are felt, with the knob turned, and gravity."""
    assert differing(twin(case, tmp_path), turned(case, case.values[-1], tmp_path)) == []


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("physics:mass = 3", "physics:mass = 3.01"),
        ('physics:axis = "Z"', 'physics:axis = "X"'),
        ("(0.08, 0.2, 0.2)", "(0.08, 0.201, 0.2)"),
        ("gravityMagnitude = 9.81", "gravityMagnitude = 9.8"),
    ],
)
def test_a_stage_with_a_wrong_number_is_not(old: str, new: str, tmp_path: Path) -> None:
    text = stage_of(BLOCK).read_text()
    assert old in text
    wrong = tmp_path / "wrong.usda"
    wrong.write_text(text.replace(old, new))
    assert differing(twin(BLOCK, tmp_path), wrong)


Shape = tuple[str, tuple[float, ...], tuple[float, ...]]


def _rounded(numbers: object) -> tuple[float, ...]:
    return tuple(float(one) + 0.0 for one in np.round(np.asarray(numbers, dtype=float), 6))


def shapes_of_mjcf(path: Path) -> set[Shape]:
    """Kind, place and size of each geom of a file whose bodies all begin at the origin, with normals of planes and axes of others."""
    found = set()
    for geom in etree.parse(path).getroot().iter("geom"):
        kind, place, axis, size = (
            geom.get("type", "sphere"),
            *(np.array(geom.get(name, other).split(), dtype=float) for name, other in (("pos", "0 0 0"), ("zaxis", "0 0 1"), ("size", ""))),
        )
        known = {"sphere": size[:1], "box": [*size, *axis], "cylinder": [*size, *axis], "plane": axis}
        found.add((kind, _rounded(place), _rounded(known[kind])))
    return found


def shapes_of_stage(stage: Usd.Stage) -> set[Shape]:
    cache, found = UsdGeom.XformCache(), set()
    for prim in (prim for prim in stage.Traverse() if prim.HasAPI(UsdPhysics.CollisionAPI)):
        to_world = np.array(cache.GetLocalToWorldTransform(prim))
        turn, kind = to_world[:3, :3], {"Cube": "box"}.get(prim.GetTypeName(), prim.GetTypeName().lower())

        def own(name: str, prim: Usd.Prim = prim) -> float:
            return float(prim.GetAttribute(name).Get())

        lengths = np.linalg.norm(turn, axis=1)
        axis = turn["XYZ".index(prim.GetAttribute("axis").Get())] if prim.HasAttribute("axis") else turn[2] / lengths[2]
        sizes = {
            "sphere": lambda own=own: [own("radius")],
            "box": lambda own=own, lengths=lengths, axis=axis: [*(own("size") / 2 * lengths), *axis],
            "cylinder": lambda own=own, axis=axis: [own("radius"), own("height") / 2, *axis],
            "plane": lambda axis=axis: axis,
        }
        found.add((kind, _rounded(to_world[3, :3]), _rounded(sizes[kind]())))
    return found


@pytest.mark.parametrize("case", CASES, ids=named)
def test_shapes_stand_where_the_mechanism_has_them(case: RigidCase, tmp_path: Path) -> None:
    assert shapes_of_stage(Usd.Stage.Open(str(stage_of(case)))) == shapes_of_mjcf(turned(case, case.values[-1], tmp_path, "mjcf"))


@pytest.mark.parametrize("case", CASES, ids=named)
def test_a_knob_sets_what_the_stage_has(case: RigidCase, tmp_path: Path) -> None:
    """Of the mechanism's coefficient of friction, that of every surface."""
    assert case.of_usd is not None
    below = Usd.Stage.Open(str(stage_of(case)))
    for value in case.values:
        above = Usd.Stage.Open(str(turned(case, value, tmp_path)))
        for place, attributes in case.of_usd(value).items():
            for declared in attributes:
                kind, name = declared.split()
                attribute = below.GetPrimAtPath(f"/{place}").GetAttribute(name)
                assert attribute.IsAuthored() and str(attribute.GetTypeName()) == kind, (place, declared)
        rubs = case.changes(value).get("mu")
        for prim in above.Traverse() if rubs is not None and case is not DISC else ():
            if prim.HasAPI(UsdPhysics.CollisionAPI):
                [path] = prim.GetRelationship("material:binding:physics").GetTargets()
                material = UsdPhysics.MaterialAPI(above.GetPrimAtPath(path))
                assert UsdShade.Material(material.GetPrim())
                assert [material.GetStaticFrictionAttr().Get(), material.GetDynamicFrictionAttr().Get()] == [pytest.approx(rubs)] * 2


def test_a_stage_composes_a_heavier_box(tmp_path: Path) -> None:
    robots = [read_robot(turned(STACK, mass, tmp_path)) for mass in (1.0, 1000.0)]
    assert robots[1].total_mass - robots[0].total_mass == pytest.approx(999.0)


def test_an_engine_of_stages_is_refused_where_none_is_written(monkeypatch: pytest.MonkeyPatch) -> None:
    found = distances(TOP, monkeypatch, "physx", of_usd=None)
    assert {(one.is_refused, one.reason) for one in found} == {(True, "no stage is written of it")}
    assert {one.value for one in found} == set(TOP.values)


@pytest.fixture
def physx(environment: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.setenv("HARNESS_CACHE", str(environment("physx")))
    return "physx"


@pytest.mark.nightly
@pytest.mark.parametrize(
    ("case", "most"),
    [(BLOCK, 1e-4), (SPHERE, 4e-3), (ROLLING, 0.012), (BALL, 2e-5), (STACK, 1.5e-3)],
    ids=lambda one: getattr(one, "name", str(one)),
)
def test_physx_comes_near_rigid_motions(case: RigidCase, most: float, physx: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Within twice of what was measured: it sticks and slides, rolls, bounces and rests."""
    found = of_setting(distances(case, monkeypatch, physx, BUILT_IN), "as the file stands")
    assert set(found) == set(case.values)
    assert max(one for one in found.values() if one is not None) < most and None not in found.values()


@pytest.mark.nightly
def test_what_a_top_loses_in_physx_is_its_default_damping(physx: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A body that floats: 0.05 / s in 2 s, whatever the point of the contact rubs by."""
    found = [one.found for one in distances(TOP, monkeypatch, physx, BUILT_IN) if one.setting == "as the file stands"]
    assert found == [pytest.approx(math.exp(-0.1) - 1, abs=0.01)] * len(TOP.values)


@pytest.mark.nightly
def test_physx_is_far_where_its_stage_rubs_otherwise(physx: str, monkeypatch: pytest.MonkeyPatch) -> None:
    right, wrong = (
        of_setting(distances(SPHERE, monkeypatch, physx, BUILT_IN, values=(0.1,), of_usd=of_usd), "as the file stands")[0.1]
        for of_usd in (SPHERE.of_usd, lambda mu: SPHERE.of_usd(1.05 * mu) if SPHERE.of_usd else {})
    )
    assert right is not None and wrong is not None and wrong > 10 * right
