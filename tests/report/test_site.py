"""The site's data: open, with a schema that holds, and enough to compute the pages again."""

from __future__ import annotations

import ast
import bisect
import json
import re
import subprocess
import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import lxml.html
import msgspec
import pytest
from markupsafe import escape
from report.test_hard_report import CASE
from report.test_page import whole
from report.test_report import build, card, night, record, run_on
from rooms import REPOSITORY
from support import pages_of

from harness.report import MODULES, write
from harness.report.benchmarks import BenchmarkSummary
from harness.report.hard_cases import HardSummary
from harness.report.html import badge
from harness.report.site_counts import slugs
from harness.report.site_data import collect, declared, issues, known_findings
from harness.report.summary import Summary
from harness.results.atlas import Atlas
from harness.results.benchmark import Benchmark, EngineFinding
from harness.results.comparison import FilesComparison
from harness.results.cross_check import CrossCheckResult
from harness.results.records import Record
from harness.results.run import Run
from harness.results.site import Site, SiteCount, schema

PACKAGE = Path(__file__).resolve().parents[2] / "harness"


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    write(folder, whole())
    return folder


def collected(run: Run, found: CrossCheckResult, measured: Benchmark | None = None) -> Site:
    return collect(
        run, Summary(run, found), BenchmarkSummary(run, measured or Benchmark()), HardSummary(run, Atlas()), FilesComparison()
    )  # fmt: skip


def site_of(records: list[Record], run: Run | None = None, **parts: Any) -> Site:
    run = run or replace(run_on(0), engines={"mujoco": "4.0.0", "pinocchio": "4.1.0"})
    return collected(run, CrossCheckResult(records=records, **parts))


def rebuild(folder: Path, *options: str) -> subprocess.CompletedProcess[str]:
    """The script as a reader runs it: no package of the harness, and none of its requirements, can be imported."""
    command = [sys.executable, "-I", "-S", str(folder / "rebuild.py"), *options]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.mark.ci
def test_the_data_have_the_types_of_their_schema() -> None:
    site = msgspec.json.decode(whole()["site.json"], type=Site)
    assert len(site.cells) > 9 and {row.kind for row in site.rows} == {"mechanism", "robot"}
    assert json.loads(whole()["site.json"], parse_constant=pytest.fail)


@pytest.mark.ci
def test_the_schema_names_every_field_and_what_numbers_may_be() -> None:
    found = json.loads(schema())
    assert found["$schema"].endswith("2020-12/schema") and found["$ref"] == "#/$defs/Site"
    document = json.loads(whole()["site.json"])
    assert set(found["$defs"]["Site"]["properties"]) == set(document)
    assert set(found["$defs"]["SiteCell"]["properties"]) == set(document["cells"][0])
    options = found["$defs"]["SiteCell"]["properties"]["backward_error"]["anyOf"]
    assert {"type": "number"} in options and {"enum": ["-inf", "inf", "nan"]} in options and {"type": "null"} in options


@pytest.mark.ci
def test_the_script_computes_every_number_of_every_table_of_every_page_again(written: Path) -> None:
    done = rebuild(written, "--json")
    assert done.returncode == 0, done.stderr
    computed = json.loads(done.stdout)
    shown = 0
    for name, text in pages_of(whole()).items():
        for table in lxml.html.fromstring(text).xpath("//table"):
            rows = [[" ".join(cell.text_content().split()) for cell in row] for row in table.xpath("./tbody/tr")]
            assert computed[name][table.get("data-table")] == rows
            shown += sum(bool(re.search(r"\d", cell)) for row in rows for cell in row)
    assert shown > 400 and f"{shown} cells with numbers" in done.stderr


@pytest.mark.parametrize(
    ("name", "said", "instead"),
    [
        ("index.html", "654", "655"),
        ("index.html", "1 of 3", "2 of 3"),
        ("engines/mujoco.html", "1.30", "1.31"),
        ("mechanisms/collar.html", "1.30", "1.03"),
        ("mechanisms/collar.html", "0.200 to 3.00", "0.100 to 3.00"),
        ("hard.html", "2.001", "2.002"),
        ("badges/lagrange.svg", "3 of 3", "2 of 3"),
    ],
)
def test_the_script_finds_a_number_that_a_page_has_wrong(tmp_path: Path, name: str, said: str, instead: str) -> None:
    write(tmp_path, whole())
    page = tmp_path / name
    text = page.read_text()
    body = text.index("<tbody>") if "<tbody>" in text else 0
    assert said in text[body:]
    page.write_text(text[:body] + text[body:].replace(said, instead))
    done = rebuild(tmp_path)
    assert done.returncode == 1 and name in done.stderr


