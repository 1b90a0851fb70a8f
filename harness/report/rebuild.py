"""Computes the numbers of the pages beside this file again from ``site.json``, and compares them with what the pages say.

    python3 rebuild.py [--json]

It needs Python 3.11 and nothing else. Verdict counts, the matrix and the lines on features are computed from the cells, one for each
mechanism or robot and subject; trends of errors, and how much changed in a trend, from the values of every run. Every other table is
written again from the values that the data hold in full. With ``--json`` what was computed goes to standard output, by page and table.
The exit status is 1 where a page says something else.
"""

from __future__ import annotations

import json
import math
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from html.parser import HTMLParser
from pathlib import Path
from statistics import median
from typing import Any

Data = dict[str, Any]
Lines = list[list[str]]

SOFT = 1e-12
TIES = ("loops", "coupled joints", "coupled tendons", "mimic joints", "rolling")
# Change points are of logarithms; of errors with a floor, and none beyond the most.
FLOOR, MOST = 0.1, 1e16
MOST_SHOWN = 200
TRENDS = {
    "trend of the worst": "worst backward error",
    "trend of the 99 %": "99 % backward error",
    "trend of the median": "median backward error",
}
ORDER = ["agrees", "unstable", "undecided", "unsupported", "disagrees", "error"]


def error_text(value: float | None) -> str:
    """Three significant digits."""
    return "-" if value is None else f"{value:#.3g}".removesuffix(".") if value else "0"


def seconds_text(value: float | None) -> str:
    if value is None:
        return "-"
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if not abs(value) < size:
            return f"{error_text(value / size)} {unit}"
    return f"{error_text(value / 1e-9)} ns"


KINDS: dict[str, Callable[[Any], str]] = {
    "text": str,
    "error": error_text,
    "relative": lambda value: "> 1" if value > 1 else error_text(value),
    "seconds": seconds_text,
    "count": "{:,}".format,
    "rounded": "{:.2f}".format,
    "given": "{:g}".format,
    "figure": "{:.5g}".format,
    "plain": str,
}


def cell_text(column: Data, cell: Data) -> str:
    """What a table says of a value, and below it its notes."""
    value = cell["value"]
    if column["kind"] != "text" and value in ("inf", "-inf", "nan"):
        value = float(value)
    if value is None:
        text = "" if column["kind"] == "text" else "-"
    elif isinstance(value, str):
        text = value
    else:
        text = f"{KINDS[column['kind']](value)} {column['unit']}".rstrip()
    return " ".join(" ".join([text, *cell["notes"]]).split())


def written(table: Data) -> Lines:
    """The rows of a table as texts, from the values that the data hold."""
    return [[cell_text(column, cell) for column, cell in zip(table["columns"], row, strict=True)] for row in table["rows"]]


def worst_of(cells: Sequence[Data]) -> float | None:
    errors = [float(cell["backward_error"]) for cell in cells if cell["backward_error"] is not None]
    return max((math.inf if math.isnan(error) else error for error in errors), default=None)


def matrix(site: Data) -> Lines:
    """The verdicts of every pair, and the worst backward errors below them."""
    found: dict[tuple[str, str], list[Data]] = {}
    for cell in site["cells"]:
        found.setdefault((cell["row"], cell["column"]), []).append(cell)
    lines = []
    for row in site["rows"]:
        line, absent = [row["name"]], "not run" if row["kind"] == "mechanism" else "not asked"
        line += [matrix_text(found.get((row["name"], column["name"]), []), absent) for column in site["columns"]]
        lines.append([" ".join(text.split()) for text in line])
    return lines


def matrix_text(cells: Sequence[Data], absent: str) -> str:
    words = ["✗" if not all(cell["as_expected"] for cell in cells) else "", "; ".join(cell["outcome"] for cell in cells)]
    for cell in cells:
        error = cell["backward_error"]
        words.append("" if error is None else error if isinstance(error, str) else error_text(error))
        if not cell["as_expected"]:
            words.append(f"expected: {cell['expected']}")
        elif cell["expected"] != "agrees":
            words.append("as expected")
    return " ".join(" ".join(words).split()) if cells else absent


def quantities(site: Data, row: str) -> Lines:
    """The verdicts on a mechanism by quantity and subject, and the worst backward errors below them."""
    found = {(cell["quantity"], cell["column"]): [cell] for cell in site["quantities"] if cell["row"] == row}
    asked = {column for _, column in found}
    columns = [column["name"] for column in site["columns"] if column["name"] in asked]
    names = sorted({quantity for quantity, _ in found})
    return [[name, *(matrix_text(found.get((name, column), []), "not asked") for column in columns)] for name in names]


def engines(site: Data) -> Lines:
    """Of each engine and version how many pairs agree, of those that got an answer; how many are unsupported; and its findings."""
    lines = []
    for engine, version in sorted({(column["engine"], column["version"]) for column in site["columns"]}):
        own = {column["name"] for column in site["columns"] if (column["engine"], column["version"]) == (engine, version)}
        cells = [cell for cell in site["cells"] if cell["column"] in own]
        unsupported = sum(cell["verdict"] == "unsupported" for cell in cells)
        agrees = f"{sum(cell['agrees'] for cell in cells)} of {len(cells) - unsupported}"
        findings = sum(finding["engine"] == engine for finding in site["findings"])
        lines.append([" ".join(text.split()) for text in (engine, version, agrees, f"{unsupported:,}", f"{findings:,}")])
    return lines


