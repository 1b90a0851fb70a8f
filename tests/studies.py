"""Scenes and assignments of the built-in library, as tests of studies ask for them."""

from __future__ import annotations

import functools
from dataclasses import replace

from catalogue import BUILT_IN

from harness.crosscheck.assignment import Assignment
from harness.crosscheck.scene import Scene
from harness.explain.pattern import subject_named
from harness.lagrange.derivation import load_mechanism
from harness.programs.mechanisms.mechanism import Mechanism


@functools.cache
def scene(name: str) -> Scene:
    return Scene.of(BUILT_IN, name)


def mechanism_named(name: str) -> Mechanism:
    return load_mechanism(BUILT_IN, name)


def assignment_of(name: str, subject: str = "mujoco/mjcf") -> Assignment:
    return Assignment.of(BUILT_IN, name, subject_named(subject))


def with_factors(mechanism: Mechanism, **factors: float) -> Mechanism:
    """The mechanism with some parameters multiplied."""
    assert factors.keys() <= {name for name, _, _ in mechanism.parameters}
    return replace(mechanism, parameters=tuple((name, value * factors.get(name, 1.0), unit) for name, value, unit in mechanism.parameters))


def silent(text: str) -> None:
    """Nobody reads what a crash would leave behind."""
