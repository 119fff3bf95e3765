#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""A hand picks up and puts down, from lists of grasps and places; where none works it is said why."""
import unittest

import actionlib
import numpy as np
import rospy
from geometry_msgs.msg import Pose, PoseStamped, Quaternion
from moveit_msgs.msg import Grasp, MoveItErrorCodes, PickupAction, PickupGoal, PlaceLocation
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint
from visualization_msgs.msg import MarkerArray

from baxter_model import SIDES, tip_of
from lab_testing.waiting import stretched, wait_until
from moveit_commander import MoveGroupCommander, PlanningSceneInterface

BLOCK, SIZE = "block", (0.04, 0.04, 0.1)
TABLE, TABLE_TOP = "table", -0.15
OPEN, CLOSED = 0.0208, 0.004
DOWN = Quaternion(1.0, 0.0, 0.0, 0.0)
UPRIGHT = Quaternion(0.0, 0.0, 0.0, 1.0)
CODES = MoveItErrorCodes


def at(x, y, z, turn=UPRIGHT):
    pose = PoseStamped()
    pose.header.frame_id = "world"
    pose.pose.position.x, pose.pose.position.y, pose.pose.position.z = x, y, z
    pose.pose.orientation = turn
    return pose


def vertical(way, direction):
    way.direction.header.frame_id = "world"
    way.direction.vector.z = direction
    way.desired_distance, way.min_distance = 0.12, 0.05


def posture(side, opening):
    return JointTrajectory(joint_names=[side[0] + "_gripper_l_finger_joint"],
                           points=[JointTrajectoryPoint(positions=[opening])])


def from_above(side, spot, name="top", quality=0.5):
    grasp = Grasp(id=name, grasp_pose=at(*spot[:2], spot[2] + 0.03, DOWN), grasp_quality=quality)
    vertical(grasp.pre_grasp_approach, -1.0)
    vertical(grasp.post_grasp_retreat, 1.0)
    grasp.pre_grasp_posture, grasp.grasp_posture = posture(side, OPEN), posture(side, CLOSED)
    return grasp


class PickPlaceTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.arms = {side: MoveGroupCommander(side + "_arm", wait_for_servers=stretched(60.0)) for side in SIDES}
        cls.scene = PlanningSceneInterface(synchronous=True)
        cls.hands = []
        cls.subscriber = rospy.Subscriber("/move_group/display_grasp_markers", MarkerArray, cls.hands.append)

    def setUp(self):
        self.scene.clear()
        self.scene.add_box(TABLE, at(0.8, 0.0, TABLE_TOP - 0.05), (0.6, 1.4, 0.1))
        for side, arm in self.arms.items():
            self.assertTrue(arm.go(side + "_neutral"))
            arm.set_planning_time(stretched(10.0))
            arm.set_support_surface_name(TABLE)

    def spot(self, side, x=0.65, y=0.25):
        return x, y if side == "left" else -y, TABLE_TOP + 0.5 * SIZE[2]

    def block_at(self, spot):
        self.scene.add_box(BLOCK, at(*spot), SIZE)

    def block(self):
        pose = self.scene.get_object_poses([BLOCK])[BLOCK].position
        return np.array([pose.x, pose.y, pose.z])

    def pick(self, side, spot):
        out_of_reach = from_above(side, (3.0, 0.0, 0.0), "far", 0.9)
        self.assertEqual(self.arms[side].pick(BLOCK, [out_of_reach, from_above(side, spot)]), CODES.SUCCESS)

    def assert_shown(self):
        """The hand is shown at both grasps, and which of them works."""
        def shown():
            green = {(marker.ns, marker.color.g > marker.color.r) for marker in self.hands[-1].markers if marker.ns}
            return green == {("far", False), ("top", True)}

        wait_until(lambda: self.hands and shown(), "the hand at both grasps, red and green")

    def held(self):
        return self.scene.get_attached_objects()

    def test_from_one_spot_to_another(self):
        for side, arm in self.arms.items():
            with self.subTest(side=side):
                spot, other = self.spot(side), self.spot(side, x=0.7, y=0.4)
                self.block_at(spot)
                before = arm.get_current_joint_values()
                self.assertEqual(arm.pick(BLOCK, from_above(side, spot), plan_only=True), CODES.SUCCESS)
                np.testing.assert_allclose(arm.get_current_joint_values(), before, atol=1e-3)
                self.pick(side, spot)
                self.assert_shown()
                held = self.held()[BLOCK]
                self.assertEqual(held.link_name, tip_of(side))
                self.assertIn(side[0] + "_gripper_r_finger_tip", held.touch_links)
                self.assertAlmostEqual(arm.get_current_pose().pose.position.z, spot[2] + 0.03 + 0.12, delta=0.01)
                # The first of the places is taken.
                places = [at(*spot[:2], spot[2] + 0.5), at(*other[:2], other[2] + 0.002)]
                self.assertEqual(arm.place(BLOCK, [self.place(places[0], 0.1), self.place(places[1], 0.9)]),
                                 CODES.SUCCESS)
                self.assertEqual(self.held(), {})
                np.testing.assert_allclose(self.block(), other, atol=0.01)
                self.assertTrue(arm.go(side + "_neutral"))

    def place(self, pose, quality):
        place = PlaceLocation(place_pose=pose, quality=quality)
        vertical(place.pre_place_approach, -1.0)
        vertical(place.post_place_retreat, 1.0)
        return place

    def test_anywhere_on_the_table(self):
        spot = self.spot("left")
        self.block_at(spot)
        self.pick("left", spot)
        self.assertEqual(self.arms["left"].place(BLOCK), CODES.SUCCESS)
        self.assertAlmostEqual(self.block()[2], spot[2], delta=0.005)

    def test_a_pose_is_enough_to_place_at(self):
        spot = self.spot("right")
        self.block_at(spot)
        self.pick("right", spot)
        goal = self.spot("right", x=0.7)
        self.assertEqual(self.arms["right"].place(BLOCK, Pose(at(*goal).pose.position, UPRIGHT)), CODES.SUCCESS)
        np.testing.assert_allclose(self.block()[:2], goal[:2], atol=0.01)

    def test_why_none_works(self):
        client = actionlib.SimpleActionClient("pickup", PickupAction)
        self.assertTrue(client.wait_for_server(rospy.Duration(stretched(90.0))))
        spot = self.spot("left")
        self.block_at(spot)
        self.scene.add_box("lid", at(*spot[:2], spot[2] + 0.1), (0.2, 0.2, 0.02))

        def ended(**fields):
            goal = PickupGoal(**{"target_name": BLOCK, "group_name": "left_arm", "support_surface_name": TABLE,
                                 "allowed_planning_time": stretched(10.0),
                                 "possible_grasps": [from_above("left", spot)], **fields})
            client.send_goal_and_wait(goal, rospy.Duration(stretched(60.0)))
            return client.get_result().error_code.val, client.get_goal_status_text()

        code, text = ended()
        self.assertEqual(code, CODES.GOAL_IN_COLLISION)
        self.assertRegex(text, "'top' fails at 'grasp pose': .*'lid'")
        for fields, expected in (({"target_name": "brick"}, CODES.INVALID_OBJECT_NAME),
                                 ({"group_name": "tail"}, CODES.INVALID_GROUP_NAME),
                                 ({"end_effector": "claw"}, CODES.INVALID_GROUP_NAME),
                                 ({"possible_grasps": [Grasp(grasp_pose=PoseStamped())]}, None)):
            code, text = ended(**fields)
            self.assertNotEqual(code, CODES.SUCCESS)
            self.assertTrue(expected is None or code == expected, text)
        self.assertEqual(self.held(), {})


if __name__ == "__main__":
    import rostest
    rospy.init_node("pick_place_rostest")
    rostest.rosrun("baxter_moveit_config", "pick_place", PickPlaceTest)
