#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Materials as in rviz: each mesh of Baxter under equal light, its mean colour in rviz's picture and in a camera's.

rviz lights a scene by one lamp at the eye, of which a surface shows its diffuse colour times the cosine of the angle
of incidence. Its camera looks straight down here, so a camera of ours gets a sun overhead of brightness 1 and nothing
else. The pictures are compared away from outlines, where both have the same surfaces.
"""
import os
import signal
import subprocess
import unittest
from pathlib import Path

import numpy as np
import rospkg
import rospy

import xacro
from lab_testing import virtual_screen
from model_files.resources import ResourceFinder
from sensor_renderer.gl_renderer import GlRenderer
from sensor_renderer.light import SceneLight
from sensor_renderer.mirror import Mirror
from sensor_renderer.pinhole import Pinhole
from urdf_model import Mesh, parse_urdf
from urdf_model.transforms import pose_matrix
from world_picture.drawing import DrawingCache, read_level

# An even number of columns: the pointer, in the middle of the screen, is between them.
COLUMNS, APART_M, SIDE_M, PIXELS_PER_M = 10, 0.26, 0.2, 420
BACKGROUND = (0, 0, 255)
# From so high, the perspective of a camera of ours is that of rviz's, which has none, within a pixel.
HEIGHT_M = 200.0
DOWN = np.diag([1.0, -1.0, -1.0, 1.0])
# Of the mean colours: a share of rviz's, and two steps of 255 for rounding.
SAME_SHARE, SAME_STEPS = 0.05, 2.0
TURNS = ((0.0, 0.0, 0.0), (0.0, 1.5708, 0.0), (1.5708, 0.0, 0.0))
CONFIG = """Panels: []
Visualization Manager:
  Class: ""
  Displays:
    - {Class: rviz/RobotModel, Name: Meshes, Enabled: true, Robot Description: robot_description, Visual Enabled: true}
  Global Options: {Background Color: 0; 0; 255, Fixed Frame: base}
  Name: root
  Tools:
    - {Class: rviz/MoveCamera}
  Views:
    Current: {Class: rviz/TopDownOrtho, Name: Current View, Angle: 0, Scale: %d, Target Frame: base, X: 0, Y: 0}
