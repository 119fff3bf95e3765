# SPDX-License-Identifier: BSD-3-Clause
"""The robot as a whole in ROS messages: all its joints, its state, and the requests that change that state."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np
from std_msgs.msg import Empty, UInt32

from baxter_sim_hardware.errors import CommandRefused
from baxter_sim_hardware.robot_state import Event

from . import convert
from .row import JOINT_STATE_RATE, LATCHED, STATE_RATE_HZ, RobotPart, TopicRow

if TYPE_CHECKING:
    from collections.abc import Callable

    from baxter_core_msgs.msg import AssemblyState
    from sensor_msgs.msg import JointState
    from std_msgs.msg import Bool, UInt16

    from baxter_sim_hardware.simulated import SimulatedBaxter
    from baxter_sim_hardware.snapshot import JointSnapshot
    from baxter_sim_hardware.warnings import Warnings
    from gazebo_ros.model_plugin import PluginContext
    from loop_ros.protocol import Publisher

# Joints that the physical robot lists, always at 0: it nods without an angle, and its torso turns on no joint.
WITHOUT_SENSOR = ("head_nod", "torso_t0")
# Next number on `sim/resets`. Shared by all robots of this process, so that a replaced robot publishes another number.
_resets = itertools.count(1)


class RobotTopics(RobotPart):
    """simulated: `simulated.SimulatedBaxter`; set_joint_state_rate: function(Hz); as_robot: whether joint states come
    as the physical robot sends them: arms, head and torso in one message, grippers in another."""

    def __init__(self, simulated: SimulatedBaxter, set_joint_state_rate: Callable[[float], None],
                 context: PluginContext, warnings: Warnings, as_robot: bool = False) -> None:
        self._simulated, self._baxter, self._set_rate = simulated, simulated.baxter, set_joint_state_rate
        self._world, self._log, self._warnings = context.world, context.log, warnings
        self._joints = self._messages_of_joints(list(simulated.model.joint_names), as_robot)

    def apply(self, event: Event) -> None:
        """Take an `Event`; a request that the robot's state refuses is logged."""
        before = self._baxter.state.state
        try:
            self._simulated.apply(event)
        except CommandRefused as refusal:
            self._warnings.warn(self._world.time_s, event, "%s ignored: %s" % (event.value, refusal))
            return
        if self._baxter.state.state is not before:
            self._log.info("Baxter is %s" % self._baxter.state.state.value)

    def press_estop(self, pressed: bool) -> None:
        """The emergency stop button was pressed or released."""
        self.apply(Event.ESTOP_PRESS if pressed else Event.ESTOP_RELEASE)

    def announce_start(self) -> None:
        """Tell subscribers that the robot is ready."""
        self._started.publish(Empty())

    def announce_reset(self) -> None:
        """Tell subscribers that the joints were moved by a service or reset."""
        self._resets.publish(UInt32(next(_resets)))

    # -- out

    @staticmethod
    def _messages_of_joints(names: list[str], as_robot: bool) -> list[tuple[convert.JointStates, np.ndarray]]:
        """[(`convert.JointStates`, indices of its joints; the number of joints means one without a sensor)]."""
        groups = [sorted(names)]
        if as_robot:
            fingers = sorted(name for name in names if name.endswith("_finger_joint"))
            groups = [sorted({*names, *WITHOUT_SENSOR} - {*fingers}), fingers]
        return [(convert.JointStates(group), np.array([names.index(name) if name in names else len(names)
                                                       for name in group])) for group in groups if group]

    def _joint_states(self, time_s: float, component: None, snapshot: JointSnapshot) -> tuple[JointState, ...]:
        sensed = [np.append(values, 0.0) for values in snapshot.sensed]
        return tuple(states.message(time_s, *(values[order] for values in sensed)) for states, order in self._joints)

    def _assembly(self, time_s: float, component: str | None, snapshot: JointSnapshot) -> AssemblyState:
        return convert.assembly_state(self._baxter.state.assembly)

    def _keep_started(self, publisher: Publisher) -> None:
        self._started = publisher

    def _begin_resets(self, publisher: Publisher) -> None:
        self._resets = publisher
        self.announce_reset()

    # -- in

    def _joint_state_publish_rate(self, component: None, msg: UInt16, time_s: float) -> None:
        if not 1 <= msg.data <= 1000:
            raise CommandRefused("%d Hz; it must be from 1 to 1000" % msg.data)
        self._set_rate(msg.data)

    def _super_enable(self, component: None, msg: Bool, time_s: float) -> None:
        self.apply(Event.ENABLE if msg.data else Event.DISABLE)

    def _super_stop(self, component: None, msg: Empty, time_s: float) -> None:
        self.apply(Event.STOP)

    def _super_reset(self, component: None, msg: Empty, time_s: float) -> None:
        self.apply(Event.RESET)

    TOPICS = (
        TopicRow("joint_states", "joint_states", "sensor_msgs/JointState", JOINT_STATE_RATE, _joint_states,
                 "all movable joints, names in alphabetical order [rad, m; rad/s, m/s; Nm, N]; "
                 "15 without grippers, 19 with two electric ones; with the effect `states` 17 and `head_nod`, "
                 "`torso_t0` among them, and a second message for the fingers"),
        TopicRow("joint_state_publish_rate", "joint_state_publish_rate", "std_msgs/UInt16", None,
                 _joint_state_publish_rate, "[Hz] 1 to 1000: rate of joint_states"),
        TopicRow("state", "state", "baxter_core_msgs/AssemblyState", STATE_RATE_HZ, _assembly,
                 "enabled, stopped, ready, emergency stop"),
        TopicRow("assembly_state", "assembly/{assembly}/state", "baxter_core_msgs/AssemblyState", STATE_RATE_HZ,
                 _assembly, "the same as `state`: assemblies are enabled and stopped together"),
        TopicRow("limb_state", "limb/{limb}/state", "baxter_core_msgs/AssemblyState", STATE_RATE_HZ, _assembly,
                 "the same for the limb"),
        TopicRow("head_assembly_state", "head/state", "baxter_core_msgs/AssemblyState", STATE_RATE_HZ, _assembly,
                 "the same for the head"),
        TopicRow("set_super_enable", "set_super_enable", "std_msgs/Bool", None, _super_enable,
                 "true enables, false disables"),
        TopicRow("set_super_stop", "set_super_stop", "std_msgs/Empty", None, _super_stop, "software stop"),
        TopicRow("set_super_reset", "set_super_reset", "std_msgs/Empty", None, _super_reset,
                 "clears a stop; leaves the robot disabled"),
        TopicRow("resets", "sim/resets", "std_msgs/UInt32", LATCHED, _begin_resets,
                 "a number that changes whenever the joints are put elsewhere: by a reset of the world or the "
                 "simulation, by set_model_configuration, by another robot in this one's place"),
        TopicRow("started", "sim/started", "std_msgs/Empty", LATCHED, _keep_started,
                 "the robot stands, publishes and listens"),
    )
