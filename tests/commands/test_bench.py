"""``harness bench``: what it runs and how, what it keeps, what it prints, and its exit statuses."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from click.testing import Result
from support import Stage, completed, harness_in_a_process, make_library, where, without_progress
from support_results import RECORD, RUN

from harness import workers
from harness.bench.parts import PARTS, BenchmarkSettings, load
from harness.bench.study import BenchmarkStudy
from harness.crosscheck.scene import Scene
from harness.errors import InvalidModel
from harness.lagrange.derivation import load_mechanism
from harness.library import Library
from harness.results.benchmark import AccelerationCost, Benchmark, Cheapest
from harness.results.cross_check import CrossCheckResult
from harness.results.history import History
from harness.results.motion_benchmark import Figure, MotionCost, Order
from harness.study import Inquiry, ask, run_study
from harness.workers import Crash, Outcome, Task

# Of a path, only the file may reach a published page.
UPSIDE_DOWN = Path("somebody", "mjcf", "bar_pendulum.xml")


def cost(system: str, seconds: float = 1e-6) -> Benchmark:
    entry = AccelerationCost(
        system=system, method="pinocchio aba", threads=1, states=10, seconds_per_state=seconds, backward_error=1.0, relative_error=1e-15
    )
    return Benchmark(accelerations=[entry])


def answer(task: Task) -> Outcome:
    """A scene for what loads, and a measurement for what measures."""
    name, part = where(task)[:2]
    if task.function is load:
        library = Library.built_in()
        return Outcome(task, value=Scene(library, load_mechanism(library, "bar_pendulum"), {}))
    return Outcome(task, value=cost(f"{name} {part}"))


def test_one_task_per_system_and_part_and_what_is_timed_runs_alone() -> None:
    stage, names = Stage(answer), ("collar", "cart_pendulum", "chain_3")
    study = BenchmarkStudy(BenchmarkSettings(library=Library.built_in(), names=names, motion=True))
    measured = list(run_study(study, stage))
    loading, timed, shared = [[where(task)[:2] for task in tasks] for tasks in stage.rounds]
    assert loading == [(name, "equations and models") for name in names]
    assert timed == [(name, "accelerations") for name in names] + [("chain", "growth"), ("chain", "growth of robots")] + [
        (name, "motion") for name in names
    ]
    assert {task.affinity for task in stage.rounds[1]} == {True} and {task.affinity for task in stage.rounds[2]} == {None}
    assert set(shared) == {
        *((name, part) for name in names for part in ("long runs", "stationary action")),
        ("cart_pendulum", "figures of the text"),
    }
    assert len(measured) == study.steps


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        ({"names": ["collar"]}, {"accelerations"}),
        ({"names": ["collar"], "quantities": ["bias", "accelerations"]}, {"accelerations", "bias"}),
        ({"names": ["collar"], "quantities": ["bias"]}, {"bias"}),
        ({"names": ["cart_pendulum"], "methods": ["pinocchio aba"], "motion": True}, {"accelerations"}),
        ({"names": ["collar"], "methods": ["mujoco RK4"], "motion": True}, {"motion", "long runs", "stationary action"}),
        ({}, {"accelerations", "growth", "growth of robots"}),
        ({"names": ["chain_3"], "methods": ["pinocchio aba"]}, {"accelerations", "growth"}),
    ],
)
def test_only_what_was_asked_for_is_measured(settings: dict[str, Any], expected: set[str]) -> None:
    stage = Stage(answer)
    completed(BenchmarkStudy(BenchmarkSettings(library=Library.built_in(), **settings)), stage)
    measuring = [task for tasks in stage.rounds[1:] for task in tasks]
    assert {where(task)[1] for task in measuring} == expected
    for task in measuring:
        given, _ = task.arguments
        if "methods" in settings:
            assert given.methods == settings["methods"]


def test_a_failing_part_costs_nothing_but_itself() -> None:
    def failing(task: Task) -> Outcome:
        if where(task)[:2] == ("collar", "accelerations"):
            return Outcome(task, crash=Crash("crashed by signal 11 (SIGSEGV)", "pinocchio aba", ""))
        if where(task)[:2] == ("bar_pendulum", "equations and models"):
            return Outcome(task, exception=InvalidModel(UPSIDE_DOWN, 3, "is upside down"))
        if where(task)[:2] == ("arm_2r", "accelerations"):
            return Outcome(task, exception=ZeroDivisionError("division by zero"))
        return answer(task)

    run = BenchmarkStudy(BenchmarkSettings(library=Library.built_in(), names=("collar", "bar_pendulum", "arm_2r", "cart_pendulum")))
    measured = completed(run, Stage(failing))
    assert [entry.system for entry in measured.accelerations] == ["cart_pendulum accelerations"]
    assert measured.problems == [
        "bar_pendulum, equations and models: bar_pendulum.xml: is upside down",
        "collar, accelerations (pinocchio aba): crashed by signal 11 (SIGSEGV)",
        "arm_2r, accelerations: ZeroDivisionError: division by zero",
    ]
    assert run.crashed and [str(problem) for problem in run.problems] == [f"{UPSIDE_DOWN}:3: is upside down"]


@pytest.fixture
def measure(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Replaces what a benchmark measures, one part a round."""

    def replace(
        *parts: Benchmark, problems: Iterable[InvalidModel] = (), crashed: bool = False, then: Callable[[], None] = lambda: None
    ) -> None:
        def inquiries(self: BenchmarkStudy) -> Iterator[list[Inquiry[None]]]:
            self.problems, self.crashed = list(problems), crashed
            yield from ([measured(self, number, part)] for number, part in enumerate(parts))
            then()

        def measured(study: BenchmarkStudy, number: int, part: Benchmark) -> Inquiry[None]:
            yield from ask(print)
            yield study.kept(f"part {number}", part)

        monkeypatch.setattr(BenchmarkStudy, "inquiries", inquiries)
        monkeypatch.setattr(workers, "Workers", Stage(Outcome))

    return replace


