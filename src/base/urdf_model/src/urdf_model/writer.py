# SPDX-License-Identifier: BSD-3-Clause
"""Write a merged robot as URDF text, for the renderer: bodies, joints, shapes and colours, nothing else."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

from lxml import etree

from .model import Box, Cylinder, Mesh, Plane, Sphere
from .transforms import pose_matrix, rpy_from_matrix

if TYPE_CHECKING:
    from .merge import MergedRobot

_SHEET_M = 0.002  # how thick a plane is drawn


def drawing_urdf(merged: MergedRobot) -> str:
    """Return URDF text whose bodies and movable joints are those of ``merged`` (a MergedRobot), in the same order.

    Planes become thin boxes that face the same way. Joint limits are left out: the renderer is given positions.
    """
    robot = etree.Element("robot", name=merged.name)
    for link in merged.links.values():
        element = etree.SubElement(robot, "link", name=link.name)
        for tag, shapes in (("visual", link.visuals), ("collision", link.collisions)):
            for shape in shapes:
                _add_shape(etree.SubElement(element, tag), shape)
    for joint in merged.joints.values():
        # A revolute joint without limits is a continuous one.
        kind = "continuous" if joint.type == "revolute" else joint.type
        element = etree.SubElement(robot, "joint", name=joint.name, type=kind)
        etree.SubElement(element, "parent", link=joint.parent)
        etree.SubElement(element, "child", link=joint.child)
        _add_origin(element, joint.origin)
        etree.SubElement(element, "axis", xyz=_words(joint.axis))
        if kind == "prismatic":
            etree.SubElement(element, "limit", lower="0", upper="0", effort="0", velocity="0")
    for body in merged.loose:
        element = etree.SubElement(robot, "joint", name="%s_loose" % body, type="floating")
        etree.SubElement(element, "parent", link=merged.root)
        etree.SubElement(element, "child", link=body)
    return etree.tostring(robot, encoding="unicode")


def _add_shape(element, shape):
    geometry, origin = shape.geometry, shape.origin
    if isinstance(geometry, Plane):
        origin = origin @ pose_matrix((0.0, 0.0, -_SHEET_M / 2.0))
        # A picture on a plane has x to the right, on the top of a box -y (Gazebo's MeshManager).
        origin = origin @ pose_matrix(rpy=(0.0, 0.0, math.pi / 2.0))
        width, height = geometry.size
        geometry = Box((height, width, _SHEET_M))
    _add_origin(element, origin)
    holder = etree.SubElement(element, "geometry")
    if isinstance(geometry, Box):
        etree.SubElement(holder, "box", size=_words(geometry.size))
    elif isinstance(geometry, Cylinder):
        etree.SubElement(holder, "cylinder", radius=_words([geometry.radius]), length=_words([geometry.length]))
    elif isinstance(geometry, Sphere):
        etree.SubElement(holder, "sphere", radius=_words([geometry.radius]))
    elif isinstance(geometry, Mesh):
        mesh = etree.SubElement(holder, "mesh", filename=geometry.filename, scale=_words(geometry.scale))
        if geometry.submesh:
            mesh.set("submesh", geometry.submesh)
            mesh.set("centred", str(geometry.centred).lower())
    if shape.colour is None and shape.finish is None:
        return
    material = etree.SubElement(element, "material", name="")
    if shape.colour is not None:
        etree.SubElement(material, "color", rgba=_words(shape.colour))
    if shape.finish is not None:
        _add_finish(material, shape.finish)


def _add_finish(material, finish):
    """Write a finish; for what URDF lacks, elements and attributes of our own, which ``parse_urdf`` reads."""
    if finish.texture:
        etree.SubElement(material, "texture", filename=finish.texture, repeats=_words(finish.repeats),
                         cut_out=str(finish.cut_out).lower(), two_sided=str(finish.two_sided).lower())
    if any(finish.emission):
        etree.SubElement(material, "emission", rgb=_words(finish.emission))
    if finish.gloss is not None:
        etree.SubElement(material, "gloss", value=_words([finish.gloss]))


def _add_origin(element, matrix):
    etree.SubElement(element, "origin", xyz=_words(matrix[:3, 3]), rpy=_words(rpy_from_matrix(matrix)))


def _words(values):
    # numpy 2 writes its own numbers as np.float64(0.1).
    return " ".join(repr(float(value)) for value in values)
