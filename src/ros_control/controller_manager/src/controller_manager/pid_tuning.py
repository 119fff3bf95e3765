# SPDX-License-Identifier: BSD-3-Clause
"""PIDs that users watch and tune at run time: dynamic_reconfigure for the gains, control_msgs/PidState."""
from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

import genpy
from control_msgs.msg import PidState

from controller_manager.controller import ControllerContext
from controller_manager.errors import ControllerError
from controller_manager.limits import Floats
from controller_manager.pid import Pid
from loop_ros.protocol import Topics
from loop_ros.reconfigure import Setting, SettingsServer
from sim_time.stamps import stamp

# Ranges of the settings: gains, and ends of the integral term.
_GAIN, _CLAMP = 1e5, 1e6


class TunablePids:
    """The joints of a :class:`controller_manager.pid.Pid` in the ROS graph, each under the name of its gains."""

    def __init__(self, topics: Topics, pid: Pid, names: Sequence[str], publishing: Collection[str] = ()) -> None:
        """``topics``: ``loop_ros.protocol.Topics``; ``names``: one of each joint's gains, such as
        ``"pid"`` or ``"gains/joint_1"``; ``publishing``: those of them that have a topic ``state``."""
        self._pid = pid
        gains = pid.gains
        for k, name in enumerate(names):
            SettingsServer(topics, name, [
                Setting("p", float(gains.p[k]), -_GAIN, _GAIN, "proportional gain"),
                Setting("i", float(gains.i[k]), -_GAIN, _GAIN, "integral gain"),
                Setting("d", float(gains.d[k]), -_GAIN, _GAIN, "derivative gain"),
                Setting("i_clamp_min", float(gains.i_min[k]), -_CLAMP, _CLAMP, "lower end of the integral term"),
                Setting("i_clamp_max", float(gains.i_max[k]), -_CLAMP, _CLAMP, "upper end of the integral term"),
                Setting("antiwindup", bool(gains.antiwindup[k]), meaning="bound the integral instead of its term"),
            ], lambda values, k=k: self._change(k, values))
        self._states = [(k, topics.publisher(name + "/state", PidState))
                        for k, name in enumerate(names) if name in publishing]

    @classmethod
    def of_controller(cls, context: ControllerContext, pid: Pid, names: Sequence[str]) -> TunablePids:
        """For a controller with gains under ``names``; the parameter ``publish_state`` beside the gains (false) selects
        the topics."""
        return cls(context, pid, names, [name for name in names if context.flag(name + "/publish_state", False)])

    def publish(self, time_s: float, dt: float, output: Floats) -> None:
        """After an update of the PID: publish its state. ``output`` (k,): its result."""
        for k, publisher in self._states:
            if publisher.has_listeners:
                publisher.publish(self._state(k, time_s, dt, output))

    # -- inside -------------------------------------------------------------------------------------------------

    def _change(self, k: int, values: dict[str, Any]) -> None:
        try:
            self._pid.change(k, values["p"], values["i"], values["d"], values["i_clamp_min"], values["i_clamp_max"],
                             values["antiwindup"])
        except ControllerError as error:
            raise ValueError(str(error)) from error

    def _state(self, k: int, time_s: float, dt: float, output: Floats) -> PidState:
        pid = self._pid
        error, error_dot = float(pid.last_error[k]), float(pid.last_error_dot[k])
        message = PidState()
        message.header.stamp = stamp(time_s)
        message.timestep = genpy.Duration(*divmod(round(dt * 1e9), 10**9))
        message.error, message.error_dot = error, error_dot
        message.p_error, message.i_error, message.d_error = error, float(pid.integral[k]), error_dot
        message.p_term, message.i_term, message.d_term = map(float, pid.terms(k))
        message.i_min, message.i_max = float(pid.gains.i_min[k]), float(pid.gains.i_max[k])
        message.output = float(output[k])
        return message
