"""The notebook of the tutorial as a page: its text, its code, and no output, which it has only where it is run."""

from __future__ import annotations

import nbformat

from pages.made import DOCS, Made, fenced

SECTION = "Start"
NOTEBOOK = "start/tutorial.ipynb"


def pages() -> Made:
    """The page; the notebook itself lies beside it."""
    notebook = nbformat.read(DOCS / NOTEBOOK, as_version=4)
    cells = [cell.source if cell.cell_type == "markdown" else fenced(cell.source, "python") for cell in notebook.cells]
    cells.insert(1, "This page is a notebook: [download it](tutorial.ipynb) and run it beside your own cells.")
    return Made({"start/tutorial.md": "\n\n".join(cells)}, ["start/tutorial.md"])
