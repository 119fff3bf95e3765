# SPDX-License-Identifier: BSD-3-Clause
"""A correct client: calls services, enables, waits for rest, moves an arm and checks that it follows."""
import time

import rospy
import tcpros
from baxter_core_msgs.msg import JointCommand
from bullet_sim_msgs.srv import Press, PressRequest
from gazebo_msgs.srv import DeleteModel, GetWorldProperties
from invariants import Patience
from std_msgs.msg import Bool, Empty, Float64, UInt16
from std_srvs.srv import Empty as EmptyService
from watch import STATE, STATES

from baxter_model import JOINTS, SIDES
from lab import CALLER, cpu_s
from lab_testing.waiting import wait_until

# Time limits of a service's answer [s]: CPU time of its node, and wall time.
PATIENCE_CPU_S, PATIENCE_WALL_S = 60.0, 180.0
PATIENCE = Patience(PATIENCE_CPU_S, PATIENCE_WALL_S)
REST_SPEED = 0.005  # [rad/s]
REST_S = 0.3  # time without motion until the arm counts as at rest [simulated s]
ARRIVED = 0.02  # [rad]
STATES_HZ = 50
STEP = 0.1  # distance of a test motion [rad]
# Time limit for the effect of a command [simulated s, and wall s if the clock stops].
FOLLOW_S, WALL_S = 10.0, 180.0
OURS = ("baxter", "two_joints")  # models that are kept


class LabError(Exception):
    """The lab does not behave as a client may expect."""


class Services:
    """Calls the lab's services by raw requests, with a deadline in CPU time."""

    def __init__(self, lab):
        self._lab, self._connections = lab, {}

    def call_raw(self, name, node, request, wall_s=PATIENCE_WALL_S):
        """Return (True, the answer's bytes) or (False, the error's text). Raises LabError if there is no answer in
        time."""
        pid = self._lab.pid(node)
        if pid is None:
            raise LabError("%s, the node of %s, does not answer" % (node, name))
        computed, begin = cpu_s(pid), time.monotonic()
        try:
            answer = self._connection(name).call(request, wall_s)
        except TimeoutError:
            raise LabError("%s did not answer within %.0f s, in which its node computed for %.1f s" % (
                name, wall_s, cpu_s(pid) - computed)) from None
        late = PATIENCE.check(name, cpu_s(pid) - computed, time.monotonic() - begin)
        if late:
            raise LabError(late[0])
        return answer

    def forget(self):
        """Close all connections; needed after nodes have been restarted."""
        for connection in self._connections.values():
            connection.close()
        self._connections.clear()

    def _connection(self, name):
        if name not in self._connections:
            address = self._lab.service_address(name)
            _, md5sum = tcpros.service_type(address, name)
            self._connections[name] = tcpros.ServiceConnection(address, name, md5sum)
        return self._connections[name]


