"""``rebuild.py`` as one file that needs Python alone: the modules that compute the tables of the site, one below the other."""

from __future__ import annotations

import ast
from importlib.resources import files

# Each after those that it imports. They use the standard library alone, and no two give one name to different things.
MODULES = (
    "verdict.py", "results/table.py", "results/site.py", "results/trend_numbers.py", "report/addresses.py", "report/sparkline.py",
    "report/site_features.py", "report/site_tables.py", "report/rebuild.py",
)  # fmt: skip


def standalone() -> str:
    """The text of the file, which begins with the docstring of ``harness.report.rebuild``."""
    texts = {name: files("harness").joinpath(name).read_text("utf-8") for name in MODULES}
    about = ast.get_docstring(ast.parse(texts[MODULES[-1]]), clean=False)
    return "\n\n".join([f'"""{about}"""\n\nfrom __future__ import annotations', *(_alone(text) for text in texts.values())]) + "\n"


def _alone(text: str) -> str:
    """A module without its docstring and without what it imports of the harness."""
    lines = text.splitlines()
    for place, node in reversed(list(enumerate(ast.parse(text).body))):
        is_docstring = place == 0 and isinstance(node, ast.Expr)
        is_import = isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] in ("harness", "__future__")
        if is_docstring or is_import:
            del lines[node.lineno - 1 : node.end_lineno]
    return "\n".join(lines).strip("\n")
