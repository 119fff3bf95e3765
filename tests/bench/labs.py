# SPDX-License-Identifier: BSD-3-Clause
"""Labs that a bench starts, each with its own master, and connections to them. Nothing here is a ROS node."""
import contextlib
import os
import selectors
import signal
import socket
import struct
import subprocess
import sys
import time
import xmlrpc.client
from pathlib import Path

from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Empty

from lab_testing.virtual_screen import VirtualScreen
from lab_testing.waiting import wait_until
from processes.ports import free_port

HERE = Path(__file__).resolve().parent
WORLD = ("baxter_gazebo", "baxter_world.launch")
START_LIMIT_S = 120.0


class Lab:
    """A launch file with its master, as a context manager: at the end, everything started in it is ended.

    launch: (package, file); arguments: of the launch file. started_s: roslaunch to the first message on ``ready``, a
    latched std_msgs/Empty, or to the service ``ready`` if it is not a topic. screen: start a virtual display (Xvfb).
    parameters: {name: value} that the master holds before the launch.
    """

    def __init__(self, launch=WORLD, ready="/robot/sim/started", screen=False, parameters=None, **arguments):
        self._launch, self._ready, self._arguments = launch, ready, arguments
        self._with_screen, self._parameters = screen, parameters or {}

    def __enter__(self):
        with contextlib.ExitStack() as stack:
            self._stack = stack
            port = free_port()
            uri = "http://localhost:%d" % port
            surroundings = os.environ
            if self._with_screen:
                screen = VirtualScreen()
                stack.callback(screen.close)
                surroundings = screen.environment
            self.environment = dict(surroundings, ROS_MASTER_URI=uri, ROS_HOSTNAME="localhost")
            self.master = xmlrpc.client.ServerProxy(uri)
            self.start("roscore", "-p", str(port))
            wait_until(self._answers, "the master", START_LIMIT_S, 0.02)
            for name, value in self._parameters.items():
                self.master.setParam("/bench", name, value)
            self._launch_it()
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *_):
        self._stack.close()

    def restart(self):
        """End the launch file, as Ctrl-C does, and launch it again on the same master."""
        _end(self._launched)
        self._launch_it()

    def start(self, *command, **options):
        """Run a command on this lab's master until the lab ends; return its Popen."""
        options = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, **options}
        process = subprocess.Popen(command, env=self.environment, **options)
        self._stack.callback(_end, process)
        return process

    def part(self, name, *arguments):
        """Start `lab_part.py NAME`, wait until it prints "up", and return its Popen."""
        process = self.start(sys.executable, str(HERE / "lab_part.py"), name, *map(str, arguments),
                             stdout=subprocess.PIPE, text=True, bufsize=1)
        line = process.stdout.readline()
        if line != "up\n":
            raise SystemExit("lab_part.py %s did not come up: %r" % (name, line))
        return process

    def process(self, node):
        """Return the Process of a node by its name."""
        api = self.master.lookupNode("/bench", node)[2]
        return Process(xmlrpc.client.ServerProxy(api).getPid("/bench")[2])

    def nodes(self):
        """Return the names of all nodes."""
        state = self.master.getSystemState("/bench")[2]
        return sorted({node for kind in state for _, names in kind for node in names})

    def sink(self, topic, message_class, number=0):
        """Return a connected socket on ``topic`` that only reads."""
        return subscribe(self.master, topic, message_class, "/bench_sink_%d" % number)

    def now(self):
        """Return simulation time [s], from one message of /clock."""
        with contextlib.closing(self.sink("/clock", Clock)) as connection:
            secs, nsecs = struct.unpack("<II", Sink(connection).message()[-8:])
        return secs + 1e-9 * nsecs

    def factor(self, seconds):
        """Return the real-time factor over ``seconds`` of wall time."""
        simulated, wall = self.now(), time.monotonic()
        time.sleep(seconds)
        return (self.now() - simulated) / (time.monotonic() - wall)

    def _launch_it(self):
        begin = time.monotonic()
        self._launched = self.start("roslaunch", *self._launch,
                                    *("%s:=%s" % pair for pair in self._arguments.items()))
        wait_until(self._is_ready, "%s of %s" % (self._ready, " ".join(self._launch)), START_LIMIT_S, 0.02)
        self.started_s = time.monotonic() - begin

    def _answers(self):
        try:
            return self.master.getPid("/bench")[0] == 1
        except OSError:
            return False

    def _is_ready(self):
        published, _, services = self.master.getSystemState("/bench")[2]
        if self._ready in dict(services):
            return True
        if self._ready not in dict(published):
            return False
        with contextlib.closing(self.sink(self._ready, Empty)) as connection:
            Sink(connection).message()
        return True