ORDER = Order(system="collar", integrator="mujoco Euler", measured=0.5, expected=1.0, verdict="differs")
DIFFERS, EXPLAINED = Benchmark(orders=[ORDER]), Benchmark(orders=[replace(ORDER, explanation="It is damped.")])
FIGURE = Figure(system="cart_pendulum", what="x", unit="cm", printed=0.01, computed=0.0048, truth=0.0048, reproduced=False)


@pytest.mark.ci
@pytest.mark.parametrize(
    ("parts", "options", "status", "words"),
    [
        ([cost("collar")], {}, 0, "pinocchio aba"),
        ([EXPLAINED], {}, 0, "It is damped."),
        ([cost("collar"), DIFFERS], {}, 1, "order of convergence 0.50, expected 1.00"),
        ([Benchmark(figures=[FIGURE])], {}, 1, "printed 0.01 cm, computed 0.0048 cm"),
        ([cost("collar"), Benchmark(problems=["arm_2r, motion: ValueError: no"])], {}, 1, "not measured: arm_2r, motion: ValueError: no"),
        ([cost("collar"), DIFFERS], {"problems": [InvalidModel("a.xml", 3, "is empty")]}, 2, "a.xml:3: is empty"),
        ([DIFFERS, Benchmark(problems=["died"])], {"crashed": True}, 3, "not measured: died"),
        ([Benchmark(problems=["died"])], {"problems": [InvalidModel("a.xml", 3, "is empty")], "crashed": True}, 2, "died"),
    ],
)
def test_exit_statuses(
    parts: list[Benchmark],
    options: dict[str, Any],
    status: int,
    words: str,
    invoke: Callable[..., Result],
    measure: Callable[..., None],
) -> None:
    measure(*parts, **options)
    done = invoke("collar")
    assert done.exit_code == status, done.output
    assert words in done.output


def test_parts_are_kept_as_they_come(invoke: Callable[..., Result], measure: Callable[..., None], tmp_path: Path) -> None:
    def interrupt() -> None:
        written = json.loads((tmp_path / "out.json").read_text())["benchmark"]
        assert [entry["system"] for entry in written["accelerations"]] == ["collar"]
        raise KeyboardInterrupt

    measure(cost("collar"), then=interrupt)
    assert invoke("collar", "--json", "out.json").exit_code != 0
    with History(tmp_path / "reports" / "history.sqlite") as history:
        found = history.latest(Benchmark, "built-in")
    assert found is not None and found[1] == cost("collar")


@pytest.mark.ci
def test_the_page_holds_the_latest_run_and_benchmark_of_the_library(
    invoke: Callable[..., Result], measure: Callable[..., None], tmp_path: Path
) -> None:
    measure(cost("collar", 1e-6))
    page = tmp_path / "reports" / "index.html"
    invoke("collar")
    assert "Nothing was cross-checked yet" in page.read_text()
    with History(tmp_path / "reports" / "history.sqlite") as history:
        history.append(history.begin(RUN, CrossCheckResult), CrossCheckResult(records=[RECORD]))
    measure(cost("collar", 2e-6))
    assert invoke("collar").exit_code == 0
    text = page.read_text()
    assert "Nothing was cross-checked yet" not in text
    assert 'id="verdicts"' in text and 'id="cost"' in (tmp_path / "reports" / "mechanisms" / "collar.html").read_text()
    document = json.loads((tmp_path / "reports" / "report.json").read_text())
    assert [entry["seconds_per_state"] for entry in document["benchmark"]["accelerations"]] == [2e-6]
    assert [record["system"] for record in document["records"]] == [RECORD.system]
    cheapest = [Cheapest(**entry) for entry in document["benchmark"]["cheapest"]]
    assert [entry.way for entry in cheapest] == ["pinocchio aba"] * 3


