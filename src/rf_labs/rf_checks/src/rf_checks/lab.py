# SPDX-License-Identifier: BSD-3-Clause
"""A lab of the judge's own: master, simulator and the nodes around it, on a port that nobody uses.

The judge itself is no ROS node: what the robot does comes through the recorder's socket, and who else is there from the
master's XML-RPC interface.
"""
import contextlib
import json
import os
import random
import shutil
import signal
import socket
import subprocess
import tempfile
import threading
import time
import xmlrpc.client
from pathlib import Path

import rospkg

from rf_checks.pacing import Watch
from rf_checks.recorder_names import PLUGIN_ELEMENT, SOCKET_VARIABLE

START_TIMEOUT_S = 60.0
RESET_TIMEOUT_S = 20.0
STOP_TIMEOUT_S = 20.0
RECORD_S = 0.01
#: Programs on whose answers a student's program waits, or that have yet to take in what it sent: time must not run away
#: meanwhile either.
HELPERS = ("position_kinematics", "robot_state_publisher", "rosmaster", "gzserver")
#: Nodes that come and go by themselves.
TRANSIENT = frozenset(("/urdf_spawner",))
_CALLER = "/lab_judge"


class LabFailed(Exception):
    """The judge's own lab does not come up or is gone; the text says why."""


def free_port():
    """A port that nobody listens on, below those (32768 up) that the kernel could hand to somebody else meanwhile."""
    while True:
        port = random.randrange(20000, 30000)
        with socket.socket() as probe, contextlib.suppress(OSError):
            probe.bind(("127.0.0.1", port))
            return port


