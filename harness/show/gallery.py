"""One picture of each system, for the report."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

from harness.engines import EQUATIONS, Subject, is_native, load_model, subjects_beside
from harness.files.model_file import read_model
from harness.lagrange.derivation import load_mechanism
from harness.library import Library
from harness.results.cross_check import CrossCheckResult, Picture
from harness.show.picture import draw
from harness.show.placement import choose_view, place
from harness.show.robots import draw_robot
from harness.study import Inquiry, Study, ask


class Gallery(Study):
    """The pictures of systems and robots; a ``harness.study.Study``. A system that no engine can place has none.

    ``crashes`` are those of the cross-check, as ``CrossCheck`` has them: what died or hung there would again.
    """

    title = "pictures"

    def __init__(
        self, library: Library, names: Sequence[str], crashes: Collection[tuple[str, str | None]] = (), robots: Sequence[Path] = ()
    ) -> None:
        super().__init__(CrossCheckResult())
        native = [subject for subject in subjects_beside(library) if subject.format != EQUATIONS and is_native(library, subject)]
        # A variant looks like its system.
        plain = [name for name in names if not library.is_variant(name)]
        sound = {
            name: [own for own in native if not any((name, what) in crashes for what in (str(own), own.format, None))] for name in plain
        }
        self._library, self._sound = library, {name: subjects for name, subjects in sound.items() if subjects}
        self._robots = robots
        self.steps = len(self._sound) + len(robots)

    def inquiries(self) -> Iterator[Iterable[Inquiry[None]]]:
        drawn = [self._drawn(name, draw_system, self._library, name, subjects) for name, subjects in self._sound.items()]
        yield [*drawn, *(self._drawn(str(path), draw_robot, path) for path in self._robots)]

    def _drawn(self, name: str, *asked: Any) -> Inquiry[None]:
        outcome = yield from ask(*asked, affinity=name)
        # Why a system or a model cannot be used is in the records.
        yield self.kept(name, CrossCheckResult(pictures=[Picture(system=name, svg=outcome.value)] if outcome.value else []))


def draw_system(library: Library, name: str, asked: Sequence[Subject], note: Callable[[str], None]) -> str:
    """A system moved a little from its zero configuration, over its shadow there, by the first subject that can place it; "" for none."""
    mechanism = load_mechanism(library, name)
    for subject in asked:
        note(str(subject))
        try:
            model = read_model(library.model_path(name, subject.format), subject.format)
            placements = place(load_model(library, subject, mechanism, model), mechanism)
        except Exception:
            # The records say why; another engine may do.
            continue
        if placements is not None:
            resting, moved = placements
            return draw(moved, [resting], choose_view(placements), mechanism.gravity, ghost=resting)
    return ""
