# SPDX-License-Identifier: BSD-3-Clause
"""The engine for several machines: Ray (https://ray.io), which is installed on first use."""
from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

import psutil

from processes.work_folder import claimed_folder

from . import keeping, on_first_use
from .job import JobError, Outcome, load, run_episode
from .processes import ONE_THREAD, SEEDS_AHEAD, TRIES

if TYPE_CHECKING:
    from lab_batch.job import Spec
    from lab_batch.processes import BatchLimits

REQUIREMENTS = Path(__file__).with_name("requirements-ray.txt")
# Ray's own limits for the start of its processes (15 to 30 s) are too short for a busy machine. Usage is not reported,
# and the tokens that Ray asks for by default stay in force for clusters: they are Ray's own setting.
ENVIRONMENT = {"RAY_agent_register_timeout_ms": "180000", "RAY_worker_register_timeout_seconds": "180",
               "RAY_raylet_start_wait_time_s": "60", "RAY_USAGE_STATS_ENABLED": "0"}
# By default Ray's processes have an address of the network, even if 127.0.0.1 is asked for, and listen on every
# network. Its setting for systems without clusters keeps all of them to loopback.
LOOPBACK = {"RAY_ENABLE_WINDOWS_OR_OSX_CLUSTER": "0"}
# Ray gives its first process 30 s, which a busy machine may miss.
STARTS = 3
END_S = 10.0


def ensure_installed(root: Path) -> None:
    """Make Ray importable here and in its workers; install it below root/.baxter on first use. Raises JobError."""
    on_first_use.ensure_installed(root, "ray", REQUIREMENTS, "batches with --engine processes need nothing")


def has_token() -> bool:
    """Whether this user has a token of Ray's, where Ray looks for it."""
    named = os.environ.get("RAY_AUTH_TOKEN_PATH")
    file = Path(named) if named else Path.home() / ".ray" / "auth_token"
    return bool(os.environ.get("RAY_AUTH_TOKEN")) or file.is_file()


class _Episodes:
    """A Ray actor: one worker with its job."""

    def __init__(self, spec: Spec, memory_bytes: int) -> None:
        if memory_bytes is not None:
            # Ray's own threads have some already.
            keeping.limit_memory(keeping.own_memory_bytes() + memory_bytes)
        self._job = load(spec)

    def started(self) -> None:
        """Return when the job has started."""

    def run(self, seed: int) -> Outcome:
        return run_episode(self._job, seed)


def map_seeds(spec: Spec, seeds: range, limits: BatchLimits, address: str | None = None) -> Iterator[Outcome]:
    """Yield an Outcome for each seed, as processes.map_seeds.

    address: HOST:PORT of a cluster's head; None: a Ray of its own on this machine. limits.workers is the number of
    actors, of one processor each. Ray reads its settings once, when it is imported: a process should use either a
    cluster or a Ray of its own, and not import Ray before. Raises JobError.
    """
    ensure_installed(Path(os.environ.get("LAB_ROOT", Path.cwd())))
    for name, value in ENVIRONMENT.items():
        os.environ.setdefault(name, value)
    if not address:
        os.environ.update(LOOPBACK)
    if address and has_token():
        # Ray sends its token only where this says so; to a head that asks for it, it would try without it for ever.
        os.environ.setdefault("RAY_AUTH_MODE", "token")
    import ray  # pyright: ignore[reportMissingImports]

    with contextlib.ExitStack() as ending:
        _start(ray, limits, address, ending)
        yield from _Actors(ray, spec, seeds, limits).outcomes()


def _start(ray: ModuleType, limits: BatchLimits, address: str | None, ending: contextlib.ExitStack) -> None:
    """Connect to a cluster, or start a Ray here; `ending` (contextlib.ExitStack) ends it. Raises JobError."""
    options: dict[str, Any] = {"include_dashboard": False, "log_to_driver": False, "configure_logging": False}
    tries, folder = STARTS, None
    if address:
        options["address"], tries = address, 1
    else:
        # For its logs and sockets, which it would keep.
        folder = str(ending.enter_context(claimed_folder("ray-", lambda left: _end_left(str(left)))))
        ending.callback(end_processes, folder)
        # Ray opens its own folder to everybody; the one around it stays closed.
        options.update(num_cpus=limits.workers, _temp_dir=os.path.join(folder, "ray"))
    ending.callback(ray.shutdown)
    for left in reversed(range(tries)):
        try:
            ray.init(**options)
            return
        except Exception as error:  # Ray raises a bare Exception where its processes do not start in time
            ray.shutdown()
            if folder:
                end_processes(folder)
            if not left:
                raise JobError("no Ray at %s: %s" % (address or "this machine", error)) from error


def end_processes(folder: str) -> None:
    """End the processes below this one that have ``folder`` in their command: ray.shutdown leaves those of a Ray whose
    start failed."""
    _end_users(folder, psutil.Process().children(recursive=True))


def _end_left(folder: str) -> None:
    """End the processes of this user that have ``folder`` in their command: those of a batch that was killed."""
    with contextlib.suppress(psutil.Error):
        _end_users(folder, [one for one in psutil.process_iter() if one.pid != os.getpid()])


def _end_users(folder: str, processes: list[psutil.Process]) -> None:
    found = []
    for process in processes:
        with contextlib.suppress(psutil.Error):
            if process.uids().real == os.getuid() and any(folder + "/" in word for word in process.cmdline()):
                process.kill()
                found.append(process)
    psutil.wait_procs(found, END_S)


