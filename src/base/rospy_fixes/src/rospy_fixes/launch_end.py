# SPDX-License-Identifier: BSD-3-Clause
"""Lets Ctrl-C and SIGTERM end a roslaunch at any moment, with all that it has started.

roslaunch's own handler waits in the main thread until another thread, the process monitor, has ended all processes. In
the middle of the start the main thread may hold a lock that the monitor needs. Both then stood for 20 s, the start
failed at its next process, and roslaunch left before its monitor had ended the master. Here the handler only says that
the end has come and interrupts the start; whatever the reason of an end, roslaunch waits for its monitor.
"""
from __future__ import annotations

import contextlib
import functools
import inspect
import os
import re
import signal
import sys
from collections.abc import Callable
from typing import Any

# Longest wait for the monitor at exit, beyond the time that its processes may take [s].
MARGIN_S = 10.0


def amend(parent: Any) -> None:
    """Amend the parts of roslaunch that its module ``parent`` has imported."""
    modules: Any = (sys.modules["roslaunch." + name]
                                       for name in ("core", "launch", "pmon", "nodeprocess"))
    core, launch, pmon, nodeprocess = modules
    end = _End(pmon)
    end.starts = {parent.ROSLaunchParent.start.__code__, launch.ROSLaunchRunner.launch.__code__}
    end.not_in = {nodeprocess.LocalProcess.start.__code__, launch.ROSLaunchRunner.stop.__code__,
                  parent.ROSLaunchParent._stop_infrastructure.__code__}
    pmon.rl_signal, pmon.shutdown_process_monitor = end.handle, wait_for_end
    parent.ROSLaunchParent.start = end.of_launch(parent.ROSLaunchParent.start)
    nodeprocess.LocalProcess.start = end.of_process(nodeprocess.LocalProcess.start)
    core.Master.is_running = end.of_question(core.Master.is_running)


def wait_for_end(monitor: Any) -> bool:
    """End the processes of a monitor; whether all of them have ended. roslaunch calls it at its exit."""
    if monitor is None:
        return False
    processes = list(monitor.procs)
    monitor.is_shutdown = True
    monitor.join(MARGIN_S + sum(getattr(process, "sigint_timeout", 0.0) + getattr(process, "sigterm_timeout", 0.0)
                                for process in processes))
    return not monitor.is_alive()


def _is_python(process: Any) -> bool:
    """Whether a process begins with the lab's sitecustomize, which lets Ctrl-C through: before that, Python tells the
    user of a fatal error."""
    if process.env.get("PYTHONPATH") != os.environ.get("PYTHONPATH"):
        return False
    try:
        with open(process.args[0], "rb") as file:
            line = file.readline(200)
    except OSError:
        return False
    return re.fullmatch(rb"#! ?(/\S*/|/usr/bin/env )python[\d.]*\s*", line) is not None


class _End:
    """The end of this process's launches, once a signal has ordered it."""

    def __init__(self, pmon: Any) -> None:
        self._pmon = pmon
        # Code of the functions that a signal interrupts, and of those within them that it does not.
        self.starts, self.not_in = set(), set()

    def handle(self, number: int, frame: Any) -> None:
        """The handler of signals: it takes no lock and waits for nothing. Raises KeyboardInterrupt in the start."""
        is_first, self._pmon._shutting_down = not self._pmon._shutting_down, True
        for monitor in list(self._pmon._pmons):
            monitor.is_shutdown = True
        former = self._pmon._signal_chain.get(number)
        if is_first and callable(former) and former not in (self.handle, signal.default_int_handler):
            with contextlib.suppress(KeyboardInterrupt):
                former(number, frame)
        if self._is_in_start(frame):
            raise KeyboardInterrupt

    def _is_in_start(self, frame: Any) -> bool:
        """Whether the start may be interrupted here: not within logging, which the monitor needs, too, nor between a
        process's begin and its entry in the books, nor where Python would print an exception and drop it, as in a
        generator that is thrown away. There the next step of the start ends it."""
        is_start = False
        while frame is not None:
            name = frame.f_globals.get("__name__", "")
            code = frame.f_code
            if code.co_flags & inspect.CO_GENERATOR or code.co_name == "__del__":
                return False
            if code in self.not_in or name.partition(".")[0] == "logging" or name == "rosgraph.roslogging":
                return False
            is_start = is_start or code in self.starts
            frame = frame.f_back
        return is_start

    def of_launch(self, start: Callable) -> Callable:
        """``start`` of a launch. Interrupted by a signal, it ends as a launch does that was interrupted later."""
        @functools.wraps(start)
        def started(launch, *arguments, **options):
            try:
                start(launch, *arguments, **options)
            except (Exception, KeyboardInterrupt):
                if not self._pmon._shutting_down:
                    raise  # an error, or Ctrl-C before there was a process
                launch._stop_infrastructure()
                if launch.runner is None:
                    raise KeyboardInterrupt from None
                launch.runner.stop()
                launch.runner.spin = launch.runner.stop  # there is nothing to wait for any more
        return started

    def of_process(self, start: Callable) -> Callable:
        """``start`` of a process: if the end has come meanwhile, the monitor may have passed it, and it ends here."""
        @functools.wraps(start)
        def started(process):
            before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT} if _is_python(process) else ())
            try:
                is_started = start(process)  # with these signals held back
            finally:
                signal.pthread_sigmask(signal.SIG_SETMASK, before)
            # Monitors of earlier launches of this process stay in the list: rostest has a launch for each test.
            monitors = list(self._pmon._pmons)
            if self._pmon._shutting_down or (monitors and all(monitor.is_shutdown for monitor in monitors)):
                process.stop([])
            return is_started
        return started

    def of_question(self, is_running: Callable) -> Callable:
        """``is_running`` of a master, which takes every exception, an interruption too, for a "no"."""
        @functools.wraps(is_running)
        def asked(master):
            answer = is_running(master)
            if self._pmon._shutting_down:
                raise KeyboardInterrupt
            return answer
        return asked
