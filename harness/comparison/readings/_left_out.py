"""Readings that several engines have: elements that an engine leaves out, and that nothing stands for.

Each takes the engine, its formats, the sentence and the source, and whether the harness supplies it to an aided engine.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

from harness.comparison.readings import Reading, freed, with_joints
from harness.robots.robot import Robot
from harness.robots.tree import Tree

Declare = Callable[..., Reading]


def _without(number: str) -> Callable[[Robot], Tree]:
    """The tree of a robot in which that number of every joint is zero."""

    nothing: dict[str, Any] = {number: Fraction(0)}

    def tree(robot: Robot) -> Tree:
        return with_joints(robot.tree, lambda joint: replace(joint, **nothing) if getattr(joint, number) else joint)

    return tree


def _without_mimics(robot: Robot) -> Tree:
    return with_joints(robot.tree, freed)


def _without_tendons(robot: Robot) -> Tree:
    tree = robot.tree
    return replace(tree, springs=(), couplings=()) if tree.springs or tree.couplings else tree


def _declaring(name: str, concerns: str, tree: Callable[[Robot], Tree], is_supplied: bool = True) -> Declare:
    def declare(engine: str, formats: Sequence[str], sentence: str, source: str, supplied: bool = is_supplied) -> Reading:
        return Reading(name, engine, tuple(formats), sentence, concerns, source, tree, supplied)

    return declare


dampers = _declaring("joint damping", "joints", _without("damping"))
springs = _declaring("springs", "joints", _without("stiffness"))
rotors = _declaring("rotor inertias", "joints", _without("armature"))
mimics = _declaring("mimic joints", "joints", _without_mimics)
tendons = _declaring("tendons", "tendons", _without_tendons, is_supplied=False)
