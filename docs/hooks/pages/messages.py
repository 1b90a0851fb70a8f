"""Every message that ends a command with exit status 2, and every reason why an engine is not asked, from the source."""

from __future__ import annotations

import ast
from collections.abc import Iterator

from pages.made import REPOSITORY, Made, literal

SECTION = "Reference"
PACKAGE = REPOSITORY / "harness"
# What a class of error is about, in the order of the page.
KINDS = {
    "InvalidRequest": "A command that asks for what cannot be",
    "InvalidModel": "A model file or robot",
    "InvalidSystem": "A system file",
    "InvalidInput": "Another file",
    "Unsupported": "An engine that cannot express a mechanism",
    "Refused": "An engine that refuses a file",
}


def pages() -> Made:
    """One page, a list for each kind of error."""
    found: dict[str, list[tuple[str, str]]] = {kind: [] for kind in KINDS}
    for path in sorted(PACKAGE.rglob("*.py")):
        for kind, text in raised(ast.parse(path.read_text(encoding="utf-8"))):
            found[kind].append((text, path.relative_to(PACKAGE).as_posix()))
    lines = [
        "# Messages\n",
        "What stands in braces is filled in. A message about a file begins with its name and line. The first four kinds are exit status 2; "
        "the last two are the reason of the verdict `unsupported`. A message that is put together from several parts is not listed.\n",
    ]
    for kind, title in KINDS.items():
        lines.append(f"## {title}\n")
        lines += [f"- {literal(text)} <small>{place}</small>" for text, place in sorted(set(found[kind]))]
        lines.append("")
    return Made({"reference/messages.md": "\n".join(lines)}, ["reference/messages.md"])


def raised(tree: ast.Module) -> Iterator[tuple[str, str]]:
    """The kind and the text of each error of ``KINDS`` whose text is written where it is raised."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call):
            kind = ast.unparse(node.exc.func).rpartition(".")[2]
            texts = [text for argument in node.exc.args[-1:] if kind in KINDS and (text := text_of(argument))]
            yield from ((kind, text) for text in texts)


def text_of(node: ast.expr) -> str:
    """The text of a string or of one with parts to be filled in; "" for anything else and for one without words of its own."""
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return " ".join(node.value.split())
    if not isinstance(node, ast.JoinedStr):
        return ""
    parts = [str(part.value) if isinstance(part, ast.Constant) else f"{{{name_of(part)}}}" for part in node.values]
    own = "".join(str(part.value) for part in node.values if isinstance(part, ast.Constant))
    return " ".join("".join(parts).split()) if len(own.split()) > 1 else ""


def name_of(node: ast.expr) -> str:
    """The last name of an expression, for the reader of a message."""
    names = [
        part.attr if isinstance(part, ast.Attribute) else part.id for part in ast.walk(node) if isinstance(part, ast.Attribute | ast.Name)
    ]
    return names[0] if names else "value"
