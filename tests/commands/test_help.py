"""Help texts: whole sentences in the list of commands, nothing cut off at 80 columns, and examples that the command takes."""

from __future__ import annotations

import shlex

import click
import pytest
from click.testing import CliRunner

from harness.cli import main
from harness.commands import SECTIONS

COMMANDS = main.list_commands(click.Context(main))


def help_of(*words: str) -> str:
    done = CliRunner().invoke(main, [*words, "--help"], terminal_width=80)
    assert done.exit_code == 0, done.output
    return done.output


def examples_of(*words: str) -> list[list[str]]:
    """The commands in the section of examples, which stands between the text and the options."""
    section = help_of(*words).partition("\n  Examples:\n")[2].partition("\n\n")[0]
    return [shlex.split(line) for line in section.splitlines()]


def command_called(name: str) -> click.Command:
    found = main.get_command(click.Context(main), name)
    assert found is not None
    return found


def test_no_line_in_the_list_of_commands_is_cut_off() -> None:
    sections = [help_of().partition(f"\n{section}:\n")[2].partition("\n\n")[0].splitlines() for section in SECTIONS]
    assert all(sections)
    listed = [line for section in sections for line in section]
    assert sorted(line.split()[0] for line in listed) == COMMANDS
    assert [line for line in listed if not line.endswith(".") or line.endswith("...")] == []


@pytest.mark.parametrize("words", [[], *([name] for name in COMMANDS)], ids=["harness", *COMMANDS])
def test_nothing_is_cut_off_at_80_columns(words: list[str]) -> None:
    lines = help_of(*words).splitlines()
    assert [line for line in lines if len(line) > 80] == []
    # Click puts dots where it cuts; those of "[NAME]..." mean repetition.
    assert [line for line in lines if line.endswith("...") and not line.startswith("Usage:")] == []


@pytest.mark.parametrize("name", COMMANDS)
def test_every_option_says_what_it_does(name: str) -> None:
    options = [option for option in command_called(name).params if isinstance(option, click.Option)]
    assert [option.name for option in options if not (option.help or "").endswith(".")] == []


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_has_examples_that_it_takes(name: str) -> None:
    examples = examples_of(name)
    assert len(examples) >= 2
    for program, command, *arguments in examples:
        assert (program, command) == ("harness", name)
        command_called(name).make_context(name, arguments)  # raises UsageError


def test_the_program_s_own_help_has_examples_and_exit_statuses() -> None:
    examples = examples_of()
    assert len(examples) >= 3
    for program, name, *arguments in examples:
        assert program == "harness"
        command_called(name).make_context(name, arguments)
    for status in ("0 ", "1 ", "2 ", "3 "):
        assert f"\n    {status}" in help_of()
