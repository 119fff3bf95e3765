# SPDX-License-Identifier: BSD-3-Clause
"""The panel's ROS side: messages from and to `panel.Panel`, and the service that presses its buttons."""
from baxter_core_msgs.msg import (
    AnalogIOState,
    AnalogIOStates,
    DigitalIOState,
    DigitalIOStates,
    NavigatorState,
    NavigatorStates,
)
from bullet_sim_msgs.srv import Press, PressRequest, PressResponse
from std_msgs.msg import UInt32

from baxter_sim_hardware.errors import CommandRefused
from baxter_sim_hardware.sensing.panel import ANALOG, BUTTONS, DIGITAL, ESTOP, LIGHTS, NAVIGATORS, Panel, navigator_name
from sim_time.stamps import stamp

PRESS_SERVICE = "sim/press"


class PanelTopics:
    """makers: {key of the interface table: function(time_s, part, snapshot) -> message};
    takers: {key: function(part, message, time_s)}, which raise CommandRefused."""

    def __init__(self, context, press_estop):
        """press_estop: function(whether the emergency stop is pressed now)."""
        self._panel, self._press_estop = Panel(), press_estop
        self.reset = self._panel.reset
        self.attach, self.attach_valve = self._panel.attach, self._panel.attach_valve
        self.makers = {
            "digital_io": lambda time_s, name, _: self._digital(name),
            "digital_io_states": lambda time_s, part, _: DigitalIOStates(
                list(DIGITAL), [self._digital(name) for name in DIGITAL]),
            "analog_io": lambda time_s, name, _: self._analog(name, time_s),
            "analog_io_uint32": lambda time_s, name, _: UInt32(self._panel.read_analog(name)),
            "analog_io_states": lambda time_s, part, _: AnalogIOStates(
                list(ANALOG), [self._analog(name, time_s) for name in ANALOG]),
            "navigator": lambda time_s, navigator, _: self._navigator(navigator),
            "navigators_states": lambda time_s, part, _: NavigatorStates(
                [navigator_name(navigator) for navigator in NAVIGATORS],
                [self._navigator(navigator) for navigator in NAVIGATORS]),
        }
        self.takers = {
            "digital_io_command": lambda part, msg, time_s: self._panel.set_digital(msg.name, msg.value),
            "analog_io_command": lambda part, msg, time_s: self._panel.set_analog(msg.name, msg.value),
        }
        context.service(PRESS_SERVICE, Press, self._press)

    def cuff_squeezed(self, side):
        """Whether somebody squeezes the cuff of one hand."""
        return self._panel.digital["%s_lower_cuff" % side]

    def _digital(self, name):
        return DigitalIOState(int(self._panel.read_digital(name)), DIGITAL[name])

    def _analog(self, name, time_s):
        return AnalogIOState(stamp(time_s), float(self._panel.read_analog(name)), ANALOG[name])

    def _navigator(self, navigator):
        buttons, wheel, lights = self._panel.navigator(navigator)
        return NavigatorState(list(BUTTONS), buttons, wheel, list(LIGHTS), lights)

    def _press(self, request):
        try:
            if request.action == PressRequest.TURN:
                self._panel.turn(request.component, request.steps)
            elif request.action in (PressRequest.PRESS, PressRequest.RELEASE) and request.component == ESTOP:
                self._press_estop(request.action == PressRequest.PRESS)
            elif request.action in (PressRequest.PRESS, PressRequest.RELEASE):
                self._panel.press(request.component, request.action == PressRequest.PRESS)
            else:
                raise CommandRefused("action is '%s'; choices are press, release, turn" % request.action)
        except CommandRefused as refusal:
            return PressResponse(False, str(refusal))
        return PressResponse(True, "")
