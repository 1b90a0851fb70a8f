"""The options and exit statuses that commands share, and errors as messages."""

from __future__ import annotations

import functools
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any, NoReturn, get_args, get_origin, get_type_hints

import click

from harness.commands.frame.terminal import say
from harness.results.detail import Detail
from harness.results.records import ACCELERATIONS

AS_EXPECTED, NOT_AS_EXPECTED, INVALID, CRASHED = 0, 1, 2, 3
# As sysexits.h has EX_SOFTWARE, and as shells count an end by SIGINT and by SIGTERM.
INTERNAL, INTERRUPTED, TERMINATED = 70, 130, 143
# States per system of a report; the check command's own default is the same as quick.
STATES_OF_PROFILE = {"quick": 1000, "nightly": 100_000}


def report_errors(problems: Sequence[Exception]) -> None:
    """Print each problem, further lines of it indented; exit with status 2 if there is one."""
    for problem in problems:
        first, *others = str(problem).split("\n")
        say(f"harness: {first}", *(f"  {line.strip()}" for line in others), err=True)
    if problems:
        sys.exit(INVALID)


def report_own_fault() -> NoReturn:
    """Say that the harness is to blame for what was printed, and exit with status 70."""
    blame = "internal error: this is a fault of the harness, not of your files"
    report = "report it where you have the harness from, with the lines above, the command and what `harness list` prints"
    say(f"harness: {blame}; please {report}", err=True)
    sys.exit(INTERNAL)


