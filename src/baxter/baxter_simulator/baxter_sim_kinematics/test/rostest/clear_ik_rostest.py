#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The IK service told to keep the robot off itself: a verdict where nothing is clear, else a clear answer."""
import sys
import unittest

import rospy
import rostest
from baxter_core_msgs.srv import SolvePositionIK, SolvePositionIKRequest
from baxter_kinematics_msgs.msg import IKReport, IKVerdict
from geometry_msgs.msg import PoseStamped

from baxter_sim_kinematics import Chain, convert
from lab_testing.waiting import wait_until
from urdf_model import parse_urdf

# The left hand in the chest, in whatever way the arm is held; and the neutral posture.
IN_THE_CHEST = (-0.4, -0.6, -2.2, 1.8, -1.3, 1.6, -1.4)
NEUTRAL = (0.0, -0.55, 0.0, 0.75, 0.0, 1.26, 0.0)
WAIT_S = 60.0


class ClearIk(unittest.TestCase):

    def test_pose_inside_the_body_gets_the_pair_and_a_clear_one_an_answer(self):
        robot = parse_urdf(rospy.get_param("robot_description"), source="robot_description")
        chain = Chain.from_robot(robot, "base", "left_gripper")
        name = "/ExternalTools/left/PositionKinematicsNode/"
        reports = []
        listener = rospy.Subscriber(name + "IKReport", IKReport, reports.append)
        rospy.wait_for_service(name + "IKService", timeout=WAIT_S)
        poses = []
        for q in (IN_THE_CHEST, NEUTRAL):
            poses.append(PoseStamped(pose=convert.pose_message(chain.fk(q))))
            poses[-1].header.frame_id = "base"
        answer = rospy.ServiceProxy(name + "IKService", SolvePositionIK)(SolvePositionIKRequest(pose_stamp=poses))
        self.assertEqual(answer.isValid, [False, True])
        # Latched, so it comes whenever the connection is made.
        wait_until(lambda: reports, "the report", WAIT_S)
        inside, clear = reports[-1].verdicts
        self.assertEqual((inside.verdict, clear.verdict), (IKVerdict.SELF_COLLISION, IKVerdict.SOLVED))
        self.assertIn("base", inside.links)
        self.assertEqual(len(inside.links), 2)
        listener.unregister()


if __name__ == "__main__":
    rospy.init_node("clear_ik_rostest")
    rostest.rosrun("baxter_sim_kinematics", "clear_ik", ClearIk, sys.argv)
