# SPDX-License-Identifier: BSD-3-Clause
"""The head's ROS side: messages from and to `head.HeadHardware`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from baxter_core_msgs.msg import HeadPanCommand, HeadState

from baxter_sim_hardware.head import TURNING_SPEED

from . import convert
from .row import STATE_RATE_HZ, RobotPart, TopicRow

if TYPE_CHECKING:
    from control_msgs.msg import JointControllerState
    from std_msgs.msg import Bool, Float64

    from baxter_sim_hardware.head import PanDrive
    from baxter_sim_hardware.robot_state import RobotState
    from baxter_sim_hardware.snapshot import JointSnapshot

_REQUESTS = {HeadPanCommand.REQUEST_PAN_ENABLE: True, HeadPanCommand.REQUEST_PAN_DISABLE: False}


class HeadTopics(RobotPart):
    """drive: `head.PanDrive`; state: the robot's RobotState; dt: length of a tick [s]."""

    def __init__(self, drive: PanDrive, state: RobotState, dt: float) -> None:
        self._head, self._joint, self._state, self._dt = drive.head, drive.joint, state, dt

    def _command_pan(self, component: None, msg: HeadPanCommand, time_s: float) -> None:
        self._state.require_enabled()
        # A message with only the target set means: turn there. It does not disable panning, although the unset field's
        # 0 is the value of that request.
        request = msg.enable_pan_request if msg.speed_ratio else HeadPanCommand.REQUEST_PAN_VOID
        self._head.command_pan(msg.target, msg.speed_ratio, _REQUESTS.get(request))

    def _command_position(self, component: None, msg: Float64, time_s: float) -> None:
        self._state.require_enabled()
        self._head.command_pan(msg.data, 0.0, None)

    def _command_nod(self, component: None, msg: Bool, time_s: float) -> None:
        if msg.data:
            self._state.require_enabled()
            self._head.nod(time_s)

    def _head_state(self, time_s: float, component: None, snapshot: JointSnapshot) -> HeadState:
        joint = self._joint
        return HeadState(snapshot.position[joint], bool(abs(snapshot.velocity[joint]) > TURNING_SPEED),
                         self._head.is_nodding(time_s), self._head.pan_enabled)

    def _controller_state(self, time_s: float, component: None, snapshot: JointSnapshot) -> JointControllerState:
        joint = self._joint
        return convert.joint_controller_state(
            time_s, self._head.commanded_position, snapshot.position[joint], snapshot.effort[joint], self._dt)

    TOPICS = (
        TopicRow("head_state", "head/head_state", "baxter_core_msgs/HeadState", STATE_RATE_HZ, _head_state,
                 "pan [rad], turning, nodding, panning enabled"),
        TopicRow("command_head_pan", "head/command_head_pan", "baxter_core_msgs/HeadPanCommand", None, _command_pan,
                 "target [rad]; speed ratio of 8.4 rad/s, where 0 means full speed; enable request"),
        TopicRow("command_head_nod", "head/command_head_nod", "std_msgs/Bool", None, _command_nod,
                 "true begins a nod of 1 s"),
        TopicRow("head_position_controller", "head_position_controller/joints/head_controller/command",
                 "std_msgs/Float64",
                 None, _command_position, "pan [rad] at full speed: for programs made for the vendor's simulator"),
        TopicRow("head_position_controller_state", "head_position_controller/joints/head_controller/state",
                 "control_msgs/JointControllerState", STATE_RATE_HZ, _controller_state,
                 "set-point, measured value, error [rad] and effort [Nm]; gains are 0: for programs made for the "
                 "vendor's simulator"),
    )
