#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""PTP, LIN, CIRC and sequences through move_group, as clients ask for them."""
import copy
import math
import unittest

import actionlib
import numpy as np
import rospy
from actionlib_msgs.msg import GoalStatus
from geometry_msgs.msg import Pose
from moveit_msgs.msg import (
    Constraints,
    MotionSequenceItem,
    MotionSequenceRequest,
    MoveGroupSequenceAction,
    MoveGroupSequenceGoal,
    MoveItErrorCodes,
    PositionConstraint,
)
from moveit_msgs.srv import (
    GetMotionPlan,
    GetMotionSequence,
    GetPositionFK,
    GetPositionFKRequest,
    QueryPlannerInterfaces,
)

import moveit_commander
from lab_testing.waiting import stretched, wait_until

PILZ, GROUP, TIP = "pilz_industrial_motion_planner", "manipulator", "tool0"
TIMEOUT_S = stretched(60.0)
# The tool in front of the arm, with room on all sides.
BENT = (0.0, -0.8, 0.0, 0.0, 0.6, 0.0)
CODES = MoveItErrorCodes


class IndustrialTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.arm = moveit_commander.MoveGroupCommander(GROUP, wait_for_servers=TIMEOUT_S)
        cls.sequence = actionlib.SimpleActionClient("sequence_move_group", MoveGroupSequenceAction)
        assert cls.sequence.wait_for_server(rospy.Duration(TIMEOUT_S)), "sequence_move_group is not there"
        cls.services = {name: rospy.ServiceProxy(name, kind) for name, kind in (
            ("plan_sequence_path", GetMotionSequence), ("plan_kinematic_path", GetMotionPlan),
            ("compute_fk", GetPositionFK), ("query_planner_interface", QueryPlannerInterfaces))}
        for name in cls.services:
            rospy.wait_for_service(name, TIMEOUT_S)

    def setUp(self):
        self.arm.set_planning_pipeline_id(PILZ)
        self.arm.set_planner_id("PTP")
        self.arm.clear_path_constraints()
        self.arm.set_max_velocity_scaling_factor(0.5)
        self.arm.set_max_acceleration_scaling_factor(0.5)
        self.assertTrue(self.arm.go(list(BENT), wait=True))
        # A pose that was planned from where the arm really is: the last digits of a fake arm lag behind.
        self.begin = self.arm.get_current_pose(TIP).pose

    def shifted(self, x=0.0, y=0.0, z=0.0):
        pose = copy.deepcopy(self.begin)
        pose.position.x, pose.position.y, pose.position.z = (
            pose.position.x + x, pose.position.y + y, pose.position.z + z)
        return pose

    def tips(self, trajectory):
        """Where the tip is at the points of a RobotTrajectory (n, 3)."""
        found = []
        for point in trajectory.joint_trajectory.points:
            request = GetPositionFKRequest(fk_link_names=[TIP])
            request.header.frame_id = "base_link"
            request.robot_state.joint_state.name = trajectory.joint_trajectory.joint_names
            request.robot_state.joint_state.position = point.positions
            position = self.services["compute_fk"](request).pose_stamped[0].pose.position
            found.append((position.x, position.y, position.z))
        return np.array(found)

    def item(self, planner, pose, radius=0.0, constraints=None):
        self.arm.set_planner_id(planner)
        self.arm.set_pose_target(pose, TIP)
        request = self.arm.construct_motion_plan_request()
        if constraints is not None:
            request.path_constraints = constraints
        return MotionSequenceItem(request, radius)

    def about(self, kind, position):
        """Path constraints for CIRC, with a point and nothing else."""
        place = PositionConstraint(link_name=TIP)
        place.header.frame_id = "base_link"
        place.constraint_region.primitive_poses = [Pose(position=position)]
        return Constraints(name=kind, position_constraints=[place])

    # -- single commands ----------------------------------------------------------------------------------------

    def test_lin_is_executed_along_its_line(self):
        self.arm.set_planner_id("LIN")
        goal = self.shifted(y=0.1, z=0.05)
        self.arm.set_pose_target(goal, TIP)
        success, trajectory, _, code = self.arm.plan()
        self.assertTrue(success, code)
        points = self.tips(trajectory)
        along = np.array([0.0, 0.1, 0.05]) / math.hypot(0.1, 0.05)
        away = points - points[0]
        self.assertLess(np.linalg.norm(away - np.outer(away @ along, along), axis=1).max(), 1e-3)
        self.assertTrue(self.arm.execute(trajectory, wait=True))
        here = self.arm.get_current_pose(TIP).pose.position
        np.testing.assert_allclose((here.x, here.y, here.z),
                                   (goal.position.x, goal.position.y, goal.position.z), atol=2e-3)

    def test_circ_by_path_constraints(self):
        centre = self.shifted(y=-0.05).position
        goal = self.shifted(y=-0.05, z=0.05)
        request = self.item("CIRC", goal, constraints=self.about("center", centre)).req
        response = self.services["plan_kinematic_path"](request).motion_plan_response
        self.assertEqual(response.error_code.val, CODES.SUCCESS)
        points = self.tips(response.trajectory)
        radii = np.linalg.norm(points - (centre.x, centre.y, centre.z), axis=1)
        np.testing.assert_allclose(radii, 0.05, atol=1e-3)
        request.path_constraints.name = "middle"
        response = self.services["plan_kinematic_path"](request).motion_plan_response
        self.assertEqual(response.error_code.val, CODES.INVALID_MOTION_PLAN)

    def test_codes_of_what_is_refused(self):
        request = self.item("LIN", self.shifted(y=3.0)).req
        ask = self.services["plan_kinematic_path"]
        self.assertEqual(ask(request).motion_plan_response.error_code.val, CODES.NO_IK_SOLUTION)
        request = self.item("LIN", self.shifted(y=0.05)).req
        request.start_state.is_diff = True
        request.start_state.joint_state.name = ["joint_1"]
        request.start_state.joint_state.position, request.start_state.joint_state.velocity = [0.0], [0.3]
        self.assertEqual(ask(request).motion_plan_response.error_code.val, CODES.INVALID_ROBOT_STATE)
        request.start_state.joint_state.velocity = []
        self.assertEqual(ask(request).motion_plan_response.error_code.val, CODES.SUCCESS)
        request.max_velocity_scaling_factor = 0.0
        self.assertEqual(ask(request).motion_plan_response.error_code.val, CODES.INVALID_MOTION_PLAN)
        request.pipeline_id = "chomp"
        self.assertEqual(ask(request).motion_plan_response.error_code.val, CODES.FAILURE)

    def test_both_pipelines_are_listed_and_ompl_is_the_usual_one(self):
        found = self.services["query_planner_interface"]().planner_interfaces
        planners = {one.pipeline_id: one.planner_ids for one in found}
        self.assertEqual(planners[PILZ], ["PTP", "LIN", "CIRC"])
        self.assertIn("ompl", planners)
        self.arm.set_planning_pipeline_id("")
        self.arm.set_planner_id("")
        self.assertTrue(self.arm.plan([0.3, *BENT[1:]])[0])

    # -- sequences ----------------------------------------------------------------------------------------------

    def corner(self, radius):
        first = self.item("LIN", self.shifted(y=0.1), radius)
        second = self.item("LIN", self.shifted(y=0.1, z=0.1))
        return MotionSequenceRequest([first, second])

    def test_a_planned_sequence_passes_the_corner(self):
        response = self.services["plan_sequence_path"](self.corner(0.04)).response
        self.assertEqual(response.error_code.val, CODES.SUCCESS)
        self.assertEqual(len(response.planned_trajectories), 1)
        self.assertEqual(list(response.sequence_start.joint_state.name)[:1], ["joint_1"])
        corner = self.shifted(y=0.1).position
        gaps = np.linalg.norm(self.tips(response.planned_trajectories[0]) - (corner.x, corner.y, corner.z), axis=1)
        self.assertGreater(gaps.min(), 0.003)
        self.assertLess(gaps.min(), 0.025)
        stops = self.services["plan_sequence_path"](self.corner(0.0)).response.planned_trajectories[0]
        self.assertGreater(stops.joint_trajectory.points[-1].time_from_start,
                           response.planned_trajectories[0].joint_trajectory.points[-1].time_from_start)

    def test_a_sequence_is_executed(self):
        goal = MoveGroupSequenceGoal(request=self.corner(0.03))
        self.sequence.send_goal(goal)
        self.assertTrue(self.sequence.wait_for_result(rospy.Duration(TIMEOUT_S)))
        response = self.sequence.get_result().response
        self.assertEqual((self.sequence.get_state(), response.error_code.val), (GoalStatus.SUCCEEDED, CODES.SUCCESS),
                         self.sequence.get_goal_status_text())
        end = self.shifted(y=0.1, z=0.1).position
        wait_until(lambda: abs(self.arm.get_current_pose(TIP).pose.position.z - end.z) < 2e-3, "the arm to arrive",
                   TIMEOUT_S)

    def test_a_sequence_that_cannot_be_says_why(self):
        request = self.corner(0.5)
        goal = MoveGroupSequenceGoal(request=request)
        goal.planning_options.plan_only = True
        self.sequence.send_goal(goal)
        self.assertTrue(self.sequence.wait_for_result(rospy.Duration(TIMEOUT_S)))
        self.assertEqual(self.sequence.get_state(), GoalStatus.ABORTED)
        self.assertEqual(self.sequence.get_result().response.error_code.val, CODES.INVALID_MOTION_PLAN)
        self.assertIn("within the blend radius", self.sequence.get_goal_status_text())
        request.items[1].req.start_state.joint_state.name = ["joint_1"]
        request.items[1].req.start_state.joint_state.position = [0.0]
        response = self.services["plan_sequence_path"](request).response
        self.assertEqual(response.error_code.val, CODES.INVALID_ROBOT_STATE)


if __name__ == "__main__":
    import rostest

    rospy.init_node("industrial_rostest")
    rostest.rosrun("moveit_ros_move_group", "industrial", IndustrialTest)
