# SPDX-License-Identifier: BSD-3-Clause
"""The connection to a running move_group: its actions, services and topics."""
from __future__ import annotations

import socket
import threading
import time
import urllib.parse
from collections.abc import Iterable
from functools import cache
from typing import TYPE_CHECKING, Any

import actionlib
import rosgraph
import rospkg
import rospy
from actionlib_msgs.msg import GoalStatus
from moveit_msgs import msg, srv
from std_msgs.msg import String

import master_calls

from .exception import MoveItCommanderException
from .node import ensure_node

if TYPE_CHECKING:
    import genpy
    from actionlib import ClientGoalHandle

ACTIONS = {"move_group": msg.MoveGroupAction, "execute_trajectory": msg.ExecuteTrajectoryAction,
           "pickup": msg.PickupAction, "place": msg.PlaceAction}
_RESULTS = {"move_group": msg.MoveGroupResult, "execute_trajectory": msg.ExecuteTrajectoryResult,
            "pickup": msg.PickupResult, "place": msg.PlaceResult}
SERVICES = {"apply_planning_scene": srv.ApplyPlanningScene, "compute_cartesian_path": srv.GetCartesianPath,
            "compute_ik": srv.GetPositionIK, "get_planning_scene": srv.GetPlanningScene,
            "query_planner_interface": srv.QueryPlannerInterfaces}
TOPICS = {"attached_collision_object": msg.AttachedCollisionObject, "collision_object": msg.CollisionObject,
          "planning_scene": msg.PlanningScene, "trajectory_execution_event": String}

#: Time limit for a service that move_group has not advertised yet [s].
SERVICE_WAIT_S = 5.0
_POLL_S = 0.05
#: Time limit for a move_group that has started, but does not serve yet [s]: at its first start with a robot it makes
#: what planning needs to know of the robot's shape.
START_WAIT_S = 120.0
# Time limit for an answer of the master and of the node [s].
_ANSWER_S = 1.0


def how_to_start() -> str:
    """The sentence that says what starts move_group, with the configurations that are installed."""
    found = sorted(name for name in rospkg.RosPack().list() if name.endswith("_moveit_config"))
    return "Start it with its robot's configuration: roslaunch %s move_group.launch; without a robot, its demo" % (
        " or ".join(found) or "ROBOT_moveit_config")


