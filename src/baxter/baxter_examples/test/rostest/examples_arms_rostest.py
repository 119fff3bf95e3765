#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The examples of the arms, each with its effect on the simulated robot."""
import os
import sys
import tempfile
import unittest

import rospy
from baxter_core_msgs.msg import DigitalIOState, JointCommand
from bullet_sim_msgs.srv import Press, PressRequest

from baxter_examples import recording
from baxter_interface import Limb, RobotEnable
from baxter_model import SIDES
from lab_testing.fake_joystick import FakeJoystick
from lab_testing.waiting import wait_for_message

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from example_program import Program, wait_until  # noqa: E402

STEP_RAD = 0.1
NEAR_RAD = 0.02


class ArmsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        RobotEnable().enable()
        cls.limbs = {side: Limb(side) for side in SIDES}

    def start(self, name, *options, **package):
        program = Program(name, *options, **package)
        self.addCleanup(program.end)
        return program

    def angle(self, name):
        return self.limbs[name.split("_")[0]].joint_angle(name)

    def wait_for_angle(self, name, angle):
        wait_until(lambda: abs(self.angle(name) - angle) < NEAR_RAD,
                   "%s to be at %.3f rad; it is at %.3f" % (name, angle, self.angle(name)))

    def go_neutral(self):
        for limb in self.limbs.values():
            self.assertTrue(limb.move_to_neutral())


class JoggingTest(ArmsTest):
    def test_keyboard(self):
        self.go_neutral()
        program = self.start("joint_position_keyboard.py")
        program.wait_for("Esc or Ctrl-C: quit")
        before = {name: self.angle(name) for name in ("left_w2", "right_s0", "left_e1")}
        program.type(".")
        self.wait_for_angle("left_w2", before["left_w2"] + STEP_RAD)
        program.type("111")
        self.wait_for_angle("right_s0", before["right_s0"] - 3 * STEP_RAD)
        program.type("iu")
        program.wait_for("left_e1 - 0.1 rad")
        self.wait_for_angle("left_e1", before["left_e1"])
        program.type("\x03")
        self.assertEqual(program.wait(), 0)

    def test_joystick(self):
        self.go_neutral()
        joystick = FakeJoystick(sticks=[0, 0, 1, 0, 0, 1, 0, 0], buttons=[0] * 11)
        self.addCleanup(joystick.close)
        program = self.start("joint_position_joystick.launch", "joystick:=xbox", "dev:=" + joystick.path)
        joystick.plug_in()
        program.wait_for("Ctrl-C: quit")
        before = self.angle("right_s0")
        joystick.push(stick=3, value=1.0)
        wait_until(lambda: self.angle("right_s0") > before + 2 * STEP_RAD, "the right stick to move right_s0")
        joystick.release()
        joystick.press(button=4)
        program.wait_for("left stick: s1 and e0")
        before = self.angle("left_e0")
        joystick.push(stick=1, value=-1.0)
        wait_until(lambda: self.angle("left_e0") < before - STEP_RAD, "the left stick to move left_e0")
        joystick.release()
        program.interrupt()


class RecordingTest(ArmsTest):
    def test_recorded_motion_is_played_back_in_both_ways(self):
        self.go_neutral()
        path = self.enterContext(tempfile.TemporaryDirectory()) + "/motion.csv"
        recorder = self.start("joint_recorder.py", "-f", path, "-r", "50")
        recorder.wait_for("until Ctrl-C")
        self.assertTrue(self.limbs["left"].move_to_joint_positions({"left_w1": 0.6, "left_s0": -0.3}))
        self.assertEqual(recorder.interrupt(), 130)
        record = recording.read(path)
        self.assertEqual(["time", *record.names], recording.COLUMNS)
        self.assertAlmostEqual(record.rows[-1]["left_w1"], 0.6, delta=NEAR_RAD)
        self.assertAlmostEqual(record.rows[0]["left_w1"], 1.26, delta=0.1)

        self.go_neutral()
        for command in (("joint_position_file_playback.py", "-f", path),
                        ("joint_trajectory_file_playback.launch", "file_path:=" + path)):
            program = self.start(*command)
            self.assertEqual(program.wait(), 0, program.output)
            self.wait_for_angle("left_w1", record.rows[-1]["left_w1"])
            self.wait_for_angle("left_s0", record.rows[-1]["left_s0"])


