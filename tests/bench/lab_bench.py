#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Run the whole lab with both arms moving and say whether it keeps up: real-time factor, CPU of /gazebo, message rates.

    ./baxter.sh sim tests/bench/lab_bench.py                        headless
    ./baxter.sh sim tests/bench/lab_bench.py --gui                  with the simulator's window (on a virtual screen)
    ./baxter.sh sim tests/bench/lab_bench.py --rviz                 with rviz

Each run adds, after the plain measurement, a subscriber that has stopped reading, then a busy Python thread inside
/gazebo.
"""

import argparse
import contextlib
import math
import multiprocessing
import os
import selectors
import signal
import socket
import statistics
import struct
import subprocess
import sys
import time
import xmlrpc.client
from pathlib import Path

import rospy
from baxter_core_msgs.msg import JointCommand
from gazebo_msgs.srv import DeleteModel, SpawnModel
from geometry_msgs.msg import Pose
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Empty

from lab_testing.ports import free_port
from lab_testing.waiting import wait_until

SIDES = ("left", "right")
JOINTS = ("s0", "s1", "e0", "e1", "w0", "w1", "w2")
NEUTRAL = (0.0, -0.55, 0.0, 0.75, 0.0, 1.26, 0.0)
COMMAND_HZ = 100.0
BUSY_MODEL = """<robot name="busy"><link name="world"/>
<gazebo><plugin name="busy" filename="libbench_busy.so"/></gazebo></robot>"""


def subscribe(master, topic, message_class, caller):
    """Open one TCPROS connection to the publisher of ``topic``; a rospy process would share one among all.

    ``caller`` names a node that does not exist, another one each time: rospy keeps one connection for each.
    """
    _, _, (published, _, _) = master.getSystemState("/lab_bench")
    node = dict(published)[topic][0]
    uri = master.lookupNode("/lab_bench", node)[2]
    _, _, protocol = xmlrpc.client.ServerProxy(uri).requestTopic("/lab_bench", topic, [["TCPROS"]])
    connection = socket.create_connection((protocol[1], protocol[2]))
    fields = {
        "callerid": caller,
        "topic": topic,
        "type": message_class._type,
        "md5sum": message_class._md5sum,
        "tcp_nodelay": "1",
    }
    header = b"".join(
        struct.pack("<I", len(field)) + field for field in (f"{k}={v}".encode() for k, v in fields.items())
    )
    connection.sendall(struct.pack("<I", len(header)) + header)
    return connection


def drain(master_uri, plan, connected, ending, arrivals):
    """Child process: read from many connections; report the arrival times on the last one."""
    master = xmlrpc.client.ServerProxy(master_uri)
    selector = selectors.DefaultSelector()
    times = []
    for topic, message_class, count in plan:
        for number in range(count):
            connection = subscribe(master, topic, message_class, f"/lab_bench_{number}")
            selector.register(connection, selectors.EVENT_READ, (topic, number))
    last = (plan[-1][0], 0)
    connected.set()
    while not ending.is_set():
        for key, _ in selector.select(0.2):
            key.fileobj.recv(65536)
            if key.data == last:
                times.append(time.monotonic())
    arrivals.put(times)


class Process:
    """CPU time of a process."""

    def __init__(self, pid):
        self.pid = pid

    def cpu_s(self):
        fields = Path(f"/proc/{self.pid}/stat").read_text().rsplit(")", 1)[1].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


class Lab:
    """The launched lab, both arms swinging around neutral."""

    def __init__(self, launch, gui, rviz):
        self.launch, self.gui, self.rviz = launch, gui, rviz

    def __enter__(self):
        self._stack = contextlib.ExitStack()
        port = free_port()
        environment = dict(os.environ, ROS_MASTER_URI=f"http://localhost:{port}", ROS_HOSTNAME="localhost")
        environment["PYTHONPATH"] = f"{Path(__file__).parent}:{environment.get('PYTHONPATH', '')}"
        if self.gui or self.rviz:
            display = f":{port % 1000 + 100}"
            self._start(["Xvfb", display, "-screen", "0", "1280x1024x24"], environment)
            environment.update(DISPLAY=display, LIBGL_ALWAYS_SOFTWARE="1")
        os.environ.update(environment)
        self._start(["roscore", "-p", str(port)], environment)
        self.master = xmlrpc.client.ServerProxy(environment["ROS_MASTER_URI"])
        wait_until(self._master_answers, "the master", 60.0)
        self.master.setParam("/lab_bench", "/gazebo/model_plugins", {"libbench_busy.so": "busy_plugin:BusyPlugin"})
        command = ["roslaunch", *self.launch]
        command += [f"gui:={str(self.gui).lower()}", f"rviz:={str(self.rviz).lower()}", "enable:=true"]
        self._start(command, environment)
        wait_until(lambda: self.master.hasParam("/lab_bench", "/use_sim_time")[2], "roslaunch", 60.0)
        rospy.init_node("lab_bench", disable_signals=True)
        rospy.wait_for_message("/robot/sim/started", Empty, timeout=60)
        self.gazebo = Process(self._pid("/gazebo"))
        self._publishers = {
            side: rospy.Publisher(f"/robot/limb/{side}/joint_command", JointCommand, queue_size=1) for side in SIDES
        }
        rospy.Publisher("/robot/set_super_enable", Bool, latch=True, queue_size=1).publish(True)
        self._timer = rospy.Timer(rospy.Duration(1.0 / COMMAND_HZ), self._swing)
        return self

    def __exit__(self, *_):
        self._timer.shutdown()
        rospy.signal_shutdown("done")
        self._stack.close()

    def _swing(self, event):
        swing = 0.3 * math.sin(event.current_real.to_sec())
        for side, publisher in self._publishers.items():
            names = [f"{side}_{joint}" for joint in JOINTS]
            publisher.publish(JointCommand.POSITION_MODE, [angle + swing for angle in NEUTRAL], names)

    def _start(self, command, environment):
        process = subprocess.Popen(
            command, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
        )
        self._stack.callback(self._stop, process)

    @staticmethod
    def _stop(process):
        process.send_signal(signal.SIGINT)
        try:
            process.wait(15)
        except subprocess.TimeoutExpired:
            process.kill()

    def _master_answers(self):
        try:
            return self.master.getPid("/lab_bench")[0] == 1
        except OSError:
            return False

    def _pid(self, node):
        return xmlrpc.client.ServerProxy(self.master.lookupNode("/lab_bench", node)[2]).getPid("/lab_bench")[2]

    def measure(self, label, seconds, clocks, states):
        """Measure for ``seconds`` of wall time with so many connections; print one row."""
        fresh = multiprocessing.get_context("spawn")  # a fork would take rospy's connections along
        connected, ending, arrivals = fresh.Event(), fresh.Event(), fresh.Queue()
        plan = [("/clock", Clock, clocks), ("/robot/joint_states", JointState, states)]
        child = fresh.Process(target=drain, args=(os.environ["ROS_MASTER_URI"], plan, connected, ending, arrivals))
        child.start()
        # What is measured is the steady state, so the connections come first.
        if not connected.wait(60.0):
            raise SystemExit("the connections did not come within 60 s")
        wall, simulated, used = time.monotonic(), rospy.get_time(), self.gazebo.cpu_s()
        time.sleep(seconds)
        elapsed = time.monotonic() - wall
        factor = (rospy.get_time() - simulated) / elapsed
        cpu = (self.gazebo.cpu_s() - used) / elapsed
        ending.set()
        times = arrivals.get()
        child.join()
        gaps = [b - a for a, b in zip(times, times[1:], strict=False)]
        print(
            f"{label:34s}{factor:8.4f}{100 * cpu:9.1f} %{1 / statistics.mean(gaps):12.2f} Hz"
            f"{1e3 * statistics.stdev(gaps):9.2f} ms",
            flush=True,
        )


@contextlib.contextmanager
def stopped_subscriber():
    """A subscriber of /clock and the joint states that somebody stopped with Ctrl-Z."""
    program = (
        "import rospy; from rosgraph_msgs.msg import Clock; from sensor_msgs.msg import JointState; "
        "rospy.init_node('stopped', anonymous=True); print('up', flush=True); "
        "rospy.Subscriber('/robot/joint_states', JointState, lambda m: print('heard', flush=True)); rospy.spin()"
    )
    process = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True)
    while process.stdout.readline() != "heard\n":
        pass
    process.send_signal(signal.SIGSTOP)
    try:
        yield
    finally:
        process.kill()
        process.wait()


@contextlib.contextmanager
def busy_thread():
    """A thread inside /gazebo that computes without pause, in Python."""
    rospy.ServiceProxy("/gazebo/spawn_urdf_model", SpawnModel)("busy", BUSY_MODEL, "", Pose(), "")
    try:
        yield
    finally:
        rospy.ServiceProxy("/gazebo/delete_model", DeleteModel)("busy")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--launch",
        nargs=2,
        metavar=("PKG", "FILE"),
        default=("baxter_gazebo", "baxter_world.launch"),
        help="another lab with a Baxter, such as workspace_tests three_robots.launch",
    )
    parser.add_argument("--gui", action="store_true", help="open the simulator's window")
    parser.add_argument("--rviz", action="store_true", help="open rviz")
    parser.add_argument("--seconds", type=float, default=15.0, help="length of each measurement (default %(default)s)")
    parser.add_argument("--clocks", type=int, default=10, help="connections on /clock (default %(default)s)")
    parser.add_argument("--states", type=int, default=5, help="connections on joint_states (default %(default)s)")
    arguments = parser.parse_args()
    with Lab(arguments.launch, arguments.gui, arguments.rviz) as lab:
        print(f"{'':34s}{'real time':>8s}{'/gazebo':>11s}{'joint_states':>15s}{'sd':>12s}")
        count = arguments.clocks, arguments.states
        lab.measure("both arms moving", arguments.seconds, *count)
        with stopped_subscriber():
            lab.measure("and a stopped subscriber", arguments.seconds, *count)
        with busy_thread():
            lab.measure("and a busy thread in /gazebo", arguments.seconds, *count)


if __name__ == "__main__":
    main()
