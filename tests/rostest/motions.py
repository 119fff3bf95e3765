# SPDX-License-Identifier: BSD-3-Clause
"""Kinds of motion of the robot, for the tests that interrupt each of them.

``start`` begins a motion; while its program runs, ``beat`` is called every 10 ms of simulated time.
"""
import actionlib
import rospy
from actionlib_msgs.msg import GoalStatus
from baxter_core_msgs.msg import EndEffectorCommand, HeadPanCommand, JointCommand
from baxter_traj_streamer.msg import trajAction, trajGoal
from control_msgs.msg import FollowJointTrajectoryAction, FollowJointTrajectoryGoal
from interruption_bench import DEADLINE_S, TICK_S, Program, joints
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from baxter_model import ELECTRIC, JOINTS, SIDES
from lab_testing.waiting import wait_until

POSITION, VELOCITY, TORQUE, RAW = 1, 2, 3, 4
# Distance of a motion from the arms' start [rad], and its duration [s]: long enough to be interrupted.
WAY = dict(zip(JOINTS, (0.5, -0.6, 0.4, 0.6, -0.6, 0.6, 0.8), strict=True))
DURATION_S = 2.0
# An interrupting command of another program [rad from the arm's position].
ELSEWHERE = dict.fromkeys(JOINTS, 0.05)


class Motion:
    """side: which arm moves; ``has_ended()``: whether the program or the goal has ended."""

    title = ""

    def __init__(self, bench, side):
        self.bench, self.side = bench, side
        self.names = joints(side)

    def prepare(self):
        """Start the programs that it needs."""

    def start(self):
        self.begin_s = self.bench._time.to_sec()
        here = self.bench.positions()
        self.here = {name: here[name] for name in self.names}
        self.goal = {name: self.here[name] + WAY[name[-2:]] for name in self.names}

    def beat(self):
        """The program's action every 10 ms."""

    def lose_client(self):
        """Kill the program of the motion."""

    def go_back(self):
        """Command the motion back; for parts that move by one command."""
        raise NotImplementedError

    def has_ended(self):
        return True

    def close(self):
        """End what ``prepare`` started."""


class Stream(Motion):
    """Commands of one mode at 100 Hz, as Limb sends them."""

    def __init__(self, bench, side, mode):
        super().__init__(bench, side)
        self.title = {POSITION: "position", VELOCITY: "velocity", TORQUE: "torque", RAW: "raw position"}[mode]
        self._mode = mode
        self._publisher = None

    def start(self):
        super().start()
        self._publisher = rospy.Publisher("/robot/limb/%s/joint_command" % self.side, JointCommand, queue_size=1,
                                          tcp_nodelay=True)
        # The robot, and the bench.
        wait_until(lambda: self._publisher.get_num_connections() >= 2, "the robot receives the commands", DEADLINE_S)
        self.alive = True

    def beat(self):
        if not self.alive:
            return
        share = min((self.bench._time.to_sec() - self.begin_s) / DURATION_S, 1.0)
        values = {
            POSITION: [self.here[name] + share * WAY[name[-2:]] for name in self.names],
            VELOCITY: [WAY[name[-2:]] / DURATION_S for name in self.names],
            TORQUE: [3.0 * WAY[name[-2:]] * (3.0 if name[-2] in "se" else 0.3) for name in self.names],
        }.get(self._mode)
        if values is None:
            values = [self.here[name] + share * WAY[name[-2:]] for name in self.names]
        self._publisher.publish(JointCommand(self._mode, values, self.names))

    def lose_client(self):
        self.alive = False
        self._publisher.unregister()

    def close(self):
        if self._publisher is not None:
            self.lose_client()


class ActionMotion(Motion):
    """A goal of an external action server. ``command``: starts that server."""

    action, topic, command = None, "", ()

    def prepare(self):
        self._server = Program(*self.command)
        self._client = actionlib.ActionClient(self.topic, self.action)
        # The client's own wait uses simulated time, which is paused.
        self.bench.run_until(lambda: self._client.pub_goal.get_num_connections() and self._client.last_status_msg,
                             "%s serves" % self.topic, most_s=300.0)

    def start(self):
        super().start()
        self._handle = self._client.send_goal(self.make_goal(self.goal))
        self._sent_s = self.bench._time.to_sec()

    def make_goal(self, goal):
        """A goal of ``goal`` (dict of joint name to rad) in DURATION_S."""
        raise NotImplementedError

    def trajectory(self, goal):
        return JointTrajectory(joint_names=list(goal), points=[JointTrajectoryPoint(
            positions=list(goal.values()), velocities=[0.0] * len(goal),
            time_from_start=rospy.Duration.from_sec(DURATION_S))])

    def lose_client(self):
        self._client.stop()

    def cancel(self):
        self._handle.cancel()

    def replace(self, goal):
        """Send another goal, which replaces this one; returns its handle."""
        return self._client.send_goal(self.make_goal(goal))

    def kill_server(self):
        self._server.kill()

    def has_ended(self):
        return self._handle.get_comm_state() == actionlib.CommState.DONE

    @property
    def status(self):
        return self._handle.get_goal_status()

    @property
    def text(self):
        return self._handle.get_goal_status_text() or getattr(self._handle.get_result(), "error_string", "")

    def succeeds(self, goal):
        """Send a goal and check that it succeeds: the server still works."""
        handle = self._client.send_goal(self.make_goal(goal))
        self.bench.run_until(lambda: handle.get_comm_state() == actionlib.CommState.DONE, "the next goal")
        state, text = handle.get_goal_status(), handle.get_goal_status_text()
        assert state == GoalStatus.SUCCEEDED, "the next goal ended with state %d: %s" % (state, text)

    def close(self):
        self._server.end()
        if self._client.pub_goal.impl is not None:
            self._client.stop()


