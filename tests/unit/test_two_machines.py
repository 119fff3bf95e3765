# SPDX-License-Identifier: BSD-3-Clause
"""The simulator on one machine, the student's programs on another: two network namespaces and a cable between them.

The cable has real addresses, a host name on one side only, and can be pulled. Needs root, to make namespaces.
"""

import contextlib
import os
import re
import shutil
import signal
import subprocess
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SERVER_ADDRESS, CLIENT_ADDRESS, SERVER_NAME = "10.77.0.1", "10.77.0.2", "lab-robot"
COMMAND_LIMIT_S = 120

pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(os.geteuid() != 0, reason="network namespaces need root"),
    pytest.mark.skipif(shutil.which("ip") is None, reason="ip, of the package iproute2, is not installed"),
]

# Turns the left wrist at 0.5 rad/s until it is stopped.
TURN = """
import rospy, baxter_interface
rospy.init_node("turn")
limb = baxter_interface.Limb("left")
rate = rospy.Rate(50)
print("turning", flush=True)
while not rospy.is_shutdown():
    limb.set_joint_velocities({"left_w2": 0.5})
    rate.sleep()
"""
# Prints the speed of the left wrist [rad/s] once per message.
WATCH = """
import rospy
from sensor_msgs.msg import JointState
rospy.init_node("watch")
rospy.Subscriber("/robot/joint_states", JointState, lambda m: print(m.velocity[m.name.index("left_w2")], flush=True))
rospy.spin()
"""
# A doctor whose own clock is 30 s ahead.
SKEWED_DOCTOR = """
import runpy, sys, time
true_time = time.time
time.time = lambda: true_time() + 30.0
sys.argv = [sys.argv[1]]
sys.path.insert(0, sys.argv[0].rsplit("/", 1)[0])
runpy.run_path(sys.argv[0], run_name="__main__")
"""


def ip(*words):
    subprocess.run(["ip", *words], check=True, capture_output=True, text=True)


class Machine:
    """A network namespace that runs baxter.sh."""

    def __init__(self, namespace, mode):
        self.namespace, self.mode = namespace, mode

    def _command(self, command):
        clean = ["env", "-u", "ROS_MASTER_URI", "-u", "ROS_IP", "-u", "ROS_HOSTNAME", "-u", "DISPLAY"]
        return ["ip", "netns", "exec", self.namespace, *clean, str(ROOT / "baxter.sh"), *self.mode, *command]

    def run(self, *command):
        """Output of a command that must succeed."""
        done = subprocess.run(self._command(command), capture_output=True, text=True, timeout=COMMAND_LIMIT_S)
        assert done.returncode == 0, f"{command}: {done.stdout}{done.stderr}"
        return done.stdout

    def doctor(self, host):
        """The doctor's output; its exit code says whether anything is wrong."""
        command = ["ip", "netns", "exec", self.namespace, str(ROOT / "baxter.sh"), "doctor", host]
        return subprocess.run(command, capture_output=True, text=True, timeout=COMMAND_LIMIT_S).stdout

    @contextlib.contextmanager
    def running(self, *command, output=subprocess.DEVNULL):
        process = subprocess.Popen(self._command(command), stdout=output, stderr=subprocess.DEVNULL, text=True,
                                   start_new_session=True)
        try:
            yield process
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGINT)
            try:
                process.wait(20)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()


@pytest.fixture(scope="module")
def cable():
    """(server, client, function that pulls or plugs the cable)."""
    names = [f"lab{os.getpid()}{end}" for end in "ab"]
    hosts = Path("/etc/netns") / names[1] / "hosts"
    with contextlib.ExitStack() as cleanup:
        try:
            for name in names:
                ip("netns", "add", name)
                cleanup.callback(ip, "netns", "delete", name)
            ip("link", "add", "cable", "netns", names[0], "type", "veth", "peer", "name", "cable", "netns", names[1])
        except subprocess.CalledProcessError as error:
            pytest.skip(f"root may not connect two network namespaces on this machine: {error.stderr}")
        for name, address in zip(names, (SERVER_ADDRESS, CLIENT_ADDRESS), strict=True):
            ip("-n", name, "address", "add", f"{address}/24", "dev", "cable")
            for link in ("lo", "cable"):
                ip("-n", name, "link", "set", link, "up")
        hosts.parent.mkdir(parents=True)
        cleanup.callback(shutil.rmtree, hosts.parent)
        hosts.write_text(f"127.0.0.1 localhost\n{SERVER_ADDRESS} {SERVER_NAME}\n")

        def plug(on):
            ip("-n", names[0], "link", "set", "cable", "up" if on else "down")

        yield Machine(names[0], ["sim", "--public"]), Machine(names[1], [SERVER_NAME]), plug


@pytest.fixture(scope="module")
def lab(cable):
    server, client, plug = cable
    with server.running("roslaunch", "baxter_gazebo", "baxter_world.launch", "gui:=false", "enable:=true"):
        server.run("rosrun", "baxter_tools", "enable_robot.py", "-e")  # waits for master and robot
        yield server, client, plug


def move_arms(client):
    """By IK across the cable; the program fails unless the arm gets there, and says how near."""
    said = client.run("rosrun", "rf_lab2", "move_baxter.py")
    assert float(re.search(r"gripper is (\S+) mm", said)[1]) < 1.0, said


def test_tf_ik_and_motion_across_the_cable(lab):
    _, client, _ = lab
    move_arms(client)
    client.run("timeout", "30", "rostopic", "echo", "-n", "5", "/robot/joint_states")


def test_a_trajectory_across_the_cable(lab):
    server, client, _ = lab
    with server.running("rosrun", "baxter_traj_streamer", "traj_interpolator_as"):
        client.run("rosrun", "baxter_traj_streamer", "traj_action_client_pre_pose")


def speeds(watch, seconds):
    """Output of `watch` during this wall time [rad/s]."""
    deadline = time.monotonic() + seconds
    found = []
    while time.monotonic() < deadline:
        found.append(float(watch.stdout.readline()))
    return found


def wait_for_speed(watch, expected):
    deadline = time.monotonic() + 30
    while abs(float(watch.stdout.readline()) - expected) > 0.02:
        assert time.monotonic() < deadline, f"the wrist never turned at {expected} rad/s"


def test_a_pulled_cable_stops_the_arm_and_service_comes_back(lab):
    server, client, plug = lab
    with (server.running("python3", "-c", WATCH, output=subprocess.PIPE) as watch,
          client.running("python3", "-c", TURN)):
        wait_for_speed(watch, 0.5)
        plug(False)
        wait_for_speed(watch, 0.0)
        assert max(map(abs, speeds(watch, 5.0))) < 0.01
        plug(True)
        wait_for_speed(watch, 0.5)
    move_arms(client)


def test_the_doctor_tells_what_is_wrong(lab):
    _, client, plug = lab
    assert "Nothing is wrong" in client.doctor(SERVER_NAME)
    nobody = f"no-{SERVER_NAME}"
    assert f"WRONG network    the master's host name {nobody} does not resolve" in client.doctor(nobody)
    skewed = client.run("bash", "-c", '! python3 -c "$0" "$1"', SKEWED_DOCTOR, str(ROOT / "tools" / "doctor.py"))
    assert f"the clock of {SERVER_NAME} is" in skewed and "behind this one's" in skewed, skewed
    plug(False)
    try:
        assert "WRONG master" in client.doctor(SERVER_NAME)
    finally:
        plug(True)
