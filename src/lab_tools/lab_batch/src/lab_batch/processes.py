# SPDX-License-Identifier: BSD-3-Clause
"""The engine that is always there: worker processes on this machine."""
import ctypes
import multiprocessing
import os
import signal
import sys
import time
from collections import deque
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing import connection

import psutil

from .job import JobError, Outcome, load, run_episode

_PR_SET_PDEATHSIG, _PR_SET_CHILD_SUBREAPER = 1, 36
# A worker has its next seed while the answer to the last one is on its way.
SEEDS_AHEAD = 2
# An episode gets a second worker where its first one died, which may have been killed for another reason.
TRIES = 2
STOP_TIMEOUT_S = 5.0
# One thread each, as many workers as processors: with threads of their own, libraries would also make results depend on
# the machine.
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")


@dataclass(frozen=True)
class Limits:
    """workers: processes at a time. episode_s: longest wall time of an episode, None: no limit. episodes: how many a
    worker runs before a new one takes its place (physics engines keep memory), None: no limit."""

    workers: int = 1
    episode_s: float | None = None
    episodes: int | None = 200


def map_seeds(spec, seeds, limits):
    """Yield an Outcome for each seed, in the order in which they end. spec: Spec, seeds: iterable of int.

    Raises JobError where the job cannot start. When the caller closes the generator, the workers are stopped.
    """
    pool = _Pool(spec, seeds, limits)
    try:
        yield from pool.outcomes()
    finally:
        pool.stop()


class _Pool:
    def __init__(self, spec, seeds, limits):
        self._spec, self._limits = spec, limits
        self._seeds, self._again = iter(seeds), deque()
        self._tries = {}  # of seeds whose worker died
        self._workers = []
        self._lost_at_start = 0  # workers in a row that died before the job had started

    def outcomes(self):
        while True:
            self._fill()
            if not self._workers:
                return
            yield from self._wait()

    def _next_seed(self):
        if self._again:
            return self._again.popleft()
        return next(self._seeds, None)

    def _fill(self):
        """Give every worker its seeds; start workers while there are seeds for them, and end those without any."""
        for worker in list(self._workers):
            while len(worker.seeds) < SEEDS_AHEAD and not worker.is_worn(self._limits):
                seed = self._next_seed()
                if seed is None:
                    break
                worker.give(seed)
            if not worker.seeds:
                self._workers.remove(worker)
                worker.end()
        while len(self._workers) < self._limits.workers:
            seed = self._next_seed()
            if seed is None:
                return
            worker = _Worker(self._spec)
            self._workers.append(worker)
            worker.give(seed)

    def _wait(self):
        deadline = min((worker.deadline(self._limits) for worker in self._workers), default=None)
        timeout = None if deadline is None or deadline == float("inf") else max(0.0, deadline - time.monotonic())
        ready = connection.wait([worker.link for worker in self._workers], timeout)
        for worker in list(self._workers):
            if worker.link in ready:
                yield from self._hear(worker)
            elif worker.deadline(self._limits) <= time.monotonic():
                self._lose(worker)
                text = "took more than the limit of %g s" % self._limits.episode_s
                yield Outcome(worker.seeds.popleft(), {}, text, self._limits.episode_s)
                self._again.extend(worker.seeds)

    def _hear(self, worker):
        try:
            message = worker.link.recv()
        except (EOFError, OSError):
            self._lose(worker)
            yield from self._died(worker)
            return
        if isinstance(message, JobError):
            raise message
        if message is None:  # the job has started
            self._lost_at_start = 0
        else:
            worker.seeds.popleft()
            worker.count += 1
            yield message
        worker.began = time.monotonic()

    def _died(self, worker):
        """The episode that ran gets another try; those that had not begun count as untouched."""
        if worker.began is None:
            self._lost_at_start += 1
            if self._lost_at_start >= TRIES:
                raise JobError("job %s: %d workers in a row died at the start: %s" % (
                    self._spec.name, TRIES, _cause(worker.process.exitcode)))
            self._again.extend(worker.seeds)
            return
        seed = worker.seeds.popleft()
        self._again.extend(worker.seeds)
        self._tries[seed] = self._tries.get(seed, 1) + 1
        if self._tries[seed] <= TRIES:
            self._again.append(seed)
        else:
            yield Outcome(seed, {}, "its worker died twice: %s" % _cause(worker.process.exitcode), 0.0)

    def _lose(self, worker):
        self._workers.remove(worker)
        worker.kill()

    def stop(self):
        for worker in self._workers:
            worker.kill()
        self._workers.clear()