def subscribe(master, topic, message_class, caller):
    """Open one TCPROS connection to the publisher of ``topic``; all subscribers in a rospy process would share one.

    ``caller`` is the name of a node that does not exist, a new one each time: rospy keeps one connection per node.
    Waits until the topic is published.
    """
    publishers = wait_until(lambda: dict(master.getSystemState("/bench")[2][0]).get(topic), topic, START_LIMIT_S, 0.02)
    uri = master.lookupNode("/bench", publishers[0])[2]
    _, host, port = xmlrpc.client.ServerProxy(uri).requestTopic("/bench", topic, [["TCPROS"]])[2]
    connection = socket.create_connection((host, port))
    fields = {"callerid": caller, "topic": topic, "type": message_class._type, "md5sum": message_class._md5sum,
              "tcp_nodelay": "1"}
    header = b"".join(struct.pack("<I", len(field)) + field
                      for field in (("%s=%s" % pair).encode() for pair in fields.items()))
    connection.sendall(struct.pack("<I", len(header)) + header)
    return connection


class Process:
    """CPU time of a process."""

    def __init__(self, pid):
        self.pid = pid

    def cpu_s(self):
        """Of all of its threads since its start [s]."""
        fields = Path("/proc/%d/stat" % self.pid).read_text().rsplit(")", 1)[1].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


class Sink:
    """Messages of one connection."""

    def __init__(self, connection):
        self._connection, self._held = connection, b""
        self._read_block()  # the publisher's header

    def message(self):
        """Return the next message's bytes; waits for it."""
        return self._read_block()

    def _read_block(self):
        length, = struct.unpack("<I", self._read(4))
        return self._read(length)

    def _read(self, count):
        while len(self._held) < count:
            more = self._connection.recv(65536)
            if not more:
                raise SystemExit("the publisher closed the connection")
            self._held += more
        taken, self._held = self._held[:count], self._held[count:]
        return taken


def arrivals(lab, plan, watched, seconds):
    """Read from ``plan`` ([(topic, class, number of connections)]) for ``seconds``. Return the arrival times [s] on the
    first connection of topic ``watched``; for several topics, a tuple of lists."""
    selector, connections = selectors.DefaultSelector(), []
    times = {topic: [] for topic in watched}
    for topic, message_class, count in plan:
        for number in range(count):
            connection = lab.sink(topic, message_class, number)
            connections.append(connection)
            selector.register(connection, selectors.EVENT_READ, topic if number == 0 else None)
    end = time.monotonic() + seconds + 0.5
    begin = end - seconds  # only the steady state is measured
    while time.monotonic() < end:
        for key, _ in selector.select(0.1):
            key.fileobj.recv(65536)
            now = time.monotonic()
            if key.data in times and now >= begin:
                times[key.data].append(now)
    for connection in connections:
        connection.close()
    return tuple(times[topic] for topic in watched)


def plan_of(count):
    """The topics that ``count`` subscribers of a robot connect to."""
    return [("/clock", Clock, count), ("/robot/joint_states", JointState, count)]


def memory_mb(pid):
    """Return the memory of a process, with shared pages divided among their users [MB]."""
    for line in Path("/proc/%d/smaps_rollup" % pid).read_text().splitlines():
        if line.startswith("Pss:"):
            return int(line.split()[1]) / 1024.0
    raise SystemExit("no memory figure for process %d" % pid)


def _end(process):
    process.send_signal(signal.SIGINT)
    try:
        process.wait(20)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    if process.stdout:
        process.stdout.close()