class Lab:
    """Start with :meth:`start`, end with :meth:`close`; a context manager."""

    def __init__(self, description_xml):
        """`description_xml`: the robot's URDF text."""
        self.uri = ""
        self.watch = Watch()
        #: Called with each record (dict), in the thread that lets the world go on; must be quick.
        self.on_record = lambda record: None
        #: False: at real time at most, because nobody needs more.
        self.is_hurried = False
        self.joint_names = ()
        self._description = description_xml
        self._processes = []
        self._folder = None
        self._order = None
        self._done = None
        self._connection = None
        self._ended = threading.Event()
        self._has_time = False
        #: Names of the lab's own nodes.
        self.own_nodes = frozenset()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    @property
    def folder(self):
        """Where the lab keeps its files."""
        return self._folder

    @property
    def is_alive(self):
        """False once the simulator, or its robot, is gone."""
        return not self._ended.is_set()

    def start(self):
        """Start everything and wait until the robot stands. Raises LabFailed."""
        self._folder = Path(tempfile.mkdtemp(prefix="lab-judge-"))
        port = free_port()
        self.uri = "http://localhost:%d" % port
        environment = {**os.environ, "ROS_MASTER_URI": self.uri, "ROS_HOSTNAME": "localhost",
                       "ROS_LOG_DIR": str(self._folder / "log"), SOCKET_VARIABLE: str(self._folder / "socket")}
        environment.pop("ROS_IP", None)
        self._ended = threading.Event()
        with socket.socket(socket.AF_UNIX) as listener:
            listener.bind(str(self._folder / "socket"))
            listener.listen(1)
            listener.settimeout(0.1)
            description = self._folder / "robot.urdf"
            description.write_text(self._description.replace("</robot>", PLUGIN_ELEMENT + "</robot>"), encoding="utf-8")
            self._run(["roslaunch", "-p", str(port), str(_share() / "launch" / "lab.launch"),
                       "description:=%s" % description], environment)
            self._connection = self._await(lambda: _accept(listener), "the simulator")
        self._connection.settimeout(None)
        threading.Thread(target=self._pace, args=(self._connection, self._ended), daemon=True).start()
        self._await(self._all_there, "the nodes around the robot")
        self.own_nodes = frozenset(self.nodes() - TRANSIENT)

    def reset(self, posture):
        """Disable the robot and put its arms into `posture` (dict of joint to rad). Raises LabFailed."""
        self.is_hurried = True
        self._done = None
        self._order = {"names": list(posture), "positions": list(posture.values())}
        deadline = time.monotonic() + RESET_TIMEOUT_S
        while self._done is None and self.is_alive and time.monotonic() < deadline:
            time.sleep(0.005)
        if self._done != "":
            raise LabFailed("the robot cannot be put back: %s" % (self._done or "the simulator does not answer"))

    def nodes(self):
        """Names of all nodes that the master knows: a set. Raises LabFailed when there is no master."""
        return {name for kind in self._state() for _, names in kind for name in names} - {_CALLER}

    def publishers(self, topic):
        """Names of the nodes that publish `topic`."""
        return {name for found, names in self._state()[0] if found == topic for name in names}

    def missing_nodes(self):
        """The lab's own nodes that are no longer registered."""
        return sorted(self.own_nodes - self.nodes())

    def is_as_it_was(self):
        """Whether another program can be judged here: everything alive, and nobody else there."""
        try:
            return self.is_alive and self.nodes() - TRANSIENT == self.own_nodes
        except LabFailed:
            return False

    def forget_strangers(self):
        """Take nodes that are gone, and were not the lab's, off the master's lists, as `rosnode cleanup` does."""
        with contextlib.suppress(LabFailed, OSError, xmlrpc.client.Error):
            master = self._master()
            publishers, subscribers, services = self._state()
            for node in self.nodes() - self.own_nodes - TRANSIENT:
                code, _, uri = master.lookupNode(_CALLER, node)
                if code != 1:
                    continue
                for kind, unregister in ((publishers, master.unregisterPublisher),
                                         (subscribers, master.unregisterSubscriber)):
                    for topic, names in kind:
                        if node in names:
                            unregister(node, topic, uri)
                for service, names in services:
                    if node in names:
                        unregister_uri = master.lookupService(_CALLER, service)[2]
                        master.unregisterService(node, service, unregister_uri)

    def helper_pids(self):
        """Process ids of HELPERS in this lab."""
        found = []
        for entry in Path("/proc").iterdir():
            with contextlib.suppress(OSError):
                if entry.name.isdigit() and (entry / "environ").read_bytes().find(self.uri.encode()) >= 0:
                    line = (entry / "cmdline").read_bytes()
                    found += [int(entry.name)] if any(name.encode() in line for name in HELPERS) else []
        return found

    def log_tail(self):
        """The last lines of what the lab's own processes wrote."""
        lines = (self._folder / "output.txt").read_text(errors="replace").splitlines()
        return "\n".join(lines[-15:])

    def close(self):
        """End every process, quickly: nothing of this lab is of use to anybody."""
        self._ended.set()
        if self._connection is not None:
            self._connection.close()
            self._connection = None
        for sign, timeout_s in ((signal.SIGINT, STOP_TIMEOUT_S), (signal.SIGKILL, STOP_TIMEOUT_S)):
            for process in reversed(self._processes):
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(process.pid, sign)
                with contextlib.suppress(subprocess.TimeoutExpired):
                    process.wait(timeout_s)
        self._processes = []
        self.watch.close()
        if self._folder is not None:
            shutil.rmtree(self._folder, ignore_errors=True)

    # -- below

    def _run(self, command, environment):
        with open(self._folder / "output.txt", "ab") as output:
            self._processes.append(subprocess.Popen(command, env=environment, stdin=subprocess.DEVNULL, stdout=output,
                                                    stderr=subprocess.STDOUT, start_new_session=True))

    def _await(self, condition, what):
        deadline = time.monotonic() + START_TIMEOUT_S
        while True:
            found = condition()
            if found:
                return found
            ended = [process.args[0] for process in self._processes if process.poll() is not None]
            if ended or time.monotonic() > deadline:
                reason = "%s ended" % ended[0] if ended else "not there after %g s" % START_TIMEOUT_S
                raise LabFailed("the check's own lab does not start: waiting for %s: %s\n%s"
                                % (what, reason, self.log_tail()))
            time.sleep(0.05)

    def _master(self):
        return xmlrpc.client.ServerProxy(self.uri, transport=_Impatient())

    def _state(self):
        try:
            return self._master().getSystemState(_CALLER)[2]
        except (OSError, xmlrpc.client.Error) as error:
            raise LabFailed("the ROS master does not answer: %s" % error) from error

    def _all_there(self):
        services = {name for name, _ in self._state()[2]}
        return (all("/ExternalTools/%s/PositionKinematicsNode/IKService" % side in services
                    for side in ("left", "right"))
                and "/robot_state_publisher" in self.nodes() and self.joint_names and self._has_time)

    def _pace(self, connection, ended):
        """Read records, wait until the watched programs rest, let the world go on."""
        lines = connection.makefile("r", encoding="utf-8")
        try:
            self.joint_names = tuple(json.loads(next(lines))["joints"])
            for line in lines:
                record = json.loads(line)
                self._has_time = True
                if record.get("done") is not None:
                    self._done = record["done"]
                record["rested"] = self.watch.wait_until_idle()
                self.on_record(record)
                if not self.is_hurried:
                    time.sleep(RECORD_S)
                order, self._order = self._order, None
                connection.sendall((json.dumps(order) if order else "").encode() + b"\n")
        except (OSError, ValueError, StopIteration):
            pass  # the simulator has gone: that is what is_alive says
        finally:
            ended.set()


class _Impatient(xmlrpc.client.Transport):
    """XML-RPC that does not wait for ever for a master that is stopped."""

    def make_connection(self, host):
        connection = super().make_connection(host)
        connection.timeout = 5.0
        return connection


def _accept(listener):
    with contextlib.suppress(TimeoutError):
        return listener.accept()[0]
    return None


def _share():
    return Path(rospkg.RosPack().get_path("rf_checks"))


def robot_description():
    """The URDF text of the robot that the lab has. Raises LabFailed."""
    packages = rospkg.RosPack()
    command = [str(Path(packages.get_path("xacro")) / "xacro"),
               str(Path(packages.get_path("baxter_description")) / "urdf" / "baxter.urdf.xacro")]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        raise LabFailed("xacro fails on the robot's description: %s" % done.stderr.strip())
    return done.stdout
