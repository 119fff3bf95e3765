#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Either arm and both plan and move, to states, joint values and poses."""

import numpy as np
import rospy

from baxter_model import SIDES, joint_names, poses, tip_of
from lab_testing import subtests
from lab_testing.waiting import stretched, wait_until
from moveit_commander import MoveGroupCommander, PlanningSceneInterface, RobotCommander

# Largest error at the end of a motion: the goal's tolerance and the last step of the fake controller.
NEAR = 0.01


def angles(name, side):
    values = poses().angles(name, side)
    return [values[joint] for joint in joint_names(side)]


class DummyTest(subtests.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.arms = {side: MoveGroupCommander(side + "_arm", wait_for_servers=stretched(60.0)) for side in SIDES}

    def setUp(self):
        for side, arm in self.arms.items():
            self.assertTrue(arm.go(side + "_neutral"))

    def assert_at(self, group, values):
        wait_until(lambda: np.abs(np.array(group.get_current_joint_values()) - values).max() < NEAR, "the joints there")

    def test_the_robot_is_as_described(self):
        robot = RobotCommander()
        self.assertEqual(robot.get_planning_frame(), "world")
        self.assertEqual(set(robot.get_group_names()),
                         {"both_arms", *(side + part for side in SIDES for part in ("_arm", "_hand"))})
        for side, arm in self.arms.items():
            self.assertEqual(arm.get_active_joints(), list(joint_names(side)))
            self.assertEqual(arm.get_end_effector_link(), tip_of(side))

    def test_to_joint_values(self):
        for side, arm in self.arms.items():
            self.assertTrue(arm.go(angles("untucked", side)))
            self.assert_at(arm, angles("untucked", side))

    def test_to_a_pose(self):
        for side, arm in self.arms.items():
            with self.subTest(side=side):
                pose = arm.get_current_pose()
                self.assertEqual(pose.header.frame_id, "world")
                pose.pose.position.z += 0.1
                arm.set_pose_target(pose)
                self.assertTrue(arm.go())
                arm.clear_pose_targets()
                self.assertAlmostEqual(arm.get_current_pose().pose.position.z, pose.pose.position.z, delta=NEAR)

    def test_both_arms_at_once(self):
        both = MoveGroupCommander("both_arms")
        wanted = {joint: value for side in SIDES for joint, value in poses().angles("untucked", side).items()}
        self.assertTrue(both.go(wanted))
        self.assert_at(both, [wanted[joint] for joint in both.get_active_joints()])
        tips = {side: self.arms[side].get_current_pose() for side in SIDES}
        for side, pose in tips.items():
            pose.pose.position.z += 0.05
            both.set_pose_target(pose, tip_of(side))
        self.assertTrue(both.go())
        for side, pose in tips.items():
            there = self.arms[side].get_current_pose().pose.position
            self.assertAlmostEqual(there.z, pose.pose.position.z, delta=NEAR)

    def test_around_a_pillar(self):
        scene = PlanningSceneInterface()
        self.addCleanup(scene.clear)
        arm = self.arms["left"]
        before = arm.get_current_pose()
        # An obstacle between the hand and its goal, half a turn of the shoulder to the right.
        goal = arm.get_current_joint_values()
        goal[0] -= 1.0
        self.assertTrue(arm.go(goal))
        after = arm.get_current_pose()
        self.assertTrue(arm.go("left_neutral"))
        before.pose.position.x = 0.5 * (before.pose.position.x + after.pose.position.x)
        before.pose.position.y = 0.5 * (before.pose.position.y + after.pose.position.y)
        before.pose.orientation.x, before.pose.orientation.y, before.pose.orientation.z = 0.0, 0.0, 0.0
        before.pose.orientation.w = 1.0
        scene.add_box("pillar", before, (0.1, 0.1, 0.4))
        arm.set_planning_time(stretched(20.0))
        self.assertTrue(arm.go(goal))
        self.assert_at(arm, goal)


if __name__ == "__main__":
    import rostest
    rospy.init_node("demo_dummy_rostest")
    rostest.rosrun("baxter_moveit_config", "demo_dummy", DummyTest)
