# SPDX-License-Identifier: BSD-3-Clause
"""SDF models and worlds as plain data: each model becomes a ``urdf_model.Robot``. Knows neither ROS nor physics."""

from .document import SdfError
from .folders import ModelFolders, description_file
from .lights import Light, SceneLook, parse_light
from .model import SdfModel, parse_sdf_model
from .urdf_joints import add_loops
from .world import SdfWorld, parse_sdf_world

__all__ = [
    "Light",
    "ModelFolders",
    "SceneLook",
    "SdfError",
    "SdfModel",
    "SdfWorld",
    "add_loops",
    "description_file",
    "parse_light",
    "parse_sdf_model",
    "parse_sdf_world",
]
