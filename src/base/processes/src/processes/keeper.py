# SPDX-License-Identifier: BSD-3-Clause
"""`python3 keeper.py STATE_FILE COMMAND...`: runs a command for as long as its own standard input is open.

The starting process holds the other end of that pipe, so that the command ends when its owner ends, in any way.
Free of ROS. The state file is locked while the keeper lives; its first line is `running` or `ending`, the others are
the command. With LAB_SESSION_AFTER naming another keeper's state file, the command outlives that keeper.
"""
from __future__ import annotations

import contextlib
import ctypes
import fcntl
import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from typing import TextIO

# roslaunch gives a node 15 s after SIGINT and 2 s after SIGTERM before it kills it.
STOP_TIMEOUT_S = 20.0
_POLL_S = 0.1
_PR_SET_CHILD_SUBREAPER = 36


def _write_state(file: TextIO, state: str, command: Sequence[str]) -> None:
    file.seek(0)
    file.truncate()
    file.write("%s\n%s\n" % (state, " ".join(command)))
    file.flush()


def is_held(path: str | os.PathLike) -> bool:
    """Whether a living keeper holds the lock of this state file."""
    try:
        with open(path, encoding="utf-8") as file:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except FileNotFoundError:
        return False
    except BlockingIOError:
        return True
    return False


def _wait_until(condition: Callable[[], bool], timeout_s: float) -> None:
    deadline = time.monotonic() + timeout_s
    while not condition() and time.monotonic() < deadline:
        time.sleep(_POLL_S)


def _own_children() -> list[int]:
    with open("/proc/self/task/%d/children" % os.getpid(), encoding="ascii") as file:
        return [int(word) for word in file.read().split()]


def _end_everything() -> None:
    """Kill remaining processes: as subreaper this process inherits every orphan below it."""
    while True:
        children = _own_children()
        if not children:
            return
        for pid in children:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
            with contextlib.suppress(ChildProcessError):
                os.waitpid(pid, 0)


def _wait_for_orphans(grace_s: float) -> None:
    deadline = time.monotonic() + grace_s
    while _own_children() and time.monotonic() < deadline:
        with contextlib.suppress(ChildProcessError):
            if not os.waitpid(-1, os.WNOHANG)[0]:
                time.sleep(_POLL_S)


def keep(state_path: str | os.PathLike, command: Sequence[str], after: str | os.PathLike | None = None,
         grace_s: float = 0.0) -> int:
    """Run `command` until it ends or standard input closes; returns its exit code, or 0 when it was ended.

    after: state file of a keeper that ends first; grace_s: time for what the command leaves to end by itself.
    """
    with open(state_path, "a", encoding="utf-8") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        ctypes.CDLL(None).prctl(_PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
        _write_state(lock, "running", command)
        child = subprocess.Popen(command, stdin=subprocess.DEVNULL)
        try:
            while child.poll() is None:
                if select.select([sys.stdin], [], [], _POLL_S)[0] and not os.read(sys.stdin.fileno(), 1024):
                    break
            code = child.poll()
            _write_state(lock, "ending", command)
            if code is None:
                if after:
                    _wait_until(lambda: not is_held(after), STOP_TIMEOUT_S + 5.0)
                child.send_signal(signal.SIGINT)
                with contextlib.suppress(subprocess.TimeoutExpired):
                    child.wait(STOP_TIMEOUT_S)
            _wait_for_orphans(grace_s)
        finally:
            _end_everything()
            os.unlink(state_path)
    return code or 0


if __name__ == "__main__":
    # A Ctrl-C in the terminal is for the owner; the keeper acts when the owner is gone. Not SIG_IGN, which the command
    # would inherit.
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda *_: None)
    sys.exit(keep(sys.argv[1], sys.argv[2:], os.environ.get("LAB_SESSION_AFTER")))