Window Geometry: {Height: 780, Width: 1180}
""" % PIXELS_PER_M


def shapes():
    """The visual meshes of Baxter and their grippers' fingers, each once, with the material that the description gives
    it, and shapes of one colour."""
    path = rospkg.RosPack().get_path("baxter_description") + "/urdf/baxter.urdf.xacro"
    found = {}
    for link in parse_urdf(xacro.process_file(path).toxml(), source=path).links.values():
        for shape in link.visuals:
            if isinstance(shape.geometry, Mesh):
                found.setdefault(shape.geometry.filename, shape.colour)
    return found


def description(meshes, finder):
    """(URDF of the meshes side by side, each turned three ways and %g m long; where they are)""" % SIDE_M
    cache, links, cells = DrawingCache(), ['<robot name="meshes"><link name="base"/>'], []
    for name, colour in meshes.items():
        corners = np.concatenate([read_level(part.levels[-1].path)[0] for part in cache.parts(finder(name))])
        low, high = corners.min(axis=0), corners.max(axis=0)
        scale = SIDE_M / np.linalg.norm(high - low)
        for turn in TURNS:
            number = len(cells)
            place = (APART_M * (number % COLUMNS - (COLUMNS - 1) / 2.0), APART_M * (2.0 - number // COLUMNS), 0.0)
            cells.append((name, place))
            middle = pose_matrix((0.0, 0.0, 0.0), turn)[:3, :3] @ (-scale * (low + high) / 2.0)
            links.append('<link name="l%d"><visual><origin xyz="%g %g %g" rpy="%g %g %g"/><geometry><mesh '
                         'filename="%s" scale="%g %g %g"/></geometry>%s</visual></link><joint name="j%d" type="fixed">'
                         '<parent link="base"/><child link="l%d"/><origin xyz="%g %g %g"/></joint>'
                         % (number, *middle, *turn, name, scale, scale, scale,
                            '<material name="m%d"><color rgba="%g %g %g %g"/></material>' % (number, *colour)
                            if colour else "", number, number, *place))
    return "".join([*links, "</robot>"]), cells


class ColoursTest(unittest.TestCase):
    def run_until_the_end(self, command, **options):
        process = subprocess.Popen(command, start_new_session=True, **options)

        def end():
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGTERM)
                process.wait(30.0)
        self.addCleanup(end)

    def test_each_mesh_has_the_colour_that_rviz_shows(self):
        screen, finder = virtual_screen.open_for(self), ResourceFinder()
        urdf, cells = description(shapes(), finder)
        rospy.set_param("robot_description", urdf)
        folder = Path(os.environ.get("ROS_TEST_RESULTS_DIR") or os.environ.get("TMPDIR", "/tmp"))
        config = folder / "rviz_colours.rviz"
        config.write_text(CONFIG)
        self.run_until_the_end(["rosrun", "robot_state_publisher", "robot_state_publisher"])
        self.run_until_the_end(["rosrun", "rviz", "rviz", "-d", str(config)], env=screen.environment)

        def scene(picture):
            is_background = (picture == BACKGROUND).all(axis=2)
            rows, columns = np.flatnonzero(is_background.any(axis=1)), np.flatnonzero(is_background.any(axis=0))
            if len(rows) < 400:
                return None
            inside = picture[rows[0]:rows[-1] + 1, columns[0]:columns[-1] + 1]
            return inside if np.mean((inside != BACKGROUND).any(axis=2)) > 0.05 else None

        theirs = scene(screen.wait_until_still(scene, 150.0))
        ours, covered = self.drawn(urdf, finder, theirs.shape)
        for name, picture in (("theirs", theirs), ("ours", ours)):
            (folder / ("rviz_colours_%s.ppm" % name)).write_bytes(
                b"P6 %d %d 255\n" % picture.shape[1::-1] + picture.tobytes())
        seen, wrong = {}, []
        for name, (x, y, _) in cells:
            a, b, whole = (self.cell(picture, x, y) for picture in (theirs, ours, covered))
            both = inner((a != BACKGROUND).any(axis=2)) & inner(whole)
            if np.count_nonzero(both) < 30:
                continue
            mean, mine = a[both].mean(axis=0), b[both].mean(axis=0)
            seen[name] = seen.get(name, 0) + 1
            line = "%-24s rviz %s, camera %s" % (name.split("/")[-1], mean.round(1), mine.round(1))
            print(line)
            if (np.abs(mean - mine) > SAME_SHARE * mean + SAME_STEPS).any():
                wrong.append(line)
        self.assertEqual(set(seen), {name for name, _ in cells}, "every mesh must be seen")
        self.assertEqual(wrong, [])

    def drawn(self, urdf, finder, shape):
        """(our picture, which of its pixels are covered as a whole: they are the same on another background)"""
        mirror = Mirror(DrawingCache(), finder, self.fail)
        mirror.set_scene([{"name": "meshes", "urdf": urdf, "joints": []}])
        mirror.set_state(np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]))
        height, width, _ = shape
        focal = PIXELS_PER_M * HEIGHT_M
        pinhole = Pinhole(width, height, focal, focal, (width - 1) / 2.0, (height - 1) / 2.0, 1.0, 2.0 * HEIGHT_M)
        pose = DOWN.copy()
        pose[2, 3] = HEIGHT_M
        renderer, pictures = GlRenderer(still=True), []
        for background in ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0)):
            dark = SceneLight.of_scene({"ambient": (0.0, 0.0, 0.0), "background": background, "lights": []})
            mirror.light = dark._replace(to_sun=(0.0, 0.0, 1.0), sun=(1.0, 1.0, 1.0), sun_shine=(0.0, 0.0, 0.0))
            pictures.append(renderer.render(mirror, pinhole, pose)[0])
        renderer.close()
        return pictures[0], (pictures[0] == pictures[1]).all(axis=2)

    @staticmethod
    def cell(picture, x, y):
        height, width = picture.shape[:2]
        half = round(0.5 * APART_M * PIXELS_PER_M)
        row, column = round(height / 2.0 - PIXELS_PER_M * y), round(width / 2.0 + PIXELS_PER_M * x)
        return picture[max(row - half, 0):row + half, max(column - half, 0):column + half]


def inner(mask):
    """The pixels of ``mask`` (h, w) whose neighbours two pixels around are in it as well."""
    for axis in (0, 1):
        for step in (1, 1, -1, -1):
            mask = mask & np.roll(mask, step, axis)
    return mask


if __name__ == "__main__":
    import rostest
    rospy.init_node("rviz_colours_rostest")
    rostest.rosrun("sensor_renderer", "rviz_colours", ColoursTest)
