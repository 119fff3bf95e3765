# SPDX-License-Identifier: BSD-3-Clause
"""The pytest plugin of `./baxter.sh test`: .test files as tests, some at a time, and the counts.

The controller of pytest-xdist gives whole files to its workers, the longest first; files that share a lab are one.
There is a worker for each core, and two more, which collect and run only the .test files that leave the processor to
others.
"""

from __future__ import annotations

import atexit
import contextlib
import fcntl
import functools
import hashlib
import json
import locale
import os
import random
import resource
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest
from xdist.scheduler import LoadScopeScheduling

from lab_tests import comma_locale, left_threads, rostests
from lab_tests.discovery import WORKERS_BESIDE_CORES, is_long, mostly_waits, package_of
from lab_tests.results import Tally, summary
from lab_tests.shared_labs import lab_of

if TYPE_CHECKING:
    from xdist.remote import Producer
    from xdist.workermanage import WorkerController

LOCALE_FOLDER = Path(__file__).resolve().parents[2] / ".baxter" / "locale"
# What files took in earlier runs, and what a fresh clone begins with: file below the root -> seconds.
DURATIONS, FIRST_DURATIONS = "durations.json", Path(__file__).with_name("durations.json")
# Of a .test file that never ran [s]: one that begins last may end long after all others.
NEW_ROSTEST_S = 120.0
# Files that take less are ordered by name [s].
MIN_DURATION_S = 2.0
# Temporary files that are named.
MAX_NAMED = 20
# Examples of a test by Hypothesis that names no number: everywhere, and with --long.
QUICK_EXAMPLES, DEEP_EXAMPLES = 50, 500
#: What the runs of this process have counted.
FINISHED: list[Tally] = []
#: The RunWorker of a process that collects and runs tests.
WORKER: pytest.StashKey[RunWorker] = pytest.StashKey()


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("lab", "./baxter.sh test")
    group.addoption("--long", action="store_true", help="also run the tests that take minutes")
    group.addoption("--shuffle", type=int, metavar="SEED", help="run the files, and the tests in them, in random order")
    group.addoption("--stretch", type=float, default=1.0, metavar="FACTOR",
                    help="factor of all time limits, for a slow machine")


def work_folder(config: pytest.Config) -> Path:
    """Where logs and results of tests stay."""
    folder = config.rootpath / ".baxter" / "tests"
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def pytest_configure(config: pytest.Config) -> None:
    is_worker = hasattr(config, "workerinput")
    if not is_worker:
        config.pluginmanager.register(RunController(config), "lab controller")
    # A few files run in this process itself, and a mere list of tests has no workers either.
    if is_worker or not config.option.numprocesses or config.option.collectonly:
        worker = RunWorker(config)
        config.pluginmanager.register(worker, "lab worker")
        config.stash[WORKER] = worker
        if not worker.is_extra:
            load_hypothesis_profile(config)


def load_hypothesis_profile(config: pytest.Config) -> None:
    """Few examples, or many with --long; unless --hypothesis-profile names another profile."""
    import hypothesis  # here, since the controller of a whole run needs none of it

    for name, examples in (("quick", QUICK_EXAMPLES), ("deep", DEEP_EXAMPLES)):
        # How long an example takes is the machine's doing, not the code's.
        hypothesis.settings.register_profile(name, max_examples=examples, deadline=None,
                                             suppress_health_check=[hypothesis.HealthCheck.too_slow])
    # It parses every module that is not installed, for constants to try: those of 900 modules of generated messages and
    # of Debian's ROS are no hints, and took a worker of a fresh clone 14 of 36 seconds of processor time.
    from hypothesis.internal.conjecture import providers
    from hypothesis.internal.constants_ast import is_local_module_file

    own = str(config.rootpath / "src")
    # Patched where it is used, in a module that has imported it.
    providers.is_local_module_file = (  # pyright: ignore[reportPrivateImportUsage]
        lambda path: path.startswith(own) and is_local_module_file(path))
    if not config.getoption("hypothesis_profile", None):
        hypothesis.settings.load_profile("deep" if config.option.long else "quick")


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> RostestFile | None:
    if file_path.suffix == ".test" and file_path.parent.name == "rostest":
        return RostestFile.from_parent(parent, path=file_path)
    return None


