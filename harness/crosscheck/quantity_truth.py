"""The truth that the readers of a mechanism's files are held against in a quantity beyond accelerations."""

from __future__ import annotations

from harness.certify.quantities import Quantity, Question, Truth
from harness.crosscheck.tasks import Assignment, frame_of
from harness.engines import NotOffered
from harness.library import MODEL_SUFFIXES, Library
from harness.models.model_file import ModelFile, read_model
from harness.storage import Kept


def truth_of(quantity: Quantity, system: str, assignment: Assignment, read: ModelFile) -> Truth:
    """The truth for the readers of one file, made once per process."""
    declared = declared_model(assignment.library, system)
    key = quantity.name, assignment.mechanism.key, declared.text, read.text, frame_of(assignment)
    return _TRUTHS.get(key, lambda: quantity.truth(Question(assignment.mechanism, declared, read, frame_of(assignment))))


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
