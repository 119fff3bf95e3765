# SPDX-License-Identifier: BSD-3-Clause
"""A robot on ROS that follows its commands at once, with some of a simulator's services; says what it gets on stdout.

Argument: a folder for the snapshot of a world with a can in it; without, there is none.
"""
import json
import sys
import threading
from pathlib import Path

import numpy as np
import rospy
from baxter_core_msgs.msg import (
    AnalogOutputCommand,
    AssemblyState,
    CollisionAvoidanceState,
    DigitalOutputCommand,
    JointCommand,
)
from bullet_sim_msgs.srv import AdvanceTicks, AdvanceTicksResponse, Press, PressResponse
from fake_move_group import FakeMoveGroup
from gazebo_msgs.msg import ModelState
from gazebo_msgs.srv import (
    DeleteModel,
    DeleteModelResponse,
    GetModelState,
    GetModelStateResponse,
    GetPhysicsProperties,
    GetPhysicsPropertiesResponse,
    SpawnModel,
    SpawnModelResponse,
)
from geometry_msgs.msg import Point, Pose, Quaternion
from lab_arms import JOINTS, URDF, posture
from sensor_msgs.msg import Image, JointState
from std_msgs.msg import Bool, Empty
from std_srvs.srv import Empty as EmptyService
from std_srvs.srv import EmptyResponse

from lab_testing.waiting import beats
from world_picture.snapshot import SnapshotWriter

RATE_HZ = 50.0


class FakeBaxter:
    def __init__(self, positions):
        self._positions = positions
        self._state = AssemblyState(ready=True)
        self._paused = False
        self._lock = threading.Lock()
        self._joints = rospy.Publisher("/robot/joint_states", JointState, queue_size=1)
        self._states = rospy.Publisher("/robot/state", AssemblyState, queue_size=1)
        self._avoidance = rospy.Publisher("/robot/limb/left/collision_avoidance_state", CollisionAvoidanceState,
                                          queue_size=1)
        # What the left arm is too near to; it stands still then.
        self._near = []
        for side in ("left", "right"):
            rospy.Subscriber("/robot/limb/%s/joint_command" % side, JointCommand, self._command, queue_size=1)
        rospy.Subscriber("/robot/set_super_enable", Bool, lambda message: self._switch(message.data, False))
        rospy.Subscriber("/robot/set_super_stop", Empty, lambda _: self._switch(False, True))
        rospy.Subscriber("/robot/set_super_reset", Empty, lambda _: self._switch(False, False))
        rospy.Subscriber("/robot/digital_io/command", DigitalOutputCommand,
                         lambda message: self._say("digital", message.name, message.value))
        rospy.Subscriber("/robot/analog_io/command", AnalogOutputCommand,
                         lambda message: self._say("analog", message.name, message.value))
        rospy.Subscriber("/robot/head/command_head_nod", Bool, lambda message: self._say("nod", message.data))
        rospy.Subscriber("/robot/xdisplay", Image, lambda image: self._say(
            "screen", image.width, image.height, image.encoding, list(image.data[:3])), buff_size=1 << 22)
        rospy.Service("/robot/sim/press", Press, self._press)
        rospy.Service("/gazebo/pause_physics", EmptyService, lambda _: self._pause(True))
        rospy.Service("/gazebo/unpause_physics", EmptyService, lambda _: self._pause(False))
        rospy.Service("/gazebo/get_physics_properties", GetPhysicsProperties,
                      lambda _: GetPhysicsPropertiesResponse(pause=self._paused, success=True))

        rospy.Service("/gazebo/reset_world", EmptyService, lambda _: self._answer(EmptyResponse(), "reset"))
        rospy.Service("/gazebo/advance", AdvanceTicks, lambda request: self._answer(
            AdvanceTicksResponse(success=True), "step", request.ticks))
        rospy.Service("/gazebo/spawn_sdf_model", SpawnModel, lambda request: self._answer(
            SpawnModelResponse(True, ""), "spawn", request.model_name, "<sdf" in request.model_xml,
            request.reference_frame))
        rospy.Service("/gazebo/delete_model", DeleteModel, lambda request: self._answer(
            DeleteModelResponse(False, "it is held"), "delete", request.model_name))
        rospy.Service("/gazebo/get_model_state", GetModelState, lambda request: GetModelStateResponse(
            pose=Pose(Point(1.0, 2.0, 3.0), Quaternion(0.0, 0.0, 0.0, 1.0)), success=True))
        rospy.Subscriber("/gazebo/set_model_state", ModelState, lambda message: self._say(
            "put", message.model_name, message.pose.position.x, message.pose.orientation.w, message.reference_frame))

        FakeMoveGroup(lambda: dict(self._positions), self._say)

    def run(self):
        for number, _ in enumerate(beats(RATE_HZ, rospy.is_shutdown)):
            with self._lock:
                self._near = rospy.get_param_cached("/fake_baxter/near", [])
                joints = JointState(name=list(self._positions), position=list(self._positions.values()))
            joints.header.stamp = rospy.Time.from_sec(1.0 + number / RATE_HZ)
            self._joints.publish(joints)
            self._states.publish(self._state)
            self._avoidance.publish(collision_object=self._near)

    def _command(self, message):
        with self._lock:
            if not (self._near and message.names[0].startswith("left")):
                self._positions.update(zip(message.names, message.command, strict=True))
        self._say("joints", dict(zip(message.names, message.command, strict=True)))

    def _switch(self, enabled, stopped):
        self._state = AssemblyState(ready=True, enabled=enabled, stopped=stopped)
        self._say("state", enabled, stopped)

    def _press(self, request):
        self._say("press", request.action, request.component, request.steps)
        is_known = request.component != "nothing"
        return PressResponse(is_known, "" if is_known else "there is no such button")

    def _pause(self, paused):
        self._paused = paused
        self._say("paused", paused)
        return EmptyResponse()

    def _answer(self, answer, *what):
        self._say(*what)
        return answer

    @staticmethod
    def _say(*what):
        sys.stdout.write(json.dumps(what) + "\n")
        sys.stdout.flush()


CAN = """<robot name="can"><link name="can"><visual><geometry><box size="0.1 0.1 0.1"/></geometry></visual></link>
</robot>"""


def show_world(folder):
    """Write the snapshot of the robot and a can, and tell where."""
    writer = SnapshotWriter(Path(folder))
    writer.write_scene([{"name": "robot", "urdf": URDF, "joints": JOINTS}, {"name": "can", "urdf": CAN, "joints": []}])
    pose = [0.0, 0.0, 0.9, 0.0, 0.0, 0.0, 1.0]
    writer.write(1, 0.0, [np.array([*pose, *posture().values(), *pose])])
    rospy.set_param("/gazebo/snapshot", str(writer.folder))
    return writer


if __name__ == "__main__":
    rospy.init_node("fake_baxter")
    world = show_world(sys.argv[1]) if len(sys.argv) > 1 else None
    rospy.set_param("/robot_description", URDF)
    FakeBaxter(posture()).run()
