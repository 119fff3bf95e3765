# SPDX-License-Identifier: BSD-3-Clause
"""Baxter as a model plugin of /gazebo: connects the robot's parts to the simulated model. It makes no decisions."""
import math
from types import MethodType

import numpy as np
import roslib.message

from baxter_model import BASE_FRAME, SIDES, ModelError, is_part_of_arm, tip_of
from baxter_model.description import arm_radius, finger_openings, limbs_of
from baxter_model.self_collision import spawn_options
from baxter_sim_kinematics import Chain
from gazebo_ros.model_plugin import ModelPlugin, PluginError
from numba_cache import compiler_pages

from . import compiled, effects, individual
from .arms.actuators import Actuators
from .arms.external_load import ExternalLoad
from .arms.hand_load import HandLoads
from .arms.joint_command import JointLimits
from .arms.joint_sensors import JointSensors
from .arms.measured import Measured
from .arms.safety import Safety
from .errors import HardwareError
from .grippers.hands import hand_of
from .message_delay import MessageDelay
from .robot import Baxter, Behaviour
from .robot_state import Event, State
from .sensing.noise import HandSensors
from .topics import interface
from .topics.arms import ArmTopics
from .topics.collision import CollisionTopics, guards_of
from .topics.grippers import GripperTopics
from .topics.handling import Handling
from .topics.head import HeadTopics
from .topics.panel import PanelTopics
from .topics.procedures import ProcedureTopics
from .topics.publishing import Publishing
from .topics.robot import RobotTopics
from .topics.screen import ScreenTopics
from .topics.sensors import SensorTopics
from .topics.snapshot import Snapshot
from .topics.status import StatusTopics
from .topics.warnings import Warnings

PARAMETERS = "/baxter_sim_hardware/"
QUEUE_DEPTH = 400  # messages between two ticks: 20 ms, the longest turn, of a client that writes at 20 kHz


