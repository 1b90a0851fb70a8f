"""One subject along one family of hard points in another quantity than accelerations, at the same states.

The truth at a point is that of the numbers which one of the case's model files has there; where these are not what the energies say,
as where a file must hold an inertia that its mechanism has not, the point is ``undecided``. What an engine does not offer has no row.
"""

from __future__ import annotations

import json
import time
from dataclasses import replace

from harness.certify.compare import compare, farthest_block
from harness.crosscheck.assignment import Assignment, truth_of
from harness.crosscheck.tasks import Note
from harness.engines import NotOffered, Subject, Unsupported, load_engine
from harness.equations.derivation import load_mechanism
from harness.equations.mechanism import Mechanism
from harness.errors import InvalidModel
from harness.hard.cases import HardCase, hard_cases, library_of
from harness.hard.measurement import judged_point, measured_row
from harness.hard.truths import model_file, states_at
from harness.library import MODEL_SUFFIXES, Library
from harness.models.model_file import ModelFile
from harness.results.atlas import HardPoint, HardRow
from harness.verdict import Verdict


def measure_quantity(case_name: str, subject: Subject, quantity: str, engines: Library, note: Note) -> HardRow:
    """The row of a quantity; ``engines`` is the library whose engines are meant.

    Raises:
        harness.engines.NotOffered: the engine does not offer the quantity, or the case's mechanism has nothing of the kind.
    """
    started = time.perf_counter()
    case, points = hard_cases()[case_name], []
    for place, value in enumerate(case.values):
        note(json.dumps({"knob": value, "system": case.system_at(value)}))
        points.append(_point_of(case, value, place, subject, quantity, engines))
    row = measured_row(case, subject, points, started)
    # What theory expects of a case is about accelerations.
    return replace(row, theory_verdict=Verdict.AGREES.value, theory_growth=None, theory_digits_growth=None)


def _point_of(case: HardCase, value: float, place: int, subject: Subject, quantity: str, engines: Library) -> HardPoint:
    written = load_mechanism(library_of(case), case.system_at(value))
    mechanism, states = case.mechanism_at(written, value), states_at(case, written, value, place)
    about = HardPoint(knob=value, system=mechanism.name, verdict=Verdict.UNDECIDED.value, states=len(states))
    try:
        read, declared = (_file(case, written, value, one) for one in (subject.format, None))
    except InvalidModel as error:
        # The case itself is wrong where its model is not physical.
        return replace(about, verdict=Verdict.ERROR.value, reason=str(error))
    if declared is None:
        raise NotOffered(f"{mechanism.name} has no model file")
    engine = load_engine(engines, subject.engine)
    try:
        loaded = engine.load(mechanism if read is None else read, mechanism.joints, mechanism.gravity)
    except (ValueError, Unsupported) as error:
        return replace(about, verdict=Verdict.UNSUPPORTED.value, reason=f"{subject.engine} refuses the model: {error}")
    if case.configured is not None:
        loaded = case.configured(loaded, value)
    assignment = Assignment(engines, subject, mechanism, read, quantity=quantity)
    try:
        truth = truth_of(assignment, declared)
        certified = truth.evaluate(states)
    except InvalidModel as error:
        return replace(about, reason=str(error))
    about = replace(about, certified=int(certified.certified.sum()), bits=int(certified.bits.max(initial=0)), in_balls=len(states))
    if about.certified < about.states:
        about = replace(about, reason=f"the {quantity} of {about.states - about.certified} states is not certified")
    try:
        answers = truth.answers(loaded, states)
    except NotOffered:
        raise
    except Exception as error:
        return replace(about, verdict=Verdict.ERROR.value, reason=f"{type(error).__name__}: {error}")
    found = judged_point(about, states, compare(certified, answers))
    if found.verdict != Verdict.DISAGREES:
        return found
    remark = f"farthest off is the {truth.blocks[farthest_block(certified, answers)]}"
    return replace(found, reason="; ".join(filter(None, [found.reason, remark])))


def _file(case: HardCase, mechanism: Mechanism, value: float, model_format: str | None) -> ModelFile | None:
    """The model at one point in a format, by default in the first one that the system has; None for equations."""
    if model_format is None:
        formats = [one for one in MODEL_SUFFIXES if library_of(case).has_model(mechanism.name, one)]
        if not formats:
            return None
        model_format = formats[0]
    model = model_file(case.name, mechanism.name, model_format)
    return None if model is None else case.model_at(model, mechanism, value)
