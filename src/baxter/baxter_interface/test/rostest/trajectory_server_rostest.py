#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Every way in which a trajectory goal can end; and nothing moves when nothing should."""
import math
import os
import signal
import threading
import unittest
import xmlrpc.client

import rosgraph
import rospy
from actionlib_msgs.msg import GoalStatus
from baxter_core_msgs.msg import AssemblyState, DigitalIOState, JointCommand
from control_msgs.msg import FollowJointTrajectoryResult, JointTolerance
from dynamic_reconfigure.client import Client as ParameterClient
from dynamic_reconfigure.msg import Config, DoubleParameter
from dynamic_reconfigure.srv import Reconfigure
from trajectory_client import TrajectoryClient
from trajectory_msgs.msg import JointTrajectoryPoint

from baxter_dataflow import wait_for
from baxter_interface import Limb, RobotEnable
from lab_testing.knobs import reload
from lab_testing.waiting import stretched, wait_for_time

DEADLINE_S = stretched(90.0)
HOME = [0.2, 0.5, 0.0, 0.5, -0.2, -0.1, 0.0]
AWAY = [0.4, 0.3, 0.2, 0.7, 0.0, 0.1, 0.2]
# Duration of a pause of the server's process: shorter than it waits for joint states [s, ROS time].
PAUSE_S = 0.3
# Number of the robot's state messages, at 100 Hz, after which a server at 100 Hz counts as silent.
QUIET_MESSAGES = 30


class TrajectoryServerTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.robot = RobotEnable()
        cls.limb = Limb("left")
        cls.client = TrajectoryClient("left")
        cls.heard = threading.Condition()
        cls.commands, cls.dynamics, cls.states = [], [], 0
        cls.cuff = rospy.Publisher("/robot/digital_io/left_lower_cuff/state", DigitalIOState, queue_size=1)
        cls.stranger = rospy.Publisher("/robot/limb/left/joint_command", JointCommand, queue_size=1)
        cls.subscribers = [
            rospy.Subscriber("/robot/limb/left/joint_command", JointCommand, cls.on_command),
            rospy.Subscriber("/robot/limb/left/inverse_dynamics_command", JointTrajectoryPoint, cls.dynamics.append),
            rospy.Subscriber("/robot/state", AssemblyState, cls.on_state)]
        # The server, the test itself, and for commands also the robot.
        cls.wait_for(lambda: cls.cuff.get_num_connections() >= 1 and cls.stranger.get_num_connections() >= 3,
                     "the server to listen")

    @classmethod
    def on_command(cls, message):
        cls.commands.append(message)

    @classmethod
    def on_state(cls, message):
        with cls.heard:
            cls.states += 1
            cls.heard.notify_all()

    @staticmethod
    def wait_for(test, what):
        wait_for(test, DEADLINE_S, timeout_msg="timed out waiting for %s" % what)

    def setUp(self):
        self.knobs()
        self.squeeze(False)
        self.ready()

    def ready(self):
        """The robot is enabled, the server knows it, and the arm is at home."""
        self.insist(self.robot.enable)
        self.wait_for(lambda: self.client.go([(0.6, HOME)])[0] == GoalStatus.SUCCEEDED, "a goal that succeeds")

    def insist(self, request):
        """Make a request of the robot until it has worked: on a busy machine it may take longer than usual."""
        def works():
            try:
                request()
            except OSError:
                return False
            return True

        self.wait_for(works, request.__name__)

    def knobs(self, **knobs):
        for name, value in {"enabled": True, "stuck": [], **knobs}.items():
            rospy.set_param("/fake_robot/" + name, value)
        reload("/fake_robot")

    def squeeze(self, pressed):
        self.cuff.publish(state=int(pressed), isInputOnly=True)

    def pass_states(self, count):
        with self.heard:
            end = self.states + count
            self.assertTrue(self.heard.wait_for(lambda: self.states >= end, DEADLINE_S), "no robot states")

    def assert_quiet(self):
        """Check that nobody commands the arm. Messages that are still in transit are ignored first."""
        self.pass_states(QUIET_MESSAGES)
        before = len(self.commands)
        self.pass_states(QUIET_MESSAGES)
        self.assertEqual(len(self.commands), before, "the arm is still commanded")

    def assert_commanded(self):
        before = len(self.commands)
        self.wait_for(lambda: len(self.commands) > before + 5, "commands")

    def assert_succeeds(self, end):
        self.assertEqual(end, (GoalStatus.SUCCEEDED, FollowJointTrajectoryResult.SUCCESSFUL, ""))

    def assert_aborts(self, end, code, *texts):
        self.assertEqual(end[:2], (GoalStatus.ABORTED, code), end)
        for text in texts:
            self.assertIn(text, end[2])

    def under_way(self):
        self.wait_for(lambda: len(self.client.feedback) > 10, "feedback")

    def close_to(self, pose):
        names = self.client.names
        return all(abs(self.limb.joint_angle(name) - wanted) < 0.02 for name, wanted in zip(names, pose, strict=True))

    # -- goals that are carried out ---------------------------------------------------------------------------------

    def test_goal_is_reached_reported_once_and_held(self):
        before = sum(self.client.ends.values())
        self.dynamics.clear()
        self.assert_succeeds(self.client.go([(0.5, AWAY), (0.8, HOME)]))
        feedback = list(self.client.feedback)
        self.assertGreater(len(feedback), 10)
        for message in feedback:
            self.assertEqual(list(message.joint_names), self.client.names)
            self.assertEqual([len(message.desired.positions), len(message.actual.positions),
                              len(message.error.positions), len(message.desired.accelerations)], [7] * 4)
        times = [message.actual.time_from_start.to_sec() for message in feedback]
        self.assertEqual(times, sorted(times))
        self.assertTrue(self.dynamics and all(len(point.velocities) == 7 for point in self.dynamics))
        self.assert_commanded()
        self.assertEqual(self.commands[-1].mode, JointCommand.RAW_POSITION_MODE)
        self.wait_for(lambda: self.close_to(HOME), "the arm at home")
        self.assertEqual(sum(self.client.ends.values()), before + 1)

    def test_some_joints_in_any_order(self):
        self.release()
        self.assert_succeeds(self.client.go([(0.5, [0.3, 0.4])], names=["left_w2", "left_s0"]))
        self.assertEqual(set(self.commands[-1].names), {"left_w2", "left_s0"})

    def test_goal_as_a_motion_planner_sends_it(self):
        """With a stamp ahead, velocities and accelerations, one point without, the first point where the arm is."""
        rest, middle = [0.0] * 7, [(h + a) / 2.0 for h, a in zip(HOME, AWAY, strict=True)]
        self.assert_succeeds(self.client.go(
            [(0.0, HOME, rest, rest), (0.3, middle, [0.4] * 7, rest), (0.45, [m + 0.05 for m in middle]),
             (0.7, AWAY, rest, rest)], stamp=rospy.Time.now() + rospy.Duration(0.2)))
        self.wait_for(lambda: self.close_to(AWAY), "the arm at its goal")

    def test_another_goal_takes_over(self):
        other = TrajectoryClient("left")
        self.client.send([(20.0, AWAY)])
        self.under_way()
        self.assert_succeeds(other.go([(0.6, HOME)]))
        self.assertEqual(self.client.end()[0], GoalStatus.PREEMPTED)

    def test_cancelled_goal_is_preempted_and_the_arm_holds(self):
        self.client.send([(20.0, AWAY)])
        self.under_way()
        self.client.cancel()
        self.assertEqual(self.client.end()[0], GoalStatus.PREEMPTED)
        self.assert_commanded()
        self.assertFalse(self.close_to(AWAY))

    def test_server_that_is_held_up_skips_no_part_of_the_path(self):
        duration_s, took_s = 2.0, []

        def goes_on():
            begin = rospy.get_time()
            self.client.send([(duration_s, AWAY)])
            self.under_way()
            paused_s = self.pause("/server")
            # On a busy machine the pause may become so long that the goal is aborted.
            ended = self.client.end()[0] == GoalStatus.SUCCEEDED
            took_s[:] = [rospy.get_time() - begin, duration_s + 0.5 * paused_s]
            return ended or self.ready()

        self.wait_for(goes_on, "a goal that succeeds in spite of a pause")
        self.assertGreater(*took_s)

    @staticmethod
    def pause(node):
        """Stop a node's process for PAUSE_S; return for how long it stood still at least [s, ROS time]."""
        pid = node_pid(node)
        os.kill(pid, signal.SIGSTOP)
        begin = rospy.get_time()
        try:
            wait_for_time(PAUSE_S)
            return rospy.get_time() - begin
        finally:
            os.kill(pid, signal.SIGCONT)

    # -- goals that are refused -------------------------------------------------------------------------------------

    def test_what_is_wrong_is_said_before_anything_moves(self):
        names, invalid = self.client.names, FollowJointTrajectoryResult.INVALID_GOAL
        joints = FollowJointTrajectoryResult.INVALID_JOINTS
        self.release()
        cases = [
            (invalid, "no points", {"points": []}),
            (invalid, "point 0 has 2 positions, expected 7", {"points": [(1.0, [0.0, 0.0])]}),
            (invalid, "point 0 has 1 velocity", {"points": [(1.0, HOME, [0.0])]}),
            (invalid, "not finite", {"points": [(1.0, [*HOME[:6], float("nan")])]}),
            (invalid, "not finite", {"points": [(1.0, HOME, [float("inf")] * 7)]}),
            (invalid, "time_from_start must increase", {"points": [(1.0, HOME), (1.0, HOME)]}),
            (invalid, "due at once", {"points": [(0.0, HOME)]}),
            (joints, "unknown joint right_s0", {"points": [(1.0, HOME)], "names": ["right_s0", *names[1:]]}),
            (joints, "more than once", {"points": [(1.0, HOME)], "names": [names[0], *names[:6]]}),
            (joints, "joint_names is empty", {"points": [(1.0, [])], "names": []}),
            (FollowJointTrajectoryResult.OLD_HEADER_TIMESTAMP, "in the past",
             {"points": [(1.0, HOME)], "stamp": rospy.Time.now() - rospy.Duration(10.0)}),
        ]
        for code, text, goal in cases:
            self.assert_aborts(self.client.go(**goal), code, text)
        self.insist(self.robot.disable)
        # The server may hear of it a little later.
        self.wait_for(lambda: "not enabled" in self.client.go([(1.0, AWAY)])[2], "goals to be refused while disabled")
        self.insist(self.robot.enable)
        self.assert_quiet()

    def test_refused_goal_does_not_disturb_the_one_before(self):
        self.client.send([(1.0, AWAY)])
        self.under_way()
        self.assert_aborts(TrajectoryClient("left").go([(1.0, [9.0])]), FollowJointTrajectoryResult.INVALID_GOAL)
        self.assert_succeeds(self.client.end())

    # -- goals that fail --------------------------------------------------------------------------------------------

    def test_blocked_joint(self):
        self.knobs(stuck=["left_e1"])
        self.assert_aborts(self.client.go([(3.0, [*HOME[:3], HOME[3] + 1.0, *HOME[4:]])]),
                           FollowJointTrajectoryResult.PATH_TOLERANCE_VIOLATED, "left_e1 path error 0.",
                           "(position, tolerance 0.35) at ")
        self.assert_commanded()

    def test_collision_that_the_robot_feels_is_in_the_result(self):
        self.knobs(stuck=["left_e1"], collides=True)
        self.addCleanup(self.knobs, collides=False)
        self.assert_aborts(self.client.go([(3.0, [*HOME[:3], HOME[3] + 1.0, *HOME[4:]])]),
                           FollowJointTrajectoryResult.PATH_TOLERANCE_VIOLATED, "left_e1 path error", "a collision")

    def test_tolerances_of_the_goal(self):
        self.knobs(stuck=["left_e1"])
        free, tight = JointTolerance(name="left_e1", position=-1.0), JointTolerance(name="left_e1", position=0.05)
        self.assert_aborts(
            self.client.go([(0.5, AWAY)], path_tolerance=[free], goal_tolerance=[tight],
                           goal_time_tolerance=rospy.Duration.from_sec(0.2)),
            FollowJointTrajectoryResult.GOAL_TOLERANCE_VIOLATED, "left_e1 goal error 0.2", "tolerance 0.05",
            "s after the end")

    def test_tolerances_as_parameters(self):
        self.knobs(stuck=["left_e1"])
        parameters = ParameterClient("/server", timeout=DEADLINE_S)
        self.addCleanup(parameters.update_configuration, {"left_e1_trajectory": 0.35})
        parameters.update_configuration({"left_e1_trajectory": 0.1})
        self.assert_aborts(self.client.go([(3.0, AWAY)]), FollowJointTrajectoryResult.PATH_TOLERANCE_VIOLATED,
                           "left_e1 path error 0.", "tolerance 0.1)")

    def test_what_no_parameter_can_be_does_not_get_in(self):
        updates = []
        listener = rospy.Subscriber("/server/parameter_updates", Config, updates.append)
        self.addCleanup(listener.unregister)
        set_parameters = rospy.ServiceProxy("/server/set_parameters", Reconfigure)
        self.addCleanup(set_parameters, Config(doubles=[DoubleParameter("left_e1_trajectory", 0.35)]))
        for name, value, text in (("left_e1_trajectory", math.nan, "left_e1_trajectory is nan, expected -1 to 1"),
                                  ("left_e7_trajectory", math.inf, "there is no parameter 'left_e7_trajectory'")):
            with self.assertRaisesRegex(rospy.ServiceException, text):
                set_parameters(Config(doubles=[DoubleParameter(name, value)]))
        answer = set_parameters(Config(doubles=[DoubleParameter("left_e1_trajectory", math.inf)]))
        self.wait_for(lambda: updates and updates[-1] == answer.config, "the update")
        values = {parameter.name: parameter.value for parameter in answer.config.doubles}
        self.assertEqual(values["left_e1_trajectory"], 1.0)
        self.assertEqual([name for name, value in values.items() if not math.isfinite(value)], [])
        self.assertNotIn("left_e7_trajectory", values)

    def test_disabled_or_stopped_on_the_way_and_nothing_moves_afterwards(self):
        for interrupt, text in ((self.robot.disable, "the robot was disabled"),
                                (self.robot.stop, "the robot was stopped")):
            self.ready()
            self.client.send([(30.0, AWAY)])
            self.under_way()
            self.insist(interrupt)
            self.assert_aborts(self.client.end(), FollowJointTrajectoryResult.PATH_TOLERANCE_VIOLATED, text,
                               "s after the start", "rad from its end")
            self.insist(self.robot.enable)
            self.assert_quiet()

    def test_cuff(self):
        self.client.send([(20.0, AWAY)])
        self.under_way()
        self.squeeze(True)
        self.assert_aborts(self.client.end(), FollowJointTrajectoryResult.PATH_TOLERANCE_VIOLATED, "cuff was squeezed")
        self.assert_aborts(self.client.go([(0.5, AWAY)]), FollowJointTrajectoryResult.INVALID_GOAL, "cuff is squeezed")
        self.assert_quiet()

    def test_another_node_that_commands_the_arm_afterwards_gets_it(self):
        self.assert_commanded()
        self.release()
        self.assert_quiet()

    def release(self):
        """Command the arm from here, until the server has released it."""
        own = rospy.get_name()

        def let_go():
            del self.commands[:]
            self.stranger.publish(mode=JointCommand.POSITION_MODE, names=["left_w2"], command=[0.0])
            self.pass_states(10)
            return not [command for command in self.commands if command._connection_header["callerid"] != own]

        self.wait_for(let_go, "the server to let go of the arm")

    def test_robot_that_is_killed_on_the_way_and_comes_back(self):
        self.client.send([(30.0, AWAY)])
        self.under_way()
        pid = node_pid("/fake_robot")
        os.kill(pid, signal.SIGKILL)
        end = self.client.end()
        self.assert_aborts(end, FollowJointTrajectoryResult.PATH_TOLERANCE_VIOLATED, "s after the start")
        # The latter if the robot was back before its loss was detected.
        self.assertRegex(end[2], "the robot was lost|time went back from .* the simulation was reset or restarted")
        wait_for(lambda: node_pid("/fake_robot") not in (None, pid), DEADLINE_S,
                 timeout_msg="timed out waiting for the robot's return")
        self.knobs()
        self.pass_states(QUIET_MESSAGES)
        self.insist(self.robot.enable)
        self.assert_quiet()
        self.ready()


def node_pid(name):
    """The process of a node, None if it does not answer."""
    try:
        uri = rosgraph.Master(rospy.get_name()).lookupNode(name)
        return xmlrpc.client.ServerProxy(uri).getPid(rospy.get_name())[2]
    except (OSError, rosgraph.MasterException):
        return None


if __name__ == "__main__":
    import rostest

    rospy.init_node("trajectory_server_rostest")
    rostest.rosrun("baxter_interface", "trajectory_server", TrajectoryServerTest)
