"""Findings of a check and of a comparison as scripts and notebooks get them: they print with the answer first."""

from __future__ import annotations

from html import escape

from harness.results.check_conclusion import conclusion, with_short_names
from harness.results.comparison import FilesComparison
from harness.results.records import Records


class CheckedRecords(Records):
    """Records of a check; they print as ``harness check`` does, and a notebook shows a table."""

    @property
    def conclusion(self) -> str:
        """Numbers of answers that agree, and those that differ, in a sentence."""
        return f"{conclusion(with_short_names(self))}."

    def __str__(self) -> str:
        return f"{self.conclusion}\n\n{Records(with_short_names(self))}"

    __repr__ = __str__

    def _repr_html_(self) -> str:
        return f"<p>{escape(self.conclusion)}</p>{Records(with_short_names(self))._repr_html_()}"


class ComparedFiles(FilesComparison):
    """Records of files, engines and pairs of files; it prints as ``harness compare`` does, and a notebook shows its tables."""

    def __repr__(self) -> str:
        from harness.report.comparison import answers

        return "\n\n".join(map(str, answers(self)))

    def _repr_html_(self) -> str:
        from harness.report.comparison import answers, html_of

        return html_of(answers(self))
