"""The bracket around every command: its options, its run, worker processes, progress, JSON, and exit status."""

from __future__ import annotations

import contextlib
import functools
import json
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from harness.commands.frame import options
from harness.commands.frame.terminal import progress, say
from harness.errors import InvalidInput, InvalidRequest, Terminated
from harness.results.detail import Detail

if TYPE_CHECKING:
    from harness.library import Library
    from harness.results.history import History
    from harness.results.plain_json import JsonDocument
    from harness.results.records import Record
    from harness.results.run import Run, StudyResult
    from harness.study import Study
    from harness.workers import Scheduler, SchedulerLost, Workers


STANDARD_OUTPUT = "-"
# So many times over the text of all parts is written while they come; after each part it would be as many times as there are parts.
_JSON_WRITTEN_BY = 20


@dataclass(frozen=True)
class CutShort:
    """The end of a study before its last part: the loss of a scheduler, or a signal.

    Attributes:
        why: a clause, as in "interrupted". status: the command's exit status. signal: what was raised, if a signal it was.
    """

    why: str
    status: int
    signal: BaseException | None = None


@dataclass(kw_only=True)
class Bracket:
    """The first argument of a command.

    Attributes:
        library_path, floating_base, aided, seed, json_path, workers, memory_limit, scheduler, time_limit, directory, detail: the options,
            as far as a command has them.
        named_subjects: those of the command's options; other engine files of the library are not run.
        run: what the command is; set by ``begin``. number: of the run in the history, None where it is not kept.
        cut_short: what ended a study before its last part, after which none goes on; what was answered is told and written.
    """

    library_path: str | None = None
    floating_base: bool = False
    aided: bool = False
    seed: int = 0
    json_path: str | None = None
    workers: int | None = None
    memory_limit: int | None = None
    scheduler: Scheduler | None = None
    time_limit: float | None = None
    directory: Path = Path("reports")
    detail: Detail = Detail.BRIEF
    named_subjects: Sequence[str] = field(default=(), init=False)
    _exit: contextlib.ExitStack = field(default_factory=contextlib.ExitStack)
    number: int | None = None
    cut_short: CutShort | None = None
    run: Run = field(init=False)
    _document: str = ""

    @cached_property
    def library(self) -> Library:
        """The library asked for, with its engines described by worker processes of their own.

        Raises:
            InvalidInput: there is no such library.
        """
        from harness.library import Library

        library = Library.at(self.library_path)
        self.describe_engines(library)
        return library

    def describe_engines(self, library: Library | None = None) -> None:
        """Find the engines of a library, by default of this one, and their environments, as they are now."""
        from harness.engines import LOADING_SECONDS, describe_engines
        from harness.workers import Workers

        # Made only where a library has engine files of its own.
        def made() -> Workers:
            return Workers(self.workers, self.scheduler, self.time_limit or LOADING_SECONDS, self.memory_limit)

        describe_engines(library or self.library, made, self.named_subjects)

    @property
    def replay_options(self) -> list[str]:
        """The options of a command that repeats a part of this one."""
        floating = ["--floating-base"] * self.floating_base + ["--aided"] * self.aided + ["--contacts"] * self.library.touches
        return ["--library", self.library_path, *floating] if self.library_path else floating

    def choose_library(self, names: Sequence[str], anywhere: bool = False, acts: bool = False, touches: bool = False) -> None:
        """Make robots' files the library from here on, where ``names`` are theirs; the others as of ``RobotLibrary`` and ``Library``.

        Raises:
            InvalidInput: a file cannot be read, or is no robot.
            InvalidRequest: some names are of files and others are not.
        """
        from harness.library import is_file

        if self.floating_base or self.aided or touches or any(is_file(self.library, name) for name in names):
            # Imported late: a run that is about mechanisms needs nothing of it.
            from harness.comparison.robot_library import resolved

            self.library = resolved(self.library, names, self.floating_base, self.aided, anywhere, acts=acts, touches=touches)

    def begin(self, states: int, profile: str, kept_as: type[StudyResult] | None = None) -> Run:
        """Describe the run that starts now; with ``kept_as`` its parts go into the history."""
        from harness.crosscheck.settings import describe_run

        workers = "of a cluster" if self.scheduler else str(self.workers or os.cpu_count())
        self.run = describe_run(self.library, states, self.seed, profile, ["harness", *sys.argv[1:]], workers)
        if kept_as is not None:
            self.number = self.history.begin(self.run, kept_as)
        return self.run

    @cached_property
    def pool(self) -> Workers:
        """The worker processes, from the first use to the end of the command or the loss of the scheduler.

        Raises:
            InvalidRequest: the cluster cannot be reached.
            KeyboardInterrupt, SystemExit: such a signal has cut a study short, and nothing further is asked.
        """
        assert self.time_limit is not None, "a command with workers has a time limit"
        if self.cut_short is not None and self.cut_short.signal is not None:
            raise self.cut_short.signal
        return self._exit.enter_context(self.pool_for(self.time_limit))

    def pool_for(self, time_limit: float, on_this_machine: bool = False) -> Workers:
        """Worker processes whose context the caller enters, which raises as ``pool``; a task may take ``time_limit`` [s]."""
        from harness.programs.machine_code import replace_damaged
        from harness.workers import Workers

        scheduler = None if on_this_machine or self.cut_short is not None else self.scheduler
        # Where heyoka is loaded, it has the cache open.
        if scheduler is None and "heyoka" not in sys.modules and (damaged := replace_damaged()):
            say(f"harness: {damaged}", err=True)
        return Workers(self.workers, scheduler, time_limit, self.memory_limit)

    @cached_property
    def history(self) -> History:
        """The history in the folder of the report, which is made where it is missing.

        Raises:
            InvalidInput: folder or history cannot be written.
        """
        from harness.results.history import History

        return self._exit.enter_context(History(self.directory / "history.sqlite"))

    def complete(self, study: Study, document: Callable[[], Mapping[str, Any]] | None = None, kept: bool = True) -> Any:
        """Run a study to the end and return its result: progress, each part into the history, and the JSON file beside it.

        A lost scheduler ends it before, and so does a signal once a part is complete.

        ``document`` gives the parts of the JSON file, which is written when a twentieth of the parts is new and when the study ends,
        in whatever way: each part while they are few, and of a thousand of them the last fifty may be missing after a kill.
        ``kept`` is False for a study whose parts are no part of the run's.
        """
        from harness.study import run_study
        from harness.workers import SchedulerLost

        if self.cut_short is not None:
            return study.result()
        parts = unwritten = 0
        try:
            with progress(study.steps, study.title, under_way=lambda: self.pool.under_way) as advance:
                for part in run_study(study, self.pool):
                    if kept:
                        self.keep(part.value)
                    parts, unwritten = parts + 1, unwritten + 1
                    if document is not None and unwritten * _JSON_WRITTEN_BY >= parts:
                        self.write_json(**document())
                        unwritten = 0
                    advance(part.label)
        except (SchedulerLost, KeyboardInterrupt, Terminated) as cause:
            if not parts and not isinstance(cause, SchedulerLost):
                raise
            # There may be more of them than was known before.
            so_far = f"{parts} of {study.steps}" if parts < study.steps else f"{parts}"
            cut_short(self, cause, f"{so_far} parts of the {study.title} were complete, and what follows is of those")
        finally:
            if document is not None and (unwritten or self.cut_short is not None):
                self.write_json(**document())
        return study.result()

    def keep(self, found: StudyResult) -> None:
        """Add what was found to the run in the history, where the run is kept there."""
        if self.number is not None:
            self.history.append(self.number, found)

    def write_json(self, records: Sequence[Record] = (), **parts: Any) -> None:
        """Write the JSON file that was asked for, if one was; ``parts`` as for ``to_json``."""
        if self.json_path:
            incomplete = {} if self.cut_short is None else {"incomplete": self.cut_short.why}
            self._write_text(self._json.text(records, **parts, **incomplete))

    def write_plain(self, data: Any) -> None:
        """Write plain data, of a command that has no run, to the JSON file that was asked for, if one was."""
        self._write_text(json.dumps(data, indent=2) + "\n")

    @cached_property
    def _json(self) -> JsonDocument:
        from harness.results.plain_json import JsonDocument

        return JsonDocument(self.run)

    def _write_text(self, text: str) -> None:
        """Make ``text`` the JSON file; on standard output only the last one is written, at the end of the command."""
        from harness.storage import write_atomically

        if self.json_path == STANDARD_OUTPUT:
            self._document = text
        elif self.json_path:
            write_atomically(self.json_path, text)

    def finish(self, problems: Sequence[Exception], crashed: bool, as_expected: bool, faults: Sequence[str] = ()) -> None:
        """End with the status that was earned: invalid input first, then faults of the harness, then a death, then a verdict.

        The loss of the scheduler is a death, and a signal has a status of its own.
        """
        options.report_errors(problems)
        for fault in faults:
            say(fault, err=True)
        if faults:
            options.report_own_fault()
        if self.cut_short is not None:
            sys.exit(self.cut_short.status)
        sys.exit(options.CRASHED if crashed else options.AS_EXPECTED if as_expected else options.NOT_AS_EXPECTED)


