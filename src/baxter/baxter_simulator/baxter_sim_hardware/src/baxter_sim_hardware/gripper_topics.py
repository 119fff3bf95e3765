# SPDX-License-Identifier: BSD-3-Clause
"""The grippers' ROS side: messages from and to `gripper.ElectricGripper`, and the drives of its fingers."""
import numpy as np
from baxter_core_msgs.msg import EndEffectorProperties, EndEffectorState

from baxter_sim_hardware.convert import stamp
from baxter_sim_hardware.errors import CommandRefused
from baxter_sim_hardware.gripper import ElectricGripper
from baxter_sim_hardware.sides import SIDES

ELECTRIC_ID = 65538
_ELECTRIC = EndEffectorProperties(
    id=ELECTRIC_ID, ui_type=EndEffectorProperties.ELECTRIC_GRIPPER, manufacturer="Rethink Research Robot",
    product="SDK End Effector", serial_number="3712199347", hardware_rev="2", firmware_rev="3.0.0 5.5",
    firmware_date="2014/7/24 18:30:00", has_calibration=True, controls_grip=True, senses_grip=True,
    controls_force=True, senses_force=True, controls_position=True, senses_position=True)
_NONE = EndEffectorProperties(ui_type=EndEffectorProperties.NO_GRIPPER)
_UNKNOWN = [EndEffectorState.STATE_UNKNOWN] * 8


class GripperTopics:
    """makers and takers: as in PanelTopics. openings: {finger joint: where it is open [m]}, which says what each side
    carries: two fingers or nothing; model: of bullet_sim; state: the robot's RobotState."""

    def __init__(self, model, openings, state, dt):
        self._state = state
        self._hands = {}
        for side in SIDES:
            names = [name for name in openings if name.startswith("%s_gripper_" % side[0])]
            if names:
                self._hands[side] = _Hand(model, names, np.array([openings[name] for name in names]), dt)
        self.makers = {"gripper_state": self._gripper_state, "gripper_properties": self._gripper_properties}
        self.takers = {"gripper_command": self._command}

    def update(self, joints):
        """One tick; joints: (position, velocity, effort) of the whole model."""
        for hand in self._hands.values():
            hand.update(joints)

    def stop(self):
        for hand in self._hands.values():
            hand.gripper.stop(hand.position())

    def reset(self):
        for hand in self._hands.values():
            hand.gripper.reset(hand.position())

    def _command(self, side, msg, time_s):
        if side not in self._hands:
            raise CommandRefused("the %s arm carries no gripper" % side)
        hand = self._hands[side]
        hand.gripper.take(msg.command, msg.args, msg.sender, msg.sequence, hand.position(), self._state.enabled)

    def _gripper_properties(self, time_s, side, snapshot):
        return _ELECTRIC if side in self._hands else _NONE

    def _gripper_state(self, time_s, side, snapshot):
        if side not in self._hands:
            return EndEffectorState(stamp(time_s), 0, *_UNKNOWN, 0.0, 0.0, "", "", "", 0)
        hand = self._hands[side]
        gripper, felt = hand.gripper, hand.feel((snapshot.position, snapshot.velocity, snapshot.effort))
        return EndEffectorState(
            stamp(time_s), ELECTRIC_ID, int(self._state.enabled), int(gripper.calibrated), 1, int(felt.moving),
            int(felt.gripping), int(felt.missed), 0, 0, felt.position, felt.force, "", gripper.command,
            gripper.sender, gripper.sequence)


class _Hand:
    """One gripper and its finger joints; `openings` (k,) [m], with the sign of each joint."""

    def __init__(self, model, names, openings, dt):
        self._model, self._index, self._openings = model, model.index(names), openings
        self._max_effort = model.max_effort[self._index]
        self.gripper = ElectricGripper(float(np.abs(openings).max()), self.position(), dt)

    def position(self):
        return self._share(self._model.read_joints()[0])

    def _share(self, values):
        return float((values[self._index] / self._openings).mean())

    def feel(self, joints):
        position, velocity, effort = joints
        force = 100.0 * float((np.abs(effort[self._index]) / self._max_effort).mean())
        return self.gripper.feel(self._share(position), self._share(velocity), force)

    def update(self, joints):
        if self.gripper.is_resting:
            return
        setpoint, force = self.gripper.update(self._share(joints[0]), self.feel(joints))
        self._model.drive_position(self._index, setpoint * self._openings, force / 100.0 * self._max_effort)
