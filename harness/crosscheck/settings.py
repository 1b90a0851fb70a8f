"""The choice of a cross-check, and the commands that repeat it."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from harness.equations.states import States
from harness.library import Library

DEFAULT_STATES = 1000
# States of a run that hypothesis chooses; the rest is sampled in bulk.
MOST_SEARCHED = 500


@dataclass(frozen=True, kw_only=True)
class Settings:
    """A choice of comparisons.

    Attributes:
        library: where systems and models are.
        names: systems; all for none.
        subjects: subjects as text; all for none.
        states: states per system; half of them, at most ``MOST_SEARCHED``, is searched for by
            hypothesis, the rest sampled. The hard states stored with a system come on top.
        seed: of both.
        stand_ins: model format to a file that stands in for the one system's own.
        state: the one state to compare at instead of sampling, for replays.
        examples: folder of hypothesis' example database; None for none.
        replay_options: command-line options that say where library and stand-ins are, for replay commands.
    """

    library: Library
    names: Sequence[str] = ()
    subjects: Sequence[str] = ()
    states: int = DEFAULT_STATES
    seed: int = 0
    stand_ins: Mapping[str, Path] = field(default_factory=dict)
    state: States | None = None
    examples: Path | None = Path(".hypothesis/harness")
    replay_options: Sequence[str] = ()

    def diagnosis(self, name: str) -> str:
        """The command that says all there is to say of why ``name``, or another system, is not as expected."""
        chosen = [("--states", self.states, DEFAULT_STATES), ("--seed", self.seed, 0)]
        options = [str(word) for option, value, default in chosen if value != default for word in (option, value)]
        return shlex.join(["harness", "diagnose", name, *self.replay_options, *options])

    @property
    def searched(self) -> int:
        return 0 if self.state is not None else min(self.states // 2, MOST_SEARCHED)
