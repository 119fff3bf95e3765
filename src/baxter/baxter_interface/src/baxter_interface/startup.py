# SPDX-License-Identifier: BSD-3-Clause
"""Waiting for a robot that is still starting: its master, topics, parameters and clock; with error texts.

Everything here waits in wall time, since ROS time may not run yet.
"""
from __future__ import annotations

import http.client
import os
import socket
import xml.parsers.expat
import xmlrpc.client
from collections.abc import Callable
from typing import Any, cast
from urllib.parse import urlparse

import rosgraph
import rospy
import rospy.impl.simtime

from command_line.waiting_line import WaitingLine
from master_calls.simulator_start import StartWatch
from rospy_nodes.start import limit_ports

from .waiting import Condition, others_than, wait_in_order

#: (name, its nodes) of topics or services.
Registered = list[tuple[str, list[str]]]
# Longest wait for a robot [s, wall], not counting the time while a simulator is starting.
STARTUP_TIMEOUT_S = 30.0
# Longest wait for one part of a robot that is up [s, wall]: shorter, because the part may not exist.
PART_TIMEOUT_S = 5.0
# Longest wait for one answer over the network [s].
ANSWER_TIMEOUT_S = 2.0

# All waits of a program share a line.
LINE = WaitingLine()

_LAUNCH_HINT = "is the robot or the simulator running (roslaunch baxter_gazebo baxter_world.launch)?"
# All errors of a call to the master: not there, not a master, an error response.
_MASTER_ERRORS = (OSError, http.client.HTTPException, xmlrpc.client.Error, xml.parsers.expat.ExpatError,
                  rosgraph.MasterException, rospy.ROSException)


def init_node(name: str, topic: str = "robot/state", **options) -> None:
    """Wait for the master and for a publisher of `topic`, then call rospy.init_node(name, **options).

    The order matters when a program starts together with roslaunch: rospy.init_node reads /use_sim_time once, and
    roslaunch sets that parameter a moment after the master is up. The time limit does not run while a simulator is
    starting. Raises OSError with errno ETIMEDOUT, which says what was found and what would be right; SimulatorDied, an
    OSError.
    """
    topic = rospy.resolve_name(topic)
    wait_in_order([master_answers(), topic_published(topic)], STARTUP_TIMEOUT_S, LINE, simulator_is_coming())
    limit_ports()
    rospy.init_node(name, **options)


def wait_for_start(conditions: list[Condition], timeout_s: float | None = None) -> None:
    """Wait, as an initialised node, for the master, for `conditions` in their order, and for the clock to run.

    Parameters: `timeout_s` [s, wall], None for STARTUP_TIMEOUT_S; it does not run while a simulator is starting.
    Raises OSError with errno ETIMEDOUT or ESHUTDOWN; SimulatorDied, an OSError; rospy.ROSInitException before
    rospy.init_node.
    """
    if not rospy.core.is_initialized():
        raise rospy.ROSInitException("this program is not a ROS node yet: call rospy.init_node(name) first")
    wait_in_order([master_answers(), *conditions, clock_runs()], STARTUP_TIMEOUT_S if timeout_s is None else timeout_s,
                  LINE, simulator_is_coming(), rospy.is_shutdown)


def simulator_is_coming() -> Callable[[], bool]:
    """Return a function that returns whether a simulator is starting at this master.

    The function raises SimulatorDied, an OSError, if a simulator that it has seen is gone.
    """
    watch = StartWatch(rosgraph.get_master_uri(), _caller())
    return lambda: bool(watch.look())


def wait_for_part(topic: str, has_arrived: Callable[[], bool]) -> None:
    """Wait for a robot that is still starting, then for `has_arrived()`, set by a subscriber of `topic` (resolved).

    Raises as wait_for_start.
    """
    state_topic = rospy.resolve_name("robot/state")
    wait_for_start([Condition("a robot from %s" % rosgraph.get_master_uri(),
                              lambda: bool(_publishers(state_topic) or _publishers(topic)),
                              lambda: _explain_topic(state_topic))])
    wait_for_start([message_arrives(topic, has_arrived)], PART_TIMEOUT_S)


def master_answers() -> Any:
    """Condition: a ROS master answers where ROS_MASTER_URI points."""
    uri = rosgraph.get_master_uri()
    url = urlparse(uri)
    try:
        host, port = url.hostname, url.port
    except ValueError:
        host = port = None
    if not host or not port:
        raise ValueError("ROS_MASTER_URI is %r; it should look like http://localhost:11311" % uri)
    last_error = []

    def is_met() -> bool:
        try:
            # XML-RPC has no time-out, so first check whether the port accepts connections.
            connect(host, port)
            _master().getPid()
        except _MASTER_ERRORS as error:
            last_error[:] = [error]
            return False
        return True

    def explain() -> str:
        return "%s. ROS_MASTER_URI says %s: %s" % (last_error[0], uri, _LAUNCH_HINT)

    return Condition("a ROS master at %s" % uri, is_met, explain)


