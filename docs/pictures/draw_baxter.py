#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Draw Baxter as the README shows it: the model's own meshes, coarsened, as polygons of an SVG file.

./baxter.sh sim docs/pictures/draw_baxter.py >docs/pictures/baxter.svg
"""

import sys

import numpy as np
import rospkg
import trimesh

import xacro
from baxter_model import joint_names, poses
from urdf_model import Box, Cylinder, Mesh, Sphere, parse_urdf
from urdf_model.transforms import axis_rotation, rigid

SIZE = 720  # [px]
GRID = 0.017  # [m] vertices within one cell become one
LEAST_PIXELS = 2  # a polygon of which less shows is left out
EYE, TARGET, UP = np.array([3.2, 1.5, 0.9]), np.array([0.12, 0.05, 0.0]), np.array([0.0, 0.0, 1.0])
LIGHT = np.array([0.75, 0.3, 0.6]) / np.linalg.norm([0.75, 0.3, 0.6])
LAB_POSE = (-1.0051, -1.0358, -0.3310, 1.7034, 0.3051, 0.8611, -1.4742)  # of the left arm


def link_frames(robot):
    """4x4 pose of every link in base."""
    angles = {**dict(zip(joint_names("left"), LAB_POSE, strict=True)), **poses().angles("untucked", "right")}
    frames, links = {robot.root: np.eye(4)}, [robot.root]
    while links:
        parent = links.pop()
        for joint in robot.children(parent):
            value = angles.get(joint.name, 0.0)
            if joint.type == "prismatic":
                motion = rigid(np.eye(3), joint.axis * value)
            else:
                motion = rigid(axis_rotation(joint.axis, value), np.zeros(3))
            frames[joint.child] = frames[parent] @ joint.origin @ motion
            links.append(joint.child)
    return frames


def mesh_of(geometry, rospack):
    if isinstance(geometry, Mesh):
        package, _, path = geometry.filename[len("package://") :].partition("/")
        scene = trimesh.load(f"{rospack.get_path(package)}/{path}", force="scene")
        mesh = scene.to_geometry()
        mesh.apply_scale(geometry.scale)
        return mesh
    if isinstance(geometry, Box):
        return trimesh.creation.box(geometry.size)
    if isinstance(geometry, Cylinder):
        return trimesh.creation.cylinder(geometry.radius, geometry.length, sections=20)
    if isinstance(geometry, Sphere):
        return trimesh.creation.icosphere(2, geometry.radius)
    raise TypeError(geometry)


def coarsened(vertices, faces):
    """Merge all vertices within a grid cell into their mean; drop the triangles that vanish."""
    cells, index = np.unique(np.round(vertices / GRID).astype(int), axis=0, return_inverse=True)
    index = index.ravel()
    merged = np.zeros((len(cells), 3))
    np.add.at(merged, index, vertices)
    merged /= np.bincount(index)[:, None]
    faces = index[faces]
    solid = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    _, first = np.unique(np.sort(faces[solid], axis=1), axis=0, return_index=True)
    return merged, faces[solid][first]


def camera():
    ahead = (TARGET - EYE) / np.linalg.norm(TARGET - EYE)
    right = np.cross(ahead, UP)
    right /= np.linalg.norm(right)
    return np.array([right, np.cross(ahead, right), ahead])


def visible(polygons):
    """Those of the polygons, given from back to front, of which something is left when all are painted."""
    canvas = np.zeros((SIZE, SIZE), dtype=int)
    for number, (_, points, _) in enumerate(polygons, start=1):
        low = np.clip(np.floor(points.min(axis=0)).astype(int), 0, SIZE)
        high = np.clip(np.ceil(points.max(axis=0)).astype(int) + 1, 0, SIZE)
        x, y = np.meshgrid(np.arange(low[0], high[0]) + 0.5, np.arange(low[1], high[1]) + 0.5)
        sides = []
        for (ax, ay), (bx, by) in zip(points, np.roll(points, -1, axis=0), strict=True):
            sides.append((bx - ax) * (y - ay) - (by - ay) * (x - ax))
        inside = (np.min(sides, axis=0) >= 0.0) | (np.max(sides, axis=0) <= 0.0)
        canvas[low[1] : high[1], low[0] : high[0]][inside] = number
    left = np.bincount(canvas.ravel(), minlength=len(polygons) + 1)[1:]
    return [polygon for polygon, pixels in zip(polygons, left, strict=True) if pixels >= LEAST_PIXELS]


def main():
    rospack = rospkg.RosPack()
    source = rospack.get_path("baxter_description") + "/urdf/baxter.urdf.xacro"
    robot = parse_urdf(xacro.process_file(source).toxml(), source)
    frames, view = link_frames(robot), camera()
    polygons = []
    for name, link in robot.links.items():
        for shape in link.visuals:
            mesh = mesh_of(shape.geometry, rospack)
            pose = frames[name] @ shape.origin
            vertices, faces = coarsened(mesh.vertices @ pose[:3, :3].T + pose[:3, 3], mesh.faces)
            colour = np.array((shape.colour or (0.5, 0.1, 0.1, 1.0))[:3])
            corners = vertices[faces]
            normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
            area = np.linalg.norm(normals, axis=1)
            for points, normal, size in zip(corners, normals, area, strict=True):
                if size < 1e-9:
                    continue
                if normal @ (points[0] - EYE) > 0.0:
                    normal = -normal  # seen from inside: coarse shells have holes
                seen = (points - EYE) @ view.T
                bright = 0.45 + 0.55 * max(0.0, normal @ LIGHT / size)
                drawn = 1.55 * SIZE * seen[:, :2] / seen[:, 2:] + SIZE / 2
                polygons.append((seen[:, 2].mean(), drawn, colour * bright))
    polygons.sort(key=lambda polygon: -polygon[0])
    polygons = visible(polygons)
    out = sys.stdout
    out.write(f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {SIZE} {SIZE}">\n')
    out.write(f'<title>Baxter</title><rect width="{SIZE}" height="{SIZE}" fill="#f4f4f2"/>\n')
    out.write('<g fill="currentColor" stroke="currentColor" stroke-linejoin="round">\n')
    for _, points, colour in polygons:
        shade = "#%02x%02x%02x" % tuple(int(255 * min(1.0, channel)) for channel in colour)
        x = np.round(points).astype(int)
        steps = np.diff(x, axis=0).ravel()
        out.write("<path d='M%d %dl%d %d %d %dz' color='%s'/>\n" % (*x[0], *steps, shade))
    out.write("</g>\n</svg>\n")


if __name__ == "__main__":
    main()
