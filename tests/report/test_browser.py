"""The page in a browser: nothing wider than the window, and no violation of accessibility rules.

``HARNESS_AXE`` names ``axe.min.js`` of the npm package axe-core; without it, the test of the rules is skipped.
"""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from browser import DRAWN, Browser
from report.test_page import SHOWN, SYSTEMS, sites
from support import harness

from harness.report import write

AXE = os.environ.get("HARNESS_AXE")
GRAVE = ("serious", "critical")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a folder for each site, and the page of a mechanism that stands alone."""
    made = tmp_path_factory.mktemp("pages")
    for name, files in sites().items():
        write(made / name, files)
    assert harness("show", "cart_pendulum", "--html", "show.html", cwd=made).returncode == 0
    return made


@pytest.fixture(params=[*("/".join(shown) for shown in SHOWN), "show.html"])
def page(request: pytest.FixtureRequest, folder: Path) -> Path:
    return folder / request.param


@pytest.mark.nightly
def test_a_page_does_nothing_that_its_policy_refuses(browser: Browser, page: Path) -> None:
    browser.show(page, 1280, "light", DRAWN)
    assert browser.refusals() == []


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
@pytest.mark.parametrize(
    ("name", "least"),
    [("differences.html", 1), ("changes.html", 1), ("mechanisms/collar.html", 5), ("benchmark.html", 2), ("hard.html", 2)],
)
def test_charts_are_drawn_in_the_browser(browser: Browser, folder: Path, name: str, least: int) -> None:
    browser.show(folder / "whole" / name, 1400, "light", DRAWN)
    assert browser.run("document.querySelectorAll('[data-root-id]').length") >= least
    assert browser.run("[...document.querySelectorAll('[data-root-id]')].every(place => place.firstElementChild)")


VISIBLE = "[...document.querySelectorAll('table.verdicts tbody tr')].filter(row => !row.hidden).map(row => row.cells[0].innerText.trim())"
ADDRESS = "decodeURIComponent(location.hash)"


def choose(field: str, value: str) -> str:
    """A script that sets a field of the filter as a person does."""
    return (
        f"(() => {{ const field = document.getElementById('filter').elements['{field}']; field.value = '{value}';"
        " field.dispatchEvent(new Event('input', {bubbles: true})); })()"
    )


@pytest.fixture(params=[1400, 390])
def index(request: pytest.FixtureRequest, browser: Browser, folder: Path) -> Path:
    """The index, shown at the widths of a desk and of a phone."""
    found = folder / "whole" / "index.html"
    browser.show(found, request.param, "light", DRAWN)
    return found


@pytest.mark.nightly
def test_a_filter_stands_in_the_address_which_brings_it_back(browser: Browser, index: Path) -> None:
    everything = browser.run(VISIBLE)
    assert set(SYSTEMS) < set(everything)
    browser.run(choose("verdict", "surprise"))
    assert browser.run(VISIBLE) == ["bar_pendulum", "collar"]
    browser.run(choose("name", "coll"))
    assert browser.run(VISIBLE) == ["collar"] and "1 of" in browser.run("document.getElementById('shown').innerText")
    fragment = browser.run("location.hash")
    assert fragment == browser.run("document.getElementById('permalink').getAttribute('href')")
    browser.show(index, 1400, "light", DRAWN, fragment)
    assert browser.run(VISIBLE) == ["collar"]
    assert browser.run("document.getElementById('filter').elements.verdict.value") == "surprise"
    browser.run("document.querySelector('#filter button').click()")
    browser.until(f"{VISIBLE}.length > 1")
    assert browser.run(VISIBLE) == everything and "name=" not in browser.run(ADDRESS)


@pytest.mark.nightly
def test_arrow_keys_go_from_cell_to_cell_and_the_address_leads_back_to_it(browser: Browser, index: Path) -> None:
    browser.run("document.querySelector('#cell-arm_2r--mujoco-mjcf a').focus()")
    for key, code in (("ArrowDown", 40), ("ArrowRight", 39)):
        browser.press(key, code)
    focused = "document.activeElement.closest('td')?.id"
    assert browser.run(focused) == "cell-bar_pendulum--pinocchio-urdf"
    fragment = browser.run("location.hash")
    assert "cell=cell-bar_pendulum--pinocchio-urdf" in fragment
    browser.show(index, 390, "light", DRAWN, fragment)
    assert browser.run(focused) == "cell-bar_pendulum--pinocchio-urdf"
    place = browser.run("(box => [box.top, box.bottom, innerHeight])(document.activeElement.getBoundingClientRect())")
    assert 0 <= place[0] < place[1] <= place[2]
    browser.press("ArrowLeft", 37)
    browser.press("ArrowLeft", 37)
    assert browser.run("document.activeElement.closest('th')?.innerText") == "bar_pendulum"


@pytest.mark.nightly
def test_a_link_of_a_cell_leads_to_the_place_where_it_is_told(browser: Browser, index: Path) -> None:
    browser.run("document.querySelector('#cell-collar--mujoco-mjcf a').click()")
    browser.until("location.pathname.endsWith('/mechanisms/collar.html') && document.readyState == 'complete'")
    assert browser.run("location.hash") == "#mujoco-mjcf"
    told = browser.run("document.querySelector(':target').parentElement.innerText")
    assert "harness check collar --subject mujoco/mjcf" in told and "FatalError" in told


@pytest.mark.nightly
def test_two_columns_are_compared(browser: Browser, index: Path) -> None:
    browser.run(choose("a", "pinocchio/urdf"))
    assert not browser.run("document.getElementById('compared').innerText")
    browser.run(choose("b", "mujoco/mjcf"))
    told = browser.run("document.getElementById('compared').innerText")
    assert "3 of 3 rows that were asked of both differ" in told
    rows = browser.run("[...document.querySelectorAll('#compared tbody tr')].map(row => row.innerText.replace(/\\s+/g, ' ').trim())")
    assert [row.split()[0] for row in rows] == ["arm_2r", "bar_pendulum", "collar"] and all(row.endswith("verdict") for row in rows)
    assert "unstable" in rows[0] and "654" in rows[0] and "error" in rows[2]
    assert browser.run("document.documentElement.scrollWidth <= innerWidth")
    fragment = browser.run("location.hash")
    browser.show(index, 390, "dark", DRAWN, fragment)
    assert browser.run("document.getElementById('compared').innerText") == told


@pytest.mark.nightly
def test_an_address_that_somebody_made_up_breaks_nothing(browser: Browser, index: Path) -> None:
    everything = browser.run(VISIBLE)
    browser.show(index, 1400, "light", DRAWN, "#?verdict=nonsense&a=%3Cimg%3E&cell=filter&kind=x")
    assert browser.run(VISIBLE) == everything and not browser.run("document.querySelector('#compared img')")


@pytest.mark.nightly
def test_each_page_of_the_built_in_library_has_less_than_3_mb_and_the_index_fits_seven_windows(tmp_path: Path, browser: Browser) -> None:
    harness("report", "--out", "out", cwd=tmp_path, isolated=True)
    browser.show(tmp_path / "out" / "index.html", 1280, "light", DRAWN)
    assert browser.run("document.documentElement.scrollHeight") <= 6000
    assert len((tmp_path / "out" / "report.md").read_text().splitlines()) <= 60
    shared = sum((tmp_path / "out" / name).stat().st_size for name in ("bokeh.js", "charts.js", "site.js", "style.css"))
    sizes = {path: path.stat().st_size for path in (tmp_path / "out").rglob("*.html")}
    assert len(sizes) > 60 and max(sizes.values()) + shared < 3_000_000
