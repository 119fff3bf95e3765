#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The panel driven as rviz drives it: markers dragged, menus chosen; and by the topics of MoveIt's panel."""
import copy
import threading
import unittest

import numpy as np
import rospy
from geometry_msgs.msg import PoseStamped
from moveit_msgs.msg import AttachedCollisionObject, CollisionObject, PlanningScene, RobotState
from moveit_msgs.srv import ApplyPlanningScene
from sensor_msgs.msg import JointState
from std_msgs.msg import Empty, String
from visualization_msgs.msg import Marker, MarkerArray

from lab_testing.marker_client import MarkerClient
from lab_testing.waiting import stretched, wait_for_message, wait_until
from motion_planning_rviz.drawing import COLLIDING, GOAL
from motion_planning_rviz.handles import TOPIC

JOINTS = ["joint_%d" % number for number in range(1, 7)]
HOME, UPWARD = (0.0,) * 6, (0.0, 0.0, 1.5708, 0.0, 1.5708, 0.0)
TIMEOUT_S = stretched(60.0)
GOAL_MARKER = "EE:goal_tool0"


class Rviz(MarkerClient):
    """Rviz's side: the markers to drag, and those that are drawn."""

    def __init__(self):
        self._drawing = threading.Lock()
        self._pictures = {}
        self._drawn = []
        for name in ("goal_state", "start_state", "contacts", "planning_scene", "planned_path"):
            self._pictures[name] = {}
            self._drawn.append(rospy.Subscriber("/planning_panel/" + name, MarkerArray, self._on_picture, name))
        super().__init__(TOPIC, TIMEOUT_S)

    def _on_picture(self, message, name):
        with self._drawing:
            picture = self._pictures[name]
            for marker in message.markers:
                if marker.action == Marker.DELETEALL:
                    picture.clear()
                elif marker.action == Marker.DELETE:
                    picture.pop((marker.ns, marker.id), None)
                else:
                    picture[(marker.ns, marker.id)] = marker

    def picture(self, name):
        with self._drawing:
            return list(self._pictures[name].values())

    def colours(self, name):
        """{link: its colour} in a ghost."""
        return {marker.ns: np.round((marker.color.r, marker.color.g, marker.color.b, marker.color.a), 3).tolist()
                for marker in self.picture(name)}

    def drag(self, pose, name=GOAL_MARKER):
        super().drag(pose, name)

    def titles(self, name=GOAL_MARKER):
        return super().titles(name)

    def choose(self, *titles, name=GOAL_MARKER):
        super().choose(*titles, name=name)


class PlanningPanelTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.rviz = Rviz()
        cls.lines = []
        rospy.wait_for_service("apply_planning_scene", TIMEOUT_S)
        cls.apply = staticmethod(rospy.ServiceProxy("apply_planning_scene", ApplyPlanningScene))
        cls.status = rospy.Subscriber("/planning_panel/status", String, lambda message: cls.lines.append(message.data))
        wait_until(lambda: GOAL_MARKER in cls.rviz.markers, "the goal's marker", TIMEOUT_S)
        cls.topics = {name: rospy.Publisher("/rviz/moveit/" + name, kind, queue_size=5) for name, kind in (
            ("plan", Empty), ("execute", Empty), ("stop", Empty), ("update_goal_state", Empty),
            ("update_start_state", Empty), ("update_custom_goal_state", RobotState),
            ("update_custom_start_state", RobotState), ("select_planning_group", String),
            ("move_marker/goal_tool0", PoseStamped))}
        wait_until(lambda: all(topic.get_num_connections() for topic in cls.topics.values()), "the panel's topics",
                   TIMEOUT_S)

        # Feedback in the first second of a marker is lost: interactive_markers takes it for that of a second rviz.
        def accepted():
            cls.rviz.choose("Speed", "50 %")
            return "[x] 50 %" in cls.rviz.titles()

        wait_until(accepted, "the menu to say which speed was chosen", TIMEOUT_S, 0.2)
        cls.rviz.choose("Speed", "100 %")

    def says(self, text, before=0):
        """Wait for a line with ``text`` after the first ``before`` ones."""
        return wait_until(lambda: next((line for line in self.lines[before:] if text in line), None),
                          "a line with '%s', in %s" % (text, self.lines[before:]), TIMEOUT_S)

    def joints_at(self, values):
        def there(message):
            at = dict(zip(message.name, message.position, strict=True))
            return all(abs(at[name] - value) < 2e-3 for name, value in zip(JOINTS, values, strict=True))

        wait_for_message("/joint_states", JointState, there, TIMEOUT_S)

    def marker_at(self, pose):
        def there():
            now = self.rviz.markers[GOAL_MARKER].pose.position
            return np.allclose((now.x, now.y, now.z), (pose.position.x, pose.position.y, pose.position.z), atol=1e-4)

        wait_until(there, "the goal's marker at %s" % pose.position, TIMEOUT_S)

    def clear_scene(self):
        held = AttachedCollisionObject()
        held.object.operation = CollisionObject.REMOVE
        # What is let go of is in the world then.
        for attached, objects in (([held], []), ([], [CollisionObject(operation=CollisionObject.REMOVE)])):
            scene = PlanningScene(is_diff=True)
            scene.robot_state.is_diff = True
            scene.robot_state.attached_collision_objects, scene.world.collision_objects = attached, objects
            self.assertTrue(self.apply(scene).success)
        wait_until(lambda: not self.rviz.picture("planning_scene"), "the scene to be empty", TIMEOUT_S)

    def send_home(self):
        """The robot and the goal at home, no box, no start of its own."""
        self.clear_scene()
        self.topics["update_start_state"].publish()
        before = len(self.lines)
        self.rviz.choose("Goal", "home")
        self.rviz.choose("Plan and execute")
        self.says("executed", before)
        self.joints_at(HOME)

    def test_a_dragged_goal_is_planned_for_and_reached(self):
        self.send_home()
        pose = copy.deepcopy(self.rviz.markers[GOAL_MARKER].pose)
        pose.position.z -= 0.05
        pose.position.x += 0.02
        self.rviz.drag(pose)
        self.marker_at(pose)
        before = len(self.lines)
        self.rviz.choose("Plan")
        self.says("planned: ", before)
        wait_until(lambda: {"way of tool0", "link_5"} <= {marker.ns for marker in self.rviz.picture("planned_path")},
                   "the planned path as a film", TIMEOUT_S)
        self.joints_at(HOME)
        self.rviz.choose("Execute")
        self.says("executed", before)
        # The arm is at the goal: its marker comes back there.
        wait_until(lambda: not self.rviz.picture("planned_path"), "the film to end", TIMEOUT_S)
        self.rviz.choose("Goal", "upward")
        wait_until(lambda: self.rviz.markers[GOAL_MARKER].pose.position.z > pose.position.z + 0.05, "the goal upwards",
                   TIMEOUT_S)
        self.topics["update_goal_state"].publish()
        self.marker_at(pose)

    def test_out_of_reach_says_why(self):
        self.send_home()
        home = self.rviz.markers[GOAL_MARKER].pose
        before = len(self.lines)
        far = PoseStamped(pose=type(home)(position=type(home.position)(2.0, 0.0, 0.3), orientation=home.orientation))
        self.rviz.drag(far.pose)
        self.says("link 'tool0' cannot be put there: out of reach: ", before)
        wait_until(lambda: "unreached" in self.rviz.colours("goal_state"), "a line to the pose", TIMEOUT_S)
        self.topics["update_goal_state"].publish()
        wait_until(lambda: "unreached" not in self.rviz.colours("goal_state"), "the line to go", TIMEOUT_S)
        self.marker_at(home)

    def test_a_box_turns_links_red_and_is_held(self):
        self.send_home()
        before = len(self.lines)
        self.rviz.choose("Scene", "Add a box in front", "5 cm")
        wait_until(lambda: "box_1" in self.rviz.colours("planning_scene"), "the box", TIMEOUT_S)
        pose = copy.deepcopy(self.rviz.markers[GOAL_MARKER].pose)
        pose.position.z -= 0.03
        self.rviz.drag(pose)
        self.says("link_6 touches box_1", before)
        red, orange = (np.round(colour, 3).tolist() for colour in (COLLIDING, GOAL))
        wait_until(lambda: self.rviz.colours("goal_state").get("link_6") == red, "the flange in red", TIMEOUT_S)
        self.assertEqual(self.rviz.colours("goal_state")["link_2"], orange)
        wait_until(lambda: self.rviz.picture("contacts"), "the contacts", TIMEOUT_S)
        before = len(self.lines)
        self.rviz.choose("Plan")
        self.assertIn("box_1", self.says("no plan: ", before))

        self.rviz.choose("Scene", "Attach", "box_1")
        wait_until(lambda: self.rviz.colours("goal_state").get("link_6") == orange, "the flange to be free", TIMEOUT_S)
        self.assertEqual(self.rviz.colours("goal_state")["box_1"], orange)
        self.rviz.choose("Goal", "upward")
        before = len(self.lines)
        self.rviz.choose("Plan and execute")
        self.says("executed", before)
        self.joints_at(UPWARD)
        self.rviz.choose("Scene", "Detach", "box_1")
        self.rviz.choose("Scene", "Remove", "box_1")
        wait_until(lambda: not self.rviz.picture("planning_scene"), "the box to go", TIMEOUT_S)

    def test_a_box_that_another_program_removes_at_once_goes_from_the_picture(self):
        self.send_home()
        for _ in range(3):
            self.rviz.choose("Scene", "Add a box in front", "5 cm")
            wait_until(lambda: "box_1" in self.rviz.colours("planning_scene"), "the box", TIMEOUT_S)
            # Often within one period of move_group's scene, whose next message then has neither.
            self.clear_scene()

    def test_the_topics_of_moveits_panel(self):
        self.send_home()
        home = self.rviz.markers[GOAL_MARKER].pose
        goal = RobotState()
        goal.joint_state = JointState(name=JOINTS, position=UPWARD)
        self.topics["update_custom_goal_state"].publish(goal)
        wait_until(lambda: self.rviz.markers[GOAL_MARKER].pose.position.z > home.position.z + 0.05, "the goal upwards",
                   TIMEOUT_S)
        before = len(self.lines)
        self.topics["plan"].publish()
        self.says("planned: ", before)
        self.topics["execute"].publish()
        self.says("executed", before)
        self.joints_at(UPWARD)
        message = PoseStamped(pose=home)
        message.header.frame_id = "base_link"
        self.topics["move_marker/goal_tool0"].publish(message)
        self.marker_at(home)
        before = len(self.lines)
        self.topics["select_planning_group"].publish("legs")
        self.says("there is no group 'legs' to plan for; there are manipulator", before)

    def test_a_start_of_its_own(self):
        self.send_home()
        start = RobotState()
        start.joint_state = JointState(name=JOINTS, position=UPWARD)
        self.topics["update_custom_start_state"].publish(start)
        wait_until(lambda: "EE:start_tool0" in self.rviz.markers, "the start's marker", TIMEOUT_S)
        wait_until(lambda: self.rviz.picture("start_state"), "the start's ghost", TIMEOUT_S)
        before = len(self.lines)
        self.rviz.choose("Plan")
        self.says("planned: ", before)
        self.topics["update_start_state"].publish()
        wait_until(lambda: "EE:start_tool0" not in self.rviz.markers, "the start's marker to go", TIMEOUT_S)
        wait_until(lambda: not self.rviz.picture("start_state"), "the start's ghost to go", TIMEOUT_S)

    def test_stop_ends_a_motion(self):
        self.send_home()
        self.rviz.choose("Goal", "upward")
        self.rviz.choose("Speed", "10 %")
        before = len(self.lines)
        self.rviz.choose("Plan and execute")
        wait_for_message("/joint_states", JointState,
                         lambda message: message.position[message.name.index("joint_3")] > 0.05, TIMEOUT_S)
        self.topics["stop"].publish()
        self.says("stopped", before)
        at = rospy.wait_for_message("/joint_states", JointState, TIMEOUT_S)
        self.assertLess(at.position[at.name.index("joint_3")], 1.5)
        self.rviz.choose("Speed", "100 %")

    def test_random_goals_are_valid(self):
        self.send_home()
        before = self.rviz.markers[GOAL_MARKER].pose.position
        self.rviz.choose("Goal", "Random valid")

        def elsewhere():
            now = self.rviz.markers[GOAL_MARKER].pose.position
            return abs(now.x - before.x) + abs(now.y - before.y) + abs(now.z - before.z) > 1e-3

        wait_until(elsewhere, "the goal elsewhere", TIMEOUT_S)
        self.assertNotIn(np.round(COLLIDING, 3).tolist(), self.rviz.colours("goal_state").values())


if __name__ == "__main__":
    import rostest
    rospy.init_node("planning_panel_rostest")
    rostest.rosrun("motion_planning_rviz", "planning_panel", PlanningPanelTest)
