"""Distances from rigid contact of one case, changed or not, asked of one engine, by default in this process."""

from __future__ import annotations

from dataclasses import replace

import pytest
from catalogue import CALLED_HERE
from studies import silent

from harness.hard import touching
from harness.hard.rigid_case import RigidCase
from harness.hard.touching import rigid_distances
from harness.library import Library
from harness.results.rigid import RigidDistance


def distances(
    case: RigidCase, monkeypatch: pytest.MonkeyPatch, engine: str = "mujoco", library: Library = CALLED_HERE, **changed: object
) -> list[RigidDistance]:
    own = replace(case, **changed) if changed else case  # type: ignore[arg-type]
    monkeypatch.setattr(touching, "rigid_cases", lambda: {case.name: own})
    monkeypatch.setattr(touching, "_engines", lambda library: iter([engine]))
    return rigid_distances(case.name, library, silent)


def of_setting(found: list[RigidDistance], setting: str) -> dict[float, float | None]:
    return {one.value: one.distance for one in found if one.setting == setting}
