# SPDX-License-Identifier: BSD-3-Clause
"""A client for the end-to-end tests, without the SDK, only with topics."""
import collections

import rospy
from baxter_core_msgs.msg import AssemblyState, EndpointState, JointCommand
from diagnostic_msgs.msg import DiagnosticArray
from rosgraph_msgs.msg import Log
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Empty, Float64

from lab_testing.waiting import wait_for_message, wait_until

SIDES = ("left", "right")
SUFFIXES = ("s0", "s1", "e0", "e1", "w0", "w1", "w2")
POSITION, VELOCITY, TORQUE, RAW = 1, 2, 3, 4


def joints(side):
    return ["%s_%s" % (side, suffix) for suffix in SUFFIXES]


class Latest:
    """The newest message of a topic, or None."""

    def __init__(self, topic, kind):
        self.message = None
        self._keep = rospy.Subscriber(topic, kind, self._on_message, tcp_nodelay=True)

    def _on_message(self, message):
        self.message = message


class Robot:
    """Topics of one Baxter; waits for `/robot/sim/started`."""

    def __init__(self):
        self.history = collections.deque(maxlen=5000)  # JointState, oldest first
        self.state = None
        self.endpoints, self.lines = {}, []
        self._started = False
        self._keep = [
            rospy.Subscriber("/robot/joint_states", JointState, self.history.append, queue_size=100, tcp_nodelay=True),
            rospy.Subscriber("/robot/state", AssemblyState, self._on_state, tcp_nodelay=True),
            rospy.Subscriber("/robot/sim/started", Empty, self._on_started),
            rospy.Subscriber("/rosout", Log, lambda msg: self.lines.append(msg.msg)),
        ]
        for side in SIDES:
            self._keep.append(rospy.Subscriber("/robot/limb/%s/endpoint_state" % side, EndpointState,
                                               lambda msg, side=side: self.endpoints.update({side: msg})))

        def publisher(name, kind):
            return rospy.Publisher("/robot/" + name, kind, queue_size=100, tcp_nodelay=True)

        self.super_enable = publisher("set_super_enable", Bool)
        self.super_stop = publisher("set_super_stop", Empty)
        self.super_reset = publisher("set_super_reset", Empty)
        self.commands = {side: publisher("limb/%s/joint_command" % side, JointCommand) for side in SIDES}
        self.timeouts = {side: publisher("limb/%s/joint_command_timeout" % side, Float64) for side in SIDES}
        self.ratios = {side: publisher("limb/%s/set_speed_ratio" % side, Float64) for side in SIDES}
        wait_until(lambda: self._started, "/robot/sim/started")
        everything = [self.super_enable, self.super_stop, self.super_reset]
        everything += [*self.commands.values(), *self.timeouts.values(), *self.ratios.values()]
        wait_until(lambda: all(topic.get_num_connections() for topic in everything), "the robot listens to its topics")
        wait_until(lambda: self.state and self.history, "the robot's first states")

    def _on_state(self, msg):
        self.state = msg

    def _on_started(self, _):
        self._started = True

    @property
    def positions(self):
        """{joint: position} of the newest joint state."""
        message = self.history[-1]
        return dict(zip(message.name, message.position, strict=True))

    @property
    def velocities(self):
        message = self.history[-1]
        return dict(zip(message.name, message.velocity, strict=True))

    def now(self):
        """Simulation time of the newest joint state [s]."""
        return self.history[-1].header.stamp.to_sec()

    def wait_sim(self, seconds):
        """Wait for this much simulation time."""
        end = self.now() + seconds
        wait_until(lambda: self.now() >= end, "%g s of simulation" % seconds, 60.0 + 30.0 * seconds)

    def set_enabled(self, on):
        self.super_enable.publish(on)
        wait_until(lambda: self.state.enabled == on, "enabled is %s" % on)

    def restart(self):
        """From any state to enabled, with the defaults of both limbs.

        Each step waits for the robot to show it: two topics are two connections, and the later message may overtake.
        """
        if self.state.stopped or self.state.error:
            self.super_reset.publish()
            wait_until(lambda: not (self.state.stopped or self.state.error), "reset")
        elif self.state.enabled:
            self.set_enabled(False)
        for side in SIDES:
            self.timeouts[side].publish(0.2)
            self.ratios[side].publish(1.0)
        self.set_enabled(True)

    def command(self, mode, values):
        """One message per limb for {joint: value}."""
        for side in SIDES:
            chosen = [name for name in values if name.startswith(side)]
            if chosen:
                self.commands[side].publish(JointCommand(mode, [values[name] for name in chosen], chosen))

    def stream(self, mode, values, seconds):
        """Repeat a command at 100 Hz of wall time for this much simulation time."""
        end = self.now() + seconds
        def step():
            self.command(mode, values() if callable(values) else values)
            return self.now() >= end

        wait_until(step, "%g s of simulation" % seconds, 60.0 + 30.0 * seconds)

    def wait_setting(self, name, value):
        """Until the diagnostics show the value under ``name`` for both arms: a command could overtake a setting."""
        def taken(diagnostics):
            shown = [pair.value for status in diagnostics.status for pair in status.values if pair.key == name]
            return shown == ["%g" % value] * len(SIDES)

        wait_for_message("/diagnostics", DiagnosticArray, taken)

    def fastest(self, joint, since):
        """Largest speed of a joint [rad/s] after the simulation time ``since`` [s]."""
        return max(abs(message.velocity[message.name.index(joint)]) for message in list(self.history)
                   if message.header.stamp.to_sec() > since)

    def error(self, goal):
        """Largest distance of a joint from {joint: angle} [rad]."""
        positions = self.positions
        return max(abs(positions[name] - angle) for name, angle in goal.items())

    def move(self, goal, timeout_s=90.0):
        """Position mode: send {joint: angle} once and wait until it is reached."""
        self.command(POSITION, goal)
        wait_until(lambda: self.error(goal) < 2e-3 and max(map(abs, self.velocities.values())) < 1e-3,
                 "joints reach %s" % goal, timeout_s)
