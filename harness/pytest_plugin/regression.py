"""The cross-check of a library as tests: one per system, subject and quantity."""

from __future__ import annotations

import contextlib
import warnings
from collections.abc import Generator, Iterator
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from harness import workers
from harness.errors import InvalidInput, InvalidRequest
from harness.library import BUILT_IN_NAME, Library, names_in
from harness.results.cross_check import Cause, HeldDifference, SuperfluousPart
from harness.results.records import Record, quantity_words
from harness.study import Part, run_study

if TYPE_CHECKING:
    from harness.crosscheck.run import CrossCheck
    from harness.crosscheck.settings import Settings
    from harness.engines import Subject


@contextlib.contextmanager
def usage_errors() -> Iterator[None]:
    """Context in which what cannot be used or answered ends pytest with its message."""
    try:
        yield
    except (InvalidInput, InvalidRequest) as error:
        raise pytest.UsageError(str(error)) from error


def collect_also(config: pytest.Config, folder: Path) -> None:
    """Collect a folder; arguments on the command line may ask for something else besides."""
    if config.args_source is not pytest.Config.ArgsSource.ARGS:
        config.args[:] = []
    config.args.append(str(folder))


def register(config: pytest.Config, chosen: str, states: int) -> None:
    """Collect the library ``chosen``, a folder or an installed one's name, and compare at ``states`` per system.

    Raises:
        pytest.UsageError: there is no such library.
    """
    with usage_errors():
        # From the folder where pytest was started; a name where there is no such folder.
        directory = config.invocation_params.dir / chosen
        library = Library.at(None if chosen == BUILT_IN_NAME else directory if directory.exists() else chosen)
    config.pluginmanager.register(_Regression(_Choice(config, library, chosen, states)), "harness-regression")
    if config.getoption("--harness-library"):
        collect_also(config, library.systems)


class _Choice:
    """The library, and what of it options and settings of pytest ask for."""

    def __init__(self, config: pytest.Config, library: Library, chosen: str, states: int) -> None:
        self.option, self.library, self.states = config.getoption, library, states
        self.named: list[str] = list(config.getoption("--harness-quantity") or config.getini("harness_quantity"))
        self.is_distributed = hasattr(config, "workerinput")
        self._replay_options = [] if chosen == BUILT_IN_NAME else ["--library", chosen]

    @cached_property
    def quantities(self) -> list[str]:
        """The quantities asked for, by default accelerations."""
        from harness.truth.quantities import select_quantities

        with usage_errors():
            return select_quantities(self.named)

    @cached_property
    def subjects(self) -> list[Subject]:
        """The subjects asked for."""
        from harness.engines import describe_engines, select_subjects

        asked = self.option("--harness-subject")
        describe_engines(self.library, self.new_workers, asked)
        with usage_errors():
            return select_subjects(self.library, asked)

    def settings(self, names: list[str], subjects: list[str]) -> Settings:
        from harness.crosscheck.settings import Settings

        seed, again = self.option("--harness-seed"), self._replay_options
        return Settings(library=self.library, names=names, subjects=subjects, states=self.states, seed=seed, replay_options=again)

    def new_workers(self) -> workers.Workers:
        count = self.option("--harness-workers") or (1 if self.is_distributed else None)
        address = self.option("--harness-scheduler")
        files = (self.option(f"--harness-tls-{file}") for file in ("ca-file", "cert", "key"))
        scheduler = workers.Scheduler(address, *files) if address else None
        return workers.Workers(count, scheduler, self.option("--harness-time-limit"), self.option("--harness-memory-limit"))


