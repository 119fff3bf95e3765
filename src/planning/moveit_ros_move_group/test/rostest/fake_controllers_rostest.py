#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""move_group with fake controllers: what happens while something moves."""
import time
import unittest

import clients
import numpy as np
import rospy
from actionlib_msgs.msg import GoalStatus
from geometry_msgs.msg import Point, Pose, Quaternion
from moveit_msgs.msg import (
    AttachedCollisionObject,
    CollisionObject,
    Constraints,
    DisplayTrajectory,
    JointConstraint,
    MoveGroupAction,
    MoveGroupGoal,
    MoveItErrorCodes,
    PlanningScene,
    RobotState,
)
from moveit_msgs.srv import (
    ApplyPlanningScene,
    GetPlanningScene,
    GetPlanningSceneRequest,
    GetPositionFK,
    GetPositionFKRequest,
)
from sensor_msgs.msg import JointState
from shape_msgs.msg import SolidPrimitive
from std_msgs.msg import String

from lab_testing.waiting import stretched, wait_until

JOINTS = ["joint_%d" % number for number in range(1, 7)]
TIMEOUT_S = stretched(60.0)
# Joints 2 to 6, the tool far out; a slow way leads from one side to the other through the middle.
FORWARD = (-0.6, 0.4, 0.0, 0.4, 0.0)
LEFT, MIDDLE, RIGHT = (-0.9, *FORWARD), (0.0, *FORWARD), (0.9, *FORWARD)
CODES = MoveItErrorCodes


def box(name, position, size):
    message = CollisionObject(id=name, operation=CollisionObject.ADD,
                              primitives=[SolidPrimitive(SolidPrimitive.BOX, list(size))],
                              primitive_poses=[Pose(Point(*position), Quaternion(0.0, 0.0, 0.0, 1.0))])
    message.header.frame_id = "base_link"
    return message


class FakeControllersTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.move = clients.action("move_group", MoveGroupAction)
        cls.services = clients.services(
            apply_planning_scene=ApplyPlanningScene, get_planning_scene=GetPlanningScene, compute_fk=GetPositionFK)
        cls.feedback = []
        cls.event = rospy.Publisher("trajectory_execution_event", String, queue_size=1)

    def setUp(self):
        self.apply(CollisionObject(operation=CollisionObject.REMOVE))
        self.feedback.clear()

    def apply(self, *objects, attached=()):
        scene = PlanningScene(is_diff=True)
        scene.robot_state.is_diff = True
        scene.world.collision_objects, scene.robot_state.attached_collision_objects = list(objects), list(attached)
        self.assertTrue(self.services["apply_planning_scene"](scene).success)

    def send(self, values, speed=1.0, replan=False):
        goal = MoveGroupGoal()
        request, options = goal.request, goal.planning_options
        request.group_name, request.allowed_planning_time = "manipulator", 5.0
        request.max_velocity_scaling_factor = request.max_acceleration_scaling_factor = speed
        request.goal_constraints = [Constraints(joint_constraints=[
            JointConstraint(name, value, 1e-3, 1e-3, 1.0) for name, value in zip(JOINTS, values, strict=True)])]
        request.start_state.is_diff = options.planning_scene_diff.is_diff = True
        options.planning_scene_diff.robot_state.is_diff = True
        options.replan, options.replan_attempts, options.replan_delay = replan, 3, 0.1
        self.move.send_goal(goal, feedback_cb=lambda message: self.feedback.append(message.state))

    def ended(self):
        self.assertTrue(self.move.wait_for_result(rospy.Duration(TIMEOUT_S)), "move_group does not end")
        return self.move.get_state(), self.move.get_result(), self.move.get_goal_status_text()

    def go(self, values, **options):
        self.send(values, **options)
        state, result, text = self.ended()
        self.assertEqual((state, result.error_code.val), (GoalStatus.SUCCEEDED, CODES.SUCCESS), text)
        return result

    def positions(self):
        state = rospy.wait_for_message("/joint_states", JointState, TIMEOUT_S)
        return np.array([state.position[state.name.index(name)] for name in JOINTS])

    def tip(self, values):
        request = GetPositionFKRequest(fk_link_names=["tool0"], robot_state=RobotState(is_diff=True))
        request.header.frame_id = "base_link"
        request.robot_state.joint_state = JointState(name=JOINTS, position=list(values))
        return self.services["compute_fk"](request).pose_stamped[0].pose.position

    def on_the_way(self, values):
        """A slow motion to ``values``, begun."""
        begin = self.positions()
        self.send(values, speed=0.1)
        wait_until(lambda: np.abs(self.positions() - begin).max() > 0.05, "the arm to move", TIMEOUT_S)

    # -- moving -------------------------------------------------------------------------------------------------

    def test_a_goal_is_reached_and_shown(self):
        shown = []
        subscriber = rospy.Subscriber("/move_group/display_planned_path", DisplayTrajectory, shown.append)
        self.go(LEFT)
        np.testing.assert_allclose(self.positions(), LEFT, atol=2e-3)
        wait_until(lambda: shown, "the planned path", TIMEOUT_S)
        subscriber.unregister()
        self.assertEqual(shown[-1].trajectory[0].joint_trajectory.joint_names, JOINTS)
        self.assertEqual([state for state in self.feedback if state != "IDLE"], ["PLANNING", "MONITOR"])

    def test_cancel_ends_it_soon(self):
        self.go(LEFT)
        self.on_the_way(RIGHT)
        begin = time.monotonic()
        self.move.cancel_goal()
        state, result, _ = self.ended()
        took = time.monotonic() - begin
        self.assertEqual((state, result.error_code.val), (GoalStatus.PREEMPTED, CODES.PREEMPTED))
        self.assertLess(took, stretched(1.0))
        self.assertLess(self.positions()[0], RIGHT[0] - 0.1)

    def test_the_stop_event_ends_it(self):
        self.go(LEFT)
        wait_until(lambda: self.event.get_num_connections() > 0, "move_group to listen", TIMEOUT_S)
        self.on_the_way(RIGHT)
        self.event.publish("stop")
        state, result, _ = self.ended()
        self.assertEqual(result.error_code.val, CODES.PREEMPTED)
        self.assertLess(self.positions()[0], RIGHT[0] - 0.1)

    # -- what changes while it moves ------------------------------------------------------------------------------

    def wall(self):
        middle = self.tip(MIDDLE)
        return box("wall", (middle.x, middle.y, middle.z), (0.1, 0.04, 0.2))

    def test_something_new_in_the_way_stops_it(self):
        self.go(LEFT)
        wall = self.wall()
        self.on_the_way(RIGHT)
        self.apply(wall)
        state, result, text = self.ended()
        self.assertEqual((state, result.error_code.val),
                         (GoalStatus.ABORTED, CODES.MOTION_PLAN_INVALIDATED_BY_ENVIRONMENT_CHANGE))
        self.assertIn("the environment changed during execution", text)
        self.assertIn("'wall'", text)
        self.assertLess(self.positions()[0], 0.0)

    def test_something_new_in_the_way_is_gone_around(self):
        self.go(LEFT)
        wall = self.wall()
        self.feedback.clear()
        begin = self.positions()
        self.send(RIGHT, speed=0.2, replan=True)
        wait_until(lambda: np.abs(self.positions() - begin).max() > 0.05, "the arm to move", TIMEOUT_S)
        self.apply(wall)
        state, result, text = self.ended()
        self.assertEqual((state, result.error_code.val), (GoalStatus.SUCCEEDED, CODES.SUCCESS), text)
        np.testing.assert_allclose(self.positions(), RIGHT, atol=2e-3)
        states = [state for state in self.feedback if state != "IDLE"]
        # Once more where planning beside the motion took too long: then the arm stops first.
        self.assertIn(states, [["PLANNING", "MONITOR"] * rounds for rounds in (2, 3)])

    def test_something_new_beside_the_way_changes_nothing(self):
        self.go(LEFT)
        self.on_the_way(MIDDLE)
        self.apply(box("far", (0.0, 0.0, 2.0), (0.1, 0.1, 0.1)))
        state, result, text = self.ended()
        self.assertEqual((state, result.error_code.val), (GoalStatus.SUCCEEDED, CODES.SUCCESS), text)

    # -- what is held ---------------------------------------------------------------------------------------------

    def test_what_is_held_collides_too(self):
        self.go(MIDDLE)
        tip, right = self.tip(MIDDLE), self.tip(RIGHT)
        self.apply(box("bar", (tip.x, tip.y, tip.z - 0.12), (0.02, 0.02, 0.2)),
                   box("table", (right.x, right.y, right.z - 0.2), (0.1, 0.1, 0.1)))
        held = AttachedCollisionObject(link_name="tool0", touch_links=["link_6", "link_5"])
        held.object.id, held.object.operation = "bar", CollisionObject.ADD
        self.apply(attached=[held])
        self.send(RIGHT)
        state, result, text = self.ended()
        self.assertEqual(result.error_code.val, CODES.GOAL_IN_COLLISION, text)
        self.assertIn("'bar'", text)
        held.object.operation = CollisionObject.REMOVE
        self.apply(attached=[held])
        self.assertEqual(sorted(one.id for one in self.scene().world.collision_objects), ["bar", "table"])
        self.apply(CollisionObject(id="bar", operation=CollisionObject.REMOVE))
        self.go(RIGHT)

    def scene(self):
        return self.services["get_planning_scene"](GetPlanningSceneRequest()).scene


if __name__ == "__main__":
    import rostest

    rospy.init_node("fake_controllers_test")
    rostest.rosrun("moveit_ros_move_group", "fake_controllers", FakeControllersTest)
