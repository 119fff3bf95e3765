#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Sends the same requests to the simulated robot and to the fakes of the SDK's tests, and compares the results.

A request is a function of a name prefix, "" for the robot and "/fake" for the fake.
"""
import sys
import unittest

import rospy
import rostest
from baxter_core_msgs.msg import (
    AnalogIOState,
    AnalogOutputCommand,
    AssemblyState,
    CameraControl,
    CameraSettings,
    DigitalIOState,
    DigitalOutputCommand,
    EndEffectorCommand,
    EndEffectorProperties,
    EndEffectorState,
    HeadPanCommand,
    HeadState,
    JointCommand,
    NavigatorState,
    RobustControllerStatus,
)
from baxter_core_msgs.srv import CloseCamera, ListCameras, OpenCamera, SolvePositionIK
from baxter_maintenance_msgs.msg import TareEnable, UpdateStatus
from bullet_sim_msgs.srv import Press
from geometry_msgs.msg import PoseStamped
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Empty, String

from baxter_model import JOINTS, joint_names
from lab_testing.waiting import wait_for_message, wait_until

ROBOT, FAKE = "", "/fake"
DEADLINE_S = 60.0


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
    """Shape of the responses to a pose within reach, one beyond it, and one in an unknown frame."""
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
            # That a request changes nothing can only be seen after some time: 0.5 s of the robot's time.
            wait_until(lambda heard=heard: len(heard) > 50, "states of %s" % (prefix or "the robot"), DEADLINE_S)
        finally:
            subscriber.unregister()
        seen.append({field: getattr(heard[-1], field) for field in fields})
    return seen


def arms(prefix):
    """Names and order of the arms' joints, and which commands move them: enabled, disabled, halted."""
    enable = publisher(prefix, "/robot/set_super_enable", Bool)
    command = publisher(prefix, "/robot/limb/left/joint_command", JointCommand)
    names = list(joint_names("left"))

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

    listed = [name for name in angles() if name[-2:] in JOINTS]
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
    """The status of a procedure before it is requested, and after."""
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
    """The response to an unknown update."""
    publisher(prefix, "/updater/start", String).publish("no such update")
    return wait_for_message(prefix + "/updater/status", UpdateStatus,
                            lambda message: message.status == UpdateStatus.STS_INVALID).status


def enabled(prefix):
    """Enable the robot, for requests that need power."""
    enable = publisher(prefix, "/robot/set_super_enable", Bool)
    wait_until(lambda: enable.publish(True) or wait_for_message(prefix + "/robot/state", AssemblyState).enabled,
               "the robot is enabled", DEADLINE_S)


class Newest:
    """The newest message on a topic, and their count."""

    def __init__(self, topic, kind):
        self.message, self.count = None, 0
        self._subscriber = rospy.Subscriber(topic, kind, self._take)
        wait_until(lambda: self.count, topic, DEADLINE_S)

    def _take(self, message):
        self.message, self.count = message, self.count + 1

    def wait_for(self, messages):
        """Wait for this many further messages: the only way to see that a request changes nothing."""
        until = self.count + messages
        wait_until(lambda: self.count >= until, "%d more messages" % messages, DEADLINE_S)

    def close(self):
        self._subscriber.unregister()


def gripper(prefix):
    """The electric gripper: its properties, and its state after each command, valid and invalid."""
    enabled(prefix)
    name = prefix + "/robot/end_effector/left_gripper/"
    properties = wait_for_message(name + "properties", EndEffectorProperties)
    found = [{field: getattr(properties, field) for field in properties.__slots__}]
    command = publisher(prefix, "/robot/end_effector/left_gripper/command", EndEffectorCommand)
    state = Newest(name + "state", EndEffectorState)
    flags = ("enabled", "calibrated", "ready", "moving", "gripping", "missed", "error", "reverse")
    for number, (what, args) in enumerate((
            ("configure", '{"velocity": 100}'), ("go", '{"position": 40}'), ("go", '{"position": 150}'), ("go", "{}"),
            ("go", "nonsense"), ("go", "[" * 50), ("fly", ""), ("configure", '{"colour": 1}'), ("grip", ""),
            ("prepare_to_grip", ""), ("clear_calibration", ""), ("go", '{"position": 20}'), ("calibrate", ""),
            ("go", '{"position": 20}'), ("release", ""), ("stop", ""), ("reset", ""), ("no_op", ""), ("reboot", ""),
            ("calibrate", "")), 1):
        command.publish(id=properties.id, command=what, args=args, sender="/fakes", sequence=number)
        state.wait_for(30)
        wait_until(lambda: state.message.ready == 1 and state.message.moving == 0, "the fingers rest", DEADLINE_S)
        state.wait_for(5)
        now = state.message
        found.append((what, args, now.command, now.command_sender, now.command_sequence, round(now.position, -1),
                      {flag: getattr(now, flag) for flag in flags}))
    state.close()
    return found


