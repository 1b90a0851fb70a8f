"""What a cross-check holds of a system and of each subject on it while it is compared."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from harness.crosscheck.assignment import Assignment
from harness.crosscheck.judgement import Evidence
from harness.engines import Subject
from harness.files.model_file import ModelFile
from harness.programs.mechanisms.mechanism import Mechanism
from harness.results.records import ACCELERATIONS, quantity_words


@dataclass(kw_only=True)
class Pair(Evidence):
    """A subject on a system while its answers come in.

    Attributes:
        quantity: what it is asked for.
        componentwise: the componentwise backward error at the worst state; None where it was not measured.
    """

    subject: Subject
    quantity: str = ACCELERATIONS
    assignment: Assignment | None = None
    componentwise: float | None = None

    @property
    def key(self) -> str:
        """Its name among the pairs of its system."""
        return " ".join([str(self.subject), *quantity_words(self.quantity)])

    def fail(self, failure: str, unsupported: bool = False, refused: bool = False) -> None:
        """The first failure is the one that is reported."""
        if not self.failure:
            self.failure, self.unsupported, self.refused = failure, unsupported, refused


Pairs = Sequence[Pair]


def answering(pairs: Iterable[Pair]) -> list[Pair]:
    """The pairs that can be asked and have not failed."""
    return [pair for pair in pairs if pair.assignment is not None and not pair.failure]


@dataclass
class System:
    """A system, or a variant of its models, while it is compared.

    Attributes:
        models: by format, those that a subject reads; why not, where one cannot be used.
        seconds: per certified state of each batch. compilation_seconds: of the certified kernel; None before the first batch.
    """

    name: str
    pairs: dict[str, Pair]
    mechanism: Mechanism | None = None
    models: dict[str, ModelFile | str] = field(default_factory=dict)
    seconds: list[float] = field(default_factory=list)
    compilation_seconds: float | None = None

    def fail(self, failure: str) -> None:
        """Nothing of it can be asked, for a file cannot be used."""
        for pair in self.pairs.values():
            pair.fail(failure, refused=True)