def cut_short(bracket: Bracket, cause: SchedulerLost | KeyboardInterrupt | Terminated, sentence: str) -> None:
    """Go on without a study that ended before its last part, which the first line that is printed says.

    Where the scheduler is lost, side tasks run on this machine. After a signal none does.
    """
    match cause:
        case KeyboardInterrupt():
            bracket.cut_short = CutShort("interrupted", options.INTERRUPTED, cause)
        case Terminated():
            bracket.cut_short = CutShort("terminated by a signal", options.TERMINATED, cause)
        case _:
            bracket.cut_short = CutShort(str(cause), options.CRASHED)
    bracket.__dict__.pop("pool", None)
    why = bracket.cut_short.why
    say(f"{why[0].upper()}{why[1:]}: {sentence}.", "")


def computing(*, time_limit: float | None = None, **chosen: bool) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Give a command its ``Bracket`` as first argument, and the options that fill it.

    Every command has --library, --json and --seed, --workers and --memory-limit; ``chosen`` adds ``scheduler``, ``directory``,
    ``floating_base``, ``aided`` and ``detail``, which is --all and --verbose, or takes away by False. ``time_limit`` is the default of
    --time-limit [s]; None leaves the option out.
    """
    offered = {"library": True, "json": True, "seed": True, "workers": True, "scheduler": False, "directory": False}
    offered |= {"floating_base": False, "aided": False, "detail": False} | chosen
    offered["memory_limit"] = offered["workers"]
    decorators = [options.BY_NAME[name] for name, is_offered in offered.items() if is_offered]
    if time_limit is not None:
        decorators.append(options.time_limit_option(time_limit))

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        @functools.wraps(command)
        def wrapper(**given: Any) -> None:
            own = {name: given.pop(name) for name in list(given) if name in Bracket.__dataclass_fields__}
            bracket = Bracket(**own)
            bracket.named_subjects = getattr(given.get("asked"), "subjects", given.get("subjects", ()))
            with contextlib.ExitStack() as output:
                if bracket.json_path == STANDARD_OUTPUT:
                    # Tables are for people: standard output is JSON and nothing else.
                    output.callback(lambda: print(bracket._document, end="", flush=True))
                    output.enter_context(contextlib.redirect_stdout(sys.stderr))
                try:
                    with bracket._exit:
                        command(bracket, **given)
                except (InvalidInput, InvalidRequest) as error:
                    from harness.workers import SchedulerLost

                    if isinstance(error, SchedulerLost):
                        say(f"harness: {error}", err=True)
                        sys.exit(options.CRASHED)
                    options.report_errors([error])

        return functools.reduce(lambda decorated, decorator: decorator(decorated), reversed(decorators), wrapper)

    return decorate
