#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The left gripper, of any kind, for the SDK's tests: the simulator's own, on fingers and a cup without physics.

Knobs are private parameters, read at the start and again at each call of ~reload.
"""
import copy
import threading
import time
from types import SimpleNamespace

import rospy
from baxter_core_msgs.msg import EndEffectorCommand, EndEffectorProperties, EndEffectorState
from std_srvs.srv import Trigger, TriggerResponse

from baxter_sim_hardware.errors import CommandRefused
from baxter_sim_hardware.grippers.electric import OPEN, ElectricGripperHardware
from baxter_sim_hardware.grippers.hands import NoHand
from baxter_sim_hardware.grippers.suction import SuctionGripperHardware
from baxter_sim_hardware.robot_state import BaxterState, RobotState
from baxter_sim_hardware.topics.grippers import GripperTopics
from lab_testing.waiting import beats

SIDE = "left"
RATE_HZ = 100.0
TRAVEL_M = 0.02  # of a finger
CUSTOM_ID = 131073
KNOBS = {
    "ui_type": EndEffectorProperties.ELECTRIC_GRIPPER,
    "firmware_date": "",  # of the electric one, in place of its own
    "enabled": True,      # the robot
    "calibrated": True,   # at a reload
    "error": False,       # at a reload
    "acknowledges": True,
    "works": True,        # commands have effects
    "block_at": -1.0,     # position of an object between the fingers [%]; negative: none
    "seal": True,         # sucking finds something
}


class Fingers:
    """Two fingers that jump to their target, unless something lies between them."""

    def __init__(self, knobs):
        self.gripper = ElectricGripperHardware(TRAVEL_M, OPEN, 1.0 / RATE_HZ)
        self.gripper.calibrated, self.gripper.error = knobs["calibrated"], knobs["error"]
        self._block = knobs["block_at"] / 100.0
        self._position, self._squeeze = OPEN, 0.0

    def readings(self, _positions):
        return 100.0 * self._position, self._squeeze

    def update(self, _joints):
        drive = self.gripper.update(self._position, lambda: self._squeeze)
        if drive is not None:
            setpoint, force = drive
            self._position = max(setpoint, self._block)
            self._squeeze = force if setpoint < self._block else 0.0


class Cup:
    """A cup on an object, or on nothing."""

    def __init__(self, knobs):
        self.gripper = SuctionGripperHardware(1.0 / RATE_HZ)
        self._seal = knobs["seal"]

    def readings(self, _positions):
        return 0.0, 0.0

    def update(self, _joints):
        self.gripper.update(self._seal)


HANDS = {EndEffectorProperties.ELECTRIC_GRIPPER: Fingers, EndEffectorProperties.SUCTION_CUP_GRIPPER: Cup}


class FakeGripper:
    def __init__(self):
        self._lock = threading.RLock()
        self.reload(None)
        prefix = "/robot/end_effector/%s_gripper/" % SIDE
        self._properties = rospy.Publisher(prefix + "properties", EndEffectorProperties, queue_size=1)
        self._state = rospy.Publisher(prefix + "state", EndEffectorState, queue_size=1)
        self._subscribers = [
            rospy.Subscriber(prefix + "command", EndEffectorCommand, self._on_command),
            rospy.Subscriber(prefix + "rsdk/set_properties", EndEffectorProperties,
                             lambda message: self._take("gripper_set_properties", message)),
            rospy.Subscriber(prefix + "rsdk/set_state", EndEffectorState,
                             lambda message: self._take("gripper_set_state", message))]
        self._service = rospy.Service("~reload", Trigger, self.reload)

    def reload(self, _request):
        with self._lock:
            self._knobs = {name: rospy.get_param("~" + name, default) for name, default in KNOBS.items()}
            kind = self._knobs["ui_type"]
            self._hand = HANDS[kind](self._knobs) if kind in HANDS else NoHand()
            state = RobotState(BaxterState.ENABLED if self._knobs["enabled"] else BaxterState.DISABLED)
            self._topics = GripperTopics({SIDE: self._hand}, state)
            if kind == EndEffectorProperties.PASSIVE_GRIPPER:
                self._take("gripper_set_properties", EndEffectorProperties(id=CUSTOM_ID, ui_type=kind))
        return TriggerResponse(success=True)

    def run(self):
        for _ in beats(RATE_HZ, rospy.is_shutdown):
            with self._lock:
                self._hand.update(None)
                self._publish()

    def _publish(self):
        arguments = time.monotonic(), SIDE, SimpleNamespace(position=())
        properties = copy.copy(self._topics.publishers["gripper_properties"](*arguments))
        properties.firmware_date = self._knobs["firmware_date"] or properties.firmware_date
        properties.ui_type = self._knobs["ui_type"]  # 0 as older robots say of a bare arm
        state = self._topics.publishers["gripper_state"](*arguments)
        if not self._knobs["acknowledges"]:
            state.command, state.command_sender, state.command_sequence = "", "", 0
        self._properties.publish(properties)
        self._state.publish(state)

    def _on_command(self, message):
        if self._knobs["works"]:
            self._take("gripper_command", message)
            return
        with self._lock:
            gripper = self._hand.gripper
            gripper.command, gripper.sender, gripper.sequence = message.command, message.sender, message.sequence

    def _take(self, key, message):
        with self._lock:
            try:
                self._topics.handlers[key](SIDE, message, time.monotonic())
            except CommandRefused as refusal:
                rospy.logwarn("%s", refusal)


def main():
    rospy.init_node("fake_gripper", disable_rostime=True)
    FakeGripper().run()


if __name__ == "__main__":
    main()
