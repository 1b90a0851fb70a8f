"""What reaches a terminal: names and messages of others as text, tables that keep their numbers, and progress without a terminal."""

from __future__ import annotations

import io
import re
import threading
import time
from collections.abc import Callable
from dataclasses import MISSING, dataclass, fields
from pathlib import Path
from typing import Any

import click
import pytest
from click.testing import CliRunner
from rich.console import Console
from support import harness, make_library
from support_results import RECORD, RUN

from harness.commands import faults
from harness.commands.bench import _print_benchmark
from harness.commands.faults import _print_faults, _print_left_out
from harness.commands.frame import options, terminal
from harness.commands.frame.bracket import Bracket, computing
from harness.crosscheck.held import Difference
from harness.crosscheck.settings import Settings
from harness.diagnosis.faults.summary import Fault, KindOfFault, SmallestChange
from harness.errors import InvalidInput
from harness.files.text.scan import TextPlace
from harness.library import Library
from harness.report import hard_cases
from harness.report.benchmarks import BenchmarkSummary
from harness.report.hard_cases import HardSummary
from harness.results import benchmark as bench
from harness.results.atlas import Atlas, HardPoint, HardRow, Parting, StableStep
from harness.results.cross_check import Cause, CrossCheckResult, SuperfluousPart
from harness.results.detail import Detail
from harness.results.pareto import with_cheapest
from harness.results.records import Record
from harness.results.table import Cell, Column, Table

# Markup of rich, colours, a title, a carriage return, a line of its own, and a reversal of what follows.
EVIL = "[red]x[/blue]\x1b[31m\x1b]0;t\x07\r\n9 of 9 as expected\x9b\u202e"
LONG = "long_name_" * 25


def hostile(kind: type[Any], **given: Any) -> Any:
    """A result with ``EVIL`` in each of its texts and 1 for each number that it needs, but for what is given."""
    texts = {part.name: EVIL for part in fields(kind) if str(part.type) == "str" or str(part.type).startswith("Annotated[str, ")}
    needed = [part.name for part in fields(kind) if part.default is part.default_factory is MISSING]
    return kind(**dict.fromkeys(needed, 1) | texts | given)


MEASURED = bench.Benchmark(
    accelerations=[hostile(bench.AccelerationCost)],
    growth=[hostile(bench.Growth, sizes=[1, 2], seconds_per_state=[1e-6, 2e-6], backward_errors=[1.0, 1.0])],
    truths=[hostile(bench.MotionTruth, start={EVIL: [0.5]})],
    drifts=[hostile(bench.Drift)],
    stationarity=[hostile(bench.Stationarity)],
    orders=[hostile(bench.Order, verdict="")],
    motion=[hostile(bench.MotionCost, tolerance=None, state_error=1e-4, energy_error=1e-4, duration=2.0)],
    figures=[hostile(bench.Figure, reproduced=False)],
    problems=[EVIL],
)
HARD = Atlas(
    rows=[hostile(HardRow, points=[hostile(HardPoint, verdict="agrees", state=None)], verdict="agrees")],
    partings=[hostile(Parting, verdict="agrees")],
    stable_steps=[hostile(StableStep, expected=2.0, verdict="disagrees")],
    problems=[EVIL],
)
NUMBERS = {name: value for name, value in vars(RECORD).items() if not isinstance(value, str)}
WRONG = hostile(Record, **NUMBERS, verdict=RECORD.verdict, expected=RECORD.expected)
FOUND = {"terms": {"sentences": [EVIL]}, "model": {"file": EVIL, "text": [EVIL]}, "textbook": None}
CAUSES = [hostile(Cause, first_line=EVIL + ".", diagnosed=diagnosed, found=FOUND) for diagnosed in (EVIL, "")]
FAULT = hostile(Fault, where=((1, EVIL, EVIL),), caught_by="")
CHANGE = hostile(SmallestChange, place=TextPlace(3, EVIL, EVIL, 0, EVIL))
DIFFERENCE = Difference("mass", EVIL, ((EVIL,), (EVIL,)), (1.0, 2.0), 1e9, {"mjcf": (1,)}, {"mjcf": EVIL})


def _atlas() -> None:
    summary = HardSummary(RUN, HARD)
    for table in (hard_cases.rows_of(summary), hard_cases.partings(summary), hard_cases.stable_steps(summary)):
        terminal.print_titled(EVIL, table)
    terminal.print_sentences(summary)


def _refuse() -> None:
    with pytest.raises(SystemExit):
        options.report_errors([InvalidInput(EVIL, 3, EVIL)])


