"""The fault campaign over a robot's file: the numbers of its actuators, dry friction, limits and equalities, planted one by one.

The engine loads a copy of the file with another number, and is held against what the file means as ``compare`` does it, at the states where
these act. The numbers are those that a diagnosis suspects. Each is planted twice: ``MOST_ABOVE_THEORY`` times above the change that data
roundoff lets be caught, and visibly. Each range of an actuator is planted as one of another quantity besides: the order of clamps. Contacts
are off.
"""

from __future__ import annotations

import math
import re
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

from harness.arrays import Array
from harness.comparison.robot_library import engines_of_files, robot_at
from harness.comparison.switched_on import pose, with_verdict
from harness.crosscheck.examination import NOISE
from harness.diagnosis.faults.campaign import RIGHT_ROUNDOFFS, RIGHT_VALUE, CampaignSettings, spread_evenly
from harness.diagnosis.faults.reader import MOST_ABOVE_THEORY
from harness.diagnosis.faults.study import FaultStudy
from harness.diagnosis.faults.summary import Fault
from harness.engines import installed_version
from harness.engines.request import EngineAnswers
from harness.errors import InvalidModel, InvalidRequest
from harness.explain.clamps import MovedClamp, moved_clamps
from harness.explain.columns import Whitening
from harness.explain.meant import meant
from harness.explain.suspects import Suspect
from harness.files.findings import CONTACTS, FRICTION
from harness.files.text.scan import largest_change
from harness.files.text.written_numbers import with_number_written
from harness.library import Library, nearest
from harness.results.switched_on import SwitchedOnRecord
from harness.results.table import grouped
from harness.verdict import AGREEMENT

# Relative size of a change that people see, and states of a file, whose truth is certified anew some thousand times.
VISIBLE, STATES = 0.01, 64
# The kind of faults that are ranges of another quantity.
ORDER_OF_CLAMPS = "order of clamps"
# What a diagnosis says of the number that it names.
_NAMED = re.compile(r"(?P<name>.+) = \S+: the engine behaves as with (?P<value>\S+), which leaves (?P<left>\S+) data roundoffs")


