# SPDX-License-Identifier: BSD-3-Clause
"""The node beside a master and a robot, most of them without a simulator: no scene, grippers, cameras, move_group."""
import json
import os
import re
import signal
import subprocess
import sys
import threading
import urllib.request
from pathlib import Path

import cbor2
import lab_arms
import numpy as np
import pytest
import rosgraph
import websocket
from fake_move_group import BLOCKED_RAD, ENDLESS_RAD, IN_COLLISION

from lab_testing.waiting import stretched, wait_until
from lab_web.control import HEARTBEAT_S
from lab_web.libraries import LibrariesError, fetched
from lab_web.serving import SCREEN
from processes.ports import free_port
from world_picture.snapshot import SnapshotWriter

HERE = Path(__file__).resolve().parent
PACKAGE = HERE.parents[1]
START_S = 60.0


def result_file(home):
    return home / "lab_page" / "exercise.json"


class Process:
    """A program whose lines come while it runs."""

    def __init__(self, environment, *command):
        self.process = subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                                        text=True)
        self.lines = []
        self._reader = threading.Thread(target=self._read)
        self._reader.start()

    def _read(self):
        for line in self.process.stdout:
            self.lines.append(line)

    def found(self, pattern):
        """The first match in a line of its output, or None."""
        return next(filter(None, (re.search(pattern, line) for line in list(self.lines))), None)

    def end(self):
        self.process.terminate()
        try:
            self.process.wait(stretched(10))
        except subprocess.TimeoutExpired:
            self.process.kill()
        self.process.wait()
        self._reader.join()
        self.process.stdout.close()


class Page:
    """A page without a browser: its heartbeat, and what it was told."""

    def __init__(self, port, token="drive"):
        self._socket = websocket.create_connection("ws://127.0.0.1:%d/lab?token=%s" % (port, token),
                                                   timeout=stretched(60))
        self.heard = []
        self.poses = 0
        self._ended = threading.Event()
        self._threads = [threading.Thread(target=target) for target in (self._beat, self._read)]
        for thread in self._threads:
            thread.start()

    def send(self, **operation):
        # As the page does: the server takes operations of pages that it has just heard.
        self._socket.send("beat")
        self._socket.send(json.dumps(operation))

    def last(self, op):
        return next((operation for operation in reversed(self.heard) if operation["op"] == op), None)

    def told(self):
        return [operation["text"] for operation in self.heard if operation["op"] == "told"]

    def close(self):
        self._ended.set()
        self._socket.close()
        for thread in self._threads:
            thread.join()

    def _beat(self):
        while not self._ended.wait(HEARTBEAT_S):
            try:
                self._socket.send("beat")
            except (OSError, websocket.WebSocketException):
                return

    def _read(self):
        while not self._ended.is_set():
            try:
                frame = self._socket.recv()
            except (OSError, websocket.WebSocketException):
                return
            if isinstance(frame, str) and frame:
                self.heard.append(json.loads(frame))
            self.poses += isinstance(frame, bytes)


