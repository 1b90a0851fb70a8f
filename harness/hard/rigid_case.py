"""A family of motions with contacts whose rigid answers are known: its mechanism, its knob and its measured number."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from harness.arrays import Array
from harness.truth.coulomb import RigidContacts

Numbers = Mapping[str, float]
Interval = tuple[float, float]
# Of elements of an MJCF, or prims of a stage, by their path, attributes that are set; those of prims are declared with their type.
Edits = Mapping[str, Mapping[str, str]]


@dataclass(frozen=True, eq=False)
class RecordedMotion:
    """One motion of a case.

    Attributes:
        times: (k,) [s]. q, v: (k, nq) and (k, nv) after steps. start: q and v before them.
    """

    times: Array
    q: Array
    v: Array
    start: tuple[Array, Array]


@dataclass(frozen=True)
class UrdfChanges:
    """Numbers of a URDF.

    Attributes:
        surface: by their names in the ``<contact>`` that Bullet reads of links, those of every link but the world; the world has lateral
            friction and restitution 1, for Bullet takes the products of both.
        edits: as of an MJCF.
    """

    surface: Numbers = field(default_factory=dict)
    edits: Edits = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class RigidCase:
    """A family of motions with contacts.

    Attributes:
        name, system: of the family, and in the built-in library.
        knob: name and unit of what is turned; values: of it.
        changes: value to parameters of the system that are not its own; edits, of_urdf, of_usd: the same in an MJCF, in a URDF and in
            a stage; None where no stage is written of it.
        start: parameters to q and v; closed: the contacts that touch there.
        time: parameters to the length of the motion [s]; None for one step.
        measured: name and unit of the number that is measured; measure: (motion, parameters) to it.
        rigid: (contacts, q, v, parameters) to the intervals in which rigid motions have it.
        scale: parameters to what distances are relative to.
        length: (value, parameters) to the length of steps [s]; None where that is the setting's.
        only: settings that bear on it, by name; the usual ones for none.
        not_in_urdf: what acts in it that engines take from no URDF, as "spring of a joint"; "" for nothing.
        gentle_first: whether values go from gentle to hard, so that a law of growth and the value that breaks an engine are told.
    """

    name: str
    system: str
    knob: tuple[str, str]
    values: tuple[float, ...]
    changes: Callable[[float], Numbers] = lambda value: {}
    edits: Callable[[float], Edits] = lambda value: {}
    of_urdf: Callable[[float], UrdfChanges] = lambda value: UrdfChanges()
    of_usd: Callable[[float], Edits] | None = None
    start: Callable[[Numbers], tuple[Sequence[float], Sequence[float]]]
    closed: tuple[str, ...] = ()
    time: Callable[[Numbers], float] | None
    measured: tuple[str, str]
    measure: Callable[[RecordedMotion, Numbers], float]
    rigid: Callable[[RigidContacts, Sequence[float], Sequence[float], Numbers], Sequence[Interval]]
    scale: Callable[[Numbers], float] = lambda own: 1.0
    length: Callable[[float, Numbers], float] | None = None
    only: tuple[str, ...] = ()
    not_in_urdf: str = ""
    gentle_first: bool = False
    source: str