class FileCampaign:
    """The faults of one file, which the engine beside the harness loads that is asked with most on.

    Raises:
        InvalidModel: the file cannot be read, or the engine is wrong about it before any fault is planted.
        InvalidRequest: no number is of a kind that is asked for.
    """

    def __init__(self, path: Path, settings: CampaignSettings) -> None:
        robot = robot_at(path)
        self._path, self._settings, self._text, self._format = path, settings, path.read_text(), robot.format
        self._engine = _engine_of(robot.format)
        record, posed = pose(meant(robot, settings.states, settings.seed), self._engine, without=(CONTACTS,))
        if posed is None:
            why = record.message or "it has no actuators, dry friction, limits or equalities that are judged"
            raise InvalidModel(path, None, f"{self._engine}: {why}; expected some, whose numbers can be planted")
        self._record, self._case, self._asked = record, posed.case, posed.asked
        self.numbers = grouped((one.number.attribute, one) for one in self._case.search.suspects if self._is_written_here(one))
        here = [one for one in moved_clamps(self._case.original.robot) if all(place.path == path for place, _ in one.edits)]
        self.planted: dict[str, list[Suspect | MovedClamp]] = {kind: [*own] for kind, own in self.numbers.items()}
        self.planted |= {ORDER_OF_CLAMPS: [*here]} if here else {}
        for kind in settings.kinds:
            if kind not in self.planted:
                raise InvalidRequest(f"{path} has nothing of the kind {kind!r} to be planted; {nearest(kind, self.planted)}")

    def faults(self, note: Callable[[str], None]) -> Iterator[Fault]:
        """Every fault of the kinds asked for, kind by kind."""
        with _copied(self._path) as copy:
            sound = self._answers(copy, self._text)
            record = self._record if sound.refusal else self._judged(copy, sound)
            if sound.refusal or not record.explained:
                why = sound.refusal or "; ".join(record.rest)
                raise InvalidModel(self._path, None, f"{self._engine} is not what it documents before any fault is planted: {why}")
            healthy = sound.of(self._joints)
            for kind in self._settings.kinds or self.planted:
                planted = [(one, size) for one in self.planted[kind] for size in self._sizes(one)]
                found = []
                for one, size in planted:
                    note(f"{self._path}: {one.name}")
                    found.append(self._caught(copy, healthy, one, size))
                red = [place for place, fault in enumerate(found) if fault.live and fault.caught_by == "check"]
                chosen = {red[place] for place in spread_evenly(len(red), self._settings.diagnosed)}
                for place, ((one, size), fault) in enumerate(zip(planted, found, strict=True)):
                    yield self._diagnosed(copy, fault, one, size) if place in chosen else fault

    @property
    def _joints(self) -> tuple[str, ...]:
        return self._case.at.robot.joints

    def _is_written_here(self, suspect: Suspect) -> bool:
        """False for a number of another file, and for one that follows from others."""
        return suspect.number.place.path == self._path and " " not in suspect.number.attribute

    def _theory(self, suspect: Suspect | MovedClamp) -> float:
        """The smallest relative change that is caught by theory; inf for a number that no state feels, and for what is no number."""
        if isinstance(suspect, MovedClamp):
            return math.inf
        column = self._case.search.columns[self._case.search.suspects.index(suspect)]
        felt = float(np.linalg.norm(column, axis=1).max(initial=0.0)) * suspect.scale
        return AGREEMENT / felt if felt else math.inf

    def _sizes(self, suspect: Suspect | MovedClamp) -> list[float]:
        if isinstance(suspect, MovedClamp):
            return [1.0]
        least = MOST_ABOVE_THEORY * self._theory(suspect)
        return [*self._settings.sizes] or [*([least] if least < VISIBLE else []), VISIBLE]

    def _changed(self, suspect: Suspect | MovedClamp, size: float) -> str:
        if isinstance(suspect, MovedClamp):
            return suspect.written(self._text, self._format)
        own = float(suspect.number)
        return with_number_written(self._text, self._format, suspect.number, own + size * suspect.scale, suspect.beside)

    def _answers(self, copy: Path, text: str) -> EngineAnswers:
        copy.write_text(text)
        return replace(self._asked, path=copy).with_those(self._case.judged, self._case.at)

    def _judged(self, copy: Path, answers: EngineAnswers, names: bool = True) -> SwitchedOnRecord:
        """The record of what the engine makes of the copy as it stands."""
        return with_verdict(self._record, self._case, replace(self._asked, path=copy), answers, names)

    def _caught(self, copy: Path, healthy: Array, suspect: Suspect | MovedClamp, size: float) -> Fault:
        theory = self._theory(suspect)
        fault = Fault(
            system=str(self._path),
            format=self._format,
            kind=ORDER_OF_CLAMPS if isinstance(suspect, MovedClamp) else suspect.attribute,
            statement=f"holds {suspect.held}" if isinstance(suspect, MovedClamp) else "",
            where=((suspect.place.line, suspect.place.tag, suspect.attribute),),
            sizes=(size,),
            theory=theory if theory < math.inf else None,
        )
        answers = self._answers(copy, self._changed(suspect, size))
        if answers.refusal:
            return replace(fault, caught_by="reader", answer=answers.refusal)
        accelerations = answers.of(self._joints)
        moved = Whitening(self._case.truth).change(accelerations - healthy)
        is_far = float(np.nan_to_num(np.linalg.norm(moved, axis=1), nan=np.inf).max()) > 2 * AGREEMENT
        fault = replace(fault, live=theory < math.inf or largest_change(healthy, accelerations) > NOISE)
        if not self._judged(copy, answers, names=False).explained:
            return replace(fault, caught_by="check")
        return replace(fault, missed=(size,) if is_far or size >= MOST_ABOVE_THEORY * theory else ())

    def _diagnosed(self, copy: Path, fault: Fault, suspect: Suspect | MovedClamp, size: float) -> Fault:
        started = time.perf_counter()
        record = self._judged(copy, self._answers(copy, self._changed(suspect, size)))
        if isinstance(suspect, MovedClamp):
            own = [sentence.startswith(f"{suspect.name}: the engine holds {suspect.held} in it") for sentence in record.rest]
            fault = replace(fault, named=own[:1] == [True], in_class=any(own), explained=any(" the engine " in one for one in record.rest))
            # What it holds is all that was planted: its numbers are those of the file.
            right = True if fault.named else None
            return replace(fault, diagnosed=size, right_value=right, answer=record.rest[0], seconds=time.perf_counter() - started)
        named = [match for sentence in record.rest if (match := _NAMED.fullmatch(sentence))]
        places = [match["name"] == suspect.name for match in named]
        planted = float(suspect.number) + size * suspect.scale
        return replace(
            fault,
            diagnosed=size,
            named=places[:1] == [True],
            in_class=any(places),
            explained=bool(named),
            right_value=_is_right(named[0], planted) if places[:1] == [True] else None,
            answer=record.rest[0],
            seconds=time.perf_counter() - started,
        )


def _engine_of(model_format: str) -> str:
    """The engine beside the harness that is asked with most on; raises InvalidRequest where none is asked with dry friction."""
    own = [one for one in engines_of_files().values() if model_format in one.formats and FRICTION not in one.why_off]
    beside = [one for one in own if installed_version(one) is not None]
    if not beside:
        raise InvalidRequest(f"no engine that is asked with dry friction is installed: {', '.join(one.title for one in own)}; install one")
    return min(beside, key=lambda one: len(one.why_off)).name


def _is_right(named: re.Match[str], planted: float) -> bool:
    """True where a diagnosis gives the number that was planted, or what moves accelerations no more than rounding does."""
    return float(named["left"]) <= RIGHT_ROUNDOFFS or abs(float(named["value"]) - planted) <= RIGHT_VALUE * abs(planted)


def file_campaign(library: Library, settings: CampaignSettings) -> FaultStudy:
    """The faults of all files of a library; rows are ``Fault``, kinds the attributes of the numbers. Without ``sizes`` they are two."""
    models = [(name, model_format) for name in library.system_names() for model_format in library.formats_of(name)]
    return FaultStudy(library, models, {}, ("system", "format", "kind"), run_file_campaign, [settings])


def run_file_campaign(_library: Library, name: str, _format: str, settings: CampaignSettings, note: Callable[[str], None]) -> list[Fault]:
    """Every fault of one file, as a task for ``harness.workers``."""
    return list(FileCampaign(Path(name), settings).faults(note))


@contextmanager
def _copied(path: Path) -> Iterator[Path]:
    """A copy of a file to write to, beside all that lies beside the file and that it may include."""
    with tempfile.TemporaryDirectory() as folder:
        for other in path.resolve().parent.iterdir():
            if other.name != path.name:
                (Path(folder) / other.name).symlink_to(other)
        yield Path(folder) / path.name
