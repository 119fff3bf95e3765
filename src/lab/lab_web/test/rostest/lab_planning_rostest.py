#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Planned motions of the real page beside Baxter's lab and a move_group."""
import sys

import rospy
from geometry_msgs.msg import Point, Pose, Quaternion
from lab_window import NEAR_RAD, SIDE, PageTest, away, wait_for_rest, wait_for_state
from moveit_msgs.msg import CollisionObject, PlanningScene
from moveit_msgs.srv import ApplyPlanningScene
from shape_msgs.msg import SolidPrimitive

from lab_testing.waiting import wait_until

CRATE_M = (1.0, 2.0, 0.1)
# In the frame base, where the hands of the pose "neutral" are; those of "untucked" are not.
CRATE_AT_M = (1.05, 0.0, 0.05)


def put_crate(operation):
    """Add the crate to the scene of the move_group, or remove it."""
    crate = CollisionObject(id="crate", operation=operation)
    crate.header.frame_id = "base"
    crate.pose = Pose(Point(), Quaternion(0.0, 0.0, 0.0, 1.0))
    crate.primitives = [SolidPrimitive(SolidPrimitive.BOX, CRATE_M)]
    crate.primitive_poses = [Pose(Point(*CRATE_AT_M), Quaternion(0.0, 0.0, 0.0, 1.0))]
    scene = PlanningScene(is_diff=True)
    scene.robot_state.is_diff = True
    scene.world.collision_objects = [crate]
    service = rospy.ServiceProxy("/apply_planning_scene", ApplyPlanningScene)
    assert service(scene).success


class LabPlanning(PageTest):
    def setUp(self):
        super().setUp()
        self.browser.wait("!document.getElementById('plans').hidden")
        self.take_control()
        self.enable()

    def said(self):
        return self.browser.evaluate("document.getElementById('plan-said').textContent")

    def want_plans(self, wanted):
        if self.browser.evaluate("document.getElementById('plan-first').checked") is not wanted:
            self.browser.click("#plan-first")

    def plan(self, pose):
        """Press the pose's button; what the page says when the planning has ended."""
        self.browser.wait("!document.getElementById('pose-%s').disabled" % pose)
        self.browser.click("#pose-" + pose)
        return wait_until(lambda: self.said() not in ("", "Planning …") and self.said(), "the end of the planning")

    def test_the_arms_follow_a_plan_to_a_pose(self):
        for pose in sorted(("neutral", "untucked"), key=away, reverse=True):
            self.want_plans(True)

            def arrived(pose=pose):
                self.assertIn("s was found", self.plan(pose))
                wait_for_rest()
                return away(pose) < NEAR_RAD
            wait_until(arrived, lambda pose=pose: "%s, %.2f rad away, %s" % (pose, away(pose), self.said()), 120.0)

    def test_a_pose_in_an_obstacle_is_refused_with_its_name(self):
        self.want_plans(False)
        self.go_to("untucked")
        put_crate(CollisionObject.ADD)
        try:
            self.want_plans(True)
            before = away("neutral")
            said = self.plan("neutral")
            self.assertIn("The arms would touch something there: ", said)
            self.assertIn("crate", said)
            self.assertAlmostEqual(away("neutral"), before, delta=NEAR_RAD)
        finally:
            put_crate(CollisionObject.REMOVE)

    def test_a_stop_in_mid_motion_ends_a_plan(self):
        self.want_plans(True)
        pose = max(("neutral", "untucked"), key=away)
        before = away(pose)

        def moves():
            self.assertIn("s was found", self.plan(pose))
            wait_until(lambda: before - away(pose) > 0.1 or self.says_silent(), "a motion")
            return not self.says_silent()
        wait_until(moves, "a motion to " + pose, 60.0)
        self.browser.press(" ", "Space")
        wait_for_state(stopped=True, enabled=False)
        wait_for_rest()
        self.assertGreater(away(pose), 0.2)

    def test_a_hand_goes_to_its_handle_by_a_plan(self):
        self.want_plans(False)
        self.go_to("untucked")
        self.want_plans(True)
        self.browser.click("#reach-" + SIDE)
        self.browser.wait("lab.view.ghosts.has('%s')" % SIDE)
        self.drag_handle(SIDE, 25, 15)
        self.check_hand_goes_to_its_ghost(SIDE)
        self.assertIn("s was found", self.said())


if __name__ == "__main__":
    import rostest
    rospy.init_node("lab_planning")
    rostest.rosrun("lab_web", "lab_planning", LabPlanning, sys.argv)
