# SPDX-License-Identifier: BSD-3-Clause
"""Shared by the robot's command-line programs: start and end, an enabled robot, and a loop that detects its loss."""
from __future__ import annotations

import errno
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from types import TracebackType
from typing import Any

import rospy

from baxter_dataflow.ros_clock import RosClock
from baxter_dataflow.waiting import Ticker
from baxter_model.readiness import ENABLE

from . import startup
from .joint_motion import DISABLED_GRACE_S
from .robot_enable import RobotEnable
from .settings import CHECK_VERSION

# A robot that has reported nothing for this long is lost [s, wall]; it reports 100 times a second.
LOST_AFTER_S = 5.0
# Longest time for disabling the robot at the end [s, wall]; a present one takes a few hundredths.
LAST_WORD_S = 5.0


class ProgramFailed(OSError):
    """A program did not reach its aim; the text says which and why."""

    def __init__(self, text: str, number: int = errno.EIO) -> None:
        super().__init__(number, text)


class RobotLost(ProgramFailed):
    """The robot was disabled, stopped or restarted, or has stopped publishing, while a program worked with it."""


def run(node_name: str, body: Callable[[], None], **options) -> int:
    """Run a program: wait for the robot, become the node `node_name`, call `body()`; return the exit status.

    `options` go to rospy.init_node. The status is 0 after success, 1 after an OSError, a ValueError or a ROSException,
    with one line on stderr, or when ROS was shut down meanwhile, and 130 after Ctrl-C. `body` gets Ctrl-C and SIGTERM
    as KeyboardInterrupt while ROS still runs, so that its `finally` and `with` can bring the robot to a safe state.
    """
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        startup.init_node(node_name, disable_signals=True, **options)
        body()
        # Another process has shut ROS down, and logged why: this program's work is incomplete.
        return 1 if rospy.is_shutdown() else 0
    except KeyboardInterrupt:
        return 130
    except (OSError, ValueError, rospy.ROSException) as error:
        if getattr(error, "errno", None) == errno.EPIPE:
            raise  # of the standard output: rospy_fixes ends the program without a word
        print("%s: %s" % (os.path.basename(sys.argv[0]), getattr(error, "strerror", None) or error), file=sys.stderr)
        return 1
    finally:
        rospy.signal_shutdown("the program has ended")


def expect(done: Any, text: str) -> None:
    """Raise ProgramFailed with `text` unless `done`: for moves, which return whether they succeeded."""
    if not done:
        raise ProgramFailed(text)


class EnabledRobot:
    """Keeps the robot enabled inside a `with`; disables it at the end if it was disabled before.

    Raises as RobotEnable and its enable(). An OSError inside the `with` becomes RobotLost if the robot was disabled by
    others before.
    """

    def __init__(self, versioned: bool = CHECK_VERSION) -> None:
        self.switch = RobotEnable(versioned)
        self._was_enabled = self.switch.state().enabled
        self._disabled_since_s = None

    def __enter__(self) -> EnabledRobot:
        self.switch.enable()
        return self

    def __exit__(self, kind: type | None, error: Any, traceback: TracebackType | None) -> None:
        if rospy.is_shutdown() or isinstance(error, RobotLost):
            return
        if isinstance(error, OSError) and not self.is_enabled():
            raise self._loss() from error  # the loss is the reason of the failure
        if self._was_enabled:
            return
        failures = []

        def disable() -> None:
            try:
                self.switch.disable()
            except OSError as failure:
                failures.append(failure)

        # Its time-out is in ROS time, which may have stopped with a simulation.
        worker = threading.Thread(target=disable, daemon=True)
        worker.start()
        worker.join(LAST_WORD_S)
        if worker.is_alive():
            rospy.logwarn("the robot does not answer any more: it is not disabled")
        elif failures and error is None:
            raise failures[0]

    def is_enabled(self) -> bool:
        """Tell whether the robot is enabled now."""
        state = self.switch.state()
        return state.enabled and not state.stopped

    def beats(self, rate_hz: float) -> Iterator[None]:
        """Yield `rate_hz` times a second of ROS time until ROS shuts down, while the robot is present and enabled.

        Waits for a paused or absent simulation, with log lines. Raises RobotLost.
        """
        clock = RosClock()
        ticker = Ticker(clock, rate_hz)
        while not rospy.is_shutdown():
            yield
            ticker.sleep()
            self._check(clock.now())

    def _check(self, now_s: float) -> None:
        if self.switch.silence_s() > LOST_AFTER_S and rospy.rostime.is_wallclock():
            raise RobotLost("lost the robot: it has reported nothing for %.0f s" % LOST_AFTER_S)
        if self.is_enabled():
            self._disabled_since_s = None
        elif self._disabled_since_s is None or now_s < self._disabled_since_s:
            self._disabled_since_s = now_s
        elif now_s - self._disabled_since_s >= DISABLED_GRACE_S:
            raise self._loss()

    def _loss(self) -> RobotLost:
        what = "stopped" if self.switch.state().stopped else "disabled, or restarted"
        return RobotLost("lost the robot: it was %s; enable it, and start this program again: %s" % (what, ENABLE))
