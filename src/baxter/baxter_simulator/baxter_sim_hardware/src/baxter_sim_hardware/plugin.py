# SPDX-License-Identifier: BSD-3-Clause
"""Baxter as a model plugin of /gazebo: connects the robot's parts to the simulated model. It makes no decisions."""

from __future__ import annotations

import math
from functools import partial
from types import MethodType
from typing import TYPE_CHECKING, Any

import roslib.message

from baxter_model import BaxterModelError
from baxter_model.self_collision import spawn_options
from disk_cache import compiler_pages
from gazebo_ros.model_plugin import ModelPlugin, PluginError

from . import compiled, effects, individual
from .errors import BaxterHardwareError
from .message_delay import MessageDelay
from .robot_state import BaxterState, Event
from .simulated import SimulatedBaxter, Which
from .topics import interface
from .topics.arms import ArmTopics
from .topics.collision import CollisionTopics
from .topics.grippers import GripperTopics
from .topics.handling import Handling
from .topics.head import HeadTopics
from .topics.panel import PanelTopics
from .topics.procedures import ProcedureTopics
from .topics.publishing import Publishing
from .topics.robot import RobotTopics
from .topics.screen import ScreenTopics
from .topics.sensors import SensorTopics
from .topics.status import StatusTopics
from .warnings import Warnings

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np

    from gazebo_ros.model_plugin import PluginContext
    from urdf_model import Robot

PARAMETERS = "/baxter_sim_hardware/"
QUEUE_DEPTH = 400  # messages between two ticks: 20 ms, the longest turn, of a client that writes at 20 kHz


