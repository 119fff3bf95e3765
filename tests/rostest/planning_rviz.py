#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""A goal is dragged in rviz, planned for and reached: for PROBOT, and for each arm of Baxter and both.

The pictures lie beside the test's other results; docs/pictures has some of them.
"""
import copy
import sys

import numpy as np
import rospy
import rostest
from rviz_lab import TIMEOUT_S, VIEW, RvizLab, colours
from std_msgs.msg import String

from lab_testing.marker_client import MarkerClient
from lab_testing.waiting import wait_until
from motion_planning_rviz.handles import TOPIC, marker_name

# A ghost has at least so many pixels.
GHOST_PIXELS = 1500
# How far a tip may end from where its marker was left [m].
NEAR_M = 0.01
# For each group of each robot, how far each tip's marker is dragged [m].
GROUPS = {"probot": {"manipulator": {"tool0": (0.02, 0.12, -0.1)}},
          "baxter": {"left_arm": {"left_gripper": (0.1, 0.1, 0.2)}, "right_arm": {"right_gripper": (0.1, -0.1, 0.2)},
                     "both_arms": {"left_gripper": (0.0, -0.1, -0.1), "right_gripper": (0.0, 0.1, -0.1)}}}


class Pixels:
    """How many pixels of rviz's view are orange, as the goal's ghost, and pale blue, as the planned path's."""

    def __init__(self, picture):
        red, green, blue = colours(picture)
        self.goal = int(np.count_nonzero((red - green > 20) & (green - blue > 20)))
        self.path = int(np.count_nonzero((blue - green > 20) & (green >= red) & (red > 50)))

    def __str__(self):
        return "%d orange, %d pale blue" % (self.goal, self.path)


class DragCase(RvizLab):
    """One robot, driven by its markers."""

    robot = ""

    def setUp(self):
        super().setUp()
        self.lines = []
        self.subscriber = rospy.Subscriber("/planning_panel/status", String, lambda said: self.lines.append(said.data))
        self.rviz = MarkerClient(TOPIC, TIMEOUT_S)

    def test_dragged_goals_are_planned_for_and_reached(self):
        groups = GROUPS[self.robot]
        self.begin([marker_name("goal", tip) for tip in next(iter(groups.values()))][0])
        for group, offsets in groups.items():
            try:
                self.drive(group, offsets)
            except AssertionError:
                self.keep("%s_%s_failed" % (self.robot, group))
                raise

    def begin(self, marker):
        """Wait for markers that can be used and a picture with the robot."""
        # interactive_markers takes feedback in a marker's first second for that of a second rviz.
        wait_until(lambda: marker in self.rviz.markers, "marker %s" % marker, TIMEOUT_S)

        def accepted():
            self.rviz.choose("Speed", "100 %", name=marker)
            return "[x] 100 %" in self.rviz.titles(marker)

        wait_until(accepted, "the menu to say which speed was chosen", TIMEOUT_S, 0.2)
        self.wait_for_goal_ghost()

    def wait_for_goal_ghost(self):
        wait_until(lambda: Pixels(self.screen.picture()).goal > GHOST_PIXELS, lambda: "the goal's ghost; pixels: %s"
                   % Pixels(self.screen.picture()), TIMEOUT_S, 0.5)

    def drive(self, group, offsets):
        """Drag the markers of a group, plan, execute."""
        markers = {tip: marker_name("goal", tip) for tip in offsets}
        some = next(iter(self.rviz.markers))
        # A group that is chosen again gets new markers.
        if set(self.rviz.markers) != set(markers.values()):
            self.rviz.choose("Group", group, name=some)
        wait_until(lambda: set(self.rviz.markers) == set(markers.values()), lambda: "the markers of %s; there are %s"
                   % (group, ", ".join(self.rviz.markers)), TIMEOUT_S)
        goals = {tip: self.drag(markers[tip], offset) for tip, offset in offsets.items()}
        before, marker = len(self.lines), next(iter(markers.values()))
        # Before the path is shown: its end hides the goal's ghost, and a slow rviz may draw little else of it.
        self.wait_for_goal_ghost()
        # The markers have some blue, too.
        most = Pixels(self.screen.picture()).path + GHOST_PIXELS
        self.rviz.choose("Plan", name=marker)
        self.says("planned: ", before)

        def path_seen():
            picture = self.screen.picture()
            seen = Pixels(picture).path > most
            if seen:
                self.keep("%s_%s_planned" % (self.robot, group), picture)
            return seen

        wait_until(path_seen, lambda: "the planned path; pixels: %s" % Pixels(self.screen.picture()), TIMEOUT_S, 0.1)
        for tip, goal in goals.items():
            self.assertGreater(self.distance(tip, *goal), 5.0 * NEAR_M, "%s moves before it is told to" % tip)
        self.rviz.choose("Execute", name=marker)
        self.says("executed", before)
        for tip, goal in goals.items():
            wait_until(lambda tip=tip, goal=goal: self.distance(tip, *goal) < NEAR_M, lambda tip=tip, goal=goal:
                       "%s at its marker; it is %.3f m away" % (tip, self.distance(tip, *goal)), TIMEOUT_S)
        wait_until(lambda: Pixels(self.screen.picture()).path < most, lambda: "the film to end; pixels: %s"
                   % Pixels(self.screen.picture()), TIMEOUT_S, 0.2)
        self.screen.wait_until_still(lambda picture: picture[VIEW], TIMEOUT_S)
        self.keep("%s_%s_executed" % (self.robot, group))

    def drag(self, name, offset):
        """Drag a marker by an offset [m]; return (position where it stays, its frame)."""
        marker = self.rviz.markers[name]
        frame, pose = marker.header.frame_id, copy.deepcopy(marker.pose)
        for axis, value in zip("xyz", offset, strict=True):
            setattr(pose.position, axis, getattr(pose.position, axis) + value)
        wanted = np.array((pose.position.x, pose.position.y, pose.position.z))

        def where():
            now = self.rviz.markers[name].pose.position
            return np.array((now.x, now.y, now.z))

        def there():
            self.rviz.drag(pose, name)
            return np.linalg.norm(where() - wanted) < NEAR_M

        wait_until(there, lambda: "%s at %s; it is at %s, and the panel says %s"
                   % (name, wanted.round(3), where().round(3), self.lines[-1:]), TIMEOUT_S, 0.5)
        return wanted, frame

    def distance(self, tip, position, frame):
        """How far a tip is from a position in a frame, now [m]."""
        return float(np.linalg.norm(self.position(frame, tip) - position))

    def says(self, text, before):
        """Wait for a line with ``text`` after the first ``before`` ones."""
        return wait_until(lambda: next((line for line in self.lines[before:] if text in line), None),
                          lambda: "a line with '%s', in %s" % (text, self.lines[before:]), TIMEOUT_S)


class Probot(DragCase):
    robot, launch = "probot", ("probot_gazebo", "probot_anno_bringup_moveit.launch", "gui:=false")


class Baxter(DragCase):
    robot, launch = "baxter", ("workspace_tests", "baxter_planning.launch")


CASES = {"probot": Probot, "baxter": Baxter}

if __name__ == "__main__":
    rospy.init_node("planning_rviz")
    name = next(word for word in sys.argv[1:] if word in CASES)
    rostest.rosrun("workspace_tests", "planning_rviz_" + name, CASES[name])
