#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The same questions to the simulated robot and to the fakes of the SDK's tests: the answers are the same.

A question is a function of a prefix of names, "" for the robot and "/fake" for the fake; what it returns is compared.
"""
import sys
import unittest

import rospy
import rostest
from baxter_core_msgs.msg import AssemblyState, CameraControl, CameraSettings, JointCommand, RobustControllerStatus
from baxter_core_msgs.srv import CloseCamera, ListCameras, OpenCamera, SolvePositionIK
from baxter_maintenance_msgs.msg import TareEnable, UpdateStatus
from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Empty, String

from lab_testing.waiting import wait_for_message, wait_until

ROBOT, FAKE = "", "/fake"
DEADLINE_S = 60.0
SUFFIXES = ("s0", "s1", "e0", "e1", "w0", "w1", "w2")


def service(prefix, name, kind):
    rospy.wait_for_service(prefix + name, DEADLINE_S)
    return rospy.ServiceProxy(prefix + name, kind)


def publisher(prefix, name, kind):
    made = rospy.Publisher(prefix + name, kind, queue_size=10)
    wait_until(made.get_num_connections, "%s%s is heard" % (prefix, name), DEADLINE_S)
    return made


def cameras(prefix):
    """Error codes of requests, right and wrong."""
    name = "left_hand_camera"
    opens, closes = service(prefix, "/cameras/open", OpenCamera), service(prefix, "/cameras/close", CloseCamera)

    def settings(width=640, height=400, fps=25.0, controls=()):
        return CameraSettings(width, height, fps, [CameraControl(*control) for control in controls])

    return {
        "open": opens(name, settings()).err, "open again": opens(name, settings(320, 200)).err,
        "close": closes(name).err, "close again": closes(name).err, "close an unknown one": closes("nose").err,
        "open an unknown one": opens("nose", settings()).err, "no resolution": opens(name, settings(1, 1)).err,
        "no rate": opens(name, settings(fps=-1.0)).err, "no control": opens(name, settings(controls=[(42, 1)])).err,
        "no gain": opens(name, settings(controls=[(101, 1000)])).err,
        "listed": name in service(prefix, "/cameras/list", ListCameras)().cameras}


def inverse_kinematics(prefix):
    """Shape of the answers to a pose within reach, one beyond it, and one in an unknown frame."""
    def pose(x, frame="base"):
        stamped = PoseStamped()
        stamped.header.frame_id = frame
        stamped.pose.position.x, stamped.pose.position.y, stamped.pose.position.z = x, 0.85, 0.04
        orientation = stamped.pose.orientation
        orientation.x, orientation.y, orientation.z, orientation.w = -0.366895, 0.885980, 0.108156, 0.262162
        return stamped

    ask = service(prefix, "/ExternalTools/left/PositionKinematicsNode/IKService", SolvePositionIK)
    answer = ask([pose(0.66), pose(3.0), pose(0.66, "nowhere")], [], 0)
    return [(valid, kind != 0, list(joints.name), len(joints.position))
            for valid, kind, joints in zip(answer.isValid, answer.result_type, answer.joints, strict=True)]


def switch(prefix):
    """The robot's state after each request, in an order that passes all of its states."""
    enable = publisher(prefix, "/robot/set_super_enable", Bool)
    stop, reset = (publisher(prefix, "/robot/set_super_%s" % name, Empty) for name in ("stop", "reset"))
    fields = ("enabled", "stopped", "error", "estop_button", "estop_source")
    seen = []
    for topic, message in ((reset, ()), (enable, (True,)), (enable, (True,)), (enable, (False,)), (enable, (True,)),
                           (stop, ()), (enable, (True,)), (reset, ()), (enable, (True,)), (reset, ())):
        topic.publish(*message)
        heard = []
        subscriber = rospy.Subscriber(prefix + "/robot/state", AssemblyState, heard.append)
        try:
            # A request that changes nothing can only be told by time: of the robot's, 0.5 s.
            wait_until(lambda heard=heard: len(heard) > 50, "states of %s" % (prefix or "the robot"), DEADLINE_S)
        finally:
            subscriber.unregister()
        seen.append({field: getattr(heard[-1], field) for field in fields})
    return seen


