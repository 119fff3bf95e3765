#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Points of a camera are planned around, and forgotten when they are cleared."""
import unittest

import numpy as np
import rospy
from moveit_msgs.msg import PlanningScene, PlanningSceneComponents
from moveit_msgs.srv import GetPlanningScene, GetPlanningSceneRequest, GetPositionFK, GetPositionFKRequest
from sensor_msgs.msg import PointCloud2
from std_msgs.msg import Header
from std_srvs.srv import Empty

import moveit_commander
from lab_testing.waiting import stretched, wait_until
from moveit_ros_move_group.convert.clouds import cloud_of, points_of

TIMEOUT_S = stretched(60.0)
# Joints 2 to 6, the tool far out; the way from one side to the other leads through the middle.
FORWARD = (-0.6, 0.4, 0.0, 0.4, 0.0)
LEFT, MIDDLE, RIGHT = (-0.9, *FORWARD), (0.0, *FORWARD), (0.9, *FORWARD)
RADIUS_M, HALF_M = 0.033, 0.06  # of a can


class OctomapTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.arm = moveit_commander.MoveGroupCommander("manipulator", wait_for_servers=TIMEOUT_S)
        cls.services = {name: rospy.ServiceProxy(name, kind) for name, kind in (
            ("get_planning_scene", GetPlanningScene), ("compute_fk", GetPositionFK), ("clear_octomap", Empty))}
        for name in cls.services:
            rospy.wait_for_service(name, TIMEOUT_S)
        cls.camera = rospy.Publisher("/camera/depth_registered/points", PointCloud2, queue_size=1)
        cls.filtered, cls.scenes = [], []
        cls.subscribers = [
            rospy.Subscriber("/move_group/filtered_cloud", PointCloud2, cls.filtered.append),
            rospy.Subscriber("/move_group/monitored_planning_scene", PlanningScene, cls.scenes.append)]
        wait_until(lambda: cls.camera.get_num_connections(), "move_group to listen to the camera", TIMEOUT_S)

    def tip(self, values):
        request = GetPositionFKRequest(fk_link_names=["link_6"])
        request.header.frame_id = "base_link"
        request.robot_state.joint_state.name = ["joint_%d" % number for number in range(1, 7)]
        request.robot_state.joint_state.position = list(values)
        position = self.services["compute_fk"](request).pose_stamped[0].pose.position
        return np.array((position.x, position.y, position.z))

    def octomap(self):
        components = PlanningSceneComponents(PlanningSceneComponents.OCTOMAP)
        return self.services["get_planning_scene"](GetPlanningSceneRequest(components)).scene.world.octomap

    def look(self, *clouds):
        self.camera.publish(cloud_of(np.concatenate(clouds), Header(stamp=rospy.Time.now(), frame_id="base_link")))

    def planned(self):
        """Where the tip is on the way that is planned from left to right (n, 3)."""
        success, trajectory, _, code = self.arm.plan(list(RIGHT))
        self.assertTrue(success, code)
        return np.array([self.tip(point.positions) for point in trajectory.joint_trajectory.points])

    def test_a_can_that_the_camera_sees_is_gone_around(self):
        self.arm.set_max_velocity_scaling_factor(1.0)
        self.assertTrue(self.arm.go(list(LEFT), wait=True))
        middle, here = self.tip(MIDDLE), self.tip(LEFT)
        can = can_at(middle)
        self.services["clear_octomap"]()
        self.assertLess(self.nearest(middle), RADIUS_M)  # without the can the tip goes through where it will be
        robot = here + np.array([[0.0, 0.0, 0.0], [0.005, 0.0, 0.0]])
        seen = []

        def entered():
            self.look(can, robot)
            seen[:] = [len(self.octomap().octomap.data)]
            return seen[0]

        wait_until(entered, "the octomap", TIMEOUT_S)
        octomap = self.octomap()
        self.assertEqual((octomap.header.frame_id, octomap.octomap.id, octomap.octomap.binary),
                         ("world", "OcTree", True))
        self.assertAlmostEqual(octomap.octomap.resolution, 0.02)
        self.assertGreater(self.nearest(middle), RADIUS_M)
        wait_until(lambda: self.look(can, robot) or self.filtered, "the filtered cloud", TIMEOUT_S)
        self.assertEqual(len(points_of(self.filtered[-1])), len(can))
        wait_until(lambda: any(len(scene.world.octomap.octomap.data) for scene in self.scenes),
                   "the octomap in the monitored scene", TIMEOUT_S)
        self.assertTrue(self.arm.go(list(RIGHT), wait=True))
        self.services["clear_octomap"]()
        self.assertEqual(len(self.octomap().octomap.data), 0)

    def nearest(self, place):
        """How near the tip's way comes to a place, between the trajectory's points too [m]."""
        points = self.planned()
        dense = np.concatenate([np.linspace(a, b, 20) for a, b in zip(points, points[1:], strict=False)])
        return float(np.linalg.norm(dense - place, axis=1).min())


def can_at(centre):
    """Points (n, 3) on an upright can."""
    angle, height = np.meshgrid(np.linspace(0.0, 2.0 * np.pi, 40), np.linspace(-HALF_M, HALF_M, 20))
    return centre + np.stack([RADIUS_M * np.cos(angle), RADIUS_M * np.sin(angle), height], axis=-1).reshape(-1, 3)


if __name__ == "__main__":
    import rostest

    rospy.init_node("octomap_rostest")
    rostest.rosrun("moveit_ros_move_group", "octomap", OctomapTest)