def test_the_modules_of_the_script_give_no_name_to_two_things() -> None:
    given = Counter[str]()
    for name in MODULES:
        body = ast.parse((PACKAGE / name).read_text()).body
        own = {node.name for node in body if isinstance(node, (ast.FunctionDef, ast.ClassDef))}
        given.update(
            own
            | {part.id for node in body if isinstance(node, ast.Assign) for part in ast.walk(node.targets[0]) if isinstance(part, ast.Name)}
        )
    assert [name for name, count in given.items() if count > 1] == []


@pytest.mark.ci
def test_the_script_computes_changes_and_trends_from_the_values_of_the_runs(tmp_path: Path) -> None:
    write(tmp_path, whole())
    assert rebuild(tmp_path).returncode == 0
    data = json.loads((tmp_path / "site.json").read_text())
    [trend] = [one for one in data["trends"] if one["changes"] and one["study"] == "cross-check"]
    trend["values"] = [0.4, 0.4, 0.4, trend["values"][-1]]
    [cost] = [one for one in data["trends"] if one["changes"] and one["study"] == "benchmark"]
    cost["values"] = [value and 2 * value for value in cost["values"]]
    (tmp_path / "site.json").write_text(json.dumps(data))
    told = rebuild(tmp_path).stderr
    assert "says '0.200 to 3.00 in 4 runs, changed in run 4', computed '0.400 to 3.00 in 4 runs, changed in run 4'" in told
    assert "changes.html: table" in told and "says '0.200', computed '0.400'" in told
    assert all(f"{page}: table" in told for page in ("changes.html", "mechanisms/arm_2r.html", "mechanisms/collar.html"))


def test_the_script_computes_verdicts_from_cells_alone(tmp_path: Path) -> None:
    write(tmp_path, whole())
    data = json.loads((tmp_path / "site.json").read_text())
    cell = next(cell for cell in data["cells"] if cell["verdict"] == "agrees" and cell["column"] == "mujoco/mjcf")
    cell |= {"verdict": "disagrees", "outcome": "disagrees", "agrees": False}
    (tmp_path / "site.json").write_text(json.dumps(data))
    told = rebuild(tmp_path).stderr
    assert all(f"index.html: {table}" in told for table in ("table-1", "table-2"))
    assert "engines/mujoco.html" in told and "badges/mujoco-4.0.0.svg" in told


