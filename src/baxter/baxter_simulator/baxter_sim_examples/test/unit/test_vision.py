# SPDX-License-Identifier: BSD-3-Clause
"""Tags, colours and planes, in pictures that the cameras' renderer draws: from a picture to a pose, without ROS."""
import math
from pathlib import Path

import numpy as np
import pytest
import rospkg

from baxter_sim_examples import tagged, vision_scene
from baxter_sim_examples.colours import HUES, find_blocks, find_patches
from baxter_sim_examples.looking import CameraView, NotSeen, find_tagged_block, locate_tagged
from baxter_sim_examples.planes import NoPlane, fit_plane
from baxter_sim_examples.scene import BLOCK_SIZE_M, TABLE_SIZE_M
from baxter_sim_examples.tags import CELLS, find_tags, pattern
from sdf_model import parse_sdf_model
from sensor_renderer.exposure import Exposure, ExposureSettings
from sensor_renderer.gl_renderer import GlRenderer
from sensor_renderer.lens import Distortion, Lens
from sensor_renderer.mirror import Mirror
from sensor_renderer.pinhole import Pinhole
from sensor_renderer.structured_light import StructuredLight
from urdf_model import merge_fixed
from urdf_model.transforms import inverse, pose_matrix, quaternion_from_matrix
from urdf_model.writer import drawing_urdf
from world_picture.drawing import DrawingCache

# The hands' and the head's camera as they start, and the Kinect.
CAMERAS = {"hand": Pinhole.from_field_of_view(800, 800, 1.3962634, 0.02, 10.0),
           "kinect": Pinhole.from_field_of_view(640, 480, 1.047, 0.1, 100.0)}
LENS = Distortion(-0.1, 0.02, 0.001, -0.001, 0.0)
SENSOR = ExposureSettings(full_well=10000.0, read_noise=15.0)
TABLE = """<robot name="table"><link name="table"><visual><origin xyz="0 0 -0.02"/><geometry>
<box size="%g %g 0.04"/></geometry><material name="wood"><color rgba="0.55 0.38 0.22 1"/></material></visual></link>
</robot>""" % (TABLE_SIZE_M, TABLE_SIZE_M)


@pytest.fixture(scope="module")
def renderer():
    made = GlRenderer()
    yield made
    made.close()


def world(tmp_path, *things):
    """A Mirror of (URDF text, pose (4, 4))."""
    mirror = Mirror(DrawingCache(tmp_path), lambda uri: None, pytest.fail)
    mirror.set_scene([{"name": "thing%d" % number, "urdf": urdf, "joints": []}
                      for number, (urdf, _) in enumerate(things)])
    mirror.set_state(np.concatenate([[*pose[:3, 3], *quaternion_from_matrix(pose)] for _, pose in things]))
    return mirror


def seen(renderer, mirror, pinhole, pose, distortion=None, time_s=0.0):
    """The CameraView of a noisy camera at `pose`."""
    lens = Lens(pinhole, distortion) if distortion else None
    picture, _ = renderer.render(mirror, lens.ideal if lens else pinhole, pose)
    picture = Exposure(1).developed([lens.picture(picture) if lens else picture], SENSOR, time_s)
    matrix = np.array([[pinhole.fx, 0.0, pinhole.cx], [0.0, pinhole.fy, pinhole.cy], [0.0, 0.0, 1.0]])
    return CameraView(picture, matrix, pose, tuple(distortion or ()))


def looking_at(target, away, slant, turn):
    """Optical pose (4, 4) at a distance [m] from a point, slanted from straight down and turned about the vertical."""
    pose = pose_matrix((0.0, 0.0, 0.0), (0.0, 0.0, turn)) @ pose_matrix((0.0, 0.0, 0.0), (math.pi - slant, 0.0, 0.0))
    pose[:3, 3] = np.asarray(target) - away * pose[:3, 2]
    return pose


def angle_deg(one, other):
    return math.degrees(math.acos(min(1.0, (np.trace(one[:3, :3].T @ other[:3, :3]) - 1.0) / 2.0)))


