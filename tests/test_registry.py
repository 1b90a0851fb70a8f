"""Declarations found by name, in a package written for the test."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import pytest

from harness.errors import InvalidRequest
from harness.registry import declared, module_names, select


@dataclass(frozen=True)
class Bell:
    name: str


@pytest.fixture
def belfry(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest) -> str:
    """A package of a name of its own, as modules once imported stay."""
    name = f"belfry_{abs(hash(request.node.name))}"
    texts = {
        "__init__": "",
        "tower": "from test_registry import Bell\nBELLS = [Bell('tenor'), Bell('alto')]",
        "chapel": f"from test_registry import Bell\nfrom {name}.tower import BELLS\nBELL = Bell('small')",
        "_clapper": "raise RuntimeError",
    }
    (tmp_path / name).mkdir()
    for module, text in texts.items():
        (tmp_path / name / f"{module}.py").write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setitem(sys.modules, "test_registry", sys.modules[__name__])
    return name


def test_declarations_alone_and_in_lists_are_found_once_in_order_and_shared_modules_are_left_out(belfry: str) -> None:
    bells = declared(belfry, Bell, "bell")
    assert module_names(belfry) == ["chapel", "tower"]
    assert sorted(bells) == ["alto", "small", "tenor"]
    assert list(bells) == ["tenor", "alto", "small"]


def test_names_are_selected_once_in_their_order_and_all_for_none(belfry: str) -> None:
    bells = declared(belfry, Bell, "bell")
    assert [one.name for one in select(["small", "alto", "small"], bells, "bell")] == ["small", "alto"]
    assert {one.name for one in select([], bells, "bell")} == {"alto", "small", "tenor"}
    with pytest.raises(InvalidRequest, match="no bell is called 'tenora'; did you mean 'tenor'"):
        select(["tenora"], bells, "bell")


def test_two_declarations_of_one_name_are_refused(belfry: str, tmp_path: Path) -> None:
    (tmp_path / belfry / "yard.py").write_text("from test_registry import Bell\nBELL = Bell('alto')")
    with pytest.raises(ValueError, match=f"{belfry} has two of the name 'alto'; expected one bell of a name"):
        declared(belfry, Bell, "bell")
