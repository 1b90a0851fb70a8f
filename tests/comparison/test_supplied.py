"""A file that is named by its path gets from the harness what it gets as a mechanism's model: springs, rotors, a ball joint."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from comparison.robots import record_of
from support import BUILT_IN

from harness.engines.request import Aid, JointForces, Request

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


def test_an_engine_that_must_be_told_gravity_is_told_the_file_s_where_that_is_supplied() -> None:
    """A user of PyBullet or iDynTree says 9.81 downwards, whatever stands in a file that holds gravity."""
    plain = Request(path=Path("robot.urdf"), format="urdf", joints=(), moving=())
    aided = replace(plain, aid=Aid(np.array([0.5, -1.5, 3.0]), JointForces(np.zeros(0), ()), np.zeros(0)))
    assert (plain.gravity, aided.gravity) == ((0.0, 0.0, -9.81), (0.5, -1.5, 3.0))
