#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""move_group with a simulated arm, asked as MoveIt's clients ask: by messages."""
import unittest

import clients
import numpy as np
import rospy
from actionlib_msgs.msg import GoalStatus
from geometry_msgs.msg import Point, Pose, Quaternion
from motion_planning_msgs.msg import Failure
from moveit_msgs.msg import (
    BoundingVolume,
    CollisionObject,
    Constraints,
    ExecuteTrajectoryAction,
    ExecuteTrajectoryGoal,
    JointConstraint,
    MoveGroupAction,
    MoveGroupGoal,
    MoveItErrorCodes,
    OrientationConstraint,
    PlanningScene,
    PositionConstraint,
    RobotState,
)
from moveit_msgs.srv import (
    ApplyPlanningScene,
    GetCartesianPath,
    GetCartesianPathRequest,
    GetMotionPlan,
    GetPlanningScene,
    GetPlanningSceneRequest,
    GetPositionFK,
    GetPositionFKRequest,
    GetPositionIK,
    GetPositionIKRequest,
    GetStateValidity,
    GetStateValidityRequest,
    QueryPlannerInterfaces,
)
from sensor_msgs.msg import JointState
from shape_msgs.msg import SolidPrimitive

from lab_testing.waiting import stretched, wait_until

JOINTS = ["joint_%d" % number for number in range(1, 7)]
TIMEOUT_S = stretched(60.0)
ARRIVED_RAD = 5e-3
# Shares of the greatest speed, one after the other, of a motion that a slow machine must lead around in time.
SPEEDS = (0.4, 0.2, 0.1, 0.05)
# Bent, with room on all sides.
BENT = (0.0, 0.3, 0.4, 0.0, 0.6, 0.0)
ASIDE = (1.2, 0.3, 0.4, 0.0, 0.6, 0.5)
# Joints 2 to 6, the tool far out.
FORWARD = (-0.6, 0.4, 0.0, 0.4, 0.0)
CODES = MoveItErrorCodes
EXECUTED, ALREADY_MET = "Solution was found and executed.", "Requested path and goal constraints are already met."


def state_of(values):
    message = RobotState(is_diff=True)
    message.joint_state.name, message.joint_state.position = list(JOINTS), list(values)
    return message


def joint_goal(values, tolerance=1e-3):
    return Constraints(joint_constraints=[JointConstraint(name, value, tolerance, tolerance, 1.0)
                                          for name, value in zip(JOINTS, values, strict=True)])


def pose_goal(pose, link="tool0"):
    position = PositionConstraint(link_name=link, weight=1.0, constraint_region=BoundingVolume(
        primitives=[SolidPrimitive(SolidPrimitive.SPHERE, [1e-3])], primitive_poses=[pose]))
    orientation = OrientationConstraint(link_name=link, orientation=pose.orientation, weight=1.0,
                                        absolute_x_axis_tolerance=1e-2, absolute_y_axis_tolerance=1e-2,
                                        absolute_z_axis_tolerance=1e-2)
    position.header.frame_id = orientation.header.frame_id = "base_link"
    return Constraints(position_constraints=[position], orientation_constraints=[orientation])


def box(name, position, size):
    message = CollisionObject(id=name, operation=CollisionObject.ADD,
                              primitives=[SolidPrimitive(SolidPrimitive.BOX, list(size))],
                              primitive_poses=[Pose(Point(*position), Quaternion(0.0, 0.0, 0.0, 1.0))])
    message.header.frame_id = "base_link"
    return message


class MoveGroupTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.move = clients.action("move_group", MoveGroupAction)
        cls.execute = clients.action("execute_trajectory", ExecuteTrajectoryAction)
        cls.services = clients.services(
            plan_kinematic_path=GetMotionPlan, compute_ik=GetPositionIK, compute_fk=GetPositionFK,
            compute_cartesian_path=GetCartesianPath, check_state_validity=GetStateValidity,
            get_planning_scene=GetPlanningScene, apply_planning_scene=ApplyPlanningScene,
            query_planner_interface=QueryPlannerInterfaces)
        cls.failures = []
        cls.subscriber = rospy.Subscriber("/move_group/failures", Failure, cls.failures.append, queue_size=100)

    def setUp(self):
        clear = CollisionObject(operation=CollisionObject.REMOVE)
        self.assertTrue(self.apply(clear))
        self.failures.clear()

    # -- asking -------------------------------------------------------------------------------------------------

    def apply(self, *objects):
        scene = PlanningScene(is_diff=True)
        scene.robot_state.is_diff = True
        scene.world.collision_objects = list(objects)
        return self.services["apply_planning_scene"](scene).success

    def goal(self, constraints, plan_only=False, speed=1.0):
        goal = MoveGroupGoal()
        request = goal.request
        request.group_name, request.goal_constraints = "manipulator", [constraints]
        request.allowed_planning_time, request.num_planning_attempts = 5.0, 1
        request.max_velocity_scaling_factor = request.max_acceleration_scaling_factor = speed
        request.start_state.is_diff = True
        goal.planning_options.plan_only = plan_only
        goal.planning_options.planning_scene_diff.is_diff = True
        goal.planning_options.planning_scene_diff.robot_state.is_diff = True
        return goal

    def ask(self, constraints, **options):
        """Send a goal and wait for its end: (terminal state, result, text)."""
        self.move.send_goal(self.goal(constraints, **options))
        self.assertTrue(self.move.wait_for_result(rospy.Duration(TIMEOUT_S)), "move_group does not end")
        return self.move.get_state(), self.move.get_result(), self.move.get_goal_status_text()

    def go(self, constraints, **options):
        state, result, text = self.ask(constraints, **options)
        self.assertEqual((state, result.error_code.val), (GoalStatus.SUCCEEDED, CODES.SUCCESS), text)
        self.assertIn(text, (EXECUTED, ALREADY_MET))
        return result

    def positions(self):
        state = rospy.wait_for_message("/joint_states", JointState, TIMEOUT_S)
        return np.array([state.position[state.name.index(name)] for name in JOINTS])

    def tip(self, values=None):
        """The tool's pose at joint values, or where it is."""
        request = GetPositionFKRequest(fk_link_names=["tool0"], robot_state=RobotState(is_diff=True) if values is None
                                       else state_of(values))
        request.header.frame_id = "base_link"
        response = self.services["compute_fk"](request)
        self.assertEqual(response.error_code.val, CODES.SUCCESS)
        self.assertEqual(response.pose_stamped[0].header.frame_id, "base_link")
        return response.pose_stamped[0].pose

    def told(self, request):
        wait_until(lambda: any(one.request == request for one in self.failures),
                   lambda: "a failure of %s; there are %s" % (request, self.failures), TIMEOUT_S)
        return next(one for one in self.failures if one.request == request)

    def assert_near(self, pose, other, metres):
        self.assertLess(np.linalg.norm([pose.position.x - other.position.x, pose.position.y - other.position.y,
                                        pose.position.z - other.position.z]), metres)

    # -- moving -------------------------------------------------------------------------------------------------

    def test_a_joint_goal_is_planned_and_executed(self):
        for values in (BENT, ASIDE, BENT):
            result = self.go(joint_goal(values))
            np.testing.assert_allclose(self.positions(), values, atol=ARRIVED_RAD)
        points = result.planned_trajectory.joint_trajectory.points
        self.assertGreater(len(points), 2)
        self.assertGreater(result.planning_time, 0.0)
        np.testing.assert_allclose(points[0].positions, ASIDE, atol=ARRIVED_RAD)
        self.assertEqual(len(points[0].velocities), 6)

    def test_what_is_met_already_is_not_moved(self):
        self.go(joint_goal(BENT))
        state, result, text = self.ask(joint_goal(BENT, tolerance=0.01))
        self.assertEqual((state, text), (GoalStatus.SUCCEEDED, ALREADY_MET))

    def test_a_pose_goal_is_planned_and_executed(self):
        self.go(joint_goal(BENT))
        wanted = self.tip((0.7, 0.2, 0.5, 0.2, 0.8, 0.3))
        self.go(pose_goal(wanted))
        self.assert_near(self.tip(), wanted, 5e-3)

    def test_a_plan_alone_moves_nothing(self):
        self.go(joint_goal(BENT))
        state, result, text = self.ask(joint_goal(ASIDE), plan_only=True)
        self.assertEqual((state, text), (GoalStatus.SUCCEEDED, "Motion plan was computed succesfully."))
        np.testing.assert_allclose(self.positions(), BENT, atol=ARRIVED_RAD)
        last = result.planned_trajectory.joint_trajectory.points[-1]
        np.testing.assert_allclose(last.positions, ASIDE, atol=2e-3)

    def test_a_cartesian_path_is_followed(self):
        self.go(joint_goal(BENT))
        begin = self.tip()
        waypoints = [Pose(Point(begin.position.x, begin.position.y, begin.position.z - 0.05), begin.orientation),
                     Pose(Point(begin.position.x, begin.position.y + 0.05, begin.position.z - 0.05), begin.orientation)]
        request = GetCartesianPathRequest(group_name="manipulator", waypoints=waypoints, max_step=0.01,
                                          avoid_collisions=True)
        request.header.frame_id, request.start_state.is_diff = "base_link", True
        response = self.services["compute_cartesian_path"](request)
        self.assertEqual((response.error_code.val, response.fraction), (CODES.SUCCESS, 1.0), self.failures)
        self.execute.send_goal(ExecuteTrajectoryGoal(trajectory=response.solution))
        self.assertTrue(self.execute.wait_for_result(rospy.Duration(TIMEOUT_S)))
        self.assertEqual(self.execute.get_result().error_code.val, CODES.SUCCESS, self.execute.get_goal_status_text())
        self.assert_near(self.tip(), waypoints[-1], 5e-3)

    def test_a_cartesian_path_that_ends_early_says_why(self):
        self.go(joint_goal(BENT))
        begin = self.tip()
        far = Pose(Point(begin.position.x + 2.0, begin.position.y, begin.position.z), begin.orientation)
        request = GetCartesianPathRequest(group_name="manipulator", waypoints=[far], max_step=0.01)
        request.start_state.is_diff = True
        response = self.services["compute_cartesian_path"](request)
        self.assertEqual(response.error_code.val, CODES.SUCCESS)
        self.assertLess(response.fraction, 0.5)
        self.assertIn("waypoint 1 of 1", self.told("compute_cartesian_path").text)

    # -- collisions ---------------------------------------------------------------------------------------------

    def test_a_goal_in_collision_names_the_pair(self):
        self.go(joint_goal(BENT))
        tip = self.tip(ASIDE).position
        self.assertTrue(self.apply(box("crate", (tip.x, tip.y, tip.z), (0.06, 0.06, 0.06))))
        state, result, text = self.ask(joint_goal(ASIDE))
        self.assertEqual((state, result.error_code.val), (GoalStatus.ABORTED, CODES.GOAL_IN_COLLISION), text)
        self.assertIn("'crate'", text)
        self.assertIn("link_", text)
        failure = self.told("move_group")
        self.assertEqual(failure.error_code, CODES.GOAL_IN_COLLISION)
        self.assertIn("crate", [contact.contact_body_2 for contact in failure.contacts])
        np.testing.assert_allclose(self.positions(), BENT, atol=ARRIVED_RAD)

    def test_the_way_leads_around_a_box(self):
        left, right = (-0.9, *FORWARD), (0.9, *FORWARD)
        self.go(joint_goal(left))
        middle = self.tip((0.0, *left[1:])).position
        self.assertTrue(self.apply(box("wall", (middle.x, 0.0, middle.z), (0.1, 0.04, 0.2))))
        ask = self.services["check_state_validity"]
        self.assertTrue(ask(GetStateValidityRequest(robot_state=state_of(left))).valid)
        blocked = ask(GetStateValidityRequest(robot_state=state_of((0.0, *left[1:])), group_name="manipulator"))
        self.assertFalse(blocked.valid)
        self.assertIn("wall", [contact.contact_body_2 for contact in blocked.contacts])
        result = self.go(joint_goal(right))
        np.testing.assert_allclose(self.positions(), right, atol=ARRIVED_RAD)
        for point in result.planned_trajectory.joint_trajectory.points:
            answer = ask(GetStateValidityRequest(robot_state=state_of(point.positions), group_name="manipulator"))
            self.assertTrue(answer.valid, answer.contacts)

    # -- executing ----------------------------------------------------------------------------------------------

    def test_a_cancelled_goal_stops_the_arm(self):
        self.go(joint_goal(BENT))
        self.move.send_goal(self.goal(joint_goal((2.5, 0.3, 0.4, 0.0, 0.6, 0.0)), speed=0.2))
        wait_until(lambda: self.positions()[0] > 0.1, "the arm to move", TIMEOUT_S)
        self.move.cancel_goal()
        self.assertTrue(self.move.wait_for_result(rospy.Duration(TIMEOUT_S)))
        self.assertEqual(self.move.get_state(), GoalStatus.PREEMPTED)
        self.assertEqual(self.move.get_result().error_code.val, CODES.PREEMPTED)
        self.assertLess(self.positions()[0], 2.0)

    def test_what_enters_the_way_is_led_around_while_the_arm_moves(self):
        """Without a stop: another way must be found before the arm is there, so on a slow machine the arm is slower."""
        for speed in SPEEDS:
            states, result = self.swing_around_what_enters(speed)
            ask = self.services["check_state_validity"]
            for state in states[::5]:
                values = [state.position[state.name.index(name)] for name in JOINTS]
                answer = ask(GetStateValidityRequest(robot_state=state_of(values), group_name="manipulator"))
                self.assertTrue(answer.valid, answer.contacts)
            moves_rad_s = 0.125 * speed
            if np.abs(result.planned_trajectory.joint_trajectory.points[0].velocities).max() > moves_rad_s:
                break
        else:
            self.fail("the arm stopped before it went another way, at each of the speeds %s" % (SPEEDS,))
        # Its controller led it on as well: from the start to shortly before the end it moves.
        speeds = np.abs([state.velocity for state in states]).max(axis=1)
        moving = np.flatnonzero(speeds > moves_rad_s)
        slow = speeds[moving[0]:moving[-1]] < 0.1 * moves_rad_s
        self.assertFalse(slow.any(), speeds[moving[0]:moving[-1]].min())

    def swing_around_what_enters(self, speed):
        """(joint states, result) of a motion at a share of the greatest speed, into whose way a wall comes."""
        left, right = (-1.2, *FORWARD), (1.2, *FORWARD)
        self.assertTrue(self.apply(CollisionObject(operation=CollisionObject.REMOVE)))
        self.go(joint_goal(left))
        middle = self.tip((0.5, *FORWARD)).position
        states = []
        subscriber = rospy.Subscriber("/joint_states", JointState, states.append, queue_size=1000)
        goal = self.goal(joint_goal(right), speed=speed)
        goal.planning_options.replan, goal.planning_options.replan_attempts = True, 5
        self.move.send_goal(goal)
        wait_until(lambda: states and states[-1].position[states[-1].name.index("joint_1")] > -0.8, "the arm to move",
                   TIMEOUT_S, 0.002)
        wall = box("wall", (middle.x, middle.y, middle.z), (0.04, 0.04, 0.1))
        self.assertTrue(self.apply(wall))
        self.assertTrue(self.move.wait_for_result(rospy.Duration(TIMEOUT_S)), "move_group does not end")
        subscriber.unregister()
        self.assertEqual(self.move.get_result().error_code.val, CODES.SUCCESS, self.move.get_goal_status_text())
        np.testing.assert_allclose(self.positions(), right, atol=ARRIVED_RAD)
        return states, self.move.get_result()

    def test_an_old_plan_is_not_executed(self):
        self.go(joint_goal(BENT))
        _, result, _ = self.ask(joint_goal(ASIDE), plan_only=True)
        self.go(joint_goal((0.5, *BENT[1:])))
        self.execute.send_goal(ExecuteTrajectoryGoal(trajectory=result.planned_trajectory))
        self.assertTrue(self.execute.wait_for_result(rospy.Duration(TIMEOUT_S)))
        self.assertEqual(self.execute.get_result().error_code.val, CODES.CONTROL_FAILED)
        text = self.execute.get_goal_status_text()
        self.assertIn("start point deviates", text)
        self.assertRegex(text, "'joint_1' by 0\\.(5|49)")

    def test_joints_without_a_controller_are_named(self):
        _, result, _ = self.ask(joint_goal(ASIDE if self.positions()[0] < 0.6 else BENT), plan_only=True)
        trajectory = result.planned_trajectory
        trajectory.joint_trajectory.joint_names[5] = "joint_7"
        self.execute.send_goal(ExecuteTrajectoryGoal(trajectory=trajectory))
        self.assertTrue(self.execute.wait_for_result(rospy.Duration(TIMEOUT_S)))
        self.assertIn("joint_7", self.execute.get_goal_status_text())

    # -- the rest -----------------------------------------------------------------------------------------------

    def test_bad_requests_are_answered(self):
        # As MoveIt does: a joint beyond its limit is to be at the limit, with a warning.
        state, result, text = self.ask(joint_goal((9.0, 0.0, 0.0, 0.0, 0.0, 0.0)), plan_only=True)
        self.assertEqual(state, GoalStatus.SUCCEEDED, text)
        self.assertIn("joint_1", text)
        self.assertLess(result.planned_trajectory.joint_trajectory.points[-1].positions[0], 9.0)
        request = self.goal(joint_goal(BENT)).request
        request.group_name = "legs"
        response = self.services["plan_kinematic_path"](request).motion_plan_response
        self.assertEqual(response.error_code.val, CODES.INVALID_GROUP_NAME)
        self.assertIn("'legs'", self.told("plan_kinematic_path").text)
        far = Pose(Point(5.0, 0.0, 0.0), Quaternion(0.0, 0.0, 0.0, 1.0))
        state, result, text = self.ask(pose_goal(far), plan_only=True)
        self.assertEqual(state, GoalStatus.ABORTED)
        self.assertNotEqual(result.error_code.val, CODES.SUCCESS)

    def test_a_plan_from_another_start(self):
        request = self.goal(joint_goal(BENT)).request
        request.start_state = state_of(ASIDE)
        response = self.services["plan_kinematic_path"](request).motion_plan_response
        self.assertEqual(response.error_code.val, CODES.SUCCESS)
        points = response.trajectory.joint_trajectory.points
        np.testing.assert_allclose(points[0].positions, ASIDE, atol=1e-6)
        np.testing.assert_allclose(points[-1].positions, BENT, atol=2e-3)

    def test_ik_answers_what_fk_asks(self):
        request = GetPositionIKRequest()
        ask = request.ik_request
        ask.group_name, ask.robot_state = "manipulator", state_of((0.5, 0.2, 0.4, 0.1, 0.7, 0.2))
        ask.pose_stamped.pose, ask.pose_stamped.header.frame_id = self.tip((0.6, 0.3, 0.5, 0.2, 0.8, 0.3)), "base_link"
        ask.avoid_collisions = True
        response = self.services["compute_ik"](request)
        self.assertEqual(response.error_code.val, CODES.SUCCESS)
        found = dict(zip(response.solution.joint_state.name, response.solution.joint_state.position, strict=True))
        self.assert_near(self.tip([found[name] for name in JOINTS]), ask.pose_stamped.pose, 1e-4)
        ask.pose_stamped.pose.position.x = 3.0
        self.assertEqual(self.services["compute_ik"](request).error_code.val, CODES.NO_IK_SOLUTION)
        ask.group_name = "legs"
        self.assertEqual(self.services["compute_ik"](request).error_code.val, CODES.INVALID_GROUP_NAME)

    def test_the_scene_is_kept_and_published(self):
        diffs = []
        subscriber = rospy.Subscriber("/move_group/monitored_planning_scene", PlanningScene, diffs.append)
        wait_until(lambda: subscriber.get_num_connections() > 0, "move_group to connect", TIMEOUT_S)
        self.assertTrue(self.apply(box("table", (0.0, 0.0, -0.2), (1.0, 1.0, 0.1))))
        scene = self.services["get_planning_scene"](GetPlanningSceneRequest()).scene
        self.assertEqual([one.id for one in scene.world.collision_objects], ["table"])
        self.assertEqual(sorted(scene.robot_state.joint_state.name), JOINTS)
        wait_until(lambda: any(one.id == "table" for diff in list(diffs) for one in diff.world.collision_objects),
                   "the table on monitored_planning_scene", TIMEOUT_S)
        publisher = rospy.Publisher("collision_object", CollisionObject, queue_size=10)
        wait_until(lambda: publisher.get_num_connections() > 0, "move_group to listen", TIMEOUT_S)
        publisher.publish(CollisionObject(id="table", operation=CollisionObject.REMOVE))
        wait_until(lambda: not self.services["get_planning_scene"](GetPlanningSceneRequest()).scene.world.
                   collision_objects, "the table to go", TIMEOUT_S)
        self.assertFalse(self.apply(CollisionObject(id="none", operation=CollisionObject.REMOVE)))

    def test_planners_have_the_names_of_the_configuration(self):
        interfaces = self.services["query_planner_interface"]().planner_interfaces
        self.assertEqual([(one.name, one.pipeline_id) for one in interfaces], [
            ("OMPL", "ompl"), ("Pilz Industrial Motion Planner", "pilz_industrial_motion_planner")])
        self.assertIn("manipulator[RRTConnect]", interfaces[0].planner_ids)


if __name__ == "__main__":
    import rostest

    rospy.init_node("move_group_test")
    rostest.rosrun("moveit_ros_move_group", "move_group_asked", MoveGroupTest)
