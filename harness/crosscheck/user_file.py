"""A user's file as an engine reads it: the mechanism that the engine computes with, its states, and the truth of its answers.

It is what the engine's readings make of the file. A plain engine has all of them, an aided one those that nothing is supplied for.
"""

from __future__ import annotations

from dataclasses import replace
from typing import cast

from harness.crosscheck.file_numbers import why_refused
from harness.engines import Unsupported, load_engine
from harness.engines.tree_request import asked_joints
from harness.explain.meant import STATES, Folded, columns_of, effects, meant, read_by, request_of, spread, undetermined, why_unread
from harness.library import Library
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.states import States
from harness.results.readings import Effect
from harness.storage import Kept
from harness.trees.mechanism import RobotMechanism, mechanism_of
from harness.trees.robot import Robot
from harness.truth.quantities import Quantity


def folded_by(library: Library, engine: str, own: Mechanism) -> Folded:
    """The file of a mechanism as an engine's readings have it, one after the other."""
    return _FOLDED.get((library, engine, own.key), lambda: read_by(_robot(own), engine, load_engine(library, engine), library.stance))


def mechanism_read_by(library: Library, engine: str, own: Mechanism) -> Mechanism:
    """The mechanism that an engine computes with; raises as ``Assignment.as_read``."""
    if not isinstance(own, RobotMechanism) or own.reader:
        return own
    read = folded_by(library, engine, own).robot
    if read is own.robot:
        return own
    if why := why_unread(read, own.robot) or undetermined(read):
        raise Unsupported(f"as {engine} reads the file, {why}")

    def written() -> RobotMechanism:
        asked = request_of(own.robot, library.stance, read)
        return replace(mechanism_of(read), name=own.name, digest=own.digest, reader=engine, request=asked)

    return _READ.get((library, engine, own.key), written)


def states_read(own: Mechanism, read: Mechanism, states: States) -> States:
    """States of a file's mechanism, over the joints of what is read of it."""
    tree, joints = _robot(read).tree, _robot(read).joints
    return spread(_robot(own), states, asked_joints(tree, joints))


def compared_columns(own: Mechanism, read: Mechanism, quantity: Quantity) -> list[int] | slice | None:
    """Those of a file's values of a quantity among what is read of it; None where these are others."""
    mine, found = _robot(own), _robot(read)
    if found.joints == mine.joints:
        return slice(None)
    if not quantity.is_default or not set(mine.joints) <= set(found.joints):
        return None
    return columns_of(asked_joints(found.tree, found.joints), mine.joints)


def readings_and_refusal(library: Library, engine: str, own: Mechanism, seed: int, failure: str) -> tuple[list[Effect], list[str]]:
    """What each of an engine's readings does, at the states of a comparison of the file; or why it refuses the file, if it fails."""
    robot = _robot(own)
    if failure:
        named = [body.name for body in robot.tree.bodies if f"'{body.name}'" in failure]
        return [], why_refused(robot, named[0] if named else "")
    key = library, engine, own.key, seed
    return _EFFECTS.get(key, lambda: effects(meant(robot, STATES, seed), folded_by(library, engine, own))), []


def _robot(mechanism: Mechanism) -> Robot:
    return cast("RobotMechanism", mechanism).robot


_FOLDED: Kept[Folded] = Kept(32)
_READ: Kept[RobotMechanism] = Kept(32)
_EFFECTS: Kept[list[Effect]] = Kept(32)
