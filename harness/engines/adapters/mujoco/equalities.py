"""What MuJoCo's readers make of the equalities of any robot's file, and which of them act.

Source: MuJoCo documentation, Modeling, URDF extensions; XML reference, ``compiler/fusestatic`` and ``equality``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from lxml import etree

# Tags of a file by the names of MuJoCo's types of equality, where they are others.
_TYPES = {"mimic": "joint"}


def settings(root: etree._Element, model_format: str) -> etree._Element:
    """The element in which compiler and options stand: that of a URDF's extension, where it has one."""
    extension = root.find("mujoco") if model_format == "urdf" else root
    return root if extension is None else extension


def fuses(root: etree._Element, model_format: str) -> bool:
    """Whether the compiler makes bodies that no joint moves one with their parents, which it does by itself in a URDF alone."""
    told = [compiler.get("fusestatic") for compiler in settings(root, model_format).iterfind("compiler[@fusestatic]")]
    return told[-1] == "true" if told else model_format == "urdf"


def switch_on(model: Any, kinds: Sequence[str], numbers: Sequence[int]) -> None:
    """Let the equalities of these numbers act and no other; ``kinds`` are the tags of all that the file holds.

    Raises:
        ValueError: the compiled model has others.
    """
    import mujoco

    found = [mujoco.mjtEq(int(one)).name.removeprefix("mjEQ_").lower() for one in model.eq_type]
    wanted = [_TYPES.get(kind, kind) for kind in kinds]
    if found != wanted:
        raise ValueError(f"MuJoCo makes the equalities {', '.join(found) or 'none'} of the file's {', '.join(wanted)}")
    model.eq_active0[:] = 0
    model.eq_active0[list(numbers)] = 1
