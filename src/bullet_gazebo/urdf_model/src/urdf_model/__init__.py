# SPDX-License-Identifier: BSD-3-Clause
"""URDF robot descriptions as plain data: parse, validate, merge fixed links. Knows neither ROS nor a physics engine."""

from .errors import UrdfError
from .merge import MergedFrame, MergedLink, MergedRobot, merge_fixed
from .model import (
    Box,
    Cylinder,
    Inertial,
    Joint,
    Limit,
    Link,
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

__all__ = [
    "Box",
    "Cylinder",
    "Inertial",
    "Joint",
    "Limit",
    "Link",
    "MergedFrame",
    "MergedLink",
    "MergedRobot",
    "Mesh",
    "Mimic",
    "Plane",
    "Robot",
    "Shape",
    "Sphere",
    "Surface",
    "Transmission",
    "UrdfError",
    "drawing_urdf",
    "merge_fixed",
    "parse_urdf",
]
