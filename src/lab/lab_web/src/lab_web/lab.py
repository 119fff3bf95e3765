# SPDX-License-Identifier: BSD-3-Clause
"""Control of the robot by pages: one holds the control, everybody may stop. No ROS: the robot is an argument, with

- ``limits``: {joint: motion.PageJointLimits}, empty until the robot is known; ``poses``: {name: {joint: angle [rad]}}
- ``measured()``: {joint: position [rad]}, of ``time_s`` in the robot's time; ``why_not_ready()``: "" or a sentence
- ``explain(joint, tell)``: calls ``tell(sentence)`` soon, on any thread: what keeps a joint from moving
- ``command(setpoints)``: {joint: [rad], of a recording also SIDE_gripper: [%]}; ``stop()``, ``enable()``,
  ``disable()``, ``grip(side, action)``: do not wait, and raise RobotError
"""
from __future__ import annotations

import math
import threading
import time
from typing import TYPE_CHECKING

from lab_web.control import SILENCE_S, Control, NotInControl
from lab_web.motion import JointStandstill, MotionError, PageMotion, held

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from lab_web.motion import PageJointLimits
    from lab_web.playback import RecordingPlayback
    from lab_web.robot import BaxterTopics
    from lab_web.steering import SteeredMotion

#: Period of commands to the robot while it moves [s].
TICK_S = 0.01
#: Period of looks at the page in control while nothing moves [s].
IDLE_S = 0.04


class RobotError(Exception):
    """The robot cannot do that; the text says why."""


