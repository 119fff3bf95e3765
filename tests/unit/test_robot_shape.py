# SPDX-License-Identifier: BSD-3-Clause
"""Baxter as cameras see it, compared with the vendor's meshes at full resolution."""
from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numba
import numpy as np
import pytest
import rospkg

import xacro
from bullet_sim.mesh_loading import load_scene
from model_files.resources import ResourceFinder
from sensor_renderer import triangles
from sensor_renderer.gl_renderer import GlRenderer
from sensor_renderer.light import SceneLight
from sensor_renderer.mirror import DrawnModel, Mirror
from sensor_renderer.pinhole import OPTICAL, Pinhole
from urdf_model import Mesh, merge_fixed, parse_urdf
from urdf_model.transforms import inverse, pose_matrix
from world_picture.drawing import DrawingCache

VIEWS = 40
NEAR_M, CLOSE_M = 0.05, 0.003
# Pixels of a hole, of the robot and of a link that fills the picture, where a pixel is half a millimetre.
MAX_HOLE = 2
# The colour of the background, which no link has.
NOWHERE = (0, 255, 0)
PINHOLE = Pinhole.from_field_of_view(640, 400, 1.0, NEAR_M, 100.0)
BASE = (0.0, 0.0, 0.93, 0.0, 0.0, 0.0, 1.0)


@numba.njit
def depth_of(corners, fx, fy, cx, cy, depth):
    """Fill ``depth`` (height, width) [m], inf where nothing is: of triangles (n, 3, 3) [m] in the optical frame, at the
    centre of each pixel."""
    depth[:] = np.inf
    height, width = depth.shape
    for (x0, y0, z0), (x1, y1, z1), (x2, y2, z2) in corners:
        if min(z0, z1, z2) < NEAR_M:
            continue
        u0, u1, u2 = fx * x0 / z0 + cx, fx * x1 / z1 + cx, fx * x2 / z2 + cx
        v0, v1, v2 = fy * y0 / z0 + cy, fy * y1 / z1 + cy, fy * y2 / z2 + cy
        area = (u1 - u0) * (v2 - v0) - (u2 - u0) * (v1 - v0)
        if area == 0.0:
            continue
        for v in range(max(0, int(np.ceil(min(v0, v1, v2)))), min(height - 1, int(np.floor(max(v0, v1, v2)))) + 1):
            for u in range(max(0, int(np.ceil(min(u0, u1, u2)))), min(width - 1, int(np.floor(max(u0, u1, u2)))) + 1):
                a = ((u1 - u) * (v2 - v) - (u2 - u) * (v1 - v)) / area
                b = ((u2 - u) * (v0 - v) - (u0 - u) * (v2 - v)) / area
                if a >= 0.0 and b >= 0.0 and a + b <= 1.0:
                    depth[v, u] = min(depth[v, u], 1.0 / (a / z0 + b / z1 + (1.0 - a - b) / z2))


def full_triangles(links, finder):
    """Triangles (n, 3, 3) [m] of each link in its frame, as the vendor's files have them."""
    found = []
    for link in links:
        rows = [np.zeros((0, 3, 3))]
        for shape in link.visuals:
            if isinstance(shape.geometry, Mesh):
                path = finder(shape.geometry.filename)
                if path is None:
                    pytest.skip("%s is missing; ./baxter.sh setup fetches it" % shape.geometry.filename)
                mesh = np.asarray(load_scene(path).to_geometry().triangles) * shape.geometry.scale
            else:
                mesh = triangles.of_primitive(shape.geometry)[:, :3].reshape(-1, 3, 3)
            rows.append(mesh @ shape.origin[:3, :3].T + shape.origin[:3, 3])
        found.append(np.concatenate(rows))
    return found


def views(random, number, middle, nearest_m, farthest_m):
    """``number`` optical poses (4, 4) around ``middle`` (3,) [m] that look at it."""
    for count in range(number):
        azimuth, elevation, away = 2.4 * count, random.uniform(-0.3, 0.9), random.uniform(nearest_m, farthest_m)
        towards = pose_matrix(middle, (0.0, elevation, azimuth))
        yield towards @ pose_matrix((-away, 0.0, 0.0), (0.0, 0.0, 0.0)) @ OPTICAL


@dataclass
class Alone:
    """A world of the same bodies for ever, for the renderer."""

    bodies: dict
    light: SceneLight
    version: int = 0


class Robot(NamedTuple):
    """The simplified robot, and triangles (n, 3, 3) [m] of each of its links as the vendor's files have them."""

    mirror: Mirror
    joints: list
    links: list
    renderer: GlRenderer

    @property
    def body(self):
        return self.mirror.bodies["robot"]


@pytest.fixture(scope="module")
def robot():
    path = rospkg.RosPack().get_path("baxter_description") + "/urdf/baxter.urdf.xacro"
    xml = xacro.process_file(path).toxml()
    merged, finder = merge_fixed(parse_urdf(xml, source=path)), ResourceFinder()
    joints = [joint.name for joint in merged.joints.values()]
    mirror = Mirror(DrawingCache(), finder, pytest.fail)
    mirror.set_scene([{"name": "robot", "urdf": xml, "joints": joints}], {"background": [c / 255.0 for c in NOWHERE]})
    links = full_triangles([merged.links[name] for name in mirror.bodies["robot"].link_names], finder)
    renderer = GlRenderer()
    yield Robot(mirror, joints, links, renderer)
    renderer.close()


