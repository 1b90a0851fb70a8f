"""Texts for the trackers of engines, which come with the harness; the site has a page for each that it links to."""

from __future__ import annotations

import functools
import re
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path

# How an expected verdict names one.
PREFIX, _NAME = "docs/issues/", re.compile(r"docs/issues/([\w-]+)\.md")


@functools.cache
def _folder() -> Traversable:
    """The folder of the wheel, or of a clone."""
    own = files("harness").joinpath("issues")
    return own if own.is_dir() else Path(__file__).parents[2] / PREFIX


def page_of(link: str) -> str | None:
    """Address of the page from the index of the site; None where ``link`` is no such text."""
    named = _NAME.fullmatch(link)
    return f"issues/{named[1]}.html" if named and _folder().joinpath(f"{named[1]}.md").is_file() else None


def text_of(link: str) -> str:
    """The text, in Markdown.

    Raises:
        FileNotFoundError: there is none.
    """
    return _folder().joinpath(link.removeprefix(PREFIX)).read_text("utf-8")
