"""Writes the picture at the top of README: robots and a mechanism that come with the harness, as a report draws them.

python docs/hooks/readme_picture.py
"""

from __future__ import annotations

import re
from pathlib import Path

from lxml import etree
from pages.gallery import ROBOTS
from pages.made import DOCS, REPOSITORY

from harness.report.markup import thumbnail, tints
from harness.show.picture import standing_alone
from harness.show.robots import draw_robot

PICTURE = DOCS / "pictures" / "robots.svg"
SHOWN = {
    "quadruped": ROBOTS / "quadruped.urdf",
    "arm": ROBOTS / "arm.urdf",
    "gripper": ROBOTS / "gripper.urdf",
    "delta robot": REPOSITORY / "mjcf" / "delta_robot.xml",
}
WIDTH, HEIGHT, MARGIN = 240, 170, 16


def picture() -> str:
    """The drawings side by side, without the names in them, each above its own."""
    looks = re.search(r"<style>.*?</style>", standing_alone("<svg></svg>", "").svg, re.DOTALL)
    assert looks is not None
    parts = []
    for number, (name, path) in enumerate(SHOWN.items()):
        svg = etree.fromstring(str(thumbnail(draw_robot(path, lambda _: None))))
        places = {"x": number * WIDTH + MARGIN, "y": MARGIN, "width": WIDTH - 2 * MARGIN, "height": HEIGHT - MARGIN}
        svg.attrib.update({key: str(value) for key, value in places.items()} | {"class": "mechanism"})
        parts.append(
            f'{etree.tostring(svg, encoding="unicode")}<text x="{(number + 0.5) * WIDTH:g}" y="{HEIGHT + 20}" class="name">{name}</text>'
        )
    width, height = WIDTH * len(SHOWN), HEIGHT + 34
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}"><title>{", ".join(SHOWN)}</title>{looks[0]}'
        f"<style>{tints()} svg.mechanism {{ border: 0; }} .stroke {{ stroke: var(--tint); }} .fill {{ fill: var(--tint); }} "
        ".name { font: 14px system-ui, sans-serif; text-anchor: middle; fill: #1c2127; }</style>"
        f'<rect width="{width}" height="{height}" fill="#f5f6f8"/>{"".join(parts)}</svg>\n'
    )


def main(path: Path = PICTURE) -> None:
    """Write the picture."""
    path.write_text(picture(), encoding="utf-8")


if __name__ == "__main__":
    main()
