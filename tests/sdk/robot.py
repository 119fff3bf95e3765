# SPDX-License-Identifier: BSD-3-Clause
"""A person beside the robot: sees joints, grippers, lights; presses buttons, pushes, moves arms."""
import itertools
from xml.etree import ElementTree
from xmlrpc.client import ServerProxy

import rosgraph
import rospy
from baxter_core_msgs.msg import (
    AnalogIOStates,
    AssemblyState,
    DigitalIOStates,
    EndEffectorState,
    HeadState,
    JointCommand,
)
from bullet_sim_msgs.srv import Press
from gazebo_msgs.srv import ApplyBodyWrench, ApplyBodyWrenchRequest, BodyRequest
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Empty

from baxter_model.names import SIDES, joint_names
from baxter_model.poses import poses
from lab_testing.waiting import DEADLINE_S, wait_until

COMMAND_HZ = 50.0
NEAR_RAD = 0.01
# A joint rests when it has been slower than this for so long, in simulated time.
RESTING_RAD_S, RESTING_S = 0.02, 0.5


def wait_until_heard(node, topics):
    """Wait until the simulator is connected to what ``node`` publishes on ``topics``.

    That takes up to 0.25 s; a person needs longer to read that a program is ready.
    """
    program = ServerProxy(rosgraph.Master("/sdk_checks").lookupNode(node))

    def unheard():
        _, _, connections = program.getBusInfo("/sdk_checks")
        return set(topics) - {topic for _, to, direction, _, topic, *_ in connections
                              if direction == "o" and to == "/gazebo"}

    wait_until(lambda: not unheard(), lambda: "the simulator on %s" % ", ".join(sorted(unheard())))


