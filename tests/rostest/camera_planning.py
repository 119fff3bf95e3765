#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""A pillar that only the simulated Kinect knows of: the octomap has it and not the robot, rviz shows it, an arm goes
around it.
"""
import numpy as np
import rospy
import rostest
from gazebo_msgs.srv import GetModelState, SpawnModel, SpawnModelRequest
from geometry_msgs.msg import Point, Pose, Quaternion
from moveit_msgs.srv import GetStateValidity, GetStateValidityRequest
from rviz_lab import TIMEOUT_S, RvizLab, colours
from sensor_msgs.msg import PointCloud2

from baxter_model import joint_names
from lab_testing.waiting import wait_for_message, wait_until
from moveit_commander import MoveGroupCommander
from moveit_ros_move_group.convert.clouds import points_of

# Middle on the floor in `base`, width, height of its top [m].
PILLAR_XY, WIDTH, TOP, FLOOR = (0.842, 0.0), 0.1, 0.2, -0.93
PILLAR = """<robot name="pillar"><link name="pillar">
  <inertial><mass value="3"/><inertia ixx="0.4" iyy="0.4" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
  <visual><geometry>%(box)s</geometry></visual><collision><geometry>%(box)s</geometry></collision>
</link></robot>""" % {"box": '<box size="%g %g %g"/>' % (WIDTH, WIDTH, TOP - FLOOR)}
# The first joint of the left arm on either side of the pillar, the others at neutral [rad].
SIDES_RAD = (-0.5, -1.55)
# Links of the arm that the Kinect sees, and how near their points and no cubes are [m].
LINKS, SEEN_M, FREE_M = ("left_wrist", "left_hand", "left_lower_forearm"), 0.12, 0.06
TOUCHED_M = 0.002
# The pillar's cubes have at least so many pixels in rviz.
PILLAR_PIXELS = 1500


class CameraTest(RvizLab):
    launch = ("workspace_tests", "baxter_camera.launch")

    def test_what_the_kinect_sees_is_gone_around(self):
        wait_until(lambda: rospy.has_param("/robot_description_semantic"), "the lab's parameters", TIMEOUT_S)
        self.arm = MoveGroupCommander("left_arm", wait_for_servers=TIMEOUT_S)
        self.arm.set_planning_time(10.0)
        begin, end = (self.posture(angle) for angle in SIDES_RAD)
        self.assertTrue(self.arm.go(begin))
        self.assertEqual(self.touches_on_the_way(begin, end), set())
        most = self.cube_pixels() + PILLAR_PIXELS
        self.spawn()
        stood = self.pillar()
        wait_until(lambda: self.cells_in_pillar() > 100, lambda: "the pillar in the octomap; it has %d cubes there"
                   % self.cells_in_pillar(), TIMEOUT_S)
        self.check_that_the_robot_is_left_out()
        self.assertIn("<octomap>", self.touches_on_the_way(begin, end))
        try:
            wait_until(lambda: self.cube_pixels() > most, lambda: "the pillar's cubes in rviz; of their colours there "
                       "are %d pixels, awaited more than %d" % (self.cube_pixels(), most), TIMEOUT_S, 0.5)
        finally:
            self.keep("baxter_octomap")
        for goal in (end, begin):
            self.assertTrue(self.arm.go(goal))
            self.assertLess(np.abs(np.array(self.arm.get_current_joint_values()) - goal).max(), 0.02)
        self.assertLess(np.linalg.norm(self.pillar() - stood), TOUCHED_M, "the arm has touched the pillar")

    def posture(self, angle):
        """The left arm at neutral, its first joint at an angle [rad]: (7,)."""
        values = self.arm.get_named_target_values("left_neutral")
        return [angle, *(values[name] for name in joint_names("left")[1:])]

    def touches_on_the_way(self, begin, end):
        """Names of what the arm would touch on the straight way."""
        check = rospy.ServiceProxy("check_state_validity", GetStateValidity)
        found = set()
        for share in np.linspace(0.0, 1.0, 30):
            request = GetStateValidityRequest(group_name="left_arm")
            request.robot_state.is_diff = True
            request.robot_state.joint_state.name = list(joint_names("left"))
            request.robot_state.joint_state.position = list(np.array(begin) + share * np.subtract(end, begin))
            found |= {name for one in check(request).contacts for name in (one.contact_body_1, one.contact_body_2)}
        return {name for name in found if not name.startswith("left_")}

    def spawn(self):
        rospy.wait_for_service("/gazebo/spawn_urdf_model", TIMEOUT_S)
        pose = Pose(Point(*PILLAR_XY, 0.5 * (TOP - FLOOR)), Quaternion(0.0, 0.0, 0.0, 1.0))
        request = SpawnModelRequest("pillar", PILLAR, "", pose, "world")
        answer = rospy.ServiceProxy("/gazebo/spawn_urdf_model", SpawnModel)(request)
        self.assertTrue(answer.success, answer.status_message)

    def pillar(self):
        """Where the pillar's middle is (3,) [m]."""
        at = rospy.ServiceProxy("/gazebo/get_model_state", GetModelState)("pillar", "world").pose.position
        return np.array((at.x, at.y, at.z))

    def cells(self):
        """Middles of the octomap's cubes (n, 3) in `base` [m]."""
        return points_of(rospy.wait_for_message("/move_group/display_octomap", PointCloud2, TIMEOUT_S))

    def cells_in_pillar(self):
        off = np.abs(self.cells() - (*PILLAR_XY, 0.5 * (TOP + FLOOR)))
        return int((off < (0.5 * WIDTH + 0.02, 0.5 * WIDTH + 0.02, 0.5 * (TOP - FLOOR) + 0.02)).all(axis=1).sum())

    def check_that_the_robot_is_left_out(self):
        """The Kinect sees the arm, and the octomap has nothing there."""
        cloud = wait_for_message("/kinect/depth/points", PointCloud2, timeout_s=TIMEOUT_S)
        seen, cells = points_of(cloud), self.cells()
        for link in LINKS:
            near = np.linalg.norm(seen - self.position(cloud.header.frame_id, link), axis=1) < SEEN_M
            self.assertGreater(np.count_nonzero(near), 50, "the Kinect does not see %s" % link)
            nearest = np.linalg.norm(cells - self.position("base", link), axis=1).min()
            self.assertGreater(nearest, FREE_M, "a cube of the octomap is in %s" % link)

    def cube_pixels(self):
        """Pixels of rviz's view in the strong colours of cubes above the floor, whose own are red; some markers have
        them, too."""
        red, green, blue = colours(self.screen.picture())
        strong = np.maximum(green, blue) - np.minimum(np.minimum(red, green), blue)
        return int(np.count_nonzero((strong > 120) & (np.maximum(green, blue) >= red)))


if __name__ == "__main__":
    rospy.init_node("camera_planning")
    rostest.rosrun("workspace_tests", "camera_planning", CameraTest)