class SideBySideTest(ArmsTest):
    def press(self, button):
        press = rospy.ServiceProxy("/robot/sim/press", Press)
        component = "left_button_" + button
        for action, state in ((PressRequest.PRESS, DigitalIOState.PRESSED),
                              (PressRequest.RELEASE, DigitalIOState.UNPRESSED)):
            self.assertTrue(press(component=component, action=action).success)
            # A press that is shorter than the message period would be missed.
            wait_for_message("/robot/digital_io/%s/state" % component, DigitalIOState,
                             lambda message, state=state: message.state == state)

    def test_waypoints_of_one_arm_while_the_other_follows_a_trajectory(self):
        client = self.start("joint_trajectory_client.launch", "limb:=right")
        program = self.start("joint_position_waypoints.py", "-l", "left", "-s", "1.0", "-a", "0.05")
        program.wait_for("(0 so far)")
        limb = self.limbs["left"]
        for count, angle in enumerate((0.8, 1.1), 1):
            self.assertTrue(limb.move_to_joint_positions({"left_w1": angle}))
            self.press("ok")
            program.wait_for("(%d so far)" % count)
        self.press("show")
        program.wait_for("playing 2 waypoints")
        for angle in (0.8, 1.1, 0.8):
            wait_until(lambda angle=angle: abs(self.angle("left_w1") - angle) < 0.06, "waypoint %.1f" % angle)
        self.assertEqual(program.interrupt(), 130)
        self.assertEqual(client.wait(), 0, client.output)
        self.assertIn("the right arm has followed its trajectory", client.output)
        self.wait_for_angle("right_w2", -2.39 * 1.25)


class ModesTest(ArmsTest):
    def test_springs_bring_the_arm_back_and_follow_their_parameters(self):
        modes = set()
        keep = rospy.Subscriber("/robot/limb/left/joint_command", JointCommand, lambda message: modes.add(message.mode))
        program = self.start("joint_torque_springs.py", "-l", "left")
        program.wait_for("is on springs")
        wait_until(lambda: JointCommand.TORQUE_MODE in modes, "torques")
        self.wait_for_angle("left_w1", 1.26)
        import dynamic_reconfigure.client
        springs = dynamic_reconfigure.client.Client("rsdk_joint_torque_springs_left", timeout=30)
        self.assertEqual(springs.update_configuration({"w1_spring_stiffness": 3.5})["w1_spring_stiffness"], 3.5)
        self.assertEqual(program.interrupt(), 130)
        self.wait_for_angle("left_w1", 1.26)
        del keep

    def test_wobbler_moves_every_joint_and_rests_at_the_end(self):
        program = self.start("joint_velocity_wobbler.py")
        program.wait_for("wobbling")
        moved = set()

        def all_moved():
            moved.update(name for limb in self.limbs.values() for name, speed in limb.joint_velocities().items()
                         if abs(speed) > 0.05)
            return len(moved) == 14

        wait_until(all_moved, "all joints to move")
        self.assertEqual(program.interrupt(), 130)
        wait_until(lambda: all(abs(speed) < 0.01 for limb in self.limbs.values()
                               for speed in limb.joint_velocities().values()), "rest")

    def test_puppet_mirrors_the_other_arm(self):
        program = self.start("joint_velocity_puppet.py", "-l", "left")
        program.wait_for("move that arm")
        before = {name: self.angle(name) for name in ("right_s0", "right_w1")}
        self.assertTrue(self.limbs["left"].move_to_joint_positions({"left_s0": -0.4, "left_w1": 0.9}))
        # The simulated arms' speeds are measured, so their integral is close to the distance, not equal.
        wait_until(lambda: self.angle("right_s0") > before["right_s0"] + 0.25, "right_s0 to mirror left_s0")
        self.assertLess(self.angle("right_w1"), before["right_w1"] - 0.2)
        self.assertEqual(program.interrupt(), 130)


class LostRobotTest(ArmsTest):
    def test_disabled_robot_ends_a_loop_with_one_line(self):
        program = self.start("joint_velocity_wobbler.py")
        program.wait_for("wobbling")
        robot = RobotEnable()
        robot.disable()
        self.addCleanup(robot.enable)
        self.assertEqual(program.wait(), 1, program.output)
        self.assertEqual(program.output.count("lost the robot"), 1)


if __name__ == "__main__":
    import rostest
    rospy.init_node("examples_arms_rostest")
    rostest.rosrun("baxter_examples", "examples_arms", "__main__")
