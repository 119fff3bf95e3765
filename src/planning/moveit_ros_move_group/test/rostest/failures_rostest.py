#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""A running move_group says why it failed: in the text of the result, and in a Failure with what is in the way."""
import sys
import unittest
from pathlib import Path

import clients
import rospy
from geometry_msgs.msg import Quaternion
from motion_planning_msgs.msg import Failure
from moveit_msgs.msg import ExecuteTrajectoryAction, MoveGroupAction, MoveItErrorCodes, OrientationConstraint
from moveit_msgs.srv import ApplyPlanningScene, GetCartesianPath, GetPositionFK, GetPositionFKRequest

from lab_testing.waiting import stretched, wait_until

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from good_requests import (  # noqa: E402
    Robot,
    box,
    diff,
    framed,
    good_requests,
    joint_goal,
    nothing_left,
    state_of,
    trajectory,
)

CODES = MoveItErrorCodes
TIMEOUT_S = stretched(60.0)
JOINTS = tuple("joint_%d" % number for number in range(1, 7))
FREE, ASIDE = (0.0, 0.3, 0.4, 0.0, 0.6, 0.0), (1.2, 0.3, 0.4, 0.0, 0.6, 0.5)
LAST_LIMIT = 3.1416


class FailuresTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.move = clients.action("move_group", MoveGroupAction)
        cls.execute = clients.action("execute_trajectory", ExecuteTrajectoryAction)
        cls.services = clients.services(
            apply_planning_scene=ApplyPlanningScene, compute_cartesian_path=GetCartesianPath,
            compute_fk=GetPositionFK)
        cls.told = []
        cls.subscriber = rospy.Subscriber("/move_group/failures", Failure, cls.told.append, queue_size=100)
        cls.robot = Robot("manipulator", JOINTS, (), FREE, ASIDE, "tool0", (), "base_link")
        pose = cls.pose_at(cls.services["compute_fk"], ASIDE)
        place = (pose.position.x, pose.position.y, pose.position.z, pose.orientation.x, pose.orientation.y,
                 pose.orientation.z, pose.orientation.w)
        cls.robot = Robot(**{**vars(cls.robot), "place": place})

    @classmethod
    def pose_at(cls, fk, values):
        request = GetPositionFKRequest(fk_link_names=["tool0"], robot_state=state_of(cls.robot, values))
        return fk(request).pose_stamped[0].pose

    def setUp(self):
        for scene in nothing_left():
            self.services["apply_planning_scene"](scene)
        self.told.clear()

    def add(self, name, size, at):
        thing = box(self.robot, name, size, (at.x, at.y, at.z))
        self.assertTrue(self.services["apply_planning_scene"](diff([thing])).success)

    def goal(self, **fields):
        goal = good_requests(self.robot)["move_group"]
        for name, value in fields.items():
            setattr(goal.request, name, value)
        return goal

    def refused(self, request, answer, code):
        """The Failure that says the same as an answer (code, text)."""
        self.assertEqual(answer[0], code, answer[1])
        wait_until(lambda: [one for one in self.told if one.request == request], "a failure of %s" % request, TIMEOUT_S)
        failure = next(one for one in self.told if one.request == request)
        if code != CODES.SUCCESS:
            self.assertEqual(failure.error_code, code)
            self.assertIn(failure.text, answer[1])
        return failure

    def asked(self, goal, client=None):
        client = client or self.move
        client.send_goal(goal)
        self.assertTrue(client.wait_for_result(rospy.Duration(TIMEOUT_S)), "it does not end")
        return client.get_result().error_code.val, client.get_goal_status_text()

    def test_a_start_in_collision_names_the_pair(self):
        # So large that no small move of the start leads out of it.
        self.add("crate", 0.2, self.pose_at(self.services["compute_fk"], FREE).position)
        failure = self.refused("move_group", self.asked(self.goal()), CODES.START_STATE_IN_COLLISION)
        self.assertIn("'crate'", failure.text)
        self.assertIn("crate", [contact.contact_body_2 for contact in failure.contacts])
        self.assertRegex(failure.contacts[0].contact_body_1, "link_|tool0")

    def test_a_goal_in_collision_names_the_pair(self):
        self.add("crate", 0.06, self.pose_at(self.services["compute_fk"], ASIDE).position)
        failure = self.refused("move_group", self.asked(self.goal()), CODES.GOAL_IN_COLLISION)
        self.assertIn("'crate'", failure.text)
        self.assertIn("crate", [contact.contact_body_2 for contact in failure.contacts])

    def test_a_start_beyond_limits_names_the_joint(self):
        start = state_of(self.robot, (*FREE[:5], LAST_LIMIT + 0.5))
        failure = self.refused("move_group", self.asked(self.goal(start_state=start)), CODES.START_STATE_INVALID)
        self.assertIn("joint 'joint_6' is at %.4f" % (LAST_LIMIT + 0.5), failure.text)
        self.assertEqual(failure.joints, ["joint_6"])
        self.assertAlmostEqual(failure.values[0], LAST_LIMIT + 0.5)

    def test_a_goal_beyond_limits_is_the_limit_and_names_the_joint(self):
        goal = self.goal(goal_constraints=[joint_goal(self.robot, (*ASIDE[:5], LAST_LIMIT + 0.5))])
        code, text = self.asked(goal)
        self.assertEqual(code, CODES.SUCCESS, text)
        self.assertIn("'joint_6'", text)

    def test_the_constraint_that_no_posture_meets_is_named(self):
        both = joint_goal(self.robot, ASIDE)
        both.orientation_constraints = [framed(OrientationConstraint(
            link_name="tool0", orientation=Quaternion(1.0, 0.0, 0.0, 0.0), absolute_x_axis_tolerance=0.01,
            absolute_y_axis_tolerance=0.01, absolute_z_axis_tolerance=0.01, weight=1.0), "base_link")]
        code, text = self.asked(self.goal(goal_constraints=[both]))
        self.assertIn(code, (CODES.NO_IK_SOLUTION, CODES.GOAL_CONSTRAINTS_VIOLATED), text)
        self.assertRegex(self.refused("move_group", (code, text), code).text, "joint_|tool0")

    def test_the_path_constraint_that_the_start_violates_is_named(self):
        goal = self.goal(path_constraints=joint_goal(self.robot, (0.5, *FREE[1:]), 0.1))
        failure = self.refused("move_group", self.asked(goal), CODES.START_STATE_VIOLATES_PATH_CONSTRAINTS)
        self.assertIn("joint 'joint_1' is at 0.0000", failure.text)

    def test_where_and_why_a_cartesian_path_ends(self):
        request = good_requests(self.robot)["compute_cartesian_path"]
        begin = self.pose_at(self.services["compute_fk"], FREE)
        request.waypoints = [begin, good_requests(self.robot)["compute_ik"].ik_request.pose_stamped.pose]
        request.waypoints[1].orientation = begin.orientation
        request.waypoints[1].position.x, request.waypoints[1].position.y = begin.position.x, begin.position.y + 0.15
        request.waypoints[1].position.z = begin.position.z
        wall = request.waypoints[1].position
        self.add("wall", 0.04, type(wall)(wall.x, wall.y + 0.03, wall.z))
        response = self.services["compute_cartesian_path"](request)
        self.assertLess(response.fraction, 1.0)
        failure = self.refused("compute_cartesian_path", (response.error_code.val, ""), CODES.SUCCESS)
        for part in ("at fraction %.3f" % response.fraction, "'wall'", "waypoint 2 of 2"):
            self.assertIn(part, failure.text)

    def test_joints_without_a_controller_are_named(self):
        goal = trajectory(self.robot, [FREE, ASIDE])
        goal.trajectory.joint_trajectory.joint_names[5] = "joint_7"
        failure = self.refused("execute_trajectory", self.asked(goal, self.execute), CODES.CONTROL_FAILED)
        self.assertIn("No controller moves joint_7", failure.text)
        self.assertIn("joint_1, joint_2", failure.text)

    def test_a_start_elsewhere_names_the_joint_and_how_far(self):
        goal = trajectory(self.robot, [(9.0, *FREE[1:]), FREE])
        failure = self.refused("execute_trajectory", self.asked(goal, self.execute), CODES.CONTROL_FAILED)
        self.assertRegex(failure.text, "joint 'joint_1' by [0-9.]+")
        self.assertEqual(failure.joints, ["joint_1"])
        self.assertGreater(failure.values[0], 1.0)


if __name__ == "__main__":
    import rostest

    rospy.init_node("failures_test")
    rostest.rosrun("moveit_ros_move_group", "failures", FailuresTest)
