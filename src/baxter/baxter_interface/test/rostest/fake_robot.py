#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""A minimal robot for the SDK's tests: states, commands and switches, with knobs for its faults.

Knobs are private parameters, read at the start and again at each call of ~reload; see KNOBS.
"""
import threading
import time

import rospy
from baxter_core_msgs.msg import (
    AssemblyState,
    CollisionAvoidanceState,
    CollisionDetectionState,
    EndpointState,
    JointCommand,
)
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Empty, Float64
from std_srvs.srv import Trigger, TriggerResponse

from lab_testing.waiting import beats

RATE_HZ = 100.0
SIDES = ("left", "right")
JOINTS = ("e0", "e1", "s0", "s1", "w0", "w1", "w2")  # alphabetical, as a robot reports them
# The simulator's start pose, roughly [rad].
START = {"s0": 0.19, "s1": 1.047, "e0": 0.0, "e1": 0.49, "w0": -0.18, "w1": -0.06, "w2": -0.01}
KNOBS = {
    "start_delay_s": 0.0,      # wall time between the node's start and its first topic
    "lag_s": 0.02,             # time constant with which joints follow their commands
    "stuck": [],               # joints that never move
    "near": [],                # what collision avoidance finds too near to the left arm ...
    "other_arm": False,        # ... and whether it is part of the other one
    "collides": False,         # whether the left arm feels a collision
    "enabled": False,          # at the start
    "refuse_enable": False,    # enable requests change nothing
    "stop_button": False,      # pressed: stopped, and no reset helps
    "sticky_error": False,     # an error flag that no reset clears
    "version": "1.2.0.57",     # of the software; "unset": the parameter is left alone
    "clock_start_s": -1.0,     # first reading of /clock; negative: no simulated time
}


class FakeRobot:
    def __init__(self):
        self._lock = threading.RLock()
        self._knobs = {}
        self.reload(None)
        self._state = AssemblyState(enabled=self._knobs["enabled"])
        self._angles = {"%s_%s" % (side, joint): START[joint] for side in SIDES for joint in JOINTS}
        self._targets = dict(self._angles)
        self._speeds = dict.fromkeys(self._angles, 0.0)
        if self._knobs["version"] != "unset":
            rospy.set_param("/rethink/software_version", self._knobs["version"])
        time.sleep(self._knobs["start_delay_s"])

        self._state_publisher = rospy.Publisher("/robot/state", AssemblyState, queue_size=1)
        self._joint_publisher = rospy.Publisher("/robot/joint_states", JointState, queue_size=1)
        self._endpoint_publishers = [
            rospy.Publisher("/robot/limb/%s/endpoint_state" % side, EndpointState, queue_size=1) for side in SIDES]
        self._avoidance_publisher = rospy.Publisher("/robot/limb/left/collision_avoidance_state",
                                                    CollisionAvoidanceState, queue_size=1)
        self._detection_publisher = rospy.Publisher("/robot/limb/left/collision_detection_state",
                                                    CollisionDetectionState, queue_size=1)
        self._clock_publisher = None
        if self._knobs["clock_start_s"] >= 0.0:
            self._clock_publisher = rospy.Publisher("/clock", Clock, queue_size=1)
        self._subscribers = [
            rospy.Subscriber("/robot/limb/%s/joint_command" % side, JointCommand, self._on_command) for side in SIDES]
        # Not read here; without a subscriber, wait_for_subscribers would not wait.
        self._subscribers += [rospy.Subscriber("/robot/limb/%s/%s" % (side, topic), Float64, lambda message: None)
                              for side in SIDES for topic in ("set_speed_ratio", "joint_command_timeout")]
        self._subscribers += [
            rospy.Subscriber("/robot/set_super_enable", Bool, self._on_enable),
            rospy.Subscriber("/robot/set_super_reset", Empty, self._on_reset),
            rospy.Subscriber("/robot/set_super_stop", Empty, self._on_stop),
        ]
        self._service = rospy.Service("~reload", Trigger, self.reload)

    def reload(self, _request):
        with self._lock:
            self._knobs = {name: rospy.get_param("~" + name, default) for name, default in KNOBS.items()}
            if hasattr(self, "_state"):
                self._state = AssemblyState(enabled=self._knobs["enabled"], error=self._knobs["sticky_error"])
                if self._knobs["stop_button"]:
                    self._on_stop(None)
                    self._state.estop_button = AssemblyState.ESTOP_BUTTON_PRESSED
        return TriggerResponse(success=True)

    def run(self):
        begin_s = time.monotonic()
        for _ in beats(RATE_HZ, rospy.is_shutdown):
            with self._lock:
                self._step(1.0 / RATE_HZ)
                self._publish(time.monotonic() - begin_s)

    def _step(self, dt):
        for name, target in self._targets.items():
            moves = self._state.enabled and name not in self._knobs["stuck"]
            self._speeds[name] = (target - self._angles[name]) / max(self._knobs["lag_s"], dt) if moves else 0.0
            self._angles[name] += self._speeds[name] * dt

    def _publish(self, time_s):
        self._state_publisher.publish(self._state)
        names = sorted(self._angles)
        self._joint_publisher.publish(JointState(
            name=names, position=[self._angles[name] for name in names],
            velocity=[self._speeds[name] for name in names], effort=[float(i) for i in range(len(names))]))
        for number, publisher in enumerate(self._endpoint_publishers):
            message = EndpointState()
            message.pose.position.y = 0.5 - number
            message.pose.orientation.w = 1.0
            message.twist.angular.z = 0.25
            message.wrench.force.x = 3.0
            publisher.publish(message)
        self._avoidance_publisher.publish(other_arm=self._knobs["other_arm"], collision_object=self._knobs["near"])
        self._detection_publisher.publish(collision_state=self._knobs["collides"])
        if self._clock_publisher:
            self._clock_publisher.publish(rospy.Time.from_sec(self._knobs["clock_start_s"] + time_s))

    def _on_command(self, message):
        with self._lock:
            if self._state.enabled and message.mode in (JointCommand.POSITION_MODE, JointCommand.RAW_POSITION_MODE):
                self._targets.update(zip(message.names, message.command, strict=True))
            elif self._state.enabled and message.mode == JointCommand.VELOCITY_MODE and not any(message.command):
                # It supports only the velocity zero: stop, and hold.
                self._targets.update((name, self._angles[name]) for name in message.names)

    def _on_enable(self, message):
        with self._lock:
            if not (self._knobs["refuse_enable"] or self._state.stopped):
                self._state.enabled = message.data

    def _on_reset(self, _message):
        with self._lock:
            if not self._knobs["stop_button"]:
                self._state = AssemblyState(error=self._knobs["sticky_error"])

    def _on_stop(self, _message):
        with self._lock:
            self._state = AssemblyState(stopped=True, estop_button=AssemblyState.ESTOP_BUTTON_UNKNOWN,
                                        estop_source=AssemblyState.ESTOP_SOURCE_UNKNOWN)


def main():
    # The fake's own time is wall time; it may be the one that publishes /clock.
    rospy.init_node("fake_robot", disable_rostime=True)
    FakeRobot().run()


if __name__ == "__main__":
    main()