class BaxterPlugin(ModelPlugin):
    """Wires one `Baxter` to one simulated model. Parameters: see launch/baxter_sdk_control.launch."""

    # The robot's ramps and time-outs are counted in ticks.
    keeps_step = True

    @classmethod
    def spawn_options(cls, robot: Robot, element: Any) -> dict[str, Any]:
        # This is called outside the loop, which would stand still for the second that it takes.
        compiled.load()
        # The pedestal stands on the floor and stays there.
        return {"static": True, **spawn_options(robot.links)}

    def __init__(self, context: PluginContext, before: BaxterState | None = None) -> None:
        """``before``: the robot_state.BaxterState of the plugin that this one replaces, or None."""
        super().__init__(context)
        try:
            self._build(context, before)
        except (BaxterHardwareError, BaxterModelError) as error:
            raise PluginError("model '%s' cannot be driven as a Baxter: %s" % (context.model.name, error)) from error
        self._open_topics(context)

    def _build(self, context: PluginContext, before: BaxterState | None) -> None:
        which = Which(self._parameter("profile", "sim"), self._parameter("effects", None),
                      self._parameter("serial", individual.DRAWING), self._parameter("disabled", "hold"))
        simulated = self._simulated = SimulatedBaxter(context.world, context.model, context.robot, which, before,
                                                      lambda side: self._panel.cuff_squeezed(side))
        self._baxter, self._dt = simulated.baxter, simulated.dt
        self._delay = MessageDelay(simulated.numbers["delay"], simulated.seed) if "delay" in simulated.chosen else None
        self._warnings = Warnings(context.log)
        simulated.guarding.warn = self._warnings.warn
        self._build_parts(context, simulated)
        if before is None and self._switch("enable", False):
            self._robot.apply(Event.ENABLE)
        self._reads, self._read_s = None, 0.0  # the loop's count of reads at the last tick; the time of the last [s]
        self._has_started = before is not None
        #: Called in the loop with (side, message, JointCommand or None where it was refused) for each joint command.
        self.command_observers = self._arms.command_observers

    def _build_parts(self, context: PluginContext, simulated: SimulatedBaxter) -> None:
        baxter, limb_index = simulated.baxter, simulated.limb_index
        self._robot = RobotTopics(simulated, self._set_joint_state_rate, context, self._warnings,
                                  "states" in simulated.chosen)
        self._arms = ArmTopics(baxter, simulated.chains, limb_index, self._warnings)
        head = HeadTopics(simulated.head, baxter.state, self._dt)
        grippers = GripperTopics(simulated.hands, baxter.state)
        self._panel = PanelTopics(context, self._robot.press_estop)
        senses = SensorTopics(context, limb_index, self._dt, simulated.hand_sensors)
        for part in (grippers, senses):
            part.attach_sensors(self._panel)
        self._update_lights = senses.update
        self._procedures = ProcedureTopics(baxter, self._warnings)
        self._parts = (
            self._robot, self._arms, self._panel, head, grippers, CollisionTopics(simulated.guarding),
            self._procedures, senses, ScreenTopics(context),
            StatusTopics(baxter, limb_index, context.robot.links, context.urdf_xml, context.log))

    def _parameter(self, name: str, default: Any) -> Any:
        return self.context.param(PARAMETERS + name, default)

    def _switch(self, name: str, default: bool) -> bool:
        """A parameter that is true or false. Another word in a launch file arrives as a non-empty string, which Python
        takes as true."""
        value = self._parameter(name, default)
        if value not in (True, False):
            raise PluginError("%s is %r; it must be true or false" % (name, value))
        return bool(value)

    def _open_topics(self, context: PluginContext) -> None:
        """Open every row of the interface table; `sim/started` last: its subscribers find all others open."""
        parts = {type(part): part for part in self._parts}
        owners = {row.key: parts[part] for part in interface.PARTS for row in part.TOPICS}
        order = [row.key for row in interface.TOPICS if row.key not in interface.HANDLED_LAST]
        order += interface.HANDLED_LAST
        rate = self._parameter("joint_state_rate", interface.JOINT_STATE_RATE_HZ)
        if not (isinstance(rate, int | float) and math.isfinite(rate) and 0.0 < rate <= 1.0 / self._dt):
            raise PluginError("joint_state_rate is %r; it must be a number of Hz above 0 and up to %g" % (
                rate, 1.0 / self._dt))
        if "states" in self._simulated.chosen:
            rate = max(rate, effects.positive(self._simulated.numbers["states"], "least_rate", "joint_states"))
        delay_of = None if self._delay is None else self._delays(self._delay)
        self._handling = Handling(self._warnings, delay_of)
        self._publishing = Publishing(self._simulated.snapshot, context.survived, lambda: context.world.time_s)
        if delay_of is not None:
            self._publishing.delay((interface.JOINT_STATE_RATE,), partial(delay_of, 0))
        for row in sorted(interface.TOPICS, key=lambda row: row.key == "started"):
            message = roslib.message.get_message_class(row.type)
            if message is None:
                raise PluginError("there is no message %s: its package is missing, or not built" % row.type)
            function = MethodType(row.function, owners[row.key])
            for component, name in row.names():
                if row.rate is None:
                    subscription = context.subscription(name, message, QUEUE_DEPTH)
                    self._handling.add(subscription, order.index(row.key), row.key, component, function,
                                       row.key in interface.DELAYED)
                elif row.rate == interface.LATCHED:
                    function(context.publisher(name, message, latch=True))
                else:
                    hz = rate if row.rate == interface.JOINT_STATE_RATE else row.rate
                    self._publishing.add(row.rate, hz, function, component, context.publisher(name, message))

    def _delays(self, delay: MessageDelay) -> Callable[[int], float]:
        """The function (number of a stream) -> how long what comes now is on its way [s]."""
        world = self.context.world
        return lambda stream: delay.of(stream, world.tick)

    def _set_joint_state_rate(self, hz: float) -> None:
        self._publishing.set_rate(interface.JOINT_STATE_RATE, hz)

    # -- the tick

    def update(self, time_s: float, dt: float) -> None:
        self._simulated.measure(time_s, self._missing(time_s))
        pending = self.context.pending()
        if pending or self._handling.waits:
            self._handling.handle(pending, time_s)
        self._simulated.update()

    def _missing(self, time_s: float) -> float | None:
        """`Measured.missing_s`. Where several ticks follow each other at once, a command that comes during them is read
        after the last one: it is missing only if it is not there one read later, either."""
        reads = self.context.reads()
        if reads == self._reads:
            return None
        before_s, self._reads, self._read_s = self._read_s, reads, time_s
        return before_s if 1.5 * self._dt < time_s - before_s else time_s

    def publish(self, time_s: float) -> None:
        self._procedures.update(time_s, self._feel_torques)
        self._update_lights(time_s)
        if self._publishing.publish(time_s) and not self._has_started:
            self._robot.announce_start()
            self._has_started = True
            compiler_pages.release()

    def _feel_torques(self, side: str) -> np.ndarray:
        return self._simulated.feel(side, self._simulated.snapshot())[0]

    # -- when it has raised

    def hold(self) -> None:
        self._simulated.hold()

    def restarted(self) -> BaxterPlugin:
        before = self._baxter.state.state
        return self.successor(BaxterState.DISABLED if before is BaxterState.FAILED else before)

    def while_failed(self, time_s: float) -> bool:
        self._simulated.before = self._simulated.model.read_joints()
        # Messages that arrive now are dropped; but a reset is what the failed robot waits for.
        keys = self._handling.drop(self.context.pending())
        self._publishing.publish(time_s)
        return "set_super_reset" in keys

    def joints_set(self) -> None:
        # Messages that have arrived by now are from before the joints were moved.
        self._simulated.measure_now()
        self._handling.handle(self.context.pending(), self.context.world.time_s)
        self._handling.forget()
        self._publishing.forget()
        self._simulated.put_elsewhere()
        self._robot.announce_reset()

    def reset(self) -> None:
        self.joints_set()
        self._simulated.guarding.reset()
        for part in self._parts:
            part.reset()
        self._warnings.reset()

    # -- for other plugins of the model, and for tests

    def read_joints(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(position, velocity, effort) of all joints as the robot's own sensors have them, in the model's order."""
        return self._simulated.snapshot().sensed

    @property
    def is_enabled(self) -> bool:
        """Whether the arms obey commands."""
        return self._baxter.state.enabled

    @property
    def held(self) -> dict[str, tuple[str, ...]]:
        """{side: names of the links that collision avoidance holds that arm away from now}, empty for a free arm."""
        return dict(self._simulated.guarding.held)

    def start_over(self) -> None:
        """Disable the robot; release and clear stops; restore the start's speeds and time-outs. The joints stay where
        they are."""
        for event in (Event.ESTOP_RELEASE, Event.RESET):
            self._robot.apply(event)
        self._baxter.restore_settings()
