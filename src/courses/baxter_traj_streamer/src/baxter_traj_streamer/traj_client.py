# SPDX-License-Identifier: BSD-3-Clause
"""Sends trajectories to trajActionServer, and waits for server and robot."""
from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any

import actionlib
import rospy
from actionlib.action_client import get_name_of_constant
from actionlib_msgs.msg import GoalStatus
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from baxter_dataflow.waiting import Stopwatch
from baxter_interface import startup
from baxter_interface.waiting import FIRST_NOTICE_S

from .interpolator import ACTION_NAME
from .streamer import BaxterTrajStreamer
from .versions import VERSIONS, Version

if TYPE_CHECKING:
    import numpy as np

# Polling period for the end of a goal [s, wall].
_POLL_S = 0.01


class MoveFailed(Exception):
    """The goal was not reached; the text says why. ``status``: of actionlib_msgs/GoalStatus."""

    def __init__(self, status: int, text: str) -> None:
        super().__init__("the goal ended as %s: %s" % (get_name_of_constant(GoalStatus, status), text))
        self.status = status


class SentGoal:
    """An active goal. It is polled instead of waiting for events, because a response may arrive before send()
    returns."""

    def __init__(self, client: actionlib.ActionClient, goal: Any, feedback: Callable[[float], object]) -> None:
        self._client = client
        self._handle = client.send_goal(goal, feedback_cb=lambda _, message: feedback(message.fdbk))

    def cancel(self) -> None:
        """Cancel the goal."""
        self._handle.cancel()

    def is_active(self) -> bool:
        """Whether it is being executed."""
        return self._handle.get_comm_state() == actionlib.CommState.ACTIVE

    def is_over(self) -> bool:
        """Whether it has ended in any state."""
        return self._handle.get_comm_state() in (actionlib.CommState.DONE, actionlib.CommState.LOST)

    def wait(self, timeout_s: float | None = None) -> bool:
        """Wait for the end, at most ``timeout_s`` [s, ROS time]; returns whether it has come.

        Raises MoveFailed when the server is gone, ROSInterruptException when ROS shuts down.
        """
        watch = Stopwatch(rospy.get_time())
        while not self.is_over():
            _raise_if_interrupted()
            if timeout_s is not None and watch.elapsed_s(rospy.get_time()) >= timeout_s:
                return False
            if not self._client.pub_goal.get_num_connections():
                raise MoveFailed(GoalStatus.LOST, "%s is gone" % ACTION_NAME)
            time.sleep(_POLL_S)
        return True

    def outcome(self) -> tuple[Any, Any, Any]:
        """(status as in actionlib_msgs/GoalStatus, text, result message) of a goal that is over."""
        return self._handle.get_terminal_state(), self._handle.get_goal_status_text(), self._handle.get_result()


class TrajClient:
    """A robot's arms and the server that moves them; ``streamer`` is the library for paths.

    Raises what BaxterTrajStreamer raises.
    """

    def __init__(self) -> None:
        self.streamer = BaxterTrajStreamer()
        self._found: tuple[actionlib.ActionClient, Version] | None = None

    def wait_until_ready(self) -> None:
        """Wait for the server and for the robot to be enabled, in any order, and print what it waits for.

        Raises ValueError for a server of another action, ROSInterruptException when ROS shuts down.
        """
        self._wait("%s: rosrun baxter_traj_streamer traj_interpolator_as" % ACTION_NAME, self._connect)
        self._wait("%s to answer" % ACTION_NAME,
                   lambda: self._server[0].wait_for_server(rospy.Duration.from_sec(_POLL_S)))
        if why := self.streamer.robot.why_not_ready():
            self._wait("the robot: %s" % why, lambda: not self.streamer.robot.why_not_ready())

    @property
    def _server(self) -> tuple[actionlib.ActionClient, Version]:
        """The client of the server, and their version of the action. Raises RuntimeError before `wait_until_ready`."""
        if self._found is None:
            raise RuntimeError("no server is known yet: call wait_until_ready() first")
        return self._found

    def _connect(self) -> bool:
        """Use the server's version of the action; returns whether there is a server."""
        if self._found is None:
            kind = dict(rospy.get_published_topics()).get(rospy.resolve_name(ACTION_NAME + "/result"))
            version = next((each for each in VERSIONS.values() if kind == each.name + "ActionResult"), None)
            if version is not None:
                self._found = actionlib.ActionClient(ACTION_NAME, version.action), version
            elif kind is not None:
                raise ValueError("%s serves %s; this program speaks %s" % (
                    ACTION_NAME, kind.removesuffix("ActionResult"), " and ".join(VERSIONS)))
        return self._found is not None

    def _wait(self, what: str, is_there: Callable[[], bool]) -> None:
        begin_s = time.monotonic()
        try:
            while not is_there():
                _raise_if_interrupted()
                if time.monotonic() - begin_s >= FIRST_NOTICE_S:
                    startup.LINE.say(what, time.monotonic() - begin_s)
                time.sleep(0.1)
            _raise_if_interrupted()
        finally:
            startup.LINE.end()

    def send(self, trajectory: JointTrajectory, traj_id: int = 1,
             feedback: Callable[[float], object] = lambda percent: None) -> SentGoal:
        """Send a JointTrajectory: a :class:`SentGoal`; ``feedback`` is called with the percent done.

        The arms continue when this program ends; see the setting stop_when_client_leaves.
        """
        client, version = self._server
        return SentGoal(client, version.make_goal(trajectory, traj_id), feedback)

    def move(self, trajectory: JointTrajectory, timeout_s: float | None = None) -> Any:
        """Send a JointTrajectory and wait [s, ROS time; None: until the end]: the result, or None after ``timeout_s``.

        Raises MoveFailed, ROSInterruptException when ROS shuts down; the arms then continue.
        """
        goal = self.send(trajectory)
        if not goal.wait(timeout_s):
            return None
        status, text, result = goal.outcome()
        if status != GoalStatus.SUCCEEDED:
            raise MoveFailed(status, text)
        return result

    def here(self, joint_names: Sequence[str]) -> list[float]:
        """The measured angles [rad] of these joints. Raises KeyError for one that the robot does not report."""
        angles = self.streamer.robot.angles()
        return [angles[name] for name in joint_names]


def _raise_if_interrupted() -> None:
    if rospy.is_shutdown():
        raise rospy.ROSInterruptException("ROS is shutting down")


def joint_trajectory(joint_names: Sequence[str], times: Sequence[float] | np.ndarray | None,
                     positions: Iterable[Sequence[float] | np.ndarray],
                     velocities: np.ndarray | None = None) -> JointTrajectory:
    """The message: ``times`` (m,) [s], or None to let the server choose them, ``positions``, ``velocities`` (m, k)."""
    points = []
    for index, row in enumerate(positions):
        point = JointTrajectoryPoint(positions=list(row))
        if times is not None:
            point.time_from_start = rospy.Duration.from_sec(float(times[index]))
        if velocities is not None:
            point.velocities = list(velocities[index])
        points.append(point)
    return JointTrajectory(joint_names=list(joint_names), points=points)
