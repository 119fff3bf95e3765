# SPDX-License-Identifier: BSD-3-Clause
"""The panel's ROS side: messages from and to `panel.ControlPanel`, and the service that presses its buttons."""

from __future__ import annotations

from typing import TYPE_CHECKING

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
from baxter_sim_hardware.sensing import navigator_lights
from baxter_sim_hardware.sensing.panel import (
    ANALOG,
    BUTTONS,
    DIGITAL,
    ESTOP,
    LIGHTS,
    NAVIGATORS,
    ControlPanel,
    navigator_name,
)
from sim_time.stamps import stamp

from .row import STATE_RATE_HZ, RobotPart, TopicRow

if TYPE_CHECKING:
    from collections.abc import Callable

    from baxter_core_msgs.msg import AnalogOutputCommand, DigitalOutputCommand

    from baxter_sim_hardware.snapshot import JointSnapshot
    from gazebo_ros.model_plugin import PluginContext

PRESS_SERVICE = "sim/press"


class PanelTopics(RobotPart):
    """Buttons, lights, wheels and the other channels."""

    def __init__(self, context: PluginContext, press_estop: Callable[[bool], None]) -> None:
        """press_estop: function(whether the emergency stop is pressed now)."""
        self._panel, self._press_estop = ControlPanel(), press_estop
        self.attach, self.attach_valve = self._panel.attach, self._panel.attach_valve
        self._drawn = {
            navigator: context.screen(link, navigator_lights.place(navigator), navigator_lights.SIZE_M,
                                      navigator_lights.PIXELS, glows=True)
            for navigator, link in navigator_lights.LINKS.items() if link in context.robot.links}
        context.service(PRESS_SERVICE, Press, self._press)

    def reset(self) -> None:
        self._panel.reset()
        for navigator in self._drawn:
            self._draw(navigator)

    def _draw(self, navigator: str) -> None:
        _, _, lights = self._panel.navigator(navigator)
        self._drawn[navigator].show(navigator_lights.picture(*lights))

    def cuff_squeezed(self, side: str) -> bool:
        """Whether the cuff of one hand is squeezed."""
        return self._panel.digital["%s_lower_cuff" % side]

    def _digital(self, time_s: float, name: str, snapshot: JointSnapshot) -> DigitalIOState:
        return DigitalIOState(int(self._panel.read_digital(name)), DIGITAL[name])

    def _all_digital(self, time_s: float, component: None, snapshot: JointSnapshot) -> DigitalIOStates:
        return DigitalIOStates(list(DIGITAL), [self._digital(time_s, name, snapshot) for name in DIGITAL])

    def _analog(self, time_s: float, name: str, snapshot: JointSnapshot) -> AnalogIOState:
        return AnalogIOState(stamp(time_s), float(self._panel.read_analog(name)), ANALOG[name])

    def _analog_uint32(self, time_s: float, name: str, snapshot: JointSnapshot) -> UInt32:
        return UInt32(self._panel.read_analog(name))

    def _all_analog(self, time_s: float, component: None, snapshot: JointSnapshot) -> AnalogIOStates:
        return AnalogIOStates(list(ANALOG), [self._analog(time_s, name, snapshot) for name in ANALOG])

    def _navigator(self, time_s: float, navigator: str, snapshot: JointSnapshot) -> NavigatorState:
        buttons, wheel, lights = self._panel.navigator(navigator)
        return NavigatorState(list(BUTTONS), buttons, wheel, list(LIGHTS), lights)

    def _all_navigators(self, time_s: float, component: None, snapshot: JointSnapshot) -> NavigatorStates:
        return NavigatorStates([navigator_name(navigator) for navigator in NAVIGATORS],
                               [self._navigator(time_s, navigator, snapshot) for navigator in NAVIGATORS])

    def _set_digital(self, component: None, msg: DigitalOutputCommand, time_s: float) -> None:
        self._panel.set_digital(msg.name, msg.value)
        for navigator in self._drawn:
            if msg.name in ("%s_%s_light" % (navigator, light) for light in LIGHTS):
                self._draw(navigator)

    def _set_analog(self, component: None, msg: AnalogOutputCommand, time_s: float) -> None:
        self._panel.set_analog(msg.name, msg.value)

    def _press(self, request: PressRequest) -> PressResponse:
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

    TOPICS = (
        TopicRow("digital_io", "digital_io/{digital}/state", "baxter_core_msgs/DigitalIOState", STATE_RATE_HZ, _digital,
                 "one button, light, ... : 0 or 1, and whether it is an input; `<limb>_suck` and `<limb>_blow` are the "
                 "valves of a suction gripper"),
        TopicRow("digital_io_states", "digital_io_states", "baxter_core_msgs/DigitalIOStates", STATE_RATE_HZ,
                 _all_digital, "all of them"),
        TopicRow("analog_io", "analog_io/{analog}/state", "baxter_core_msgs/AnalogIOState", STATE_RATE_HZ, _analog,
                 "one wheel (0 to 255, wraps), hand range [mm], vacuum sensor (0 to 255), or the integer that "
                 "`torso_fan`, `torso_lighting` were told"),
        TopicRow("analog_io_uint32", "analog_io/{analog}/value_uint32", "std_msgs/UInt32", STATE_RATE_HZ,
                 _analog_uint32, "the same value"),
        TopicRow("analog_io_states", "analog_io_states", "baxter_core_msgs/AnalogIOStates", STATE_RATE_HZ, _all_analog,
                 "all of them"),
        TopicRow("navigator", "navigators/{navigator}_navigator/state", "baxter_core_msgs/NavigatorState",
                 STATE_RATE_HZ, _navigator,
                 "buttons ok, back, show; wheel; lights inner, outer: the same as in digital_io and analog_io"),
        TopicRow("navigators_states", "navigators_states", "baxter_core_msgs/NavigatorStates", STATE_RATE_HZ,
                 _all_navigators, "all four"),
        TopicRow("digital_io_command", "digital_io/command", "baxter_core_msgs/DigitalOutputCommand", None,
                 _set_digital, "switches one digital output, by name"),
        TopicRow("analog_io_command", "analog_io/command", "baxter_core_msgs/AnalogOutputCommand", None, _set_analog,
                 "sets one analog output, by name, 0 to 65535"),
    )