@pytest.mark.parametrize("distortion", [None, LENS])
@pytest.mark.parametrize("camera", CAMERAS)
def test_a_tag_is_found_within_3_mm_and_half_a_degree_from_a_distance_of_80_cm(renderer, tmp_path, camera, distortion):
    board = pose_matrix((0.7, 0.1, 0.2), (0.0, 0.0, 0.4))
    mirror = world(tmp_path, (TABLE, pose_matrix((1.0, 0.1, 0.19), (0, 0, 0))), (vision_scene.board_urdf(), board))
    tag = board @ pose_matrix((0.0, 0.0, vision_scene.BOARD_SIZE_M[2] / 2.0), (0, 0, 0))
    random = np.random.default_rng(5)
    for number in range(4):
        slant, turn = random.uniform(0.25, 0.8), random.uniform(-3.0, 3.0)
        pose = looking_at(tag[:3, 3] + random.uniform(-0.05, 0.05, 3), 0.8, slant, turn)
        view = seen(renderer, mirror, CAMERAS[camera], pose, distortion, number)
        found = find_tags(view, vision_scene.BOARD_TAG_M)
        assert list(found) == [vision_scene.BOARD_TAG]
        pose = found[vision_scene.BOARD_TAG]
        assert np.linalg.norm(pose[:3, 3] - tag[:3, 3]) < 0.003
        assert angle_deg(pose, tag) < 0.5


def test_a_tag_is_drawn_cell_by_cell_without_bleeding(renderer, tmp_path):
    """Each cell of the picture has the brightness of its own colour, to within a tenth of its side from its edges."""
    mirror = world(tmp_path, (vision_scene.board_urdf(), np.eye(4)))
    pinhole = Pinhole.from_field_of_view(700, 700, 0.4, 0.02, 10.0)
    top = vision_scene.BOARD_SIZE_M[2] / 2.0
    pose = looking_at((0.0, 0.0, top), 0.4, 0.0, 0.0)
    grey = renderer.render(mirror, pinhole, pose)[0].mean(axis=2)
    cell = vision_scene.BOARD_TAG_M / CELLS
    levels = {True: [], False: []}
    for (row, column), is_white in np.ndenumerate(pattern(vision_scene.BOARD_TAG)):
        for down in (0.1, 0.5, 0.9):
            for right in (0.1, 0.5, 0.9):
                point = (cell * (column + right) - 4.0 * cell, 4.0 * cell - cell * (row + down), top, 1.0)
                (u, v), = pinhole.project([(inverse(pose) @ point)[:3]]).round().astype(int)
                levels[bool(is_white)].append(grey[v, u])
    assert np.ptp(levels[True]) < 3 and np.max(levels[False]) < 0.05 * np.min(levels[True])


def test_the_same_tag_is_described_in_the_same_way_each_time():
    assert vision_scene.board_urdf() == vision_scene.board_urdf()
    with pytest.raises(ValueError, match="tag 587 is not one of AprilTag 36h11; expected 0 to 586"):
        pattern(587)


def block_at(x, y, yaw):
    """(URDF, pose) of the tagged block on a table whose top is at z = 0."""
    return tagged.tagged_block_urdf(0.1, 0.7), pose_matrix((x, y, BLOCK_SIZE_M / 2.0), (0.0, 0.0, yaw))


def test_the_tagged_block_is_found_where_it_is(renderer, tmp_path):
    for x, y, yaw in ((0.05, 0.1, 0.3), (-0.1, 0.0, -2.0), (0.0, -0.12, 1.4)):
        mirror = world(tmp_path, (TABLE, np.eye(4)), block_at(x, y, yaw))
        spot = find_tagged_block(seen(renderer, mirror, CAMERAS["hand"], looking_at((0, 0, 0), 0.35, 0.05, 1.0)))
        assert math.dist((spot.x, spot.y, spot.z), (x, y, BLOCK_SIZE_M / 2.0)) < 0.002
        assert spot.yaw == pytest.approx(yaw, abs=0.02)
    with pytest.raises(NotSeen, match="tag 9 is not seen; tags in the picture: 3"):
        find_tagged_block(seen(renderer, mirror, CAMERAS["hand"], looking_at((0, 0, 0), 0.35, 0.05, 1.0)), number=9)


class Arm:
    """An arm whose camera is 0.1 m above its tool. `blind`: the numbers of the pictures in which nothing is seen."""

    name = "left"

    def __init__(self, renderer, mirror, empty, blind=()):
        self._renderer, self._mirrors, self._blind, self.places, self.looks = renderer, (mirror, empty), blind, [], 0

    def ik(self, position, orientation, seed):
        return position

    def move_to(self, angles):
        self.places.append(angles)
        return angles

    def look(self):
        x, y, z = self.places[-1]
        mirror = self._mirrors[self.looks in self._blind]
        self.looks += 1
        return seen(self._renderer, mirror, CAMERAS["hand"], looking_at((x, y, 0.0), z + 0.1, 0.0, 0.0))


