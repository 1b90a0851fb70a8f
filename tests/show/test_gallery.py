"""Pictures in the report: drawn by workers, kept with the run, shown beside each system."""

from __future__ import annotations

from pathlib import Path

import lxml.html
import pytest
from catalogue import BUILT_IN
from support import InThisProcess, completed, harness, make_library

from harness.report.markup import picture
from harness.results.cross_check import CrossCheckResult
from harness.results.history import History
from harness.show.gallery import Gallery

DYING = """
from harness.engines import Engine

class Engine(Engine):
    requires = ("numpy", "numpy")
    formats = ("mjcf",)

    def load(self, source, joints, gravity):
        raise RuntimeError("no model today")

ENGINE = Engine()
"""


def test_a_system_that_an_engine_can_place_has_a_picture() -> None:
    found = completed(Gallery(BUILT_IN, ["collar", "rolling_disc", "heavy_top"]), InThisProcess())
    assert [drawn.system for drawn in found.pictures] == ["collar", "heavy_top"]
    for drawn in found.pictures:
        shown = picture(drawn.svg)
        assert shown is not None and shown.count("<path") == drawn.svg.count("<path") and shown.count(" tint-") == drawn.svg.count("style=")
        assert "style=" not in shown
        assert len(drawn.svg) < 20_000


def test_what_died_in_the_cross_check_is_not_asked_for_a_picture() -> None:
    crashes = {("collar", "mjcf"), ("collar", "pinocchio/urdf"), ("spring_damper", None), ("heavy_top", "mujoco/mjcf")}
    study = Gallery(BUILT_IN, ["collar", "spring_damper", "heavy_top"], crashes)
    [task] = study.tasks()
    assert task.arguments[1] == "heavy_top" and [str(subject) for subject in task.arguments[2]] == ["pinocchio/urdf"]


@pytest.mark.ci
def test_the_report_shows_pictures(tmp_path: Path) -> None:
    library = make_library(tmp_path / "library", ["spring_damper"], {"another": DYING})
    done = harness("report", "--library", str(library), "--out", "out", cwd=tmp_path)
    assert "Traceback" not in done.stderr
    page = lxml.html.fromstring((tmp_path / "out" / "mechanisms" / "spring_damper.html").read_text())
    [drawing] = page.xpath("//main//section//*[local-name()='svg'][@class='mechanism']")
    assert "slide" in drawing[0].text_content()
    with History(tmp_path / "out" / "history.sqlite") as history:
        assert len(history.read(1, CrossCheckResult).pictures) == 1
