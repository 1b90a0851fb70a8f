"""The page in a browser: nothing wider than the window, and no violation of accessibility rules.

``HARNESS_AXE`` names ``axe.min.js`` of the npm package axe-core; without it, the test of the rules is skipped.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from browser import CHROMIUM, DRAWN, Browser
from report.test_page import pages
from support import harness

AXE = os.environ.get("HARNESS_AXE")
GRAVE = ("serious", "critical")


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    if CHROMIUM is None:
        pytest.skip("needs Chromium, which is no Python package")
    with Browser() as found:
        yield found


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with every kind of page."""
    made = tmp_path_factory.mktemp("pages")
    for name, text in pages().items():
        (made / f"{name}.html").write_text(text)
    assert harness("show", "cart_pendulum", "--html", "show.html", cwd=made).returncode == 0
    return made


@pytest.fixture(params=["whole", "benchmark and atlas", "nothing", "show"])
def page(request: pytest.FixtureRequest, folder: Path) -> Path:
    return folder / f"{request.param}.html"


# Whatever a click opens is looked at too.
OPEN = "document.querySelectorAll('details').forEach(part => part.open = true)"


@pytest.mark.nightly
@pytest.mark.parametrize("width", [1400, 390])
def test_a_page_is_no_wider_than_its_window(browser: Browser, page: Path, width: int) -> None:
    browser.show(page, width, "light", DRAWN)
    browser.run(OPEN)
    assert browser.run("document.documentElement.scrollWidth") <= width


@pytest.mark.nightly
@pytest.mark.skipif(AXE is None, reason="needs HARNESS_AXE")
@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [1400, 390])
def test_a_page_can_be_read_by_everybody(browser: Browser, page: Path, width: int, scheme: str) -> None:
    browser.show(page, width, scheme, DRAWN)
    browser.run(OPEN)
    browser.run(f"{Path(str(AXE)).read_text()};true")
    found = browser.run("axe.run().then(found => found.violations.map(v => [v.impact, v.id, v.nodes.map(n => n.html).slice(0, 3)]))")
    assert not [violation for violation in found if violation[0] in GRAVE]


@pytest.mark.nightly
def test_charts_are_drawn_in_the_browser(browser: Browser, folder: Path) -> None:
    browser.show(folder / "whole.html", 1400, "light", DRAWN)
    places = browser.run("document.querySelectorAll('[data-root-id]').length")
    assert places > 10 and browser.run("[...document.querySelectorAll('[data-root-id]')].every(place => place.firstElementChild)")


@pytest.mark.nightly
def test_the_page_of_the_built_in_library_has_less_than_2_mb(tmp_path: Path) -> None:
    harness("report", "--out", "out", cwd=tmp_path, isolated=True)
    assert (tmp_path / "out" / "index.html").stat().st_size < 2_000_000
