"""A file that is named by its path gets from the harness what it gets as a mechanism's model: springs, rotors, a ball joint."""

from __future__ import annotations

import pytest
from comparison.robots import record_of
from support import BUILT_IN

SUPPLIED = ("collar", "coupled_oscillators", "flyball_governor", "furuta_pendulum.armature", "heavy_top", "tora")


@pytest.mark.parametrize("engine", ["mujoco", "pinocchio"])
@pytest.mark.parametrize("name", SUPPLIED)
def test_what_readers_of_urdf_pass_over_is_supplied_by_path(name: str, engine: str) -> None:
    aided = record_of(BUILT_IN.model_path(name, "urdf"), engine, aided=True)
    assert aided.verdict == "agrees" and not aided.readings, (aided.message, aided.rest)


@pytest.mark.parametrize("engine", ["mujoco", "pinocchio"])
@pytest.mark.parametrize(("name", "reading"), [
    ("furuta_pendulum.armature", "rotor inertias"),
    ("heavy_top", "ball joint"),
    ("flyball_governor", "tendons"),
])  # fmt: skip
def test_what_readers_of_urdf_pass_over_explains_a_plain_answer(name: str, reading: str, engine: str) -> None:
    plain = record_of(BUILT_IN.model_path(name, "urdf"), engine)
    assert plain.explained, plain.rest
    # MuJoCo refuses bodies without inertia, of which the catalogue has some.
    assert plain.verdict == "unsupported" or reading in {one.name for one in plain.readings}


def test_a_tendon_at_a_body_that_the_reader_passes_over_pulls_at_nothing() -> None:
    record = record_of(BUILT_IN.model_path("coupled_oscillators", "mjcf"), "pinocchio", aided=True)
    assert record.explained and {one.name for one in record.readings} == {"further trees"}
