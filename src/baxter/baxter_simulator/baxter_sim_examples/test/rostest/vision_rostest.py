#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The programs that look, as users call them, find what stands on the table where the physics has it."""
import math
import re
import subprocess
import unittest

import numpy as np
import rospy
from gazebo_msgs.msg import ModelState
from gazebo_msgs.srv import GetModelState, GetWorldProperties, SetModelState
from geometry_msgs.msg import Point, Pose, Quaternion

from baxter_dataflow import wait_for
from baxter_interface.startup import init_node
from baxter_sim_examples import BASE_HEIGHT_M, TABLE_TOP_M
from baxter_sim_examples.hand_senses import Eyes
from baxter_sim_examples.vision_scene import BOARD, BOARD_SIZE_M, BOARD_TAG, BOARD_TAG_M, COLOURED
from gazebo_ros.gazebo_interface import call
from urdf_model.transforms import matrix_from_quaternion, quaternion_from_matrix, rigid

DEADLINE_S = 90.0
NUMBER = r"(-?\d+\.\d+)"
# Of the board from the Kinect [m], and how it is turned against its picture [degrees] about x, y and z of the camera.
DISTANCE_M, TURN_DEG = 0.8, (25.0, 15.0, 30.0)


def said(program, *words):
    """(exit status, what it printed) of a program of the package."""
    result = subprocess.run(["rosrun", "baxter_sim_examples", program, *words], capture_output=True, text=True,
                            timeout=DEADLINE_S)
    return result.returncode, result.stdout + result.stderr


def truth(model):
    """The pose (4, 4) of a model in `base`."""
    state = call("/gazebo/get_model_state", GetModelState, model, "world")
    assert state.success, state.status_message
    at, turn = state.pose.position, state.pose.orientation
    return rigid(matrix_from_quaternion((turn.x, turn.y, turn.z, turn.w)), (at.x, at.y, at.z - BASE_HEIGHT_M))


def turned(degrees):
    """(3, 3): about x, then y, then z, each an axis of the fixed frame."""
    product = np.eye(3)
    for axis, angle in enumerate(np.radians(degrees)):
        quaternion = [0.0, 0.0, 0.0, math.cos(angle / 2.0)]
        quaternion[axis] = math.sin(angle / 2.0)
        product = matrix_from_quaternion(quaternion) @ product
    return product


class VisionTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        rospy.wait_for_service("/gazebo/get_world_properties", DEADLINE_S)
        wait_for(lambda: BOARD in call("/gazebo/get_world_properties", GetWorldProperties).model_names, DEADLINE_S,
                 timeout_msg="the board did not come into the world")

    def numbers(self, pattern, program, *words):
        """The numbers of the lines that match, a list of lists; the program must end well."""
        status, output = said(program, *words)
        self.assertEqual(status, 0, output)
        lines = re.findall(pattern, output)
        self.assertTrue(lines, output)
        return [[float(number) for number in line] for line in lines]

    def assert_tag_is_found(self, most_m, most_deg):
        found, = self.numbers("tag %d: xyz %s xyzw %s" % (
            BOARD_TAG, " ".join([NUMBER] * 3), " ".join([NUMBER] * 4)), "find_tag.py", "%g" % BOARD_TAG_M)
        tag = truth(BOARD) @ rigid(np.eye(3), (0.0, 0.0, BOARD_SIZE_M[2] / 2.0))
        away = math.dist(found[:3], tag[:3, 3])
        rest = matrix_from_quaternion(found[3:]).T @ tag[:3, :3]
        angle = math.degrees(math.acos(min(1.0, (np.trace(rest) - 1.0) / 2.0)))
        print("tag: %.2f mm and %.2f degrees from where it is" % (1e3 * away, angle))
        self.assertLess(away, most_m)
        self.assertLess(angle, most_deg)

    def test_a_coloured_blocks_place(self):
        for thing in COLOURED:
            colour = thing.name.split("_")[0]
            x, y = self.numbers("%s: x %s y %s" % (colour, NUMBER, NUMBER), "find_colour.py", colour)[0]
            away = math.dist((x, y), truth(thing.name)[:2, 3])
            print("%s: %.1f mm from where it is" % (colour, 1e3 * away))
            # Its sides are seen, too.
            self.assertLess(away, 0.02)

    def test_b_height_of_the_table(self):
        found, = self.numbers(r"table: height %s, tilted by %s degrees, %s points; on it: %s points" % (
            NUMBER, NUMBER, r"(\d+)", r"(\d+)"), "find_plane.py")
        height, tilt, plane, above = found
        print("table: %.1f mm too high, %.2f degrees" % (1e3 * (height - TABLE_TOP_M + BASE_HEIGHT_M), tilt))
        self.assertLess(abs(height - TABLE_TOP_M + BASE_HEIGHT_M), 0.005)
        self.assertLess(tilt, 0.5)
        self.assertGreater(plane, 1000)
        self.assertGreater(above, 20)

    def test_c_tag_on_the_table_and_nearer(self):
        self.assert_tag_is_found(0.006, 1.0)
        camera = Eyes().pose("kinect_pc_frame", rospy.Time(0))
        # A tag's z comes towards the camera, its y is up in the picture.
        facing = rigid(turned(TURN_DEG) @ np.diag((1.0, -1.0, -1.0)), (0.05, -0.04, DISTANCE_M))
        pose = camera @ facing
        x, y, z = pose[:3, 3]
        answer = call("/gazebo/set_model_state", SetModelState, ModelState(
            model_name=BOARD, pose=Pose(Point(x, y, z + BASE_HEIGHT_M), Quaternion(*quaternion_from_matrix(pose)))))
        self.assertTrue(answer.success, answer.status_message)
        self.assert_tag_is_found(0.003, 0.5)

    def test_d_what_is_not_there_is_said(self):
        for words, wrong, text in ((("find_colour.py", "yellow"), 1, "no yellow block is in the picture"),
                                   (("find_colour.py", "pink"), 2, "'red', 'yellow', 'green', 'blue'"),
                                   (("find_tag.py",), 2, "SIDE")):
            status, output = said(*words)
            self.assertEqual(status, wrong, output)
            self.assertIn(text, output)
            self.assertNotIn("Traceback", output)


if __name__ == "__main__":
    import rostest
    init_node("vision_rostest")
    rostest.rosrun("baxter_sim_examples", "vision", VisionTest)
