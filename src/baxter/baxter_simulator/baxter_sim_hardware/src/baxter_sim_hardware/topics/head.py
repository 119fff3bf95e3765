# SPDX-License-Identifier: BSD-3-Clause
"""The head's ROS side: messages from and to `head.Head`, and the drive of its joint."""
from baxter_core_msgs.msg import HeadPanCommand, HeadState

from baxter_model import HEAD_JOINT
from baxter_model.readiness import NOT_ENABLED
from baxter_sim_hardware.errors import CommandRefused
from baxter_sim_hardware.head import TURNING_SPEED, Head

_REQUESTS = {HeadPanCommand.REQUEST_PAN_ENABLE: True, HeadPanCommand.REQUEST_PAN_DISABLE: False}


class HeadTopics:
    """makers and takers: as in PanelTopics. model: of bullet_sim; state: the robot's RobotState."""

    def __init__(self, model, state, dt):
        self._model, self._state = model, state
        self._index = model.index([HEAD_JOINT])
        joint = self._index[0]
        self._head = Head(model.lower[joint], model.upper[joint], self._pan(), dt)
        self.makers = {"head_state": self._head_state}
        self.takers = {"command_head_pan": self._command_pan, "command_head_nod": self._command_nod}

    def _pan(self):
        return self._model.read_joints()[0][self._index[0]]

    def stop(self):
        """The robot was disabled: hold still."""
        self._head.stop(self._pan())

    def reset(self):
        """The joint was put elsewhere, or the world to its start."""
        self._head.reset(self._pan())

    def update(self):
        setpoint = self._head.update()
        if setpoint is not None:
            self._model.drive_position(self._index, setpoint[0], self._model.max_effort[self._index],
                                       velocity=setpoint[1])

    def _command_pan(self, part, msg, time_s):
        self._require_enabled()
        # A message of which only the target is set means: turn there. It disables nothing, although the request's
        # value for that is the 0 of a field that nobody set.
        request = msg.enable_pan_request if msg.speed_ratio else HeadPanCommand.REQUEST_PAN_VOID
        self._head.command_pan(msg.target, msg.speed_ratio, _REQUESTS.get(request))

    def _command_nod(self, part, msg, time_s):
        if msg.data:
            self._require_enabled()
            self._head.nod(time_s)

    def _require_enabled(self):
        if not self._state.enabled:
            raise CommandRefused(NOT_ENABLED)

    def _head_state(self, time_s, part, snapshot):
        joint = self._index[0]
        return HeadState(snapshot.position[joint], bool(abs(snapshot.velocity[joint]) > TURNING_SPEED),
                         self._head.is_nodding(time_s), self._head.pan_enabled)