@pytest.mark.ci
def test_motion_is_told_in_tables(invoke: Callable[..., Result], measure: Callable[..., None]) -> None:
    motion = [
        MotionCost(
            system="collar", integrator="mujoco RK4", step=step, tolerance=None, steps=round(2 / step), evaluations=round(8 / step),
            seconds=1e-4 / step, state_error=step**4, energy_error=step**4, duration=2.0,
        )
        for step in (0.1, 0.01)
    ]  # fmt: skip
    order = Order(system="collar", integrator="mujoco RK4", measured=4.0, expected=4.0, verdict="as expected", steps=[0.1, 0.01])
    measure(Benchmark(motion=motion, orders=[order]))
    done = invoke("collar", "--motion")
    assert done.exit_code == 0
    assert re.search(r"collar +mujoco RK4 +4\.00 +4\.00 +as expected +1\.00e-08 +5\.00 ms", done.output), done.output
    assert "mujoco RK4, step 0.1 s" in done.output and "mujoco RK4, step 0.01 s" in done.output


def test_parts_have_names_of_their_own() -> None:
    assert len({part.name for part in PARTS}) == len(PARTS)


@pytest.mark.ci
def test_accelerations_of_one_system_for_real(tmp_path: Path) -> None:
    make_library(tmp_path / "mine", ["spring_damper"])
    methods = ("--methods", "pinocchio aba", "--methods", "heyoka float64")
    done = harness_in_a_process("bench", "--library", "mine", "--workers", "1", "--json", "out.json", *methods, cwd=tmp_path, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr
    assert without_progress(done.stderr) == ""
    document = json.loads((tmp_path / "out.json").read_text(), parse_constant=pytest.fail)
    assert {"harness", "pin", "mujoco"} <= set(document["harness"])
    measured = {entry["method"]: entry for entry in document["benchmark"]["accelerations"]}
    assert set(measured) == {"pinocchio aba", "heyoka float64"}
    for entry in measured.values():
        assert entry["system"] == "spring_damper" and 0 < entry["backward_error"] < 64
        assert 0 < entry["fastest"] <= entry["seconds_per_state"] <= entry["slowest"]
        assert re.search(rf"^spring_damper +{re.escape(entry['method'])} ", done.stdout, re.MULTILINE)
    # A compiled batch against a call per state from Python: two orders of magnitude, of which one is asked for.
    assert measured["pinocchio aba"]["seconds_per_state"] > 10 * measured["heyoka float64"]["seconds_per_state"]
    assert [entry["way"] for entry in document["benchmark"]["cheapest"]] == ["heyoka float64"] * 3
    assert "spring_damper: speed against error" in (tmp_path / "reports" / "mechanisms" / "spring_damper.html").read_text()


@pytest.mark.ci
def test_costs_say_their_spread_their_loop_and_the_load(invoke: Callable[..., Result], measure: Callable[..., None]) -> None:
    entry = AccelerationCost(
        system="collar", method="pinocchio aba", states=10, seconds_per_state=2e-6, fastest=1.5e-6, slowest=4e-6, repetitions=9,
        backward_error=1e219, relative_error=5e203, loop="Python",
    )  # fmt: skip
    exact = replace(entry, method="certified balls", seconds_per_state=3e-6, fastest=2.5e-6, backward_error=0.5, relative_error=1e-16)
    measure(Benchmark(accelerations=[entry, exact]))
    assert "fastest call" not in invoke("collar").output
    done = invoke("collar", "--verbose")
    assert re.search(r"collar +pinocchio aba +1 +Python +2\.00 µs +1\.50 µs ", done.output), done.output
    assert "> 1" in done.output and "e+203" not in done.output
    assert re.search(r"^times: .*; worker processes \d+, cpus \d+, load \d+\.\d\d at the start$", done.output, re.MULTILINE)
    assert "3.00 µs per state, fastest 2.50 µs" in done.output


@pytest.mark.ci
def test_the_time_limit_is_the_profile_s_unless_one_is_given(invoke: Callable[..., Result], monkeypatch: pytest.MonkeyPatch) -> None:
    stage = Stage(answer)
    monkeypatch.setattr(workers, "Workers", stage)
    for options in ([], ["--profile", "nightly"], ["--time-limit", "5"]):
        invoke("collar", *options)
    assert [made["time_limit"] for made in stage.made_with] == [300.0, 3600.0, 5.0]