class _Regression:
    """Collects one library and runs it once, however many of its tests are selected.

    Where pytest-xdist spreads the tests over processes, each process runs the systems that come to it, one by one.
    """

    def __init__(self, choice: _Choice) -> None:
        self.choice = choice
        self._exit = contextlib.ExitStack()
        self._started: dict[str, workers.Workers] = {}
        # By the systems that run together, all of them under one name where nothing is distributed; and by quantity.
        self._checks: dict[tuple[str, str], tuple[CrossCheck, Iterator[Part]]] = {}
        self._known: dict[tuple[str, str, str], Record] = {}
        self._causes: dict[str, dict[str, Cause]] = {}
        self._wanted: tuple[list[str], list[str]] = ([], [])

    @pytest.hookimpl(wrapper=True)
    def pytest_collect_file(self, file_path: Path, parent: pytest.Collector) -> Generator[None, list[object], list[object]]:
        """A system's file alone, and not as the module that pytest takes it for where the command line names it."""
        found = yield
        if file_path.parent != self.choice.library.systems or file_path.suffix != ".py" or file_path.stem.startswith("_"):
            return found
        return [SystemFile.from_parent(parent, path=file_path, regression=self)]

    def pytest_collection_finish(self, session: pytest.Session) -> None:
        items = [item for item in session.items if isinstance(item, CrossCheckItem) and item.regression is self]
        self._wanted = sorted({item.system for item in items}), sorted({item.subject for item in items})

    def pytest_sessionfinish(self) -> None:
        self._exit.close()

    def pytest_report_header(self) -> str:
        choice = self.choice
        named = f", {' '.join(choice.named)}" if choice.named else ""
        seed = choice.option("--harness-seed")
        return f"harness: library {choice.library.name}, {choice.states} states per system, seed {seed}{named}"

    def record(self, item: CrossCheckItem, subject: str = "") -> Record:
        """The record of one item, or that of another subject beside it, running the cross-check until it comes."""
        key = item.system, subject or item.subject, item.quantity
        _, coming = self._check_of(item)
        while key not in self._known:
            self._take(next(coming))
        return self._known[key]

    def _take(self, part: Part) -> None:
        [record] = part.value.records
        self._known[record.system, record.subject, record.quantity] = record

    def superfluous(self, item: CrossCheckItem) -> list[SuperfluousPart]:
        """Superfluous parts of the model of an item whose record is known."""
        check, _ = self._check_of(item)
        return [part for part in check.result().superfluous if (part.system, part.subject) == (item.system, item.subject)]

    def differs(self, item: CrossCheckItem) -> list[HeldDifference]:
        """Differences of what an item whose record is known holds from most subjects; a finding that is nobody's is one of all items.

        None where a record of the system is not as expected: there the difference is felt, and that record fails.
        """
        check, _ = self._check_of(item)
        found = [finding for finding in check.result().differs if finding.system == item.system and finding.fails]
        own = [finding for finding in found if item.subject in finding.subjects or not finding.subjects]
        return own if own and all(record.as_expected for record in self._all_of(item)) else []

    def _all_of(self, item: CrossCheckItem) -> list[Record]:
        """The records of all subjects on an item's system, running the cross-check until they come."""
        check, _ = self._check_of(item)
        return [self.record(item, str(subject)) for subject in check.subjects_of(item.system)]

    def explanation(self, item: CrossCheckItem) -> str:
        """All that a person needs to go on from an item whose record is known and not as expected, with the cause as far as it is known."""
        record, cause = self.record(item), self._cause(item)
        diagnosis = self._check_of(item)[0].settings.diagnosis(item.system, item.quantity)
        if cause is None:
            return record.explanation if not quantity_words(record.quantity) else f"{record.explanation}\n  the diagnosis: {diagnosis}"
        of_cause = [f"  {cause.inference}", *(f"  {term}" for term in cause.terms), f"  cause: {cause.first_line}"]
        return "\n".join([record.explanation, *dict.fromkeys(of_cause), f"  the whole diagnosis: {diagnosis}"])

    def _cause(self, item: CrossCheckItem) -> Cause | None:
        """Why accelerations are not as expected; None of other quantities, of which the record itself says it."""
        check, _ = self._check_of(item)
        if quantity_words(item.quantity):
            return None
        if item.system not in self._causes:
            from harness.diagnosis.causes import EVALUATIONS_IN_ALL, LEAST_EVALUATIONS
            from harness.diagnosis.wanted import find_causes
            from harness.explain.search import EVALUATIONS

            # The party at fault follows from those that agree.
            records = self._all_of(item)
            diagnosed = sum(map(len, self._causes.values()))
            evaluations = EVALUATIONS if diagnosed * EVALUATIONS < EVALUATIONS_IN_ALL else LEAST_EVALUATIONS
            found = find_causes(check.settings, records, self._workers("diagnosis"), evaluations=evaluations, crashes=check.crashes)
            self._causes[item.system] = {cause.subject: cause for cause in found}
        return self._causes[item.system].get(item.subject)

    def _check_of(self, item: CrossCheckItem) -> tuple[CrossCheck, Iterator[Part]]:
        """The cross-check that an item belongs to, and its records to come."""
        from harness.crosscheck.run import CrossCheck

        distributed = self.choice.is_distributed
        group = item.system if distributed else "", item.quantity
        if group not in self._checks:
            settings = self.choice.settings([item.system] if distributed else self._wanted[0], self._wanted[1])
            # The workers run one check at a time.
            for _, coming in self._checks.values():
                for part in coming:
                    self._take(part)
            check = CrossCheck(settings, [item.quantity], audits=item.quantity == self.choice.quantities[0])
            self._checks[group] = check, run_study(check, self._workers("check"))
        return self._checks[group]

    def _workers(self, work: str) -> workers.Workers:
        """The workers of "check" or "diagnosis", started on first use: a diagnosis comes while records of the check are outstanding."""
        if work not in self._started:
            self._started[work] = self._exit.enter_context(self.choice.new_workers())
        return self._started[work]


