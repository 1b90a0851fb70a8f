"""The choice that a cross-check makes of a library: systems, subjects, states, and what each subject is asked with."""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Iterator, Sequence

from harness.crosscheck.assignment import Assignment, why_left_out
from harness.crosscheck.expected import Expectations
from harness.crosscheck.judgement import Pair, Pairs, SystemProgress
from harness.crosscheck.settings import Settings, stored_states
from harness.engines import Subject, Unsupported, engine_files, is_native, load_model
from harness.errors import InvalidModel, InvalidRequest, not_installed
from harness.lagrange.derivation import load_mechanism
from harness.library import MODEL_SUFFIXES, Library, orphaned_models
from harness.programs.mechanisms.mechanism import Mechanism, controls_of
from harness.programs.states import States
from harness.truth.sampling import keep_points, sample_in_blocks

LONGEST_FOLDER = 100


def derive_and_sample(library: Library, name: str, states: int, seed: int) -> Mechanism:
    """The mechanism of system ``name``; the points of its sample are in the cache afterwards."""
    mechanism = load_mechanism(library, name)
    keep_points(mechanism, states, seed)
    return mechanism


def accept(assignments: Sequence[Assignment]) -> None:
    """Let every subject's engine read its model.

    Raises:
        InvalidModel: one refuses it. What the model is held against comes later.
    """
    for assignment in assignments:
        with contextlib.suppress(Unsupported):
            load_model(assignment.library, assignment.subject, assignment.mechanism, assignment.model)


def orphans(library: Library) -> Iterator[InvalidModel]:
    """A problem for each model file that no system stands behind."""
    for path in orphaned_models(library):
        yield InvalidModel(path, None, f"has no system; expected systems/{library.system_of(path.stem)}.py beside it")


def library_folder(library: Library) -> str:
    """The name of a folder for what is kept of a library; all names of many files are longer than a file system takes."""
    return library.name if len(library.name) <= LONGEST_FOLDER else library.systems.resolve().name or "files"


def chosen_names(settings: Settings) -> list[str]:
    """The systems and variants of a choice.

    Raises:
        InvalidRequest: a name that nothing has, or a stand-in or a state that does not belong to exactly one system with models.
    """
    names = settings.library.select(settings.names, with_variants=True)
    if settings.stand_ins and len(names) != 1:
        raise InvalidRequest("--mjcf and --urdf stand in for one system's models; name exactly one system")
    if settings.stand_ins and not settings.library.validated_models(names[0]):
        raise InvalidRequest(f"nothing stands in for {names[0]}, which is the truth here; {settings.held_against(names[0])}")
    if others := [one for one in settings.stand_ins if one not in MODEL_SUFFIXES]:
        raise InvalidRequest(f"no mechanism has a model in {others[0]}; --{others[0]} is for a robot's file, as harness compare is")
    if settings.state is not None and len(names) != 1:
        raise InvalidRequest("--state belongs to one system; name exactly one system")
    return names


def why_no_model(settings: Settings, expectations: Expectations, name: str, subject: Subject) -> str:
    """The reason of the entry that excuses a missing model; a stand-in is a model."""
    return "" if subject.format in settings.stand_ins else expectations.why_no_model(settings.library, name, subject)


def assign(settings: Settings, expectations: Expectations, system: SystemProgress, mechanism: Mechanism, pair: Pair) -> None:
    """Give a pair what it is asked with, or the reason why it cannot be asked."""
    file = engine_files(settings.library)[pair.subject.engine]
    model = system.models.get(pair.subject.format)
    if reason := why_no_model(settings, expectations, system.name, pair.subject):
        pair.fail(reason, unsupported=True)
    elif isinstance(model, str):
        pair.fail(model, refused=True)
    elif file.version is None:
        pair.fail(not_installed(file.requires[1]), unsupported=True)
    elif file.elsewhere and (reason := file.too_old(file.version, pair.subject.format)):
        pair.fail(reason, unsupported=True)
    else:
        pair.assignment = Assignment(settings.library, pair.subject, mechanism, model, system.name).about(pair.quantity)


def batches_of(settings: Settings, system: SystemProgress, mechanism: Mechanism, sampled: int) -> Iterator[States]:
    """The states of a system, of which so many are sampled, batch by batch; what is stored stands before the first block of the sample.

    Raises:
        InvalidRequest: the one state to compare at is not of the mechanism's sizes. InvalidInput: as ``stored_states``.
    """
    state = settings.state
    if state is not None:
        if (state.q.shape[1], state.v.shape[1]) != (mechanism.nq, mechanism.nv):
            given = f"{state.q.shape[1]} numbers for q and {state.v.shape[1]} for v and tau"
            raise InvalidRequest(f"--state has {given}; {mechanism.name} has {mechanism.nq} and {mechanism.nv} degrees of freedom")
        acting = controls_of(mechanism)
        for name, driving in (("control", state.control), ("activation", state.activation)):
            if driving.shape[1] not in (0, acting):
                found = f"--state has {driving.shape[1]} numbers for {name}"
                raise InvalidRequest(f"{found}; {mechanism.name} has {acting} actuators up to the last that is read, a number for each")
        return iter([state])
    sample = sample_in_blocks(mechanism, sampled, settings.seed)
    stored = stored_states(settings.library, mechanism)
    if stored is None:
        return sample
    for pair in system.pairs.values():
        pair.stored = len(stored)
    return itertools.chain([States.concatenate([stored, next(sample)])], sample)


def is_beside(library: Library, pair: Pair) -> bool:
    """True for a subject whose engine is installed beside the harness, and is no version in an environment of its own."""
    return not engine_files(library)[pair.subject.engine].elsewhere


def readers_among(library: Library, pairs: Pairs) -> list[Pair]:
    """The pairs, each subject once, whose models say after loading what they hold.

    What other versions read otherwise, and optional engines, is told by ``harness upgrade`` and by their answers.
    """
    by_subject = {pair.subject: pair for pair in pairs if pair.assignment is not None and pair.assignment.model is not None}
    return [pair for pair in by_subject.values() if is_beside(library, pair)]


def natives_among(library: Library, pairs: Pairs) -> list[Pair]:
    """The readers whose accelerations tell what their file needs; other versions may feel less, and tell nothing of the file.

    So do those that apply none of its actuators, dry friction or limits.
    """
    native = (pair for pair in readers_among(library, pairs) if is_native(library, pair.subject))
    return [pair for pair in native if pair.assignment is not None and not why_left_out(pair.assignment)]


def led_together(library: Library, pairs: Pairs) -> list[list[Pair]]:
    """The subjects of each search: the harness's own engines together, and each alone that has an environment or is a library's.

    A search goes on where any of its subjects does badly. So the environments of a machine, and what a library's engines answer, change no
    states of the others.
    """
    alone = [not (is_beside(library, pair) and engine_files(library)[pair.subject.engine].is_own) for pair in pairs]
    together = [pair for pair, is_alone in zip(pairs, alone, strict=True) if not is_alone]
    return [*([together] if together else []), *([pair] for pair, is_alone in zip(pairs, alone, strict=True) if is_alone)]
