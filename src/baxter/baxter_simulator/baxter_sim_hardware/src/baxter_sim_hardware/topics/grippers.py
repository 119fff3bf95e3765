# SPDX-License-Identifier: BSD-3-Clause
"""The grippers' ROS side: messages from and to the hands, and a client's description of a custom tool."""

from __future__ import annotations

import copy
from functools import partial
from typing import TYPE_CHECKING

from baxter_core_msgs.msg import EndEffectorProperties, EndEffectorState

from baxter_model import CUSTOM, ELECTRIC, SUCTION
from baxter_sim_hardware.errors import CommandRefused
from baxter_sim_hardware.grippers.commands import CustomGripperHardware
from baxter_sim_hardware.grippers.electric import ElectricGripperHardware
from baxter_sim_hardware.grippers.hands import NoHand
from baxter_sim_hardware.grippers.suction import SuctionGripperHardware
from baxter_sim_hardware.sensing.panel import BLOWERS, PUMPS, VACUUM_SENSORS
from sim_time.stamps import stamp

from .row import STATE_RATE_HZ, RobotPart, TopicRow

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from baxter_core_msgs.msg import EndEffectorCommand

    from baxter_sim_hardware.grippers.hands import CupHand, FingersHand
    from baxter_sim_hardware.robot_state import RobotState
    from baxter_sim_hardware.snapshot import JointSnapshot

    from .panel import PanelTopics

_made = partial(EndEffectorProperties, manufacturer="Rethink Research Robot", product="SDK End Effector")
_PROPERTIES = {
    ElectricGripperHardware: _made(
        id=ELECTRIC.id, ui_type=ELECTRIC.ui_type, serial_number="3712199347", hardware_rev="2",
        firmware_rev="3.0.0 5.5", firmware_date="2014/7/24 18:30:00", has_calibration=True, controls_grip=True,
        senses_grip=True, controls_force=True, senses_force=True, controls_position=True, senses_position=True),
    SuctionGripperHardware: _made(id=SUCTION.id, ui_type=SUCTION.ui_type, controls_grip=True, senses_grip=True),
    # A bare arm: the robot reports a passive tool there.
    CustomGripperHardware: _made(id=CUSTOM.id, ui_type=CUSTOM.ui_type),
}
_FLAGS = ("enabled", "calibrated", "ready", "moving", "gripping", "missed", "error", "reverse")
_UNKNOWN = dict.fromkeys(_FLAGS, EndEffectorState.STATE_UNKNOWN)

# Largest total length of the texts in a client's description of its tool, which the robot publishes a hundred times a
# second [characters].
_LONGEST = 10000