class Robot:
    """The robot, observed by a Watch and commanded by topics. One per lab; needs an initialised rospy node."""

    def __init__(self, watch):
        self.watch = watch
        self._enable = rospy.Publisher("/robot/set_super_enable", Bool, queue_size=None)
        self._stop = rospy.Publisher("/robot/set_super_stop", Empty, queue_size=None)
        self._reset = rospy.Publisher("/robot/set_super_reset", Empty, queue_size=None)
        self._rate = rospy.Publisher("/robot/joint_state_publish_rate", UInt16, queue_size=None)
        self._ratios = [rospy.Publisher("/robot/limb/%s/set_speed_ratio" % side, Float64, queue_size=None)
                        for side in SIDES]
        self._commands = {side: rospy.Publisher("/robot/limb/%s/joint_command" % side, JointCommand, queue_size=None)
                          for side in SIDES}

    def call(self, name, service_class, *arguments):
        """Call a service. Raises LabError."""
        try:
            rospy.wait_for_service(name, PATIENCE_WALL_S)
            return rospy.ServiceProxy(name, service_class)(*arguments)
        except (rospy.ServiceException, rospy.ROSException) as error:
            raise LabError("%s: %s" % (name, error)) from error

    def state(self):
        """The last AssemblyState; None before the first."""
        return self.watch.latest.get(STATE)

    def positions(self):
        """Arm joint's name to its position [rad]; empty before the first message."""
        message = self.watch.latest.get(STATES)
        return {} if message is None else {
            name: position for name, position in zip(message.name, message.position, strict=True)
            if name[-2:] in JOINTS}

    def await_fresh(self, what, condition):
        """Wait until ``condition(joint states)`` holds for a new message and the next 15 (0.3 s). Raises LabError if it
        does not within FOLLOW_S [simulated s], or if there are no messages.
        """
        begin, last, since = None, self.watch.latest.get(STATES), None

        def has_held():
            nonlocal begin, last, since
            message = self.watch.latest.get(STATES)
            if message is last or message is None:
                return False
            last, now = message, message.header.stamp.to_sec()
            begin = now if begin is None or now < begin else begin
            if not condition(message):
                since = None
            elif since is None or now < since:
                since = now
            elif now - since >= REST_S:
                return True
            if now - begin > FOLLOW_S:
                raise LabError("%s: not within %.0f simulated s" % (what() if callable(what) else what, FOLLOW_S))
            return False

        try:
            wait_until(has_held, what, WALL_S, 0.005)
        except AssertionError as error:
            raise LabError("%s, and the simulation clock has stopped or is very slow" % error) from None

    def enable(self):
        """Reset, enable and wait for both, at full speed. Raises LabError."""
        def is_enabled():
            # An earlier command may have set a low speed, which is correct behaviour.
            for ratio in self._ratios:
                ratio.publish(1.0)
            self._rate.publish(STATES_HZ)
            state = self.state()
            if state is not None and state.enabled:
                return True
            if state is not None and state.stopped:
                self._reset.publish()
            self._enable.publish(True)
            return False

        try:
            wait_until(is_enabled, lambda: "an enabled robot; its state is %s" % (self.state(),), WALL_S, 0.1)
        except AssertionError as error:
            raise LabError(str(error)) from None

    def tidy(self):
        """Undo the effects of hostile but valid requests: start the clock, release the buttons, delete foreign
        models."""
        self.call("/gazebo/unpause_physics", EmptyService)
        self.call("/robot/sim/press", Press, "estop", PressRequest.RELEASE, 0)
        for name in self.call("/gazebo/get_world_properties", GetWorldProperties).model_names:
            if name not in OURS and "ground" not in name:
                self.call("/gazebo/delete_model", DeleteModel, name)
        self.watch.stamps.announce_reset()
        self.call("/gazebo/reset_simulation", EmptyService)

    def come_to_rest(self):
        """Enable, and wait until no arm joint moves. Raises LabError."""
        self.enable()

        def is_at_rest(message):
            return all(abs(speed) < REST_SPEED for name, speed in zip(message.name, message.velocity, strict=True)
                       if name[-2:] in JOINTS)

        self.await_fresh("arms at rest", is_at_rest)

    def follow(self):
        """Move a joint of each arm and check that it arrives. Raises LabError."""
        self.enable()
        start = self.positions()
        goals = {}
        for side in SIDES:
            name = "%s_w2" % side
            goals[name] = start[name] + (STEP if start[name] < 0.0 else -STEP)
        sent_at = [0.0]

        def have_arrived(message):
            if time.monotonic() - sent_at[0] > 0.1:
                sent_at[0] = time.monotonic()
                for side in SIDES:
                    name = "%s_w2" % side
                    self._commands[side].publish(JointCommand.POSITION_MODE, [goals[name]], [name])
            found = dict(zip(message.name, message.position, strict=True))
            return all(abs(found[name] - goal) < ARRIVED for name, goal in goals.items())

        self.await_fresh(lambda: "the arms did not follow a valid command to %s, they are at %s" % (
            goals, {name: self.positions().get(name) for name in goals}), have_arrived)


def init_node():
    """Start as a node on the master in ROS_MASTER_URI."""
    rospy.init_node(CALLER[1:], anonymous=False, disable_signals=True, disable_rostime=True)
