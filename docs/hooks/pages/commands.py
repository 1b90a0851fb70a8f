"""The reference of the command line, from what ``--help`` prints."""

from __future__ import annotations

import re

import click

from harness.cli import main
from pages.made import Made, fenced, literal, table

SECTION = "Reference"


def pages() -> Made:
    """One page with every command."""
    context = click.Context(main, info_name="harness")
    lines = ["# Commands\n", "Every command as `--help` describes it.\n"]
    for name in main.list_commands(context):
        command = main.get_command(context, name)
        assert command is not None
        lines += [f"## harness {name}\n", *described(command, click.Context(command, parent=context, info_name=name))]
    return Made({"reference/commands.md": "\n".join(lines)}, ["reference/commands.md"])


def described(command: click.Command, context: click.Context) -> list[str]:
    """Usage, description, examples and options of one command."""
    usage = command.get_usage(context).partition(":")[2]
    lines = [fenced(" ".join(usage.split()))]
    for paragraph in re.split(r"\n\s*\n", (command.help or "").strip()):
        if paragraph.startswith("\b"):
            head, *examples = (line.strip() for line in paragraph.removeprefix("\b").strip().splitlines())
            lines += [f"{literal(head)}\n", fenced("\n".join(examples))]
        else:
            lines.append(f"{literal(' '.join(paragraph.split()))}\n")
    options = [record for parameter in command.get_params(context) if (record := parameter.get_help_record(context))]
    lines.append(table(["option", "meaning"], [[f"`{names}`", literal(meaning)] for names, meaning in options]))
    return lines
