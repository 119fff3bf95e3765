#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Channels, a navigator and a head for the SDK's tests: the simulator's own, without a robot, with knobs for faults.

Knobs are private parameters, read at the start and at each call of ~reload. Its service /robot/sim/press presses
buttons, as the simulator's does.
"""
import threading
import time
from types import SimpleNamespace

import numpy as np
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
from std_msgs.msg import Bool
from std_srvs.srv import Trigger, TriggerResponse

from baxter_sim_hardware.errors import CommandRefused
from baxter_sim_hardware.head import PanDrive
from baxter_sim_hardware.robot_state import BaxterState, RobotState
from baxter_sim_hardware.topics.head import HeadTopics
from baxter_sim_hardware.topics.panel import PanelTopics
from lab_testing.waiting import beats

RATE_HZ = 100.0
KNOBS = {
    "io_echo": True,     # channels follow their commands
    "head_turns": True,  # the head follows its commands
    "nods": True,        # the head nods when it is told to
    "nod_ends": True,    # and stops again
}
DIGITAL = ("torso_left_inner_light", "torso_left_outer_light", "left_lower_cuff", "torso_left_button_ok",
           "torso_left_button_back", "torso_left_button_show")
RANGE = "left_hand_range"
ANALOG = (RANGE, "torso_fan")
NAVIGATOR = "torso_left"
RANGE_MM = 123


class PanJoint:
    """A model of one joint, which jumps to its target; limits as in the robot's description [rad]."""

    lower, upper, max_effort = np.array([-np.pi / 2.0]), np.array([np.pi / 2.0]), np.array([50.0])

    def __init__(self):
        self.position, self.velocity = np.zeros(1), np.zeros(1)

    def index(self, _names):
        return np.array([0])

    def read_joints(self):
        return self.position, self.velocity, np.zeros(1)

    def drive_position(self, _index, position, _max_effort, velocity):
        self.position, self.velocity = position.copy(), velocity.copy()


class FakeParts:
    def __init__(self):
        self._lock = threading.RLock()
        self.reload(None)
        self._services = []
        # Lights are drawn at links, of which there are none here.
        context = SimpleNamespace(service=self._serve, robot=SimpleNamespace(links={}))
        panel = PanelTopics(context, lambda pressed: None)
        panel.attach(RANGE, lambda: RANGE_MM)
        self._joint = PanJoint()
        # The robot is enabled here.
        self._pan = PanDrive(self._joint, 1.0 / RATE_HZ)
        self._head = HeadTopics(self._pan, RobotState(BaxterState.ENABLED), 1.0 / RATE_HZ)
        self._publishers = {**panel.publishers, **self._head.publishers}
        self._handlers = {**panel.handlers, **self._head.handlers}
        self._nods_on = False
        self._published = [
            *(("digital_io", name, self._publisher("digital_io/%s/state" % name, DigitalIOState)) for name in DIGITAL),
            *(("analog_io", name, self._publisher("analog_io/%s/state" % name, AnalogIOState)) for name in ANALOG),
            ("navigator", NAVIGATOR, self._publisher("navigators/%s_navigator/state" % NAVIGATOR, NavigatorState)),
            ("head_state", None, self._publisher("head/head_state", HeadState))]
        self._subscribers = [
            rospy.Subscriber("/robot/" + topic, kind, self._take, (key, knob)) for topic, kind, key, knob in (
                ("digital_io/command", DigitalOutputCommand, "digital_io_command", "io_echo"),
                ("analog_io/command", AnalogOutputCommand, "analog_io_command", "io_echo"),
                ("head/command_head_pan", HeadPanCommand, "command_head_pan", "head_turns"),
                ("head/command_head_nod", Bool, "command_head_nod", "nods"))]
        self._services.append(rospy.Service("~reload", Trigger, self.reload))

    @staticmethod
    def _publisher(topic, kind):
        return rospy.Publisher("/robot/" + topic, kind, queue_size=1)

    def _serve(self, name, kind, handler):
        def locked(request):
            with self._lock:
                return handler(request)

        self._services.append(rospy.Service("/robot/" + name, kind, locked))

    def reload(self, _request):
        with self._lock:
            self._knobs = {name: rospy.get_param("~" + name, default) for name, default in KNOBS.items()}
        return TriggerResponse(success=True)

    def run(self):
        for _ in beats(RATE_HZ, rospy.is_shutdown):
            with self._lock:
                self._pan.update()
                now = time.monotonic()
                for key, part, publisher in self._published:
                    message = self._publishers[key](now, part, self._joint)
                    if key == "head_state":
                        self._nods_on = not self._knobs["nod_ends"] and (self._nods_on or message.isNodding)
                        message.isNodding |= self._nods_on
                    publisher.publish(message)

    def _take(self, message, key_and_knob):
        key, knob = key_and_knob
        with self._lock:
            if not self._knobs[knob]:
                return
            try:
                self._handlers[key](None, message, time.monotonic())
            except CommandRefused as refusal:
                rospy.logwarn("%s", refusal)


def main():
    rospy.init_node("fake_parts", disable_rostime=True)
    FakeParts().run()


if __name__ == "__main__":
    main()
