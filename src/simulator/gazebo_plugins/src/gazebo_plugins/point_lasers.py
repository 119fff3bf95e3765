# SPDX-License-Identifier: BSD-3-Clause
"""Lasers of several rows that publish points."""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from geometry_msgs.msg import Point32
from sensor_msgs.msg import ChannelFloat32, PointCloud, PointCloud2, PointField

from gazebo_ros.sensor_plugins import RaySensor

if TYPE_CHECKING:
    from gazebo_ros.model_plugin import PluginContext

# Field -> (its kind in messages, numpy's).
_FIELDS = {"x": (PointField.FLOAT32, "<f4"), "y": (PointField.FLOAT32, "<f4"), "z": (PointField.FLOAT32, "<f4"),
           "intensity": (PointField.FLOAT32, "<f4"), "ring": (PointField.UINT16, "<u2"),
           "time": (PointField.FLOAT32, "<f4")}
_POINT = np.dtype([(name, kind) for name, (_, kind) in _FIELDS.items()])
# Field -> where it begins. numpy's types allow for None, which plain numbers have for fields.
_OFFSETS = {name: place[1] for name, place in (_POINT.fields or {}).items()}


class BlockLaser(RaySensor):
    """``libgazebo_ros_block_laser.so``: sensor_msgs/PointCloud of all rays, row by row from the lowest, with
    intensities of 0. A ray that hits nothing is infinitely far. Element besides those of a laser: ``gaussianNoise``
    [m]."""

    message_class = PointCloud

    def __init__(self, context: PluginContext) -> None:
        super().__init__(context)
        self._noise = self.noise()

    def message(self, ranges: np.ndarray) -> PointCloud:
        with np.errstate(invalid="ignore"):  # 0 times infinity
            points = np.nan_to_num(ranges[:, None] * self.pattern.directions, nan=0.0, posinf=np.inf, neginf=-np.inf)
        if self._noise:
            points = points + self.context.world.random.normal(0.0, self._noise, points.shape)
        return PointCloud(points=[Point32(*point) for point in points.tolist()],
                          channels=[ChannelFloat32(values=[0.0] * len(points))])


class VelodyneLaser(RaySensor):
    """``libgazebo_ros_velodyne_laser.so`` and ``libgazebo_ros_velodyne_gpu_laser.so``: sensor_msgs/PointCloud2 of the
    rays that hit something, with ``ring`` (the row, from below), ``intensity`` and ``time`` of 0.

    Elements besides those of a laser: ``min_range`` (0), ``max_range`` (any) [m], ``gaussianNoise`` [m],
    ``organize_cloud`` (false; true: a row of the cloud for each ring, with NaN where nothing is hit).
    """

    message_class = PointCloud2

    def __init__(self, context: PluginContext) -> None:
        super().__init__(context)
        self._noise = self.noise()
        self._least = max(self.number("min_range", 0.0), self.pattern.range_min)
        self._most = min(self.number("max_range", self.pattern.range_max), self.pattern.range_max)
        self._organized = context.element_text("organize_cloud", "false").lower() in ("true", "1")
        self._points = np.zeros(len(self.pattern.directions), _POINT)
        self._points["ring"] = np.repeat(np.arange(self.pattern.rows), self.pattern.columns)
        self._fields = [PointField(name, _OFFSETS[name], kind, 1) for name, (kind, _) in _FIELDS.items()]

    def message(self, ranges: np.ndarray) -> PointCloud2:
        hit = (ranges > self._least) & (ranges < self._most)
        if self._noise:
            ranges = ranges + self.context.world.random.normal(0.0, self._noise, len(ranges))
        places = np.where(hit, ranges, np.nan)[:, None] * self.pattern.directions
        points = self._points.copy()
        points["x"], points["y"], points["z"] = places.T
        height, width = self.pattern.rows, self.pattern.columns
        if not self._organized:
            # As a turning scanner has them: column by column.
            points = points.reshape(height, width).T[hit.reshape(height, width).T]
            height, width = 1, len(points)
        return PointCloud2(height=height, width=width, fields=self._fields, point_step=_POINT.itemsize,
                           row_step=width * _POINT.itemsize, data=points.tobytes(), is_dense=not self._organized)