class Hall:
    """A master, a robot, and the page's server."""

    def __init__(self, folder, *world, clock_s=None):
        """``world``: a folder for the snapshot of a world, or nothing; ``clock_s``: where simulated time stands [s]."""
        port = free_port()
        self._environment = dict(os.environ, ROS_MASTER_URI="http://localhost:%d" % port, ROS_HOSTNAME="localhost",
                                 ROS_LOG_DIR=str(folder), PYTHONUNBUFFERED="1", ROS_HOME=str(folder / "home"))
        self.home = folder / "home"
        for name in ("ROS_NAMESPACE", "ROS_IP"):
            self._environment.pop(name, None)
        self._processes = []
        try:
            self._start("rosmaster", "--core", "-p", str(port))
            self.master = rosgraph.Master("/test", self._environment["ROS_MASTER_URI"])
            wait_until(self.master.is_online, "the master", START_S)
            self.robot = self._start(sys.executable, str(HERE / "fake_baxter.py"), *map(str, world))
            wait_until(lambda: self.master.hasParam("/robot_description"), "the robot", START_S)
            if clock_s is not None:
                self.master.setParam("/use_sim_time", True)
                self._start("rostopic", "pub", "--latch", "/clock", "rosgraph_msgs/Clock",
                            "clock: {secs: %d}" % clock_s)
            self.server = self._start(sys.executable, str(PACKAGE / "nodes" / "lab_web"), "--token", "drive",
                                      "--view-token", "look")
            self.port = int(wait_until(lambda: self.server.found(r"localhost:(\d+)/\?token=drive"), "the address",
                                       START_S)[1])
        except BaseException:
            self.close()
            raise

    def _start(self, *command):
        self._processes.append(Process(self._environment, *command))
        return self._processes[-1]

    def said(self, what):
        """The values that the robot got of a kind: a list of lists."""
        rows = [json.loads(line) for line in list(self.robot.lines) if line.startswith("[\"")]
        return [values for kind, *values in rows if kind == what]

    def subscriptions(self, below="/robot/"):
        """The robot's topics, or others, that the page's server has subscribed to."""
        return {topic for topic, nodes in self.master.getSystemState()[1]
                if topic.startswith(below) and "/lab_web" in nodes}

    def drive(self):
        """A page that has the control of an enabled robot."""
        page = Page(self.port)
        wait_until(lambda: len((page.last("robot") or {}).get("hands", ())) == 2, "the arms", START_S)
        page.send(op="take")
        wait_until(lambda: (page.last("control") or {}).get("mine"), "the control")
        page.send(op="enable")
        wait_until(lambda: self.said("state")[-1:] == [[True, False]], "an enabled robot", START_S)
        return page

    def close(self):
        for process in reversed(self._processes):
            process.end()


@pytest.fixture(scope="module")
def libraries():
    try:
        fetched(PACKAGE / "page")
    except LibrariesError as error:
        pytest.skip(str(error))


@pytest.fixture
def hall(libraries, tmp_path):
    made = Hall(tmp_path)
    yield made
    made.close()


@pytest.fixture
def world(libraries, tmp_path):
    """A hall with the snapshot of a world, in which there is a can."""
    made = Hall(tmp_path, tmp_path)
    yield made
    made.close()


def test_the_clock_is_read_but_for_a_client_that_needs_no_time(libraries, tmp_path):
    hall = Hall(tmp_path, clock_s=77)
    clients = []

    def connect(more=""):
        clients.append(websocket.create_connection("ws://127.0.0.1:%d/rosbridge?token=look%s" % (hall.port, more),
                                                   timeout=stretched(60)))
        return clients[-1]

    def received(client, compression="none"):
        client.send(json.dumps({"op": "subscribe", "topic": "/robot/state", "compression": compression}))
        return client.recv()
    try:
        assert json.loads(received(connect("&time=none")))["topic"] == "/robot/state"
        assert hall.subscriptions("/clock") == set()
        client = connect()
        # The clock's publisher may take longer to connect than the server waits.
        wait_until(lambda: isinstance(frame := received(client, "cbor-raw"), bytes)
                   and cbor2.loads(frame)["msg"]["secs"] == 77, "the simulated time")
        assert hall.subscriptions("/clock") == {"/clock"}
    finally:
        for client in clients:
            client.close()
        hall.close()


