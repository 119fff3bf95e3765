# SPDX-License-Identifier: BSD-3-Clause
"""A student's program in a process of its own: limited, unable to reach the judge, and gone when it is told to go.

Where the kernel allows, it runs in namespaces of its own: it sees no process but its own, so it can neither stop the
judge nor leave a child behind; the workspace is read-only and the judge's folder is hidden. Elsewhere (containers
without the right to make namespaces) a session, limits and a search for descendants have to do. Free of ROS.
"""
import collections
import contextlib
import ctypes
import functools
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time

from rf_checks.pacing import children_of, direct_children

CPU_S = 120
MEMORY_BYTES = 8 << 30
FILE_BYTES = 20 << 20
PROCESSES = 100
#: A program that writes more than this is stopped; the first and the last KEPT_BYTES are kept.
OUTPUT_BYTES = 4 << 20
KEPT_BYTES = 200_000
_DUMP_S = 1.0
_KILL_ROUNDS = 20
_SET_CHILD_SUBREAPER = 36  # linux/prctl.h

# Run with the program's command as "$@", in new namespaces. $1: the workspace, $2: the judge's folder.
_ENTER = r"""
root=$1 hidden=$2; shift 2
mount --bind "$root" "$root" && mount -o remount,bind,ro "$root" &&
mount -t tmpfs -o size=4k,mode=0700 tmpfs "$hidden" || exit 125
exec setpriv --bounding-set=-all --inh-caps=-all --ambient-caps=-all --no-new-privs -- "$@"
"""


def _unshare():
    user = [] if os.geteuid() == 0 else ["--user", "--map-current-user", "--keep-caps"]
    return ["unshare", *user, "--mount", "--pid", "--fork", "--kill-child=KILL", "--mount-proc", "--"]


@functools.cache
def has_namespaces():
    """Whether this machine lets us make the namespaces."""
    with tempfile.TemporaryDirectory(prefix="lab-probe-") as folder:
        command = [*_unshare(), "sh", "-c", _ENTER, "sh", folder, folder, "true"]
        with contextlib.suppress(OSError):
            return subprocess.run(command, capture_output=True).returncode == 0
    return False


def adopt_orphans():
    """Have processes whose parent ended become children of this one, where they can be found."""
    ctypes.CDLL(None, use_errno=True).prctl(_SET_CHILD_SUBREAPER, 1, 0, 0, 0)


class Student:
    """A running program. `output`, `errors`: what it wrote so far; `wrote_too_much`: that it was too much."""

    def __init__(self, command, environment, workspace, hidden, namespaces=None, pass_fds=()):
        """Start `command` (list). `workspace`: made read-only; `hidden`: folder that is not shown.

        `pass_fds`: descriptors that it inherits, under their numbers.
        """
        self.folder = tempfile.mkdtemp(prefix="lab-student-")
        self.survivors = 0
        self._before = direct_children(os.getpid())
        limits = ["prlimit", "--cpu=%d" % CPU_S, "--as=%d" % MEMORY_BYTES, "--fsize=%d" % FILE_BYTES, "--core=0", "--"]
        if namespaces is None:
            namespaces = has_namespaces()
        enter = [*_unshare(), "sh", "-c", _ENTER, "sh", str(workspace), str(hidden)] if namespaces else []
        # Its folders are its own; the fault handler tells the judge where it was when it is stopped.
        own = {"HOME": self.folder, "TMPDIR": self.folder, "ROS_HOME": self.folder, "ROS_LOG_DIR": self.folder + "/log",
               "PYTHONFAULTHANDLER": "1", "PYTHONUNBUFFERED": "1", "PYTHONDONTWRITEBYTECODE": "1",
               "NUMBA_CACHE_DIR": self.folder}
        self._process = subprocess.Popen(
            [*enter, *limits, *command], env={**environment, **own}, cwd=self.folder, stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True, pass_fds=pass_fds)
        self._streams = [_Stream(self._process.stdout), _Stream(self._process.stderr)]

    @property
    def pid(self):
        return self._process.pid

    @property
    def exit_code(self):
        """None while it runs."""
        return self._process.poll()

    @property
    def output(self):
        return self._streams[0].text()

    @property
    def errors(self):
        return self._streams[1].text()

    @property
    def wrote_too_much(self):
        return any(stream.total > OUTPUT_BYTES for stream in self._streams)

    def family(self):
        """Process ids of the program and of all that it started, orphans included."""
        roots = direct_children(os.getpid()) - self._before
        # Once it has ended its number may be another process's.
        if self.exit_code is None:
            roots.add(self.pid)
        return children_of(roots)

    def dump(self):
        """Have Python say where it is, which also ends it; what it says is in `errors` afterwards."""
        before = self._streams[1].total
        for pid in self.family() - {self.pid}:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGABRT)
        if self.pid in self.family():
            with contextlib.suppress(ProcessLookupError, PermissionError):
                # Without namespaces this is the program; with them it is `unshare`, which is ended by end().
                if not self._is_unshare():
                    os.kill(self.pid, signal.SIGABRT)
        deadline = time.monotonic() + _DUMP_S
        while self._streams[1].total == before and time.monotonic() < deadline:
            time.sleep(0.01)
        time.sleep(0.05)

    def end(self):
        """Kill what is left and count what outlived the program. To be called once."""
        if self.exit_code is not None:
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

    def _is_unshare(self):
        with contextlib.suppress(OSError), open("/proc/%d/comm" % self.pid, encoding="utf-8") as file:
            return file.read().strip() == "unshare"
        return True


def _reap(pids):
    for pid in pids:
        with contextlib.suppress(ChildProcessError):
            os.waitpid(pid, os.WNOHANG)


class _Stream:
    """Reads a pipe to its end, whatever comes, and keeps its beginning and its end."""

    def __init__(self, pipe):
        self.total = 0
        self._pipe = pipe
        self._head = bytearray()
        self._tail = collections.deque(maxlen=max(1, KEPT_BYTES // 4096))
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def _read(self):
        with contextlib.suppress(OSError, ValueError):
            while chunk := os.read(self._pipe.fileno(), 4096):
                self.total += len(chunk)
                if len(self._head) < KEPT_BYTES:
                    self._head += chunk
                else:
                    self._tail.append(chunk)
                if self.total > OUTPUT_BYTES:
                    time.sleep(0.01)  # it fills the pipe and waits, rather than a processor

    def text(self):
        return (bytes(self._head) + b"".join(list(self._tail))).decode(errors="replace")

    def close(self):
        self._thread.join(1.0)
        self._pipe.close()


def python():
    """The interpreter for programs: the one this runs on."""
    return sys.executable
