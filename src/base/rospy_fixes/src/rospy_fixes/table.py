# SPDX-License-Identifier: BSD-3-Clause
"""All amendments: which module each changes, in which programs, why, and what tests it.

They are made once the module has been imported, by the ``amend(module)`` of the module ``rospy_fixes.<fix>``. Those of
EVERYWHERE are made in each Python of the lab's environment, by ``sitecustomize``; those of NODES in nodes that ask for
them, by :func:`amend_nodes`. docs/decisions/0008 and 0009 have the observations behind them.
"""
from __future__ import annotations

import importlib
from types import ModuleType
from typing import NamedTuple

EVERYWHERE, NODES = "every program", "nodes with limits on their ports"


class Fix(NamedTuple):
    """One row. ``upstream``: its issue, "" where none was found; ``test``: in test/unit, or a path."""

    module: str
    fix: str
    where: str
    why: str
    upstream: str
    test: str

    def amend(self, module: ModuleType) -> None:
        """Amend the imported ``module``."""
        importlib.import_module("rospy_fixes." + self.fix).amend(module)


FIXES = (
    Fix("rospy.client", "first_clock", EVERYWHERE, "init_node returns at time 0, which then jumps by minutes",
        "ros/ros_comm#354", "test_first_clock.py"),
    Fix("rospy.core", "last_messages", EVERYWHERE, "what is published just before a program's end is lost at random",
        "", "test_last_messages.py"),
    Fix("rospy.topics", "signals", EVERYWHERE, "Ctrl-C in a publish, and a shutdown handler that publishes, wait for "
        "each other for ever", "", "test_signals.py"),
    Fix("rospy.topics", "closed_connections", EVERYWHERE, "a connection that ends takes the newest one with it",
        "", "test_closed_connections.py"),
    Fix("rospy.topics", "first_messages", EVERYWHERE, "what is published as soon as a subscriber is connected is lost",
        "", "test_first_messages.py"),
    Fix("rospy.impl.tcpros_base", "refused_connections", EVERYWHERE, "a refused subscriber waits without a word",
        "", "test_refused_connections.py"),
    Fix("rospy.impl.tcpros_pubsub", "late_subscribers", EVERYWHERE, "shutdown handlers publish to nobody that connects "
        "only then", "", "test_late_subscribers.py"),
    Fix("rospy.impl.masterslave", "one_connection", EVERYWHERE, "two threads connect to one publisher, and both "
        "connections end", "", "test_one_connection.py"),
    Fix("rospy.impl.registration", "registrations", EVERYWHERE, "a master that hangs, or a name that it cannot "
        "read, stops a node for ever", "ros/ros_comm#262", "test_registrations.py"),
    Fix("rospy.impl.statistics", "registrations", EVERYWHERE, "each subscriber asks a master that hangs, with all "
        "locks held", "", "test_registrations.py"),
    Fix("rosgraph.masterapi", "master_answers", EVERYWHERE, "a question to a master that is stopped waits for "
        "ever", "", "test_master_answers.py"),
    Fix("rosgraph.xmlrpc", "ended_servers", EVERYWHERE, "the server of an ended node takes a core until its process "
        "ends", "ros/ros_comm#2238", "test_ended_servers.py"),
    Fix("rosgraph.roslogging", "full_disk", EVERYWHERE, "a full disk prints a traceback for each message of the log",
        "", "test_full_disk.py"),
    Fix("rosgraph.roslogging", "quick_imports", EVERYWHERE, "each node searches the workspace for settings of its log",
        "", "test_quick_imports.py"),
    Fix("catkin", "quick_imports", EVERYWHERE, "each node imports a library for grammars", "", "test_quick_imports.py"),
    Fix("roslaunch.config", "quick_imports", EVERYWHERE, "roslaunch imports setuptools to look for one program",
        "", "test_quick_imports.py"),
    Fix("roslaunch.config", "hidden_tokens", EVERYWHERE, "logs that everybody can read have servers' tokens in them",
        "", "test_hidden_tokens.py"),
    Fix("roslaunch.config", "rosout_clock", EVERYWHERE, "each message of /clock wakes rosout, which needs none",
        "", "test_rosout_clock.py"),
    Fix("roslaunch.config", "distro_name", EVERYWHERE, "clients without ROS know no distribution of the name Debian",
        "", "test_distro_name.py"),
    Fix("roslaunch.parent", "launch_guard", EVERYWHERE, "a second simulator on a master ends the first one's nodes",
        "", "src/base/master_calls/test/unit/test_single_instance.py"),
    Fix("roslaunch.parent", "launch_end", EVERYWHERE, "Ctrl-C in the middle of a start stands for 20 s and leaves the "
        "master", "", "test_launch_end.py"),
    Fix("actionlib.simple_action_client", "goal_tracking", EVERYWHERE, "the answer of a quick server counts as one to "
        "nobody's goal", "ros/actionlib#206", "test_goal_tracking.py"),
    Fix("actionlib.action_client", "lost_goals", EVERYWHERE, "a goal that is cancelled at once is taken for lost",
        "", "test_lost_goals.py"),
    *(Fix(module, "former_fields", EVERYWHERE, "programs of ROS Kinetic set fields that Noetic lacks, or give "
          "fields by position", "", "test_former_fields.py") for module in (
        *("moveit_msgs.msg._" + name for name in (
            "CollisionObject", "DisplayRobotState", "MotionPlanRequest", "OrientationConstraint", "PlaceLocation",
            "PositionIKRequest")),
        "moveit_msgs.srv._GetCartesianPath", "moveit_msgs.srv._GetPlannerParams", "moveit_msgs.srv._SetPlannerParams",
        "gazebo_msgs.srv._SetLightProperties")),
    Fix("rospy.impl.tcpros_base", "ports.tcpros_server", NODES, "a client that connects and sends nothing blocks all "
        "others", "", "test_handshakes.py"),
    Fix("rospy.impl.tcpros_base", "ports.messages", NODES, "memory of any announced size is reserved",
        "", "test_registration.py"),
    Fix("rospy.impl.tcpros_service", "ports.services", NODES, "a connection without a request holds a thread for ever; "
        "what fails in one is a traceback", "", "src/base/rospy_nodes/test/rostest/limits_rostest.py"),
    Fix("rospy.impl.tcpros_base", "ports.registration", NODES, "a header of any length is read", "",
        "test_registration.py"),
    Fix("rospy.impl.registration", "ports.registration", NODES, "an unforeseen error ends the thread that connects to "
        "publishers", "", "test_registration.py"),
    Fix("rospy.impl.masterslave", "ports.registration", NODES, "one call may cost any number of threads", "",
        "test_registration.py"),
    Fix("rosgraph.xmlrpc", "ports.xmlrpc_server", NODES, "a connection without a request holds a thread for ever",
        "", "test_xmlrpc_connections.py"),
    Fix("rospy.topics", "ports.topic_poller", NODES, "a topic that ends keeps its descriptor", "ros/ros_comm#2373",
        "test_topic_poller.py"),
)


def on_import(name: str) -> list[Fix]:
    """The amendments of the module ``name`` that every program gets."""
    return [fix for fix in FIXES if fix.module == name and fix.where == EVERYWHERE]


def amend_nodes() -> None:
    """Make the amendments of NODES in this process."""
    for fix in FIXES:
        if fix.where == NODES:
            fix.amend(importlib.import_module(fix.module))