class BaxterPlugin(ModelPlugin):
    """Wires one `Baxter` to one simulated model. Parameters: see launch/baxter_sdk_control.launch."""

    # The robot's ramps and time-outs are counted in ticks.
    keeps_step = True

    @classmethod
    def spawn_options(cls, robot, element):
        # This is called outside the loop, which would stand still for the second that it takes.
        compiled.load()
        # The pedestal stands on the floor and stays there.
        return {"static": True, **spawn_options(robot.links)}

    def __init__(self, context, before=None):
        """``before``: the robot_state.State of the plugin that this one replaces, or None."""
        super().__init__(context)
        self._model = context.model
        try:
            self._build(context, before)
        except (HardwareError, ModelError) as error:
            raise PluginError("model '%s' cannot be driven as a Baxter: %s" % (context.model.name, error)) from error
        self._open_topics(context)

    def _build(self, context, before):
        model, robot = context.model, context.robot
        limbs = limbs_of(robot)
        names = tuple(name for limb in limbs for name in limb.joint_names)
        arm = self._arm_index = model.index(names)
        if before is None:
            self._hold_other_joints(robot)
        self._dt = context.world.time_step_s
        limits = JointLimits(names, model.lower[arm], model.upper[arm], model.max_velocity[arm], model.max_effort[arm])
        profile = self._parameter("profile", "sim")
        chosen = effects.chosen(self._parameter("effects", effects.ALL if profile == "robot" else effects.NONE))
        rows = effects.read(effects.physical_robot()) if chosen else {}
        seed = self._seed() if chosen & {"noise", "delay"} else None
        serial = individual.checked(self._parameter("serial", individual.DRAWING))
        self._sensors = JointSensors(rows["noise"], names, seed, serial) if "noise" in chosen else None
        hands = HandSensors(rows, serial, seed) if "noise" in chosen else None
        self._delay = MessageDelay(rows["delay"], seed) if "delay" in chosen else None
        self._effects, self._numbers = chosen, rows
        behaviour = Behaviour(profile, self._parameter("disabled", "hold"),
                              Actuators(rows["lag"], names) if "lag" in chosen else None)
        self._baxter = Baxter(limbs, limits, Measured(self._felt(), self._dynamics), self._dt, behaviour,
                              before)
        self._warnings = Warnings(context.log)
        dead_band = 0.0 if "noise" not in chosen else effects.positive(rows["senses"], "head_dead_band", "head_pan")
        self._build_parts(context, {limb.side: model.index(limb.joint_names) for limb in limbs}, hands, dead_band)
        if before is not None:
            self._measure()
            self._baxter.take_over()
        elif self._switch("enable", False):
            self._robot.apply(Event.ENABLE)
        self._before = None  # the joints before the last step, if there was one since they were put where they are
        # The joints that were driven to a position last, as the arms and as the model number them.
        self._driven = self._driven_index = None
        self._reads, self._read_s = None, 0.0  # the loop's count of reads at the last tick; the time of the last [s]
        self._has_started = before is not None
        #: Called in the loop with (side, message, JointCommand or None where it was refused) for each joint command.
        self.command_observers = self._arms.command_observers

    def _build_parts(self, context, limb_index, hands, dead_band):
        world, model, robot, baxter = context.world, context.model, context.robot, self._baxter
        chains = {side: Chain.from_robot(robot, base=BASE_FRAME, tip=tip_of(side)) for side in limb_index}
        self._robot = RobotTopics(baxter, model.joint_names, self._measure, self._set_joint_state_rate, context,
                                  self._warnings, "states" in self._effects)
        self._arms = ArmTopics(baxter, chains, limb_index, self._warnings)
        self._head = HeadTopics(model, baxter.state, self._dt, dead_band)
        self._grippers = GripperTopics({side: hand_of(world, model, side, self._dt, self._is_calibrated(side))
                                        for side in SIDES}, baxter.state)
        self._loads = (HandLoads(robot, chains, limb_index, self._grippers.told_load)
                       if baxter.actuators is not None else None)
        self._robot.on_disabled += [self._head.stop, self._grippers.stop]
        panel = PanelTopics(context, self._robot.press_estop)
        senses = SensorTopics(context, limb_index, self._dt, hands)
        for part in (self._grippers, senses):
            part.attach_sensors(panel)
        self._update_lights = senses.update
        self._collision = CollisionTopics(world, model, baxter, chains, guards_of(robot), self._arms.feel,
                                          panel.cuff_squeezed)
        self._collision.warn = self._warnings.warn
        if "safety" in self._effects:
            self._make_safe(model, robot, chains)
        if baxter.profile == "robot":
            self._robot.what_keeps_disabled = self._collision.too_near
        self._procedures = ProcedureTopics(baxter, self._warnings)
        self._parts = (
            self._robot, self._arms, panel, self._head, self._grippers, self._collision, self._procedures, senses,
            ScreenTopics(context), StatusTopics(baxter, limb_index, robot.links, context.urdf_xml, context.log))

    def _make_safe(self, model, robot, chains):
        numbers = self._numbers["safety"]
        surface = [effects.positive(numbers, number, "arm") for number in ("contact_stiffness", "contact_damping")]
        links = {side: [robot.joints[name].child for name in chain.joint_names] for side, chain in chains.items()}
        load = ExternalLoad(model, self._as_known, self._dt)
        self._collision.safety = Safety(self._numbers, load, links, arm_radius(robot))
        for joint in robot.movable_joints():
            if any(is_part_of_arm(joint.child, side) for side in SIDES):
                model.soften(joint.child, *surface)

    def _hold_other_joints(self, robot):
        """Hold the head straight, the fingers open, and all other joints."""
        model = self._model
        fingers = finger_openings(robot)
        if fingers:
            model.set_joint_positions(model.index(fingers), np.array(list(fingers.values())))
        others = np.setdiff1d(np.arange(len(model.joint_names)), self._arm_index)
        model.drive_position(others, model.read_joints()[0][others], model.max_effort[others])
        model.mark_start()

    def _is_calibrated(self, side):
        return "uncalibrated" not in self._effects or bool(
            effects.row(self._numbers["uncalibrated"], "calibrated").get(side))

    def _seed(self):
        """Of this robot's noise: the world's seed has a say in it."""
        return int(self.context.world.random.integers(2**32))

    def _parameter(self, name, default):
        return self.context.param(PARAMETERS + name, default)

    def _switch(self, name, default):
        """A parameter that is true or false. Another word in a launch file arrives as a non-empty string, which Python
        takes as true."""
        value = self._parameter(name, default)
        if value not in (True, False):
            raise PluginError("%s is %r; it must be true or false" % (name, value))
        return bool(value)

    def _open_topics(self, context):
        """Open every row of the interface table; `sim/started` last: its subscribers find all others open."""
        parts = {type(part): part for part in self._parts}
        owners = {row.key: parts[part] for part in interface.PARTS for row in part.TOPICS}
        order = [row.key for row in interface.TOPICS if row.key not in interface.HANDLED_LAST]
        order += interface.HANDLED_LAST
        rate = self._parameter("joint_state_rate", interface.JOINT_STATE_RATE_HZ)
        if not (isinstance(rate, int | float) and math.isfinite(rate) and 0.0 < rate <= 1.0 / self._dt):
            raise PluginError("joint_state_rate is %r; it must be a number of Hz above 0 and up to %g" % (
                rate, 1.0 / self._dt))
        if "states" in self._effects:
            rate = max(rate, effects.positive(self._numbers["states"], "least_rate", "joint_states"))
        self._handling = Handling(self._warnings, None if self._delay is None else self._delay_of)
        self._publishing = Publishing(self._snapshot, context.survived, lambda: context.world.time_s)
        if self._delay is not None:
            self._publishing.delay((interface.JOINT_STATE_RATE,), lambda: self._delay_of(0))
        for row in sorted(interface.TOPICS, key=lambda row: row.key == "started"):
            message = roslib.message.get_message_class(row.type)
            function = MethodType(row.function, owners[row.key])
            for component, name in row.names():
                if row.rate == interface.LATCHED:
                    function(context.publisher(name, message, latch=True))
                elif row.is_published:
                    hz = rate if row.rate == interface.JOINT_STATE_RATE else row.rate
                    self._publishing.add(row.rate, hz, function, component, context.publisher(name, message))
                else:
                    subscription = context.subscription(name, message, QUEUE_DEPTH)
                    self._handling.add(subscription, order.index(row.key), row.key, component, function,
                                       row.key in interface.DELAYED)

    def _delay_of(self, stream):
        return self._delay.of(stream, self.context.world.tick)

    def _set_joint_state_rate(self, hz):
        self._publishing.set_rate(interface.JOINT_STATE_RATE, hz)

    # -- the tick

    def update(self, time_s, dt):
        self._before = self._model.read_joints()
        arm, measured = self._arm_index, self._baxter.measured
        measured.time_s, measured.position, measured.velocity = time_s, self._felt(), self._before[1][arm]
        measured.missing_s = self._missing(time_s)
        pending = self.context.pending()
        if pending or self._handling.waits:
            self._handling.handle(pending, time_s)
        self._collision.update(time_s, self._baxter.state.enabled, self._before)
        if self._baxter.moves_by_gravity:
            efforts = self._model.gravity_efforts(self._before[0])
            self._as_known(efforts, self._before[0])
            measured.gravity = efforts[arm]
        drives = self._baxter.update()
        if len(drives.position_driven):
            if drives.position_driven is not self._driven:
                self._driven, self._driven_index = drives.position_driven, arm[drives.position_driven]
            goal = drives.position
            if self._sensors is not None:
                goal = self._sensors.reached(goal, drives.position_driven)
            self._model.drive_position(self._driven_index, goal, drives.effort, velocity=drives.velocity)
        if len(drives.velocity_driven):
            self._model.drive_velocity(arm[drives.velocity_driven], drives.push_velocity, drives.push_effort)
        if len(drives.effort_driven):
            self._model.drive_effort(arm[drives.effort_driven], drives.exerted)
        self._head.update()
        self._grippers.update(self._before)

    def _missing(self, time_s):
        """`Measured.missing_s`. Where several ticks follow each other at once, a command that comes during them is read
        after the last one: it is missing only if it is not there one read later, either."""
        reads = self.context.reads()
        if reads == self._reads:
            return None
        before_s, self._reads, self._read_s = self._read_s, reads, time_s
        return before_s if 1.5 * self._dt < time_s - before_s else time_s

    def publish(self, time_s):
        self._procedures.update(time_s, self._feel_torques)
        self._update_lights(time_s)
        if self._publishing.publish(time_s) and not self._has_started:
            self._robot.announce_start()
            self._has_started = True
            compiler_pages.release()

    def _feel_torques(self, side):
        return self._arms.feel(side, self._snapshot())[0]

    def _dynamics(self, velocity):
        """The function `dynamics` of `Measured`."""
        model, arm = self._model, self._arm_index
        position, velocities = model.read_joints()[0], np.zeros(len(model.joint_names))
        velocities[arm] = velocity
        return model.mass_matrix(position)[np.ix_(arm, arm)], model.inverse_dynamics(position, velocities)[arm]

    def _snapshot(self):
        return Snapshot(self._model, self._before, self._dt, self._sense, self._as_known)

    def _as_known(self, efforts, position):
        """Make efforts (n,), which balance all that the description has, those that the controllers know of."""
        if self._loads is not None:
            self._loads.correct(efforts, position, self._gravity_in_base)

    def _gravity_in_base(self):
        to_base = self._model.link_pose(BASE_FRAME).matrix()[:3, :3].T
        return to_base @ np.array(self.context.world.gravity)

    def _sense(self, position, velocity, effort):
        """What the robot says of its joints, (n,) each, where they are as given."""
        arm, actuators = self._arm_index, self._baxter.actuators
        if actuators is not None:
            effort = effort.copy()
            effort[arm] += actuators.counterbalance(position[arm]) + actuators.hysteresis
        if self._sensors is not None:
            position, velocity, effort = position.copy(), velocity.copy(), effort.copy()
            position[arm], velocity[arm], effort[arm] = self._sensors.read(
                self.context.world.tick, position[arm], velocity[arm], effort[arm])
        return position, velocity, effort

    def _measure(self):
        """Update the measured state of the arms' joints, between two ticks."""
        measured = self._baxter.measured
        measured.time_s = self.context.world.time_s
        measured.position, measured.velocity = self._felt(), self._model.read_joints()[1][self._arm_index]

    def _felt(self):
        """(n,) [rad] where the arms' joints are, as their controllers have it."""
        position = self._model.read_joints()[0][self._arm_index]
        return position if self._sensors is None else self._sensors.felt(position)

    # -- when it has raised

    def hold(self):
        self._baxter.state.fail()
        arm = self._arm_index
        self._model.drive_position(arm, self._model.read_joints()[0][arm], self._model.max_effort[arm])

    def restarted(self):
        before = self._baxter.state.state
        return self.successor(State.DISABLED if before is State.FAILED else before)

    def while_failed(self, time_s):
        self._before = self._model.read_joints()
        # Messages that arrive now are dropped; but a reset is what the failed robot waits for.
        keys = self._handling.drop(self.context.pending())
        self._publishing.publish(time_s)
        return "set_super_reset" in keys

    def joints_set(self):
        # Messages that have arrived by now are from before the joints were moved.
        self._measure()
        self._handling.handle(self.context.pending(), self.context.world.time_s)
        self._handling.forget()
        self._before = None
        self._publishing.forget()
        self._baxter.put_elsewhere()
        self._collision.forget()
        self._head.reset()
        self._grippers.reset()
        self._robot.announce_reset()

    def reset(self):
        self.joints_set()
        for part in self._parts:
            if part not in (self._head, self._grippers):
                part.reset()
        self._warnings.reset()

    # -- for other plugins of the model, and for tests

    def read_joints(self):
        """(position, velocity, effort) of all joints as the robot's own sensors have them, in the model's order."""
        return self._snapshot().sensed

    @property
    def is_enabled(self):
        """Whether the arms obey commands."""
        return self._baxter.state.enabled

    def start_over(self):
        """Disable the robot; release and clear stops; restore the start's speeds and time-outs. The joints stay where
        they are."""
        for event in (Event.ESTOP_RELEASE, Event.RESET):
            self._robot.apply(event)
        self._baxter.restore_settings()
