# SPDX-License-Identifier: BSD-3-Clause
"""The engine that is always there: worker processes on this machine."""
from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import time
from collections import deque
from collections.abc import Generator, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing import connection
from typing import TYPE_CHECKING, Any

from . import keeping
from .job import JobError, Outcome, gigabytes, load, run_episode

if TYPE_CHECKING:
    from lab_batch.job import Spec

# A worker has its next seed while the answer to the last one is on its way.
SEEDS_AHEAD = 2
# An episode gets a second worker where its first one died, which may have been killed for another reason.
TRIES = 2
# Longer than a worker's keeper needs.
STOP_TIMEOUT_S = keeping.STOP_TIMEOUT_S + 5.0
# One thread each, as many workers as processors: with threads of their own, libraries would also make results depend on
# the machine.
ONE_THREAD = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")


@dataclass(frozen=True)
class BatchLimits:
    """workers: processes at a time. episode_s: longest wall time of an episode, None: no limit. episodes: how many a
    worker runs before a new one takes its place (physics engines keep memory), None: no limit. memory_bytes: of each
    process, and of a worker and its processes together, None: no limit."""

    workers: int = 1
    episode_s: float | None = None
    episodes: int | None = 200
    memory_bytes: int | None = None


def map_seeds(spec: Spec, seeds: range | list[int], limits: BatchLimits) -> Generator[Outcome, None, None]:
    """Yield an Outcome for each seed, in the order in which they end. spec: Spec, seeds: iterable of int.

    Raises JobError where the job cannot start. When the caller closes the generator, the workers are stopped.
    """
    pool = _Pool(spec, seeds, limits)
    try:
        yield from pool.outcomes()
    finally:
        pool.stop()


class _Pool:
    def __init__(self, spec: Spec, seeds: range | list[int], limits: BatchLimits) -> None:
        self._spec, self._limits = spec, limits
        self._seeds, self._again = iter(seeds), deque()
        self._tries = {}  # of seeds whose worker died
        self._workers = []
        self._lost_at_start = 0  # workers in a row that died before the job had started

    def outcomes(self) -> Iterator[Outcome]:
        while True:
            self._fill()
            if not self._workers:
                return
            yield from self._wait()

    def _next_seed(self) -> int | None:
        if self._again:
            return self._again.popleft()
        return next(self._seeds, None)

    def _fill(self) -> None:
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
            worker = _Worker(self._spec, self._limits)
            self._workers.append(worker)
            worker.give(seed)

    def _wait(self) -> Iterator[Outcome]:
        deadline = min((worker.deadline(self._limits) for worker in self._workers), default=None)
        timeout = None if deadline is None or deadline == float("inf") else max(0.0, deadline - time.monotonic())
        ready = connection.wait([worker.link for worker in self._workers], timeout)
        for worker in list(self._workers):
            if worker.link in ready:
                yield from self._hear(worker)
            elif worker.deadline(self._limits) <= time.monotonic():
                self._lose(worker)
                text = "took more than the limit of %g s" % self._limits.episode_s
                yield Outcome(worker.seeds.popleft(), {}, text, self._limits.episode_s or 0.0)
                self._again.extend(worker.seeds)

    def _hear(self, worker: _Worker) -> Iterator[Outcome]:
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
            if message.is_out_of_memory:
                # The job may still hold it.
                self._lose(worker)
                self._again.extend(worker.seeds)
                return
        worker.began = time.monotonic()

    def _died(self, worker: _Worker) -> Iterator[Outcome]:
        """The episode that ran gets another try; those that had not begun count as untouched."""
        has_excess = worker.process.exitcode == keeping.TOO_MUCH_MEMORY
        if worker.began is None:
            if has_excess:
                raise JobError("job %s cannot start: %s" % (self._spec.name, self._memory_text()))
            self._lost_at_start += 1
            if self._lost_at_start >= TRIES:
                raise JobError("job %s: %d workers in a row died at the start: %s" % (
                    self._spec.name, TRIES, _cause(worker.process.exitcode)))
            self._again.extend(worker.seeds)
            return
        seed = worker.seeds.popleft()
        self._again.extend(worker.seeds)
        if has_excess:
            yield Outcome(seed, {}, self._memory_text(), time.monotonic() - worker.began)
            return
        self._tries[seed] = self._tries.get(seed, 1) + 1
        if self._tries[seed] <= TRIES:
            self._again.append(seed)
        else:
            yield Outcome(seed, {}, "its worker died twice: %s" % _cause(worker.process.exitcode), 0.0)

    def _memory_text(self) -> str:
        limit = gigabytes(self._limits.memory_bytes or 0)
        return "with its processes it took more than the limit of %s of memory" % limit

    def _lose(self, worker: _Worker) -> None:
        self._workers.remove(worker)
        worker.kill()

    def stop(self) -> None:
        for worker in self._workers:
            worker.process.terminate()
        for worker in self._workers:
            worker.kill()
        self._workers.clear()


def _cause(code: int | None) -> str:
    if code is not None and code < 0:
        # The kernel sends it where memory has run out.
        more = "; from outside, or because memory had run out" if code == -signal.SIGKILL else ""
        return "signal %s%s" % (signal.Signals(-code).name, more)
    return "exit code %s" % code


class _Worker:
    def __init__(self, spec: Spec, limits: BatchLimits) -> None:
        context = multiprocessing.get_context("spawn")
        self.link, theirs = context.Pipe()
        given = (spec, theirs, os.getpid(), limits.memory_bytes)
        self.process = context.Process(target=_work, args=given, daemon=False)
        with _environment(ONE_THREAD):
            self.process.start()
        theirs.close()
        self.seeds, self.count = deque(), 0
        self.began: float | None = None  # when the episode that now runs began; None: the job has not started

    def give(self, seed: int) -> None:
        self.seeds.append(seed)
        try:
            self.link.send(seed)
        except OSError:
            pass  # it has died: its end of the link says so to the next wait

    def is_worn(self, limits: BatchLimits) -> bool:
        return limits.episodes is not None and self.count + len(self.seeds) >= limits.episodes

    def deadline(self, limits: BatchLimits) -> float:
        """When the episode that runs must have ended, on the monotonic clock [s]."""
        if self.began is None or limits.episode_s is None:
            return float("inf")
        return self.began + limits.episode_s

    def end(self) -> None:
        """Let it release what it holds, and wait for its end."""
        try:
            self.link.send(None)
        except OSError:
            pass
        self.process.join(STOP_TIMEOUT_S)
        self.kill()

    def kill(self) -> None:
        """End it; its keeper ends all processes that it has started."""
        if self.process.pid is not None:
            # A worker that has died is still followed by its keeper, for a moment.
            if not connection.wait([self.process.sentinel], 0.0):
                self.process.terminate()
            self.process.join(STOP_TIMEOUT_S)
            if self.process.exitcode is None:
                self.process.kill()
                self.process.join()
        self.link.close()


@contextmanager
def _environment(values: Mapping[Any, str]) -> Iterator[None]:
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


def _work(spec: Spec, link: connection.Connection, parent: int, memory_bytes: int) -> None:
    """A worker's program: episodes until a None or the end of the link."""
    os.setpgid(0, 0)  # Ctrl-C goes to the parent alone
    keeping.be_kept(parent, memory_bytes, link.close)
    # What jobs print is no result: it goes to the error output.
    os.dup2(2, 1)
    with suppress(_Stopped):
        signal.signal(signal.SIGTERM, _stop)
        _episodes(spec, link)
        return
    sys.exit(1)


def _episodes(spec: Spec, link: connection.Connection) -> None:
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


def _stop(*_: object) -> None:
    raise _Stopped
