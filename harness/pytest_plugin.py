"""The cross-check as a pytest regression for any library: one test per system and subject.

``pytest --harness-library DIR`` collects ``DIR/systems/*.py``; the ini option ``harness_library`` does
the same for a project's own runs. No engine is imported when this module loads.
"""

from __future__ import annotations

import argparse
import contextlib
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from harness.library import BUILT_IN_NAME

if TYPE_CHECKING:
    from harness.crosscheck.run import CrossCheck
    from harness.engines import Subject
    from harness.library import Library
    from harness.results.cross_check import Cause, HeldDifference, SuperfluousPart
    from harness.results.records import Record
    from harness.study import Part
    from harness.workers import Workers

_DEFAULT_STATES = 1000
_TLS_FILES = {
    "ca-file": "certificate of the authority that a tls:// cluster trusts",
    "cert": "certificate to show to a tls:// cluster",
    "key": "key of that certificate",
}


def _above_zero(text: str) -> int:
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f"{value} is not above zero")
    return value


def _seconds(text: str) -> float:
    value = float(text)
    if not value > 0:
        raise argparse.ArgumentTypeError(f"{value} is not above zero")
    return value


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("harness", "cross-check of physics engines")
    group.addoption(
        "--harness-library",
        metavar="DIR",
        help=f"cross-check this library, a folder or an installed one's name ('{BUILT_IN_NAME}' for the textbook mechanisms)",
    )
    group.addoption(
        "--harness-robots",
        metavar="FOLDER",
        help="compare the engines on every robot of this folder, a test for each file and engine; expected_robots.toml there says "
        "which outcomes are expected",
    )
    group.addoption(
        "--harness-states",
        type=_above_zero,
        metavar="N",
        help=f"states per system (default: harness_states of the settings, else {_DEFAULT_STATES})",
    )
    group.addoption("--harness-seed", type=int, default=0, metavar="S", help="seed of the sampled states (default: %(default)s)")
    group.addoption("--harness-subject", action="append", default=[], metavar="ENGINE/FORMAT", help="only this subject; repeatable")
    group.addoption("--harness-workers", type=_above_zero, metavar="N", help="worker processes (default: one per CPU)")
    group.addoption(
        "--harness-scheduler",
        metavar="ADDRESS",
        help="use the dask.distributed cluster at this address. Who can reach the scheduler can run code as you; "
        "use tls:// on shared machines",
    )
    for file, content in _TLS_FILES.items():
        group.addoption(f"--harness-tls-{file}", metavar="FILE", help=content)
    group.addoption(
        "--harness-time-limit",
        type=_seconds,
        default=60.0,
        metavar="SECONDS",
        help="seconds an engine may take over one batch (default: %(default)s)",
    )
    parser.addini("harness_library", "library the cross-check runs over when --harness-library is not given", default="")
    parser.addini("harness_states", "states per system when --harness-states is not given", default=str(_DEFAULT_STATES))


def _states_of_settings(config: pytest.Config) -> int:
    text = config.getini("harness_states")
    try:
        return _above_zero(text)
    except (ValueError, argparse.ArgumentTypeError) as error:
        raise pytest.UsageError(f"harness_states in the settings is {text!r}; expected a whole number above zero") from error


def pytest_configure(config: pytest.Config) -> None:
    if config.getoption("--harness-robots"):
        from harness.pytest_robots import register

        register(config)
    chosen = config.getoption("--harness-library") or config.getini("harness_library")
    if not chosen:
        return
    from harness.errors import InvalidInput
    from harness.library import Library

    try:
        # From the folder where pytest was started; a name where there is no such folder.
        directory = config.invocation_params.dir / chosen
        library = Library.at(None if chosen == BUILT_IN_NAME else directory if directory.exists() else chosen)
    except InvalidInput as error:
        raise pytest.UsageError(str(error)) from error
    config.pluginmanager.register(_Regression(config, library, chosen), "harness-regression")
    # The option asks for the library; arguments on the command line may ask for something else besides.
    if config.getoption("--harness-library"):
        if config.args_source is not pytest.Config.ArgsSource.ARGS:
            config.args[:] = []
        config.args.append(str(library.systems))


