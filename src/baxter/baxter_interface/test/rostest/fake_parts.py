#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Channels, a navigator and a head of a few lines for the SDK's tests, with knobs for their faults.

Knobs are private parameters, read at the start and again at each call of ~reload. The topics ~touch (a channel, inputs
too) and ~turn (a wheel's counter) stand in for fingers.
"""
import threading
import time

import rospy
from baxter_core_msgs.msg import (
    AnalogIOState,
    AnalogOutputCommand,
    DigitalIOState,
    DigitalOutputCommand,
    HeadPanCommand,
    HeadState,
    NavigatorState,
)
from std_msgs.msg import Bool, UInt8
from std_srvs.srv import Trigger, TriggerResponse

RATE_HZ = 100.0
KNOBS = {
    "io_echo": True,         # channels follow their commands
    "head_full_speed": 8.4,  # [rad/s]
    "nods": True,            # the head nods when it is told to
    "nod_ends": True,        # and stops again
}
NOD_S = 0.3
OUTPUTS = ("torso_left_inner_light", "torso_left_outer_light")
INPUTS = ("left_lower_cuff",)
BUTTONS = ("torso_left_button_ok", "torso_left_button_back", "torso_left_button_show")
FAN, RANGE = "torso_fan", "left_hand_range"


class FakeParts:
    def __init__(self):
        self._lock = threading.RLock()
        self._knobs = {}
        self.reload(None)
        self._digital = dict.fromkeys((*OUTPUTS, *INPUTS, *BUTTONS), False)
        self._analog = {FAN: 0, RANGE: 123.5}
        self._wheel = 0
        self._head = HeadState()
        self._pan_command = HeadPanCommand(speed_ratio=1.0)
        self._nod_began_s = None
        self._digital_publishers = {
            name: rospy.Publisher("/robot/digital_io/%s/state" % name, DigitalIOState, queue_size=1)
            for name in self._digital}
        self._analog_publishers = {
            name: rospy.Publisher("/robot/analog_io/%s/state" % name, AnalogIOState, queue_size=1)
            for name in self._analog}
        self._navigator_publisher = rospy.Publisher(
            "/robot/navigators/torso_left_navigator/state", NavigatorState, queue_size=1)
        self._head_publisher = rospy.Publisher("/robot/head/head_state", HeadState, queue_size=1)
        self._subscribers = [
            rospy.Subscriber("/robot/digital_io/command", DigitalOutputCommand, self._on_digital),
            rospy.Subscriber("/robot/analog_io/command", AnalogOutputCommand, self._on_analog),
            rospy.Subscriber("/robot/head/command_head_pan", HeadPanCommand, self._on_pan),
            rospy.Subscriber("/robot/head/command_head_nod", Bool, self._on_nod),
            rospy.Subscriber("~touch", DigitalOutputCommand, self._on_touch),
            rospy.Subscriber("~turn", UInt8, self._on_turn),
        ]
        self._service = rospy.Service("~reload", Trigger, self.reload)

    def reload(self, _request):
        with self._lock:
            self._knobs = {name: rospy.get_param("~" + name, default) for name, default in KNOBS.items()}
        return TriggerResponse(success=True)

    def run(self):
        while not rospy.is_shutdown():
            with self._lock:
                self._step_head(1.0 / RATE_HZ)
                self._publish()
            time.sleep(1.0 / RATE_HZ)

    def _step_head(self, dt):
        distance = self._pan_command.target - self._head.pan
        reach = self._pan_command.speed_ratio * self._knobs["head_full_speed"] * dt
        self._head.pan += max(-reach, min(reach, distance))
        self._head.isTurning = abs(distance) > reach > 0.0
        if self._nod_began_s is not None and self._knobs["nod_ends"] and time.monotonic() - self._nod_began_s > NOD_S:
            self._nod_began_s = None
        self._head.isNodding = self._nod_began_s is not None

    def _publish(self):
        for name, publisher in self._digital_publishers.items():
            publisher.publish(DigitalIOState(state=self._digital[name], isInputOnly=name not in OUTPUTS))
        for name, publisher in self._analog_publishers.items():
            publisher.publish(AnalogIOState(value=self._analog[name], isInputOnly=name != FAN))
        self._navigator_publisher.publish(NavigatorState(
            button_names=["ok", "back", "show"], buttons=[self._digital[name] for name in BUTTONS],
            wheel=self._wheel, light_names=["inner", "outer"], lights=[self._digital[name] for name in OUTPUTS]))
        self._head_publisher.publish(self._head)

    def _on_digital(self, message):
        with self._lock:
            if self._knobs["io_echo"] and message.name in OUTPUTS:
                self._digital[message.name] = message.value

    def _on_analog(self, message):
        with self._lock:
            if self._knobs["io_echo"] and message.name == FAN:
                self._analog[FAN] = message.value

    def _on_pan(self, message):
        with self._lock:
            self._pan_command = message

    def _on_nod(self, message):
        with self._lock:
            if message.data and self._knobs["nods"] and self._nod_began_s is None:
                self._nod_began_s = time.monotonic()

    def _on_touch(self, message):
        with self._lock:
            self._digital[message.name] = message.value

    def _on_turn(self, message):
        with self._lock:
            self._wheel = message.data


def main():
    rospy.init_node("fake_parts", disable_rostime=True)
    FakeParts().run()


if __name__ == "__main__":
    main()
