"""The first lines that four users read are those of the golden file, which a person has read."""

from __future__ import annotations

import pytest
from first_lines import GOLDEN, MOST_LINES, MOST_LINES_OF_A_PAIR, USERS, User, first_line, of_others, typed

HELD = dict(section.split("\n", 1) for section in GOLDEN.read_text(encoding="utf-8").strip().split("\n\n\n"))


def held(user: User) -> dict[str, str]:
    """Exit status and first line of each command of a user, in the order in which they are typed."""
    blocks = (block.splitlines() for block in HELD[f"# {user.title}"].strip().split("\n\n"))
    return {f"{number} {command}": said for number, (command, said) in enumerate(blocks)}


def hold(user: User) -> None:
    found = {}
    for number, (command, done) in enumerate(typed(user)):
        found[f"{number} $ harness {command}"] = f"{done.returncode}: {first_line(done)}"
        words = command.split()
        if words[0] == "compare" and done.returncode < 2:
            files = [word for word in words[1:] if not word.startswith("-")]
            assert len(done.stdout.splitlines()) <= (MOST_LINES if len(set(files)) == 1 else MOST_LINES_OF_A_PAIR), done.stdout
    assert found == held(user), "read what is new, then write it by python tests/first_lines.py"


@pytest.mark.ci
@pytest.mark.parametrize("name", USERS)
def test_a_user_reads_the_first_lines_that_a_person_has_read(name: str) -> None:
    hold(USERS[name])


@pytest.mark.nightly
@pytest.mark.robots
def test_first_lines_on_files_of_others() -> None:
    hold(of_others())


def test_the_golden_file_has_every_user_and_no_number_of_a_machine() -> None:
    text = GOLDEN.read_text(encoding="utf-8")
    assert {f"# {user.title}" for user in USERS.values()} <= HELD.keys()
    for sign in (" ms", " µs", "/tmp", "/home", "cpus", "load "):
        assert sign not in text