def test_arms_move_and_parts_follow_and_what_is_missing_is_told(hall):
    assert hall.subscriptions() == set()
    page = hall.drive()
    try:
        assert hall.subscriptions() > {"/robot/joint_states", "/robot/state"}
        described = page.last("robot")
        assert [joint["name"] for joint in described["joints"]] == lab_arms.JOINTS
        assert described["has_scene"] is False and described["grippers"] == described["cameras"] == []
        wait_until(lambda: page.last("robot")["can_press"], "buttons")
        # Hands: where they are, and on to where they go.
        page.send(op="reach", side="left", number=1)
        wait_until(lambda: (page.last("reach") or {}).get("number") == 1, "an answer", START_S)
        here = page.last("reach")
        assert here["why"] == "" and here["ghost"] is None
        x, y, z = here["position"]
        page.send(op="reach", side="left", number=2, position=[x - 0.05, y, z], orientation=here["orientation"])
        wait_until(lambda: page.last("reach")["number"] == 2, "an answer")
        assert page.last("reach")["why"] == ""
        joints = page.last("reach")["joints"]
        page.send(op="record", on=True)

        def there():
            last = {}
            for (command,) in hall.said("joints"):
                last.update(command)
            if all(last.get(name) == pytest.approx(angle, abs=1e-6) for name, angle in joints.items()):
                return True
            page.send(op="move", joints=joints)
            return False
        wait_until(there, "the hand at its place", 120.0, interval_s=1.0)
        page.send(op="record", on=False)
        wait_until(lambda: (page.last("recording") or {}).get("seconds"), "a recording")
        with urllib.request.urlopen("http://127.0.0.1:%d/recording.csv?token=look" % hall.port,
                                    timeout=stretched(60)) as answer:
            assert answer.read().startswith(b"time,left_s0,")
        # An exercise that is checked meanwhile.
        result_file(hall.home).parent.mkdir(exist_ok=True)
        result_file(hall.home).write_text(json.dumps({
            "exercise": "wave", "points": 90, "pass_mark": 80, "passed": True, "not_graded": None, "hint": None,
            "runs": []}))
        wait_until(lambda: (page.last("result") or {}).get("passed"), "the exercise's result")
        # The other parts.
        page.send(op="press", name="left_lower_cuff", pressed=True)
        page.send(op="output", name="head_red_light", value=True)
        page.send(op="output", name="torso_fan", value=7)
        page.send(op="nod")
        rows = bytes((1, 2, 3)) * (SCREEN[0] * SCREEN[1])
        urllib.request.urlopen(urllib.request.Request(
            "http://127.0.0.1:%d/screen?token=drive&page=%d" % (hall.port, page.last("hello")["number"]), rows),
            timeout=stretched(60)).close()
        for what, values in (("press", ["press", "left_lower_cuff", 0]), ("digital", ["head_red_light", True]),
                             ("analog", ["torso_fan", 7]), ("nod", [True]), ("screen", [*SCREEN, "rgb8", [1, 2, 3]])):
            wait_until(lambda what=what, values=values: values in hall.said(what), what)
        page.send(op="press", name="nothing", pressed=True)
        wait_until(lambda: any("there is no such button" in text for text in page.told()), "the robot's reason")
        before = len(page.told())
        for operation in ({"op": "grip", "side": "left", "action": "open"}, {"op": "delete", "name": "can"},
                          {"op": "spawn", "name": "elephant"}):
            page.send(**operation)
        wait_until(lambda: len(page.told()) >= before + 3, "three reasons")
        page.send(op="release")
        wait_until(lambda: ["release", "left_lower_cuff", 0] in hall.said("press"), "the cuff's release")
    finally:
        page.close()
    wait_until(lambda: hall.subscriptions() == set(), "the server to rest, also after a switch of the robot")


def test_an_arm_that_the_robot_holds_is_told_with_its_reason_and_the_command_that_helps(hall):
    page = hall.drive()
    try:
        hall.master.setParam("/fake_baxter/near", ["collision_head_link_2"])
        begin = lab_arms.posture()["left_s0"]

        def told():
            if not any("left_s0 stands still" in text for text in page.told()):
                page.send(op="move", joints={"left_s0": begin + 0.05})
                return False
            return True
        wait_until(told, "the reason", 60.0, interval_s=0.5)
        assert all(part in page.told()[-1] for part in ("too near to collision_head_link_2", "tuck_arms.py -u"))
    finally:
        page.close()


def test_the_arms_follow_a_plan_and_the_planners_reasons_are_told(hall):
    page = hall.drive()
    try:
        wait_until(lambda: page.last("robot")["can_plan"], "a planner")

        def planned(joint, angle):
            page.heard[:] = [row for row in page.heard if row["op"] != "plan"]
            page.send(op="plan", joints={joint: angle})
            wait_until(lambda: (page.last("plan") or {}).get("why", "busy") != "busy", "an answer", START_S)
            return page.last("plan")
        assert planned("right_s0", 0.4)["why"] == "found"
        wait_until(lambda: any(row.get("right_s0") == pytest.approx(0.4, abs=1e-6) for (row,) in hall.said("joints")),
                   "the arm at its goal")
        assert hall.said("plan") == [["right_arm", {"right_s0": 0.4}, True, True]]
        blocked = planned("left_s0", BLOCKED_RAD)
        assert (blocked["why"], blocked["text"]) == ("goal_in_collision",
                                                     "the goal is in collision: " + IN_COLLISION)
        # Planning that goes on until it is stopped.
        page.heard[:] = [row for row in page.heard if row["op"] != "plan"]
        page.send(op="plan", joints={"left_s0": ENDLESS_RAD})
        wait_until(lambda: len(hall.said("plan")) == 3, "a goal at the planner")
        page.send(op="stop")
        wait_until(lambda: page.last("plan")["why"] == "preempted" and hall.said("preempted"),
                   "the end of the planning")
        assert not any("left_s0" in row for (row,) in hall.said("joints"))
    finally:
        page.close()


