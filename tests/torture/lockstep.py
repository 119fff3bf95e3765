# SPDX-License-Identifier: BSD-3-Clause
"""The lab in lock-step: what is published arrives before the ticks in which its effect is looked for."""
import concurrent.futures

import rospy
from bullet_sim_msgs.srv import AdvanceTicks
from robot import WALL_S, LabError
from std_srvs.srv import Empty
from watch import STATE, STATES

from lab_testing.waiting import wait_until

TICK_S = 0.002
STATES_PERIOD_S = 0.02


class LockStep:
    """Publishes, advances, waits for what the robot says of it. The world has to be paused: `pause`."""

    def __init__(self, watch):
        self._watch, self._publishers = watch, {}
        self._advance = rospy.ServiceProxy("/gazebo/advance", AdvanceTicks)
        self._executor = concurrent.futures.ThreadPoolExecutor(max_workers=1)
        self.ticks = 0

    def pause(self):
        rospy.ServiceProxy("/gazebo/pause_physics", Empty)()

    def run_free(self, seconds):
        """Unpause until so much simulated time [s] has gone by, and pause again."""
        begin = self._now()
        rospy.ServiceProxy("/gazebo/unpause_physics", Empty)()
        try:
            wait_until(lambda: self._now() >= begin + seconds, "simulated time to go on", WALL_S)
        finally:
            self.pause()

    def connect(self, topic, message_class):
        """Have a publisher that the robot listens to."""
        if topic not in self._publishers:
            self._publishers[topic] = rospy.Publisher(topic, message_class, queue_size=None)
        wait_until(self._publishers[topic].get_num_connections, "the robot to listen to " + topic, WALL_S)
        return self._publishers[topic]

    def send(self, topic, message, ticks):
        """Publish, and advance by so many ticks, the first of which takes the message in."""
        self.connect(topic, type(message)).publish(message)
        self.advance(ticks, [topic])

    def advance(self, ticks, topics=()):
        """Advance, and wait for the joint states of the end. Raises LabError."""
        answer = self._advance(ticks, list(topics), WALL_S)
        if not answer.success:
            raise LabError(answer.status_message)
        self.ticks += ticks
        end = answer.sim_time.to_sec()

        def has_come():
            message = self._watch.latest.get(STATES)
            return message is not None and 0.0 <= end - message.header.stamp.to_sec() < STATES_PERIOD_S

        try:
            wait_until(has_come, lambda: "joint states of %.3f s" % end, WALL_S, 0.001)
        except AssertionError as error:
            raise LabError(str(error)) from None

    def forget_state(self):
        """The next state that is looked at is one that comes from now on."""
        self._watch.latest.pop(STATE, None)

    def state(self):
        """The last AssemblyState since `forget_state`. Raises LabError where none comes."""
        try:
            return wait_until(lambda: self._watch.latest.get(STATE), "a message on " + STATE, WALL_S, 0.001)
        except AssertionError as error:
            raise LabError(str(error)) from None

    def await_state(self, fields):
        """Wait for the state; the world stands, so what it says last is what it says. Raises LabError."""
        def says():
            state = self._watch.latest.get(STATE)
            return state is not None and fields == (
                state.ready, state.enabled, state.stopped, state.estop_button, state.estop_source)

        try:
            wait_until(says, "", 10.0, 0.001)
        except AssertionError:
            raise LabError("expected (ready, enabled, stopped, button, source) %s, found %s" % (
                fields, self._watch.latest.get(STATE))) from None

    def call_while_advancing(self, function, *arguments):
        """Call a service that is answered after a tick; returns its answer."""
        answer = self._executor.submit(function, *arguments)
        for _ in range(1000):
            if answer.done():
                break
            self.advance(5)
        return answer.result(WALL_S)

    def _now(self):
        return self._watch.latest["/clock"].clock.to_sec() if "/clock" in self._watch.latest else 0.0