class MoveGroupConnection:
    """To the move_group in one namespace. All methods can be called from several threads."""

    def __init__(self, namespace: str) -> None:
        self._namespace = namespace
        self._clients, self._publishers = {}, {}
        self._lock = threading.RLock()
        self._running = set()

    def name(self, name: str) -> str:
        """The resolved name of one of move_group's actions, services or topics."""
        return rospy.resolve_name("/".join(filter(None, [self._namespace, name])))

    def wait_for_actions(self, names: Iterable[str], seconds: float) -> None:
        """Wait until the action servers answer, in seconds of real time; longer, up to START_WAIT_S, while move_group
        is starting. Raises RuntimeError after the time limit."""
        begin = time.monotonic()
        deadline, told = begin + seconds, False
        for name in names:
            client = self._client(name)
            # A duration below 0 checks once: the client's own wait never ends while simulation time is paused.
            while not client.wait_for_server(rospy.Duration(0, -1)):
                now = time.monotonic()
                starting = name == "move_group" and deadline < now < begin + START_WAIT_S
                if starting and not rospy.is_shutdown() and self._is_starting():
                    if not told:
                        rospy.logwarn("move_group is starting, which takes longer the first time with a robot; waiting")
                    told, deadline = True, now + 1.0
                if rospy.is_shutdown() or now > deadline:
                    raise RuntimeError("Unable to connect to move_group action server '%s' within allotted time (%gs); "
                                       "is move_group running? %s" % (self.name(name), seconds, how_to_start()))
                time.sleep(_POLL_S)

    def _is_starting(self) -> bool:
        """Whether move_group's node is there, served or not."""
        master = master_calls.master(rospy.get_name(), rosgraph.get_master_uri(), _ANSWER_S)
        try:
            uri = urllib.parse.urlsplit(str(master.lookupNode(self.name("move_group"))))
            socket.create_connection((uri.hostname or "", uri.port or 0), timeout=_ANSWER_S).close()
        # The master does not answer, or knows no such node, or one that has ended.
        except (rosgraph.MasterException, *master_calls.NO_ANSWER):
            return False
        return True

    def start(self, name: str, goal: genpy.Message) -> tuple[ClientGoalHandle, threading.Event]:
        """Send a goal and return at once; :meth:`cancel` ends it."""
        done = threading.Event()
        # Sent without our lock: actionlib holds its own lock while it calls _transition, which needs ours.
        handle = self._client(name).send_goal(goal, transition_cb=lambda handle: self._transition(handle, done))
        with self._lock:
            # actionlib forgets a handle without a reference.
            if not done.is_set():
                self._running.add(handle)
        return handle, done

    def _transition(self, handle: ClientGoalHandle, done: threading.Event) -> None:
        if handle.get_comm_state() == actionlib.CommState.DONE:
            done.set()
            with self._lock:
                self._running.discard(handle)

    def run(self, name: str, goal: genpy.Message) -> tuple[Any, str]:
        """Send a goal, wait until it has ended, without a time limit, and return (result, text of its server).

        The result is FAILURE if the server refused the goal or has ended.
        """
        handle, done = self.start(name, goal)
        client = self._client(name)
        while not done.wait(_POLL_S):
            if rospy.is_shutdown():
                return _failure(name), "the program is shutting down"
            if not client.result_sub.get_num_connections():
                return _failure(name), "the action server '%s' is gone" % self.name(name)
        text = handle.get_goal_status_text()
        refused = handle.get_goal_status() in (GoalStatus.REJECTED, GoalStatus.RECALLED, GoalStatus.LOST)
        return _failure(name) if refused else handle.get_result(), text

    def cancel(self) -> None:
        """Cancel what this program has sent and what has not ended yet."""
        with self._lock:
            running = tuple(self._running)
        for handle in running:
            handle.cancel()

    def call(self, name: str, **fields: object) -> Any:
        """Call a service and return its answer. Raises MoveItCommanderException when there is none."""
        full_name = self.name(name)
        try:
            rospy.wait_for_service(full_name, SERVICE_WAIT_S)
            return self.service(name)(**fields)
        except (rospy.ROSException, rospy.ServiceException) as error:
            raise MoveItCommanderException("the service '%s' did not answer: %s" % (full_name, error)) from error

    def service(self, name: str) -> rospy.ServiceProxy:
        """Return a rospy.ServiceProxy of one of move_group's services, which need not be there yet."""
        return rospy.ServiceProxy(self.name(name), SERVICES[name])

    def publish(self, name: str, message: genpy.Message) -> None:
        """Publish on one of the topics that move_group listens to."""
        self.advertise(name).publish(message)

    def advertise(self, name: str) -> rospy.Publisher:
        """Return the publisher of a topic; one that exists beforehand loses no message to a late connection."""
        with self._lock:
            if name not in self._publishers:
                self._publishers[name] = rospy.Publisher(self.name(name), TOPICS[name], queue_size=100)
            return self._publishers[name]

    def _client(self, name: str) -> actionlib.ActionClient:
        with self._lock:
            if name not in self._clients:
                self._clients[name] = actionlib.ActionClient(self.name(name), ACTIONS[name])
            return self._clients[name]


def _failure(name: str) -> Any:
    return _RESULTS[name](error_code=msg.MoveItErrorCodes(msg.MoveItErrorCodes.FAILURE))


@cache
def connect(namespace: str) -> MoveGroupConnection:
    """Return the program's connection to the move_group in a namespace, the same one for every commander."""
    ensure_node()
    return MoveGroupConnection(namespace)
