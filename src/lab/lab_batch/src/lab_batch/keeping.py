# SPDX-License-Identifier: BSD-3-Clause
"""A worker's keeper: the process between a batch and one of its workers.

It ends all that the worker has started, also where worker or batch are killed, and ends the worker where it and its
processes take too much memory together. Linux only.
"""
from __future__ import annotations

import contextlib
import ctypes
import os
import resource
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from processes.family import children_of, memory_exceeds

#: Exit code of a keeper that has ended its worker for its memory.
TOO_MUCH_MEMORY = 238
#: How long a worker has to end its programs, such as roslaunch, before all of them are killed [s].
STOP_TIMEOUT_S = 5.0
#: Of the machine's memory, what all workers may take together by default.
SHARE = 0.8
_LOOK_S = 0.25
_RESERVE_BYTES = 64 << 20
_PR_SET_PDEATHSIG, _PR_SET_CHILD_SUBREAPER = 1, 36
# Where memory runs out all the same, Linux ends processes of workers before others (0 to 1000; others have 0).
_OOM_SCORE = "500"
_WAKING = (signal.SIGCHLD, signal.SIGTERM)


def default_memory_bytes(workers: int, root: Path = Path("/")) -> int:
    """Memory of each of so many workers, with all of its processes, by default: a share of the machine's, or of its
    control group's where that has less. root: of /proc and /sys."""
    most = int((root / "proc/meminfo").read_text(encoding="ascii").split("MemTotal:")[1].split()[0]) << 10
    # Version 2, as a container sees its own, and version 1.
    for name in ("sys/fs/cgroup/memory.max", "sys/fs/cgroup/memory/memory.limit_in_bytes"):
        try:
            most = min(most, int((root / name).read_text(encoding="ascii")))
        except (OSError, ValueError):
            continue  # it has no limit
    return int(SHARE * most / workers)


def limit_memory(memory_bytes: int) -> None:
    """Let this process, and each that it starts, have so much memory; more is a MemoryError."""
    hard = resource.getrlimit(resource.RLIMIT_DATA)[1]
    if hard == resource.RLIM_INFINITY or memory_bytes < hard:
        resource.setrlimit(resource.RLIMIT_DATA, (memory_bytes, hard))


def raise_limit() -> None:
    """Let this process have a little more than its limit of memory, to say that it is reached."""
    limit = resource.getrlimit(resource.RLIMIT_DATA)[0]
    if limit != resource.RLIM_INFINITY:
        limit_memory(limit + _RESERVE_BYTES)


def own_memory_bytes() -> int:
    """The memory of this process that counts for its limit [bytes]."""
    return int(Path("/proc/self/status").read_text(encoding="ascii").split("VmData:")[1].split()[0]) << 10


def be_kept(parent: int, memory_bytes: int, close: Callable[[], None]) -> None:
    """Go on as the worker: a new child of this process, which becomes its keeper and does not return.

    parent: process id of the batch; memory_bytes: None, no limit; close: called in the keeper, to close what the worker
    alone may hold. To be called before any thread starts.
    """
    signal.pthread_sigmask(signal.SIG_BLOCK, _WAKING)
    _prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
    _prctl(_PR_SET_CHILD_SUBREAPER, 1)
    keeper = os.getpid()
    worker = os.fork()
    if worker:
        close()
        _keep(worker, parent, memory_bytes)
    _prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    _prctl(_PR_SET_CHILD_SUBREAPER, 1)  # children of its children stay below it
    if os.getppid() != keeper:
        os._exit(1)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, _WAKING)
    with contextlib.suppress(OSError):
        Path("/proc/self/oom_score_adj").write_text(_OOM_SCORE, encoding="ascii")
    if memory_bytes is not None:
        limit_memory(memory_bytes)


def _prctl(option: int, value: Any) -> None:
    ctypes.CDLL(None).prctl(option, value, 0, 0, 0)


def _keep(worker: int, parent: int, memory_bytes: int) -> None:
    """Wait for the worker's end, end what it leaves, and end as it has ended."""
    code = 1
    try:
        code = _wait(worker, parent, memory_bytes)
    finally:
        _end_family()
        if code < 0:
            _end_by(-code)
        os._exit(code)


def _wait(worker: int, parent: int, memory_bytes: int) -> int:
    """The worker's exit code, or minus a signal's number; TOO_MUCH_MEMORY where it has more than its limit."""
    deadline = float("inf")
    while True:
        woken = signal.sigtimedwait(_WAKING, _LOOK_S)
        pid, status = os.waitpid(worker, os.WNOHANG)
        if pid:
            return os.waitstatus_to_exitcode(status)
        if memory_bytes is not None and memory_exceeds(children_of([worker]), memory_bytes):
            return TOO_MUCH_MEMORY
        is_stopped = (woken and woken.si_signo == signal.SIGTERM) or os.getppid() != parent
        if is_stopped and deadline == float("inf"):
            os.kill(worker, signal.SIGTERM)
            deadline = time.monotonic() + STOP_TIMEOUT_S
        if time.monotonic() >= deadline:
            return -signal.SIGKILL


def _end_family() -> None:
    """Kill all descendants. Those that are started meanwhile are found: orphans become children of this process."""
    own = os.getpid()
    while family := children_of([own]) - {own}:
        for pid in family:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        _reap()


def _end_by(number: int) -> None:
    """End this process by a signal, without a core file."""
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    if number != signal.SIGKILL:
        signal.signal(number, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, [number])
    os.kill(os.getpid(), number)


def _reap() -> None:
    """Wait for children that have ended, for one at least."""
    try:
        os.waitpid(-1, 0)
        while os.waitpid(-1, os.WNOHANG)[0]:
            pass
    except ChildProcessError:
        pass
