"""What reaches a terminal: names and messages of others as text, tables that keep their numbers, and progress without a terminal."""

from __future__ import annotations

import io
import re
import threading
import time
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console
from support import harness, make_library
from support_results import RECORD, RUN

from harness.commands import faults
from harness.commands.bench import _print_benchmark
from harness.commands.faults import _print_faults, _print_left_out
from harness.commands.frame import options, terminal
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
from harness.results.cross_check import Cause, SuperfluousPart
from harness.results.pareto import with_cheapest
from harness.results.table import Column, Table

# Markup of rich, colours, a title, a carriage return, a line of its own, and a reversal of what follows.
EVIL = "[red]x[/blue]\x1b[31m\x1b]0;t\x07\r\n9 of 9 as expected\x9b\u202e"
LONG = "long_name_" * 25


def hostile(template: Any, *, but: tuple[str, ...] = (), name: str = EVIL) -> Any:
    """A copy of a result with ``name`` in each of its texts, but for those that are not free."""
    return replace(template, **{part.name: name for part in fields(template) if _is_text(part.type) and part.name not in but})


def _is_text(kind: Any) -> bool:
    return str(kind) == "str" or str(kind).startswith("Annotated[str, ")


MEASURED = bench.Benchmark(
    accelerations=[
        hostile(bench.AccelerationCost(
            system="", method="", threads=1, states=10, seconds_per_state=1e-6, backward_error=1.0, relative_error=1e-15, note="-"
        ))
    ],
    growth=[
        hostile(bench.Growth(
            family="", method="", sizes=[1, 2], seconds_per_state=[1e-6, 2e-6], backward_errors=[1.0, 1.0], exponent=1.0, expected=""
        ))
    ],
    truths=[hostile(bench.MotionTruth(system="", start={EVIL: [0.5]}, horizon=2.0, trusted=2.0, error=1e-15, precision="", seconds=1.0))],
    drifts=[
        hostile(bench.Drift(
            system="", integrator="", step=0.1, steps=10, seconds=1.0, largest=1.0, growth=1.0, verdict="", expected=""
        ))
    ],
    stationarity=[hostile(bench.Stationarity(system="", path="", step=0.1, residual=1e-3, slope=2.0, first_variation=1e-3))],
    orders=[hostile(bench.Order(system="", integrator="", measured=0.5, expected=1.0, verdict=""), but=("verdict",))],
    motion=[
        hostile(bench.MotionCost(
            system="", integrator="", step=0.1, tolerance=None, steps=20, evaluations=80, seconds=1e-3, state_error=1e-4,
            energy_error=1e-4, duration=2.0,
        ))
    ],
    figures=[hostile(bench.Figure(system="", what="", unit="", printed=1.0, computed=2.0, truth=2.0, reproduced=False))],
    problems=[EVIL],
)  # fmt: skip
POINT = HardPoint(
    knob=1.0, system=EVIL, verdict="agrees", backward_error=1.5, digits_lost=0.3, condition=1.0, unstable_bound=16.0, certified=8,
    states=8, bits=128, state=None, reason=EVIL,
)  # fmt: skip
HARD = Atlas(
    rows=[
        HardRow(case=EVIL, title=EVIL, subject=EVIL, knob=EVIL, unit=EVIL, points=[POINT], verdict="agrees", source=EVIL, remedy=EVIL)
    ],
    partings=[
        Parting(
            motion=EVIL, system=EVIL, integrator=EVIL, knob=2.4, rate=1.1, expected_rate=1.0, parted=25.0, earliest=24.0, largest=1.0,
            verdict="agrees",
        )
    ],
    stable_steps=[
        StableStep(case=EVIL, system=EVIL, integrator=EVIL, knob=1.0, frequency=1.0, measured=1.0, expected=2.0, verdict="disagrees")
    ],
    problems=[EVIL],
)  # fmt: skip
CAUSE = Cause(
    system=EVIL, subject=EVIL, inference=EVIL, first_line=EVIL + ".", diagnosed=EVIL,
    found={"terms": {"sentences": [EVIL]}, "model": {"file": EVIL, "text": [EVIL]}, "textbook": None},
)  # fmt: skip
FAULT = Fault(system=EVIL, format=EVIL, kind=EVIL, statement=EVIL, where=((1, EVIL, EVIL),), answer=EVIL, blamed=EVIL, cleared=EVIL)
KIND = KindOfFault(
    kind=EVIL, planted=1, live=1, caught=1, judged=1, named=1, in_class=1, blamed=0, smallest=1e-9, theory=1e-9, seconds=1.0, longest=1.0,
    known=True, diagnosed=1, found=1, found_in_class=1, right=1, misled=0, stopped=0,
)  # fmt: skip
CHANGE = SmallestChange(
    system=EVIL, subject=EVIL, file=EVIL, place=TextPlace(3, EVIL, EVIL, 0, EVIL), statement=EVIL, value=1.0, smallest=1e-9, theory=1e-9
)
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
    "records": lambda: terminal.print_table([hostile(RECORD, but=("verdict", "expected"))], RUN),
    "unexpected": lambda: terminal.print_unexpected([hostile(RECORD, but=("verdict", "expected"))]),
    "superfluous": lambda: terminal.print_superfluous([SuperfluousPart(EVIL, EVIL, EVIL, 1, EVIL, EVIL, EVIL, EVIL)]),
    "causes": lambda: terminal.print_causes([CAUSE, replace(CAUSE, diagnosed="")], Settings(library=Library.built_in())),
    "diagnoses": lambda: terminal.print_diagnoses([CAUSE, replace(CAUSE, diagnosed="")], [DIFFERENCE]),
    "benchmark": lambda: _print_benchmark(BenchmarkSummary(RUN, with_cheapest(MEASURED))),
    "atlas": _atlas,
    "faults": lambda: _print_faults([FAULT]),
    "left out": lambda: _print_left_out({(EVIL, EVIL): EVIL}),
    "kinds of faults": lambda: faults.print_kinds([KIND]),
    "smallest changes": lambda: faults.print_caught([CHANGE]),
    "errors": _refuse,
}


