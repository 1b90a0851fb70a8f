"""The documentation as a site: an example for every reading, pages that need no network, and pages that everybody can read."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from browser import Browser
from comparison.robots import meant_by, record_of
from documents import DOCS
from rooms import REPOSITORY
from support import InThisProcess, completed

sys.path.insert(0, str(DOCS / "hooks"))

from hook import fetched
from pages import commands, findings, messages, schemas
from pages.findings import effect_of, example_of

from harness.comparison.robot_library import RobotLibrary
from harness.comparison.switched_on import judge_switched_on
from harness.crosscheck.run import CrossCheck
from harness.crosscheck.settings import Settings
from harness.explain.changes.readings import Reading, find_all
from harness.results.readings import FELT

AXE = os.environ.get("HARNESS_AXE")


def by_page() -> dict[str, list[Reading]]:
    found: dict[str, list[Reading]] = {}
    for reading in find_all():
        found.setdefault(reading.page, []).append(reading)
    return found


PAGES = by_page()


# Findings


@pytest.mark.ci
@pytest.mark.parametrize("page", PAGES)
def test_a_reading_has_an_example_that_it_moves(page: str) -> None:
    effect = effect_of(PAGES[page])
    assert effect.page == page and effect.lines
    assert effect.alone is None or effect.alone > FELT


@pytest.mark.ci
@pytest.mark.parametrize("page", [page for page, readings in PAGES.items() if readings[0].engine in ("mujoco", "pinocchio")])
def test_an_example_is_what_the_installed_engine_does(page: str) -> None:
    path, reading = example_of(PAGES[page])
    if reading.quantity:
        library = RobotLibrary.of([str(path)])
        study = CrossCheck(Settings(library=library, subjects=[f"{reading.engine}/mjcf"], states=20, examples=None), [reading.quantity])
        (found,) = completed(study, InThisProcess()).records
        assert found.verdict == ("misreads" if reading.is_misread else "explained") and reading.name in [one.name for one in found.readings]
        return
    record = record_of(path, reading.engine)
    if reading.versions:
        assert reading.name not in [one.name for one in record.readings]
    else:
        switched_on = judge_switched_on(meant_by(path), reading.engine)
        assert record.explained and reading.name in [one.name for one in (*record.readings, *switched_on.readings)], record


def test_no_example_is_left_over() -> None:
    used = {example_of(readings)[0] for readings in PAGES.values()}
    assert sorted({*findings.EXAMPLES.iterdir()} - used) == []
    assert max(len(path.read_text().splitlines()) for path in used) <= 11


@pytest.mark.ci
def test_every_finding_has_a_page_and_pages_have_different_names() -> None:
    made = findings.pages()
    assert {f"findings/{page}.md" for page in PAGES} < made.files.keys()
    assert len(made.files) == len(PAGES) + findings.KNOWN.read_text().count("[[finding]]") + 1


# Reference


def test_the_reference_has_every_command_with_its_options() -> None:
    text = str(commands.pages().files["reference/commands.md"])
    for heading in ("## harness compare", "## harness upgrade", "## harness engines"):
        assert f"\n{heading}\n" in text
    assert "`--without JOINT`" in text and "harness compare robot.urdf --steps 100" in text


@pytest.mark.ci
def test_messages_are_those_of_the_source() -> None:
    text = str(messages.pages().files["reference/messages.md"])
    assert "which the system needs" in text
    assert text.count("\n- ") > 100


def test_a_schema_of_every_document_has_its_fields() -> None:
    made = schemas.pages().files
    assert len(made) == len(schemas.DOCUMENTS) + 2
    assert "| `page` | string |" in str(made["reference/json.md"])


# Pages


@pytest.mark.parametrize(
    ("html", "found"),
    [
        ('<script src="https://cdn.example/x.js"></script>', ["https://cdn.example/x.js"]),
        ('<link rel="stylesheet" href="//fonts.example/f.css">', ["//fonts.example/f.css"]),
        ('<img src="../a.svg"><a href="https://example.org">a</a><link rel="canonical" href="https://example.org/">', []),
    ],
)
def test_what_a_page_fetches_is_found(html: str, found: list[str]) -> None:
    assert fetched(html) == found


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(folder)]
    done = subprocess.run(
        command, cwd=REPOSITORY, env=os.environ | {"NO_MKDOCS_2_WARNING": "1"}, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


SHOWN = [
    "index.html", "start/robot.html", "start/tutorial.html", "how-to/ci.html", "findings/index.html",
    "findings/pinocchio-joint-damping.html",
    "concepts/verdicts.html", "concepts/comparison.html", "reference/commands.html", "reference/python.html", "reference/json.html",
    "gallery/mechanisms.html", "inside/numerics.html",
]  # fmt: skip


@pytest.mark.nightly
@pytest.mark.skipif(AXE is None, reason="needs HARNESS_AXE")
@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1400, 390])
@pytest.mark.parametrize("page", SHOWN)
def test_a_page_can_be_read_by_everybody(browser: Browser, site: Path, page: str, width: int, scheme: str) -> None:
    browser.show(site / page, width, scheme)
    browser.run(f"{Path(str(AXE)).read_text()};true")
    found = browser.run("axe.run().then(found => found.violations.map(v => [v.impact, v.id, v.nodes.map(n => n.html).slice(0, 3)]))")
    assert found == []
