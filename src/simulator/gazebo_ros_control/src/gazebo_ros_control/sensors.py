# SPDX-License-Identifier: BSD-3-Clause
"""The sensors of a simulated model as hardware for controllers: IMUs on links, force and torque at joints. ROS-free."""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from controller_manager.interfaces import FORCE_TORQUE_SENSOR, IMU_SENSOR
from gazebo_plugins.joint_wrench import JointWrench
from urdf_model.transforms import pose_matrix, quaternion_from_matrix

if TYPE_CHECKING:
    from lxml import etree

    from bullet_sim import Model, World


class SimulatedImu:
    """Call ``read`` before each step: its result is that of the previous step. ``frame``: the link that it is on, at
    ``place`` (4, 4) in it."""

    def __init__(self, world: World, model: Model, link: str, place: np.ndarray) -> None:
        self._world, self._model, self.frame, self._place = world, model, link, place
        self._last = None

    def read(self) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
        """Quaternion (4,) in the world, turn rate (3,) [rad/s], and acceleration (3,) [m/s2] in its axes, gravity up
        at rest; None if it was not called at the previous step."""
        linear, angular = (np.asarray(part) for part in self._model.link_twist(self.frame))
        link = self._model.link_pose(self.frame).matrix()
        linear = linear + np.cross(angular, link[:3, :3] @ self._place[:3, 3])
        last, self._last = self._last, (self._world.steps, linear)
        if last is None or last[0] != self._world.steps - 1:
            return None
        axes = link[:3, :3] @ self._place[:3, :3]
        change = (linear - last[1]) / self._world.time_step_s - np.asarray(self._world.gravity)
        return quaternion_from_matrix(axes), axes.T @ angular, axes.T @ change


class SimulatedForceTorque:
    """As :class:`SimulatedImu`, of a joint; ``frame``: the link whose axes it measures in.

    ``sensor``: its element. ``<force_torque>`` may have ``<frame>``: child, parent or sensor (the child's, turned as
    its ``<pose>``), and ``<measure_direction>``: child_to_parent or parent_to_child.
    """

    def __init__(self, world: World, model: Model, joint: str, sensor: etree._Element) -> None:
        self._world, self._model, self._wrench = world, model, JointWrench(world, model, joint)
        self.frame = child = self._wrench.child
        self._turn = np.eye(3)  # from the child's axes
        self._axes = (sensor.findtext("force_torque/frame") or "child").strip()
        if self._axes == "parent":
            self.frame = model.robot.joints[joint].parent
        elif self._axes == "sensor":
            self._turn = sensor_place(sensor)[:3, :3].T
        direction = (sensor.findtext("force_torque/measure_direction") or "child_to_parent").strip()
        self._sign = -1.0 if direction == "parent_to_child" else 1.0
        self._child, self._noted = child, None

    def read(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Force (3,) [N] and torque (3,) [Nm] that the child exerts on the parent, or None."""
        found = self._wrench.measure() if self._noted == self._world.steps - 1 else None
        self._wrench.note()
        self._noted = self._world.steps
        if found is None:
            return None
        turn = self._turn
        if self._axes == "parent":
            parent, child = (self._model.link_pose(link).matrix()[:3, :3] for link in (self.frame, self._child))
            turn = parent.T @ child
        force, torque = found
        return self._sign * (turn @ force), self._sign * (turn @ torque)


def sensor_place(sensor: etree._Element) -> np.ndarray:
    """The pose (4, 4) of a ``<sensor>`` in its link; as in the link's frame where it gives none or no six numbers."""
    try:
        values = [float(word) for word in (sensor.findtext("pose") or "").split()]
    except ValueError:
        values = []
    return pose_matrix(values[:3], values[3:]) if len(values) == 6 and np.isfinite(values).all() else np.eye(4)


def simulated_sensors(world: World, model: Model) -> dict[str, dict[str, SimulatedImu | SimulatedForceTorque]]:
    """{interface: {sensor's name: sensor}} of the ``<sensor type="imu">`` on links and the ``<sensor
    type="force_torque">`` on joints of a description, by their names in the description."""
    found = {IMU_SENSOR: {}, FORCE_TORQUE_SENSOR: {}}
    for gazebo in model.robot.gazebo:
        where = gazebo.get("reference")
        for sensor in gazebo.findall("sensor"):
            name = sensor.get("name") or where
            if sensor.get("type") == "imu" and where in model.robot.links:
                found[IMU_SENSOR][name] = SimulatedImu(world, model, where, sensor_place(sensor))
            elif sensor.get("type") == "force_torque" and where in model.robot.joints:
                found[FORCE_TORQUE_SENSOR][name] = SimulatedForceTorque(world, model, where, sensor)
    return found
