"""Parts of a model file that its scene does not need, found by taking parts away and watching accelerations.

A number must be felt: lowered by a thousandth it moves some joint's acceleration, or its reader does not
accept it lower. What is zero or at its default is left out where the reader allows that; so are elements
whose absence nothing feels, and stages of the engine's pipeline that change nothing. Components of a
joint's axis, and of the axes that turn a frame, are the mechanism's structure and stay.
"""

from __future__ import annotations

import contextlib
import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import msgspec

from harness.engines import Engine, Subject, engine_paths, installed_version, load_engine, runs_elsewhere
from harness.files.model_file import ModelFile
from harness.library import Library
from harness.programs.mechanisms.mechanism import Mechanism
from harness.programs.states import States
from harness.results.cross_check import SuperfluousPart
from harness.storage import cache_directory, read_entry, sources_digest, write_entry
from harness.truth.sampling import random_sample
from harness.verdict import Verdict

if TYPE_CHECKING:
    from harness.crosscheck.assignment import Assignment
    from harness.crosscheck.examination import NotNeeded

# As few as feel everything, for a long chain is asked a thousand times.
STATES, SEED = 8, 7
# Of a mechanism with actuators, of whose ranges few states feel each end.
_DRIVEN_STATES = 64
# Changed models times states they are asked at. Most numbers are felt at the first state, so that a chain of sixty links takes 2000.
MOST_EVALUATIONS = 4000
# What ``SuperfluousPart`` says beside mechanism, subject and file.
_Row = tuple[int, str, str, str, str]


def find_superfluous(assignment: Assignment) -> list[SuperfluousPart]:
    """``superfluous`` parts of the subject's model; none where its answers are wrong as it is."""

    def is_sound() -> bool:
        verdicts = assignment.judge(_states_of(assignment)).verdicts
        return not {Verdict.DISAGREES.value, Verdict.ERROR.value} & set(verdicts)

    return superfluous(assignment, is_sound)


def superfluous(assignment: Assignment, is_sound: Callable[[], bool] = lambda: True) -> list[SuperfluousPart]:
    """Parts of the model that the subject does not feel, in the order of its lines.

    The result is kept on disk. Where nothing is kept, ``is_sound`` is asked first whether the subject is right about the
    model as it is: if not, that comes first.

    Raises:
        ValueError: the engine refuses the model.
    """
    library, subject, mechanism, model = assignment.library, assignment.subject, assignment.mechanism, assignment.model
    assert model is not None
    entry = _entry(library, subject, model, mechanism)
    parts: list[_Row] | None = None
    with contextlib.suppress(msgspec.DecodeError):
        parts = msgspec.json.decode(read_entry(entry) or "", type=list[_Row])
    if parts is None:
        if not is_sound():
            return []
        parts = sorted(_not_needed(assignment, model))
        write_entry(entry, msgspec.json.encode(parts).decode())
    return [SuperfluousPart(mechanism.name, str(subject), str(model.path), *part) for part in parts]


def _not_needed(assignment: Assignment, model: ModelFile) -> list[_Row]:
    # Most of the time all is kept.
    from harness.crosscheck.examination import examine, is_needed

    engine, others = load_engine(assignment.library, assignment.subject.engine), _other_readers(assignment.subject)
    about, kept = (model, assignment.mechanism, _states_of(assignment)), set[int]()
    while True:
        found: list[NotNeeded] = engine.run(examine, *about, MOST_EVALUATIONS, kept)
        # What only holds others may make another mechanism for another reader of the file, and is examined again with what it holds.
        needed = {one.start for one in found if one.plain and any(other.run(is_needed, *about, one.plain) for other in others)}
        if not needed:
            return [one.row for one in found]
        kept |= needed


def _states_of(assignment: Assignment) -> States:
    """The states at which parts are looked for; those of a declared truth are off the manifold, on which its numbers are not felt."""
    count = STATES if assignment.mechanism.driving is None else _DRIVEN_STATES
    return assignment.truth.asked_at(random_sample(assignment.mechanism, count, SEED), share=1.0)


def _entry(library: Library, subject: Subject, model: ModelFile, mechanism: Mechanism) -> Path:
    engine_file = engine_paths(library)[subject.engine]
    ranges = mechanism.position_ranges, mechanism.rate_ranges, mechanism.force_ranges
    identity = [repr(mechanism.key), repr(ranges), str(subject), str(installed_version(load_engine(library, subject.engine))), model.text]
    digest = hashlib.sha256("\0".join(identity).encode())
    digest.update(sources_digest("files", "engines", "programs", "lagrange", "trees", "truth", "crosscheck"))
    digest.update(hashlib.sha256(engine_file.read_bytes()).digest())
    return cache_directory() / "superfluous" / f"{digest.hexdigest()[:40]}.json"


def _other_readers(subject: Subject) -> list[Engine]:
    """The harness's other engines that read the subject's format and are installed: those of a library change no other's record."""
    library = Library.built_in()
    names = [name for name in engine_paths(library) if name != subject.engine]
    engines = [engine for name in names if subject.format in (engine := load_engine(library, name)).formats]
    return [engine for engine in engines if not runs_elsewhere(engine) and installed_version(engine) is not None]