class SystemFile(pytest.File):
    """A system file, which holds one test per subject and quantity, and per variant. It is not imported here."""

    def __init__(self, *, regression: _Regression, **options: Any) -> None:
        super().__init__(**options)
        self.regression = regression

    def collect(self) -> Iterator[CrossCheckItem]:
        from harness.engines import asked_of

        regression, choice = self.regression, self.regression.choice
        library = choice.library
        names = names_in(self.path)
        for name in [*names, *(variant for variant in library.variant_names() if library.system_of(variant) in names)]:
            for subject in map(str, asked_of(library, name, choice.subjects)):
                for quantity in choice.quantities:
                    # The members of a family and variants share a file, so their tests carry the name too.
                    title = subject if name == self.path.stem else f"{name}:{subject}"
                    title += "".join(f"[{name}]" for name in quantity_words(quantity))
                    about = {"system": name, "subject": subject, "quantity": quantity}
                    yield CrossCheckItem.from_parent(self, name=title, regression=regression, **about)


class CrossCheckItem(pytest.Item):
    """One subject on one system in one quantity: passes where the verdict is the expected one, and neither a superfluous part of the
    model nor a difference after loading fails."""

    def __init__(self, *, regression: _Regression, system: str, subject: str, quantity: str, **options: Any) -> None:
        super().__init__(**options)
        self.regression = regression
        self.system, self.subject, self.quantity = system, subject, quantity

    def runtest(self) -> None:
        record = self.regression.record(self)
        self.user_properties += [("verdict", record.verdict), ("backward_error", record.backward_error), ("states", record.states)]
        if not record.as_expected:
            pytest.fail(self.regression.explanation(self), pytrace=False)
        if superfluous := self.regression.superfluous(self):
            text = "\n".join(["superfluous parts of the model:", *(f"  {part}" for part in superfluous)])
            if any(part.fails for part in superfluous):
                pytest.fail(text, pytrace=False)
            warnings.warn(pytest.PytestWarning(text), stacklevel=2)
        if differs := self.regression.differs(self):
            pytest.fail("\n".join(["not held alike after loading:", *(f"  {finding}" for finding in differs)]), pytrace=False)

    def reportinfo(self) -> tuple[Path, int | None, str]:
        return self.path, None, f"{self.system}[{self.name.rpartition(':')[2]}]"