def channels(prefix):
    """A light, a cuff, the fan and a navigator after commands and presses, valid and invalid."""
    digital = publisher(prefix, "/robot/digital_io/command", DigitalOutputCommand)
    analog = publisher(prefix, "/robot/analog_io/command", AnalogOutputCommand)
    press = service(prefix, "/robot/sim/press", Press)
    heard = {name: Newest(prefix + "/robot/%s/state" % name, kind) for name, kind in (
        ("digital_io/torso_left_inner_light", DigitalIOState), ("digital_io/left_lower_cuff", DigitalIOState),
        ("digital_io/torso_left_button_ok", DigitalIOState), ("analog_io/torso_fan", AnalogIOState),
        ("navigators/torso_left_navigator", NavigatorState))}
    found = []

    def note(what):
        for newest in heard.values():
            newest.wait_for(5)
        found.append((what, [{field: getattr(newest.message, field) for field in newest.message.__slots__
                              if field != "timestamp"} for newest in heard.values()]))

    for topic, name, value in (
            (digital, "torso_left_inner_light", True), (digital, "left_lower_cuff", True), (digital, "nose", True),
            (digital, "torso_left_inner_light", False), (analog, "torso_fan", 70), (analog, "left_hand_range", 5),
            (analog, "nose", 1), (analog, "torso_fan", 0)):
        topic.publish(name, value)
        note((name, value))
    for component, action, steps in (
            ("left_lower_cuff", "press", 0), ("torso_left_button_ok", "press", 0), ("torso_left_wheel", "turn", 300),
            ("torso_left_wheel", "turn", -300), ("torso_left_inner_light", "press", 0), ("nose", "press", 0),
            ("torso_left_wheel", "press", 0), ("left_lower_cuff", "pinch", 0), ("left_lower_cuff", "release", 0),
            ("torso_left_button_ok", "release", 0)):
        answer = press(component=component, action=action, steps=steps)
        note((component, action, steps, answer.success, answer.status_message))
    for newest in heard.values():
        newest.close()
    return found


def head(prefix):
    """The head's pan and nod."""
    enabled(prefix)
    pan = publisher(prefix, "/robot/head/command_head_pan", HeadPanCommand)
    nod = publisher(prefix, "/robot/head/command_head_nod", Bool)
    state = Newest(prefix + "/robot/head/head_state", HeadState)
    found = []
    void, off, on = (HeadPanCommand.REQUEST_PAN_VOID, HeadPanCommand.REQUEST_PAN_DISABLE,
                     HeadPanCommand.REQUEST_PAN_ENABLE)
    for target, ratio, request in ((0.5, 1.0, void), (9.0, 1.0, void), (float("nan"), 1.0, void), (0.2, -1.0, void),
                                   (-0.3, 0.0, 0), (0.4, 1.0, off), (0.1, 0.5, on), (0.0, 1.0, void)):
        pan.publish(target, ratio, request)
        state.wait_for(20)
        wait_until(lambda: not state.message.isTurning, "the head stands", DEADLINE_S)
        state.wait_for(5)
        found.append((repr(target), ratio, request, round(state.message.pan, 2), state.message.isPanEnabled))
    nod.publish(False)
    state.wait_for(20)
    found.append(("no nod", state.message.isNodding))
    nod.publish(True)
    wait_until(lambda: state.message.isNodding, "the head nods", DEADLINE_S)
    wait_until(lambda: not state.message.isNodding, "the nod ends", DEADLINE_S)
    state.close()
    return found


class FakesTest(unittest.TestCase):
    maxDiff = None

    def same(self, question):
        self.assertEqual(question(FAKE), question(ROBOT))

    def test_cameras(self):
        self.same(cameras)

    def test_inverse_kinematics(self):
        self.same(inverse_kinematics)

    def test_switch(self):
        self.same(switch)

    def test_arms(self):
        self.same(arms)

    def test_procedures(self):
        self.same(procedures)

    def test_updater(self):
        self.same(updater)

    def test_gripper(self):
        self.same(gripper)

    def test_channels(self):
        self.same(channels)

    def test_head(self):
        self.same(head)


if __name__ == "__main__":
    rospy.init_node("fakes")
    rostest.rosrun("workspace_tests", "fakes", FakesTest, sys.argv)
