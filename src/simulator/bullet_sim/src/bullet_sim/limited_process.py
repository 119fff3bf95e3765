# SPDX-License-Identifier: BSD-3-Clause
"""Work on untrusted files, in a separate process with limits. A library that hangs or takes all memory only ends that
process, and the interpreter lock stays free for the physics.

The limit is processor time, not wall time: a busy machine gets the same result later.
"""

from __future__ import annotations

import importlib
import json
import os
import resource
import select
import signal
import subprocess
import sys
import threading
import time
from typing import IO, TYPE_CHECKING, Any, NamedTuple

from processes.priority import as_before, give_way

if TYPE_CHECKING:
    from collections.abc import Callable

#: Limits of a call: processor time [s], additional memory [bytes], and the wall time in which it must get on [s].
PROCESSOR_S = 4
MEMORY_BYTES = 1_500_000_000
WAITING_S = 60.0
_IDLE_S = 10.0
# Physics comes first, but a user waits for the result: beside programs that take all they get, it has a quarter of a
# processor. At 15, as a helper of the renderer at 10, it had a fiftieth.
_NICENESS = 5
# A call that has used less of a processor than this part of the wall time does nothing; on a busy machine, a process of
# the lowest priority has more.
_WORKS_SHARE = 0.002
_START = "from bullet_sim.limited_process import serve; serve()"


class LimitError(Exception):
    """The work failed, or exceeded a limit; the text says which."""


class _Worker(NamedTuple):
    """The process, and the pipes to it and from it."""

    process: subprocess.Popen[bytes]
    requests: IO[bytes]
    answers: IO[bytes]


class LimitedProcess:
    """Calls functions in a process that starts on demand and ends after some idle time.

    Any thread may call; calls run one at a time.
    """

    def __init__(self, processor_s: int = PROCESSOR_S, memory_bytes: int = MEMORY_BYTES,
                 waiting_s: float = WAITING_S) -> None:
        self._limits = processor_s, memory_bytes
        self._waiting_s = waiting_s
        self._lock = threading.Lock()
        self._worker: _Worker | None = None

    def call(self, function: Callable, *arguments: Any) -> Any:
        """Return ``function(*arguments)``: a function of a module, arguments and result as JSON has them.

        Raises LimitError with the text of the function's error, or with the limit that it exceeded.
        """
        request = {"function": [function.__module__, function.__name__], "arguments": arguments}
        with self._lock:
            line = self._ask(json.dumps(request).encode() + b"\n")
        answer = json.loads(line)
        if "error" in answer:
            raise LimitError(answer["error"])
        return answer["result"]

    def close(self) -> None:
        """End the process."""
        with self._lock:
            self._end()

    def _ask(self, request: bytes) -> bytes:
        for _ in range(2):
            if self._worker is None:
                self._worker = _start(*self._limits)
            line = self._exchange(self._worker, request)
            if line is not None:
                return line
        raise LimitError("the process for it cannot be started")

    def _exchange(self, worker: _Worker, request: bytes) -> bytes | None:
        """Return the answer's line, or None if the process had ended after its idle time."""
        process, line, gives_up_at = worker.process, b"", time.monotonic() + self._waiting_s
        used_s = _processor_s(process)
        try:
            worker.requests.write(request)
            worker.requests.flush()
        except OSError:
            self._end()
            return None
        while not line.endswith(b"\n"):
            readable = select.select([worker.answers], [], [], max(0.0, gives_up_at - time.monotonic()))[0]
            before_s, used_s = used_s, used_s if readable else _processor_s(process)
            if used_s - before_s > _WORKS_SHARE * self._waiting_s:
                gives_up_at = time.monotonic() + self._waiting_s
                continue
            part = os.read(worker.answers.fileno(), 65536) if readable else b""
            if not part:
                if readable and process.wait() == 0:
                    self._end()
                    return None
                raise LimitError(self._why(process, bool(readable)))
            line += part
        return line

    def _why(self, process: subprocess.Popen[bytes], has_ended: bool) -> str:
        if not has_ended:
            self._end()
            return "it did nothing for %g s" % self._waiting_s
        code = process.wait()
        self._end()
        if code == -signal.SIGXCPU:
            return "it took more than %g s of processor time" % self._limits[0]
        return "the process that worked on it ended with code %d" % code

    def _end(self) -> None:
        worker, self._worker = self._worker, None
        if worker is not None:
            worker.process.kill()
            worker.process.wait()
            worker.requests.close()
            worker.answers.close()


def _processor_s(process: subprocess.Popen[bytes]) -> float:
    """Processor time that a process has used [s]; 0 after its end."""
    try:
        with open("/proc/%d/stat" % process.pid, "rb") as file:
            fields = file.read().rpartition(b")")[2].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def _start(processor_s: int, memory_bytes: int) -> _Worker:
    # One thread is enough, and each of a numerical library's own takes memory.
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    process = as_before(
        subprocess.Popen, [sys.executable, "-c", _START, str(processor_s), str(memory_bytes)],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=environment, bufsize=0,
        start_new_session=True,
    )
    return _Worker(process, process.stdin, process.stdout)


def serve() -> None:
    """Main function of the process: answer requests until the input ends, or until the idle time is over."""
    processor_s, memory_bytes = int(sys.argv[1]), int(sys.argv[2])
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # at Ctrl-C it ends with the one that asks
    give_way(max(0, _NICENESS - os.nice(0)))
    answers = os.fdopen(os.dup(1), "wb", buffering=0)
    os.dup2(2, 1)  # keep output of libraries out of the answers
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_DATA, (memory_bytes, memory_bytes))
    pending = b""
    while True:
        if not select.select([0], [], [], _IDLE_S)[0]:
            return
        part = os.read(0, 65536)
        if not part:
            return
        pending += part
        while b"\n" in pending:
            line, _, pending = pending.partition(b"\n")
            answers.write(_answer(json.loads(line), processor_s, memory_bytes) + b"\n")


def _answer(request: dict[str, Any], processor_s: int, memory_bytes: int) -> bytes:
    used = resource.getrusage(resource.RUSAGE_SELF)
    limit = int(used.ru_utime + used.ru_stime + processor_s + 0.999)
    resource.setrlimit(resource.RLIMIT_CPU, (limit, resource.RLIM_INFINITY))
    module, name = request["function"]
    try:
        result = getattr(importlib.import_module(module), name)(*request["arguments"])
        return json.dumps({"result": result}).encode()
    except MemoryError:
        return json.dumps({"error": "it took more than %d MB of memory" % (memory_bytes // 1_000_000)}).encode()
    except Exception as error:  # noqa: BLE001  (every error is passed on to the caller)
        return json.dumps({"error": str(error) or type(error).__name__}).encode()


#: The process that all meshes of this program are read in.
MESHES = LimitedProcess()
