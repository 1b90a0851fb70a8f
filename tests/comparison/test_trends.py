"""What is followed from survey to survey: the worst backward error after readings."""

from __future__ import annotations

from harness.report.sparkline import Sparkline
from harness.report.survey import survey_sections
from harness.results.comparison import FileRecord, FilesComparison, SubjectRecord
from harness.results.detail import Detail
from harness.results.survey_conclusion import trends
from harness.verdict import Verdict


def survey(**errors: tuple[float | None, float | None]) -> FilesComparison:
    """Of robots with (backward error, what is left of it after readings)."""
    subjects = [
        SubjectRecord(
            path=f"{name}.urdf",
            engine="pinocchio",
            format="urdf",
            aided=False,
            call="",
            verdict=Verdict.AGREES if left is None else Verdict.DISAGREES,
            explained=True,
            backward_error=error,
            left=left,
        )
        for name, (error, left) in errors.items()
    ]
    return FilesComparison(files=[FileRecord(path=f"{name}.urdf", format="urdf") for name in errors], subjects=subjects)


def test_trends_follow_what_is_left_after_readings() -> None:
    before = [survey(arm=(1e9, 3.0), gone=(1.0, None)), survey(arm=(2.0, None), leg=(None, None))]
    found = trends(before, survey(arm=(1e9, 4.0), leg=(5.0, None), new=(None, None)))
    kept = {path: values for (path, _, _), values in found.items()}
    assert kept == {"arm.urdf": [3.0, 2.0, 4.0], "leg.urdf": [5.0], "new.urdf": []}


def test_a_survey_shows_a_trend_once_there_is_an_earlier_one() -> None:
    now = survey(arm=(1e9, 4.0), new=(None, None))
    pages = {file.path: f"robots/{file.path}.html" for file in now.files}
    assert all(section.title != "Trend" for section in survey_sections(now, Detail.VERBOSE, None, pages))
    (section,) = [
        section for section in survey_sections(now, Detail.VERBOSE, None, pages, [survey(arm=(2.0, None))]) if section.title == "Trend"
    ]
    (table,) = section.parts
    ((robot, line),) = table.rows  # type: ignore[union-attr]
    assert robot.value == "arm.urdf" and robot.link == "robots/arm.urdf.html" and isinstance(line, Sparkline) and line.values == [2.0, 4.0]
