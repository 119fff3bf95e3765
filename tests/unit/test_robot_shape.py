# SPDX-License-Identifier: BSD-3-Clause
"""Baxter as cameras see it, compared with the vendor's meshes at full resolution."""
import numba
import numpy as np
import pytest
import rospkg

import xacro
from bullet_sim.mesh_loading import load_scene
from model_files.resources import ResourceFinder
from sensor_renderer import triangles
from sensor_renderer.gl_renderer import GlRenderer
from sensor_renderer.mirror import Mirror
from sensor_renderer.pinhole import OPTICAL, Pinhole
from urdf_model import Mesh, merge_fixed, parse_urdf
from urdf_model.transforms import inverse, pose_matrix
from world_picture.drawing import DrawingCache

VIEWS = 40
NEAR_M, CLOSE_M = 0.05, 0.003
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


def views(random):
    """Optical poses (4, 4) around the robot, that look at its middle."""
    for number in range(VIEWS):
        azimuth, elevation, away = 2.4 * number, random.uniform(-0.3, 0.9), random.uniform(1.6, 3.0)
        towards = pose_matrix((0.0, 0.0, 0.9), (0.0, elevation, azimuth))
        yield towards @ pose_matrix((-away, 0.0, 0.0), (0.0, 0.0, 0.0)) @ OPTICAL


@pytest.mark.long
def test_silhouette_and_depth_from_forty_views():
    path = rospkg.RosPack().get_path("baxter_description") + "/urdf/baxter.urdf.xacro"
    xml = xacro.process_file(path).toxml()
    merged, finder = merge_fixed(parse_urdf(xml, source=path)), ResourceFinder()
    joints = [joint.name for joint in merged.joints.values()]
    mirror = Mirror(DrawingCache(), finder, pytest.fail)
    mirror.set_scene([{"name": "robot", "urdf": xml, "joints": joints}])
    body, renderer, random = mirror.bodies["robot"], GlRenderer(), np.random.default_rng(1)
    links = full_triangles([merged.links[name] for name in body.link_names], finder)
    overlaps, close = [], []
    true = np.empty((PINHOLE.height, PINHOLE.width))
    for pose in views(random):
        angles = [0.0 if "finger" in name else angle
                  for name, angle in zip(joints, random.uniform(-1.0, 1.0, len(joints)), strict=True)]
        mirror.set_state(np.array([*BASE, *angles]))
        drawn = renderer.render(mirror, PINHOLE, pose, colour=False, depth=True)[1]
        placed = [np.einsum("ij,nkj->nki", matrix[:3, :3], mesh) + matrix[:3, 3]
                  for mesh, matrix in zip(links, inverse(pose) @ body.matrices, strict=True)]
        depth_of(np.concatenate(placed), PINHOLE.fx, PINHOLE.fy, PINHOLE.cx, PINHOLE.cy, true)
        there, seen = np.isfinite(true), np.isfinite(drawn)
        overlaps.append((there & seen).sum() / (there | seen).sum())
        close.append((np.abs(true - drawn)[there & seen] < CLOSE_M).mean())
    renderer.close()
    print("overlap %.4f, least %.4f; depth %.4f, least %.4f"
          % (np.mean(overlaps), min(overlaps), np.mean(close), min(close)))
    assert np.mean(overlaps) >= 0.99 and min(overlaps) >= 0.98
    assert np.mean(close) >= 0.90 and min(close) >= 0.84
