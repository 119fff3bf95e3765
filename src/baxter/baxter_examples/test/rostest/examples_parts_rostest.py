#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The examples of head, grippers, lights, channels and screen, each with its effect on the simulated robot."""
import os
import sys
import tempfile
import unittest

import cv2
import numpy as np
import rospy
from baxter_core_msgs.msg import AnalogIOState, DigitalIOState, HeadState, URDFConfiguration
from bullet_sim_msgs.srv import Press, PressRequest
from sensor_msgs.msg import Image

from baxter_interface import Gripper, RobotEnable
from baxter_model import SIDES
from lab_testing.fake_joystick import FakeJoystick

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from example_program import Program, wait_until  # noqa: E402

FAN, LIGHT = "torso_fan", "torso_left_outer_light"


class Seen:
    """The values of a topic, each when it changed."""

    def __init__(self, topic, kind, value):
        self.values = []
        self._value = value
        self._subscriber = rospy.Subscriber(topic, kind, self._on_message, queue_size=100)
        wait_until(self._subscriber.get_num_connections, "a connection to " + topic)

    def _on_message(self, message):
        value = self._value(message)
        if self.values[-1:] != [value]:
            self.values.append(value)


class ExamplesTest(unittest.TestCase):
    def start(self, name, *options, **package):
        program = Program(name, *options, **package)
        self.addCleanup(program.end)
        return program

    def assert_good(self, program):
        self.assertEqual(program.wait(), 0, program.output)


class ChannelsTest(ExamplesTest):
    """Run in parallel, since they do not interfere."""

    def test_channels_navigator_screen_head_and_ik(self):
        fan = Seen("/robot/analog_io/%s/state" % FAN, AnalogIOState, lambda message: message.value)
        light = Seen("/robot/digital_io/%s/state" % LIGHT, DigitalIOState, lambda message: message.state)
        inner = Seen("/robot/digital_io/left_inner_light/state", DigitalIOState, lambda message: message.state)
        pans = Seen("/robot/head/head_state", HeadState, lambda message: round(message.pan, 1))
        screen, urdf = [], []
        keep = [rospy.Subscriber("/robot/xdisplay", Image, screen.append),
                rospy.Subscriber("/robot/urdf", URDFConfiguration, urdf.append)]
        folder = self.enterContext(tempfile.TemporaryDirectory())
        picture, fragment = folder + "/picture.png", folder + "/tool.urdf"
        cv2.imwrite(picture, np.full((60, 80, 3), (10, 20, 30), np.uint8))
        with open(fragment, "w") as stream:
            stream.write("<robot name='tool'/>")

        programs = {name: self.start(name, *options) for name, *options in (
            ("analog_io_rampup.py",), ("digital_io_blink.py", "_component_id:=" + LIGHT), ("navigator_io.py", "-b"),
            ("xdisplay_image.py", "-f", picture), ("ik_service_client.py", "-l", "left"))}
        missing = [(self.start(name, *options), text) for name, options, text in (
            ("xdisplay_image.py", ("-f", "/none.png"), "No such file"),
            ("joint_position_file_playback.py", ("-f", "/none.csv"), "No such file"),
            ("digital_io_blink.py", ("-c", "no_light"), "/robot/digital_io/no_light/state"),
            ("gripper_action_client.py", ("-g", "right"), "rosrun baxter_interface gripper_action_server.py"))]
        server = self.start("head_action_server.py", package="baxter_interface")
        head = self.start("head_action_client.py")
        sender = self.start("send_urdf_fragment.py", "-f", fragment)
        for program in programs.values():
            self.assert_good(program)
        self.assertIn(100.0, fan.values)
        self.assertEqual(fan.values[-1], 0.0)
        self.assertEqual(light.values[-3:], [0, 1, 0])
        self.assertGreater(len(inner.values), 50)
        wait_until(lambda: screen and urdf, "a picture and a fragment; %d, %d came" % (len(screen), len(urdf)))
        self.assertEqual((screen[-1].width, screen[-1].height, screen[-1].encoding, screen[-1].data[:3]),
                         (80, 60, "bgr8", bytes((10, 20, 30))))
        self.assertEqual((urdf[-1].link, urdf[-1].joint), ("left_hand", "left_gripper_base"))
        self.assertEqual(programs["ik_service_client.py"].output.count("left_"), 7)
        self.assertEqual(sender.interrupt(), 130)
        del keep

        self.assert_good(head)
        self.assertEqual(head.output.count("the head is at"), 5)
        self.assertGreater(max(pans.values), 1.4)
        self.assertLess(min(pans.values), -0.8)
        server.interrupt()
        for program, text in missing:
            self.assertEqual(program.wait(), 1, program.output)
            self.assertIn(text, program.output)

    def test_navigator_input_is_printed(self):
        program = self.start("navigator_io.py", "-i")
        program.wait_for("buttons up up up")
        press("left_button_ok", PressRequest.PRESS)
        program.wait_for("buttons down up up")
        press("left_button_ok", PressRequest.RELEASE)
        self.assertEqual(program.interrupt(), 130)