def connect(host: str, port: int) -> None:
    """Check whether a TCP port accepts connections; raises OSError if not."""
    socket.create_connection((host, port), timeout=ANSWER_TIMEOUT_S).close()


def topic_published(topic: str) -> Condition:
    """Condition: the master knows a publisher of `topic` (a resolved name)."""
    return Condition("%s from %s" % (topic, rosgraph.get_master_uri()),
                     lambda: bool(_publishers(topic)), lambda: _explain_topic(topic))


def message_arrives(topic: str, has_arrived: Callable[[], bool]) -> Condition:
    """Condition: `has_arrived()`, set by a subscriber of `topic` (a resolved name)."""
    return Condition("%s from %s" % (topic, rosgraph.get_master_uri()), has_arrived, lambda: _explain_topic(topic))


def parameter_set(name: str) -> Condition:
    """Condition: the parameter `name` (a resolved name) has a value."""
    def is_met():
        try:
            return rospy.has_param(name)
        except _MASTER_ERRORS:
            return False

    return Condition("the parameter %s from %s" % (name, rosgraph.get_master_uri()), is_met,
                     lambda: "it is not set; %s" % _LAUNCH_HINT)


def clock_runs() -> Condition:
    """Condition: ROS time runs. Under /use_sim_time, makes this node follow /clock if it does not yet."""
    def is_met() -> bool:
        try:
            follow_simulated_time()
        except _MASTER_ERRORS:
            return False
        return rospy.get_time() > 0.0

    def explain() -> str:
        publishers = _publishers("/clock")
        if not publishers:
            return ("the parameter /use_sim_time is true, but nobody publishes /clock. Start the simulator, or, "
                    "for a real robot: rosparam set use_sim_time false")
        return ("/clock is published by %s, but time stands at 0: is the simulation paused? "
                "(rosservice call /gazebo/unpause_physics)" % ", ".join(publishers))

    return Condition("simulated time on /clock", is_met, explain)


def follow_simulated_time() -> None:
    """Follow /clock if /use_sim_time is true and this node, started before it was set, runs on wall time."""
    if not rospy.rostime.is_wallclock() or not rospy.get_param("/use_sim_time", False):
        return
    rospy.logwarn("/use_sim_time was set after this node had started: from now on it follows /clock")
    rospy.impl.simtime.init_simtime()


def wait_for_subscribers(publisher: rospy.Publisher, timeout: float = 1.0, enough: int | None = None) -> None:
    """Wait until all nodes that the master lists as subscribers of `publisher` have connected to it, if there are any.

    Subscribers that have not connected yet lose the first messages of a new publisher. Returns after
    `timeout` [s, wall] in any case: a subscriber on the list may be dead. `enough`: this many are enough; None for all.
    """
    try:
        expected = len(_nodes_of(str(publisher.resolved_name), subscribers=True))
    except _MASTER_ERRORS:
        return
    if enough is not None:
        expected = min(expected, enough)
    connected = Condition("", lambda: publisher.get_num_connections() >= expected, lambda: "")
    try:
        wait_in_order([connected], timeout, is_shutdown=rospy.is_shutdown)
    except OSError:
        rospy.logdebug("%s: %d of %d subscribers connected within %.1f s", publisher.resolved_name,
                       publisher.get_num_connections(), expected, timeout)


def _caller() -> str:
    # Before init_node there is no node name; the master only needs some caller id.
    return "/baxter_interface_%d" % os.getpid()


def _master():
    return rosgraph.Master(_caller())


def system_state(master: rosgraph.Master) -> tuple[Registered, Registered, Registered]:
    """Publishers, subscribers and services by the master: (name, nodes) each. Raises what rosgraph raises."""
    return cast("tuple[Registered, Registered, Registered]", master.getSystemState())  # rosgraph has no types


def _nodes_of(topic: str, subscribers: bool = False) -> list[str]:
    published, subscribed, _services = system_state(_master())
    return dict(subscribed if subscribers else published).get(topic, [])


def _publishers(topic: str):
    try:
        return _nodes_of(topic)
    except _MASTER_ERRORS:
        return []


def _explain_topic(topic: str) -> str:
    """Explain from the master's data why no message of `topic` came."""
    try:
        published = dict(system_state(_master())[0])
    except _MASTER_ERRORS as error:
        return "the master at %s is gone (%s)" % (rosgraph.get_master_uri(), error)
    if topic in published:
        names = ", ".join(published[topic])
        return ("%s publishes it, but no message of use came. Paused (rosservice call /gazebo/unpause_physics), dead "
                "(rosnode ping %s), or out of reach from this machine (ROS_IP, ROS_HOSTNAME)?"
                % (names, published[topic][0]))
    twins = sorted(name for name in published if name.endswith(topic) or topic.endswith(name))
    if twins:
        return "nobody publishes it, but there is %s: is this program in the wrong namespace (%s)?" % (
            ", ".join(twins), rospy.get_namespace())
    if rospy.resolve_name("robot/state") in published:
        return "the robot is up, but has no such topic%s" % others_than(topic, published)
    return "the master is up, but nobody publishes it: %s" % _LAUNCH_HINT