class TrajectoryAction(ActionMotion):
    """The SDK's trajectory server in one of its modes."""

    action = FollowJointTrajectoryAction

    def __init__(self, bench, side, mode):
        super().__init__(bench, side)
        self.title = "trajectory action, %s" % mode
        self.topic = "/robot/limb/%s/follow_joint_trajectory" % side
        self.command = ("rosrun", "baxter_interface", "joint_trajectory_action_server.py", "-l", side, "-m", mode)

    def make_goal(self, goal):
        made = FollowJointTrajectoryGoal(trajectory=self.trajectory(goal))
        made.goal_time_tolerance = rospy.Duration(20.0)  # no goal fails because the machine is busy
        return made


class StreamerAction(ActionMotion):
    """Case Western's trajectory server."""

    title, action, topic = "baxter_traj_streamer", trajAction, "/trajActionServer"
    command = ("rosrun", "baxter_traj_streamer", "traj_interpolator_as")

    def make_goal(self, goal):
        here = self.bench.positions()
        trajectory = self.trajectory(goal)
        trajectory.points.insert(0, JointTrajectoryPoint(positions=[here[name] for name in goal],
                                                         velocities=[0.0] * len(goal)))
        return trajGoal(trajectory=trajectory)


class ProgramMotion(Motion):
    """A program that moves the arms by the SDK and ends with a status."""

    def __init__(self, bench, side, title, *command):
        super().__init__(bench, side)
        self.title, self._command = title, command
        self._program = None

    def start(self):
        super().start()
        self._program = Program(*self._command)

    def has_ended(self):
        return self._program.has_ended

    def lose_client(self):
        self._program.kill()

    def close(self):
        if self._program is not None:
            self._program.end()


class GripperMotion(Motion):
    """The fingers of the electric gripper close, slowly."""

    title = "gripper"

    def prepare(self):
        topic = "/robot/end_effector/%s_gripper/command" % self.side
        self._publisher = rospy.Publisher(topic, EndEffectorCommand, queue_size=10)
        self._number = 0
        wait_until(self._publisher.get_num_connections, "the gripper listens", DEADLINE_S)

    def start(self):
        super().start()
        self._say("set", '{"velocity": 5.0}')
        self._say("go", '{"position": 20.0}')

    def go_back(self):
        # To another position, whether it is closed or open, at the slow speed that was set.
        self._say("go", '{"position": 50.0}')

    def _say(self, command, arguments):
        self._number += 1
        self._publisher.publish(EndEffectorCommand(
            id=ELECTRIC.id, command=command, args=arguments, sender="/interruptions", sequence=self._number))
        self.bench.run(TICK_S)

    def close(self):
        self._publisher.unregister()


class HeadMotion(Motion):
    """The head pans, slowly."""

    title = "head"

    def prepare(self):
        self._publisher = rospy.Publisher("/robot/head/command_head_pan", HeadPanCommand, queue_size=10)
        wait_until(self._publisher.get_num_connections, "the head listens", DEADLINE_S)

    def start(self):
        super().start()
        self._publisher.publish(HeadPanCommand(target=1.0, speed_ratio=0.05,
                                               enable_pan_request=HeadPanCommand.REQUEST_PAN_ENABLE))

    def go_back(self):
        self._publisher.publish(HeadPanCommand(target=-1.0, speed_ratio=0.5,
                                               enable_pan_request=HeadPanCommand.REQUEST_PAN_ENABLE))

    def close(self):
        self._publisher.unregister()


def all_motions(bench):
    """All kinds of motion; they alternate between the arms, so that both are tested."""
    left, right = SIDES
    # The robot starts in neutral, so move_to_neutral would not move.
    move = "from baxter_interface import Limb, startup; startup.init_node('move'); limb = Limb('%s'); " \
        "limb.move_to_joint_positions({name: angle + 0.3 for name, angle in limb.joint_angles().items()})" % right
    return {
        **{"stream_%d" % mode: Stream(bench, SIDES[mode % 2], mode) for mode in (POSITION, VELOCITY, TORQUE, RAW)},
        "action_position": TrajectoryAction(bench, left, "position"),
        "action_velocity": TrajectoryAction(bench, right, "velocity"),
        "action_position_w_id": TrajectoryAction(bench, left, "position_w_id"),
        "streamer": StreamerAction(bench, right),
        "gripper": GripperMotion(bench, left),
        "head": HeadMotion(bench, left),
        "sdk_move": ProgramMotion(bench, right, "move_to_joint_positions", "python3", "-c", move),
        "tuck": ProgramMotion(bench, left, "tuck_arms.py", "rosrun", "baxter_tools", "tuck_arms.py", "-t"),
    }