def test_threads_outlive_what_nobody_foresaw(hall, tmp_path):
    page = hall.drive()
    writer = SnapshotWriter(tmp_path)
    try:
        hall.master.setParam("/gazebo/snapshot", 5)
        wait_until(lambda: hall.server.found("/gazebo/snapshot is 5"), "a warning")
        assert page.last("robot")["has_scene"] is False
        for number, position in enumerate(([10 ** 400, 0, 0], [0.5, [0.0], 0]), 1):
            page.send(op="reach", side="left", number=number, position=position, orientation=[0, 0, 0, 1])
            wait_until(lambda number=number: (page.last("reach") or {}).get("number") == number, "an answer", START_S)
            assert page.last("reach")["why"] == "invalid"
        writer.write_scene([{"name": "robot", "urdf": lab_arms.URDF, "joints": lab_arms.JOINTS}])
        writer.write(1, 0.0, [np.array([0.0, 0.0, 0.9, 0.0, 0.0, 0.0, 1.0, *lab_arms.posture().values()])])
        hall.master.setParam("/gazebo/snapshot", str(writer.folder))
        wait_until(lambda: page.poses and page.last("robot")["has_scene"], "poses of the world", START_S)
    finally:
        page.close()
        writer.close()


def test_a_server_that_is_killed_commands_nothing_more_and_holds_no_button(hall):
    page = hall.drive()
    try:
        before = lab_arms.posture()["left_s0"]

        def moves():
            page.send(op="move", joints={"left_s0": before + 2.4})
            return len(hall.said("joints")) > 20
        wait_until(moves, "a motion", 60.0, interval_s=0.3)
        page.send(op="press", name="left_lower_cuff", pressed=True)
        wait_until(lambda: ["press", "left_lower_cuff", 0] in hall.said("press"), "a squeezed cuff")
        hall.server.process.send_signal(signal.SIGKILL)
        hall.server.process.wait()
    finally:
        page.close()
    last = hall.said("joints")[-1][0]["left_s0"]
    assert before < last < before + 2.3
    wait_until(lambda: ["release", "left_lower_cuff", 0] in hall.said("press"), "the cuff's release", START_S)


def test_the_simulation_is_paused_and_its_objects_are_added_moved_and_deleted(world):
    page = world.drive()
    try:
        wait_until(lambda: page.last("robot")["has_scene"], "a world")
        wait_until(lambda: page.last("simulation") == {"op": "simulation", "paused": False}, "a simulation that runs")
        page.send(op="reach", side="left", number=1)
        wait_until(lambda: (page.last("reach") or {}).get("ghost"), "a ghost", START_S)
        assert page.last("reach")["ghost"]["base"] == [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0.9]
        for do in ("pause", "step", "reset"):
            page.send(op="simulation", do=do)
        wait_until(lambda: page.last("simulation")["paused"], "a pause")
        page.send(op="spawn", name="red_block")
        page.send(op="grab", name="can")
        wait_until(lambda: page.last("grabbed") is not None, "where the can is")
        assert page.last("grabbed") == {"op": "grabbed", "name": "can", "position": [1, 2, 3],
                                        "orientation": [0, 0, 0, 1]}
        wait_until(lambda: world.said("step") == [[1]] and world.said("reset") == [[]], "a step and a reset")
        wait_until(lambda: world.said("spawn") == [["red_block", True, "world"]], "a block")

        def put():
            # The first message may come before the publisher knows its subscriber.
            page.send(op="put", name="can", position=[0.5, 0, 1], orientation=[0, 0, 0, 2])
            return world.said("put")
        wait_until(put, "the can at its place", interval_s=0.5)
        assert world.said("put")[0] == ["can", 0.5, 1.0, "world"]
        page.send(op="delete", name="can")
        wait_until(lambda: any("it is held" in text for text in page.told()), "the simulator's reason")
        page.send(op="delete", name="robot")
        wait_until(lambda: any("robot is the robot" in text for text in page.told()), "a refusal")
        wait_until(lambda: world.said("delete") == [["can"]], "one deletion")
    finally:
        page.close()
