# SPDX-License-Identifier: BSD-3-Clause
"""Baxter as a model plugin of /gazebo: messages in and out, drives of the simulated joints. No decisions of its own."""
import itertools
import math

import numpy as np
import roslib.message
from std_msgs.msg import Empty, UInt32

from baxter_model import BASE_FRAME, SIDES, ModelError, tip_of
from baxter_model.description import finger_openings, limbs_of
from baxter_model.self_collision import MESH_CUTS, self_collision_pairs
from baxter_sim_hardware.arms import endpoint
from baxter_sim_hardware.arms.control import BRAKES_EFFORT_FACTOR
from baxter_sim_hardware.arms.joint_command import JointLimits
from baxter_sim_hardware.errors import CommandRefused, HardwareError
from baxter_sim_hardware.grippers.hands import hand_of
from baxter_sim_hardware.robot import Baxter
from baxter_sim_hardware.robot_state import Event, State
from baxter_sim_hardware.topics import convert, interface
from baxter_sim_hardware.topics.collision import CollisionTopics
from baxter_sim_hardware.topics.grippers import GripperTopics
from baxter_sim_hardware.topics.head import HeadTopics
from baxter_sim_hardware.topics.panel import PanelTopics
from baxter_sim_hardware.topics.procedures import ProcedureTopics
from baxter_sim_hardware.topics.screen import ScreenTopics
from baxter_sim_hardware.topics.sensors import SensorTopics
from baxter_sim_hardware.topics.status import StatusTopics
from baxter_sim_kinematics import Chain
from gazebo_ros.model_plugin import ModelPlugin, PluginError
from sim_time.pace import Schedule

PARAMETERS = "/baxter_sim_hardware/"
QUEUE_DEPTH = 200  # messages between two ticks: 2 ms of a client that writes at 100 kHz
# How often the torque that balances gravity is computed anew where it only raises what a drive may exert [ticks]: from
# one time to the next an arm at full speed turns by 0.04 rad, and the torque changes by 2 Nm.
GRAVITY_TICKS = 5
# What `sim/resets` says next. One for all robots of this process: another one in the same place says another number.
_resets = itertools.count(1)
WARN_PERIOD_S = 5.0  # [simulated s] between two warnings of one kind


