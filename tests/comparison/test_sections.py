"""What a comparison prints: files of one name are told apart, and "nothing" is said where everybody was asked and answered."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from rooms import REPOSITORY
from support import harness

from harness.results.comparison import names_apart

ARM = REPOSITORY / "urdf" / "arm_2r.urdf"
NOTHING = "nothing: every answer agrees"


@pytest.mark.parametrize(
    ("paths", "names"),
    [
        (["/a/b/r.urdf"], ["r.urdf"]),
        (["/a/b/r.urdf", "/a/b/s.urdf"], ["r.urdf", "s.urdf"]),
        (["/a/b/r.urdf", "/c/b/r.urdf", "s.urdf"], ["a/b/r.urdf", "c/b/r.urdf", "s.urdf"]),
        (["r.urdf", "old/r.urdf"], ["r.urdf", "old/r.urdf"]),
    ],
)
def test_files_have_as_many_folders_in_their_names_as_tell_them_apart(paths: list[str], names: list[str]) -> None:
    assert list(names_apart(paths).values()) == names


def test_two_files_of_one_name_have_a_column_each(tmp_path: Path) -> None:
    for folder, mass in (("old", "2"), ("new", "2.5")):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "r.urdf").write_text(ARM.read_text().replace('mass value="2"', f'mass value="{mass}"'))
    for command in (["compare", "old/r.urdf", "new/r.urdf"], ["diagnose", "old/r.urdf", "--urdf", "new/r.urdf"]):
        done = harness(*command, cwd=tmp_path)
        said = "old/r.urdf and new/r.urdf differ: mass of link fore, 2 (old/r.urdf:23) against 2.5 (new/r.urdf:23), changes qdd by "
        assert done.stdout.startswith(said)
        heads = next(line for line in done.stdout.splitlines() if line.startswith("difference"))
        assert heads.split()[1:3] == ["old/r.urdf", "new/r.urdf"]
        assert re.search(r"^mass of link fore +2, old/r.urdf:23 +2.5, new/r.urdf:23 ", done.stdout, re.MULTILINE)


def test_of_a_file_that_is_missing_nothing_is_said_to_agree(tmp_path: Path) -> None:
    done = harness("compare", "missing.urdf", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stdout.startswith("missing.urdf cannot be read: ")
    whole = harness("compare", "missing.urdf", "--verbose", cwd=tmp_path).stdout
    assert NOTHING not in whole and "no answer: no engine was asked about missing.urdf" in whole


def test_who_refuses_a_file_has_not_agreed(tmp_path: Path) -> None:
    (tmp_path / "r.urdf").write_text(ARM.read_text())
    command = ("compare", "r.urdf", "--verbose", "--subject")
    refused = harness(*command, "mujoco/urdf", cwd=tmp_path).stdout
    assert refused.startswith("r.urdf: no engine gives an answer that can be judged. MuJoCo refuses the file: ")
    assert NOTHING not in refused and "no answer: mujoco/urdf, plain, refuses r.urdf" in refused
    answered = harness(*command, "pinocchio/urdf", cwd=tmp_path).stdout
    assert answered.startswith("r.urdf: Pinocchio agrees with the file to rounding.")
    assert NOTHING in answered and "no answer" not in answered
