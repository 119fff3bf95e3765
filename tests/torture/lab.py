# SPDX-License-Identifier: BSD-3-Clause
"""The lab under test: starts it, inspects it, restarts it. It has its own master and log."""
import contextlib
import os
import re
import signal
import subprocess
import time
import xmlrpc.client
from pathlib import Path

import roslib.message
import tcpros
from invariants import Usage

from lab_testing.processes import is_alive
from lab_testing.waiting import wait_until
from processes.ports import free_port

LAUNCH = ("workspace_tests", "torture.launch")
# The lab is ready when these are registered: the last topic or service of each node.
NEEDED_TOPICS = ("/robot/sim/started", "/robot/limb/right/follow_joint_trajectory/goal", "/trajActionServer/goal",
                 "/robot/end_effector/right_gripper/gripper_action/goal", "/robot/head/head_action/goal")
NEEDED_SERVICES = ("/robot/sim/press", "/one/controller_manager/list_controllers", "/cameras/list",
                   "/ExternalTools/left/PositionKinematicsNode/IKService",
                   "/ExternalTools/right/PositionKinematicsNode/IKService")
START_LIMIT_S = 300.0
STOP_LIMIT_S = 40.0
CALLER = "/torture"
# Nodes that are not the lab's: this program, short-lived nodes, and roscore's own node.
NOT_OURS = re.compile(r"^/(torture|rosservice|rostopic|record|urdf_spawner|two_joints_spawner|rosout)")
# Nodes of Debian's ROS, in C++. A damaged request can end them (roscpp 1.16 has a segmentation fault); roslaunch
# restarts them.
FOREIGN = ("/base_to_world",)


class Lab:
    """A launch file with its master. Context manager: at the end, everything started in it is ended."""

    def __init__(self, folder, launch=LAUNCH, prefix=(), environment=None, **arguments):
        """folder: of logs; prefix: words in front of the roslaunch command; environment: more variables for all
        processes; arguments: of the launch file."""
        self._folder, self._launch, self._prefix, self._arguments = Path(folder), launch, prefix, arguments
        self._environment = environment or {}
        self._stack = contextlib.ExitStack()
        self._children = []

    def __enter__(self):
        self._folder.mkdir(parents=True, exist_ok=True)
        port = free_port()
        self.uri = "http://localhost:%d" % port
        os.environ.update(ROS_MASTER_URI=self.uri, ROS_HOSTNAME="localhost", ROS_LOG_DIR=str(self._folder / "log"))
        self._output = self._stack.enter_context((self._folder / "output.txt").open("ab"))
        self._stack.callback(self._end_children)
        try:
            self.start("roscore", "-p", str(port))
            wait_until(self._master_answers, "the master", START_LIMIT_S, 0.05)
            self.launch()
        except BaseException:
            self._stack.close()
            raise
        return self

    def __exit__(self, *_):
        self._stack.close()

    @property
    def master(self):
        """The master's XML-RPC interface; a new proxy for each call, since threads cannot share one."""
        return xmlrpc.client.ServerProxy(self.uri)

    def launch(self):
        """Start the launch file and return the time until the robot was ready [s]."""
        begin = time.monotonic()
        words = [*self._prefix, "roslaunch", *self._launch, *("%s:=%s" % pair for pair in self._arguments.items())]
        self.launched = self.start(*words)
        wait_until(lambda: not self._missing(), lambda: "%s; see %s" % (
            ", ".join(self._missing()), self._output.name), START_LIMIT_S, 0.1)
        return time.monotonic() - begin

    def relaunch(self):
        """End the launched nodes and start them again; return the start-up time [s]."""
        end(self.launched)
        # Killed nodes are still registered with the master.
        wait_until(lambda: not any(map(self.is_node_alive, self.nodes())), "the lab's end", STOP_LIMIT_S)
        for node in self.nodes():
            self.forget(node)
        return self.launch()

    def start(self, *command, **options):
        """Start a command on this lab's master; it ends with the lab. Returns its Popen."""
        options = {"stdout": self._output, "stderr": subprocess.STDOUT, "stdin": subprocess.DEVNULL, **options}
        environment = {**os.environ, **self._environment}
        child = subprocess.Popen(command, start_new_session=True, env=environment, **options)
        self._children.append(child)
        return child

    def nodes(self):
        """Names of the lab's nodes that are registered with the master."""
        state = self.master.getSystemState(CALLER)[2]
        return sorted({node for kind in state for _, nodes in kind for node in nodes if not NOT_OURS.match(node)})

    def pid(self, node):
        """Process id of a node, from the node itself; None if it does not answer."""
        uri = self.master.lookupNode(CALLER, node)[2]
        try:
            with xmlrpc.client.ServerProxy(uri) as proxy:
                return proxy.getPid(CALLER)[2]
        except (OSError, xmlrpc.client.Error):
            return None

    def is_node_alive(self, node):
        pid = self.pid(node)
        return pid is not None and is_alive(pid)

    def processes(self):
        """{node: process id} of all nodes that answer."""
        found = {node: self.pid(node) for node in self.nodes()}
        return {node: pid for node, pid in found.items() if pid is not None}

    def subscriptions(self):
        """[(topic, type)] that the lab's nodes subscribe to, sorted."""
        types = dict(self.master.getTopicTypes(CALLER)[2])
        listened = self.master.getSystemState(CALLER)[2][1]
        return sorted((topic, types[topic]) for topic, nodes in listened
                      if any(not NOT_OURS.match(node) for node in nodes) and types.get(topic, "*") != "*")

    def publications(self):
        """[(topic, type, node)] that the lab's nodes publish, sorted."""
        types = dict(self.master.getTopicTypes(CALLER)[2])
        published = self.master.getSystemState(CALLER)[2][0]
        return sorted((topic, types[topic], node) for topic, nodes in published for node in nodes
                      if not NOT_OURS.match(node) and topic in types)

    def services(self):
        """[(service, node)] of the lab's nodes, sorted."""
        offered = self.master.getSystemState(CALLER)[2][2]
        return sorted((service, node) for service, nodes in offered for node in nodes if not NOT_OURS.match(node))

    def service_address(self, service):
        """(host, port) of a service's node. Raises KeyError if there is no such service."""
        code, text, uri = self.master.lookupService(CALLER, service)
        if code != 1:
            raise KeyError(text)
        return address_of(uri)

    def forget(self, node):
        """Unregister a node that died without unregistering itself, as `rosnode cleanup` does."""
        uri = self.master.lookupNode(CALLER, node)
        published, listened, services = self.master.getSystemState(CALLER)[2]
        for topic, nodes in published:
            if node in nodes:
                self.master.unregisterPublisher(node, topic, uri[2])
        for topic, nodes in listened:
            if node in nodes:
                self.master.unregisterSubscriber(node, topic, uri[2])
        for service, nodes in services:
            if node in nodes:
                self.master.unregisterService(node, service, self.master.lookupService(CALLER, service)[2])

    def _master_answers(self):
        try:
            return self.master.getPid(CALLER)[0] == 1
        except OSError:
            return False

    def _missing(self):
        if self.launched.poll() is not None:
            raise AssertionError("roslaunch ended with %d; see %s" % (self.launched.returncode, self._output.name))
        published, listened, services = self.master.getSystemState(CALLER)[2]
        topics = {name for name, _ in published + listened}
        return [name for name in NEEDED_TOPICS if name not in topics] + [
            name for name in NEEDED_SERVICES if name not in dict(services)]

    def _end_children(self):
        for child in reversed(self._children):
            end(child)