def pytest_make_parametrize_id(val: object, argname: str) -> str | None:
    # Every worker must give a test the same name, and bytes may hold the time at which they were made.
    return argname if isinstance(val, bytes) else None


class RostestFile(pytest.File):
    def collect(self) -> Iterator[Rostest]:
        test = Rostest.from_parent(self, name="rostest")
        if is_long(self.path):
            test.add_marker("long")
        yield test


class Rostest(pytest.Item):
    """One .test file, run by rostest; the tests in it are counted one by one."""

    def runtest(self) -> None:
        tally = self.config.stash[WORKER].run_rostest(self)
        tally.refuse_bare_skips()
        self.user_properties += [("passed", tally.passed), ("failed", tally.failed), ("skips", tally.skips)]
        if tally.failed:
            raise RostestFailure("\n".join(tally.details))
        if not tally.passed:
            pytest.skip("; ".join(dict.fromkeys(reason for _, reason in tally.skips)))

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        if isinstance(excinfo.value, RostestFailure):
            return str(excinfo.value)
        return super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[Path, None, str]:
        return self.path, None, self.path.name


class RostestFailure(Exception):
    """Tests of a .test file failed; the text has their names and messages, and the end of the output."""


@contextlib.contextmanager
def one_run(folder: Path) -> Iterator[None]:
    """Wait until no other run of this workspace uses the folder of a .test file."""
    with folder.with_name(f".{folder.name}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def reason_of(report: pytest.TestReport | pytest.CollectReport) -> str:
    """Why something was skipped; "" without a reason."""
    # (file, line, "Skipped: reason"); without a reason only "Skipped".
    reason = report.longrepr[2] if isinstance(report.longrepr, (tuple, list)) else ""
    return str(reason).removeprefix("Skipped").removeprefix(": ")


def file_of(nodeid: str) -> str:
    return nodeid.partition("::")[0]


@functools.cache
def unit_of(root: Path, nodeid: str) -> str:
    """The key of a worker's share of tests: the test's file, or the name of the lab that several .test files share."""
    lab = lab_of(root / file_of(nodeid))
    return file_of(nodeid) if lab is None else f"lab {hashlib.sha256(lab.encode()).hexdigest()[:12]}"


def is_extra(number: int, count: int) -> bool:
    """Whether a worker is one beside the cores. One that replaces a dead worker has a higher number, and is not."""
    return max(1, count - WORKERS_BESIDE_CORES) <= number < count


def read_durations(folder: Path) -> dict[str, float]:
    """File below the root -> seconds that it took last time."""
    found: dict[str, float] = {}
    for path in (FIRST_DURATIONS, folder / DURATIONS):
        with contextlib.suppress(OSError, ValueError, TypeError):
            read = json.loads(path.read_text(encoding="utf-8"))
            found.update({file: float(seconds) for file, seconds in read.items()} if isinstance(read, dict) else {})
    return found


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave long tests out, unless one was named; then the longest files first, or all in random order."""
    named = tuple(argument for argument in config.args if "::" in argument)
    if not (config.option.long or config.option.markexpr):
        left_out = [item for item in items
                    if item.get_closest_marker("long") and not str(config.rootpath / item.nodeid).startswith(named)]
        config.hook.pytest_deselected(items=left_out)
        items[:] = [item for item in items if item not in set(left_out)]
        if not config.stash[WORKER].is_extra:
            _tell(config, "long", [item.nodeid for item in left_out])
    # All workers must have the same order; another run may write new durations meanwhile.
    durations = getattr(config, "workerinput", {}).get("durations") or read_durations(work_folder(config))
    units: dict[str, list] = {}
    for item in items:
        units.setdefault(unit_of(config.rootpath, item.nodeid), []).append(item)
    for of_unit in units.values():
        # Workers collect the files in different orders; within a file the sort keeps the order.
        of_unit.sort(key=lambda item: file_of(item.nodeid))
    files = {unit: {file_of(item.nodeid) for item in of_unit} for unit, of_unit in units.items()}
    order = sorted(units, key=lambda unit: (-sum(
        durations.get(file, NEW_ROSTEST_S if file.endswith(".test") else 0.0) for file in files[unit]), unit))
    if config.option.shuffle is not None:
        source = random.Random(config.option.shuffle)
        source.shuffle(order)
        for unit in order:
            source.shuffle(units[unit])
    items[:] = [item for unit in order for item in units[unit]]


def _tell(config, name: str, value):
    """Tell the controller something, which may be in this process."""
    if hasattr(config, "workeroutput"):
        config.workeroutput[name] = value
    else:
        config.pluginmanager.get_plugin("lab controller").take({name: value})


class RunWorker:
    """In each worker: the locale, ROS tests, and the processor's time of each test."""

    def __init__(self, config: pytest.Config) -> None:
        self._config = config
        told = getattr(config, "workerinput", {"workerid": "gw0", "workercount": 1})
        number, count = int(told["workerid"].removeprefix("gw")), told["workercount"]
        self.is_extra = is_extra(number, count)
        self._choose_files(number, max(1, count - WORKERS_BESIDE_CORES))
        # For programs outside of this process: unit tests change variables, some of them when they are imported.
        self.environment = dict(os.environ)
        os.environ.update(comma_locale.variables(LOCALE_FOLDER))
        locale.setlocale(locale.LC_ALL, "")
        self._shared: dict[Path, Tally] = {}
        self._skipped_modules: list[tuple[str, str]] = []

    def run_rostest(self, item: Rostest) -> Tally:
        """Run a .test file, with all those of this run that share its lab when it is the first of them."""
        config, stretch = self._config, self._config.option.stretch
        if lab_of(item.path) is None:
            folder = work_folder(config) / f"{package_of(item.path, config.rootpath)}-{item.path.stem}"
            with one_run(folder):
                return rostests.run(item.path, folder, self.environment, stretch=stretch)
        if item.path not in self._shared:
            unit = unit_of(config.rootpath, item.nodeid)
            paths = [one.path for one in item.session.items if unit_of(config.rootpath, one.nodeid) == unit]
            folder = work_folder(config) / unit.replace(" ", "-")
            with one_run(folder):
                self._shared.update(rostests.run_shared(paths, folder, self.environment, stretch))
        return self._shared.pop(item.path)

    def _choose_files(self, number: int, cores: int):
        """Collect only what this worker may run; and in another order than the others do: what one compiles, the others
        find compiled."""
        arguments = self._config.args
        if self.is_extra:
            arguments[:] = [one for one in arguments if mostly_waits(self._config.rootpath / file_of(one))]
        begin = len(arguments) * (number % cores) // cores
        arguments[:] = arguments[begin:] + arguments[:begin]

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        if report.skipped:
            self._skipped_modules.append((report.nodeid, reason_of(report)))

    def pytest_collection_finish(self) -> None:
        if self._skipped_modules:
            _tell(self._config, "modules", self._skipped_modules)

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_protocol(self) -> None:
        self._before_s = _processor_s()

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_makereport(self, item: pytest.Item, call: pytest.CallInfo[None]) -> None:
        if call.when == "teardown":
            item.user_properties.append(("processor_s", _processor_s() - self._before_s))

    @pytest.hookimpl(tryfirst=True)
    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        if session.testscollected and (names := left_threads.busy_ones()):
            _tell(self._config, "left_threads", names)

    def pytest_unconfigure(self) -> None:
        os.environ.clear()
        os.environ.update(self.environment)
        locale.setlocale(locale.LC_ALL, "")


def _processor_s() -> float:
    both = [resource.getrusage(whose) for whose in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in both)


class RunController:
    """In the process that the user started: which worker runs what, the counts, the last line."""

    def __init__(self, config: pytest.Config) -> None:
        self._config, self._folder = config, work_folder(config)
        self._total = Tally()
        self._running = (self._folder / "run.lock").open("w")
        try:
            fcntl.flock(self._running, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            print("Another run of tests is under way in this workspace: a ROS test that both have waits for the other.",
                  flush=True)
        self._durations = read_durations(self._folder)
        self._took: dict[str, list[float]] = {}
        # A folder of its own for temporary files, which is removed at the end. pytest's own folders stay for the user.
        os.environ.setdefault("PYTEST_DEBUG_TEMPROOT", tempfile.gettempdir())
        self._own_places = os.environ.get("TMPDIR"), tempfile.tempdir
        self._temporary = Path(tempfile.mkdtemp(prefix="lab_tests_"))
        os.environ["TMPDIR"] = tempfile.tempdir = str(self._temporary)

    @pytest.hookimpl(tryfirst=True)
    def pytest_sessionstart(self) -> None:
        # Workers would not say what is wrong in an expression of -k or -m.
        marks: Any = self._config.pluginmanager.get_plugin("mark")
        try:
            marks.pytest_collection_modifyitems([], self._config)
        except pytest.UsageError as error:
            self._fail(str(error))
            raise

    @pytest.hookimpl(optionalhook=True)
    def pytest_configure_node(self, node: WorkerController) -> None:
        node.workerinput["durations"] = self._durations

    def pytest_xdist_make_scheduler(self, config: pytest.Config, log: Producer | None) -> FileScheduling:
        return FileScheduling(config, log)

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        took = self._took.setdefault(file_of(report.nodeid), [0.0, 0.0])
        took[0] += report.duration
        properties: dict[str, Any] = dict(report.user_properties)
        if report.when == "teardown":
            took[1] += properties.get("processor_s", 0.0)
        is_rostest = report.when == "call" and report.nodeid.endswith(".test::rostest")
        if report.failed or is_rostest:
            # pytest itself tells failures at the end; a whole run is long.
            terminal = self._config.pluginmanager.get_plugin("terminalreporter")
            if terminal is not None:  # without -p no:terminal
                terminal.ensure_newline()
                terminal.write_line(f"{report.outcome.upper()} {report.nodeid} ({report.duration:.0f} s)")
        if report.failed:
            self._total.failed += max(1, properties.get("failed", 1) if report.when == "call" else 1)
            self._total.passed += properties.get("passed", 0) if report.when == "call" else 0
            self._total.details.append(f"{report.nodeid}\n{report.longreprtext}")
        elif report.when == "call" and report.passed:
            self._total.passed += properties.get("passed", 1)
        elif report.skipped and "skips" not in properties:
            expected = getattr(report, "wasxfail", None)
            reason = reason_of(report) if expected is None else f"expected to fail: {expected}"
            self._total.skips.append((report.nodeid, reason))
        if report.when == "call":
            self._total.skips += [tuple(skip) for skip in properties.get("skips", [])]

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        if report.failed:
            self._fail(f"{report.nodeid}\n{report.longreprtext}")

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node: WorkerController, error: object) -> None:
        self.take(getattr(node, "workeroutput", {}))

    def take(self, told: dict) -> None:
        """The last report of a worker."""
        self._total.long = told.get("long", self._total.long)
        # Several workers may have collected it.
        self._total.skips += [skip for skip in map(tuple, told.get("modules", [])) if skip not in self._total.skips]
        if names := told.get("left_threads"):
            self._fail(f"after the last test, threads of a process still compute; there are: {names}")

    def _fail(self, detail: str):
        self._total.failed += 1
        self._total.details.append(detail)

    @pytest.hookimpl(trylast=True)
    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        self._total.refuse_bare_skips()
        ordinary = (pytest.ExitCode.OK, pytest.ExitCode.NO_TESTS_COLLECTED)
        if session.exitstatus not in ordinary and not self._total.failed:
            self._fail(f"pytest ended with exit code {int(session.exitstatus)}")
        if self._total.passed and session.exitstatus == pytest.ExitCode.NO_TESTS_COLLECTED:
            # xdist takes the number of the worker that came last; one beside the cores may have nothing to do.
            session.exitstatus = pytest.ExitCode.OK
        if self._total.failed or not (self._total.passed or self._config.option.collectonly):
            session.exitstatus = session.exitstatus or pytest.ExitCode.TESTS_FAILED
        took = {file: round(both[0], 1) for file, both in self._took.items() if both[0] >= MIN_DURATION_S}
        text = json.dumps({**read_durations(self._folder), **took}, indent=0, sort_keys=True)
        new = self._folder / f"{DURATIONS}.{os.getpid()}"
        new.write_text(text, encoding="utf-8")
        new.replace(self._folder / DURATIONS)
        with (self._folder / "took.csv").open("w", encoding="utf-8") as stream:
            stream.write("seconds,processor_seconds,file\n")
            for file, both in sorted(self._took.items(), key=lambda row: -row[1][1]):
                stream.write(f"{both[0]:.2f},{both[1]:.2f},{file}\n")

    @pytest.hookimpl(trylast=True)
    def pytest_unconfigure(self) -> None:
        # No failure: notebooks keep their files there on purpose, and programs that were killed cannot remove theirs.
        if left := sorted(path.name for path in self._temporary.iterdir()):
            print(f"tests left {len(left)} temporary files, now removed: {', '.join(left[:MAX_NAMED])}")
        # What libraries would remove at the end of this process, such as genpy's code of messages, is in there.
        atexit.unregister(shutil.rmtree)
        shutil.rmtree(self._temporary, ignore_errors=True)
        # Another round may follow in this process.
        self._running.close()
        variable, tempfile.tempdir = self._own_places
        if variable is None:
            os.environ.pop("TMPDIR")
        else:
            os.environ["TMPDIR"] = variable
        print(summary(self._total), flush=True)
        FINISHED.append(self._total)


class FileScheduling(LoadScopeScheduling):
    """A unit runs in one worker. Workers beside the cores get .test files that mostly wait, the others those last."""

    def _split_scope(self, nodeid):
        return unit_of(self.config.rootpath, nodeid)

    def _is_extra(self, node) -> bool:
        return is_extra(int(node.gateway.id.removeprefix("gw")), self.numnodes)

    def _check_nodes_have_same_collection(self) -> bool:
        """The others must have; a worker beside the cores has collected a part of it."""
        # xdist takes the first collection for all of it, and ends the last of more workers than units: those beside
        # come last, however fast they began.
        self.assigned_work = dict(sorted(self.assigned_work.items(), key=lambda pair: self._is_extra(pair[0])))
        collected = sorted(self.registered_collections.items(), key=lambda pair: self._is_extra(pair[0]))
        self.registered_collections = {node: names for node, names in collected if not self._is_extra(node)}
        try:
            return super()._check_nodes_have_same_collection()
        finally:
            self.registered_collections = dict(collected)

    def remove_node(self, node):
        """As xdist's, which would give back the test in which a worker died, so that it kills the next one, and tests
        that are done, for which the next one waits forever."""
        workload = self.assigned_work.pop(node)
        pending = [(unit, test) for unit, tests in workload.items() for test, is_done in tests.items() if not is_done]
        if not pending:
            return None
        for unit, test in pending[1:]:
            self.workqueue.setdefault(unit, {})[test] = False
        for other in self.nodes:
            self._reschedule(other)
        return pending[0][1]

    def _reschedule(self, node):
        # One that replaces a dead worker gets tests once it has collected them.
        if node in self.registered_collections:
            super()._reschedule(node)

    def _assign_work_unit(self, node):
        firsts = {unit: next(iter(tests)) for unit, tests in self.workqueue.items()}
        if self._is_extra(node):
            known = set(self.registered_collections[node])
            wanted = next((unit for unit, first in firsts.items() if first in known), None)
        else:
            wanted = next((unit for unit, first in firsts.items()
                           if not mostly_waits(self.config.rootpath / file_of(first))), next(iter(firsts)))
        if wanted is None:
            node.shutdown()
            return
        self.workqueue.move_to_end(wanted, last=False)
        super()._assign_work_unit(node)