def largest_hole(true, drawn):
    """Pixels of the largest connected hole: where nothing is drawn, and the reference has a surface there and at all
    eight pixels around."""
    covered = np.pad(np.isfinite(true), 1)
    for axis in (0, 1):
        covered = covered & np.roll(covered, 1, axis) & np.roll(covered, -1, axis)
    holes = (covered[1:-1, 1:-1] & ~np.isfinite(drawn)).astype(np.uint8)
    _, _, statistics, _ = cv2.connectedComponentsWithStats(holes, connectivity=8)
    return max(statistics[1:, cv2.CC_STAT_AREA], default=0)


def compared(mirror, renderer, placed, pose):
    """(overlap of the silhouettes, the same of the picture of colour, share of the pixels of both whose depth is close,
    pixels of the largest hole) of a view of ``mirror`` against triangles ``placed`` (n, 3, 3) in the optical frame."""
    drawn = renderer.render(mirror, PINHOLE, pose, colour=False, depth=True)[1]
    coloured = (renderer.render(mirror, PINHOLE, pose)[0] != NOWHERE).any(axis=2)
    true = np.empty((PINHOLE.height, PINHOLE.width))
    depth_of(placed, PINHOLE.fx, PINHOLE.fy, PINHOLE.cx, PINHOLE.cy, true)
    there, seen = np.isfinite(true), np.isfinite(drawn)
    return (overlap(there, seen), overlap(there, coloured), (np.abs(true - drawn)[there & seen] < CLOSE_M).mean(),
            largest_hole(true, drawn))


def overlap(there, seen):
    """Pixels of both masks as a share of those of either."""
    return (there & seen).sum() / (there | seen).sum()


def turned(matrix, triangles):
    return np.einsum("ij,nkj->nki", matrix[:3, :3], triangles) + matrix[:3, 3]


def judge(name, results):
    outline, coloured, close, hole = np.array(results).T
    print("%-28s overlap %.4f, least %.4f, in colour %.4f, %.4f; depth %.4f, least %.4f; largest hole %d"
          % (name, outline.mean(), outline.min(), coloured.mean(), coloured.min(), close.mean(), close.min(),
             hole.max()))
    assert outline.min() >= 0.99, name
    assert coloured.min() >= 0.99, name
    assert close.min() >= 0.99, name
    assert hole.max() <= MAX_HOLE, name


def whole_robot(robot, number):
    random, results = np.random.default_rng(1), []
    for pose in views(random, number, (0.0, 0.0, 0.9), 1.6, 3.0):
        angles = [0.0 if "finger" in name else angle
                  for name, angle in zip(robot.joints, random.uniform(-1.0, 1.0, len(robot.joints)), strict=True)]
        robot.mirror.set_state(np.array([*BASE, *angles]))
        placed = [turned(matrix, mesh)
                  for mesh, matrix in zip(robot.links, inverse(pose) @ robot.body.matrices, strict=True)]
        results.append(compared(robot.mirror, robot.renderer, np.concatenate(placed), pose))
    judge("robot", results)


def link_alone(robot, name, parts, full, number, only=None):
    """The result of `compared` for ``number`` views of a link, or ``only`` of those numbers."""
    alone = Alone({"link": DrawnModel([(name, parts)], [])}, robot.mirror.light)
    low, high = full.min(axis=(0, 1)), full.max(axis=(0, 1))
    away = np.linalg.norm(high - low)
    poses = views(np.random.default_rng(2), number, (low + high) / 2.0, 1.1 * away, 1.6 * away)
    for count, pose in enumerate(poses):
        if only is None or count in only:
            yield compared(alone, robot.renderer, turned(inverse(pose), full), pose)


def each_link(robot, number):
    """Each link by itself, as large in the picture as the picture allows. A link of both arms is looked at once."""
    seen, failed = set(), []
    for name, parts, full in zip(robot.body.link_names, robot.body.parts, robot.links, strict=True):
        key = tuple(part.key for part in parts)
        if not parts or key in seen:
            continue
        seen.add(key)
        try:
            judge(name, list(link_alone(robot, name, parts, full, number)))
        except AssertionError as error:
            failed.append(str(error).splitlines()[0])
    assert not failed


def test_silhouette_and_depth(robot):
    whole_robot(robot, 2)


def test_silhouette_and_depth_of_each_link(robot):
    each_link(robot, 2)


@pytest.mark.parametrize("name, only", [("left_upper_forearm", (8, 21, 26)), ("left_wrist", (4,))])
def test_parts_of_different_colours_show_no_cracks_between_them(robot, name, only):
    number = robot.body.link_names.index(name)
    results = link_alone(robot, name, robot.body.parts[number], robot.links[number], VIEWS, only)
    judge(name, list(results))


@pytest.mark.long
def test_silhouette_and_depth_from_forty_views(robot):
    whole_robot(robot, VIEWS)


@pytest.mark.long
def test_silhouette_and_depth_of_each_link_from_forty_views(robot):
    each_link(robot, VIEWS)
