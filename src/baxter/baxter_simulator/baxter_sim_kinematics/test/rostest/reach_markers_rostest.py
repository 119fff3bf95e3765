#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""A map of reach on its topics: one point and one cube for each reached cell, for subscribers that come later."""
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import numpy as np
import rospy
import rostest
from sensor_msgs import point_cloud2
from sensor_msgs.msg import PointCloud2
from visualization_msgs.msg import MarkerArray

from arm_kinematics.reach_map import ReachMap

NODE = Path(__file__).resolve().parents[2] / "nodes" / "reach_markers"
WAIT_S = 60.0


class ReachMarkers(unittest.TestCase):

    def test_cells_are_points_and_cubes(self):
        reached = np.zeros((2, 2, 1, 4), dtype=bool)
        reached[1, 0, 0, :3] = True
        manipulability = np.where(reached.any(axis=3), 0.25, np.nan)
        found = ReachMap(np.zeros(3), 0.5, np.tile(np.eye(3), (4, 1, 1)), reached, manipulability, "torso", "hand",
                         self_collision=False)
        with tempfile.TemporaryDirectory() as folder:
            found.write(Path(folder) / "reach.npz")
            node = subprocess.Popen([sys.executable, str(NODE), folder])
            try:
                cloud = rospy.wait_for_message("/reach_map/cells", PointCloud2, WAIT_S)
                marker, = rospy.wait_for_message("/reach_map/markers", MarkerArray, WAIT_S).markers
            finally:
                node.terminate()
                node.wait(WAIT_S)
        point, = point_cloud2.read_points(cloud, ("x", "y", "z", "share", "manipulability"))
        self.assertEqual(point, (0.75, 0.25, 0.25, 0.75, 0.25))
        self.assertEqual((cloud.header.frame_id, marker.header.frame_id), ("torso", "torso"))
        self.assertEqual([(p.x, p.y, p.z) for p in marker.points], [(0.75, 0.25, 0.25)])
        self.assertEqual(len(marker.colors), 1)

    def test_folder_without_map_is_one_line(self):
        done = subprocess.run([sys.executable, str(NODE), "/nowhere"], capture_output=True, text=True, timeout=WAIT_S)
        self.assertEqual(done.returncode, 1)
        self.assertRegex(done.stderr, r"^reach_markers: .*nowhere.*\n$")


if __name__ == "__main__":
    rospy.init_node("reach_markers_rostest", anonymous=True)
    rostest.rosrun("baxter_sim_kinematics", "reach_markers_rostest", ReachMarkers, sys.argv)
