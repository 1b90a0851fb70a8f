"""Help texts: whole sentences in the list of commands, and an example in each that the command takes."""

from __future__ import annotations

import re
import shlex

import click
import pytest
from click.testing import CliRunner

from harness.cli import main

COMMANDS = main.list_commands(click.Context(main))


def help_of(*words: str) -> str:
    done = CliRunner().invoke(main, [*words, "--help"], terminal_width=80)
    assert done.exit_code == 0, done.output
    return done.output


def test_no_line_in_the_list_of_commands_is_cut_off() -> None:
    listed = help_of().partition("Commands:\n")[2].splitlines()
    assert [line.split()[0] for line in listed] == COMMANDS
    assert [line for line in listed if not line.endswith(".") or line.endswith("...")] == []


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_has_an_example_that_it_takes(name: str) -> None:
    [example] = re.findall(r"^ +Example: (.+)$", help_of(name), re.MULTILINE)
    program, command, *arguments = shlex.split(example)
    assert (program, command) == ("harness", name)
    found = main.get_command(click.Context(main), name)
    assert found is not None
    found.make_context(name, arguments)  # raises UsageError
