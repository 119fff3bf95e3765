#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The doctor checks a running move_group: first without problems, then with a box in the arm and without joint
states."""

import contextlib
import os
import sys
import unittest
from pathlib import Path
from xmlrpc.client import ServerProxy

import rosgraph
import rospy
import rostest
from geometry_msgs.msg import Pose
from moveit_msgs.msg import CollisionObject, PlanningScene
from moveit_msgs.srv import ApplyPlanningScene
from shape_msgs.msg import SolidPrimitive

from lab_testing.waiting import stretched, wait_until

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tools"))

from lab_doctor import move_group_checks, probe  # noqa: E402  (the tools are not installed package)
from lab_doctor.findings import Level  # noqa: E402

JOINTS = ["joint_%d" % number for number in range(1, 7)]
# The command starts a process that listens for two seconds.
probe.DEADLINE_S = stretched(60.0)


class DoctorTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        rospy.init_node("doctor_move_group")
        rospy.wait_for_service("apply_planning_scene", stretched(60.0))

    def ask(self):
        return probe.ask_move_group(ROOT, os.environ["ROS_MASTER_URI"])

    def apply(self, thing):
        scene = PlanningScene(is_diff=True)
        scene.robot_state.is_diff, scene.world.collision_objects = True, [thing]
        self.assertTrue(rospy.ServiceProxy("apply_planning_scene", ApplyPlanningScene)(scene).success)

    def test_1_all_is_well(self):
        found = self.ask()
        self.assertEqual((found.node, found.error, found.robot), ("/move_group", "", "probot_anno"))
        self.assertEqual(found.groups["manipulator"], JOINTS)
        self.assertEqual((found.joint_topic, found.silent_joints, found.contacts), ("/joint_states", [], []))
        finding, = move_group_checks.examine(found)
        self.assertEqual(finding.level, Level.OK, finding)

    def test_2_a_box_in_the_arm_is_named(self):
        self.apply(CollisionObject(id="crate", pose=Pose(), primitives=[SolidPrimitive(SolidPrimitive.BOX, [1.0] * 3)],
                                   primitive_poses=[Pose()]))
        found = self.ask()
        self.apply(CollisionObject(id="crate", operation=CollisionObject.REMOVE))
        self.assertIn("crate", [b for _, b in found.contacts])
        wrong = [finding for finding in move_group_checks.examine(found) if finding.level is Level.WRONG]
        self.assertIn("crate", wrong[0].what)

    def test_3_missing_controllers_and_joint_states_are_named(self):
        controllers = rospy.get_param("/move_group/controller_list")
        rospy.set_param("/move_group/controller_list", [{**controllers[0], "joints": JOINTS[:5]}])
        master = rosgraph.Master("/doctor_move_group")
        publisher = ServerProxy(master.lookupNode("/joint_state_publisher"))
        with contextlib.suppress(OSError):  # it may be gone before it has answered
            publisher.shutdown("/doctor_move_group", "the test has it so")
        wait_until(lambda: not dict(master.getSystemState()[0]).get("/joint_states"), "the joint states to end")
        try:
            found = self.ask()
        finally:
            rospy.set_param("/move_group/controller_list", controllers)
        self.assertEqual(found.silent_joints, JOINTS)
        said = " ".join(finding.what for finding in move_group_checks.examine(found))
        self.assertIn("no controller moves joint_6", said)
        self.assertIn("no message on /joint_states has joint_1", said)


if __name__ == "__main__":
    rostest.rosrun("workspace_tests", "doctor_move_group", DoctorTest)