class _Actor:
    """handle: Ray's; began: when the episode that it runs began, None while its job starts."""

    def __init__(self, handle: Any) -> None:
        self.handle, self.began = handle, None

    def deadline(self, limits: BatchLimits) -> float:
        """When the episode that runs must have ended, on the monotonic clock [s]."""
        if self.began is None or limits.episode_s is None:
            return float("inf")
        return self.began + limits.episode_s


class _Actors:
    """Actors, each with up to SEEDS_AHEAD seeds. Where one dies, it is not known which of its seeds has killed it: the
    outcome of a seed that is done may be lost as well. From then on its seeds run one by one."""

    def __init__(self, ray: ModuleType, spec: Spec, seeds: range, limits: BatchLimits) -> None:
        self._ray, self._spec, self._limits = ray, spec, limits
        self._seeds, self._again, self._deaths = iter(seeds), [], {}
        self._kind = ray.remote(num_cpus=1, runtime_env={"env_vars": ONE_THREAD})(_Episodes)
        # The second where Ray has ended the actor because its machine's memory runs out.
        self._losses = (ray.exceptions.RayActorError, ray.exceptions.OutOfMemoryError)
        self._starting = {}  # {reference: actor}
        self._running = {}  # {reference: (actor, seed)}

    def outcomes(self) -> Iterator[Outcome]:
        for _ in range(self._limits.workers):
            self._start()
        while self._running:
            deadline = min(actor.deadline(self._limits) for actor, _ in self._running.values())
            left = None if deadline == float("inf") else max(0.0, deadline - time.monotonic())
            done, _ = self._ray.wait([*self._starting, *self._running], num_returns=1, timeout=left)
            if done:
                yield from self._take(done[0])
            else:
                yield from self._stop_late()

    def _start(self) -> None:
        """A new actor, where a seed is left for it."""
        following = self._following([])
        if following:
            actor = _Actor(self._kind.remote(self._spec, self._limits.memory_bytes))
            self._starting[actor.handle.started.remote()] = actor
            self._give(actor, following)

    def _following(self, waiting: list[int]) -> list[int]:
        """The seeds for an actor that has still those ``waiting``."""
        if self._again:
            return [] if waiting else [self._again.pop()]
        if any(seed in self._deaths for seed in waiting):
            return []
        return list(islice(self._seeds, SEEDS_AHEAD - len(waiting)))

    def _give(self, actor: _Actor, seeds: list[int]) -> None:
        for seed in seeds:
            self._running[actor.handle.run.remote(seed)] = (actor, seed)

    def _of(self, actor: _Actor) -> dict[tuple[int, int], int]:
        """{reference: seed} of what an actor has still to do, the one that it runs first."""
        return {reference: seed for reference, (one, seed) in self._running.items() if one is actor}

    def _take(self, reference: tuple[Any, int]) -> Iterator[Outcome]:
        actor = self._starting[reference] if reference in self._starting else self._running[reference][0]
        try:
            outcome = self._result(reference)
        except self._losses as error:
            yield from self._died(actor, error)
            return
        if self._starting.pop(reference, None):
            # Its first outcome may have been reported before.
            actor.began = actor.began or time.monotonic()
            return
        actor.began = time.monotonic()
        del self._running[reference]
        yield outcome
        if outcome.is_out_of_memory:
            # The job may still hold it.
            self._again += self._forget(actor).values()
            self._ray.kill(actor.handle)
            self._start()
            return
        self._give(actor, self._following(list(self._of(actor).values())))

    def _result(self, reference: tuple[Any, int]) -> Outcome:
        try:
            return self._ray.get(reference)
        except self._ray.exceptions.RayTaskError as error:
            raise JobError(str(error.cause)) from error

    def _forget(self, actor: _Actor) -> dict[tuple[int, int], int]:
        """Take away what an actor has still to do; returns {reference: seed}."""
        seeds = self._of(actor)
        self._running = {reference: one for reference, one in self._running.items() if reference not in seeds}
        self._starting = {reference: one for reference, one in self._starting.items() if one is not actor}
        return seeds

    def _died(self, actor: _Actor, error: Exception) -> Iterator[Outcome]:
        if "JobError" in str(error):
            raise JobError(str(error).strip().splitlines()[-1])
        for reference, seed in self._forget(actor).items():
            try:
                yield self._result(reference)
                continue
            except self._losses:
                self._deaths[seed] = self._deaths.get(seed, 0) + 1
            if self._deaths[seed] < TRIES:
                self._again.append(seed)
            else:
                yield Outcome(seed, {}, "its worker died twice: %s" % str(error).strip().splitlines()[0], 0.0)
        self._start()

    def _stop_late(self) -> Iterator[Outcome]:
        """Stop the actors whose episode takes too long."""
        now = time.monotonic()
        late = {id(actor): actor for actor, _ in self._running.values() if actor.deadline(self._limits) <= now}
        for actor in late.values():
            seed, *waiting = self._forget(actor).values()
            self._again += waiting
            self._ray.kill(actor.handle)
            yield Outcome(seed, {}, "took more than the limit of %g s" % self._limits.episode_s,
                          self._limits.episode_s or 0.0)
            self._start()
