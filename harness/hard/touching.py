"""Distances of motions with contacts from rigid ones: mechanisms whose rigid motion has a closed form, or all known accelerations.

An engine that gives at contacts moves otherwise than rigid bodies under Coulomb's law, by as much as its parameters have it give. Each
``RigidCase`` turns one parameter of a mechanism and measures one number of the motion; the rigid answers are intervals, of which there are
several where several motions are consistent, and none where none is. Each is asked of every engine that simulates files with contacts, as
the file stands and with settings by which its user comes nearer.

A distance is no verdict: a law that gives is not wrong. It is relative to the scale of its case.
"""

from __future__ import annotations

import functools
import math
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from harness.crosscheck.scene import with_parameters
from harness.engines import NotOffered, engine_files, load_engine
from harness.engines.moving import Control, MotionsRequest, MovedFile, SimulatedFile, Timing
from harness.engines.request import Refused
from harness.environments import split_name
from harness.hard.rigid_case import Edits, Interval, Numbers, RecordedMotion, RigidCase
from harness.hard.touching_files import FORMATS
from harness.lagrange.assembly import contact_rows
from harness.lagrange.derivation import load_mechanism, load_system
from harness.lagrange.system import System
from harness.library import Library
from harness.programs.mechanisms.mechanism import Mechanism
from harness.registry import declared
from harness.results.rigid import RigidDistance
from harness.study import Note
from harness.truth.coulomb import RigidContact, RigidContacts

# States of a motion that are recorded, at most.
_RECORDED = 200
# Length of a step [s] where nothing else is said, and a fine one.
_LENGTH, _FINE = 2e-3, 2e-4


@dataclass(frozen=True)
class ContactSetting:
    """Settings with which an engine holds contacts.

    Attributes:
        length: of a step [s]. edits: of an MJCF; where there are any, engines whose own format is another are not asked.
        usual: whether cases that name no settings are asked with it.
    """

    name: str
    length: float = _LENGTH
    edits: Edits = field(default_factory=dict)
    usual: bool = True


def _stiffest(length: float) -> Edits:
    """Contacts that return in the least time that MuJoCo takes, which is that of two steps."""
    return {"worldbody//geom": {"solref": f"{2 * length:g} 1"}}


SETTINGS = (
    ContactSetting("as the file stands"),
    ContactSetting("elliptic cones, impratio 100", edits={"option": {"cone": "elliptic", "impratio": "100"}}),
    ContactSetting("timeconst of two steps", edits=_stiffest(_LENGTH)),
    ContactSetting("noslip", edits={"option": {"noslip_iterations": "50"}}),
    ContactSetting("steps of 0.2 ms", length=_FINE),
    ContactSetting(
        "all of these",
        length=_FINE,
        edits={"option": {"cone": "elliptic", "impratio": "100", "noslip_iterations": "50"}, **_stiffest(_FINE)},
    ),
    ContactSetting("solver CG", edits={"option": {"solver": "CG"}}, usual=False),
    ContactSetting("solver PGS", edits={"option": {"solver": "PGS"}}, usual=False),
    ContactSetting("without refsafe", edits={"option/flag": {"refsafe": "disable"}}, usual=False),
)


@functools.cache
def rigid_cases() -> Mapping[str, RigidCase]:
    """Every ``RigidCase`` of the hard cases' modules by name."""
    return declared("harness.hard.cases", RigidCase, "motion with contacts")


def rigid_contacts(system: System, mechanism: Mechanism) -> RigidContacts:
    """The contacts of a system, with the values of parameters of the mechanism, which is derived from it."""
    found, next_slip = list[RigidContact](), len(system.contacts)
    for place, (name, contact) in enumerate(system.contacts.items()):
        slips = range(next_slip, next_slip + len(contact.slips))
        found.append(RigidContact(name, (place, *slips), contact.friction.name if contact.friction is not None else ""))
        next_slip = slips.stop
    return RigidContacts(mechanism, found, contact_rows(system, mechanism.program))