def _cause(code):
    if code is not None and code < 0:
        # The kernel sends it where memory has run out.
        more = "; from outside, or because memory had run out" if code == -signal.SIGKILL else ""
        return "signal %s%s" % (signal.Signals(-code).name, more)
    return "exit code %s" % code


class _Worker:
    def __init__(self, spec):
        context = multiprocessing.get_context("spawn")
        self.link, theirs = context.Pipe()
        self.process = context.Process(target=_work, args=(spec, theirs, os.getpid()), daemon=False)
        with _environment(ONE_THREAD):
            self.process.start()
        theirs.close()
        self.seeds, self.count = deque(), 0
        self.began = None  # when the episode that now runs began; None: the job has not started

    def give(self, seed):
        self.seeds.append(seed)
        try:
            self.link.send(seed)
        except OSError:
            pass  # it has died: its end of the link says so to the next wait

    def is_worn(self, limits):
        return limits.episodes is not None and self.count + len(self.seeds) >= limits.episodes

    def deadline(self, limits):
        """When the episode that runs must have ended, on the monotonic clock [s]."""
        if self.began is None or limits.episode_s is None:
            return float("inf")
        return self.began + limits.episode_s

    def end(self):
        """Let it release what it holds, and wait for its end."""
        try:
            self.link.send(None)
        except OSError:
            pass
        self.process.join(STOP_TIMEOUT_S)
        self.kill()

    def kill(self):
        """End it and all processes that it has started."""
        family = _children(self.process.pid)
        if self.process.pid is not None and self.process.exitcode is None:
            for sign in (signal.SIGTERM, signal.SIGKILL):
                _signal_group(self.process.pid, sign)
                self.process.join(STOP_TIMEOUT_S)
                if self.process.exitcode is not None:
                    break
        if self.process.pid is not None:
            _signal_group(self.process.pid, signal.SIGKILL)  # children that outlived it
            _end(family)  # those in groups of their own
            self.process.join(STOP_TIMEOUT_S)
        self.link.close()


def _signal_group(pid, sign):
    """Signal a worker's process group, or the worker alone while it has none of its own."""
    try:
        if os.getpgid(pid) != pid:
            os.kill(pid, sign)
            return
    except ProcessLookupError:
        pass  # the worker has been waited for; its group may still have members
    try:
        os.killpg(pid, sign)
    except (ProcessLookupError, PermissionError):
        pass


def _children(pid):
    """The psutil.Process of each process below ``pid``."""
    try:
        return psutil.Process(pid).children(recursive=True)
    except psutil.Error:
        return []


def _end(processes):
    for process in processes:
        with suppress(psutil.Error):
            process.kill()


@contextmanager
def _environment(values):
    before = {name: os.environ.get(name) for name in values}
    os.environ.update(values)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _work(spec, link, parent):
    """A worker's program: episodes until a None or the end of the link."""
    os.setpgid(0, 0)  # a job's own processes end with it, and Ctrl-C goes to the parent alone
    prctl = ctypes.CDLL(None).prctl
    prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    prctl(_PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)  # children of its children stay below it
    if os.getppid() != parent:
        return
    # What jobs print is no result: it goes to the error output.
    os.dup2(2, 1)
    try:
        signal.signal(signal.SIGTERM, _stop)
        _episodes(spec, link)
    except _Stopped:
        sys.exit(1)
    finally:
        _end(_children(os.getpid()))


def _episodes(spec, link):
    try:
        job = load(spec)
    except JobError as error:
        link.send(error)
        return
    link.send(None)
    try:
        while (seed := link.recv()) is not None:
            link.send(run_episode(job, seed))
    except (EOFError, OSError):
        pass
    job.end()


class _Stopped(BaseException):
    """The pool ends this worker. Not SystemExit, which an episode may raise for itself."""


def _stop(*_):
    raise _Stopped
