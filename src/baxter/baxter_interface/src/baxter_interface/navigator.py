# SPDX-License-Identifier: BSD-3-Clause
"""One of the four navigators: a wheel, three buttons and two lights on an arm or on the torso."""
from __future__ import annotations

from typing import Any, cast

import rospy
from baxter_core_msgs.msg import NavigatorState

from baxter_dataflow import Signal
from baxter_model import SIDES
from command_line.options import counted

from . import startup
from .digital_io import DigitalIO
from .wheel import wheel_steps

LOCATIONS = (*SIDES, *("torso_%s" % side for side in SIDES))
# By their place in NavigatorState: pressing the wheel, the button above it, the button below it.
BUTTON_COUNT = 3
INNER, OUTER = 0, 1


class Navigator:
    """A navigator by its place: "left", "right", "torso_left" or "torso_right".

    Attributes:
        button0_changed, button1_changed, button2_changed: Signals, called with the button's new state (bool).
        wheel_changed: Signal, called with the steps that the wheel turned (int, signed).
    Waits up to 30 s of wall time for a robot that is still starting, and 5 s for each part of one that is up.
    Raises AttributeError for another name, OSError with errno ETIMEDOUT if it does not report,
    rospy.ROSInitException before rospy.init_node.
    """

    def __init__(self, location: str) -> None:
        if location not in LOCATIONS:
            raise AttributeError("there is no navigator %r: the navigators are %s"
                                 % (location, ", ".join(map(repr, LOCATIONS))))
        self._id = location
        self._last = cast("NavigatorState", None)  # until the first one has come, for which the constructor waits
        self.button0_changed = Signal()
        self.button1_changed = Signal()
        self.button2_changed = Signal()
        self.wheel_changed = Signal()
        self._inner = DigitalIO(location + "_inner_light")
        self._outer = DigitalIO(location + "_outer_light")
        topic = "/robot/navigators/%s_navigator/state" % location
        self._subscriber = rospy.Subscriber(topic, NavigatorState, self._on_state, queue_size=10)
        try:
            startup.wait_for_part(topic, lambda: self._last is not None)
        except BaseException:
            self._subscriber.unregister()
            raise

    @property
    def wheel(self) -> int:
        """The wheel's counter, 0 to 255; it wraps."""
        return self._last.wheel

    @property
    def button0(self) -> bool:
        """Whether the wheel is pressed."""
        return self._last.buttons[0]

    @property
    def button1(self) -> bool:
        """Whether the button above the wheel is pressed."""
        return self._last.buttons[1]

    @property
    def button2(self) -> bool:
        """Whether the button below the wheel is pressed."""
        return self._last.buttons[2]

    @property
    def inner_led(self) -> bool:
        """Whether the inner light is on. Assigning waits until it follows; raises as DigitalIO.set_output."""
        return self._last.lights[INNER]

    @inner_led.setter
    def inner_led(self, enabled: bool) -> None:
        self._inner.set_output(enabled)

    @property
    def outer_led(self) -> bool:
        """Whether the outer light is on. Assigning waits until it follows; raises as DigitalIO.set_output."""
        return self._last.lights[OUTER]

    @outer_led.setter
    def outer_led(self, enabled: bool) -> None:
        self._outer.set_output(enabled)

    def _on_state(self, message: Any) -> None:
        if len(message.buttons) < BUTTON_COUNT or len(message.lights) <= OUTER:
            rospy.logwarn_throttle(5.0, "navigator %s: a state with %s and %s is ignored: 3, 2 are due"
                                        % (self._id, counted(len(message.buttons), "button"),
                                           counted(len(message.lights), "light")))
            return
        before, self._last = self._last, message
        if before is None:
            return
        for number, changed in enumerate((self.button0_changed, self.button1_changed, self.button2_changed)):
            if before.buttons[number] != message.buttons[number]:
                changed(message.buttons[number])
        steps = wheel_steps(before.wheel, message.wheel)
        if steps:
            self.wheel_changed(steps)
