"""A page for each reading and each known finding, from their declarations, with what the reading does to an example."""

from __future__ import annotations

import math
import tomllib
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

from harness.comparison.robot_library import engines_of_files, robot_at
from harness.explain.as_read import effects, fold
from harness.explain.changes.readings import Reading, find_all
from harness.explain.meant import STATES, driven, meant
from harness.results.readings import Effect, felt_text, page_of, share_of
from pages.made import DOCS, REPOSITORY, Made, fenced, linked, literal, table

SECTION = "Findings"
EXAMPLES = DOCS / "examples"
SUFFIXES = {"urdf": ".urdf", "mjcf": ".xml", "usd": ".usda"}
LANGUAGES = {".urdf": "xml", ".xml": "xml", ".usda": "text"}
# Where issues of the harness's own are written, and what else is known of an engine.
UPSTREAM = REPOSITORY / "harness" / "report" / "upstream.toml"
KNOWN = REPOSITORY / "harness" / "report" / "known_findings.toml"
ISSUES = "docs/issues/"


def pages() -> Made:
    """A page for each engine and name of a reading, one for each known finding, and the list of both."""
    made = Made()
    by_page: dict[str, list[Reading]] = defaultdict(list)
    for reading in find_all():
        by_page[reading.page].append(reading)
    upstream = tomllib.loads(UPSTREAM.read_text(encoding="utf-8"))["upstream"]
    known = tomllib.loads(KNOWN.read_text(encoding="utf-8"))["finding"]
    entries: dict[str, list[tuple[str, str, str]]] = defaultdict(list)
    for page, readings in by_page.items():
        effect = effect_of(readings)
        made.files[f"findings/{page}.md"] = "\n".join(reading_page(readings, effect, upstream))
        kind = "misreading" if readings[0].is_misread else "documented"
        entries[readings[0].engine].append((page, readings[0].name, kind))
    for finding in known:
        page = page_of(finding["engine"], finding["title"])
        made.files[f"findings/{page}.md"] = "\n".join(finding_page(finding))
        entries[finding["engine"]].append((page, finding["title"], "finding"))
    made.files["findings/index.md"] = "\n".join(index(entries, by_page))
    made.nav = ["findings/index.md"]
    for engine in sorted(entries, key=title_of):
        made.nav.append({title_of(engine): [{name: f"findings/{page}.md"} for page, name, _ in entries[engine]]})
    return made


def title_of(engine: str) -> str:
    """The engine's name as its authors write it."""
    return engines_of_files()[engine].title or engine


def example_of(readings: Sequence[Reading]) -> tuple[Path, Reading]:
    """The example file of a page, one of the engine's own before one that several share, and the reading that it shows.

    Raises:
        FileNotFoundError: none is there.
    """
    for prefix in (f"{readings[0].engine} ", ""):
        for reading in readings:
            for model_format in reading.formats:
                path = EXAMPLES / (page_of("", f"{prefix}{reading.name}") + SUFFIXES[model_format])
                if path.is_file():
                    return path, reading
    raise FileNotFoundError(f"{EXAMPLES} has no example of {readings[0].name!r} for {readings[0].engine}")


def effect_of(readings: Sequence[Reading]) -> Effect:
    """What the reading does to its example.

    Raises:
        ValueError: it does not apply to the example.
    """
    path, reading = example_of(readings)
    robot = driven(meant(robot_at(path), STATES, 0))
    found = effects(robot, fold(robot.robot, [reading]))
    if len(found) != 1:
        raise ValueError(f"{reading.engine}'s reading {reading.name!r} does not apply to {path}")
    return found[0]


def moves(effect: Effect) -> str:
    """The effect on the example in a sentence."""
    if effect.alone is None:
        return "no acceleration is left that the file's could be held against."
    if math.isinf(effect.alone):
        return "joints are lost, so that their accelerations are missing."
    if effect.quantity:
        return f"the {effect.quantity} changes by up to {felt_text(effect.alone)} over 16 sampled states; accelerations are right."
    return f"accelerations change by up to {share_of(felt_text(effect.alone), 'qdd')}, in the energy norm, over 16 sampled states."