@dataclass(frozen=True)
class _Place:
    """One value of a case, with the numbers of the rigid answers there."""

    case: RigidCase
    value: float
    own: Numbers
    rigid: Sequence[Interval]

    def distance(self, engine: str, setting: ContactSetting, found: float | None, reason: str = "") -> RigidDistance:
        """The record of what an engine found, or why it found nothing."""
        case, scale = self.case, max([self.case.scale(self.own), *(abs(bound) for interval in self.rigid for bound in interval)])
        known = None if found is None or not math.isfinite(found) else found
        nearest = None if known is None else min((max(low - known, known - high, 0.0) for low, high in self.rigid), default=None)
        return RigidDistance(
            case=case.name,
            system=case.system,
            engine=engine,
            setting=setting.name,
            knob=case.knob[0],
            unit=case.knob[1],
            value=self.value,
            gentle_first=case.gentle_first,
            measured=case.measured[0],
            measured_unit=case.measured[1],
            rigid=list(self.rigid),
            found=known,
            distance=None if nearest is None else nearest / scale,
            reason=reason or ("" if known is not None else "its motion breaks down"),
            is_refused=bool(reason),
        )


def rigid_distances(name: str, library: Library, note: Note) -> list[RigidDistance]:
    """Every engine of a library along one case, as a task for ``harness.workers``."""
    case, built_in = rigid_cases()[name], Library.built_in()
    system, _ = load_system(built_in.system_path(case.system))
    mechanism, found = load_mechanism(built_in, case.system), list[RigidDistance]()
    for value in case.values:
        changed = case.changes(value)
        turned = with_parameters(mechanism, changed)
        own = {name: number for name, number, _ in turned.parameters} | dict(changed)
        q, v = case.start(own)
        place = _Place(case, value, own, case.rigid(rigid_contacts(system, turned), q, v, own))
        for engine in _engines(library):
            for setting in SETTINGS:
                is_meant = setting.name in case.only if case.only else setting.usual
                if not is_meant or (setting.edits and not FORMATS[_format_of(library, engine)].takes_settings):
                    continue
                note(f"{engine}, {case.knob[0]} = {value!r}, {setting.name}")
                try:
                    number = _measured(library, engine, place, setting)
                except NotOffered:
                    break
                except Refused as refusal:
                    found.append(place.distance(engine, setting, None, str(refusal)))
                    break
                found.append(place.distance(engine, setting, number))
    return found


def _engines(library: Library) -> Iterator[str]:
    """Names of engines that are installed and read files, each in one version."""
    for name, file in engine_files(library).items():
        is_there = file.version is not None and file.outcome.value is not None
        if is_there and not split_name(name)[1] and FORMATS.keys() & set(file.outcome.value.formats):
            yield name


def _format_of(library: Library, engine: str) -> str:
    """The format that is an engine's own."""
    formats: Sequence[str] = engine_files(library)[engine].outcome.value.formats
    return next(one for one in formats if one in FORMATS)


def _measured(library: Library, engine: str, place: _Place, setting: ContactSetting) -> float:
    """The number of a case by an engine; NaN where its motion breaks down. Raises as ``Engine.moved``."""
    case, value, own = place.case, place.value, place.own
    start = tuple(np.array(part, dtype=np.float64) for part in case.start(own))
    length = setting.length if case.length is None else case.length(value, own)
    steps = 1 if case.time is None else max(1, math.ceil(case.time(own) / length))
    counts = tuple(dict.fromkeys(np.linspace(1, steps, min(steps, _RECORDED)).astype(int).tolist()))
    name = _format_of(library, engine)
    model_format = FORMATS[name]
    source = model_format.source(case)
    with tempfile.TemporaryDirectory(prefix="harness-contact-") as folder:
        path = Path(folder) / source.name
        path.write_bytes(model_format.turned(source, case, value, setting.edits))
        motion = SimulatedFile(MovedFile(path, name, length=length), {}, Timing(), counts)
        joints = tuple(dict.fromkeys(load_mechanism(Library.built_in(), case.system).joints))
        control = Control.constant({})
        moved = load_engine(library, engine).moved(MotionsRequest([motion], joints, start[0], start[1], control, True))
    # Engines that offer no motions at all have said so by now.
    if lacking := model_format.lacking(case):
        raise Refused(lacking)
    times = length * np.array(counts, dtype=np.float64)
    return case.measure(RecordedMotion(times, moved.q[0], moved.v[0], (start[0], start[1])), own)