def press(component, action, steps=0):
    rospy.wait_for_service("/robot/sim/press", 30.0)
    answer = rospy.ServiceProxy("/robot/sim/press", Press)(component=component, action=action, steps=steps)
    assert answer.success, answer.status_message


class HeadTest(ExamplesTest):
    def test_wobbler_leaves_the_robot_as_it_was(self):
        robot = RobotEnable()
        robot.disable()
        self.addCleanup(robot.enable)
        nods = Seen("/robot/head/head_state", HeadState, lambda message: message.isNodding)
        wobbler = self.start("head_wobbler.py")
        self.assert_good(wobbler)
        self.assertEqual(nods.values, [False, True, False])
        self.assertGreaterEqual(wobbler.output.count("looking at"), 1)
        wait_until(lambda: not robot.state().enabled, "the robot to be disabled again, as it was")


class GripperTest(ExamplesTest):
    @classmethod
    def setUpClass(cls):
        cls.grippers = {side: Gripper(side) for side in SIDES}
        for gripper in cls.grippers.values():
            gripper.calibrate()

    def wait_for_position(self, side, test, what):
        wait_until(lambda: test(self.grippers[side].position()),
                   "the %s gripper %s; it is at %.1f" % (side, what, self.grippers[side].position()))

    def test_keyboard(self):
        program = self.start("gripper_keyboard.py")
        program.wait_for("Esc or Ctrl-C: quit")
        for key, side, test, what in (("q", "left", lambda p: p < 5.0, "to close"),
                                      ("Q", "right", lambda p: p < 5.0, "to close"),
                                      ("w", "left", lambda p: p > 95.0, "to open"),
                                      ("u", "left", lambda p: p < 90.0, "to close a little")):
            program.type(key)
            self.wait_for_position(side, test, what)
        program.type("W?")
        program.wait_for("right gripper: open")
        program.type("\x1b")
        self.assertEqual(program.wait(), 0)

    def test_joystick(self):
        joystick = FakeJoystick(sticks=[0] * 6, buttons=[0] * 12)
        self.addCleanup(joystick.close)
        program = self.start("gripper_joystick.launch", "joystick:=logitech", "dev:=" + joystick.path)
        joystick.plug_in()
        program.wait_for("Ctrl-C: quit")
        for button, side, test, what in ((6, "left", lambda p: p < 5.0, "to close"),
                                         (7, "right", lambda p: p < 5.0, "to close"),
                                         (5, "right", lambda p: p > 95.0, "to open")):
            joystick.press(button)
            self.wait_for_position(side, test, what)
            joystick.release()
        joystick.push(stick=1, value=1.0)
        self.wait_for_position("left", lambda p: p > 30.0, "to open by the stick")
        joystick.release()
        program.interrupt()

    def test_cuff_control(self):
        light = Seen("/robot/digital_io/left_inner_light/state", DigitalIOState, lambda message: message.state)
        program = self.start("gripper_cuff_control.py", "-v")
        program.wait_for("Ctrl-C: quit")
        for side in SIDES:
            for button, action, test in (("upper", "close", lambda p: p < 5.0), ("lower", "open", lambda p: p > 95.0)):
                press("%s_%s_button" % (side, button), PressRequest.PRESS)
                program.wait_for("%s gripper: %s" % (side, action))
                self.wait_for_position(side, test, "to " + action)
                press("%s_%s_button" % (side, button), PressRequest.RELEASE)
        press("left_lower_cuff", PressRequest.PRESS)
        wait_until(lambda: light.values[-1:] == [1], "the light of the squeezed cuff")
        press("left_lower_cuff", PressRequest.RELEASE)
        wait_until(lambda: light.values[-1:] == [0], "the light to go out")
        self.assertEqual(program.interrupt(), 130)

    def test_action_client_by_its_launch_file(self):
        program = self.start("gripper_action_client.launch", "gripper:=left")
        self.assert_good(program)
        self.assertEqual(program.output.count("the left gripper is at"), 6, program.output)
        self.wait_for_position("left", lambda p: p > 90.0, "to be open at the end")


if __name__ == "__main__":
    import rostest
    rospy.init_node("examples_parts_rostest")
    rostest.rosrun("baxter_examples", "examples_parts", "__main__")
