"""Pictures in the report: drawn by workers, kept with the run, shown beside each system."""

from __future__ import annotations

from pathlib import Path

import lxml.html
from catalogue import BUILT_IN
from support import InThisProcess, completed, harness, make_library

from harness.report.html import picture
from harness.results.cross_check import CrossCheckResult
from harness.results.history import History
from harness.show.gallery import Gallery

DYING = """
class Engine:
    requires = ("numpy", "numpy")
    formats = ("mjcf",)

    def load(self, source, joints, gravity):
        raise RuntimeError("no model today")

ENGINE = Engine()
"""


def test_a_system_that_an_engine_can_place_has_a_picture() -> None:
    found = completed(Gallery(BUILT_IN, ["collar", "cycloid_bead", "heavy_top"]), InThisProcess())
    assert [drawn.system for drawn in found.pictures] == ["collar", "heavy_top"]
    for drawn in found.pictures:
        shown = picture(drawn.svg)
        assert shown is not None and shown.count("<path") == drawn.svg.count("<path") and shown.count("style=") == drawn.svg.count("style=")
        assert len(drawn.svg) < 20_000


def test_the_report_shows_pictures_and_the_trend_of_each_pair(tmp_path: Path) -> None:
    library = make_library(tmp_path / "library", ["spring_damper"], {"another": DYING})
    for _ in range(2):
        done = harness("report", "--library", str(library), "--out", "out", cwd=tmp_path)
    assert "Traceback" not in done.stderr
    page = lxml.html.fromstring((tmp_path / "out" / "index.html").read_text())
    [drawing] = page.xpath("//main//section//*[local-name()='svg'][@class='mechanism']")
    assert "slide" in drawing[0].text_content()
    trends = page.xpath("//section//td//*[local-name()='svg'][@class='trend']/@aria-label")
    assert len(trends) == 6 and sum("2 runs" in trend for trend in trends) == 5
    with History(tmp_path / "out" / "history.sqlite") as history:
        assert len(history.read(1, CrossCheckResult).pictures) == 1
