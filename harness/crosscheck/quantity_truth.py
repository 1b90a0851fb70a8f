"""The truth that the readers of a mechanism's files are held against in a quantity beyond accelerations."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from harness.certify.quantities import Quantity, Question, Truth
from harness.crosscheck.tasks import Assignment, frame_of
from harness.crosscheck.truth import softened, softness_of
from harness.engines import ConstraintLaw, NotOffered, constraint_laws, load_engine, step_rules
from harness.engines.audit import require_constraints
from harness.equations.mechanism import Mechanism
from harness.library import MODEL_SUFFIXES, Library
from harness.models.model_file import ModelFile, read_model
from harness.storage import Kept


def truth_of(quantity: Quantity, system: str, assignment: Assignment, declared: ModelFile | None = None) -> Truth:
    """The truth for the readers of the subject's file, made once per process; equations have the coordinates of the declared file.

    ``declared`` has its numbers, by default ``declared_model``.

    Raises:
        InvalidModel: constraints of a file cannot be held against the mechanism's. NotOffered: there is no truth.
    """
    mechanism, in_body, softening = assignment.mechanism, frame_of(assignment), None
    if assignment.library.is_of_robots:
        return _TRUTHS.get((quantity.name, mechanism.key, in_body), lambda: quantity.truth(Question(mechanism, None, None, in_body)))
    declared = declared or declared_model(assignment.library, system)
    read = declared if assignment.model is None else assignment.model
    engine = load_engine(assignment.library, assignment.subject.engine)
    rules = step_rules(engine, read) if quantity.is_of_engine else ()
    laws: Mapping[str, ConstraintLaw] = {}
    if mechanism.constraints is not None:
        require_constraints(declared, mechanism)
        require_constraints(read, mechanism)
        laws = constraint_laws(engine, read) if quantity.is_of_engine else {}
        softening = _softening(laws, read) if laws else None
    key = quantity.name, mechanism.key, declared.text, read.text, in_body, tuple(laws.items()), rules
    return _TRUTHS.get(key, lambda: quantity.truth(Question(mechanism, declared, read, in_body, softening, rules)))


def _softening(laws: Mapping[str, ConstraintLaw], read: ModelFile) -> Callable[[Mechanism], Mechanism]:
    """What an engine makes of constraints that are held rigid, by its laws of the file that it reads."""

    def softening(mechanism: Mechanism) -> Mechanism:
        assert mechanism.constraints is not None
        return softened(mechanism, softness_of(mechanism.constraints, laws, read))

    return softening


def declared_model(library: Library, system: str) -> ModelFile:
    """The model file whose numbers are the truth: the library's own, whatever stands in for it.

    Raises:
        InvalidModel: it is invalid. NotOffered: the system has none.
    """
    for model_format in MODEL_SUFFIXES:
        if library.has_model(system, model_format):
            return read_model(library.validated_models(system)[model_format], model_format)
    raise NotOffered(f"{system} has no model file")


_TRUTHS: Kept[Truth] = Kept(64)
