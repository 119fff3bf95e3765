#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""rviz shows the robot: an arm moves, and the picture changes where it was and where it is, and nowhere else."""
import math
import os
import signal
import subprocess
import unittest
from pathlib import Path

import numpy as np
import rospkg
import rospy
import tf2_ros
import yaml
from robot_client import Robot, joints

from lab_testing import virtual_screen

# Links of the moving arm, torso to tip; each is thinner than THICKNESS_M around the line to the next.
ARM = ("left_upper_shoulder", "left_lower_shoulder", "left_upper_elbow", "left_lower_elbow", "left_upper_forearm",
       "left_lower_forearm", "left_wrist", "left_hand", "left_gripper")
THICKNESS_M = 0.2  # half width of the widest link, and of the axes that rviz draws at the frames
GOAL = dict(zip(joints("left"), (0.3, -0.9, 0.0, 1.3, 0.2, 0.6, 0.4), strict=True))
# Colour steps of 255 that do not count: the other arm holds to 1e-5 rad, which may tip a pixel at an edge.
SAME = 8
# An arm that has moved changes at least so many pixels, where it was and where it is.
CHANGED_PIXELS = 1500
# All must end on Ctrl-C; roslaunch would send SIGTERM only after the limit.
END_LIMIT_S, PATIENCE_S = 40.0, 120.0


class RvizTest(unittest.TestCase):
    def setUp(self):
        self.screen = virtual_screen.open_for(self)
        self.lab = subprocess.Popen(
            ["roslaunch", "--sigint-timeout", str(PATIENCE_S), "baxter_gazebo", "baxter_world.launch", "gui:=false",
             "rviz:=true", "enable:=true", "pose:=neutral"], env=self.screen.environment, start_new_session=True)
        self.addCleanup(self.end_lab)
        package = Path(rospkg.RosPack().get_path("baxter_gazebo"))
        self.config = yaml.safe_load((package / "config" / "baxter.rviz").read_text())["Visualization Manager"]

    def end_lab(self):
        if self.lab.poll() is None:
            os.killpg(self.lab.pid, signal.SIGINT)
            self.lab.wait(END_LIMIT_S)

    def test_picture_changes_where_the_arm_was_and_is_and_nowhere_else(self):
        robot = Robot()
        self.assertEqual(self.config["Global Options"]["Fixed Frame"], "base")
        buffer = tf2_ros.Buffer()
        tf2_ros.TransformListener(buffer)
        background = [int(value) for value in self.config["Global Options"]["Background Color"].split(";")]

        panel = None

        def drawn(picture):
            """The part of the picture that shows the scene, once there is a robot in it."""
            nonlocal panel
            panel = panel_of(picture, background)
            if panel is None:
                return None
            scene = picture[panel]
            covered = np.mean(np.any(scene != background, axis=2))
            return scene if covered > 0.08 else None

        before = self.screen.wait_until_still(drawn, 90.0)
        was = self.arm_mask(buffer, panel)
        robot.set_enabled(True)
        robot.move(GOAL)
        is_now = self.arm_mask(buffer, panel)

        def differs(picture):
            return np.any(np.abs(before[panel].astype(int) - picture[panel]) > SAME, axis=2)

        def redrawn(picture):
            """The same, once the arm has gone from where it was, and come to where it is: a busy rviz may stand still
            for seconds before, and between."""
            scene = drawn(picture)
            if scene is None:
                return None
            changed = differs(picture)
            has_moved = min(np.count_nonzero(changed & was & ~is_now),
                            np.count_nonzero(changed & is_now & ~was)) > CHANGED_PIXELS
            return scene if has_moved else None

        after = self.screen.wait_until_still(redrawn, 60.0, still_s=4.0)
        self.keep(before, "rviz_before")
        self.keep(after, "rviz_after")

        changed = differs(after)
        elsewhere = changed & ~was & ~is_now
        self.assertEqual(np.count_nonzero(elsewhere), 0, "changed elsewhere, at %s" % np.argwhere(elsewhere)[:5])

        # And Ctrl-C ends everything, rviz included.
        os.killpg(self.lab.pid, signal.SIGINT)
        self.lab.wait(END_LIMIT_S)

    def keep(self, picture, name):
        """Save the picture beside the test's other results."""
        folder = os.environ.get("ROS_TEST_RESULTS_DIR")
        if folder:
            height, width, _ = picture.shape
            (Path(folder) / (name + ".ppm")).write_bytes(b"P6 %d %d 255\n" % (width, height) + picture.tobytes())

    def arm_mask(self, buffer, panel):
        """(h, w) bool: pixels of the scene that the arm, where tf has it now, may cover."""
        rows, columns = panel
        height, width = rows.stop - rows.start, columns.stop - columns.start
        view = self.config["Views"]["Current"]
        points = []
        for link in ARM:
            p = buffer.lookup_transform("base", link, rospy.Time(), rospy.Duration(10.0)).transform.translation
            points.append((p.x, p.y, p.z))
        points = np.array(points)
        fractions = np.linspace(0.0, 1.0, 12)[:, None]
        line = np.concatenate([a + fractions * (b - a) for a, b in zip(points, points[1:], strict=False)])

        yaw, pitch = view["Yaw"], view["Pitch"]
        out = np.array([math.cos(yaw) * math.cos(pitch), math.sin(yaw) * math.cos(pitch), math.sin(pitch)])
        eye = np.array([view["Focal Point"][axis] for axis in "XYZ"]) + view["Distance"] * out
        right = np.array([-math.sin(yaw), math.cos(yaw), 0.0])
        up = np.cross(out, right)
        offset = line - eye
        depth = -offset @ out
        scale = height / 2.0 / math.tan(view["Field of View"] / 2.0) / depth  # the field of view is the vertical one
        x, y = width / 2.0 + offset @ right * scale, height / 2.0 - offset @ up * scale
        grid_y, grid_x = np.mgrid[:height, :width]
        mask = np.zeros((height, width), dtype=bool)
        for point_x, point_y, pixels_per_m in zip(x, y, scale, strict=True):
            mask |= (grid_x - point_x) ** 2 + (grid_y - point_y) ** 2 < (THICKNESS_M * pixels_per_m) ** 2
        return mask


def panel_of(picture, background):
    """(rows, columns) slices of the rendered scene: the box around all pixels of its background colour, or None."""
    is_background = np.all(picture == background, axis=2)
    if np.count_nonzero(is_background) < 50000:
        return None
    rows, columns = np.flatnonzero(is_background.any(axis=1)), np.flatnonzero(is_background.any(axis=0))
    return slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1)


if __name__ == "__main__":
    import rostest
    rospy.init_node("rviz_rostest")
    rostest.rosrun("baxter_gazebo", "rviz_picture", RvizTest)
