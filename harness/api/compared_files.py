"""A comparison of robots' files as scripts and notebooks get it."""

from __future__ import annotations

from harness.results.comparison import FilesComparison


class ComparedFiles(FilesComparison):
    """Records of files, engines and pairs of files; it prints as ``harness compare`` does, and a notebook shows its tables."""

    def __repr__(self) -> str:
        from harness.report.comparison import answers

        return "\n\n".join(map(str, answers(self)))

    def _repr_html_(self) -> str:
        from harness.report.comparison import answers, html_of

        return html_of(answers(self))
