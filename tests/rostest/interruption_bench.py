# SPDX-License-Identifier: BSD-3-Clause
"""A robot in a paused world that is advanced tick by tick, for tests that interrupt its motions."""
import math
import os
import signal
import subprocess

import rospy
from baxter_core_msgs.msg import AssemblyState, JointCommand
from bullet_sim_msgs.srv import AdvanceTicks, Press
from gazebo_msgs.srv import DeleteModel, SetModelConfiguration
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool
from std_msgs.msg import Empty as EmptyMessage
from std_srvs.srv import Empty

from baxter_model import SIDES, joint_names
from lab_testing.waiting import wait_until

DEADLINE_S = 60.0  # [s, wall] for actions that take a second on an idle machine
BEAT_TICKS, TICK_S = 5, 0.002
# Longest wait for a command after each beat [s, wall]: external programs must keep up, and a program that sends no more
# commands must not block the world.
PATIENCE_S = 0.03


def joints(side):
    return list(joint_names(side))


class Program:
    """An external program in its own process group, which ends with the test."""

    def __init__(self, *command):
        self._process = subprocess.Popen(command, start_new_session=True, stdout=subprocess.PIPE,
                                         stderr=subprocess.STDOUT, text=True)

    def kill(self):
        """Kill it, as in a crash."""
        self._signal(signal.SIGKILL)

    def end(self):
        self._signal(signal.SIGINT)

    @property
    def has_ended(self):
        return self._process.poll() is not None

    def _signal(self, number):
        if not self.has_ended:
            os.killpg(self._process.pid, number)
            try:
                self.output = self._process.communicate(timeout=DEADLINE_S)[0]
            except subprocess.TimeoutExpired:
                os.killpg(self._process.pid, signal.SIGKILL)
                self.output = self._process.communicate()[0]


class Bench:
    """The robot, its world, and a person's actions on both. The world is paused except in :meth:`run`."""

    def __init__(self):
        self.state, self._joints, self.commands_heard = None, None, 0
        self._keep = [
            rospy.Subscriber("/robot/state", AssemblyState, self._on_state, queue_size=10),
            rospy.Subscriber("/robot/joint_states", JointState, self._on_joints, queue_size=100, tcp_nodelay=True)]
        self.commands = {}
        for side in SIDES:
            topic = "/robot/limb/%s/joint_command" % side
            self._keep.append(rospy.Subscriber(topic, JointCommand, self._on_command, tcp_nodelay=True))
        self._enable = rospy.Publisher("/robot/set_super_enable", Bool, queue_size=10)
        self._stop = rospy.Publisher("/robot/set_super_stop", EmptyMessage, queue_size=10)
        self._reset = rospy.Publisher("/robot/set_super_reset", EmptyMessage, queue_size=10)
        self._advance = self._service("/gazebo/advance", AdvanceTicks)
        self._press = self._service("/robot/sim/press", Press)
        self.call = {name: self._service("/gazebo/" + name, Empty) for name in (
            "reset_world", "reset_simulation", "pause_physics", "unpause_physics")}
        self._set_joints = self._service("/gazebo/set_model_configuration", SetModelConfiguration)
        self._delete = self._service("/gazebo/delete_model", DeleteModel)
        self.call["pause_physics"]()
        self.run(0.02)
        self.run_until(lambda: self._joints is not None and self.state, "the robot's states", most_s=60.0)
        wait_until(lambda: all(each.get_num_connections() for each in (self._enable, self._stop, self._reset)),
                   "the robot listens", DEADLINE_S)

    @staticmethod
    def _service(name, kind):
        rospy.wait_for_service(name, DEADLINE_S)
        return rospy.ServiceProxy(name, kind, persistent=True)

    def _on_state(self, message):
        self.state = message

    def _on_joints(self, message):
        self._joints = message

    def _on_command(self, message):
        self.commands_heard += 1

    # -- time

    def run(self, seconds, before=None, patience_s=0.0):
        """Advance simulated time by this much, in beats; ``before()`` is called before each beat, and after each it
        waits for a command, at most ``patience_s`` [s, wall]."""
        for _ in range(max(1, round(seconds / TICK_S / BEAT_TICKS))):
            heard = self.commands_heard
            if before:
                before()
            answer = self._advance(ticks=BEAT_TICKS, await_topics=[], timeout_s=0.0)
            assert answer.success, answer.status_message
            self._time = answer.sim_time
            if patience_s:
                try:
                    wait_until(lambda heard=heard: self.commands_heard > heard, timeout_s=patience_s, interval_s=0.001)
                except AssertionError:
                    pass

    def run_until(self, test, what, before=None, most_s=20.0):
        """Let time pass until ``test()``, ``most_s`` of it at most [s, simulated]."""
        for _ in range(round(most_s / TICK_S / BEAT_TICKS)):
            if test():
                return
            self.run(BEAT_TICKS * TICK_S, before, PATIENCE_S)
        wait_until(test, what, PATIENCE_S)

    # -- observations

    def positions(self):
        """{joint: angle [rad]} in the present state of the world, or one period of the state earlier."""
        def is_new():
            behind = (self._time - self._joints.header.stamp).to_sec()
            return 0.0 <= behind < 0.025
        wait_until(is_new, "joint states of %.3f s" % self._time.to_sec(), DEADLINE_S)
        return dict(zip(self._joints.name, self._joints.position, strict=True))

    def farthest(self, before):
        """(rad, joint) of the joint that has moved most since ``before``."""
        now = self.positions()
        return max((abs(now[name] - before[name]), name) for name in now)

    # -- actions

    def enabled(self, on):
        """Enable or disable, and check that the robot reports it."""
        self._until(lambda: self._enable.publish(Bool(on)), lambda: self.state.enabled == on, "enabled is %s" % on)

    def stop(self):
        self._until(self._stop.publish, lambda: self.state.stopped, "stopped")

    def clear(self):
        """Release the button, clear a stop: the robot is disabled then."""
        self.press("release")
        self._until(self._reset.publish, lambda: not (self.state.stopped or self.state.error or self.state.enabled),
                    "reset")

    def press(self, action):
        assert self._press(component="estop", action=action, steps=0).success
        self.run(0.02)

    def _until(self, say, test, what):
        self.run_until(test, what, before=say, most_s=2.0)

    def put_joints(self, angles):
        answer = self._set_joints(model_name="baxter", urdf_param_name="robot_description", joint_names=list(angles),
                                  joint_positions=list(angles.values()))
        assert answer.success, answer.status_message

    def respawn(self):
        """Replace the robot by a new one, which is disabled, as every robot at its start."""
        state = self.state
        assert self._delete("baxter").success
        subprocess.run(["rosrun", "baxter_sim_hardware", "spawn_baxter", "neutral", "-urdf", "-param",
                        "robot_description", "-model", "baxter", "-z", "0.93"], check=True, timeout=DEADLINE_S,
                       capture_output=True)
        self.run_until(lambda: self.state is not state and not self.state.enabled and all(
            each.get_num_connections() for each in (self._enable, self._stop, self._reset)), "the new robot")
        self._press = self._service("/robot/sim/press", Press)

    def as_new(self):
        """An enabled, resting robot at the world's start."""
        self.clear()
        self.call["reset_world"]()
        self.run(0.1)
        self.enabled(True)
        self.run(0.1)

    def is_finite(self):
        return all(math.isfinite(angle) for angle in self.positions().values())