def arms(prefix):
    """Names and order of the arms' joints, and which commands move them: enabled, disabled, halted."""
    enable = publisher(prefix, "/robot/set_super_enable", Bool)
    command = publisher(prefix, "/robot/limb/left/joint_command", JointCommand)
    names = ["left_" + suffix for suffix in SUFFIXES]

    def angles():
        message = wait_for_message(prefix + "/robot/joint_states", JointState)
        return dict(zip(message.name, message.position, strict=True))

    def state(on):
        def is_so():
            enable.publish(on)
            return wait_for_message(prefix + "/robot/state", AssemblyState).enabled == on
        wait_until(is_so, "enabled is %s" % on, DEADLINE_S)

    def arrives(mode, goal, most_s):
        def is_there():
            command.publish(JointCommand(mode, goal, names))
            now = angles()
            return all(abs(now[name] - angle) < 0.01 for name, angle in zip(names, goal, strict=True))
        try:
            return bool(wait_until(is_there, timeout_s=most_s))
        except AssertionError:
            return False

    listed = [name for name in angles() if name[-2:] in SUFFIXES]
    state(False)
    start = [angles()[name] for name in names]
    goal = [angle - 0.2 for angle in start]
    found = {"names": listed, "disabled": arrives(JointCommand.POSITION_MODE, goal, 1.0)}
    state(True)
    found["position"] = arrives(JointCommand.POSITION_MODE, goal, DEADLINE_S)
    found["raw"] = arrives(JointCommand.RAW_POSITION_MODE, start, DEADLINE_S)
    command.publish(JointCommand(JointCommand.VELOCITY_MODE, [0.0] * len(names), names))
    found["halted is where it was"] = all(
        abs(angles()[name] - angle) < 0.02 for name, angle in zip(names, start, strict=True))
    state(False)
    return found


def procedures(prefix):
    """The status of a procedure before it is asked for, and once it is."""
    enable = publisher(prefix, "/robustcontroller/left/Tare/enable", TareEnable)
    topic = prefix + "/robustcontroller/left/Tare/status"

    def status(wanted=lambda message: True):
        message = wait_for_message(topic, RobustControllerStatus, wanted)
        return message.isEnabled, message.controlUid, message.complete, message.timedOut, list(message.errorCodes)

    enable.publish(TareEnable(isEnabled=False, uid="sdk"))
    idle = status(lambda message: not message.isEnabled)
    enable.publish(TareEnable(isEnabled=True, uid="sdk"))
    begun = status(lambda message: message.isEnabled)
    enable.publish(TareEnable(isEnabled=False, uid="sdk"))
    return {"idle": idle[0], "begun": begun[:2], "begun, timed out": begun[3], "ended": status(
        lambda message: not message.isEnabled)[0]}


def updater(prefix):
    """What an update that nobody knows is answered."""
    publisher(prefix, "/updater/start", String).publish("no such update")
    return wait_for_message(prefix + "/updater/status", UpdateStatus,
                            lambda message: message.status == UpdateStatus.STS_INVALID).status


QUESTIONS = (cameras, inverse_kinematics, switch, arms, procedures, updater)


class FakesTest(unittest.TestCase):
    maxDiff = None


def add_tests():
    for question in QUESTIONS:
        def test(self, question=question):
            self.assertEqual(question(FAKE), question(ROBOT))

        setattr(FakesTest, "test_" + question.__name__, test)


if __name__ == "__main__":
    rospy.init_node("fakes")
    add_tests()
    rostest.rosrun("workspace_tests", "fakes", FakesTest, sys.argv)