def subjects(site: Data, engine: str) -> Lines:
    """The same of each format, and the worst error of the cells that agree."""
    lines = []
    for column in site["columns"]:
        if column["engine"] == engine:
            cells = [cell for cell in site["cells"] if cell["column"] == column["name"]]
            agreeing = [cell for cell in cells if cell["verdict"] == "agrees"]
            unsupported = sum(cell["verdict"] == "unsupported" for cell in cells)
            counts = [f"{sum(cell['agrees'] for cell in cells):,}", f"{len(cells) - unsupported:,}", f"{unsupported:,}"]
            lines.append([column["name"], column["version"], *counts, error_text(worst_of(agreeing))])
    return [[" ".join(text.split()) for text in line] for line in lines]


def features(site: Data, engine: str) -> Lines:
    """A line on each feature and subject of an engine, from the cells whose model has the feature."""
    own = [column["name"] for column in site["columns"] if column["engine"] == engine]

    def asked(cell: Data) -> list[str]:
        return cell["features"] if cell["quantity"] == "accelerations" else [cell["quantity"]]

    lines, everything = [], [*site["cells"], *site["quantities"]]
    for feature in sorted({name for cell in everything for name in asked(cell)}):
        for column in own:
            cells = [cell for cell in everything if cell["column"] == column and feature in asked(cell)]
            if cells:
                lines.append([feature, column, *feature_line(feature, cells)])
    return [[" ".join(text.split()) for text in line] for line in lines]


def feature_line(feature: str, cells: Sequence[Data]) -> list[str]:
    agrees, worst = sum(cell["agrees"] for cell in cells), worst_of(cells)
    distances = [float(cell["from_rigid"]) for cell in cells if cell["from_rigid"] is not None and feature in TIES]
    soft = median(distances) if distances else None
    parts = [f"soft, {soft:.1e} from rigid at the file's settings"] if soft is not None and soft > SOFT else []
    if agrees:
        what = "agrees with what its engine documents" if parts else "agrees"
        parts.append(f"{what} on {agrees} of {len(cells)}, worst {error_text(worst)}")
    for verdict in ORDER[1:]:
        if count := sum(cell["verdict"] == verdict for cell in cells):
            parts.append(f"{verdict} on {count} of {len(cells)}")
    reasons = list(dict.fromkeys(cell["reason"] for cell in cells if not cell["agrees"] and cell["reason"]))
    line = "; ".join(parts) + (f": {reasons[0]}" if len(reasons) == 1 else "")
    return [line, f"{agrees:,}", f"{len(cells):,}", error_text(worst), error_text(soft)]


def logarithm(value: Any, floor: float) -> float:
    """Of a value of a trend, as changes are found in it."""
    number = float(value)
    if not floor:
        return math.log(number)
    return math.log(MOST if math.isnan(number) else min(max(number, 0.0), MOST) + floor)


def changes(site: Data, row: str | None) -> Lines:
    """The change points of a mechanism, or of all: the latest first."""
    found: list[tuple[float, list[str]]] = []
    for trend in site["trends"]:
        if row in (None, trend["row"]):
            floor = 0.0 if trend["number"] == "cost" else FLOOR
            for change, numbers in zip(trend["changes"], changed_numbers(trend, floor), strict=True):
                size = abs(math.log((change["now"] + floor) / (change["before"] + floor)))
                started = site["nights"][trend["study"]][change["place"]][:16].replace("T", " ")
                found.append((size, [started, trend["row"], trend["column"], trend["number"], *numbers, change["found_by"]]))
    found.sort(key=lambda entry: (-entry[0], entry[1][1:4]))
    found.sort(key=lambda entry: entry[1][0], reverse=True)
    lines = [line if row is None else [line[0], *line[2:]] for _, line in found[:MOST_SHOWN]]
    return [[" ".join(text.split()) for text in line] for line in lines]


def changed_numbers(trend: Data, floor: float) -> Iterator[list[str]]:
    """Of each change, from the values: the mean of the nights before, the mildest of the nights that show it, and how many were before."""
    places = [place for place, value in enumerate(trend["values"]) if value is not None]
    logarithms = [logarithm(trend["values"][place], floor) for place in places]
    begin = 0
    for change in trend["changes"]:
        end = places.index(change["place"]) + 1
        before, shown = logarithms[begin : end - change["run"]], logarithms[end - change["run"] : end]
        begin = end - change["run"]
        mean = sum(before) / len(before)
        _, now = min((abs(value - mean), value) for value in shown)
        yield [*(error_text(max(0.0, math.exp(value) - floor)) for value in (mean, now)), f"{len(before):,}"]


