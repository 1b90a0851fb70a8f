"""Badges: what an engine's version reaches, as a small SVG for a README."""

from __future__ import annotations

from html import escape

from harness.results.site import SiteCount

# Of Verdana at 11 px, about; a badge that is a little wide reads as well.
_LETTER, _MARGIN, _HEIGHT = 6.6, 6.0, 20
_GOOD, _NOT_ALL = "#17692f", "#7d5200"


def badge(count: SiteCount) -> str:
    """An ``<svg>`` that says, as "mujoco 4.0.0", how many pairs agree of those that got an answer."""
    left, right = f"{count.engine} {count.version}".strip(), f"{count.agrees} of {count.asked} agree"
    widths = [round(len(text) * _LETTER + 2 * _MARGIN) for text in (left, right)]
    total = sum(widths)
    colour = _GOOD if count.asked and count.agrees == count.asked else _NOT_ALL
    words = escape(f"{left}: {right}", quote=True)
    parts = [
        f'<rect width="{total}" height="{_HEIGHT}" rx="3" fill="#3b424b"/>',
        f'<rect x="{widths[0]}" width="{widths[1]}" height="{_HEIGHT}" rx="3" fill="{colour}"/>',
        f'<text x="{widths[0] / 2:g}" y="14">{escape(left)}</text>',
        f'<text x="{widths[0] + widths[1] / 2:g}" y="14">{escape(right)}</text>',
    ]
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{total}" height="{_HEIGHT}" role="img" aria-label="{words}"><title>{words}</title>'
        f'<g fill="#fff" text-anchor="middle" font-family="Verdana,DejaVu Sans,sans-serif" font-size="11">{"".join(parts)}</g></svg>\n'
    )
