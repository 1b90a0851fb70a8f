"""Libraries: a folder, or a name under which an installed distribution offers one."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from support import harness

from harness.commands.new import write_example
from harness.errors import InvalidInput, InvalidModel
from harness.files.document.xml import read_text
from harness.library import Library, installed_libraries, sizes


def distribution(site: Path, name: str, **entries: str) -> None:
    """What pip leaves of a distribution that offers libraries: its metadata."""
    information = site / f"{name}-1.0.dist-info"
    information.mkdir(parents=True)
    (information / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    lines = [f"{entry.replace('_', '-')} = {value}" for entry, value in entries.items()]
    (information / "entry_points.txt").write_text("[harness.libraries]\n" + "\n".join(lines) + "\n")


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder on Python's path with a package that holds a library and must not be imported."""
    folder = tmp_path / "site"
    package = folder / "robots" / "arms"
    write_example(package, "example")
    for file in (folder / "robots" / "__init__.py", package / "__init__.py"):
        file.write_text("raise RuntimeError('imported')\n")
    (folder / "empty_package").mkdir()
    (folder / "empty_package" / "__init__.py").touch()
    write_example(folder / "beside", "example")
    (folder / "beside" / "module_in_folder.py").write_text("raise RuntimeError('imported')\n")
    distribution(folder, "robots", my_arms="robots.arms", hollow="empty_package", gone="no_such_package.at_all", single="module_in_folder")
    monkeypatch.syspath_prepend(str(folder))
    monkeypatch.syspath_prepend(str(folder / "beside"))
    return folder


def run(site: Path, *command: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(site), os.environ.get("PYTHONPATH", "")])}
    return subprocess.run([sys.executable, "-m", *command], capture_output=True, text=True, timeout=120, cwd=cwd, env=environment)


def test_an_installed_library_is_found_by_name_and_not_imported(site: Path) -> None:
    assert {"my-arms": "robots.arms", "hollow": "empty_package"}.items() <= installed_libraries().items()
    library = Library.at("my-arms")
    assert (library.name, library.systems) == ("my-arms", site / "robots" / "arms" / "systems")
    assert library.system_names() == ["example"]
    assert not {"robots", "robots.arms"} & set(sys.modules)


def test_the_folder_of_a_single_module_may_be_the_library(site: Path) -> None:
    assert Library.at("single").models == site / "beside"


def test_a_path_wins_over_a_name_if_it_exists(site: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert Library.at("my-arms").models == site / "robots" / "arms"
    write_example(tmp_path / "my-arms", "local")
    assert Library.at("my-arms").system_names() == ["local"]


@pytest.mark.parametrize(
    ("name", "fragments"),
    [
        ("my-arm", ["no such directory", "my-arms, single", "did you mean 'my-arms'"]),
        ("hollow", ["empty_package", "no systems/ folder"]),
        ("gone", ["no_such_package.at_all", "cannot be found"]),
    ],
)
def test_what_is_no_library_is_told(site: Path, name: str, fragments: list[str]) -> None:
    with pytest.raises(InvalidInput) as caught:
        Library.at(name)
    for fragment in fragments:
        assert fragment in str(caught.value)


@pytest.mark.ci
def test_commands_and_pytest_take_the_name(site: Path, tmp_path: Path) -> None:
    checked = harness("check", "--library", "my-arms", "--states", "40", cwd=tmp_path)
    assert checked.returncode == 0, checked.stdout + checked.stderr
    assert "example" in checked.stdout
    listed = harness("list", "--library", "my-arms", cwd=tmp_path)
    assert listed.returncode == 0
    assert "installed libraries: gone, hollow, my-arms, single" in listed.stdout.splitlines()
    mistyped = harness("show", "example", "--library", "my-arm", cwd=tmp_path)
    assert mistyped.returncode == 2
    assert "did you mean 'my-arms'" in mistyped.stderr
    # Unlike the harness, pytest imports the packages it collects from.
    for file in (site / "robots").rglob("__init__.py"):
        file.write_text("")
    options = ("-p", "no:cacheprovider", "--harness-library", "my-arms", "--harness-states", "40", "--harness-workers", "1")
    tested = run(site, "pytest", *options, cwd=tmp_path)
    assert tested.returncode == 0, tested.stdout + tested.stderr
    assert "5 passed" in tested.stdout


def test_an_installed_library_is_not_written_to(site: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InvalidInput, match="installed library"):
        write_example(Path("my-arms"), "another")
    assert not Path("my-arms").exists()


def test_an_installed_library_of_no_package_is_refused(site: Path) -> None:
    distribution(site, "odd", odd=":library")
    with pytest.raises(InvalidInput, match="is an installed library whose package '' cannot be found by Python"):
        Library.at("odd")


def test_folders_that_are_no_libraries_and_libraries_without_systems_are_refused(tmp_path: Path) -> None:
    (file := tmp_path / "file").touch()
    with pytest.raises(InvalidInput, match="file: no such directory; expected a library with systems/, mjcf/ and urdf/"):
        Library.at(file)
    with pytest.raises(InvalidInput, match="holds no systems/ folder; expected a library with systems/, mjcf/ and urdf/"):
        Library.at(tmp_path)
    (tmp_path / "systems").mkdir()
    with pytest.raises(InvalidInput, match=r"systems: holds no system file; expected systems/<name>\.py"):
        Library.at(tmp_path).select([])


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("SIZES = (3, 0, 20)\n", (3, 20)), ("SYSTEM = None\n", ()), ("# SIZES = (3,)\n", ()), ("SIZES = ('three',)\n", ()),
        ("SIZES = range(3)\n", ()), ("SIZES = 3\n", ()), ("SIZES = (\n", ()), ("SIZES = other = (3,)\n", ()),
    ],
)  # fmt: skip
def test_sizes_of_a_family_are_read_without_running_it(tmp_path: Path, text: str, found: tuple[int, ...]) -> None:
    (tmp_path / "chain.py").write_text(f"raise RuntimeError\n{text}")
    assert sizes(tmp_path / "chain.py") == found and sizes(tmp_path / "gone.py") == ()


@pytest.mark.parametrize(
    ("text", "line", "problem"),
    [
        ("", None, "defines no model(n); expected a function that returns the text of the model of size n"),
        ("def model(n):\n    return n\n", None, "model(4) returned a int; expected the text of chain_4.xml"),
        ("def model(n):\n    return 1 / 0\n", 2, "ZeroDivisionError"),
        ("def model(n:\n", 1, "is not Python"),
    ],
)
def test_a_family_that_writes_no_models_is_refused_at_its_line(tmp_path: Path, text: str, line: int | None, problem: str) -> None:
    (tmp_path / "chain.py").write_text(text)
    with pytest.raises(InvalidModel) as told:
        read_text(tmp_path / "chain_4.xml")
    assert (told.value.path, told.value.line) == (tmp_path / "chain.py", line) and problem in told.value.problem
