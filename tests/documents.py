"""Pages of the documentation as tests run them: their blocks in order, the files that they name, and what commands should print."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from rooms import REPOSITORY

DOCS = REPOSITORY / "docs"
PAGES = [REPOSITORY / "README.md", *sorted(path for path in DOCS.rglob("*.md") if path.parent.name != "issues")]
# Comments on lines of their own, and maybe a line that names a file; then a fenced block.
BLOCK = re.compile(
    r"(?P<marks>(?:^<!-- [^\n]* -->\n)*)(?:^`(?P<path>[^`\n]+)`:\n\n)?^```(?P<language>\w*)\n(?P<content>.*?)^```$",
    re.MULTILINE | re.DOTALL,
)
NUMBER = re.compile(r"(?<![\w.])-?\d[\d,]*(?:\.\d+)?(?:e[+-]?\d+)?(?![\w.]*\d)")
ANYTHING = "[...]"


@dataclass
class Block:
    """A fenced block of a page, with the comments before it."""

    language: str
    content: str
    path: str = ""
    marks: list[str] = field(default_factory=list)

    @property
    def is_nightly(self) -> bool:
        return "nightly" in self.marks

    @property
    def status(self) -> int:
        """The exit status of its last command."""
        return next((int(mark.split()[-1]) for mark in self.marks if mark.startswith("exit status")), 0)


def blocks(text: str) -> Iterator[Block]:
    """The fenced blocks of a page, in order."""
    for found in BLOCK.finditer(text):
        marks = re.findall(r"<!-- (.*?) -->", found["marks"])
        yield Block(found["language"], found["content"], found["path"] or "", marks)


@dataclass
class Page:
    """A page that is run in a folder: ``run`` goes through its blocks, as a reader does from top to bottom."""

    text: str
    folder: Path
    nightly: bool = False
    printed: str = ""
    commands: int = 0

    def run(self) -> None:
        """Write the named files, run the commands, and hold what they print against what the page shows.

        Raises:
            AssertionError: a command ends with another status, or prints something else.
        """
        ran = False
        for block in blocks(self.text):
            if block.path:
                path = self.folder / block.path
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text(block.content, encoding="utf-8")
            elif block.language == "sh":
                ran = self.nightly or not block.is_nightly
                if ran:
                    self._command(block)
            elif "output" in block.marks and ran:
                assert shown(block.content, self.printed), f"expected\n{block.content}\nprinted\n{self.printed}"

    def _command(self, block: Block) -> None:
        done = shell(block.content, self.folder)
        assert done.returncode == block.status, f"{block.content}ended with {done.returncode}\n{done.stdout}{done.stderr}"
        self.printed = done.stdout
        self.commands += 1


def shell(script: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run a script as a reader of the page does, with ``harness`` and ``pytest`` those of this repository."""
    programs = folder / ".programs"
    if not programs.exists():
        programs.mkdir()
        for name in ("harness", "pytest", "mkdocs"):
            (programs / name).write_text(f'#!/bin/sh\nPYTHONPATH="{REPOSITORY}" exec "{sys.executable}" -m {name} "$@"\n')
            (programs / name).chmod(0o755)
        for name in ("python", "python3"):
            (programs / name).write_text(f'#!/bin/sh\nexec "{sys.executable}" "$@"\n')
            (programs / name).chmod(0o755)
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("PYTEST_", "CI"))}
    environment |= {"PATH": f"{programs}:{os.environ['PATH']}", "COLUMNS": "200"}
    environment.pop("PYTHONPATH", None)
    return subprocess.run(
        ["bash", "-euc", script], cwd=folder, env=environment, capture_output=True, text=True, timeout=1800, check=False
    )  # fmt: skip


def shown(expected: str, printed: str) -> bool:
    """Whether ``printed`` is what a page shows, but for numbers, widths of columns and whatever ``[...]`` stands for."""
    parts = [re.escape(_plain(part)) for part in expected.split(ANYTHING)]
    return re.fullmatch(".*".join(parts), _plain(printed), re.DOTALL) is not None


def _plain(text: str) -> str:
    """Words with a mark in the place of numbers, and single spaces."""
    without = re.sub(r"(?<=\s)(?:ns|µs|ms|s)(?=\s)", "", NUMBER.sub("#", text))
    return " ".join(without.split())
