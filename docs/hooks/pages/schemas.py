"""What a command writes by ``--json``: the fields of each kind of result and its JSON Schema, from the classes of ``harness.results``."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any

import msgspec

from harness.diagnosis.faults.summary import Campaign
from harness.results import atlas, benchmark, comparison, cross_check, drift, gap, night
from harness.results.run import Run
from harness.results.site import Site
from pages.made import Made, literal, table

SECTION = "Reference"
# The class of each document by what writes it.
DOCUMENTS: Mapping[str, type[Any]] = {
    "harness compare, survey": comparison.FilesComparison,
    "harness compare --steps": gap.Gaps,
    "harness drift": drift.Drifts,
    "harness check, report": cross_check.CrossCheckResult,
    "harness bench": benchmark.Benchmark,
    "harness atlas": atlas.Atlas,
    "harness faults": Campaign,
    "harness nightly": night.Night,
    "site.json": Site,
}


def pages() -> Made:
    """A page on every document, and its schema beside it."""
    made = Made(nav=["reference/json.md"])
    lines = [
        "# JSON\n",
        "`--json FILE` writes one document. It begins with `harness` (versions) and `run` (the table `Run` below); `summary`, where the "
        "command has one, is the sentence that it prints first. The lists that follow are those of the tables here. A number that is not "
        'finite is the string `"inf"`, `"-inf"` or `"nan"`. A version 0.x may add fields; one that goes or changes its meaning stands in '
        "the changelog.\n",
        "The states in a record are exact: a float64 is written so that it reads back to the last bit.\n",
    ]
    for title, kind in {**DOCUMENTS, "run": Run}.items():
        schema = {"$schema": "https://json-schema.org/draft/2020-12/schema", **msgspec.json.schema(kind)}
        name = f"{kind.__name__.lower()}.schema.json"
        made.files[f"reference/schemas/{name}"] = json.dumps(schema, indent=1, sort_keys=True) + "\n"
        lines += [f"## {title}\n", f"Schema: [{name}](schemas/{name})\n"]
        lines += described(kind, schema["$defs"])
    made.files["reference/json.md"] = "\n".join(lines)
    return made


def described(kind: type[Any], definitions: Mapping[str, Any]) -> Iterator[str]:
    """A table for the document itself, then one for each class in it."""
    for name in sorted(definitions, key=lambda name: (name != kind.__name__, name)):
        fields = definitions[name].get("properties", {})
        if fields:
            yield f"**{name}**\n"
            yield table(["field", "type"], [[f"`{field}`", literal(worded(about))] for field, about in fields.items()])


def worded(about: Mapping[str, Any]) -> str:
    """The type of a field in words."""
    if "$ref" in about:
        return str(about["$ref"]).rpartition("/")[2]
    if "anyOf" in about:
        return " or ".join(worded(one) for one in about["anyOf"])
    kind = about.get("type", "any")
    if kind == "array":
        inner = about.get("items") or next(iter(about.get("prefixItems", [])), {})
        return f"list of {worded(inner)}" if inner else "list"
    if kind == "object" and isinstance(about.get("additionalProperties"), Mapping):
        return f"object of {worded(about['additionalProperties'])}"
    return " or ".join(map(str, about["enum"])) if "enum" in about else str(kind)
