"""Mutants of a module: each is one small mistake, written into the text of the module and nowhere else in it."""

from __future__ import annotations

import ast
import copy
import random
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

COMPARISONS = {ast.Lt: ast.GtE, ast.GtE: ast.Lt, ast.Gt: ast.LtE, ast.LtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq}
COMPARISONS |= {ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In}
OPERATORS = {ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.Pow: ast.Mult, ast.MatMult: ast.Add}
LOGIC = {ast.And: ast.Or, ast.Or: ast.And}
SIGNS = (ast.USub, ast.Not)


@dataclass(frozen=True)
class Mutant:
    """One change of a module: where, in words, and the whole text with it.

    Attributes:
        was, became: the line without the change and with it.
        at_import: the line runs when the module is imported, so that what covers it says nothing of who needs it.
    """

    path: Path
    line: int
    words: str
    was: str
    became: str
    text: str
    at_import: bool


class Place(NamedTuple):
    """A node of a module, by its number in a walk through it, and which of its changes."""

    path: Path
    node: int
    change: int


def places(path: Path) -> list[Place]:
    """Every mutant of a module, not made yet."""
    nodes = _nodes(ast.parse(path.read_bytes()))
    return [Place(path, number, change) for number, node in enumerate(nodes) for change, _ in enumerate(_changes(node))]


def sample(paths: Iterable[Path], count: int, seed: int) -> tuple[list[Mutant], int]:
    """So many mutants of the modules, each as likely as any other, and of how many they are."""
    every = [place for path in paths for place in places(path)]
    return [made(place) for place in random.Random(seed).sample(every, min(count, len(every)))], len(every)


def made(place: Place) -> Mutant:
    """The mutant of a place."""
    source = place.path.read_bytes()
    tree = ast.parse(source)
    changed = copy.deepcopy(tree)
    before, node = (list(_nodes(one))[place.node] for one in (tree, changed))
    list(_changes(node))[place.change]()
    # Brackets keep an expression together where it lies in another one.
    new = f"({ast.unparse(node)})" if isinstance(node, ast.expr) else ast.unparse(node)
    text = _replaced(source, before, new.encode())
    assert ast.dump(ast.parse(text)) == ast.dump(changed), f"{place}: the text has another change than the tree"
    words = f"{ast.unparse(before)}  ->  {ast.unparse(node)}"
    number = before.lineno  # type: ignore[attr-defined]
    was, became = (one.splitlines()[number - 1].strip() for one in (source.decode(), text))
    return Mutant(place.path, number, words, was, became, text, not any(_holds(one, before) for one in ast.walk(tree)))


def _nodes(tree: ast.AST) -> Iterator[ast.AST]:
    """The nodes of a tree but those in a text with placeholders, which are words and, before Python 3.12, have no place of their own."""
    yield tree
    for child in ast.iter_child_nodes(tree):
        if not isinstance(child, ast.JoinedStr):
            yield from _nodes(child)


def _changes(node: ast.AST) -> Iterator[Callable[[], None]]:
    """What may be changed in a node, each a function that does it; annotations and docstrings have nothing of it."""
    if isinstance(node, ast.Compare) and type(node.ops[0]) in COMPARISONS:
        yield lambda: node.ops.__setitem__(0, COMPARISONS[type(node.ops[0])]())
    elif isinstance(node, ast.BinOp | ast.AugAssign) and type(node.op) in OPERATORS:
        yield lambda: setattr(node, "op", OPERATORS[type(node.op)]())
    elif isinstance(node, ast.BoolOp):
        yield lambda: setattr(node, "op", LOGIC[type(node.op)]())
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, SIGNS):
        # What has no effect on a number or a truth value, and leaves the node where it is.
        yield lambda: node.__dict__.update(op=ast.UAdd()) if isinstance(node.op, ast.USub) else _denied(node)
    elif isinstance(node, ast.Constant) and isinstance(node.value, bool):
        yield lambda: setattr(node, "value", not node.value)
    elif isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        yield lambda: setattr(node, "value", node.value + 1)
    elif isinstance(node, ast.Return | ast.Expr) and not isinstance(node.value, ast.Constant | None):
        yield lambda: setattr(node, "value", ast.Constant(None))


def _denied(node: ast.UnaryOp) -> None:
    node.operand = ast.UnaryOp(ast.Not(), node.operand)


def _replaced(source: bytes, node: ast.AST, new: bytes) -> str:
    """A source with a node of it replaced."""
    lines = source.splitlines(keepends=True)
    starts = [0]
    for line in lines:
        starts.append(starts[-1] + len(line))
    begin = starts[node.lineno - 1] + node.col_offset  # type: ignore[attr-defined]
    end = starts[node.end_lineno - 1] + node.end_col_offset  # type: ignore[attr-defined]
    return (source[:begin] + new + source[end:]).decode()


def _holds(function: ast.AST, node: ast.AST) -> bool:
    """Whether a node is of the body of a function."""
    body = function.body if isinstance(function, ast.FunctionDef | ast.AsyncFunctionDef) else []
    body = [function.body] if isinstance(function, ast.Lambda) else body
    return any(one is node for part in body for one in ast.walk(part))
