"""Optional engines on robots' files, each in an environment of its own: what they answer is explained, and a wrong number is not."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from comparison.robots import FILES, edited, meant_by
from lxml import etree
from robot_files import EVERYTHING
from support import environment_in

from harness.comparison import judgement
from harness.comparison.robot_library import RobotLibrary, ask_engine, engine_of, engines_of_files
from harness.engines import describe_engines
from harness.engines.adapters.adam import with_origins
from harness.explain.meant import question_of
from harness.library import Stance
from harness.programs.numbers import UNIT_ROUNDOFF
from harness.results.comparison import SubjectRecord
from harness.storage import cache_directory
from harness.workers import Workers

pytestmark = pytest.mark.nightly

OPTIONAL = {name: caller.formats for name, caller in engines_of_files().items() if caller.optional}
URDF, MJCF = (sorted(name for name, formats in OPTIONAL.items() if kind in formats) for kind in ("urdf", "mjcf"))
IMPORTED_BY_NEWTON = {"newton", "newton_mujoco"}
# What a plain engine reads otherwise in a file whose joints have dampers.
OTHERWISE = {"adam": "gravity", "dartpy": "implicit dampers", "idyntree": "joint damping", "pybullet": "inertia of collision shapes"}


@pytest.fixture(scope="module", autouse=True)
def cache(environments: Path) -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("HARNESS_CACHE", str(environments))
        yield
    describe_engines(RobotLibrary.without_files(), Workers)


def record_of(
    engine: str, path: Path, asked: Path | None = None, stance: Stance = Stance.PLAIN, floating_base: bool = False
) -> SubjectRecord:
    """The record on a file of what an engine answers on it, or at the same states on the file ``asked`` instead."""
    environment_in(cache_directory(), engine)
    found = meant_by(path, floating_base)
    question = question_of(found, stance)
    question = replace(question, request=replace(question.request, path=asked or path))
    return judgement.judge(found, ask_engine(engine, question), engine, stance)


def arm(folder: Path, changes: tuple[tuple[str, str], ...] = ()) -> Path:
    """A copy of the arm's URDF with every origin written out, without which adam reads no file."""
    path = edited(FILES / "arm.urdf", folder, *changes)
    path.write_text(with_origins(etree.fromstring(path.read_bytes())))
    return path


@pytest.mark.parametrize("stance", list(Stance))
@pytest.mark.parametrize("name", ["arm", "mimic", "massless_foot", "impossible", "planar"])
@pytest.mark.parametrize("engine", URDF)
def test_every_answer_on_a_urdf_agrees_or_is_explained_or_refused(engine: str, name: str, stance: Stance) -> None:
    record = record_of(engine, FILES / f"{name}.urdf", stance=stance)
    assert record.explained and record.outcome in ("agrees", "explained", "refused"), record


@pytest.mark.parametrize("stance", list(Stance))
@pytest.mark.parametrize("name", ["arm.xml", ""])
@pytest.mark.parametrize("engine", MJCF)
def test_every_answer_on_an_mjcf_agrees_or_is_explained_or_refused(engine: str, name: str, stance: Stance, tmp_path: Path) -> None:
    path = FILES / name if name else tmp_path / "everything.xml"
    if not name:
        path.write_text(EVERYTHING)
    record = record_of(engine, path, stance=stance)
    # Newton's importer makes other joints of one body, and passes over those in frames, without a word.
    misread = ("misreads",) if engine in IMPORTED_BY_NEWTON and not name else ()
    assert record.explained and record.outcome in ("agrees", "explained", "refused", *misread), record


@pytest.mark.parametrize("stance", list(Stance))
@pytest.mark.parametrize("engine", URDF)
def test_a_wrong_number_is_unexplained_and_named(engine: str, stance: Stance, tmp_path: Path) -> None:
    """The engine is asked about a copy in which one mass is another, by more than the engine rounds."""
    (tmp_path / "other").mkdir()
    size = 1e-6 if engine_of(engine).unit_roundoff == UNIT_ROUNDOFF else 1e-2
    path, other = arm(tmp_path), arm(tmp_path / "other", (('<mass value="1"/>', f'<mass value="{1 + size!r}"/>'),))
    record = record_of(engine, path, other, stance)
    assert record.outcome == "unexplained" and "the engine behaves as with" in record.rest[0]


@pytest.mark.parametrize("engine", sorted(OTHERWISE))
def test_without_its_readings_a_plain_answer_is_unexplained(engine: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    path = arm(tmp_path)
    record = record_of(engine, path)
    assert record.explained and OTHERWISE[engine] in {one.name for one in record.readings}
    monkeypatch.setattr("harness.explain.as_read.find_readings", lambda *_: [])
    assert not record_of(engine, path).explained


@pytest.mark.parametrize("engine", URDF)
def test_a_floating_base_is_put_under_the_root(engine: str, tmp_path: Path) -> None:
    base = '<link name="ground"><inertial><mass value="4"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>'
    path = arm(tmp_path, (('<link name="ground"/>', base),))
    record = record_of(engine, path, stance=Stance.AIDED, floating_base=True)
    assert record.outcome == ("refused" if engine == "pybullet" else "agrees"), record
