#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The SDK's Gripper, and a client that knows only the messages, against the simulated electric and suction grippers."""

import unittest

import rospy
import rostest
from baxter_core_msgs.msg import EndEffectorCommand, EndEffectorState, EndpointState
from gazebo_msgs.srv import DeleteModel, SpawnModel
from geometry_msgs.msg import Pose
from sensor_msgs.msg import JointState

from baxter_dataflow import wait_for
from baxter_interface import CHECK_VERSION, Gripper
from baxter_interface.startup import init_node
from urdf_model.transforms import matrix_from_quaternion

DEADLINE_S = 20.0  # [simulated s]
BASE_HEIGHT_M = 0.93
# Without gravity, so that it stays in place.
BOX = """<robot name="box"><link name="box">
  <inertial><mass value="0.1"/><inertia ixx="1e-4" iyy="1e-4" izz="1e-4" ixy="0" ixz="0" iyz="0"/></inertial>
  <collision><geometry><box size="0.04 0.04 0.04"/></geometry></collision></link>
  <gazebo reference="box"><turnGravityOff>true</turnGravityOff></gazebo></robot>"""


class Box:
    """A box in the world, its centre at this distance in front of an arm's tip, inside a `with`."""

    def __init__(self, side, ahead_m):
        self._side, self._ahead_m = side, ahead_m

    def __enter__(self):
        tip = rospy.wait_for_message(f"/robot/limb/{self._side}/endpoint_state", EndpointState, 90.0).pose
        turn = [getattr(tip.orientation, axis) for axis in "xyzw"]
        ahead = matrix_from_quaternion(turn)[:3, 2] * self._ahead_m
        pose = Pose(tip.position, tip.orientation)
        pose.position.x += ahead[0]
        pose.position.y += ahead[1]
        pose.position.z += ahead[2] + BASE_HEIGHT_M
        answer = rospy.ServiceProxy("/gazebo/spawn_urdf_model", SpawnModel)("box", BOX, "/", pose, "world")
        assert answer.success, answer.status_message
        return self

    def __exit__(self, *_):
        rospy.ServiceProxy("/gazebo/delete_model", DeleteModel)("box")


class ElectricTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.gripper = Gripper("right", CHECK_VERSION)

    def setUp(self):
        self.gripper.set_parameters(defaults=True)
        self.assertTrue(self.gripper.open(block=True, timeout=DEADLINE_S))
        wait_for(lambda: not self.gripper.moving(), DEADLINE_S)

    def test_identity(self):
        gripper = self.gripper
        self.assertEqual((gripper.type(), gripper.hardware_id(), gripper.hardware_name()),
                         ("electric", 65538, "SDK End Effector"))
        self.assertEqual((gripper.firmware_version(), gripper.firmware_build_date()),
                         ("3.0.0 5.5", "2014/7/24 18:30:00"))
        self.assertTrue(gripper.has_force() and gripper.has_position() and gripper.version_check())

    def test_positions(self):
        for percent in (60.0, 25.0, 100.0):
            self.assertTrue(self.gripper.command_position(percent, block=True, timeout=DEADLINE_S))
            wait_for(lambda: not self.gripper.moving(), DEADLINE_S)
            self.assertAlmostEqual(self.gripper.position(), percent, delta=5.0)
        fingers = rospy.wait_for_message("/robot/joint_states", JointState, 90.0)
        for finger, opening in (("l", 0.020833), ("r", -0.020833)):
            index = fingers.name.index(f"r_gripper_{finger}_finger_joint")
            self.assertAlmostEqual(fingers.position[index], opening, delta=0.001)

    def test_closing_on_nothing_and_on_something(self):
        gripper = self.gripper
        self.assertTrue(gripper.close(block=True, timeout=DEADLINE_S))
        wait_for(gripper.missed, DEADLINE_S, timeout_msg="it did not notice that it missed")
        self.assertTrue(gripper.open(block=True, timeout=DEADLINE_S))
        with Box("right", 0.0):
            self.assertTrue(gripper.close(block=True, timeout=DEADLINE_S))
            wait_for(gripper.gripping, DEADLINE_S, timeout_msg="it did not notice what it holds")
            wait_for(lambda: abs(gripper.force() - gripper.parameters()["holding_force"]) < 3.0, DEADLINE_S,
                     timeout_msg="the force on the box is not the holding force")
            self.assertGreater(gripper.position(), 10.0)
            self.assertFalse(gripper.missed() or gripper.moving())
        wait_for(gripper.missed, DEADLINE_S, timeout_msg="it did not notice that the box was removed")

    def test_calibration_reboot_reset_stop(self):
        gripper = self.gripper
        self.assertTrue(gripper.reboot(timeout=DEADLINE_S))
        self.assertFalse(gripper.calibrated())
        self.assertFalse(gripper.command_position(0.0, block=True))
        self.assertTrue(gripper.calibrate(timeout=DEADLINE_S))
        self.assertTrue(gripper.calibrated() and gripper.ready())
        with Box("right", 0.0):
            self.assertFalse(gripper.calibrate(timeout=3.0))
            wait_for(gripper.error, DEADLINE_S, timeout_msg="a calibration with something in the way is not an error")
            self.assertTrue(gripper.reset(timeout=DEADLINE_S))
            self.assertFalse(gripper.error())
        self.assertTrue(gripper.calibrate(timeout=DEADLINE_S))
        gripper.set_velocity(2.0)
        gripper.close()
        wait_for(gripper.moving, DEADLINE_S)
        self.assertTrue(gripper.stop(timeout=DEADLINE_S))
        self.assertGreater(gripper.position(), 5.0)

    def test_client_that_knows_only_the_messages(self):
        """As published course code does: a fixed id, sender and sequence, latched commands, no acknowledgement."""
        seen = []
        state = rospy.Subscriber("/robot/end_effector/right_gripper/state", EndEffectorState, seen.append)
        publisher = rospy.Publisher("/robot/end_effector/right_gripper/command", EndEffectorCommand, queue_size=1,
                                    latch=True)
        for text, sequence, reached in (('{"position": 0.0}', 3, lambda percent: percent < 90.0),
                                        ('{"position": 100.0}', 2, lambda percent: percent > 95.0)):
            publisher.publish(EndEffectorCommand(65538, "go", text, "gripper_publisher", sequence))
            wait_for(lambda sequence=sequence, reached=reached: seen and seen[-1].command_sequence == sequence
                     and seen[-1].command_sender == "gripper_publisher" and reached(seen[-1].position), DEADLINE_S,
                     timeout_msg=f"no effect of {text}")
        state.unregister()
        publisher.unregister()


class SuctionTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.gripper = Gripper("left", CHECK_VERSION)

    def setUp(self):
        self.gripper.set_parameters(defaults=True)
        self.assertTrue(self.gripper.open(block=True, timeout=DEADLINE_S))

    def test_identity(self):
        gripper = self.gripper
        self.assertEqual((gripper.type(), gripper.hardware_id()), ("suction", 65537))
        self.assertEqual(gripper.parameters(), {"vacuum_sensor_threshold": 18.0, "blow_off_seconds": 0.4})
        self.assertFalse(gripper.has_force() or gripper.has_position())
        self.assertIsNone(gripper.calibrate())

    def test_sucking_air(self):
        self.assertFalse(self.gripper.close(block=True, timeout=1.0))
        wait_for(self.gripper.missed, DEADLINE_S, timeout_msg="it did not notice that it missed")
        self.assertFalse(self.gripper.vacuum() or self.gripper.gripping() or self.gripper.sucking())

    def test_holding_and_blowing_off(self):
        gripper = self.gripper
        gripper.set_blow_off(4.0)
        with Box("left", 0.02):
            self.assertTrue(gripper.command_suction(block=True, timeout=DEADLINE_S))
            self.assertTrue(gripper.sucking())
            wait_for(lambda: gripper.gripping() and gripper.vacuum_sensor() > 95.0, DEADLINE_S,
                     timeout_msg="no vacuum under the cup")
            gripper.open()
            wait_for(gripper.blowing, DEADLINE_S, timeout_msg="it does not blow")
            wait_for(lambda: not gripper.blowing(), DEADLINE_S, timeout_msg="it does not stop blowing")
            self.assertFalse(gripper.vacuum() or gripper.gripping() or gripper.sucking())


if __name__ == "__main__":
    init_node("grippers_rostest")
    rostest.rosrun("workspace_tests", "grippers", "__main__")