NUMBER = re.compile(r"\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def test_every_other_number_of_a_page_stands_in_the_data_or_in_its_template() -> None:
    """What stands in no table: states, replay commands, programs, messages. Errors are rounded to three digits; counts are left out."""
    files = whole()
    templates = (PACKAGE / "report").glob("*.html")
    known = files["site.json"] + files["report.json"] + "".join(path.read_text() for path in templates)
    numbers = sorted({float(word) for word in NUMBER.findall(known.replace("\\n", " "))})
    for name in ("index.html", "engines/mujoco.html", "mechanisms/collar.html", "robots/arm.urdf.html"):
        page = lxml.html.fromstring(files[name])
        for drawn in page.xpath("//table | //script | //*[local-name()='svg'] | //figure"):
            drawn.drop_tree()
        for word in NUMBER.findall(page.text_content()):
            place = bisect.bisect_left(numbers, float(word) * (1 - 5e-3))
            assert float(word) < 1000 or numbers[place] <= float(word) * (1 + 5e-3), word


def test_versions_of_an_engine_are_columns_and_badges_of_their_own() -> None:
    names = ["mujoco/mjcf", "mujoco/urdf", "mujoco@3.13.0/mjcf"]
    records = [record("collar", name) for name in names]
    records[2] = replace(records[2], verdict="disagrees", backward_error=1e9)
    site = site_of(records)
    columns = {column.name: column for column in site.columns}
    assert [(columns[name].engine, columns[name].version, columns[name].format) for name in names] == [
        ("mujoco", "4.0.0", "mjcf"), ("mujoco", "4.0.0", "urdf"), ("mujoco", "3.13.0", "mjcf"),
    ]  # fmt: skip
    assert {column.page for column in site.columns} == {"engines/mujoco.html"}
    counts = {count.badge: (count.agrees, count.asked) for count in site.counts}
    assert counts == {"badges/mujoco-4.0.0.svg": (2, 2), "badges/mujoco-3.13.0.svg": (0, 1)}


def test_a_badge_says_its_counts_to_everybody() -> None:
    about: dict[str, Any] = {"title": "A", "agrees": 2, "asked": 3, "misreads": 0, "unsupported": 1, "line": "", "badge": "badges/x.svg"}
    count = SiteCount(engine="a<b", version="1.0", tone="unstable", **about)
    root = lxml.html.fromstring(badge(count))
    assert root.get("role") == "img" and root.get("aria-label") == "a<b 1.0: 2 of 3 agree"
    assert "a<b 1.0" in root.text_content() and "2 of 3 agree" in root.text_content()
    misreads = badge(replace(count, misreads=1, tone="misreads"))
    assert "2 of 3 agree, 1 misread<" in misreads and "#b3141d" in misreads and "#b3141d" not in badge(count)


@pytest.mark.usefixtures("without_charts")
def test_the_index_opens_with_a_line_for_each_engine_and_the_harness_own_code_is_none() -> None:
    reason = {"expected_reason": "it passes over frames", "features": ["frames"]}
    records = [
        record("arm_2r", "lagrange"),
        record("arm_2r", "mujoco/mjcf"),
        record("bar_pendulum", "mujoco/mjcf", from_rigid=2.58, features=["loops"]),
        record("collar", "mujoco/mjcf", verdict="unstable", expected="unstable", backward_error=654.0),
        record("collar", "pinocchio/mjcf", verdict="misreads", expected="misreads", backward_error=1e12, **reason),
    ]
    files = build(
        replace(run_on(0), engines={"mujoco": "4.0.0"}, titles={"mujoco": "MuJoCo", "pinocchio": "Pinocchio"}), [card("collar")], records
    )
    page = lxml.html.fromstring(files["index.html"])
    lines = page.xpath("//header/h1/following-sibling::*[1]//table//tbody/tr")
    assert [" ".join(line.text_content().split()) for line in lines] == [
        "MuJoCo 4.0.0right on 2 of 3 MJCF mechanisms; loses digits on collar; loops soft, as documented (accelerations 258 % from rigid "
        "ones, 1 mechanism)",
        "Pinocchioright on 0 of 1 MJCF mechanism; misreads collar",
    ]
    assert [line.find(".//a").get("class") for line in lines] == ["verdict unstable", "verdict misreads"]
    [told] = page.xpath("//p[contains(@class, 'result')]")
    assert " ".join(told.text_content().split()) == (
        "5 pairs: 3 agree (1 soft, as documented), 2 differ for a known reason, 0 unexpectedly. 1 misreads 1 unstable"
    )
    heads = [head.text_content() for head in page.xpath("//table[contains(@class, 'verdicts')]/thead//th")]
    assert heads == ["mechanism or robot", "mujoco/mjcf (4.0.0)", "pinocchio/mjcf"]
    assert "engines/lagrange.html" in page.xpath("//main//a/@href") and "0 of 1 agree, 1 misread" in files["badges/pinocchio.svg"]
    cells = {cell.get("id"): (cell.get("class"), cell.text_content()) for cell in page.xpath("//table[contains(@class, 'verdicts')]//td")}
    assert cells["cell-bar_pendulum--mujoco-mjcf"] == ("declared", "soft, as documented 258 % from rigid, 1.30")
    assert cells["cell-collar--pinocchio-mjcf"] == ("misreads", "misreads 1.00e+12, as expected")
    words = [item.text_content() for item in page.xpath("//ul[contains(@class, 'key')]/li/span")]
    assert words == ["agrees", "soft, as documented", "unstable", "misreads"]


def test_what_readings_explain_is_not_green_and_has_its_word_in_the_legend() -> None:
    page = lxml.html.fromstring(whole()["index.html"])
    explained = [cell for cell in page.xpath("//table[contains(@class, 'verdicts')]//td") if cell.text_content().startswith("explained")]
    assert explained and all(cell.get("class") == "explained" and cell.get("data-agrees") == "no" for cell in explained)
    assert "explained" in [item.text_content() for item in page.xpath("//ul[contains(@class, 'key')]/li/span")]


def lines_of(*records: Record) -> dict[tuple[str, str], str]:
    return {(line.feature, line.column): line.line for line in site_of(list(records)).features}


def test_a_feature_has_a_line_for_each_subject_from_its_records() -> None:
    soft = [record(name, "mujoco/mjcf", features=["loops", "springs"], from_rigid=size) for name, size in (("a", 0.01), ("b", 0.018))]
    refused = record("c", "pinocchio/mjcf", features=["loops"], verdict="unsupported", expected="unsupported", backward_error=None,
                     expected_reason="no loops here")  # fmt: skip
    assert lines_of(*soft, refused, record("d", "lagrange")) == {
        ("loops", "mujoco/mjcf"): "soft, 1.4e-02 from rigid at the file's settings; agrees with what its engine documents on 2 of 2, "
        "worst 1.30",
        ("springs", "mujoco/mjcf"): "agrees on 2 of 2, worst 1.30",
        ("loops", "pinocchio/mjcf"): "unsupported on 1 of 1: no loops here",
    }  # fmt: skip


def test_another_quantity_is_a_feature() -> None:
    assert lines_of(record("a", "mujoco/mjcf", quantity="reactions")) == {("reactions", "mujoco/mjcf"): "agrees on 1 of 1, worst 1.30"}


@pytest.mark.ci
def test_other_quantities_have_a_table_of_their_own_on_the_page_of_their_mechanism(tmp_path: Path) -> None:
    wrong = record(
        "collar", "mujoco/mjcf", quantity="mass_matrix", verdict="disagrees", message="Farthest off is the entry.", replay="again"
    )
    silent = {"verdict": "unsupported", "expected": "unsupported", "backward_error": None}
    further = [wrong, record("collar", "mujoco/mjcf", quantity="energy"), record("collar", "lagrange", quantity="energy", **silent)]
    records = [record("collar", "mujoco/mjcf"), record("collar", "lagrange"), *further]
    site = site_of(records)
    assert [(count.engine, count.agrees, count.asked) for count in site.counts] == [("lagrange", 1, 1), ("mujoco", 1, 1)]
    assert {(cell.column, cell.quantity) for cell in site.cells} == {("mujoco/mjcf", "accelerations"), ("lagrange", "accelerations")}
    assert {(cell.column, cell.quantity, cell.verdict) for cell in site.quantities} == {
        ("mujoco/mjcf", "mass_matrix", "disagrees"), ("mujoco/mjcf", "energy", "agrees"), ("lagrange", "energy", "unsupported"),
    }  # fmt: skip
    files = build(run_on(0), [card("collar")], records)
    page = lxml.html.fromstring(files["mechanisms/collar.html"])
    [table] = [one for one in page.iter("table") if "Other quantities on collar" in one.text_content()]
    rows = [[" ".join(cell.text_content().split()) for cell in row] for row in table.find("tbody")]
    assert rows == [
        ["energy", "unsupported as expected", "agrees 1.30"],
        ["mass_matrix", "not asked", "✗ disagrees 1.30, expected: agrees"],
    ]
    assert "Farthest off is the entry." in files["mechanisms/collar.html"]
    assert "**collar, mujoco/mjcf, mass_matrix: disagrees**" in files["report.md"] and "Farthest off is the entry." in files["report.md"]
    index = lxml.html.fromstring(files["index.html"])
    assert "1 of 3 answers for further quantities differs unexpectedly" in index.text_content()
    assert index.xpath('//ul[@class="unexpected"]//a/@href') == ["mechanisms/collar.html#quantities"]
    write(tmp_path, files)
    done = rebuild(tmp_path)
    assert done.returncode == 0, done.stderr
    # The script notices a table that says something else.
    path = tmp_path / "mechanisms" / "collar.html"
    path.write_text(path.read_text().replace("✗ disagrees", "✗ unstable"))
    assert "mechanisms/collar.html" in rebuild(tmp_path).stderr


def finding(system: str, error: float | None, program: str) -> EngineFinding:
    return EngineFinding(system=system, method="pinocchio lcaba", statement=f"on {system}", backward_error=error, reproducer=program)


def test_a_finding_is_told_once_by_its_worst_and_shortest_program() -> None:
    measured = Benchmark(findings=[finding("a", 1e5, "aa"), finding("b", None, "bbb"), finding("c", None, "cc")])
    [told] = collected(run_on(0), CrossCheckResult(), measured).findings
    assert (told.engine, told.way, told.row, told.rows, told.reproducer) == ("pinocchio", "lcaba", "c", ["a", "b", "c"], "cc")


def test_a_red_cell_carries_its_reason_its_replay_and_its_program() -> None:
    wrong = record("collar", "mujoco/mjcf", verdict="unstable", expected="unstable", expected_reason="small pivots", backward_error=4.5e3)
    site = site_of([wrong], worst_cases=[CASE])
    [cell] = site.cells
    assert (cell.reason, cell.replay, cell.reproducer, cell.page) == (
        "small pivots", wrong.replay, CASE.reproducer, "mechanisms/collar.html#mujoco-mjcf"
    )  # fmt: skip
    # Beside what is known of the engine anyway.
    [told] = [one for one in site.findings if one not in known_findings()]
    assert told.statement == "small pivots" and told.reproducer == CASE.reproducer
    files = build(run_on(0), [card("collar")], [wrong], worst_cases=[CASE])
    for name in ("mechanisms/collar.html", "engines/mujoco.html"):
        assert CASE.reproducer.splitlines()[0] in files[name] and "mall pivots" in files[name]


@pytest.mark.ci
def test_what_is_known_of_an_engine_beside_the_mechanisms_is_on_its_page() -> None:
    known = [one for one in known_findings() if one.engine == "drake"]
    assert known
    files = build(run_on(0), [], [record("arm_2r", "drake/urdf"), *night(0)[:3]])
    for one in known:
        assert one.link in files["engines/drake.html"] and escape(one.statement) in files["engines/drake.html"]
        assert one.link not in files["engines/mujoco.html"]
    assert {one.engine for one in site_of([record("arm_2r", "drake/urdf")]).findings} == {"drake"}
    assert site_of([record("arm_2r", "lagrange")]).findings == []


def test_what_trackers_say_is_dated_and_has_a_state() -> None:
    assert declared()
    for one in declared():
        assert one.state in ("open", "closed", "merged") and re.fullmatch(r"\d{4}-\d\d-\d\d", one.seen)
        assert re.fullmatch(r"https://github\.com/[\w-]+/[\w-]+/(issues|pull)/\d+", one.link) and one.title
        assert bool(one.feature) != bool(one.way)
    assert issues("pinocchio", ["mimic joints"]) and not issues("lagrange", ["mimic joints"])


@pytest.mark.ci
def test_issues_stand_where_a_cell_is_red_and_on_the_page_of_its_engine() -> None:
    [issue] = issues("pinocchio", ["mimic joints"])
    about = {"verdict": "unsupported", "expected": "unsupported", "backward_error": None, "features": ["mimic joints"]}
    files = build(run_on(0), [], [record("collar", "pinocchio/urdf", **about), *night(0)[:3]])
    assert issue.link in files["mechanisms/collar.html"] and issue.link in files["engines/pinocchio.html"]
    assert issue.link not in files["mechanisms/arm_2r.html"] and issue.link not in files["engines/mujoco.html"]


@pytest.mark.ci
def test_a_text_for_a_tracker_is_a_page_and_what_is_none_stays_words() -> None:
    link, missing, outside = "docs/issues/pinocchio-mjcf-ref.md", "docs/issues/none.md", "docs/issues/../inside/numerics.md"
    entries = [
        record(system, "pinocchio/mjcf", verdict="misreads", expected="misreads", expected_reason=f"Known {place}.", expected_link=place)
        for system, place in (("arm_2r", link), ("collar", missing), ("bar_pendulum", outside), ("scara", "Featherstone (2004)"))
    ]
    files = build(run_on(0), [], entries)
    page = files["differences.html"]
    assert [one for one in files if one.startswith("issues/")] == ["issues/pinocchio-mjcf-ref.html"]
    assert page.count('href="issues/') == 1 and f'<a href="issues/pinocchio-mjcf-ref.html" rel="noreferrer">{link}</a>' in page
    assert all(f"Source: {place}." in page for place in (missing, outside, "Featherstone (2004)"))
    text = (REPOSITORY / link).read_text(encoding="utf-8")
    words = lxml.html.fromstring(files["issues/pinocchio-mjcf-ref.html"]).xpath("//pre")[0].text_content()
    assert words.strip() == text.partition("\n")[2].strip()


def test_addresses_differ_whatever_a_file_system_makes_of_case() -> None:
    found = slugs(["a/b", "a b", "A-B", "", "..", "mujoco@3.13.0/mjcf"])
    words = [word.casefold() for word in found.values()]
    assert len(set(words)) == len(words) and found["mujoco@3.13.0/mjcf"] == "mujoco@3.13.0-mjcf"
    assert all(re.fullmatch(r"[A-Za-z0-9_@-][A-Za-z0-9_.@-]*", word) for word in found.values())
