#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Programs for MoveIt with PROBOT, on move_group itself."""
import unittest

import numpy as np
import rospy
from moveit_msgs.msg import MoveItErrorCodes, PlanningSceneComponents, RobotState
from sensor_msgs.msg import JointState

from lab_testing.waiting import stretched, wait_until
from moveit_commander import (
    MoveGroupCommander,
    MoveItCommanderException,
    PlanningSceneInterface,
    RobotCommander,
    conversions,
)

#: Bent, so that the hand can go everywhere from there.
READY = [0.0, 0.3, 0.6, 0.0, 0.8, 0.0]
# How near to its goal a motion ends: the goal's tolerance and the last step of the fake controller.
NEAR = 0.01


class ProbotTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.group = MoveGroupCommander("manipulator", wait_for_servers=stretched(60.0))
        cls.robot, cls.scene = RobotCommander(), PlanningSceneInterface()

    def setUp(self):
        self.scene.clear()
        self.group.set_start_state_to_current_state()
        self.assertTrue(self.group.go(READY))

    def there(self):
        return np.array(self.group.get_current_joint_values())

    def assert_at(self, values):
        wait_until(lambda: np.abs(self.there() - values).max() < NEAR, lambda: "%s, at %s" % (values, self.there()))

    def test_the_robot_is_as_described(self):
        self.assertEqual(self.robot.get_group_names(), ["manipulator"])
        self.assertEqual(self.group.get_active_joints(), ["joint_%d" % number for number in range(1, 7)])
        self.assertEqual(self.group.get_planning_frame(), "world")  # the root of its URDF
        self.assertEqual(self.group.get_end_effector_link(), "tool0")
        self.assertLessEqual({"home", "start", "upward"}, set(self.group.get_named_targets()))
        self.assertEqual(self.robot.joint_2.bounds(), [-2.0071, 2.0071])

    def test_planning_and_executing(self):
        success, plan, seconds, code = self.group.plan(self.there() + 0.2)
        self.assertTrue(success, code)
        self.assertGreater(seconds, 0.0)
        self.assertTrue(self.group.execute(plan))
        self.assert_at(np.array(READY) + 0.2)

    def test_an_old_plan_is_not_executed(self):
        goal = self.there() + 0.2
        old, new = self.group.plan(goal), self.group.plan(goal)
        self.assertTrue(self.group.execute(new))
        self.assertFalse(self.group.execute(old))

    def test_going_in_every_form(self):
        names, values = self.group.get_active_joints(), np.array(READY) - 0.1
        self.group.remember_joint_values("kept", values)
        for target in (values.tolist(), dict(zip(names, values, strict=True)), "kept",
                       JointState(name=names, position=values)):
            self.assertTrue(self.group.go(target))
            self.assert_at(values)
            self.assertTrue(self.group.go("home"))
            self.assert_at(np.zeros(6))

    def test_going_to_a_pose(self):
        pose = self.group.get_current_pose().pose
        pose.position.z += 0.05
        self.group.set_pose_target(pose)
        self.assertTrue(self.group.go())
        self.group.clear_pose_targets()
        there = conversions.pose_to_list(self.group.get_current_pose().pose)
        np.testing.assert_allclose(there[:3], conversions.pose_to_list(pose)[:3], atol=NEAR)
        self.group.set_joint_value_target(pose)
        self.assertTrue(self.group.go())

    def test_a_straight_line(self):
        pose = self.group.get_current_pose().pose
        pose.position.z += 0.05
        plan, fraction = self.group.compute_cartesian_path([pose], 0.005, 0.0)
        self.assertEqual(fraction, 1.0)
        self.assertTrue(self.group.execute(plan))
        there = self.group.get_current_pose().pose.position
        self.assertAlmostEqual(there.z, pose.position.z, delta=NEAR)
        pose.position.x += 3.0
        self.assertLess(self.group.compute_cartesian_path([pose], 0.01, 0.0)[1], 1.0)

    def test_what_stands_in_the_way(self):
        hand = self.group.get_current_pose()
        goal = self.there()
        self.assertTrue(self.group.go("home"))
        self.scene.add_box("box", hand, (0.1, 0.1, 0.1))
        self.assertEqual(self.scene.get_known_object_names(), ["box"])
        plan = self.group.plan(goal)
        self.assertFalse(plan[0])
        self.assertNotEqual(plan[3].val, MoveItErrorCodes.SUCCESS)
        self.scene.remove_world_object("box")
        self.assertEqual(self.scene.get_known_object_names(), [])
        self.assertTrue(self.group.plan(goal)[0])

    def test_allowing_a_collision(self):
        hand = self.group.get_current_pose()
        goal = self.there()
        self.assertTrue(self.group.go("home"))
        # A name of its own: the matrix keeps the entries of an object that is removed.
        self.scene.add_box("crumb", hand, (0.02, 0.02, 0.02))
        self.assertFalse(self.group.plan(goal)[0])
        scene = self.scene.get_planning_scene(PlanningSceneComponents.ALLOWED_COLLISION_MATRIX)
        scene.is_diff = scene.robot_state.is_diff = True
        scene.allowed_collision_matrix.set_allowed("crumb", self.robot.get_link_names())
        self.assertTrue(self.scene.apply_planning_scene(scene))
        self.assertTrue(self.group.plan(goal)[0])

    def test_holding_something(self):
        self.scene.add_box("box", self.group.get_current_pose(), (0.02, 0.02, 0.02))
        self.assertTrue(self.group.attach_object("box", "tool0", ["tool0", "link_6", "link_5"]))
        self.assertEqual(list(self.scene.get_attached_objects()), ["box"])
        self.assertEqual(self.scene.get_known_object_names(), [])
        self.assertTrue(self.group.go("home"))
        self.assertTrue(self.group.detach_object("box"))
        self.assertEqual(self.scene.get_known_object_names(), ["box"])

    def test_new_times(self):
        plan = self.group.plan(self.there() + 0.3)[1]
        slow = self.group.retime_trajectory(self.robot.get_current_state(), plan, 0.1, 0.1)
        self.assertGreater(slow.joint_trajectory.points[-1].time_from_start,
                           plan.joint_trajectory.points[-1].time_from_start)
        self.assertTrue(self.group.execute(self.group.retime_trajectory(self.robot.get_current_state(), plan)))

    def test_planning_from_elsewhere(self):
        start = RobotState(joint_state=JointState(name=self.group.get_active_joints(), position=[0.1] * 6))
        self.group.set_start_state(start)
        plan = self.group.plan("home")
        self.assertTrue(plan[0])
        np.testing.assert_allclose(plan.joint_trajectory.points[0].positions, [0.1] * 6, atol=1e-6)

    def test_stopping(self):
        self.group.set_max_velocity_scaling_factor(0.02)
        self.addCleanup(self.group.set_max_velocity_scaling_factor, 1.0)
        goal = np.array(READY) + [2.0, 0, 0, 0, 0, 0]
        before = self.there()
        self.assertTrue(self.group.go(goal, wait=False))
        wait_until(lambda: np.abs(self.there() - before).max() > 0.02, "the arm to move")
        self.group.stop()
        self.group.set_max_velocity_scaling_factor(1.0)
        # It can be moved again at once, which it could not while it still followed the first plan.
        wait_until(lambda: self.group.go(READY), "the arm to be free again")
        self.assert_at(READY)

    def test_what_cannot_be(self):
        with self.assertRaises(MoveItCommanderException):
            self.group.set_joint_value_target([9.0] * 6)
        far = self.group.get_current_pose()
        far.pose.position.x = 5.0
        with self.assertRaises(MoveItCommanderException):
            self.group.set_joint_value_target(far)
        self.group.set_pose_target(far)
        self.group.set_planning_time(1.0)
        self.assertFalse(self.group.plan()[0])
        self.group.set_planning_time(5.0)
        self.group.clear_pose_targets()


if __name__ == "__main__":
    import rostest
    rospy.init_node("commander_with_move_group_rostest")
    rostest.rosrun("moveit_commander", "commander_with_move_group", ProbotTest)
