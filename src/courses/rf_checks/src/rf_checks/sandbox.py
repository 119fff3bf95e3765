# SPDX-License-Identifier: BSD-3-Clause
"""A student's program in a separate process: limited, unable to reach the judge, and ended reliably.

It runs in a sandbox of bubblewrap (isolation.py). Only a trusted author's program may run without it, on machines
without namespaces: then a session, limits and a search for descendants replace it. Free of ROS.
"""
from __future__ import annotations

import collections
import contextlib
import ctypes
import os
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from typing import IO

import rospy_fixes
from processes import isolation, system_calls, usage
from processes.family import children_of, direct_children, is_running, memory_exceeds, with_parent
from rf_checks import hidden_paths, submission

CPU_S = 120
#: Limit of address space for each process; numpy alone reserves much.
ADDRESS_BYTES = 8 << 30
#: Limit of memory for all processes together.
MEMORY_BYTES = 2 << 30
FILE_BYTES = 20 << 20
PROCESSES = 100
#: Of all processes together: the watch reads the state of each at every record.
THREADS = 1000
# Of all processes together, one that several share counted once: the kernel keeps megabytes for what waits in each,
# which no process's memory shows. A ROS program has some dozens.
SOCKETS = 400
FILES = 1024  # open in a process
#: Files and folders that it makes: the kernel keeps a kilobyte for each, even empty ones, which no process's memory and
#: no folder's size shows.
ENTRIES = 20_000
#: A program that writes more than this is stopped; the first and the last KEPT_BYTES are kept.
OUTPUT_BYTES = 4 << 20
KEPT_BYTES = 200_000
_DUMP_S = 5.0
# For the rest of its output. With walls, bubblewrap keeps the pipe open, and the end is not seen.
_DRAIN_S = 0.2
_KILL_ROUNDS = 20
_SET_CHILD_SUBREAPER = 36  # linux/prctl.h
_STARTUP_FOLDER = "/run/startup"


def adopt_orphans() -> None:
    """Make orphaned processes children of this one, so that they can be found."""
    ctypes.CDLL(None, use_errno=True).prctl(_SET_CHILD_SUBREAPER, 1, 0, 0, 0)


class Startup:
    """Start-up data of every checked program: a folder for PYTHONPATH, variables, inherited descriptors, and what it
    must not see."""

    def __init__(self, folder: Path, environment: dict[str, str], descriptors: Sequence[int] = (),
                 hidden: Sequence[str] = ()) -> None:
        """folder: path; environment: dict; descriptors: keep their numbers; hidden: absolute paths."""
        self.folder, self.environment, self.descriptors = str(folder), dict(environment), tuple(descriptors)
        self.hidden = tuple(hidden)

    @staticmethod
    def python_path(folder: str, python_path: str) -> str:
        """PYTHONPATH of a program: with `folder` in front, but behind the lab's own environment.

        Python runs the first sitecustomize.py of all folders. The lab's runs the next one after its own work.
        """
        return os.pathsep.join(filter(None, (str(Path(rospy_fixes.__file__).parents[1]), folder, python_path)))


