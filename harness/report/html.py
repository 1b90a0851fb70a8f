"""Templates, and what they need to draw pages: filters, and only markup that is known to be harmless."""

from __future__ import annotations

import base64
import functools
import hashlib
import re
from collections.abc import Mapping
from contextvars import ContextVar
from dataclasses import dataclass
from datetime import datetime
from html import escape
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from jinja2 import Environment, FunctionLoader, StrictUndefined
from markupsafe import Markup

from harness.report import benchmarks, charts, hard_cases
from harness.report.figures import embed
from harness.report.issue_texts import page_of
from harness.report.markup import equations, picture, tint, tints
from harness.report.site_counts import badge_text, error_of
from harness.report.summary import changes_table, state_lines, states_of
from harness.results.pareto import acceleration_front, motion_front, way_of
from harness.results.records import Record
from harness.results.run import changed_versions
from harness.results.site import SiteCount
from harness.results.table import Table, counted, error_text, seconds_text
from harness.verdict import AGREEMENT, Verdict

if TYPE_CHECKING:
    from bokeh import plotting

_HEADING = re.compile(r'<h([23]) id="([^"]+)">(.*?)</h\1>', re.DOTALL)


@dataclass(frozen=True)
class Drawn:
    """A page: its text, the tables on it in their order, each by the value of its attribute ``data-table``, and whether it has charts."""

    text: str
    tables: dict[str, Table]
    has_charts: bool


# Of the page that is being drawn; None while a page is drawn whose tables nobody asked for.
_tables: ContextVar[dict[str, Table] | None] = ContextVar("_tables", default=None)


def draw(template: str, page: str, plots: Mapping[str, plotting.figure | None], **about: Any) -> Drawn:
    """A page of the site; ``page`` is its address from the index, ``about`` what its template asks for."""
    tables: dict[str, Table] = {}
    token = _tables.set(tables)
    try:
        embedded = embed(plots)
        text = environment().get_template(template).render(root="../" * page.count("/"), page=page, **about, **embedded)
    finally:
        _tables.reset(token)
    return Drawn(text, tables, bool(embedded["charts"]))


def _finalized(value: Any) -> Any:
    """A table with its name on the page; all else as it is."""
    tables = _tables.get()
    if tables is None or not isinstance(value, Table) or not value.rows:
        return value
    name = f"table-{len(tables) + 1}"
    tables[name] = value
    return Markup(value.html(name))


@functools.cache
def environment() -> Environment:
    """The templates of this folder, with what every page needs; ``base.html`` wants what comes from ``figures.embed``.

    It is one for the process, in which each template is compiled once.
    """
    package = files(__package__)
    made = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True, finalize=_finalized,
        loader=FunctionLoader(lambda name: package.joinpath(name).read_text("utf-8")),
    )  # fmt: skip
    made.filters |= {
        "error": error_text, "seconds": seconds_text, "equations": equations, "picture": picture, "link": address_of,
        "state": state_lines, "data_error": error_of, "left_out": left_out, "moment": moment, "way": way_of, "sentence_case": sentence_case,
        "contents": contents, "badge_text": badge_text, "tint": tint, "digest": digest,
    }  # fmt: skip
    made.globals |= {
        "style": Markup(style_sheet()), "limit": AGREEMENT, "counted": counted, "states_of": states_of, "way_of": way_of,
        "changed_versions": changed_versions, "changes_table": changes_table, "tables": benchmarks, "hard_tables": hard_cases,
        "acceleration_front": acceleration_front, "motion_front": motion_front, "silent_marker": charts.SILENT_MARKER[1],
    }  # fmt: skip
    return made


def asset(name: str) -> str:
    """A file of this folder as text."""
    return files(__package__).joinpath(name).read_text("utf-8")


def style_sheet() -> str:
    """The style sheet of every page."""
    return asset("style.css") + tints()


def digest(text: str) -> str:
    """Name of an inline style or script in a policy. Source: W3C Content Security Policy Level 3, section 2.3.1."""
    return f"sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}"


def contents(markup: str) -> list[tuple[str, Markup, list[tuple[str, Markup]]]]:
    """Anchor and text of each second heading of a page, and of the third headings below it that have an anchor."""
    found: list[tuple[str, Markup, list[tuple[str, Markup]]]] = []
    for level, anchor, text in _HEADING.findall(markup):
        if level == "2":
            found.append((anchor, Markup(text), []))
        elif found:
            found[-1][2].append((anchor, Markup(text)))
    return found


def sentence_case(text: str) -> str:
    """``text`` with a capital first letter where it begins with a word, and not with a path or a name."""
    return text[:1].upper() + text[1:] if re.match(r"[a-z]{2,}[,;]?(\s|$)", text) else text


def address_of(link: str) -> str | None:
    """The address of ``link`` from the index of the site: itself, or the page of a text; None for a book or a paper."""
    return link if re.fullmatch(r"https?://\S+", link) else page_of(link)


def moment(started: str) -> str:
    """ "2026-01-31 02:00:00 UTC" of ISO 8601 in UTC."""
    return f"{datetime.fromisoformat(started):%Y-%m-%d %H:%M:%S} UTC"


def left_out(record: Record) -> str:
    """States of a distribution that a logarithmic axis cannot show, in words; "" for none."""
    words = {"exact": "with no error at all", "below": f"below {10 ** (charts.LEAST_SHOWN / 2):g}", "inf": "with an infinite error"}
    shown = {str(index) for index in charts.half_decades(record)}
    rest: dict[str, int] = {}
    for key, count in record.distribution.items():
        if key not in shown and count > 0:
            is_below = key.removeprefix("-").isdecimal() and int(key) < charts.LEAST_SHOWN
            rest["below" if is_below else key] = rest.get("below" if is_below else key, 0) + count
    return ", ".join(f"{counted(count, 'state')} {words.get(key, f'in bin {key}')}" for key, count in sorted(rest.items()))


# Of Verdana at 11 px, about; a badge that is a little wide reads as well.
_LETTER, _MARGIN, _HEIGHT = 6.6, 6.0, 20
_GOOD, _NOT_ALL, _WRONG = "#17692f", "#7d5200", "#b3141d"


def badge(count: SiteCount) -> str:
    """An ``<svg>`` that says, as "mujoco 4.0.0", how many pairs agree of those that got an answer; red where one is wrong."""
    left, right = f"{count.engine} {count.version}".strip(), badge_text(count)
    widths = [round(len(text) * _LETTER + 2 * _MARGIN) for text in (left, right)]
    total = sum(widths)
    is_wrong = count.tone in (Verdict.MISREADS, Verdict.DISAGREES, Verdict.ERROR)
    colour = _WRONG if is_wrong else _GOOD if count.asked and count.agrees == count.asked else _NOT_ALL
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
