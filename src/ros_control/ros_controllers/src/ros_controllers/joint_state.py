# SPDX-License-Identifier: BSD-3-Clause
"""Publishes the joints of the robot."""
import numpy as np
from sensor_msgs.msg import JointState

from controller_manager import JOINT_STATE, Controller, ControllerError
from sim_time.pace import Pace
from sim_time.stamps import stamp


class JointStateController(Controller):
    """sensor_msgs/JointState on ``joint_states`` in the robot's namespace.

    Parameters: ``publish_rate`` [Hz], required; ``joints``, default all, in alphabetical order; ``extra_joints``, a
    list of {name, position, velocity, effort} that never change, numbers default 0.
    """

    def __init__(self, name, hardware, context):
        super().__init__(name, hardware, context)
        rate = context.number("publish_rate", expected="the rate of /joint_states in Hz, e.g. 50")
        if rate <= 0.0:
            raise ControllerError("parameter %s is %g, expected a rate above 0 Hz"
                                  % (context.resolve("publish_rate"), rate))
        self.observe(JOINT_STATE)
        joints = sorted(hardware.joint_names)
        if context.param("joints") is not None:
            joints = context.texts("joints", "a list of joint names")
        self._index = hardware.index(JOINT_STATE, joints, context.namespace)
        extra = self._extra_joints()
        self._names = joints + [row[0] for row in extra]
        self._extra = np.array([row[1:] for row in extra], dtype=float).reshape(len(extra), 3).T
        self._pace = Pace(rate)
        self._publisher = context.publisher(context.in_root("joint_states"), JointState)

    def starting(self, time_s):
        # The first update publishes at once.
        self._pace.restart()

    def update(self, time_s, dt):
        if not self._pace.take(time_s) or not self._publisher.has_listeners:
            return
        hardware, index = self.hardware, self._index
        columns = [values[index].tolist() for values in (hardware.position, hardware.velocity, hardware.effort)]
        if self._extra.size:
            columns = [column + extra.tolist() for column, extra in zip(columns, self._extra, strict=True)]
        message = JointState(None, self._names, *columns)
        message.header.stamp = stamp(time_s)
        self._publisher.publish(message)

    def _extra_joints(self):
        rows = self.context.param("extra_joints", [])
        name = self.context.resolve("extra_joints")
        if not isinstance(rows, list):
            raise ControllerError("parameter %s is %r, expected a list of {name, position, velocity, effort}"
                                  % (name, rows))
        return [self._extra_joint(name, row) for row in rows]

    @staticmethod
    def _extra_joint(parameter, row):
        if not isinstance(row, dict) or not isinstance(row.get("name"), str):
            raise ControllerError("parameter %s has the entry %r, expected {name, position, velocity, effort}"
                                  % (parameter, row))
        values = [row.get(key, 0.0) for key in ("position", "velocity", "effort")]
        if any(isinstance(value, bool) or not isinstance(value, (int, float)) for value in values):
            raise ControllerError("parameter %s: joint '%s' has %r, expected numbers"
                                  % (parameter, row["name"], values))
        return (row["name"], *values)
