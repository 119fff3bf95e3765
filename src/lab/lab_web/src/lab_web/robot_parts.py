# SPDX-License-Identifier: BSD-3-Clause
"""Baxter's buttons, outputs, head and screen for pages, in rospy."""
from __future__ import annotations

import contextlib
from typing import TYPE_CHECKING

import rosgraph
import rospy
from baxter_core_msgs.msg import AnalogOutputCommand, DigitalOutputCommand
from bullet_sim_msgs.srv import Press
from sensor_msgs.msg import Image
from std_msgs.msg import Bool, UInt16

from lab_web.lab import RobotError
from lab_web.serving import SCREEN

if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

PRESS_SERVICE = "/robot/sim/press"
#: What the screen of a simulated robot shows.
SCREEN_TOPIC = "/robot/sim/screen"
#: All sonars of the head.
_SONARS = (1 << 12) - 1
_LARGEST_ANALOG = 65535


class PartPublishers:
    """Publishers of all parts; what they show, pages read from the robot's topics."""

    def __init__(self) -> None:
        self._press = rospy.ServiceProxy(PRESS_SERVICE, Press)
        self._digital = rospy.Publisher("/robot/digital_io/command", DigitalOutputCommand, queue_size=10)
        self._analog = rospy.Publisher("/robot/analog_io/command", AnalogOutputCommand, queue_size=10)
        self._sonars = rospy.Publisher("/robot/sonar/head_sonar/set_sonars_enabled", UInt16, queue_size=1)
        self._nod = rospy.Publisher("/robot/head/command_head_nod", Bool, queue_size=1)
        self._screen = rospy.Publisher("/robot/xdisplay", Image, queue_size=1, latch=True)

    def operations(self) -> dict[str, Callable[[int, dict[str, Any]], None]]:
        """{operation: method} of those that need no power, for :meth:`lab_web.lab.PageLab.add`."""
        return {"output": self.output, "sonars": self.sonars, "screen": self.screen}

    @staticmethod
    def can_press() -> bool:
        """Are there buttons to press? Only a simulated robot has them. Waits for the master."""
        with contextlib.suppress(rosgraph.MasterError):
            return bool(rosgraph.Master(rospy.get_name()).lookupService(PRESS_SERVICE))
        return False

    def switch(self, action: str, name: str, steps: int) -> None:
        """Press or release a button, turn a wheel; waits. Raises RobotError."""
        try:
            answer = self._press(component=name, action=action, steps=steps)
        except (rospy.ServiceException, rospy.ROSInterruptException) as error:
            raise RobotError("%s cannot be reached: %s" % (name, error)) from None
        if not answer.success:
            raise RobotError(answer.status_message)

    def output(self, _client: int, operation: dict[str, Any]) -> None:
        """Switch a digital output (``value`` true or false), or set an analog one. Raises RobotError."""
        name, value = operation.get("name"), operation.get("value")
        if not isinstance(name, str) or not name:
            raise RobotError("\"name\" is %r; the name of an output is expected" % (name,))
        if isinstance(value, bool):
            self._digital.publish(DigitalOutputCommand(name, value))
        elif isinstance(value, int) and 0 <= value <= _LARGEST_ANALOG:
            self._analog.publish(AnalogOutputCommand(name, value))
        else:
            raise RobotError("%s cannot be set to %r; true, false, or a whole number from 0 to %d is expected"
                             % (name, value, _LARGEST_ANALOG))

    def sonars(self, _client: int, operation: dict[str, Any]) -> None:
        """All sonars on or off."""
        self._sonars.publish(UInt16(_SONARS if operation.get("on") is True else 0))

    def nod(self, _client: int, _operation: dict[str, Any]) -> None:
        """Nod once."""
        self._nod.publish(Bool(True))

    def screen(self, _client: int, operation: dict[str, Any]) -> None:
        """Show a picture on the head's screen: ``content``, bytes (600, 1024, 3), red first. Raises RobotError."""
        width, height = SCREEN
        rows = operation.get("content")
        if not isinstance(rows, bytes) or len(rows) != 3 * width * height:
            raise RobotError("a picture for the screen comes by an upload of %d x %d pixels" % SCREEN)
        self._screen.publish(Image(height=height, width=width, encoding="rgb8", step=3 * width, data=rows))