class _Regression:
    """Collects one library and runs it once, however many of its tests are selected.

    Where pytest-xdist spreads the tests over processes, each process runs the systems that come to it, one by one.
    """

    def __init__(self, config: pytest.Config, library: Library, chosen: str) -> None:
        self.config = config
        self.library = library
        self.chosen = chosen
        self._exit = contextlib.ExitStack()
        self._started: dict[str, Workers] = {}
        self._distributed = hasattr(config, "workerinput")
        # By the systems that run together; all of them under one name where nothing is distributed.
        self._checks: dict[str, tuple[CrossCheck, Iterator[Part]]] = {}
        self._known: dict[tuple[str, str], Record] = {}
        self._causes: dict[str, dict[str, Cause]] = {}
        self._described = False
        self._wanted: tuple[list[str], list[str]] = ([], [])
        self.states = config.getoption("--harness-states") or _states_of_settings(config)

    def pytest_collect_file(self, file_path: Path, parent: pytest.Collector) -> SystemFile | None:
        if file_path.parent != self.library.systems or file_path.suffix != ".py" or file_path.stem.startswith("_"):
            return None
        return SystemFile.from_parent(parent, path=file_path, regression=self)

    def pytest_collection_finish(self, session: pytest.Session) -> None:
        items = [item for item in session.items if isinstance(item, CrossCheckItem) and item.regression is self]
        self._wanted = sorted({item.system for item in items}), sorted({item.subject for item in items})

    def pytest_sessionfinish(self) -> None:
        self._exit.close()

    def pytest_report_header(self) -> str:
        seed = self.config.getoption("--harness-seed")
        return f"harness: library {self.library.name}, {self.states} states per system, seed {seed}"

    def subjects(self) -> list[Subject]:
        """The subjects asked for."""
        from harness.engines import describe_engines, select_subjects
        from harness.errors import InvalidInput, InvalidRequest

        if not self._described:
            self._described = bool(describe_engines(self.library, self._new_workers))
        try:
            return select_subjects(self.library, self.config.getoption("--harness-subject"))
        except (InvalidInput, InvalidRequest) as error:
            raise pytest.UsageError(str(error)) from error

    def record(self, system: str, subject: str) -> Record:
        """The record of one pair, running the cross-check until it comes."""
        while (system, subject) not in self._known:
            self._advance(system)
        return self._known[system, subject]

    def _advance(self, system: str) -> None:
        _, coming = self._check_of(system)
        [record] = next(coming).value.records
        self._known[record.system, record.subject] = record

    def superfluous(self, system: str, subject: str) -> list[SuperfluousPart]:
        """Superfluous parts of the model of a pair whose record is known."""
        check, _ = self._check_of(system)
        return [part for part in check.result().superfluous if (part.system, part.subject) == (system, subject)]

    def differs(self, system: str, subject: str) -> list[HeldDifference]:
        """What a pair whose record is known holds otherwise than most subjects do; of a finding that is nobody's, all pairs have it.

        None where a record of the system is not as expected: there the motion feels the difference, and that record fails.
        """
        check, _ = self._check_of(system)
        found = [finding for finding in check.result().differs if finding.system == system and finding.fails]
        own = [finding for finding in found if subject in finding.subjects or not finding.subjects]
        return own if own and all(record.as_expected for record in self._all_of(system)) else []

    def _all_of(self, system: str) -> list[Record]:
        """The records of all subjects on a system, running the cross-check until they come."""
        check, _ = self._check_of(system)
        while len([known for known in self._known if known[0] == system]) < len(check.subjects_of(system)):
            self._advance(system)
        return [record for record in self._known.values() if record.system == system]

    def cause(self, system: str, subject: str) -> tuple[Cause | None, str]:
        """Why a record that is known is not as expected, None where there is nothing to say; and the command that says all."""
        check, _ = self._check_of(system)
        if system not in self._causes:
            from harness.diagnosis.causes import EVALUATIONS_IN_ALL, LEAST_EVALUATIONS, find_causes
            from harness.diagnosis.model_side import EVALUATIONS

            # The party at fault follows from those that agree.
            records = self._all_of(system)
            diagnosed = sum(map(len, self._causes.values()))
            evaluations = EVALUATIONS if diagnosed * EVALUATIONS < EVALUATIONS_IN_ALL else LEAST_EVALUATIONS
            found = find_causes(check.settings, records, self._workers("diagnosis"), evaluations=evaluations, crashes=check.crashes)
            self._causes[system] = {cause.subject: cause for cause in found}
        return self._causes[system].get(subject), check.settings.diagnosis(system)

    def _check_of(self, system: str) -> tuple[CrossCheck, Iterator[Part]]:
        """The cross-check that ``system`` belongs to, and its records to come."""
        from harness.crosscheck.run import CrossCheck
        from harness.crosscheck.settings import Settings
        from harness.study import run_study

        group = system if self._distributed else ""
        if group not in self._checks:
            settings = Settings(
                library=self.library,
                names=[system] if self._distributed else self._wanted[0],
                subjects=self._wanted[1],
                states=self.states,
                seed=self.config.getoption("--harness-seed"),
                replay_options=[] if self.chosen == BUILT_IN_NAME else ["--library", self.chosen],
            )
            check = CrossCheck(settings)
            self._checks[group] = check, run_study(check, self._workers("check"))
        return self._checks[group]

    def _workers(self, work: str) -> Workers:
        """The workers of "check" or "diagnosis", started on first use: a diagnosis comes while records of the check are outstanding."""
        if work not in self._started:
            self._started[work] = self._exit.enter_context(self._new_workers())
        return self._started[work]

    def _new_workers(self) -> Workers:
        from harness.workers import Scheduler, Workers

        option = self.config.getoption
        count = option("--harness-workers") or (1 if self._distributed else None)
        address = option("--harness-scheduler")
        scheduler = Scheduler(address, *(option(f"--harness-tls-{file}") for file in _TLS_FILES)) if address else None
        return Workers(count, scheduler, option("--harness-time-limit"))