class RunningProgram:
    """A running program. `output`, `errors`: its output so far; `wrote_too_much`: whether that exceeds the limit."""

    def __init__(self, program: Path, arguments: Sequence[str], environment: dict[str, str], walls: bool = True,
                 startup: Startup | None = None) -> None:
        """Start a Python program (path) with `arguments` (strings).

        environment: the variables that ROS and the workspace need are passed on. walls: in a sandbox; False for
        programs of trusted authors. startup: Startup or None. Raises isolation.NotIsolated, submission.BadSubmission,
        OSError.
        """
        program = Path(program)
        self.survivors = 0
        self._has_walls = walls
        self.folder = tempfile.mkdtemp(prefix="lab-student-")
        self._before = direct_children(os.getpid())
        try:
            with system_calls.refused() if walls else contextlib.nullcontext(([], ())) as refused:
                self._process = self._start(program, arguments, environment, walls, startup, refused)
        except BaseException:
            shutil.rmtree(self.folder, ignore_errors=True)
            raise
        self._streams = [_Stream(pipe) for pipe in (self._process.stdout, self._process.stderr) if pipe is not None]

    def _start(self, program: Path, arguments: Sequence[str], environment: dict[str, str], walls: bool,
               startup: Startup | None, refused: tuple[list[str], tuple[int, ...]]) -> subprocess.Popen[bytes]:
        options, descriptors = refused
        home = isolation.HOME if walls else self.folder
        names = submission.copy(program, self.folder)
        # The fault handler reports the program's position when it is stopped.
        own = {"PYTHONFAULTHANDLER": "1", "PYTHONUNBUFFERED": "1", "PYTHONDONTWRITEBYTECODE": "1"}
        if walls:
            # A package beside the program is one entry; for single files, their folders would have to be made first.
            tops = sorted({name.split("/")[0] for name in names})
            binds = [("%s/%s" % (self.folder, top), "%s/%s" % (home, top), False) for top in tops]
            if startup is not None:
                binds.append((startup.folder, _STARTUP_FOLDER, False))
            unseen = (*hidden_paths.SOLVED, *hidden_paths.JUDGE, *(startup.hidden if startup else ()))
            enter = isolation.command(environment, binds, unseen, not isolation.has_own_network(), options)
            own.update(isolation.environment_of(environment))
        else:
            enter = []
            own = {**environment, **own, "HOME": home, "TMPDIR": home, "ROS_HOME": home, "ROS_LOG_DIR": home + "/log",
                   "NUMBA_CACHE_DIR": home}
        if startup is not None:
            folder = _STARTUP_FOLDER if walls else startup.folder
            own.update(startup.environment,
                       PYTHONPATH=startup.python_path(folder, environment.get("PYTHONPATH", "")))
        # A limit that a grader has for its judges must not be the program's: its verdict would depend on the machine.
        most = resource.getrlimit(resource.RLIMIT_DATA)[1]
        data = "unlimited" if most == resource.RLIM_INFINITY else str(most)
        limits = ["prlimit", "--cpu=%d" % CPU_S, "--as=%d" % ADDRESS_BYTES, "--data=" + data, "--fsize=%d" % FILE_BYTES,
                  "--core=0", "--nofile=%d" % FILES, "--"]
        # Bubblewrap itself orders its end with this process's, too late where this one is killed meanwhile.
        command = with_parent([*enter, *limits, python(), "%s/%s" % (home, program.name), *arguments])
        return subprocess.Popen(command, env=own, cwd=self.folder, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                                stderr=subprocess.PIPE, start_new_session=True,
                                pass_fds=(*descriptors, *(startup.descriptors if startup else ())))

    @property
    def pid(self) -> int:
        return self._process.pid

    @property
    def exit_code(self) -> int | None:
        """None while it runs; minus the signal's number if a signal ended it."""
        code = self._process.poll()
        # Bubblewrap reports signals as shells do.
        return 128 - code if self._has_walls and code is not None and 128 < code <= 192 else code

    @property
    def output(self) -> str:
        return self._streams[0].text()

    @property
    def errors(self) -> str:
        return self._streams[1].text()

    @property
    def wrote_too_much(self) -> bool:
        return any(stream.total > OUTPUT_BYTES for stream in self._streams)

    def family(self) -> set[int]:
        """Process ids of the program and of all its descendants, including orphans."""
        roots = direct_children(os.getpid()) - self._before
        # Once it has ended its number may be another process's.
        if self.exit_code is None:
            roots.add(self.pid)
        return children_of(roots)

    def excess(self) -> str:
        """The limit that the program exceeds: "output", "processes", "threads", "sockets", "files", "memory", or ""."""
        if self.wrote_too_much:
            return "output"
        family = self.family()
        if len(family) > PROCESSES:
            return "processes"
        if _count_threads(family) > THREADS:
            return "threads"
        if usage.sockets(family) > SOCKETS:
            return "sockets"
        if self._has_walls and _count_entries(family) > ENTRIES:
            return "files"
        return "memory" if memory_exceeds(family, MEMORY_BYTES) else ""

    def dump(self) -> None:
        """Make Python write its traceback to `errors`, which also ends it."""
        aborted = self.family()
        # Without walls this is the program; with them it is bubblewrap, which is ended by end().
        if self._is_bubblewrap():
            aborted.discard(self.pid)
        for pid in aborted:
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.kill(pid, signal.SIGABRT)
        deadline = time.monotonic() + _DUMP_S
        while any(map(is_running, aborted)) and time.monotonic() < deadline:
            time.sleep(0.01)
        self._streams[1].wait(_DRAIN_S)

    def end(self) -> None:
        """Kill remaining processes and count those that outlived the program. Call it once."""
        # Processes in a sandbox end with it.
        if self.exit_code is not None and not self._has_walls:
            self.survivors = len(self.family())
        for _ in range(_KILL_ROUNDS):
            family = self.family()
            for pid in family:
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
            if self.exit_code is None:
                with contextlib.suppress(subprocess.TimeoutExpired):
                    self._process.wait(0.2)
            _reap(family - {self.pid})
            if not family:
                break
            time.sleep(0.01)
        for stream in self._streams:
            stream.close()
        shutil.rmtree(self.folder, ignore_errors=True)

    def _is_bubblewrap(self) -> bool:
        with contextlib.suppress(OSError), open("/proc/%d/comm" % self.pid, encoding="utf-8") as file:
            return file.read().strip() == "bwrap"
        return True


def _count_threads(pids: set[int]) -> int:
    count = 0
    for pid in pids:
        with contextlib.suppress(OSError):
            # A link for each thread, besides the two of every folder: listing thousands would take long.
            count += os.stat("/proc/%d/task" % pid).st_nlink - 2
    return count


def _count_entries(pids: set[int]) -> int:
    """Files and folders in the writable folders of the sandbox that these processes are in."""
    with contextlib.suppress(OSError):
        root = usage.root_of(pids)
        return usage.files_in_memory(root, isolation.FOLDERS)[0] if root else 0
    return 0


def _reap(pids: set[int]) -> None:
    for pid in pids:
        with contextlib.suppress(ChildProcessError):
            os.waitpid(pid, os.WNOHANG)


class _Stream:
    """Reads a pipe completely, and keeps the beginning and the end of the data."""

    def __init__(self, pipe: IO[bytes]) -> None:
        self.total = 0
        self._pipe = pipe
        self._head = bytearray()
        self._tail = collections.deque(maxlen=max(1, KEPT_BYTES // 4096))
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def _read(self) -> None:
        with contextlib.suppress(OSError, ValueError):
            while chunk := os.read(self._pipe.fileno(), 4096):
                self.total += len(chunk)
                if len(self._head) < KEPT_BYTES:
                    self._head += chunk
                else:
                    self._tail.append(chunk)
                if self.total > OUTPUT_BYTES:
                    time.sleep(0.01)  # the program then waits at the full pipe instead of using a processor

    def text(self) -> str:
        return (bytes(self._head) + b"".join(list(self._tail))).decode(errors="replace")

    def wait(self, timeout_s: float) -> None:
        """Wait until all has been read, or for timeout_s."""
        self._thread.join(timeout_s)

    def close(self) -> None:
        self.wait(1.0)
        self._pipe.close()


def python() -> str:
    """The interpreter for programs: the one of this process."""
    return sys.executable
