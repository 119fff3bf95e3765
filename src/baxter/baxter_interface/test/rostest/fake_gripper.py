#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The left gripper in a few lines, of any kind, for the SDK's tests; knobs as those of the fake robot."""
import json
import threading
import time

import rospy
from baxter_core_msgs.msg import EndEffectorCommand, EndEffectorProperties, EndEffectorState
from std_srvs.srv import Trigger, TriggerResponse

RATE_HZ = 100.0
SPEED = 200.0  # [%/s]
IDS = {0: 131073, 1: 65537, 2: 65538, 3: 131073}  # by ui_type
KNOBS = {
    "ui_type": 2,
    "firmware_date": "2014/7/24 18:30:00",
    "calibrated": True,   # at a reload
    "error": False,       # at a reload
    "acknowledges": True,
    "works": True,        # commands have effects
    "block_at": -1.0,     # position of an object between the fingers [%]; negative: none
    "seal": True,         # sucking finds something
}


class FakeGripper:
    def __init__(self):
        self._lock = threading.RLock()
        self.reload(None)
        self._publishers = [rospy.Publisher("/robot/end_effector/left_gripper/" + name, kind, queue_size=1)
                            for name, kind in (("properties", EndEffectorProperties), ("state", EndEffectorState))]
        self._subscribers = [
            rospy.Subscriber("/robot/end_effector/left_gripper/command", EndEffectorCommand, self._on_command),
            rospy.Subscriber("/robot/end_effector/left_gripper/rsdk/set_properties", EndEffectorProperties,
                             self._on_set_properties),
            rospy.Subscriber("/robot/end_effector/left_gripper/rsdk/set_state", EndEffectorState, self._on_set_state)]
        self._service = rospy.Service("~reload", Trigger, self.reload)

    def reload(self, _request):
        with self._lock:
            knobs = {name: rospy.get_param("~" + name, default) for name, default in KNOBS.items()}
            kind = knobs["ui_type"]
            electric = kind == 2
            self._properties = EndEffectorProperties(
                id=IDS[kind], ui_type=kind, product="SDK End Effector", firmware_rev="3.0.0 5.5",
                firmware_date=knobs["firmware_date"], controls_force=electric, controls_position=electric)
            self._state = EndEffectorState(id=IDS[kind], enabled=1, ready=1, calibrated=int(knobs["calibrated"]),
                                           error=int(knobs["error"]), position=100.0)
            self._goal = 100.0
            self._suction = {"vacuum sensor": 0, "vacuum": False, "blowing": False, "sucking": False}
            self._blow_until_s = 0.0
            self._knobs = knobs
        return TriggerResponse(success=True)

    def run(self):
        while not rospy.is_shutdown():
            with self._lock:
                if self._properties.ui_type != EndEffectorProperties.PASSIVE_GRIPPER:
                    self._step(1.0 / RATE_HZ)
                for publisher, message in zip(self._publishers, (self._properties, self._state), strict=True):
                    publisher.publish(message)
            time.sleep(1.0 / RATE_HZ)

    def _step(self, dt):
        state, block = self._state, self._knobs["block_at"]
        step = max(-SPEED * dt, min(SPEED * dt, self._goal - state.position))
        held = block >= 0.0 and step < 0.0 and state.position + step <= block
        if held:
            step = 0.0
        state.position += step
        state.moving = int(step != 0.0)
        state.gripping = int(held)
        self._suction["blowing"] = time.monotonic() < self._blow_until_s
        if self._properties.ui_type == 1:
            state.state = json.dumps(self._suction)

    def _on_command(self, message):
        with self._lock:
            repeated = (message.sender, message.sequence) == (self._state.command_sender,
                                                              self._state.command_sequence)
            if self._knobs["acknowledges"]:
                self._state.command = message.command
                self._state.command_sender, self._state.command_sequence = message.sender, message.sequence
            if self._knobs["works"] and message.id == self._state.id and not repeated:
                self._do(message.command, json.loads(message.args or "{}"))

    def _do(self, command, args):
        state = self._state
        if command == "go" and "position" in args:
            self._goal = args["position"]
        elif command == "go":
            seal = self._knobs["seal"]
            self._suction.update({"sucking": True, "vacuum": seal, "vacuum sensor": 204 if seal else 0})
        elif command == "stop":
            self._goal = state.position
        elif command == "release":
            self._suction.update({"sucking": False, "vacuum": False, "vacuum sensor": 0})
            self._blow_until_s = time.monotonic() + 0.2
        elif command in ("calibrate", "clear_calibration"):
            state.calibrated = int(command == "calibrate")
        elif command == "reset":
            state.error = 0
        elif command == "reboot":
            state.calibrated = 0

    def _on_set_properties(self, message):
        with self._lock:
            self._properties = message

    def _on_set_state(self, message):
        with self._lock:
            self._state = message


def main():
    rospy.init_node("fake_gripper", disable_rostime=True)
    FakeGripper().run()


if __name__ == "__main__":
    main()
