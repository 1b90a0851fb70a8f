"""What the tests of comparisons share: files, edited copies of them, and comparisons without processes."""

from __future__ import annotations

from pathlib import Path

from harness.comparison.judgement import judge
from harness.comparison.robot_library import engine_of, robot_at
from harness.explain.meant import Meant, meant, question_of
from harness.library import Stance
from harness.results.comparison import SubjectRecord

FILES = Path(__file__).parent / "files"
STATES = 16


def meant_by(path: Path, floating_base: bool = False) -> Meant:
    return meant(robot_at(path, floating_base), STATES, seed=0)


def record_of(path: Path, engine: str, aided: bool = False, floating_base: bool = False) -> SubjectRecord:
    """The record of a subject, asked in this process."""
    found, stance = meant_by(path, floating_base), Stance.AIDED if aided else Stance.PLAIN
    return judge(found, engine_of(engine).ask(question_of(found, stance)), engine, stance)


def edited(source: Path, folder: Path, *changes: tuple[str, str]) -> Path:
    """A copy of a file with texts replaced, each of which stands there once."""
    text = source.read_text()
    for old, new in changes:
        assert text.count(old) == 1, (old, text.count(old))
        text = text.replace(old, new)
    copy = folder / source.name
    copy.write_text(text)
    return copy


def line_of(path: Path, text: str) -> int:
    """The line that holds ``text``, of which there is one."""
    (line,) = [number for number, content in enumerate(path.read_text().splitlines(), start=1) if text in content]
    return line
