#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The IK service with avoid_collisions: a verdict if every posture collides, else an answer without collision."""
import sys
import threading
import unittest

import rospy
import rostest
from baxter_core_msgs.srv import SolvePositionIK, SolvePositionIKRequest
from baxter_kinematics_msgs.msg import IKReport, IKVerdict
from geometry_msgs.msg import PoseStamped

from arm_kinematics import Chain
from baxter_sim_kinematics import convert
from lab_testing.waiting import wait_until
from urdf_model import parse_urdf

# The left hand in the chest, in any posture; and the neutral posture.
IN_THE_CHEST = (-0.4, -0.6, -2.2, 1.8, -1.3, 1.6, -1.4)
NEUTRAL = (0.0, -0.55, 0.0, 0.75, 0.0, 1.26, 0.0)
WAIT_S = 60.0
# Poses of a long request, and how many requests of one pose it must let pass meanwhile; in turns it is nearly as many.
MANY, SINGLES = 150, 10


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
        # Latched, so it comes whenever the connection is made; and before it perhaps the one of an earlier request.
        wait_until(lambda: reports and len(reports[-1].verdicts) == len(poses), "the report", WAIT_S)
        inside, clear = reports[-1].verdicts
        self.assertEqual((inside.verdict, clear.verdict), (IKVerdict.SELF_COLLISION, IKVerdict.SOLVED))
        self.assertIn("base", inside.links)
        self.assertEqual(len(inside.links), 2)
        listener.unregister()

    def test_a_request_with_many_poses_does_not_hold_the_others_until_its_end(self):
        robot = parse_urdf(rospy.get_param("robot_description"), source="robot_description")
        chain = Chain.from_robot(robot, "base", "left_gripper")
        name = "/ExternalTools/left/PositionKinematicsNode/IKService"
        rospy.wait_for_service(name, timeout=WAIT_S)
        chest, neutral = (PoseStamped(pose=convert.pose_message(chain.fk(q))) for q in (IN_THE_CHEST, NEUTRAL))
        chest.header.frame_id = neutral.header.frame_id = "base"
        over = []

        def ask_many():
            rospy.ServiceProxy(name, SolvePositionIK)(SolvePositionIKRequest(pose_stamp=[chest] * MANY))
            over.append(True)

        many = threading.Thread(target=ask_many)
        many.start()
        one = rospy.ServiceProxy(name, SolvePositionIK)
        singles = 0
        while not over:
            self.assertTrue(one(SolvePositionIKRequest(pose_stamp=[neutral])).isValid[0])
            singles += 1
        many.join(WAIT_S)
        self.assertGreater(singles, SINGLES, "requests of one pose answered meanwhile")

    def test_a_request_with_too_many_poses_is_refused_with_the_limit(self):
        name = "/ExternalTools/right/PositionKinematicsNode/IKService"
        rospy.wait_for_service(name, timeout=WAIT_S)
        with self.assertRaisesRegex(rospy.ServiceException, "20001 poses in one request; at most 20000"):
            rospy.ServiceProxy(name, SolvePositionIK)(SolvePositionIKRequest(pose_stamp=[PoseStamped()] * 20001))


if __name__ == "__main__":
    rospy.init_node("clear_ik_rostest")
    rostest.rosrun("baxter_sim_kinematics", "clear_ik", ClearIk, sys.argv)
