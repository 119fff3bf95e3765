# SPDX-License-Identifier: BSD-3-Clause
"""The wire to one gripper: its state and properties, and commands that it acknowledges."""
from __future__ import annotations

import errno
import json
import time
from collections.abc import Callable
from typing import Any, cast

import rospy
from baxter_core_msgs.msg import EndEffectorCommand, EndEffectorProperties, EndEffectorState

from baxter_dataflow import Signal, wait_for
from baxter_dataflow.ros_clock import RosClock
from baxter_dataflow.waiting import Stopwatch, is_unlimited
from baxter_model.readiness import NOT_ENABLED
from rospy_nodes.json_object import JsonRefused, read_object

from . import startup
from .gripper_types import TYPES
from .hindrance import IgnoredCommands

# Numbers of commands wrap here.
SEQUENCE_END = 2**31 - 1
# Least time for the effect of a command after the wait for its acknowledgement [s].
EFFECT_TIMEOUT_S = 0.5
# Commands that a robot takes that is not enabled.
NEED_NO_POWER = ("configure", "set", "no_op")


class NoGripper(OSError):
    """The arm carries no gripper."""


class GripperLink:
    """The link that the classes of gripper_types use; waits for the gripper as startup.wait_for_part does."""

    def __init__(self, side: str) -> None:
        self.name = "%s_gripper" % side
        # None until the first ones have come, for which the constructor waits.
        self.state = cast("EndEffectorState", None)
        self.properties = cast("EndEffectorProperties", None)
        self.parameters = {}
        self.on_type_changed = Signal()
        self.on_gripping_changed = Signal()
        self.on_moving_changed = Signal()
        self._sequence = 0
        self._ignored, self._refusal = IgnoredCommands(), ""
        self._prefix = "/robot/end_effector/%s/" % self.name
        self._publisher = rospy.Publisher(self._prefix + "command", EndEffectorCommand, queue_size=10)
        self.kind = None
        self._subscribers = [
            rospy.Subscriber(self._prefix + "properties", EndEffectorProperties, self._on_properties, queue_size=1),
            rospy.Subscriber(self._prefix + "state", EndEffectorState, self._on_state, queue_size=1),
        ]
        try:
            startup.wait_for_part(self._prefix + "state", lambda: self.state is not None)
            startup.wait_for_part(self._prefix + "properties", lambda: self.kind is not None)
        except OSError as failure:
            self.unregister()
            if failure.errno == errno.ETIMEDOUT and self.properties is not None and self.kind is None:
                raise NoGripper(errno.ETIMEDOUT, "there is no gripper on the %s arm: its properties say ui_type %d; "
                              "1 is suction, 2 electric, 3 custom" % (side, self.properties.ui_type)) from failure
            raise
        except BaseException:
            self.unregister()
            raise
        startup.wait_for_subscribers(self._publisher)

    @property
    def details(self) -> dict[str, int]:
        """The JSON object in the state, empty if there is none that can be read."""
        try:
            return read_object(self.state.state)
        except JsonRefused:
            return {}

    def command(self, command: str, block: bool = False, test: Callable[[], bool] | None = None, timeout_s: float = 0.0,
                args: dict[str, Any] | None = None, delay_s: float = 0.0) -> bool:
        """Send a command. Returns True if not `block`; otherwise whether `test()` came true in `timeout_s`.

        Repeats it at 100 Hz until the gripper acknowledges it, and calls `test` only from `delay_s` later. Ends early
        where the gripper has no power.
        """
        self._sequence = self._sequence % SEQUENCE_END + 1
        message = EndEffectorCommand(
            id=self.state.id, command=command, sender="%s_%s" % (rospy.get_name(), command), sequence=self._sequence,
            args="" if args is None else json.dumps(args))
        self._refusal = ""
        if command not in NEED_NO_POWER:
            self._ignored.sent(time.monotonic())
        self._publisher.publish(message)
        if not block:
            return True
        clock = RosClock()
        watch = Stopwatch(clock.now())
        wait_for(lambda: self._acknowledges(message) or self._refusal, timeout_s, raise_on_error=False, rate=100,
                 body=lambda: self._publisher.publish(message))
        acknowledged = self._acknowledges(message)
        clock.sleep(delay_s)
        remaining_s = timeout_s
        if not is_unlimited(timeout_s):
            remaining_s = max(EFFECT_TIMEOUT_S, timeout_s - watch.elapsed_s(clock.now()))
        has_effect = test or (lambda: True)
        wait_for(lambda: has_effect() or self._refusal, remaining_s, raise_on_error=False)
        done = bool(has_effect())
        if not done and not self._refusal:
            self.warn("%s was %s, but had not the effect it should within %.1f s%s" % (
                command, "acknowledged" if acknowledged else "not even acknowledged", watch.elapsed_s(clock.now()),
                "; the gripper reports an error, which reset() clears" if self.state.error == 1 else ""))
        return done

    def configure(self) -> None:
        """Send the parameters."""
        self.command("configure", args=self.parameters)

    def override(self, topic: str, message: Any, test: Callable[[], bool], timeout_s: float) -> bool:
        """Publish `message` on rsdk/`topic` until `test()`; return whether it came true."""
        publisher = rospy.Publisher(self._prefix + "rsdk/" + topic, type(message), queue_size=10)
        try:
            return wait_for(test, timeout_s, raise_on_error=False, rate=100, body=lambda: publisher.publish(message))
        finally:
            publisher.unregister()

    def sleep(self, duration_s: float) -> None:
        RosClock().sleep(duration_s)

    def warn(self, text: str) -> None:
        rospy.logwarn("%s: %s", self.name, text)

    def unregister(self) -> None:
        for end in (*self._subscribers, self._publisher):
            end.unregister()

    def _acknowledges(self, message: Any) -> bool:
        # A robot that does not count commands reports 0.
        return (self.state.command_sender == message.sender
                and self.state.command_sequence in (message.sequence, 0))

    def _on_properties(self, message: Any) -> None:
        before, self.properties = self.kind, message
        kind = TYPES.get(message.ui_type)
        if kind is None:
            self.kind = None
        elif not isinstance(before, kind):
            self.parameters = dict(kind.defaults)
            self.kind = kind(self)
            if before is not None:
                self.on_type_changed(kind.name)

    def _on_state(self, message: Any) -> None:
        before, self.state = self.state, message
        if why := self._ignored.heard(time.monotonic(), NOT_ENABLED if message.enabled == 0 else ""):
            self._refusal = why
            self.warn("a command has no effect: %s" % why)
        if before is None:
            return
        for changed, old, new in ((self.on_gripping_changed, before.gripping, message.gripping),
                                  (self.on_moving_changed, before.moving, message.moving)):
            if (old == 1) != (new == 1):
                changed(new == 1)
