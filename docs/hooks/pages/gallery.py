"""Drawings of the mechanisms and robots that come with the harness, by the code that draws robots in a report."""

from __future__ import annotations

import ast
from collections.abc import Iterable
from pathlib import Path

from harness.library import Library, member_of
from harness.show.picture import standing_alone
from harness.show.robots import draw_robot
from pages.made import REPOSITORY, Made, literal

SECTION = "Gallery"
ROBOTS = REPOSITORY / "harness" / "robots"


def pages() -> Made:
    """A page of mechanisms, each with the first sentence of its file, and one of robots."""
    library, made = Library.built_in(), Made()
    mechanisms = [(name, described(library.system_path(name)), model_of(library, name)) for name in library.system_names()]
    robots = [(path.name, "", path) for path in sorted(ROBOTS.iterdir()) if path.suffix in (".urdf", ".xml")]
    for title, shown in (("Mechanisms", mechanisms), ("Robots", robots)):
        page = f"gallery/{title.lower()}.md"
        made.files[page] = page_of(title, shown, made.files)
        made.nav.append(page)
    return made


def described(path: Path) -> str:
    """The first paragraph of the docstring of a system file, or of the file of the family that a member is of."""
    if not path.is_file() and (family := member_of(path)):
        path = family[0]
    text = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
    return " ".join(text.partition("\n\n")[0].split())


def model_of(library: Library, name: str) -> Path | None:
    """The mechanism's MJCF, or its URDF, or None where it has neither."""
    paths = (library.model_path(name, model_format) for model_format in library.formats_of(name))
    # A member of a family has its models from the file of the family.
    return next((path for path in paths if path.is_file() or member_of(path)), None)


def drawn(path: Path) -> str:
    """The drawing of a model or robot as the text of an SVG file; "" where nothing moves."""
    svg = draw_robot(path, lambda _: None)
    return standing_alone(svg, path.name).svg if svg else ""


def page_of(title: str, shown: Iterable[tuple[str, str, Path | None]], files: dict[str, str | bytes]) -> str:
    """The page, whose drawings are added to ``files``."""
    lines = [
        f"# {title}\n",
        "Each drawing shows the model a little away from its zero position, over its shadow there. The colours tell the bodies apart.\n",
    ]
    for name, text, path in shown:
        lines.append(f"## {name}\n")
        if text:
            lines.append(f"{literal(text)}\n")
        svg = "" if path is None else drawn(path)
        if path is None:
            lines.append("It has no model file: neither format can express it.\n")
        elif svg:
            picture = f"gallery/{path.stem}-{path.suffix[1:]}.svg"
            files[picture] = svg
            lines.append(f"![Drawing of {name}](../{picture}){{ loading=lazy .drawing }}\n")
    return "\n".join(lines)
