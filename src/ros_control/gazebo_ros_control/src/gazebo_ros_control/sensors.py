# SPDX-License-Identifier: BSD-3-Clause
"""The sensors of a simulated model as hardware for controllers: IMUs on links, force and torque at joints. ROS-free."""
import numpy as np

from controller_manager.interfaces import FORCE_TORQUE_SENSOR, IMU_SENSOR
from gazebo_plugins.joint_wrench import JointWrench
from urdf_model.transforms import quaternion_from_matrix


class SimulatedImu:
    """Call ``read`` before each step: its result is that of the previous step. ``frame``: the link that it is on."""

    def __init__(self, world, model, link):
        self._world, self._model, self.frame = world, model, link
        self._last = None

    def read(self):
        """Quaternion (4,) in the world, turn rate (3,) [rad/s] and acceleration (3,) [m/s2] in the link's axes, gravity
        upwards at rest; None if it was not called at the previous step."""
        linear, angular = (np.asarray(part) for part in self._model.link_twist(self.frame))
        last, self._last = self._last, (self._world.steps, linear)
        if last is None or last[0] != self._world.steps - 1:
            return None
        axes = self._model.link_pose(self.frame).matrix()[:3, :3]
        change = (linear - last[1]) / self._world.time_step_s - np.asarray(self._world.gravity)
        return quaternion_from_matrix(axes), axes.T @ angular, axes.T @ change


class SimulatedForceTorque:
    """As :class:`SimulatedImu`, of a joint; ``frame``: the link behind it."""

    def __init__(self, world, model, joint):
        self._world, self._wrench = world, JointWrench(world, model, joint)
        self.frame = self._wrench.child
        self._noted = None

    def read(self):
        """Force (3,) [N] and torque (3,) [Nm] that the child exerts on the parent, in the child's axes, or None."""
        found = self._wrench.measure() if self._noted == self._world.steps - 1 else None
        self._wrench.note()
        self._noted = self._world.steps
        return found


def simulated_sensors(world, model):
    """{interface: {sensor's name: sensor}} of the ``<sensor type="imu">`` on links and the ``<sensor
    type="force_torque">`` on joints of a description, by their names in the description."""
    found = {IMU_SENSOR: {}, FORCE_TORQUE_SENSOR: {}}
    for gazebo in model.robot.gazebo:
        where = gazebo.get("reference")
        for sensor in gazebo.findall("sensor"):
            name = sensor.get("name") or where
            if sensor.get("type") == "imu" and where in model.robot.links:
                found[IMU_SENSOR][name] = SimulatedImu(world, model, where)
            elif sensor.get("type") == "force_torque" and where in model.robot.joints:
                found[FORCE_TORQUE_SENSOR][name] = SimulatedForceTorque(world, model, where)
    return found
