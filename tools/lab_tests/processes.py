# SPDX-License-Identifier: BSD-3-Clause
"""Processes that a test or a notebook started: known by a variable in their environment, which every child inherits."""
import os
import signal
import time
from pathlib import Path

MARKER = "LAB_TEST_RUN"
RUN_MARKER = "LAB_TEST_WHOLE_RUN"
NOTEBOOK_MARKER = "LAB_NOTEBOOK_RUN"


def marked(value: str, marker: str = MARKER) -> dict[int, str]:
    """pid -> command line of all living processes, but this one, whose environment says marker=value."""
    needle = f"{marker}={value}".encode()
    found = {}
    for entry in Path("/proc").iterdir():
        if not entry.name.isdigit() or int(entry.name) == os.getpid():
            continue
        try:
            if needle in (entry / "environ").read_bytes().split(b"\0"):
                command = (entry / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace").strip()
                if command:  # a zombie has none
                    found[int(entry.name)] = command
        except OSError:
            continue  # it has just ended, or belongs to another user
    return found


def wait_until_gone(value: str, timeout_s: float, marker: str = MARKER) -> dict[int, str]:
    """Processes that are still alive after at most timeout_s.

    Gone means not found twice in a row: during exec a process shows no environment, and a list of processes may miss a
    new one.
    """
    deadline = time.monotonic() + timeout_s
    was_gone = False
    while True:
        alive = marked(value, marker)
        if (not alive and was_gone) or (alive and time.monotonic() >= deadline):
            return alive
        was_gone = not alive
        time.sleep(0.05)


def kill_all(value: str, marker: str = MARKER) -> None:
    """End every marked process, and those that it starts meanwhile."""
    for _ in range(5):
        alive = wait_until_gone(value, 0.0, marker)
        if not alive:
            return
        for pid in alive:
            try:
                os.kill(pid, signal.SIGKILL)
            except ProcessLookupError:
                pass
        time.sleep(0.05)
