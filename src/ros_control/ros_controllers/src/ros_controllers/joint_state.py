# SPDX-License-Identifier: BSD-3-Clause
"""Publishes the joints of the robot."""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from sensor_msgs.msg import JointState

from controller_manager import JOINT_STATE, Controller
from sim_time.pace import Pace
from sim_time.stamps import stamp

if TYPE_CHECKING:
    from controller_manager import ControllerContext
    from controller_manager.hardware import RobotHardware

_COLUMNS = "position", "velocity", "effort"


class JointStateController(Controller):
    """sensor_msgs/JointState on ``joint_states`` in the robot's namespace.

    Parameters: ``publish_rate`` [Hz], required, 0 or less: never; ``joints``, default all, in alphabetical order;
    ``extra_joints``, a list of {name, position, velocity, effort} that never change, numbers default 0.
    """

    def __init__(self, name: str, hardware: RobotHardware, context: ControllerContext) -> None:
        super().__init__(name, hardware, context)
        rate = context.number("publish_rate", expected="the rate of /joint_states in Hz, e.g. 50")
        if rate <= 0.0:
            self.log.warn("parameter %s is %g: joint states are not published; give a rate above 0 Hz"
                          % (context.resolve("publish_rate"), rate))
        self.observe(JOINT_STATE)
        joints = sorted(hardware.joint_names)
        if context.param("joints") is not None:
            joints = context.texts("joints", "a list of joint names")
        self._index = hardware.index(JOINT_STATE, joints, context.namespace)
        extra = self._extra_joints(joints)
        self._names = joints + [row[0] for row in extra]
        self._extra = np.array([row[1:] for row in extra], dtype=float).reshape(len(extra), 3).T
        self._pace = Pace(rate) if rate > 0.0 else None
        self._publisher = context.publisher(context.in_root("joint_states"), JointState)

    def starting(self, time_s: float) -> None:
        # The first update publishes at once.
        if self._pace is not None:
            self._pace.restart()

    def update(self, time_s: float, dt: float) -> None:
        if self._pace is None or not self._pace.take(time_s) or not self._publisher.has_listeners:
            return
        hardware, index = self.hardware, self._index
        columns = [values[index].tolist() for values in (hardware.position, hardware.velocity, hardware.effort)]
        if self._extra.size:
            columns = [column + extra.tolist() for column, extra in zip(columns, self._extra, strict=True)]
        message = JointState(None, self._names, *columns)
        message.header.stamp = stamp(time_s)
        self._publisher.publish(message)

    def _extra_joints(self, known):
        """Rows (name, position, velocity, effort) of the parameter; wrong ones are left out with a warning."""
        parameter = self.context.resolve("extra_joints")
        given = self.context.param("extra_joints", [])
        if not isinstance(given, list):
            self.log.warn("parameter %s is %r, expected a list of {name, position, velocity, effort}; it is ignored"
                          % (parameter, given))
            return []
        rows = {}
        for row in given:
            flaw = _flaw(row, {*known, *rows})
            if flaw is None:
                rows[row["name"]] = [row.get(key, 0.0) for key in _COLUMNS]
            else:
                self.log.warn("parameter %s: %s; the entry is left out" % (parameter, flaw))
        return [(name, *values) for name, values in rows.items()]


def _flaw(row, known):
    """The fault of an entry of ``extra_joints``, or None."""
    if not isinstance(row, dict) or not isinstance(row.get("name"), str):
        return "%r is no {name, position, velocity, effort}" % (row,)
    if row["name"] in known:
        return "there is already a joint '%s'" % row["name"]
    values = [row.get(key, 0.0) for key in _COLUMNS]
    if any(isinstance(value, bool) or not isinstance(value, (int, float)) for value in values):
        return "joint '%s' has %r, expected numbers" % (row["name"], values)
    return None
