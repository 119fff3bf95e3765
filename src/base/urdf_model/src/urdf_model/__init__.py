# SPDX-License-Identifier: BSD-3-Clause
"""URDF robot descriptions as plain data: parse, validate, merge fixed links. Knows neither ROS nor a physics engine."""

from .bounds import OutOfBounds, check_robot
from .errors import UrdfError
from .files import check_file, description_text, read_file, read_text
from .gazebo_names import CollisionName, collision_names, gazebo_links
from .merge import MergedFrame, MergedLink, MergedRobot, SurfacePatch, merge_fixed
from .model import (
    Box,
    Cylinder,
    Finish,
    Gear,
    Inertial,
    Joint,
    Limit,
    Link,
    Loop,
    Mesh,
    Mimic,
    Plane,
    Robot,
    Shape,
    Sphere,
    Surface,
    Transmission,
)
from .parser import parse_urdf
from .writer import drawing_urdf
from .xml_text import XmlRefused, parse_xml, refuse_entities

__all__ = [
    "Box",
    "CollisionName",
    "Cylinder",
    "Finish",
    "Gear",
    "Inertial",
    "Joint",
    "Limit",
    "Link",
    "Loop",
    "MergedFrame",
    "MergedLink",
    "MergedRobot",
    "Mesh",
    "Mimic",
    "OutOfBounds",
    "SurfacePatch",
    "Plane",
    "Robot",
    "Shape",
    "Sphere",
    "Surface",
    "Transmission",
    "UrdfError",
    "XmlRefused",
    "check_file",
    "check_robot",
    "collision_names",
    "description_text",
    "drawing_urdf",
    "gazebo_links",
    "merge_fixed",
    "parse_urdf",
    "parse_xml",
    "read_file",
    "read_text",
    "refuse_entities",
]