class SystemFile(pytest.File):
    """A system file, which holds one test per subject, and per variant and subject. It is not imported here."""

    def __init__(self, *, regression: _Regression, **options: Any) -> None:
        super().__init__(**options)
        self.regression = regression

    def collect(self) -> Iterator[CrossCheckItem]:
        from harness.engines import asked_of

        library = self.regression.library
        names = library.names_in(self.path)
        for name in [*names, *(variant for variant in library.variant_names() if library.system_of(variant) in names)]:
            for subject in map(str, asked_of(library, name, self.regression.subjects())):
                # The members of a family and variants share a file, so their tests carry the name too.
                title = subject if name == self.path.stem else f"{name}:{subject}"
                yield CrossCheckItem.from_parent(self, name=title, regression=self.regression, system=name, subject=subject)


class CrossCheckItem(pytest.Item):
    """One subject on one system: passes where the verdict is the expected one, and neither a superfluous part nor a difference fails."""

    def __init__(self, *, regression: _Regression, system: str, subject: str, **options: Any) -> None:
        super().__init__(**options)
        self.regression = regression
        self.system = system
        self.subject = subject

    def runtest(self) -> None:
        record = self.regression.record(self.system, self.subject)
        self.user_properties += [("verdict", record.verdict), ("backward_error", record.backward_error), ("states", record.states)]
        if not record.as_expected:
            pytest.fail(_explained(record, *self.regression.cause(self.system, self.subject)), pytrace=False)
        if superfluous := self.regression.superfluous(self.system, self.subject):
            text = "\n".join(["superfluous parts of the model:", *(f"  {part}" for part in superfluous)])
            if any(part.fails for part in superfluous):
                pytest.fail(text, pytrace=False)
            warnings.warn(pytest.PytestWarning(text), stacklevel=2)
        if differs := self.regression.differs(self.system, self.subject):
            pytest.fail("\n".join(["not held alike after loading:", *(f"  {finding}" for finding in differs)]), pytrace=False)

    def reportinfo(self) -> tuple[Path, int | None, str]:
        return self.path, None, f"{self.system}[{self.subject}]"


def _explained(record: Record, cause: Cause | None, diagnosis: str) -> str:
    """Everything a person needs to go on from an unexpected record, with the cause as far as it is known."""
    if cause is None:
        return record.explanation
    of_cause = [f"  {cause.inference}", *(f"  {term}" for term in cause.terms), f"  cause: {cause.first_line}"]
    return "\n".join([record.explanation, *dict.fromkeys(of_cause), f"  the whole diagnosis: {diagnosis}"])
