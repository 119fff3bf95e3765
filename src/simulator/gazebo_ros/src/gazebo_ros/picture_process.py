# SPDX-License-Identifier: BSD-3-Clause
"""Starts the node that draws cameras where no launch file does: ``gzserver`` alone shows its cameras, as Gazebo's does.

The thread of this class owns the process; the loop only says that there is a camera.
"""
from __future__ import annotations

import subprocess
import threading
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

    from loop_ros.protocol import Log

#: After a renderer has failed, the next one is started this much later [s].
RESTART_S = 2.0
# How long a renderer may take to end [s].
_ENDS_S = 2.0


class PictureProcess:
    """At most one renderer at a time. It ends with this process, whatever ends that."""

    def __init__(self, command: list[str], runs_already: Callable[[], bool], log: Log,
                 restart_s: float = RESTART_S) -> None:
        """``command``: list of words; the process must end when its standard input ends.

        ``runs_already()``: whether another process draws; asked before each start. ``log``: has ``info``, ``warn``.
        """
        self._command, self._runs_already, self._log, self._restart_s = command, runs_already, log, restart_s
        self._wanted, self._closing = threading.Event(), threading.Event()
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._thread = threading.Thread(target=self._run, name="picture process", daemon=True)
        self._thread.start()

    def want(self) -> None:
        """There is a camera. Does not wait; further calls change nothing."""
        self._wanted.set()

    def close(self) -> None:
        """End the renderer and wait for its end."""
        with self._lock:
            self._closing.set()
            if self._process is not None and self._process.stdin is not None:
                self._process.stdin.close()
        self._wanted.set()
        self._thread.join(_ENDS_S)
        if self._thread.is_alive() and self._process is not None:
            self._process.kill()

    def _run(self) -> None:
        self._wanted.wait()
        while not self._runs_already():
            process = self._start()
            if process is None:
                return
            code = process.wait()
            if self._closing.is_set() or code == 0:
                # Another node took its name, or somebody ended it.
                return
            self._log.warn("sensor_renderer ended with code %d and is started again" % code)
            self._closing.wait(self._restart_s)

    def _start(self) -> subprocess.Popen[bytes] | None:
        """Start the process; return it, or None where it does not run."""
        with self._lock:
            if self._closing.is_set():
                return None
            self._log.info("the world has cameras and no launch file starts what draws them: starting sensor_renderer")
            try:
                self._process = subprocess.Popen(self._command, stdin=subprocess.PIPE)
            except OSError as error:
                self._log.warn("no pictures: %s" % error)
                return None
            return self._process