PRINTED: dict[str, Callable[[], None]] = {
    "records": lambda: terminal.print_table([WRONG], RUN),
    "unexpected": lambda: terminal.print_unexpected([WRONG]),
    "superfluous": lambda: terminal.print_superfluous([hostile(SuperfluousPart)]),
    "causes": lambda: terminal.print_diagnoses_left(CrossCheckResult(causes=CAUSES), Settings(library=Library.built_in())),
    "diagnoses": lambda: terminal.print_diagnoses(CAUSES, [DIFFERENCE]),
    "benchmark": lambda: _print_benchmark(BenchmarkSummary(RUN, with_cheapest(MEASURED))),
    "atlas": _atlas,
    "faults": lambda: _print_faults([FAULT]),
    "left out": lambda: _print_left_out({(EVIL, EVIL): EVIL}),
    "kinds of faults": lambda: faults.print_kinds([hostile(KindOfFault)]),
    "smallest changes": lambda: faults.print_caught([CHANGE]),
    "errors": _refuse,
}


@pytest.mark.parametrize("what", PRINTED)
def test_no_name_or_message_commands_the_terminal(what: str, capsys: pytest.CaptureFixture[str]) -> None:
    PRINTED[what]()
    found = capsys.readouterr()
    shown = found.out + found.err
    assert "[red]x[/blue]" in shown.replace("\n", "").replace(" ", "")
    assert [character for character in shown if not character.isprintable() and character != "\n"] == []
    # Nothing that is no line of ours begins one.
    assert not re.search(r"^9 of 9", shown, re.MULTILINE)


def test_every_table_of_a_benchmark_is_among_them(capsys: pytest.CaptureFixture[str]) -> None:
    PRINTED["benchmark"]()
    printed = capsys.readouterr().out
    titles = [
        "accelerations", "growth: exponent of the cost over the number of bodies", "true motion", "motion", "energy over long runs",
        "stationary action", "figures of the text", "the cheapest way: accelerations", "the cheapest way: motion",
    ]  # fmt: skip
    assert [title for title in titles if f"\n{title}\n" not in printed] == []


@pytest.mark.parametrize("width", [1, 30, 60, 80, 160])
@pytest.mark.parametrize("name", ["chain_12", LONG])
def test_a_long_name_and_a_narrow_terminal_leave_every_number_whole(name: str, width: int, monkeypatch: pytest.MonkeyPatch) -> None:
    stream = io.StringIO()
    monkeypatch.setattr(stream, "isatty", lambda: True)
    monkeypatch.setattr("sys.stdout", stream)
    monkeypatch.setenv("COLUMNS", str(width))
    monkeypatch.delenv("TERM", raising=False)
    columns = ["system", *(Column(f"the {place}", "error") for place in range(9)), "verdict"]
    terminal.print_titled("title", Table(columns, [[name, *(1 / (place + 3) for place in range(9)), "unstable (as expected)"]]))
    lines = stream.getvalue().splitlines()
    for place in range(9):
        assert sum(f"{1 / (place + 3):#.3g}" in line for line in lines) == 1
    # No name is broken, and no heading either.
    assert sum(name in line for line in lines) == 1 and sum("unstable" in line for line in lines) == 1
    assert "system" in lines[2]