def end(child):
    """End a process and its children as Ctrl-C does; kill them if that does not help."""
    for number, limit_s in ((signal.SIGINT, STOP_LIMIT_S), (signal.SIGKILL, STOP_LIMIT_S)):
        if child.poll() is None:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(child.pid, number)
            with contextlib.suppress(subprocess.TimeoutExpired):
                child.wait(limit_s)


def address_of(uri):
    """(host, port) in http://host:port/ or rosrpc://host:port."""
    host, port = re.fullmatch(r"\w+://([^:/]+):(\d+)/?", uri).groups()
    return host, int(port)


def class_of(message_type):
    """The class of a message type, e.g. "std_msgs/Bool". Raises KeyError if this workspace does not have it."""
    found = roslib.message.get_message_class(message_type)
    if found is None:
        raise KeyError("this workspace has no message type %s" % message_type)
    return found


def request_class(service_type):
    """The request's class of a service type."""
    return roslib.message.get_service_class(service_type)._request_class


def response_class(service_type):
    """The response's class of a service type."""
    return roslib.message.get_service_class(service_type)._response_class


def usage(pid):
    """Usage of a process. Raises OSError if it has ended."""
    folder = Path("/proc/%d" % pid)
    status = dict(line.split(":", 1) for line in (folder / "status").read_text().splitlines())
    memory = sum(int(status[name].split()[0]) for name in ("RssAnon", "RssShmem")) * 1024
    return Usage(int(status["Threads"]), len(list((folder / "fd").iterdir())), memory)


def cpu_s(pid):
    """CPU time that a process has used [s]; 0 if it has ended."""
    try:
        fields = Path("/proc/%d/stat" % pid).read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def subscribe(lab, topic, message_type, node, who="_watch"):
    """A connection that receives a node's messages of a topic. Raises OSError, tcpros.ConnectionLost.

    who: suffix for the name of the subscribing node, which does not exist; a publisher keeps one connection per node.
    """
    uri = lab.master.lookupNode(CALLER, node)[2]
    try:
        with xmlrpc.client.ServerProxy(uri) as proxy:
            code, text, protocol = proxy.requestTopic(CALLER + who, topic, [["TCPROS"]])
    except xmlrpc.client.Error as error:
        raise tcpros.ConnectionLost(str(error)) from error
    if code != 1 or not protocol:
        raise tcpros.ConnectionLost(text)
    fields = {"callerid": CALLER + who, "topic": topic, "type": message_type, "tcp_nodelay": "1",
              "md5sum": class_of(message_type)._md5sum}
    return tcpros.handshake((protocol[1], protocol[2]), fields)[0]
