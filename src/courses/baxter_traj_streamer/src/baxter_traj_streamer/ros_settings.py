# SPDX-License-Identifier: BSD-3-Clause
"""Reads settings and joint limits from files and the parameter server."""
from __future__ import annotations

import pathlib
from typing import Any

import rospkg
import rospy
import yaml

import urdf_model

from .judging import KNOWN_JOINTS, StreamedJointLimit
from .settings import StreamerSettings, StreamerSettingsError

# Parameters of this name override config/streamer.yaml.
NAMESPACE = "/baxter_traj_streamer"


def read_settings(changes: str | None = None) -> StreamerSettings:
    """Settings from config/streamer.yaml; ``changes``, another file there, and the parameters below NAMESPACE override
    it. Raises StreamerSettingsError."""
    parameters = rospy.get_param(NAMESPACE, {})
    if not isinstance(parameters, dict):
        raise StreamerSettingsError("the parameter %s is %r; expected settings by their names" % (NAMESPACE,
                                                                                                  parameters))
    return StreamerSettings(_read("streamer.yaml"), {**(_read(changes) if changes else {}), **parameters})


def _read(name: str) -> dict[str, Any]:
    path = pathlib.Path(rospkg.RosPack().get_path("baxter_traj_streamer")) / "config" / name
    settings: Any = yaml.safe_load(path.read_text(encoding="utf-8"))
    return settings


def read_limits() -> dict[str, StreamedJointLimit]:
    """{joint: StreamedJointLimit} of both arms, from robot_description. Raises StreamerSettingsError,
    urdf_model.UrdfError."""
    if not rospy.has_param("robot_description"):
        raise StreamerSettingsError("the parameter robot_description is not set; the joints' limits are read from its "
                                    "URDF")
    joints = urdf_model.parse_urdf(str(rospy.get_param("robot_description")), source="robot_description").joints
    found = {name: joints[name].limit for name in KNOWN_JOINTS if name in joints}
    return {name: StreamedJointLimit(limit.lower, limit.upper, limit.velocity) for name, limit in found.items()
            if limit.lower is not None and limit.upper is not None and limit.velocity is not None}