def reading_page(readings: Sequence[Reading], effect: Effect, upstream: Iterable[dict[str, Any]]) -> Iterator[str]:
    """The lines of the page of a reading; several are of one engine and name, and read different formats."""
    first, (path, _) = readings[0], example_of(readings)
    title = title_of(first.engine)
    versions = f"version {first.versions}" if first.versions else "every version that the harness knows"
    yield f"# {title}: {first.name}\n"
    told = dict.fromkeys((reading.sentence, reading.remedy, reading.source) for reading in readings)
    for sentence, remedy, source in told:
        yield f"**{literal(sentence)}.**\n"
        yield f"What you can do: {literal(remedy)}.\n"
        yield f"Source: {linked(literal(source))}.\n"
    formats = " and ".join(dict.fromkeys(name.upper() for reading in readings for name in reading.formats))
    yield f"This concerns {formats} files and {versions}."
    if first.is_misread:
        yield "No documentation of the engine says so: an answer that this explains has the verdict `misreads`.\n"
    else:
        yield "The engine's documentation or source says so: an answer that this explains has the verdict `explained`.\n"
    if first.supplied:
        yield "An *aided* engine is supplied with what is left out; see [plain and aided](../concepts/robots.md).\n"
    yield "## Example\n"
    yield f"`{path.name}`:\n"
    yield fenced(path.read_text(encoding="utf-8"), LANGUAGES[path.suffix], effect.lines)
    yield f"With this reading alone {moves(effect)}\n"
    yield "```sh"
    command, about = ("check", f" --quantity {first.quantity}") if first.quantity else ("compare", "")
    yield f"harness {command} docs/examples/{path.name} --subject {first.engine}{asked_version(first)}/{format_of(path)}{about}"
    yield "```\n"
    known = [one for one in upstream if one["engine"] == first.engine and one["feature"] == first.name]
    if known:
        yield "## Upstream\n"
        yield from (f"- [{literal(one['title'])}]({one['link']}), {one['state']} on {one['seen']}" for one in known)


def format_of(path: Path) -> str:
    return next(name for name, suffix in SUFFIXES.items() if suffix == path.suffix)


def asked_version(reading: Reading) -> str:
    """The version that an example asks, where the newest no longer has the reading: the last before "<3.14"."""
    older = {"<3.14": "@3.13.0", "<3.15": "@3.13.0", "<3.4": "@3.3.1", "<4": "@3.9.0"}
    return older[reading.versions] if reading.versions else ""


def finding_page(finding: dict[str, Any]) -> Iterator[str]:
    """The lines of the page of a finding that no reading expresses."""
    yield f"# {title_of(finding['engine'])}: {literal(finding['title'])}\n"
    yield f"Found in version {finding['version']}. The program needs the engine alone; it prints what that says, then what is right.\n"
    yield fenced(finding["reproducer"], "python")
    link = finding["link"]
    if link.startswith(ISSUES):
        yield f"The text for the engine's tracker is [ready to be filed](../issues/{link.removeprefix(ISSUES)}).\n"
    else:
        yield f"Upstream: <{link}>.\n"


def index(entries: dict[str, list[tuple[str, str, str]]], by_page: dict[str, list[Reading]]) -> Iterator[str]:
    """The lines of the list of all."""
    count = len(by_page)
    yield "# Findings\n"
    yield (
        f"What engines make of a file otherwise than the format's documentation says: {count} readings, each with its effect, a remedy and "
        "a source. A line of `harness compare`, `check` or `survey` that names a reading has its page here; the JSON names the page in "
        "`page`.\n"
    )
    yield (
        "*Documented* is what the engine's documentation or source tells its user. A *misreading* is accepted without a word. A *finding* "
        "is shown by a program, because no robot's file expresses it.\n"
    )
    for engine in sorted(entries, key=title_of):
        yield f"## {title_of(engine)}\n"
        rows = []
        for page, name, kind in entries[engine]:
            sentence = by_page[page][0].sentence if page in by_page else ""
            rows.append([f"[{literal(name)}]({page}.md)", kind, literal(sentence)])
        yield table(["reading or finding", "kind", "the engine"], rows)
    yield "## Texts ready to be filed\n"
    for path in sorted((DOCS / "issues").glob("*.md")):
        heading = path.read_text(encoding="utf-8").partition("\n")[0].removeprefix("# ")
        yield f"- [{literal(heading)}](../issues/{path.name}), {title_of(path.name.partition('-')[0])}"