@pytest.mark.parametrize("name", ["chain_12", LONG])
def test_in_a_pipe_a_row_is_one_line(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    message = "two sentences of a message, " * 20
    terminal.print_rows(Table(["system", "message"], [[Cell(name, ["a note of it"]), message.strip()]]))
    _, row = capsys.readouterr().out.splitlines()
    assert row.split("  ")[0] == f"{name}, a note of it" and row.endswith(message.strip())


def test_how_often_the_fastest_call_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    terminal.print_table([RECORD], RUN)
    brief = capsys.readouterr().out
    terminal.print_table([RECORD], RUN, Detail.VERBOSE)
    whole = capsys.readouterr().out
    for background in ("fastest", "times: "):
        assert background not in brief and background in whole


@pytest.mark.parametrize(
    ("options", "detail"), [([], "BRIEF"), (["--all"], "ALL"), (["--verbose"], "VERBOSE"), (["--all", "--verbose"], "VERBOSE")]
)
def test_one_pair_of_options_says_how_much_a_command_tells(options: list[str], detail: str) -> None:
    @click.command()
    @computing(detail=True)
    def command(bracket: Bracket) -> None:
        click.echo(bracket.detail.name)

    assert CliRunner().invoke(command, options).output.strip() == detail


def test_markup_in_the_label_of_a_progress_bar_is_text(monkeypatch: pytest.MonkeyPatch) -> None:
    stream = io.StringIO()
    monkeypatch.setattr(stream, "isatty", lambda: True)
    monkeypatch.setattr("sys.stderr", stream)
    monkeypatch.setattr(terminal, "console", lambda stderr=False: Console(file=stream, force_terminal=True, width=120))
    with terminal.progress(2, "cross-check") as advance:
        advance(EVIL)
    assert "[red]x[/blue]" in stream.getvalue()
    assert "\x1b]0;" not in stream.getvalue() and "\x1b[31m" not in stream.getvalue()


@pytest.mark.ci
def test_a_library_with_a_hostile_file_name_is_checked_listed_and_shown(tmp_path: Path) -> None:
    library, name = make_library(tmp_path / "library", ["bar_pendulum"]), EVIL.replace("/", "")
    for path in list(library.rglob("bar_pendulum.*")):
        path.rename(path.with_stem(name))
    model = library / "mjcf" / f"{name}.xml"
    model.write_text(model.read_text().replace('mass="2"', 'mass="2.0000001"'))
    options = ("--library", str(library))
    for arguments, status in {("list",): 0, ("show", name): 0, ("check", "--states", "20", "--subject", "mujoco/mjcf"): 1}.items():
        done = harness(*arguments, *options, cwd=tmp_path)
        assert done.returncode == status, done.stdout + done.stderr
        shown = done.stdout + done.stderr
        assert "[red]x" in shown and [letter for letter in shown if not letter.isprintable() and letter != "\n"] == []


@dataclass
class Clock:
    """A clock that stands still until it is moved."""

    now: float = 0.0

    def __call__(self) -> float:
        return self.now


def _lines_until(count: int, stream: io.StringIO) -> list[str]:
    """The lines of a stream that another thread writes, as soon as there are so many."""
    deadline = time.monotonic() + 10
    while stream.getvalue().count("\n") < count and time.monotonic() < deadline:
        time.sleep(0.001)
    return stream.getvalue().splitlines()


def piped(monkeypatch: pytest.MonkeyPatch) -> io.StringIO:
    """Standard error from now on, which is no terminal; progress looks at its clock often."""
    stream = io.StringIO()
    monkeypatch.setattr("sys.stderr", stream)
    monkeypatch.setattr(terminal, "LOOK_SECONDS", 0.001)
    return stream


def test_without_a_terminal_a_line_tells_every_ten_seconds_how_far_it_is(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    pipe, clock = piped(monkeypatch), Clock()
    with terminal.progress(180, "cross-check", clock) as advance:
        advance("arm_2r lagrange")
        clock.now = 10.5
        assert _lines_until(1, pipe) == ["harness: cross-check: 1 of 180 after 10 s; last arm_2r lagrange"]
        for _ in range(11):
            advance(EVIL)
        clock.now = 20.5
        assert len(_lines_until(2, pipe)[1]) < 160 and pipe.getvalue().count("\n") == 2
        # Nothing was completed, which is worth a line too.
        clock.now = 95.0
        assert _lines_until(3, pipe)[2].startswith("harness: cross-check: 12 of 180 after 95 s; last [red]x[/blue]\\x1b")
    clock.now = 1000.0
    time.sleep(0.01)
    assert pipe.getvalue().count("\n") == 3
    assert capsys.readouterr().out == ""


def test_a_line_names_what_is_going_on(monkeypatch: pytest.MonkeyPatch) -> None:
    pipe, clock = piped(monkeypatch), Clock()
    running = ["/robots/iCubGazeboV2/model.urdf", "arm_7r", EVIL]
    with terminal.progress(3, "survey", clock, lambda: running):
        clock.now = 10.5
        [line] = _lines_until(1, pipe)
        assert line.startswith("harness: survey: 0 of 3 after 10 s; now iCubGazeboV2/model.urdf, arm_7r, [red]x") and len(line) < 160


@pytest.mark.parametrize(("seconds", "threads"), [(9.9, True), (30.0, False)])
def test_short_work_is_silent_and_so_is_work_for_which_no_thread_can_be_had(
    seconds: float, threads: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    def start(self: threading.Thread) -> None:
        raise RuntimeError("can't start new thread")

    pipe, clock = piped(monkeypatch), Clock()
    if not threads:
        monkeypatch.setattr("threading.Thread.start", start)
    with terminal.progress(2, "cross-check", clock) as advance:
        advance("a")
        clock.now = seconds
        time.sleep(0.02)
        advance("b")
    assert pipe.getvalue() == ""


def test_progress_ends_with_what_it_is_about_and_outlives_a_closed_stream(monkeypatch: pytest.MonkeyPatch) -> None:
    pipe, clock, before = piped(monkeypatch), Clock(), threading.active_count()
    with pytest.raises(KeyboardInterrupt), terminal.progress(2, "cross-check", clock):
        pipe.close()
        clock.now = 30.0
        time.sleep(0.02)
        raise KeyboardInterrupt
    assert threading.active_count() == before
