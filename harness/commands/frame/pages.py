"""Output of a command: sections with their page, and the report from the history in its folder."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

from harness.commands.frame.terminal import print_sections, say
from harness.results.detail import Detail
from harness.storage import write_atomically

if TYPE_CHECKING:
    from harness.commands.frame.bracket import Bracket
    from harness.report import Survey
    from harness.report.comparison import Section
    from harness.results.history import History
    from harness.results.run import Run
    from harness.study import Study


def tell(
    bracket: Bracket,
    study: Study,
    told: Callable[[Any, Detail], Iterable[Section]],
    summary: Callable[[Any], str] | None = None,
    html_path: str | None = None,
    title: str = "",
) -> Any:
    """Run a study of files or motions that has begun: progress, JSON, its result on standard output, and the page of all that is known.

    ``told`` are the sections of a result, as much as a ``Detail`` asks for; ``summary``, the answer in a sentence, stands in the JSON.
    """

    def document() -> dict[str, Any]:
        found = study.result()
        return {**({"summary": summary(found)} if summary else {}), **vars(found)}

    found = bracket.complete(study, document)
    print_sections(told(found, bracket.detail))
    if html_path is not None:
        from harness.report.comparison import render

        leave_page(html_path, render(bracket.run, title, told(found, Detail.VERBOSE)))
    return found


def leave_page(path: str, text: str) -> None:
    """Write one offline page to a file, and say so."""
    write_atomically(path, text)
    say("", f"page: {path}")


def write_page(bracket: Bracket, number: int | None = None) -> None:
    """Write the report of a run, by default the latest of the library, with the latest benchmark, atlas and survey of that library.

    Without a run, the pages hold the others alone; without any of them, none is written.
    """
    from harness.report import build, write
    from harness.results.atlas import Atlas
    from harness.results.benchmark import Benchmark
    from harness.results.cross_check import CrossCheckResult
    from harness.results.trend import MOST_NIGHTS

    history, library = bracket.history, bracket.library.name
    benchmark, atlas = history.latest(Benchmark, library), history.latest(Atlas, library)
    benchmarks = itertools.islice(history.recent(Benchmark, library, benchmark[0].profile), MOST_NIGHTS) if benchmark else ()
    runs = history.studies(CrossCheckResult, library)
    if number is None:
        number = next((one for one in runs if history.read(one, CrossCheckResult, "records").records), None)
    given: dict[str, Any] = {"benchmarks": list(benchmarks), "atlas": atlas, "robots": _survey(history, library)}
    if number is not None:
        given["robots"] = given["robots"] or _robots(history, number, runs[number])
        earlier = itertools.islice(history.earlier(number, CrossCheckResult, "records"), MOST_NIGHTS - 1)
        records = [(run, found.records) for run, found in earlier]
        given |= {"run": runs[number], "found": history.read(number, CrossCheckResult), "history": records}
    if any(given.values()):
        write(bracket.directory, build(**given))
        say(f"report: {bracket.directory / 'index.html'}")


def _robots(history: History, number: int, run: Run) -> Survey | None:
    """The robots of the library, of which the run of a report asked beside its mechanisms; None where it did not."""
    from harness.report import Survey
    from harness.results.comparison import FilesComparison

    found = history.read(number, FilesComparison)
    return Survey(run, found.in_order()) if found.files else None


def _survey(history: History, library: str) -> Survey | None:
    """The latest survey of the library, with the earlier ones of the same places; None without any."""
    from harness.report import Survey
    from harness.report.survey import MOST_SURVEYS
    from harness.results.comparison import FilesComparison

    if (latest := history.latest(FilesComparison, library)) is None:
        return None
    run, found = latest
    alike = FilesComparison, library, run.profile
    before = next(itertools.islice(history.recent(*alike), 1, 2), None)
    earlier = [one for _, one in itertools.islice(history.recent(*alike, "subjects"), 1, MOST_SURVEYS)]
    return Survey(run, found.in_order(), before, earlier[::-1])