@pytest.mark.parametrize("blind", [(), (0,), (1,), (0, 2)])
def test_an_arm_finds_the_tagged_block_though_a_picture_shows_none(renderer, tmp_path, blind):
    empty = world(tmp_path, (TABLE, np.eye(4)))
    arm = Arm(renderer, world(tmp_path, (TABLE, np.eye(4)), block_at(0.06, 0.04, 0.5)), empty, blind)
    spot = locate_tagged(arm, (0.0, 0.0), 0.0)
    assert math.dist((spot.x, spot.y), (0.06, 0.04)) < 0.003 and spot.yaw == pytest.approx(0.5, abs=0.03)


def coloured(name):
    path = Path(rospkg.RosPack().get_path("model_files")) / "models" / name / "model.sdf"
    return drawing_urdf(merge_fixed(parse_sdf_model(path.read_text(), str(path)).robot))


def test_coloured_blocks_are_found_by_thresholds(renderer, tmp_path):
    places = {"red": (0.1, 0.15), "green": (-0.1, 0.0), "blue": (0.05, -0.15), "yellow": (-0.05, 0.2)}
    half = vision_scene.COLOURED_M / 2.0
    mirror = world(tmp_path, (TABLE, np.eye(4)), *(
        (coloured(name + "_block"), pose_matrix((x, y, half), (0.0, 0.0, 0.2))) for name, (x, y) in places.items()))
    for pinhole in CAMERAS.values():
        view = seen(renderer, mirror, pinhole, looking_at((0, 0, 0), 0.9, 0.3, 0.4))
        for colour, place in places.items():
            (x, y, patch), = find_blocks(view, colour, 2.0 * half, 2.0 * half)
            # Its sides are seen, too.
            assert math.dist((x, y), place) < 0.02
            assert [patch] == find_patches(view.picture, colour)
            # As blocks of twice or half the size they have the wrong area.
            assert not find_blocks(view, colour, 4.0 * half, 2.0 * half)
            assert not find_blocks(view, colour, half, 2.0 * half)
    assert set(HUES) == set(places)
    with pytest.raises(ValueError, match="colour 'pink' is not known; expected one of red, "):
        find_patches(view.picture, "pink")


def test_the_table_is_the_plane_of_what_the_kinect_measures(renderer, tmp_path):
    pinhole = CAMERAS["kinect"]
    mirror = world(tmp_path, (TABLE, np.eye(4)), block_at(0.05, 0.05, 0.3))
    pose = looking_at((0.0, 0.0, 0.0), 0.9, 0.4, 0.3)
    _, depth = renderer.render(mirror, pinhole, pose, depth=True)
    depth = StructuredLight(pinhole, seed=1).measured(depth, 0.0)
    rows, columns = np.nonzero(np.isfinite(depth))
    z = depth[rows, columns]
    points = np.stack([(columns - pinhole.cx) / pinhole.fx * z, (rows - pinhole.cy) / pinhole.fy * z, z], axis=1)
    points = points @ pose[:3, :3].T + pose[:3, 3]
    points = points[(np.abs(points[:, :2]) < 0.3).all(axis=1)]
    plane = fit_plane(points, 0.008)
    assert abs(plane.distance) < 0.002 and math.degrees(math.acos(plane.normal[2])) < 0.5
    assert plane.inliers.mean() > 0.9
    standing = points[plane.height(points) > 0.025]
    assert np.median(standing, axis=0) == pytest.approx([0.05, 0.05, BLOCK_SIZE_M], abs=0.008)


def test_a_plane_does_not_lean_as_the_points_that_found_it():
    random = np.random.default_rng(2)
    worst = 0.0
    for seed in range(10):
        points = np.column_stack([random.uniform(-0.3, 0.3, (3000, 2)), random.normal(0.0, 0.004, 3000)])
        points[:150, 2] += random.uniform(0.0, 0.06, 150)  # something stands on it
        plane = fit_plane(points, 0.008, seed=seed)
        worst = max(worst, math.degrees(math.acos(plane.normal[2])))
    assert worst < 0.09


def test_points_without_a_plane_are_said():
    with pytest.raises(NoPlane, match="2 points are too few"):
        fit_plane(np.zeros((2, 3)), 0.01)
    with pytest.raises(NoPlane, match="no three of the 9 points span a plane"):
        fit_plane(np.outer(np.arange(9.0), (1.0, 2.0, 3.0)), 0.01)
