"""What commands share: exit statuses, options, and errors as messages."""

from __future__ import annotations

import functools
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import click

from harness.errors import InvalidInput, InvalidRequest

AS_EXPECTED, NOT_AS_EXPECTED, INVALID, CRASHED = 0, 1, 2, 3
# States per system of a report; the check command's own default is the same as quick.
PROFILES = {"quick": 1000, "nightly": 100_000}


def told(command: Callable[..., None]) -> Callable[..., None]:
    """Turn the errors of input files and names into one message and exit status 2."""

    @functools.wraps(command)
    def wrapper(*arguments: Any, **options: Any) -> None:
        try:
            command(*arguments, **options)
        except (InvalidInput, InvalidRequest) as error:
            tell([error])

    return wrapper


def tell(problems: Sequence[Exception]) -> None:
    """Print each problem; exit with status 2 if there is one."""
    for problem in problems:
        click.echo(f"harness: {problem}", err=True)
    if problems:
        sys.exit(INVALID)


library_option = click.option(
    "--library",
    "library_path",
    metavar="DIR",
    help="Folder with systems/, mjcf/ and urdf/, or the name of an installed library, instead of the built-in one.",
)
seed_option = click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, help="Seed of the sampled states.")
json_option = click.option("--json", "json_path", type=click.Path(dir_okay=False), help="Write versions and records to this file.")
workers_option = click.option("--workers", type=click.IntRange(min=1), help="Local worker processes; one per CPU by default.")
time_limit_option = click.option(
    "--time-limit",
    type=click.FloatRange(min=0, min_open=True),
    default=60.0,
    show_default=True,
    help="Seconds an engine may take over one batch.",
)
long_time_limit_option = click.option(
    "--time-limit",
    type=click.FloatRange(min=0, min_open=True),
    default=600.0,
    show_default=True,
    help="Seconds one task may take.",
)
_pem_file = click.Path(exists=True, dir_okay=False)


def scheduler_option(command: Callable[..., None]) -> Callable[..., None]:
    """``--scheduler`` and its ``--tls-`` files, which a command gets as one argument ``scheduler``: a ``Scheduler``, or None."""

    @click.option(
        "--scheduler",
        "address",
        metavar="ADDRESS",
        help="Use the dask.distributed cluster at this address. "
        "Who can reach the scheduler can run code as you; use tls:// on shared machines.",
    )
    @click.option("--tls-ca-file", "ca_file", type=_pem_file, help="Certificate of the authority that a tls:// cluster trusts.")
    @click.option("--tls-cert", "certificate", type=_pem_file, help="Certificate to show to a tls:// cluster.")
    @click.option("--tls-key", "key", type=_pem_file, help="Key of that certificate.")
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


directory_option = click.option(
    "--out",
    "directory",
    type=click.Path(file_okay=False, path_type=Path),
    default=Path("reports"),
    show_default=True,
    help="Folder of the report and its history.",
)


def make_folder(directory: Path) -> None:
    """Make the folder of a report where it is missing.

    Raises:
        InvalidInput: it cannot be made.
    """
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InvalidInput(directory, None, f"cannot be made: {error.strerror}; name a folder that can be written with --out") from error
