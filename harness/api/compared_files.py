"""A comparison of robots' files as scripts and notebooks get it."""

from __future__ import annotations

from harness.results.comparison import FilesComparison


class ComparedFiles(FilesComparison):
    """Records of files, engines and pairs of files; it prints as ``harness compare`` does, and a notebook shows its tables."""

    def __repr__(self) -> str:
        from harness.report.comparison import sections

        return "\n\n".join(map(str, sections(self)))

    def _repr_html_(self) -> str:
        from harness.report.comparison import html_of, sections

        return html_of(sections(self))