class Robot:
    """Baxter in the simulator, as seen on its topics. Needs an initialized node."""

    def __init__(self, with_grippers=True):
        self.angles, self.speeds, self.efforts = {}, {}, {}
        self._stamp_s, self._moved_s = 0.0, {}  # of the newest joint state; of the last one in which a joint moved
        self.state, self.head, self.grippers, self.digital, self.analog = None, None, {}, {}, {}
        self._watchers = []
        self._arms = {side: rospy.Publisher("/robot/limb/%s/joint_command" % side, JointCommand, queue_size=1)
                      for side in SIDES}
        self._enable = rospy.Publisher("/robot/set_super_enable", Bool, queue_size=1)
        self._reset = rospy.Publisher("/robot/set_super_reset", Empty, queue_size=1)
        self._sides = SIDES if with_grippers else ()
        for topic, kind, take in (
                ("joint_states", JointState, self._take_joints),
                ("state", AssemblyState, lambda message: setattr(self, "state", message)),
                ("head/head_state", HeadState, lambda message: setattr(self, "head", message)),
                ("digital_io_states", DigitalIOStates, self._take_digital),
                ("analog_io_states", AnalogIOStates, self._take_analog)):
            rospy.Subscriber("/robot/" + topic, kind, take)
        for side in self._sides:
            rospy.Subscriber("/robot/end_effector/%s_gripper/state" % side, EndEffectorState, self._take_gripper, side)
        wait_until(lambda: self.angles and self.state and self.head and self.digital and self.analog
                   and len(self.grippers) == len(self._sides), "the robot's states")
        model = ElementTree.fromstring(rospy.get_param("/robot_description"))
        self.effort_limits = {joint.get("name"): float(joint.find("limit").get("effort"))
                              for joint in model.findall("joint") if joint.find("limit") is not None}

    def watch(self):
        """Start a Watch, which sees every joint state from now on."""
        watch = Watch(self)
        self._watchers.append(watch)
        return watch

    def unwatch(self, watch):
        self._watchers.remove(watch)

    def enable(self):
        """Bring the robot into the enabled state, from a stop as well."""
        def tried():
            (self._reset.publish() if self.state.stopped else self._enable.publish(True))
            return self.state.enabled
        wait_until(tried, "the robot's enabling", interval_s=0.1)

    def move(self, angles, timeout_s=60.0):
        """Move joints to ``angles``, {name: angle [rad]}, by position commands, and wait for their rest there."""
        commands = {}
        for side in SIDES:
            names = [name for name in joint_names(side) if name in angles]
            if names:
                command = [angles[name] for name in names]
                commands[side] = JointCommand(mode=JointCommand.POSITION_MODE, names=names, command=command)

        def is_there():
            for side, command in commands.items():
                self._arms[side].publish(command)
            return all(abs(self.angles[name] - angle) < NEAR_RAD and abs(self.speeds[name]) < RESTING_RAD_S
                       for name, angle in angles.items())
        wait_until(is_there, lambda: "the arms to be within %g rad; they are %.3f rad off" % (
            NEAR_RAD, self.off(angles)), timeout_s, 1.0 / COMMAND_HZ)

    def move_by(self, side, change):
        """Move all joints of an arm by ``change`` [rad]."""
        self.move({name: self.angles[name] + change for name in joint_names(side)})

    def pose(self, name):
        """{joint: angle [rad]} of both arms in a pose of the model."""
        return {**poses().angles(name, "left"), **poses().angles(name, "right")}

    def off(self, angles):
        """The largest distance from ``angles``, {name: angle [rad]}, of a joint [rad]."""
        return max(abs(self.angles[name] - angle) for name, angle in angles.items())

    def press(self, component, hold):
        """Press a button, call ``hold``, and release it."""
        self._act(component, "press")
        hold()
        self._act(component, "release")

    def turn(self, wheel, steps):
        self._act(wheel, "turn", steps)

    def push(self, link, force, seconds):
        """Push a link in its centre with ``force``, (x, y, z) [N] of the world, for ``seconds`` of simulated time."""
        request = ApplyBodyWrenchRequest(body_name="baxter::" + link, duration=rospy.Duration(seconds))
        request.wrench.force.x, request.wrench.force.y, request.wrench.force.z = force
        answer = rospy.ServiceProxy("/gazebo/apply_body_wrench", ApplyBodyWrench)(request)
        assert answer.success, answer.status_message

    def release(self, link):
        rospy.ServiceProxy("/gazebo/clear_body_wrenches", BodyRequest)("baxter::" + link)

    def wait_for_joint(self, name, goal, tolerance):
        """Wait until a joint rests within ``tolerance`` of ``goal`` [rad], and return how far it is off."""
        wait_until(lambda: abs(self.angles[name] - goal) < tolerance and abs(self.speeds[name]) < RESTING_RAD_S,
                   lambda: "%s at %.3f rad; it is at %.3f" % (name, goal, self.angles[name]))
        return abs(self.angles[name] - goal)

    def wait_for_way(self, name, start, way):
        """Wait until a joint has moved from ``start`` by at least ``way``, in its direction [rad]."""
        wait_until(lambda: (self.angles[name] - start) / way > 1.0,
                   lambda: "%s to move by %.2f rad; it moved by %.3f" % (name, way, self.angles[name] - start))

    def wait_for_rest(self, name):
        """Wait until a joint has rested for RESTING_S from now on."""
        begin_s = self._stamp_s
        wait_until(lambda: self._stamp_s - max(begin_s, self._moved_s.get(name, 0.0)) > RESTING_S, "%s to rest" % name)

    def wait_for_lights(self, side, lit):
        """Wait until both lights of a navigator are on or off."""
        wait_until(lambda: all(self.digital["%s_%s_light" % (side, which)] == lit for which in ("inner", "outer")),
                   "the %s navigator's lights to be %s" % (side, "on" if lit else "off"))

    def wait_for_flag(self, side, flag, value):
        """Wait until a field of a gripper's state has a value."""
        wait_until(lambda: getattr(self.grippers[side], flag) == value,
                   lambda: "the %s gripper's %s to be %s" % (side, flag, value))

    def wait_for_state(self, enabled, stopped):
        wait_until(lambda: (self.state.enabled, self.state.stopped) == (enabled, stopped),
                   lambda: "enabled %s, stopped %s; found: %s" % (enabled, stopped, self.state))

    def wait_for_gripper(self, side, low, high, timeout_s=DEADLINE_S):
        """Wait until a calibrated gripper is between ``low`` and ``high`` [%]."""
        wait_until(lambda: low <= self.grippers[side].position <= high and self.grippers[side].calibrated == 1,
                   lambda: "the %s gripper between %g and %g %%; it is at %.1f %%" % (
                       side, low, high, self.grippers[side].position), timeout_s)

    def _act(self, component, action, steps=0):
        answer = rospy.ServiceProxy("/robot/sim/press", Press)(component=component, action=action, steps=steps)
        assert answer.success, answer.status_message

    def _take_joints(self, message):
        self.angles = dict(zip(message.name, message.position, strict=True))
        self.speeds = dict(zip(message.name, message.velocity, strict=True))
        self.efforts = dict(zip(message.name, message.effort, strict=True))
        self._stamp_s = message.header.stamp.to_sec()
        self._moved_s.update((name, self._stamp_s) for name, speed in self.speeds.items()
                             if abs(speed) >= RESTING_RAD_S)
        for watch in tuple(self._watchers):
            watch.take()

    def _take_gripper(self, message, side):
        self.grippers[side] = message
        for watch in tuple(self._watchers):
            watch.percents.setdefault(side, []).append(message.position)

    def _take_digital(self, message):
        self.digital = {name: state.state for name, state in zip(message.names, message.states, strict=True)}
        for watch in tuple(self._watchers):
            watch.digital.append(self.digital)

    def _take_analog(self, message):
        self.analog = {name: state.value for name, state in zip(message.names, message.states, strict=True)}
        for watch in tuple(self._watchers):
            watch.analog.append(self.analog)


class Watch:
    """Lowest, highest and mean angles, highest speeds and efforts since its begin; all values of grippers and
    components."""

    def __init__(self, robot):
        self._robot = robot
        self.low, self.high, self.speed, self.effort = {}, {}, {}, {}
        self._sums, self._count = {}, 0
        self.percents, self.digital, self.analog, self.nodded = {}, [], [], False

    def take(self):
        robot = self._robot
        self._count += 1
        for name, angle in robot.angles.items():
            self.low[name] = min(angle, self.low.get(name, angle))
            self.high[name] = max(angle, self.high.get(name, angle))
            self._sums[name] = self._sums.get(name, 0.0) + angle
            self.speed[name] = max(abs(robot.speeds[name]), self.speed.get(name, 0.0))
            self.effort[name] = max(abs(robot.efforts[name]), self.effort.get(name, 0.0))
        self.nodded = self.nodded or robot.head.isNodding

    def mean(self, name):
        """A joint's mean angle [rad]; joint states come at a constant rate of simulated time."""
        return self._sums[name] / self._count

    def span(self, name):
        """How far a joint has moved between its ends [rad]."""
        return self.high[name] - self.low[name]

    def changes(self, component):
        """How often a digital component has changed."""
        states = [state[component] for state in self.digital]
        return sum(a != b for a, b in itertools.pairwise(states))

    def load(self):
        """(largest share of its limit that an arm joint's effort had, that joint)."""
        limits = self._robot.effort_limits
        return max((self.effort[name] / limits[name], name) for side in SIDES for name in joint_names(side))
