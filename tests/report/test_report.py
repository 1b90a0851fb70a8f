"""Reports: complete, offline, escaped, comparable, and never failing."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import lxml.html
import pytest
from report import test_benchmark_report, test_hard_report
from support import Page, site_of

from harness import report
from harness.errors import InvalidInput
from harness.report import Earlier, write
from harness.report.charts import half_decades
from harness.report.html import left_out
from harness.report.markdown import MOST_LINES, VOLATILE
from harness.report.markup import equations
from harness.results.cross_check import Cause, CrossCheckResult, HeldDifference, SuperfluousPart, SystemCard
from harness.results.records import Record
from harness.results.run import Run
from harness.results.trend import changes, readings_of_records
from harness.verdict import Verdict

VERDICTS = [verdict.value for verdict in Verdict]
SUBJECTS = ("lagrange", "mujoco/mjcf", "pinocchio/urdf")
LONG_MESSAGE = "FatalError: constraint matrix is not positive definite. " * 30 + "<script>alert('x')</script> end of message"


def run_on(day: int, mujoco: str = "4.0.0") -> Run:
    started = (datetime(2026, 1, 1, 2, tzinfo=UTC) + timedelta(days=day)).isoformat()
    return Run(
        started=started, versions={"harness": "0.1.0", "mujoco": mujoco}, machine={"processor": f"{day} cores"}, seed=1000 + day,
        profile="nightly", states=500, library="built-in", command=f"harness report --seed {1000 + day}",
    )  # fmt: skip


def record(system: str, subject: str, night: int = 0, **changes: object) -> Record:
    plain = Record(
        system=system, subject=subject, states=500, verdict="agrees", expected="agrees", backward_error=1.3,
        relative_error=1e-15 * (1 + night), worst_state={"q": [0.1 + night], "v": [-2.0], "tau": [1e-300]},
        seconds_per_state=1e-6 * (1 + night), message="",
        median_backward_error=0.2, distribution={"exact": 3, "-2": 400, "0": 97}, verdict_counts={"agrees": 500},
        replay=f"harness check {system} --subject {subject} --seed {night}", median_bounds=[0.19, 0.21],
    )  # fmt: skip
    return replace(plain, **changes)  # type: ignore[arg-type]


def with_median(entry: Record, median: float) -> Record:
    """A record whose sample knows its median to a twentieth."""
    return replace(entry, median_backward_error=median, median_bounds=[0.95 * median, 1.05 * median])


def changes_on(page: str) -> list[list[str]]:
    """The rows of the table of what changed in the trend; none where it is missing."""
    tables = lxml.html.fromstring(page).xpath("//table[starts-with(caption, 'Changed in the trend')]")
    return [[cell.text_content().strip() for cell in row] for table in tables for row in table.xpath("./tbody/tr")]


def card(name: str) -> SystemCard:
    return SystemCard(
        name=name, description=f"Mechanism {name}", source="A book, p. 3 & 4", coordinates=[{"name": "x", "joint": "slide"}],
        parameters=[{"name": "m", "value": 1.5, "unit": "kg"}],
        equations_mathml='<math display="block"><mi>m</mi><mo>&InvisibleTimes;</mo><mi>a</mi></math>', equations_text="m*a",
        operations=2, derivation_seconds=0.1, reference_seconds_per_state=4e-5, compilation_seconds=0.25,
    )  # fmt: skip


SYSTEMS = ("arm_2r", "bar_pendulum", "collar")
CARDS = [card(name) for name in SYSTEMS]


def night(number: int) -> list[Record]:
    special: dict[tuple[str, str], dict[str, object]] = {
        ("collar", "mujoco/mjcf"): {
            "verdict": "error", "backward_error": None, "relative_error": None, "median_backward_error": None, "distribution": {},
            "verdict_counts": {"error": 500}, "seconds_per_state": None, "message": LONG_MESSAGE, "failed": True,
        },
        ("arm_2r", "mujoco/mjcf"): {
            "verdict": "unstable", "expected": "unstable", "backward_error": 654.0, "expected_reason": "Known loss of digits.",
            "expected_link": "https://example.org/issues/1",
        },
        ("bar_pendulum", "pinocchio/urdf"): {"verdict": "disagrees", "backward_error": math.inf},
    }  # fmt: skip
    return [record(system, subject, number, **special.get((system, subject), {})) for system in SYSTEMS for subject in SUBJECTS]


def build(
    run: Run, cards: Sequence[SystemCard], records: Sequence[Record], history: Sequence[Earlier] = (), **parts: list[Any]
) -> dict[str, str]:
    return report.build(run, CrossCheckResult(records=list(records), systems=list(cards), **parts), history)


@pytest.fixture(scope="module")
def files() -> dict[str, str]:
    history = [(run_on(day), night(day)[day:]) for day in range(3)]
    return build(run_on(3, "4.1.0"), CARDS, night(3), history)


@pytest.fixture(scope="module")
def page(files: dict[str, str]) -> Page:
    return site_of(files)


@pytest.mark.ci
def test_every_pair_has_its_place(page: Page, files: dict[str, str]) -> None:
    table = re.search(r'<table class="matrix verdicts"[^>]*>(.*?)</table>', files["index.html"], re.DOTALL)
    # The harness's own code is no engine, and has no column.
    assert table and table[1].count("<td") == len(SYSTEMS) * (len(SUBJECTS) - 1)
    for system in SYSTEMS:
        own = Page(files[f"mechanisms/{system}.html"]).identifiers
        for subject in SUBJECTS:
            place = subject.replace("/", "-")
            is_shown = subject != "lagrange"
            assert place in own and table[1].count(f'href="mechanisms/{system}.html#{place}"') == is_shown
            assert (f'id="cell-{system}--{place}"' in table[1]) is is_shown
    for entry in night(3):
        assert entry.replay in page.text
        assert (f"**{entry.system}, {entry.subject}: {entry.verdict}**" in files["report.md"]) is not entry.as_expected
    assert "9 pairs: 6 agree, 1 differs for a known reason, 2 unexpectedly: bar_pendulum pinocchio/urdf disagrees, " in page.text


def test_numbers_and_messages_are_complete(page: Page, files: dict[str, str]) -> None:
    assert "q = [3.1]\nv = [-2.0]\ntau = [1e-300]" in page.text
    assert LONG_MESSAGE in page.text and LONG_MESSAGE[:200] in files["report.md"]
    assert "Known loss of digits." in page.text and "https://example.org/issues/1" in page.links
    assert "3 states with no error at all" in page.text


def test_errors_far_below_a_rounding_are_counted_and_not_drawn() -> None:
    entry = record("collar", "lagrange", distribution={"-300": 2, "-17": 1, "-16": 4, "1": 493})
    assert half_decades(entry) == {-16: 4, 1: 493}
    assert left_out(entry) == "3 states below 1e-08"


@pytest.mark.usefixtures("without_charts")
def test_superfluous_parts_are_told_everywhere_and_spoil_the_result() -> None:
    finding = SuperfluousPart(
        "collar", "mujoco/mjcf", str(Path("somebody", "mjcf", "collar.xml")), 7, "joint", "armature", "0", "is not felt"
    )
    entries = [record("collar", subject) for subject in SUBJECTS]
    built = build(run_on(0), CARDS, entries, superfluous=[finding])
    page = site_of(built)
    for text in (page.words, built["report.md"]):
        assert "ollar: all 3 subjects agree; not as expected: 1 superfluous part." in text
        assert "mjcf/collar.xml:7: " in text and "somebody" not in text
    assert 'class="result bad"' in built["index.html"]
    [told] = json.loads(built["report.json"])["superfluous"]
    assert told["path"] == "mjcf/collar.xml" and told["line"] == 7
    warned = build(run_on(0), CARDS, entries, superfluous=[replace(finding, fails=False)])
    assert 'class="result good"' in warned["index.html"] and "1 superfluous part is a warning." in warned["report.md"]
    clean = build(run_on(0), CARDS, entries)
    assert 'class="result good"' in clean["index.html"] and json.loads(clean["report.json"])["superfluous"] == []


@pytest.mark.usefixtures("without_charts")
def test_differences_after_loading_are_told_everywhere_and_spoil_the_result() -> None:
    place = f"{Path('somebody', 'mjcf', 'collar.xml')}:7"
    finding = HeldDifference(
        system="collar", quantity="mass", joint="rod", subjects=["mujoco/mjcf"], statement="mass of rod is 1, but 2", places=[place]
    )
    entries = [record("collar", subject) for subject in SUBJECTS]
    built = build(run_on(0), CARDS, entries, differs=[finding])
    page = site_of(built)
    for text in (page.words, built["report.md"]):
        assert "ollar: all 3 subjects agree; not as expected: 1 difference after loading." in text
        assert "mass of rod is 1, but 2; mjcf/collar.xml:7" in text and "somebody" not in text
    assert 'class="result bad"' in built["index.html"]
    assert json.loads(built["report.json"])["differs"][0]["places"] == ["mjcf/collar.xml:7"]
    expected = build(run_on(0), CARDS, entries, differs=[replace(finding, reason="it is meant")])
    assert 'class="result good"' in expected["index.html"] and "expected because it is meant" in expected["report.md"]


def test_derivation_and_compilation_are_timed(files: dict[str, str], page: Page) -> None:
    assert page.words.count("derived in 100 ms, compiled in 250 ms") == len(SYSTEMS)
    assert json.loads(files["report.json"])["systems"][0]["compilation_seconds"] == 0.25


@pytest.mark.ci
def test_changes_and_trend_need_history(files: dict[str, str]) -> None:
    page = Page(files["changes.html"])
    changed = page.text.rpartition("Changed since the last run")[2]
    assert "4.0.0" in changed and "4.1.0" in changed
    assert "1 version changed" in Page(files["index.html"]).words
    alone = build(run_on(0), CARDS, night(0))
    assert "changes.html" not in alone and "since the last run" not in site_of(alone).words


@pytest.mark.usefixtures("without_charts")
def test_a_changed_verdict_is_named() -> None:
    before = [record("collar", "lagrange"), record("collar", "mujoco/mjcf")]
    after = [record("collar", "lagrange", verdict="disagrees", backward_error=1e5)]
    text = build(run_on(1), [], after, [(run_on(0), before)])["report.md"]
    assert "collar, lagrange: agrees, now disagrees; collar, mujoco/mjcf: agrees, now not run." in text


@pytest.mark.usefixtures("without_charts")
def test_a_median_that_has_grown_is_named_long_before_the_verdict_changes() -> None:
    """By the rule of the night, on the index, on the page of its mechanism and in the Markdown; and nowhere in the run after it."""
    before = [with_median(record("collar", subject), 1.2) for subject in ("lagrange", "mujoco/mjcf")]
    after = [with_median(before[0], 1.3), with_median(before[1], 3.0)]
    built = build(run_on(1), [], after, [(run_on(0), before)])
    assert "last run: collar, mujoco/mjcf: median backward error 1.20, now 3.00 (jump)." in built["report.md"]
    [row] = changes_on(built["changes.html"])
    assert row == ["2026-01-02 02:00", "collar", "mujoco/mjcf", "median backward error", "1.20", "3.00", "1", "jump"]
    assert changes_on(built["mechanisms/collar.html"]) == [[row[0], *row[2:]]]
    assert "1.20 to 3.00 in 2 runs, changed in run 2" in built["mechanisms/collar.html"]
    [told] = changes([readings_of_records(records) for records in (before, after)])
    assert [told.before, told.now] == pytest.approx([1.2, 3.0])

    later = build(run_on(2), [], after, [(run_on(0), before), (run_on(1), after)])
    assert "last run: no verdict, version or trend." in later["report.md"] and changes_on(later["changes.html"]) == [row]
    wider = [replace(one, median_bounds=[0.3, 12.0]) for one in after]
    assert not changes_on(build(run_on(1), [], wider, [(run_on(0), before)])["changes.html"])


@pytest.mark.usefixtures("without_charts")
def test_runs_of_another_number_of_states_have_another_trend() -> None:
    before, after = ([with_median(record("collar", "mujoco/mjcf"), median)] for median in (1.2, 3.0))
    built = build(run_on(1), [], after, [(replace(run_on(0), states=50), before)])
    assert 'id="trend"' not in built["changes.html"]


@pytest.mark.usefixtures("without_charts")
def test_markdown_stays_the_same_while_results_do() -> None:
    first = build(run_on(1), CARDS, night(1), [(run_on(0), night(0))])["report.md"]
    second = build(run_on(2), CARDS[::-1], night(2)[::-1])["report.md"]
    assert first != second
    assert first.partition(VOLATILE)[0] == second.partition(VOLATILE)[0]
    assert first.count(VOLATILE) == 1


@pytest.mark.ci
@pytest.mark.usefixtures("without_charts")
def test_markdown_fits_a_screen_however_much_differs() -> None:
    """Sixty lines in the worst of cases: what a list leaves out is counted."""
    systems = [f"system_{number}" for number in range(40)]
    listed = {"verdict": "unstable", "expected": "unstable", "backward_error": 654.0, "expected_link": "a book"}
    known = [record(name, "mujoco/mjcf", expected_reason=f"reason of {name}", **listed) for name in systems]
    wrong = [record(name, f"engine_{name}/mjcf", verdict="disagrees", message="one\ntwo\n") for name in systems]
    benchmark, atlas = test_benchmark_report.sample(), test_hard_report.sample()
    benchmark.problems, atlas.problems = ([f"no number {number}" for number in range(40)] for _ in range(2))
    built = report.build(
        run_on(1), CrossCheckResult(records=[*known, *wrong]), [(run_on(0), [record(name, "lagrange") for name in systems])],
        benchmarks=[(test_benchmark_report.RUN, benchmark)], atlas=(test_hard_report.RUN, atlas),
    )  # fmt: skip
    lines = built["report.md"].splitlines()
    assert len(lines) <= MOST_LINES == 60
    assert "- 34 more, in report.json and on the pages" in lines and "- 26 more, in report.json and on the pages" in lines
    assert lines[-1].endswith("and 114 more.")


def test_json_holds_everything(files: dict[str, str]) -> None:
    document = json.loads(files["report.json"], parse_constant=pytest.fail)
    assert len(document["records"]) == 9 and [system["name"] for system in document["systems"]] == sorted(SYSTEMS)


@pytest.mark.usefixtures("without_charts")
def test_an_empty_run_is_no_success() -> None:
    page = site_of(build(run_on(0), [], []))
    assert "Nothing was compared" in page.text
    assert 'class="result good"' not in build(run_on(0), CARDS, [])["index.html"]


def test_only_mathml_passes_as_mathml() -> None:
    shown = equations('<math xmlns="http://www.w3.org/1998/Math/MathML" onclick="x()"><mi>a</mi><mo>&InvisibleTimes;</mo><mi>b</mi></math>')
    assert shown == "<div><math><mi>a</mi><mo>\u2062</mo><mi>b</mi></math></div>"
    for rest in ("", "a + b", "<math><mi>a</math>", "<math><script>x</script></math>", '<img src="x">'):
        assert equations(rest) is None


def test_writing(tmp_path: Path, files: dict[str, str]) -> None:
    folder = tmp_path / "new" / "reports"
    write(folder, files)
    assert {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()} == set(files)
    with pytest.raises(InvalidInput):
        write(folder / "index.html", files)


FOLDER = "/somewhere/library/"
SIDE = {"file": f"{FOLDER}mjcf/collar.xml", "text": [f'{FOLDER}mjcf/collar.xml:9: <inertial mass="2"> explains it with 1.5']}
CAUSE = Cause(
    system="collar", subject="mujoco/mjcf", inference="the mjcf model is at fault", first_line=SIDE["text"][0], diagnosed="mujoco/mjcf",
    found={"terms": {"sentences": ["gravity: force on <b>x</b> is wrong"]}, "model": SIDE, "textbook": {"file": "a.py", "text": ["m = 2"]}},
)  # fmt: skip


@pytest.mark.usefixtures("without_charts")
def test_a_wrong_record_carries_its_diagnosis_without_the_folders_of_this_machine() -> None:
    causes = [CAUSE, replace(CAUSE, subject="pinocchio/mjcf")]
    wrong = [record("collar", cause.subject, verdict="disagrees", backward_error=1e9) for cause in causes]
    files = build(run_on(0), [card("collar")], wrong, causes=causes)
    page = site_of(files)
    for text in (page.words, files["report.md"]):
        assert "the mjcf model is at fault" in text
        assert "reads the same file" in text
    assert "m = 2" in page.words
    assert 'mjcf/collar.xml:9: <inertial mass="2"> explains it with 1.5' in page.words
    assert "force on <b>x</b> is wrong" in page.words
    told = json.loads(files["report.json"])["causes"]
    assert [cause["diagnosed"] for cause in told] == ["mujoco/mjcf", "mujoco/mjcf"]
    assert told[0]["found"]["model"]["file"] == "mjcf/collar.xml"
    assert not any(FOLDER in text for text in files.values())
