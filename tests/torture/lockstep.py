# SPDX-License-Identifier: BSD-3-Clause
"""The lab in lock-step: a message arrives before the ticks in which the test looks for its effect."""
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
    """Publishes, advances the world and waits for the robot's messages. The world must be paused: `pause`."""

    def __init__(self, watch):
        self._watch, self._publishers = watch, {}
        self._advance = rospy.ServiceProxy("/gazebo/advance", AdvanceTicks)
        self._executor = concurrent.futures.ThreadPoolExecutor(max_workers=1)
        self.ticks = 0

    def pause(self):
        rospy.ServiceProxy("/gazebo/pause_physics", Empty)()

    def run_free(self, seconds):
        """Unpause until this much simulation time [s] has passed, and pause again."""
        begin = self._now()
        rospy.ServiceProxy("/gazebo/unpause_physics", Empty)()
        try:
            wait_until(lambda: self._now() >= begin + seconds, "simulation time to advance", WALL_S)
        finally:
            self.pause()

    def connect(self, topic, message_class):
        """Return a publisher that the robot has subscribed to."""
        if topic not in self._publishers:
            self._publishers[topic] = rospy.Publisher(topic, message_class, queue_size=None)
        wait_until(self._publishers[topic].get_num_connections, "the robot to subscribe to " + topic, WALL_S)
        return self._publishers[topic]

    def send(self, topic, message, ticks):
        """Publish, and advance by this many ticks; the first one handles the message."""
        self.connect(topic, type(message)).publish(message)
        self.advance(ticks, [topic])

    def advance(self, ticks, topics=()):
        """Advance, and wait for the joint states of the last tick. Raises LabError."""
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
        """Discard the last state, so that `state` waits for a new one."""
        self._watch.latest.pop(STATE, None)

    def state(self):
        """The last AssemblyState since `forget_state`. Raises LabError if there is none in time."""
        try:
            return wait_until(lambda: self._watch.latest.get(STATE), "a message on " + STATE, WALL_S, 0.001)
        except AssertionError as error:
            raise LabError(str(error)) from None

    def await_state(self, fields):
        """Wait for the expected state. The world is paused, so the last state is final. Raises LabError."""
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
        """Call a service that answers after a tick; return its answer."""
        answer = self._executor.submit(function, *arguments)
        for _ in range(1000):
            if answer.done():
                break
            self.advance(5)
        return answer.result(WALL_S)

    def _now(self):
        return self._watch.latest["/clock"].clock.to_sec() if "/clock" in self._watch.latest else 0.0
