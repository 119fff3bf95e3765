# SPDX-License-Identifier: BSD-3-Clause
"""move_group without ROS around it: the node's own code, called directly; what it offers is kept in dictionaries."""
import contextlib
import threading
from types import SimpleNamespace

import actionlib
import rospy
from actionlib_msgs.msg import GoalStatus

from moveit_ros_move_group import node

# Longer than a slow machine needs to prepare a small robot [s].
PREPARED_S = 90.0


class Server:
    """An action server that runs a goal where it is called. preempted: what the goal's code is told."""

    def __init__(self, name, _type, run, auto_start=False):
        self.name, self._run, self.preempted = name, run, threading.Event()
        self.status = self.result = self.text = None
        self.feedback = []

    def start(self):
        pass

    def ask(self, goal):
        """Run a goal; return (status, result, text)."""
        self.status = None
        self._run(goal)
        return self.status, self.result, self.text

    def is_preempt_requested(self):
        return self.preempted.is_set()

    def is_active(self):
        return self.status is None

    def publish_feedback(self, message):
        self.feedback.append(message.state)

    def _end(self, status, result, text):
        self.status, self.result, self.text = status, result, text

    def set_succeeded(self, result=None, text=""):
        self._end(GoalStatus.SUCCEEDED, result, text)

    def set_aborted(self, result=None, text=""):
        self._end(GoalStatus.ABORTED, result, text)

    def set_preempted(self, result=None, text=""):
        self._end(GoalStatus.PREEMPTED, result, text)


class Node:
    """The node of some parameters (a tree, the private ones in its "~"), with what it says kept: published [(topic,
    message)], logged [line]. on_service(name) is called when a service is offered. prepared_s: as the node's own."""

    def __init__(self, monkeypatch, parameters, on_service=lambda name: None,
                 prepared_s=PREPARED_S):
        self.services, self.topics, self.servers = {}, {}, {}
        self.published, self.logged = [], []
        self._parameters, self._on_service = parameters, on_service
        rospy.rostime.set_rostime_initialized(True)
        monkeypatch.setattr(rospy, "get_param", self._get_param)
        monkeypatch.setattr(rospy, "has_param", lambda name: self._get_param(name, None) is not None)
        monkeypatch.setattr(rospy, "Service", self._service)
        monkeypatch.setattr(rospy, "Subscriber", self._subscriber)
        monkeypatch.setattr(rospy, "Publisher", self._publisher)
        monkeypatch.setattr(actionlib, "SimpleActionServer", self._server)
        monkeypatch.setattr(node, "_PREPARED_S", prepared_s)
        for level in ("logdebug", "loginfo", "logwarn", "logerr", "logfatal"):
            monkeypatch.setattr(rospy, level, lambda text, *values, **_: self.logged.append(text % values))
        monkeypatch.setattr(rospy, "logwarn_throttle", lambda _, text, *values: self.logged.append(text % values))
        self.context, self.kept = node.build()

    def ask(self, endpoint, message):
        """Return the answer of a service, (status, result, text) of an action, None of a topic."""
        if endpoint in self.servers:
            return self.servers[endpoint].ask(message)
        return (self.services.get(endpoint) or self.topics[endpoint])(message)

    @contextlib.contextmanager
    def hearing(self, topic, make):
        """Fifty times a second the node hears on a topic what make() returns."""
        done = threading.Event()

        def say():
            while not done.wait(0.02):
                self.topics[topic](make())

        thread = threading.Thread(target=say, daemon=True)
        thread.start()
        try:
            yield
        finally:
            done.set()
            thread.join()

    def told(self, topic):
        return [message for name, message in self.published if name == topic]

    def _get_param(self, name, *default):
        tree = self._parameters["~"] if name.startswith("~") else self._parameters
        for part in filter(None, name.lstrip("~").split("/")):
            if not isinstance(tree, dict) or part not in tree:
                if default:
                    return default[0]
                raise KeyError(name)
            tree = tree[part]
        return tree

    def _subscriber(self, name, _type, callback=None, **_):
        self.topics[name] = callback
        return SimpleNamespace(resolved_name="/" + name, unregister=lambda: None)

    def _publisher(self, name, *_, **__):
        def publish(message):
            self.published.append((name, message))
            if name == "~fake_controller_joint_states":
                self.topics["joint_states"](message)
        return SimpleNamespace(publish=publish, get_num_connections=lambda: 0)

    def _service(self, name, _type, serve, **_):
        self._on_service(name)
        self.services[name] = serve

    def _server(self, *arguments, **options):
        server = Server(*arguments, **options)
        self.servers[server.name] = server
        return server