class BaxterPlugin(ModelPlugin):
    """Wires one `Baxter` to one simulated model. Parameters: see launch/baxter_sdk_control.launch."""

    # Its ramps and time-outs are counted in ticks.
    keeps_step = True

    @classmethod
    def spawn_options(cls, robot, element):
        # The pedestal stands on the floor and stays there.
        return {"static": True, "self_collision_pairs": self_collision_pairs(robot.links), "mesh_cuts": MESH_CUTS}

    def __init__(self, context, before=None):
        """``before``: the robot_state.State of the plugin that this one takes over from, if there is one."""
        super().__init__(context)
        self._model = context.model
        try:
            self._build(context, before)
        except (HardwareError, ModelError) as error:
            raise PluginError("cannot be Baxter's brain for model '%s': %s" % (context.model.name, error)) from error
        self._open_topics(context)

    def _build(self, context, before):
        model, robot = context.model, context.robot
        limbs = limbs_of(robot)
        names = tuple(name for limb in limbs for name in limb.joint_names)
        self._arm_index = model.index(names)
        arm = self._arm_index
        limits = JointLimits(names, model.lower[arm], model.upper[arm], model.max_velocity[arm], model.max_effort[arm])
        self._limb_index = {limb.side: model.index(limb.joint_names) for limb in limbs}
        self._chains = {limb.side: Chain.from_robot(robot, base=BASE_FRAME, tip=tip_of(limb.side)) for limb in limbs}
        if before is None:
            self._hold_other_joints(robot)
        self._dt = context.world.time_step_s
        self._baxter = Baxter(
            limbs, limits, model.read_joints()[0][arm], dt=self._dt,
            profile=self._parameter("profile", "sim"), disabled=self._parameter("disabled", "hold"), state=before)
        self._head = HeadTopics(model, self._baxter.state, self._dt)
        hands = {side: hand_of(context.world, model, side, self._dt) for side in SIDES}
        self._grippers = GripperTopics(hands, self._baxter.state)
        self._panel = PanelTopics(context, self._press_estop)
        senses = SensorTopics(context.world, model, robot, self._limb_index, self._dt)
        for part in (self._grippers, senses):
            part.attach_sensors(self._panel)
        self._collision = CollisionTopics(
            context.world, model, self._baxter.arms, self._feel, self._panel.cuff_squeezed)
        self._procedures = ProcedureTopics(self._baxter.state)
        self._parts = (
            self._panel, self._head, self._grippers, self._collision, self._procedures, senses, ScreenTopics(context),
            StatusTopics(self._baxter, self._chains, self._read_arms, robot.links, context.urdf_xml, context.log))
        if before is not None:
            self._baxter.take_over(*self._read_arms())
        elif self._switch("enable", False):
            self._apply(Event.ENABLE)
        self._alphabetical = np.argsort(model.joint_names)
        self._joint_state_messages = convert.JointStates([model.joint_names[i] for i in self._alphabetical])
        self._before = model.read_joints()
        self._measured = None  # (position, velocity) of the arms' joints when this tick began, (n,) each
        self._gravity, self._gravity_ticks = None, 0  # what balances gravity (n,), and how long that holds
        self._servo = self._servo_index = None  # joints that were driven to a position last, and which those are
        self._last_warning = {}
        self._has_started = before is not None
        #: Called in the loop with (side, message, JointCommand or None where it was refused) for each joint command.
        self.command_observers = []

    def _hold_other_joints(self, robot):
        """Head straight, fingers open, and nothing left to dangle."""
        model = self._model
        fingers = finger_openings(robot)
        if fingers:
            model.set_joint_positions(model.index(fingers), np.array(list(fingers.values())))
        others = np.setdiff1d(np.arange(len(model.joint_names)), self._arm_index)
        model.drive_position(others, model.read_joints()[0][others], model.max_effort[others])
        model.mark_start()

    def _parameter(self, name, default):
        return self.context.param(PARAMETERS + name, default)

    def _switch(self, name, default):
        """A parameter that is true or false. Another word in a launch file arrives as text, and would count as true."""
        value = self._parameter(name, default)
        if value not in (True, False):
            raise PluginError("%s is %r; it must be true or false" % (name, value))
        return bool(value)

    def _open_topics(self, context):
        """Open every row of the interface table; `sim/started` last, so that who hears it finds all the others."""
        makers = {key: make for part in self._parts for key, make in part.makers.items()}
        takers = {key: take for part in self._parts for key, take in part.takers.items()}
        latched = {key: begin for part in self._parts for key, begin in getattr(part, "latched", {}).items()}
        latched["resets"] = self._count_resets_on
        groups = {}  # rate -> (schedule, [(function that makes a message, part, publisher)])
        takers = self._with_own_takers({row.key: takers[row.key] for row in interface.TOPICS if row.key in takers})
        order = {key: place for place, key in enumerate(takers)}
        self._letterboxes = {}  # queue -> (place in the order of reading, key, part, function that takes a message)
        rate = self._parameter("joint_state_rate", interface.JOINT_STATE_RATE_HZ)
        if not (isinstance(rate, int | float) and math.isfinite(rate) and 0.0 < rate <= 1.0 / self._dt):
            raise PluginError("joint_state_rate is %r; it must be a number of Hz above 0 and up to %g" % (
                rate, 1.0 / self._dt))
        started = None
        for row in interface.TOPICS:
            message = roslib.message.get_message_class(row.type)
            for side, name in row.names():
                if row.key == "started":
                    started = name, message
                elif row.rate == interface.LATCHED:
                    latched[row.key](context.publisher(name, message, latch=True))
                elif row.is_published:
                    hz = rate if row.rate == interface.JOINT_STATE_RATE else row.rate
                    make = makers.get(row.key) or getattr(self, "_" + row.key)
                    group = groups.setdefault(row.rate, (Schedule(hz), []))[1]
                    group.append((make, side, context.publisher(name, message)))
                else:
                    queue = context.queue(name, message, QUEUE_DEPTH)
                    self._letterboxes[queue] = order[row.key], row.key, side, takers[row.key]
        self._outputs = list(groups.values())
        self._joint_state_schedule = groups[interface.JOINT_STATE_RATE][0]
        self._started = context.publisher(*started, latch=True)
        self._idle_since_s, self._idle_until_s = math.inf, -math.inf  # between these nothing is due to be published

    # -- the tick

    def update(self, time_s, dt):
        self._before = self._model.read_joints()
        position, velocity = self._measured = (
            self._before[0][self._arm_index], self._before[1][self._arm_index])
        mail = self.context.mail()
        if mail:
            self._take_messages(mail, time_s)
        arm = self._arm_index
        self._collision.update(time_s, self._baxter.state.enabled, position, velocity)
        self._gravity_ticks -= 1
        if self._gravity_ticks <= 0 or self._baxter.moves_by_gravity:
            self._gravity = self._model.gravity_efforts(self._before[0])[arm]
            self._gravity_ticks = GRAVITY_TICKS
        drives = self._baxter.update(time_s, position, velocity, self._gravity)
        if len(drives.servo):
            if drives.servo is not self._servo:
                self._servo, self._servo_index = drives.servo, arm[drives.servo]
            self._model.drive_position(self._servo_index, drives.servo_position, drives.servo_effort,
                                       velocity=drives.servo_velocity)
        if len(drives.motor):
            self._model.drive_velocity(arm[drives.motor], drives.motor_velocity, drives.motor_effort)
        self._head.update()
        self._grippers.update(self._before)

    def publish(self, time_s):
        self._procedures.update(time_s, self._feel_torques)
        if not self._idle_since_s <= time_s < self._idle_until_s:
            self._publish_due(time_s)

    def _publish_due(self, time_s):
        snapshot = None
        for schedule, topics in self._outputs:
            if not schedule.due(time_s):
                continue
            for make, part, publisher in topics:
                if publisher.has_listeners:
                    if snapshot is None:
                        snapshot = self._snapshot()
                    try:
                        publisher.publish(make(time_s, part, snapshot))
                    except Exception as error:  # noqa: BLE001  (the robot goes on without one of its topics)
                        self.context.survived("publishing %s" % publisher.topic, error)
        if not self._has_started:
            self._started.publish(Empty())
            self._has_started = True
        self._idle_since_s, self._idle_until_s = time_s, min(schedule.next_s for schedule, _ in self._outputs)

    def _feel_torques(self, side):
        return self._feel(side, self._snapshot())[0]

    def _snapshot(self):
        return _Snapshot(self._model, self._before, self._arm_index, self._dt)

    def _read_arms(self):
        """(position, velocity) of the arms' joints, (n,) each."""
        return tuple(values[self._arm_index] for values in self._model.read_joints()[:2])

    def _feel(self, side, snapshot):
        """(torques (7,), wrench (6,)) that the surroundings exert on one arm's joints and on its tip."""
        index = self._limb_index[side]
        jacobian = self._chains[side].jacobian(snapshot.position[index])
        return (snapshot.own_effort[index] - snapshot.effort[index],
                endpoint.contact_wrench(jacobian, snapshot.effort[index], snapshot.own_effort[index]))

    # -- when it has raised

    def hold(self):
        self._baxter.state.fail()
        arm = self._arm_index
        self._model.drive_position(arm, self._model.read_joints()[0][arm],
                                   BRAKES_EFFORT_FACTOR * self._model.max_effort[arm])

    def restarted(self):
        before = self._baxter.state.state
        return self.successor(State.DISABLED if before is State.FAILED else before)

    def while_failed(self, time_s):
        self._before = self._model.read_joints()
        # What comes in now counts no more when the robot is back; but a reset is what it waits for.
        keys = [self._letterboxes[queue][1] for queue in self.context.mail() if queue.drain()]
        self._publish_due(time_s)
        return "set_super_reset" in keys

    def joints_set(self):
        # What has come in by now was said to the robot where it was.
        self._measured = self._read_arms()
        mail = self.context.mail()
        if mail:
            self._take_messages(mail, self.context.world.time_s)
        self._gravity_ticks = 0
        self._baxter.arms.reset(self._model.read_joints()[0][self._arm_index])
        self._head.reset()
        self._grippers.reset()
        self._tell_of_reset()

    def reset(self):
        self.joints_set()
        for part in self._parts:
            if part not in (self._head, self._grippers) and hasattr(part, "reset"):
                part.reset()
        self._last_warning.clear()

    def _count_resets_on(self, publisher):
        self._resets = publisher
        self._tell_of_reset()

    def _tell_of_reset(self):
        self._resets.publish(UInt32(next(_resets)))

    @property
    def is_enabled(self):
        """Whether the arms obey commands."""
        return self._baxter.state.enabled

    def start_over(self, time_s):
        """Disable; release and clear stops; speeds and time-outs as at the start. The joints stay where they are."""
        for event in (Event.ESTOP_RELEASE, Event.RESET):
            self._apply(event, time_s)
        self._baxter.restore_settings()

    # -- in

    def _with_own_takers(self, takers):
        """{key: function (part, message, time)} of all topics that the robot listens to, in the order in which those
        are read that came in within one tick."""
        arms = self._baxter.arms
        return {
            "joint_state_publish_rate": lambda part, msg, time_s: self._set_joint_state_rate(msg.data, time_s),
            "set_speed_ratio": lambda side, msg, time_s: arms.set_speed_ratio(side, msg.data),
            "joint_command_timeout": lambda side, msg, time_s: arms.set_timeout(side, msg.data),
            **takers,
            # In the order of Event: a stop has the last word.
            "set_super_reset": lambda part, msg, time_s: self._apply(Event.RESET, time_s),
            "set_super_enable": lambda part, msg, time_s: self._apply(
                Event.ENABLE if msg.data else Event.DISABLE, time_s),
            "set_super_stop": lambda part, msg, time_s: self._apply(Event.STOP, time_s),
            "joint_command": self._command,
        }

    def _take_messages(self, queues, time_s):
        letterboxes = self._letterboxes
        for queue in sorted(queues, key=lambda queue: letterboxes[queue][0]):
            _, key, part, take = letterboxes[queue]
            queue.handle(lambda msg, key=key, part=part, take=take: self._take(take, key, part, msg, time_s))

    def _take(self, take, key, part, msg, time_s):
        try:
            take(part, msg, time_s)
        except CommandRefused as refusal:
            limb = "%s limb: " % part if part in SIDES else ""
            self._warn(time_s, (part, key), "%s%s refused: %s" % (limb, key, refusal))

    def _apply(self, event, time_s=0.0):
        position, velocity = self._read_arms()
        before = self._baxter.state.state
        refusal = self._baxter.apply(event, position, velocity)
        if refusal:
            self._warn(time_s, event, "%s ignored: %s" % (event.value, refusal))
        elif self._baxter.state.state is not before:
            if not self._baxter.state.enabled:
                self._head.stop()
                self._grippers.stop()
            self.context.log.info("Baxter is %s" % self._baxter.state.state.value)

    def _press_estop(self, pressed):
        self._apply(Event.ESTOP_PRESS if pressed else Event.ESTOP_RELEASE, self.context.world.time_s)

    def _command(self, side, msg, time_s):
        position, velocity = self._measured
        try:
            command = self._baxter.command(side, msg.mode, msg.names, msg.command, time_s, position, velocity)
        except CommandRefused as refusal:
            kind = (side, self._baxter.state.enabled)
            self._warn(time_s, kind, "%s limb: joint command ignored: %s" % (side, refusal))
            command = None
        for observe in self.command_observers:
            observe(side, msg, command)
        if command is None:
            return
        if command.clamped:
            self._warn(time_s, (side, "clamped"), "%s limb: joint command clamped to the limits of %s" % (
                side, ", ".join(command.clamped)))

    def _set_joint_state_rate(self, hz, time_s):
        if 1 <= hz <= 1000:
            self._joint_state_schedule.set_rate(hz)
            self._idle_until_s = -math.inf
        else:
            self._warn(time_s, "rate", "joint_state_publish_rate %d Hz refused; it must be from 1 to 1000" % hz)

    def _warn(self, time_s, kind, text):
        """Warn once per kind and period."""
        last = self._last_warning.get(kind)
        if last is None or not last <= time_s < last + WARN_PERIOD_S:
            self._last_warning[kind] = time_s
            self.context.log.warn(text)

    # -- out: one method per published row of the interface table

    def _joint_states(self, time_s, side, snapshot):
        order = self._alphabetical
        return self._joint_state_messages.message(
            time_s, snapshot.position[order], snapshot.velocity[order], snapshot.effort[order])

    def _state(self, time_s, side, snapshot):
        return convert.assembly_state(self._baxter.state.assembly)

    def _endpoint_state(self, time_s, side, snapshot):
        index = self._limb_index[side]
        pose, jacobian = self._chains[side].fk_and_jacobian(snapshot.position[index])
        return convert.endpoint_state(
            time_s, BASE_FRAME, pose, endpoint.twist(jacobian, snapshot.velocity[index]),
            endpoint.contact_wrench(jacobian, snapshot.effort[index], snapshot.own_effort[index]))

    def _gravity_compensation_torques(self, time_s, side, snapshot):
        index, arms = self._limb_index[side], self._baxter.arms
        joints = arms.joints_of(side)
        return convert.sea_joint_state(
            time_s, BASE_FRAME, self._chains[side].joint_names,
            (arms.commanded_position[joints], arms.commanded_velocity[joints], arms.commanded_torque[joints]),
            (snapshot.position[index], snapshot.velocity[index], snapshot.effort[index]), snapshot.gravity[index])


class _Snapshot:
    """The model's joints after a step; what is costly is computed once, and only if a message asks for it."""

    def __init__(self, model, before, arm_index, dt):
        """before: `model.read_joints()` as it was when that step began; arm_index: of the arms' joints."""
        self.position, self.velocity, self.effort = model.read_joints()
        self.before, self.arm_index = before, arm_index
        self._model, self._dt = model, dt
        self._gravity = self._own_effort = None

    @property
    def gravity(self):
        """(n,) what balances gravity [Nm, N]."""
        if self._gravity is None:
            self._gravity = self._model.gravity_efforts(self.position)
        return self._gravity

    @property
    def own_effort(self):
        """(n,) what the robot's own weight, motion and joint damping took in the last step [Nm, N]; the rest of the
        effort went into what the robot touches."""
        if self._own_effort is None:
            position, velocity, _ = self.before
            acceleration = (self.velocity - velocity) / self._dt
            self._own_effort = self._model.inverse_dynamics(position, velocity, acceleration)
            self._own_effort += self._model.damping * velocity
        return self._own_effort