class PageLab:
    """All pages share one. Operations come from any thread; ``changed()`` is called after the control has changed,
    ``told(client, code, text)`` tells one page (None: all) something, ``rested(client)`` that its motion is over.

    A motion is a stream, which follows a slider, or what one click has begun: a page may be silent for longer then.
    """

    def __init__(self, robot: BaxterTopics, changed: Callable[[], object],
                 told: Callable[[int | None, str, str], object],
                 silence_s: float = SILENCE_S, clock: Callable[[], float] = time.monotonic,
                 rested: Callable[[int | None], object] = lambda client: None) -> None:
        self._robot = robot
        self._changed = changed
        self._told = told
        self._rested = rested
        self._clock = clock
        self._lock = threading.Lock()
        self._control = Control(silence_s)
        self._motion: PageMotion | RecordingPlayback | SteeredMotion = PageMotion({})
        self._is_stream = True
        self._standstill = JointStandstill()
        # Of the last step of the motion.
        self._setpoints = {}
        self._moving = threading.Event()
        self._served = dict(_OPERATIONS)
        self._for_viewers = set()
        self._releases = []
        self._releases_of_silent = []

    def add(self, name: str, serve: Callable[[int, dict[str, Any]], object], needs_control: bool = True,
            for_viewers: bool = False, needs_power: bool = False) -> None:
        """An operation beside those of this module: ``serve(client, operation)`` does not wait, and raises RobotError;
        with ``needs_control`` only for the page that has the control, with ``for_viewers`` also for one that may not
        act, with ``needs_power`` only while the robot is enabled.
        """
        def checked(lab, client, operation):
            if needs_control:
                lab._check(client, needs_power)
            serve(client, operation)
        self._served[name] = checked
        if for_viewers:
            self._for_viewers.add(name)

    def when_lost(self, release: Callable[[], object], when_silent: bool = True) -> None:
        """``release()`` is called when the robot is stopped, and when a page loses the control, goes or (with
        ``when_silent``) falls silent: it ends what the page holds. It does not wait, and may have nothing to end.
        """
        self._releases.append(release)
        if when_silent:
            self._releases_of_silent.append(release)

    @property
    def holder(self) -> int | None:
        """The client that has the control, or None."""
        return self._control.holder

    @property
    def is_moving(self) -> bool:
        return self._moving.is_set()

    def serve(self, client: int, may_act: bool, operation: dict[str, Any]) -> None:
        """One operation of a page, a dict with "op". Errors are told to the client."""
        op = operation.get("op")
        if op == "stop":
            self.stop(client)
            return
        serve = self._served.get(op) if isinstance(op, str) else None
        if serve is None:
            self._told(client, "unknown", "unknown operation %r" % (op,))
        elif not may_act and op not in self._for_viewers:
            self._told(client, "only_watches", "this address only watches; it can stop the robot, nothing else")
        else:
            try:
                serve(self, client, operation)
            except NotInControl as error:
                self._told(client, error.code, str(error))
            except (MotionError, RobotError) as error:
                self._told(client, "refused", str(error))

    def stop(self, client: int) -> None:
        """Stop the robot; every page may."""
        # Before the lock: nothing must hold this up.
        self._robot.stop()
        with self._lock:
            self._halt()
        self._told(None, "stopped", "a page has pressed stop")

    def beat(self, client: int, page_answers: bool = True) -> None:
        """A page has shown that it is there, or its connection that it is, while the page does not answer."""
        with self._lock:
            self._control.beat(client, self._clock(), page_answers)

    def gone(self, client: int) -> None:
        """A page has gone: what it moved stops."""
        with self._lock:
            had = self._control.release(client)
            if had:
                self._halt()
        if had:
            self._changed()

    def tick(self, dt: float) -> None:
        """Send the next set-points, ``dt`` [s] after the last ones; stop where the page or the robot is not ready."""
        with self._lock:
            client, now_s = self._control.holder, self._clock()
            is_alive = self._control.is_alive(now_s)
            if not is_alive:
                for release in self._releases_of_silent:
                    release()
            if not self._motion.is_moving:
                if self._moving.is_set():
                    self._rested(client)
                self._moving.clear()
                self._setpoints = {}
                return
            if not self._is_stream:
                is_alive = self._control.is_connected(now_s)
            why, lost, still, measured = self._robot.why_not_ready(), None, "", self._measured()
            if is_alive and not why:
                try:
                    still = self._standstill.look(self._robot.time_s, self._setpoints, measured)
                    if not still:
                        self._setpoints = self._motion.step(dt, measured)
                        self._robot.command(self._setpoints)
                        return
                except MotionError as error:
                    lost = error
            self._halt()
        if still:
            self._robot.explain(still, lambda what: self._told(client, "held", "%s stands still: %s" % (still, what)))
        elif lost:
            self._told(client, "refused", str(lost))
        elif why:
            self._told(client, "not_ready", why)
        else:
            self._told(client, "page_silent", "the arms were stopped: no sign of life of the page that moved them")

    def run(self, ends: Callable[[], bool]) -> None:
        """Tick until ``ends()``; for a separate thread."""
        last = self._clock()
        while not ends():
            if not self._moving.wait(IDLE_S):
                last = self._clock()
                self.tick(0.0)
                continue
            time.sleep(TICK_S)
            now = self._clock()
            if now - last > 5.0 * TICK_S:
                # This process did not get to run; heartbeats that wait in its sockets come first.
                time.sleep(TICK_S)
            self.tick(min(now - last, 5.0 * TICK_S))
            last = now

    def _halt(self) -> None:
        if self._motion.stop():
            if not self._robot.why_not_ready():
                self._robot.command(held(self._motion.limits, self._setpoints, self._measured()))
            self._setpoints = {}
        self._moving.clear()
        for release in self._releases:
            release()

    def _measured(self) -> dict[str, float]:
        # A broken sensor, or another node under the robot's topic.
        return {joint: position for joint, position in self._robot.measured().items() if math.isfinite(position)}

    def _take(self, client: int, _operation: dict[str, Any]) -> None:
        with self._lock:
            taken = self._control.take(client, self._clock())
            if taken:
                self._halt()
        if taken:
            self._changed()

    def _release(self, client: int, _operation: dict[str, Any]) -> None:
        self.gone(client)

    def _move(self, client: int, operation: dict[str, Any]) -> None:
        self._aim(client, _joints_of(operation), is_stream=True)

    def _go(self, client: int, operation: dict[str, Any]) -> None:
        self._aim(client, _joints_of(operation), is_stream=False)

    def _pose(self, client: int, operation: dict[str, Any]) -> None:
        name = operation.get("name")
        targets = self._robot.poses.get(name) if isinstance(name, str) else None
        if targets is None:
            raise MotionError("there is no pose %r; there are %s" % (name, ", ".join(self._robot.poses)))
        self._aim(client, targets, is_stream=False)

    def start(self, client: int, make: Callable[[dict[str, PageJointLimits], dict[str, float]],
                                                PageMotion | RecordingPlayback | SteeredMotion],
              is_stream: bool = False) -> None:
        """Move by ``make(limits, measured)``, which has what PageMotion has, in place of what is under way. Raises
        NotInControl, MotionError.
        """
        with self._lock:
            self._require_ready(client, is_stream)
            self._replace(make(self._robot.limits, self._measured()))
            self._begin(is_stream)

    def let_go(self, client: int, motion: PageMotion | RecordingPlayback | SteeredMotion) -> None:
        """End ``motion`` where it is that of this page."""
        with self._lock:
            if self._control.holder == client and self._motion is motion:
                motion.stop()

    def _replace(self, motion: PageMotion | RecordingPlayback | SteeredMotion) -> None:
        if motion is not self._motion:
            self._motion.stop()
            self._setpoints = {}
        self._motion = motion

    def _begin(self, is_stream: bool) -> None:
        if not (is_stream and self._moving.is_set()):
            self._standstill = JointStandstill()
        self._is_stream = is_stream
        self._moving.set()

    def _aim(self, client: int, targets: dict[str, float], is_stream: bool) -> None:
        with self._lock:
            self._require_ready(client, is_stream)
            motion = self._motion
            if not isinstance(motion, PageMotion) or motion.limits != self._robot.limits:
                motion = PageMotion(self._robot.limits)
                self._replace(motion)
            motion.aim(targets, self._measured())
            self._begin(is_stream)

    def _require_ready(self, client: int, is_stream: bool) -> None:
        self._control.check(client, self._clock(), is_stream)
        why = self._robot.why_not_ready()
        if why:
            raise NotInControl("not_ready", why)

    def _enable(self, client: int, _operation: dict[str, Any]) -> None:
        self._check(client)
        self._robot.enable()

    def _disable(self, client: int, _operation: dict[str, Any]) -> None:
        self._check(client)
        self._robot.disable()

    def _grip(self, client: int, operation: dict[str, Any]) -> None:
        side, action = operation.get("side"), operation.get("action")
        if not isinstance(side, str) or not isinstance(action, str):
            raise RobotError("\"side\" and \"action\" must be texts")
        self._check(client, needs_power=True)
        self._robot.grip(side, action)

    def _check(self, client: int, needs_power: bool = False) -> None:
        with self._lock:
            if needs_power:
                self._require_ready(client, is_stream=True)
            else:
                self._control.check(client, self._clock())


def _joints_of(operation: dict[str, Any]) -> dict[str, Any]:
    targets = operation.get("joints")
    if not isinstance(targets, dict):
        raise MotionError("\"joints\" must be an object of joints and angles")
    return targets


_OPERATIONS = {"take": PageLab._take, "release": PageLab._release, "move": PageLab._move, "go": PageLab._go,
               "pose": PageLab._pose, "enable": PageLab._enable, "disable": PageLab._disable, "grip": PageLab._grip}