def trend_text(trend: Data | None) -> str:
    """A trend in words."""
    known = [(place, float(value)) for place, value in enumerate(trend["values"] if trend else []) if value not in (None, "nan")]
    if trend is None or not known:
        return "no number yet"
    low, high = (error_text(extreme(value for _, value in known)) for extreme in (min, max))
    changed = {change["place"] for change in trend["changes"]}
    marked = [str(run) for run, (place, _) in enumerate(known, 1) if place in changed]
    runs = f"{len(known)} run{'' if len(known) == 1 else 's'}"
    return f"{low if low == high else f'{low} to {high}'} in {runs}" + (f", changed in run {', '.join(marked)}" if marked else "")


def trends(site: Data, row: str, table: Data) -> Lines:
    """The trends of each subject of a mechanism, as far as its table has them."""
    found = {(one["column"], one["number"]): one for one in site["trends"] if (one["study"], one["row"]) == ("cross-check", row)}
    numbers = [TRENDS[column["title"]] for column in table["columns"][1:]]
    return [[subject, *(trend_text(found.get((subject, number))) for number in numbers)] for subject, *_ in written(table)]


def rebuilt(site: Data) -> dict[str, dict[str, Lines]]:
    """The rows of every table, by page and by the table's name there."""
    pages: dict[str, dict[str, Lines]] = {}
    for table in site["tables"]:
        pages.setdefault(table["page"], {})[table["name"]] = written(table)
    by_caption = {(table["page"], table["caption"]): table["name"] for table in site["tables"]}

    def replace(page: str, caption: str, lines: Lines) -> None:
        name = next((name for (where, text), name in by_caption.items() if where == page and text.startswith(caption)), None)
        if name is not None:
            pages[page][name] = lines

    replace("index.html", "Verdict and worst backward error", matrix(site))
    replace("index.html", "Engines:", engines(site))
    replace("index.html", "Changed in the trend", changes(site, None))
    for row in site["rows"]:
        if row["kind"] != "robot":
            replace(row["page"], "Other quantities on ", quantities(site, row["name"]))
            replace(row["page"], "Changed in the trend", changes(site, row["name"]))
            for table in site["tables"]:
                if table["page"] == row["page"] and table["caption"].startswith("Trends of "):
                    replace(row["page"], "Trends of ", trends(site, row["name"], table))
    for engine, page in {(column["engine"], column["page"]) for column in site["columns"]}:
        replace(page, "Verdicts of ", subjects(site, engine))
        replace(page, "What ", features(site, engine))
    return pages


class Tables(HTMLParser):
    """The texts of the cells of a page's tables, by the name of the table."""

    def __init__(self, source: str) -> None:
        super().__init__()
        self.tables: dict[str, Lines] = {}
        self._name, self._in_body = "", False
        self._cell: str | None = None
        self.feed(source)

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        if tag == "table":
            self._name = dict(attributes).get("data-table") or ""
            self.tables.setdefault(self._name, [])
        elif tag == "tbody":
            self._in_body = True
        elif tag == "tr" and self._in_body:
            self.tables[self._name].append([])
        elif tag in ("td", "th") and self._in_body:
            self._cell = ""

    def handle_endtag(self, tag: str) -> None:
        if tag == "tbody":
            self._in_body = False
        elif tag in ("td", "th") and self._cell is not None:
            self.tables[self._name][-1].append(" ".join(self._cell.split()))
            self._cell = None

    def handle_data(self, data: str) -> None:
        if self._cell is not None:
            self._cell += data


def differences(folder: Path, pages: dict[str, dict[str, Lines]], site: Data) -> Iterator[str]:
    """A line for each text of a page that is not what was computed, and each table that is nowhere in the data."""
    for page, tables in pages.items():
        said = Tables((folder / page).read_text(encoding="utf-8")).tables
        for name in said.keys() - tables.keys():
            yield f"{page}: {name or 'a table without a name'}: not in the data"
        for name, lines in tables.items():
            told = said.get(name, [])
            if len(told) != len(lines):
                yield f"{page}: {name}: {len(told)} rows, computed {len(lines)}"
            for row, (own, other) in enumerate(zip(lines, told, strict=False), 1):
                for column, (computed, text) in enumerate(zip(own, other, strict=False), 1):
                    if computed != text:
                        yield f"{page}: {name}, row {row}, column {column}: says {text!r}, computed {computed!r}"
    for engine, version, agrees, *_ in engines(site):
        count = next(one for one in site["counts"] if (one["engine"], one["version"]) == (engine, version))
        if f"{agrees} agree" not in (folder / count["badge"]).read_text(encoding="utf-8"):
            yield f"{count['badge']}: does not say {agrees} agree"


def main() -> int:
    folder = Path(__file__).resolve().parent
    site = json.loads((folder / "site.json").read_text(encoding="utf-8"))
    pages = rebuilt(site)
    if "--json" in sys.argv[1:]:
        print(json.dumps(pages, indent=1))
    found = list(differences(folder, pages, site))
    texts = [text for tables in pages.values() for lines in tables.values() for line in lines for text in line]
    numbers = sum(bool(re.search(r"\d", text)) for text in texts)
    print(*found, f"{numbers} cells with numbers in {len(pages)} pages computed again; {len(found)} differ", sep="\n", file=sys.stderr)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
