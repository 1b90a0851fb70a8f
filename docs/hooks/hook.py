"""What mkdocs runs at each build: pages that are made from the code are added, and nothing on a page is fetched from elsewhere."""

from __future__ import annotations

import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

from mkdocs.exceptions import Abort
from mkdocs.structure.files import File, Files
from pages import GENERATORS

# What a browser fetches by itself, by the attribute that names it.
FETCHED = {"script": "src", "link": "href", "img": "src", "iframe": "src", "source": "src", "video": "src", "object": "data"}


def on_files(files: Files, config: Any) -> Files:
    """Add every generated file, and its place in the navigation."""
    sections = {title: entries for section in config.nav for title, entries in section.items()}
    for generator in GENERATORS:
        made = generator.pages()
        for path, content in made.files.items():
            files.append(File.generated(config, path, content=content))
        sections[generator.SECTION].extend(made.nav)
    return files


def on_post_page(output: str, **_: Any) -> str:
    """Name the search for readers of screens, and let the keyboard reach a block that scrolls."""
    named = output.replace('data-md-component="search" role="dialog"', 'data-md-component="search" role="dialog" aria-label="Search"')
    return re.sub(r"(<pre[^>]*>(?:<span></span>)?<code)(?=[ >])", r'\1 tabindex="0"', named)


def on_post_build(config: Any) -> None:
    """End the build where a page would ask another server for something."""
    site = Path(config.site_dir)
    found = [
        f"{path.relative_to(site)}: {address}" for path in sorted(site.rglob("*.html")) for address in fetched(path.read_text("utf-8"))
    ]
    if found:
        raise Abort("pages fetch something from elsewhere:\n" + "\n".join(found))


class _Reader(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        names = dict(attrs)
        address = names.get(FETCHED.get(tag, ""), "") or ""
        # The address by which a search engine knows the page is not fetched.
        if address.startswith(("http:", "https:", "//")) and names.get("rel") != "canonical":
            self.found.append(address)


def fetched(html: str) -> list[str]:
    """Addresses on other servers that a browser asks for when it shows a page."""
    reader = _Reader()
    reader.feed(html)
    return reader.found