def takes(asked: type[Any]) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Give a command its own options and arguments as one argument ``asked``, a dataclass.

    Each field declares its option where it declares its type: ``motion: Annotated[bool, click.option("--motion", is_flag=True)]``.
    """
    hints = get_type_hints(asked, include_extras=True)
    declared = {name: get_args(hint)[1] for name, hint in hints.items() if get_origin(hint) is Annotated}

    def decorate(command: Callable[..., Any]) -> Callable[..., Any]:
        @functools.wraps(command)
        def wrapper(*arguments: Any, **given: Any) -> Any:
            own = {name: given.pop(name) for name in declared}
            return command(*arguments, asked=asked(**own), **given)

        return functools.reduce(lambda decorated, option: option(decorated), reversed(declared.values()), wrapper)

    return decorate


_PEM_FILE = click.Path(exists=True, dir_okay=False)


def scheduler_option(command: Callable[..., None]) -> Callable[..., None]:
    """``--scheduler`` and its ``--tls-`` files, which a command gets as one argument ``scheduler``: a ``Scheduler``, or None."""

    @click.option(
        "--scheduler",
        "address",
        metavar="ADDRESS",
        help="Use the dask.distributed cluster at this address. "
        "Who can reach the scheduler can run code as you; use tls:// on shared machines.",
    )
    @click.option("--tls-ca-file", "ca_file", type=_PEM_FILE, help="Certificate of the authority that a tls:// cluster trusts.")
    @click.option("--tls-cert", "certificate", type=_PEM_FILE, help="Certificate to show to a tls:// cluster.")
    @click.option("--tls-key", "key", type=_PEM_FILE, help="Key of that certificate.")
    @functools.wraps(command)
    def wrapper(
        *arguments: Any, address: str | None, ca_file: str | None, certificate: str | None, key: str | None, **options: Any
    ) -> None:
        from harness.workers import Scheduler

        scheduler = None if address is None else Scheduler(address, ca_file, certificate, key)
        if scheduler is None and (ca_file or certificate or key):
            raise click.UsageError("--tls-ca-file, --tls-cert and --tls-key belong to --scheduler")
        command(*arguments, scheduler=scheduler, **options)

    return wrapper


def detail_option(command: Callable[..., None]) -> Callable[..., None]:
    """``--all`` and ``--verbose``, which a command gets as one argument ``detail``."""

    @click.option("--all", "every_row", is_flag=True, help="Print every row of the tables, however little it matters.")
    @click.option("--verbose", is_flag=True, help="Print every row, and all that is known of each.")
    @functools.wraps(command)
    def wrapper(*arguments: Any, every_row: bool, verbose: bool, **options: Any) -> None:
        detail = Detail.VERBOSE if verbose else Detail.ALL if every_row else Detail.BRIEF
        command(*arguments, detail=detail, **options)

    return wrapper


class _Size(click.ParamType[int]):
    """A size of memory, which a command gets in bytes."""

    name = "size"

    def convert(self, value: Any, parameter: click.Parameter | None, context: click.Context | None) -> int:
        from harness.workers.memory import parse_size

        try:
            return value if isinstance(value, int) else parse_size(value)
        except ValueError as error:
            self.fail(str(error), parameter, context)


BY_NAME: dict[str, Callable[..., Any]] = {
    "detail": detail_option,
    "library": click.option(
        "--library",
        "library_path",
        metavar="DIR",
        help="Folder with systems/, mjcf/ and urdf/, or the name of an installed library, instead of the built-in one.",
    ),
    "json": click.option(
        "--json", "json_path", type=click.Path(dir_okay=False), help="Write versions and records to this file; - is standard output."
    ),
    "seed": click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Seed of the sampled states."),
    "workers": click.option(
        "--workers", type=click.IntRange(min=1), help="Local worker processes; one per CPU by default. Fewer need less memory."
    ),
    "memory_limit": click.option(
        "--memory-limit",
        type=_Size(),
        metavar="SIZE",
        help="Memory that each worker process, and each process of an engine, may hold, as 4GiB or 500MiB; what needs more is refused. By "
        "default half of the machine's memory divided by the workers, at least 2GiB and at most 8GiB.",
    ),
    "floating_base": click.option("--floating-base", is_flag=True, help="Put a free joint under the root link of each URDF."),
    "aided": click.option(
        "--aided",
        is_flag=True,
        help="Supply engines with what they leave out of a robot's FILE.",
    ),
    "scheduler": scheduler_option,
    "directory": click.option(
        "--out",
        "directory",
        type=click.Path(file_okay=False, path_type=Path),
        default=Path("reports"),
        show_default=True,
        help="Folder of the report and its history.",
    ),
}
contacts_option = click.option("--contacts", is_flag=True, help="Also switch on the contacts of a robot's FILE.")
subjects_option = click.option("--subject", "subjects", multiple=True, metavar="ENGINE[/FORMAT]", help="Only this subject; repeatable.")


def quantities_option(without: str) -> Callable[..., Any]:
    """--quantity, repeatable; ``without`` says what is compared where it is not given."""
    help_text = f"What is compared, as mass_matrix or reactions, derivatives for both of these, or all; repeatable. Without it {without}."
    return click.option("--quantity", "quantities", multiple=True, metavar="NAME", help=help_text)


quantity_option = click.option(
    "--quantity", metavar="NAME", default=ACCELERATIONS, show_default=True, help="Quantity to compare, such as mass_matrix or reactions."
)


def states_option(default: int = STATES_OF_PROFILE["quick"], of: str = "system") -> Callable[..., Any]:
    """--states with its default; ``of`` says what each of which is asked at so many."""
    return click.option("--states", type=click.IntRange(min=1), default=default, show_default=True, help=f"States per {of}.")


def time_limit_option(seconds: float | None, shown: bool | str = True) -> Callable[..., Any]:
    """--time-limit with its default [s], which is None where the command finds it; ``shown`` says then what it finds."""
    return click.option(
        "--time-limit",
        type=click.FloatRange(min=0, min_open=True),
        default=seconds,
        show_default=shown,
        help="Seconds that one task of a worker process may take.",
    )


# The last one comes first in help.
_STAND_INS = {
    "usd": "USD file to compare with the robot's file.",
    "urdf": "File to take as the one system's URDF model.",
    "mjcf": "File to take as the one system's MJCF model.",
}


def stand_in_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """--mjcf, --urdf and --usd, given to the command as ``stand_ins``: format to path."""

    @functools.wraps(command)
    def wrapper(*arguments: Any, **options: Any) -> Any:
        given = {model_format: options.pop(model_format) for model_format in reversed(_STAND_INS)}
        return command(*arguments, stand_ins={name: Path(path) for name, path in given.items() if path}, **options)

    for model_format, help_text in _STAND_INS.items():
        wrapper = click.option(f"--{model_format}", type=click.Path(), help=help_text)(wrapper)
    return wrapper