@pytest.mark.parametrize("what", PRINTED)
def test_no_name_or_message_commands_the_terminal(what: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    # So wide that no line is folded.
    monkeypatch.setattr(terminal, "_PIPE_WIDTH", 2000)
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
    # What was folded comes together again.
    first = "".join(line[:12].split("  ")[0].strip() for line in lines[3:]) if width < 160 else ""
    assert name.startswith(first[:12])
    text = "".join(lines).replace(" ", "")
    assert all(letter in text for letter in name)


def test_markup_in_the_label_of_a_progress_bar_is_text(monkeypatch: pytest.MonkeyPatch) -> None:
    stream = io.StringIO()
    monkeypatch.setattr(stream, "isatty", lambda: True)
    monkeypatch.setattr("sys.stderr", stream)
    monkeypatch.setattr(terminal, "console", lambda stderr=False: Console(file=stream, force_terminal=True, width=120))
    with terminal.progress(2, "cross-check") as advance:
        advance(EVIL)
    assert "[red]x[/blue]" in stream.getvalue()
    assert "\x1b]0;" not in stream.getvalue() and "\x1b[31m" not in stream.getvalue()


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


class Clock:
    """A clock that stands still until it is moved."""

    def __init__(self) -> None:
        self.now = 0.0

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


def test_short_work_is_silent_without_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    pipe, clock = piped(monkeypatch), Clock()
    with terminal.progress(2, "cross-check", clock) as advance:
        advance("a")
        clock.now = 9.9
        time.sleep(0.02)
        advance("b")
    assert pipe.getvalue() == ""


def test_work_goes_on_without_lines_where_no_thread_can_be_had(monkeypatch: pytest.MonkeyPatch) -> None:
    def start(self: threading.Thread) -> None:
        raise RuntimeError("can't start new thread")

    pipe, clock = piped(monkeypatch), Clock()
    monkeypatch.setattr("threading.Thread.start", start)
    with terminal.progress(2, "cross-check", clock) as advance:
        clock.now = 30.0
        advance("a")
    assert pipe.getvalue() == ""


def test_progress_ends_with_what_it_is_about_and_outlives_a_closed_stream(monkeypatch: pytest.MonkeyPatch) -> None:
    pipe, clock, before = piped(monkeypatch), Clock(), threading.active_count()
    with pytest.raises(KeyboardInterrupt), terminal.progress(2, "cross-check", clock):
        pipe.close()
        clock.now = 30.0
        time.sleep(0.02)
        raise KeyboardInterrupt
    assert threading.active_count() == before
