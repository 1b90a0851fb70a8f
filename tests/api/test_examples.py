"""Every public function and method has an example in its docstring, and the example runs."""

from __future__ import annotations

import doctest
import inspect
from pathlib import Path

import pytest
from support import InThisProcess

import harness
from harness.api.loaded_system import LoadedSystem
from harness.api.motion import SimulatedMotion


def documented() -> dict[str, object]:
    """Functions of ``import harness``, and methods of what they return, by name."""
    found = {name: one for name in harness.__all__ if inspect.isfunction(one := getattr(harness, name)) and "api" in one.__module__}
    for kind in (LoadedSystem, SimulatedMotion):
        for name in dir(kind):
            one = inspect.getattr_static(kind, name)
            if not name.startswith("_") and name in {*dir(kind)} - {*kind.__dataclass_fields__} | {"latex"}:
                found[f"{kind.__name__}.{name}"] = one
    return found


EXAMPLES = documented()
WITHOUT = {"LoadedSystem.name", "LoadedSystem.system"}


@pytest.mark.parametrize("name", sorted(EXAMPLES.keys() - WITHOUT))
def test_an_example_runs(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("harness.workers.Workers", InThisProcess)
    monkeypatch.chdir(tmp_path)
    text = inspect.getdoc(EXAMPLES[name]) or ""
    example = doctest.DocTestParser().get_doctest(text, {}, name, None, None)
    assert example.examples, f"{name} has no example"
    report: list[str] = []
    assert doctest.DocTestRunner().run(example, out=report.append).failed == 0, "".join(report)