class GripperTopics(RobotPart):
    """hands: {side: one of `hands`}; state: the robot's RobotState."""

    def __init__(self, hands: Mapping[str, FingersHand | CupHand | NoHand], state: RobotState) -> None:
        self._state = state
        self._hands = hands
        self._properties = {side: _PROPERTIES[type(hand.gripper)] for side, hand in self._hands.items()}
        self._custom_states = {}  # {side: EndEffectorState of a tool that only a client knows}

    def attach_sensors(self, panel: PanelTopics) -> None:
        """Attach the vacuum sensors, 0 to 255, and the valves of suction grippers to the panel's channels."""
        for side, hand in self._hands.items():
            gripper = hand.gripper
            if isinstance(gripper, SuctionGripperHardware):
                panel.attach(VACUUM_SENSORS[side], lambda gripper=gripper: gripper.sensor)
                panel.attach_valve(PUMPS[side], lambda gripper=gripper: gripper.sucking, self._valve(gripper.set_pump))
                panel.attach_valve(BLOWERS[side], lambda gripper=gripper: gripper.blowing,
                                   self._valve(gripper.set_blow))

    def _valve(self, switch: Callable[[bool], None]) -> Callable[[bool], None]:
        def write(on):
            if on:
                self._state.require_enabled()
            switch(on)

        return write

    def _command(self, side: str, msg: EndEffectorCommand, time_s: float) -> None:
        gripper = self._hands[side].gripper
        if self._properties[side] is _PROPERTIES[CustomGripperHardware] and msg.command not in gripper.COMMANDS:
            raise CommandRefused("gripper command '%s': the %s arm carries no gripper" % (msg.command[:40], side))
        gripper.take(msg.command, msg.args, msg.sender, msg.sequence, self._state.enabled)

    def _set_properties(self, side: str, msg: EndEffectorProperties, time_s: float) -> None:
        self._require_custom(side)
        _require_short(msg)
        self._properties[side] = msg

    def _set_state(self, side: str, msg: EndEffectorState, time_s: float) -> None:
        self._require_custom(side)
        _require_short(msg)
        self._custom_states[side] = msg

    def _require_custom(self, side: str) -> None:
        if not isinstance(self._hands[side], NoHand):
            raise CommandRefused("the %s arm carries a gripper that the robot knows; only a custom one can be told "
                                 "what it is" % side)

    def _gripper_state(self, time_s: float, side: str, snapshot: JointSnapshot) -> EndEffectorState:
        hand, told = self._hands[side], self._custom_states.get(side)
        gripper = hand.gripper
        if told is not None:
            message = copy.copy(told)
        else:
            position, force = hand.readings(snapshot.position)
            flags = {**_UNKNOWN, **gripper.flags}
            if gripper.flags:
                flags.update(enabled=self._state.enabled, reverse=False)
            message = EndEffectorState(id=self._properties[side].id, position=position, force=force,
                                       state=gripper.details)
            for name, value in flags.items():
                setattr(message, name, int(value))
        message.timestamp = stamp(time_s)
        message.command, message.command_sender = gripper.command, gripper.sender
        message.command_sequence = gripper.sequence
        return message

    def _gripper_properties(self, time_s: float, side: str, snapshot: JointSnapshot) -> EndEffectorProperties:
        return self._properties[side]

    TOPICS = (
        TopicRow("gripper_state", "end_effector/{limb}_gripper/state", "baxter_core_msgs/EndEffectorState",
                 STATE_RATE_HZ, _gripper_state,
                 "position and force [%], moving, gripping, missed; sender and sequence of the last command; `state` "
                 "of a suction gripper is a JSON object: `vacuum sensor` (0 to 255), `vacuum`, `blowing`, `sucking`"),
        TopicRow("gripper_properties", "end_effector/{limb}_gripper/properties",
                 "baxter_core_msgs/EndEffectorProperties", STATE_RATE_HZ, _gripper_properties,
                 "`ui_type` 1 suction, 2 electric, 3 where the arm carries no gripper; else what `set_properties` "
                 "said"),
        TopicRow("gripper_command", "end_effector/{limb}_gripper/command", "baxter_core_msgs/EndEffectorCommand", None,
                 _command, "configure, calibrate, clear_calibration, reset, reboot, go, stop, release, grip, "
                 "prepare_to_grip, set, no_op; arguments as a JSON object; `urdf` of configure tells what the hand "
                 "weighs"),
        TopicRow("gripper_set_properties", "end_effector/{limb}_gripper/rsdk/set_properties",
                 "baxter_core_msgs/EndEffectorProperties", None, _set_properties,
                 "what a tool is that only the client knows, on an arm without a gripper"),
        TopicRow("gripper_set_state", "end_effector/{limb}_gripper/rsdk/set_state", "baxter_core_msgs/EndEffectorState",
                 None, _set_state, "the state of such a tool, which the robot then publishes"),
    )


def _require_short(msg: EndEffectorProperties | EndEffectorState) -> None:
    texts = [getattr(msg, name) for name in msg.__slots__]
    length = sum(len(text) for text in texts if isinstance(text, str))
    if length > _LONGEST:
        raise CommandRefused("its texts have %d characters; all together may have %d" % (length, _LONGEST))
