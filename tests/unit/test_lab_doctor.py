# SPDX-License-Identifier: BSD-3-Clause
"""The doctor's findings in fake environments, and its deadline."""

import contextlib
import fcntl
import socket
import threading
import time
from dataclasses import replace
from xmlrpc.server import SimpleXMLRPCServer

import pytest

from lab_doctor.checks import Level, examine
from lab_doctor.facts import (
    ControllerFacts,
    Facts,
    Listener,
    Master,
    MoveGroupFacts,
    OtherMaster,
    PythonFacts,
    Sensor,
    SetUp,
    SetupFailure,
    TopicFacts,
)
from lab_doctor.probe import (
    answer_all,
    ask_master,
    clock_offset_s,
    find_deaf_nodes,
    gather,
    master_ports,
    parse_listeners,
    resolve,
    set_up_at_work,
    users_python,
)
from lab_testing.waiting import wait_until

ENABLED = {"enabled": True, "stopped": False, "error": False}
HEALTHY_LAB = Facts(
    root="/ws",
    variables={"ROS_MASTER_URI": "http://localhost:11311", "ROS_HOSTNAME": "localhost", "ROS_IP": ""},
    addresses={"localhost": ("127.0.0.1", True)},
    master=Master(use_sim_time=True, publishers={"/clock": ["/gazebo"], "/robot/joint_states": ["/gazebo"]}),
    topics=TopicFacts(clock_messages=900, clock_advanced=True, robot_state=ENABLED),
    is_built=True,
    is_fresh=True,
    python=PythonFacts("/ws/.venv/bin/python3", {"numpy": "1.26.4"}, debian_numpy="1.24.2"),
    listeners=[],
    display=":0",
)
ON_ROBOT = replace(
    HEALTHY_LAB,
    variables={"ROS_MASTER_URI": "http://baxter.local:11311", "ROS_HOSTNAME": "", "ROS_IP": "10.0.0.7"},
    addresses={"baxter.local": ("10.0.0.2", False), "10.0.0.7": ("10.0.0.7", True)},
    master=Master(clock_offset_s=0.01, publishers={"/robot/joint_states": ["/realtime_loop"]}),
    topics=TopicFacts(robot_state=ENABLED),
)


PLANNING = MoveGroupFacts(
    "/move_group", robot="baxter", groups={"left_arm": ["left_s0", "left_s1"], "all": ["left_s0", "left_s1"]},
    controllers=[ControllerFacts("left/follow_joint_trajectory", ["left_s0", "left_s1"], True)],
    joint_topic="/robot/joint_states", sensors=[Sensor("/points", ["/camera"], True)])


def planning(**fields):
    return replace(HEALTHY_LAB, move_group=replace(PLANNING, **fields))


def with_variables(facts, **variables):
    return replace(facts, variables={**facts.variables, **variables})


def with_state(**fields):
    return replace(HEALTHY_LAB, topics=replace(HEALTHY_LAB.topics, robot_state={**ENABLED, **fields}))


def with_master(facts, **fields):
    return replace(facts, master=replace(facts.master, **fields))


@pytest.mark.parametrize("facts", [HEALTHY_LAB, ON_ROBOT, replace(HEALTHY_LAB, move_group=PLANNING)],
                         ids=["simulator", "robot", "planning"])
def test_healthy_lab_has_nothing_wrong(facts):
    assert [finding for finding in examine(facts) if finding.level is not Level.OK] == []


def test_before_the_first_set_up_no_other_lab_is_offered():
    facts = replace(HEALTHY_LAB, is_built=False, was_set_up=False, master=Master(error="refused"), topics=None,
                    other_masters=[OtherMaster("http://localhost:12752", True)])
    finding, = (one for one in examine(facts) if one.topic == "master")
    assert finding.level is Level.NOTE and "12752" not in finding.what + finding.fix


SICK = {
    # name: (facts, topic of the finding, text in what, text in fix)
    "own package": (replace(HEALTHY_LAB, own_packages=["src/a has the name 'b'"]), "packages", "'b'", "mend"),
    "not built": (replace(HEALTHY_LAB, is_built=False), "build", "not built", "setup"),
    "set-up cut off": (
        replace(HEALTHY_LAB, is_fresh=False, set_up=SetUp("pip", is_running=False)), "build", "step 'pip'", "setup",
    ),
    "set-up failed": (
        replace(HEALTHY_LAB, is_fresh=False, was_set_up=False, failure=SetupFailure("pip", "the disk is full")),
        "build", "'pip': the disk is full", "setup",
    ),
    "set up in part": (
        replace(HEALTHY_LAB, is_fresh=False, was_set_up=False), "build", "no set-up has been completed", "setup",
    ),
    "stale build": (replace(HEALTHY_LAB, is_fresh=False), "build", "changed", "setup"),
    "pyenv first": (replace(HEALTHY_LAB, python=PythonFacts("/opt/pyenv/python3")), "python", "/opt/pyenv", "setup"),
    "python does not start": (replace(HEALTHY_LAB, python=None), "python", "cannot be run", "setup"),
    "no rospy": (
        replace(HEALTHY_LAB, python=PythonFacts("/ws/.venv/bin/python3", {}, {"rospy": "ImportError: gone"})),
        "python", "cannot import rospy: ImportError: gone", "setup",
    ),
    "numpy 2 on Debian 12": (
        replace(HEALTHY_LAB, python=PythonFacts("/ws/.venv/bin/python3", {"numpy": "2.1.0"}, debian_numpy="1.24.2")),
        "python", "numpy is 2.1.0", "uninstall numpy",
    ),
    "numpy 1 on Debian 13": (
        replace(HEALTHY_LAB, python=PythonFacts("/ws/.venv/bin/python3", {"numpy": "1.26.4"}, debian_numpy="2.2.4")),
        "python", "2.2.4", "uninstall numpy",
    ),
    "mangled uri": (with_variables(HEALTHY_LAB, ROS_MASTER_URI="localhost:11311"), "network", "http://HOST", "export"),
    "no port": (with_variables(HEALTHY_LAB, ROS_MASTER_URI="http://robot"), "network", "http://HOST", "export"),
    "bad port": (with_variables(HEALTHY_LAB, ROS_MASTER_URI="http://a:99999"), "network", "http://HOST", "export"),
    "template hostname": (
        with_variables(ON_ROBOT, ROS_HOSTNAME="your_hostname.local", ROS_IP=""),
        "network", "your_hostname.local does not resolve", "./baxter.sh baxter.local",
    ),
    "address of another machine": (
        replace(ON_ROBOT, addresses={**ON_ROBOT.addresses, "10.0.0.7": ("10.0.0.7", False)}),
        "network", "not an address of this machine", "unset ROS_IP",
    ),
    "localhost to a robot": (
        with_variables(ON_ROBOT, ROS_HOSTNAME="localhost", ROS_IP=""), "network", "cannot call", "unset ROS_HOSTNAME",
    ),
    "robot unknown": (
        replace(ON_ROBOT, addresses={**ON_ROBOT.addresses, "baxter.local": (None, False)}),
        "network", "does not resolve", "/etc/hosts",
    ),
    "no lab": (replace(HEALTHY_LAB, master=Master(error="refused"), topics=None), "master", "refused", "roslaunch"),
    "lab at another port": (
        replace(HEALTHY_LAB, master=Master(error="refused"), topics=None,
                other_masters=[OtherMaster("http://localhost:11500", False),
                               OtherMaster("http://localhost:11417", True)]),
        "master", "refused", "ROS_MASTER_URI=http://localhost:11417 ./baxter.sh sim",
    ),
    "robot off": (replace(ON_ROBOT, master=None, topics=None), "master", "did not answer in time", "ping baxter.local"),
    "no clock": (
        replace(HEALTHY_LAB, topics=TopicFacts(robot_state=ENABLED)), "clock", "nothing arrives on /clock",
        "use_sim_time",
    ),
    "paused": (
        replace(HEALTHY_LAB, topics=replace(HEALTHY_LAB.topics, clock_advanced=False)), "clock", "paused", "unpause",
    ),
    "two times": (with_master(HEALTHY_LAB, use_sim_time=False), "clock", "use_sim_time is not set", "true"),
    "robot's clock ahead": (with_master(ON_ROBOT, clock_offset_s=3.2), "clock", "3.2 s ahead", "time server"),
    "robot's clock behind": (with_master(ON_ROBOT, clock_offset_s=-3.2), "clock", "3.2 s behind", "time server"),
    "plugin failed": (
        replace(HEALTHY_LAB, topics=replace(HEALTHY_LAB.topics, troubles=[
            ("gazebo: plugin libbaxter.so of baxter", 2, "failed; a reset revives it")])),
        "simulator", "libbaxter.so of baxter: failed", "reset_world",
    ),
    "robot failed": (with_state(enabled=False, stopped=True, error=True), "robot", "has failed", "enable_robot.py -r"),
    "two simulators": (
        with_master(HEALTHY_LAB, publishers={"/clock": ["/gazebo", "/gazebo_2"]}),
        "simulator", "/gazebo_2", "rosnode kill",
    ),
    "dead simulator": (with_master(HEALTHY_LAB, dead_nodes=["/gazebo"]), "simulator", "died", "rosnode cleanup"),
    "deaf node": (replace(HEALTHY_LAB, deaf_nodes=["/gazebo"]), "nodes", "/gazebo", "rosnode kill /gazebo"),
    "stopped": (with_state(stopped=True, enabled=False), "robot", "stopped", "-r"),
    "error": (with_state(error=True), "robot", "error", "-r"),
    "silent robot": (replace(HEALTHY_LAB, topics=TopicFacts(5, True)), "robot", "/robot/state", "roslaunch"),
    "move_group is hung": (
        planning(error="timeout"), "move_group", "does not answer: timeout", "rosnode ping /move_group",
    ),
    "no controllers": (
        planning(controllers=[]), "move_group", "no controller moves left_s0, left_s1 of group left_arm",
        "controller_list of /move_group",
    ),
    "a controller that is not there": (
        planning(controllers=[ControllerFacts("left/follow_joint_trajectory", ["left_s0", "left_s1"], False,
                                              "start its server: rosrun a b")]),
        "move_group", "no controller serves left/follow_joint_trajectory", "rosrun a b",
    ),
    "joints without states": (
        planning(silent_joints=["left_s1"]), "move_group", "no message on /robot/joint_states has left_s1", "remap",
    ),
    "a joint beyond its limits": (
        planning(joints_out_of_bounds=["left_s1 is at 3.0"]), "move_group", "left_s1 is at 3.0", "move the joint",
    ),
    "a start in collision": (
        planning(contacts=[("left_wrist", "table")]), "move_group", "left_wrist and table touch", "disable_collisions",
    ),
    "a camera that is not there": (
        planning(sensors=[Sensor("/points", [], False)]), "move_group", "no node publishes /points", "sensors_3d.yaml",
    ),
    "a camera that is silent": (
        planning(sensors=[Sensor("/points", ["/camera"], False)]),
        "move_group", "nothing arrives on /points of /camera", "rostopic hz /points",
    ),
    "messages not built": (
        replace(HEALTHY_LAB, topics=TopicFacts(error="ImportError: baxter_core_msgs")),
        "robot", "baxter_core_msgs", "setup",
    ),
}


@pytest.mark.parametrize("name", SICK)
def test_fault_is_named_with_its_fix(name):
    facts, topic, what, fix = SICK[name]
    wrong = [finding for finding in examine(facts) if finding.level is Level.WRONG]
    assert {finding.topic for finding in wrong} >= {topic}
    finding = next(finding for finding in wrong if finding.topic == topic)
    assert what in finding.what
    assert fix in finding.fix


NOTED = {
    "disabled": (with_state(enabled=False), "robot", "enable_robot.py -e"),
    "open port": (
        replace(HEALTHY_LAB, listeners=[Listener("robot_state_publisher", 5, "0.0.0.0", 40001)]), "ports", "",
    ),
    "conda first": (
        replace(HEALTHY_LAB, users_python="/opt/conda/bin/python3"), "python", "./baxter.sh sim",
    ),
    "lab at another port": (
        with_master(replace(HEALTHY_LAB, other_masters=[OtherMaster("http://localhost:11417", True)]), publishers={}),
        "master", "ROS_MASTER_URI=http://localhost:11417",
    ),
    "plans alone": (planning(executes=False, controllers=[]), "move_group", "allow_trajectory_execution:=true"),
    "no screen": (replace(HEALTHY_LAB, display=""), "display", "desktop"),
    "two names": (with_variables(HEALTHY_LAB, ROS_IP="127.0.0.1"), "network", "unset"),
}


@pytest.mark.parametrize("name", NOTED)
def test_note_has_a_fix_and_is_not_wrong(name):
    facts, topic, fix = NOTED[name]
    findings = [finding for finding in examine(facts) if finding.level is not Level.OK]
    assert [(finding.topic, finding.level) for finding in findings] == [(topic, Level.NOTE)]
    assert fix in findings[0].fix


BUSY = {
    "python": ("python", replace(HEALTHY_LAB, python=None)),
    "is_fresh": ("build", replace(HEALTHY_LAB, is_fresh=None)),
    "master": ("master", replace(HEALTHY_LAB, master=None, topics=None)),
    "topics": ("robot", replace(HEALTHY_LAB, topics=None)),
    "move_group": ("move_group", HEALTHY_LAB),
    "listeners": ("ports", replace(HEALTHY_LAB, listeners=None)),
}


@pytest.mark.parametrize("question", BUSY)
def test_what_was_not_answered_in_time_is_busy_and_not_wrong(question):
    topic, facts = BUSY[question]
    findings = [finding for finding in examine(replace(facts, timed_out=frozenset({question})))
                if finding.level is not Level.OK]
    assert [(finding.topic, finding.level) for finding in findings] == [(topic, Level.BUSY)]
    assert "setup" not in findings[0].fix


def test_a_simulator_that_does_not_answer_in_time_is_not_called_dead():
    facts = with_master(HEALTHY_LAB, slow_nodes=["/gazebo"])
    assert [(finding.topic, finding.level) for finding in examine(facts) if finding.level is not Level.OK] == [
        ("simulator", Level.BUSY)]


def test_another_robot_needs_no_state_of_baxter():
    facts = replace(planning(robot="probot_anno"), topics=TopicFacts(900, True))
    assert [finding for finding in examine(facts) if finding.level is not Level.OK] == []


def test_open_ports_are_one_line_however_many():
    listeners = [Listener(f"node_{number}", 10 * number + copy, "0.0.0.0", 40000 + 10 * number + copy)
                 for number in range(9) for copy in range(2)]
    finding, = (one for one in examine(replace(HEALTHY_LAB, listeners=listeners)) if one.topic == "ports")
    assert "node_2 and 6 more" in finding.what and len(finding.what) < 120 and not finding.fix


@pytest.mark.parametrize("uri", ["", "http://:11311", "localhost:11311"])
def test_a_host_without_a_name_is_not_printed(uri):
    facts = with_variables(replace(HEALTHY_LAB, master=Master(error="unsupported"), topics=None), ROS_MASTER_URI=uri)
    for finding in examine(facts):
        text = finding.what + finding.fix
        assert "is  on" not in text and "ping `" not in text and "./baxter.sh ," not in text
        assert not text.startswith(" ") and not finding.fix.endswith("./baxter.sh ")


def test_questions_that_take_long_are_named_and_counted_as_open():
    go_on, said = threading.Event(), []

    def late():
        go_on.wait(60.0)

    def refuses():
        raise TimeoutError

    # Immediate answers arrive within this time, also on a busy machine.
    answers, timed_out = answer_all({"quick": lambda: 1, "late": late, "refuses": refuses}, 3.0, said.append, 1.5)
    go_on.set()
    assert answers == {"quick": 1} and timed_out == {"late", "refuses"}
    assert said == [["late"]]


def test_masters_are_found_by_their_processes():
    text = (
        'LISTEN 0 5 127.0.0.1:11417 0.0.0.0:* users:(("rosmaster",pid=10,fd=3))\n'
        'LISTEN 0 5 127.0.0.1:40001 0.0.0.0:* users:(("gzserver",pid=11,fd=9))\n'
        'LISTEN 0 5 *:22 *:*\n'
    )
    commands = {10: "/usr/bin/python3 /usr/bin/rosmaster --core -p 11417", 11: "python3 gzserver __name:=gazebo"}
    assert master_ports(text, commands.get) == {11417}


def test_ones_own_python_is_named_when_it_finds_no_rospy(tmp_path):
    python = tmp_path / "bin" / "python3"
    python.parent.mkdir()
    python.write_text("#!/bin/sh\nexit 1\n")
    python.chmod(0o755)
    assert users_python({"LAB_USERS_PYTHON": str(python)}) == str(python)
    assert users_python({"LAB_USERS_PYTHON": "/usr/bin/python3"}) == ""
    assert users_python({}) == ""
    python.write_text("#!/bin/sh\nexit 0\n")
    assert users_python({"LAB_USERS_PYTHON": str(python)}) == ""


def test_ports_are_no_matter_with_a_robot():
    facts = replace(ON_ROBOT, listeners=[Listener("rosout", 5, "0.0.0.0", 40001)])
    assert "ports" not in {finding.topic for finding in examine(facts)}


def test_only_ros_processes_beyond_loopback_are_listed():
    text = (
        'LISTEN 0 5 127.0.0.1:11311 0.0.0.0:* users:(("rosmaster",pid=10,fd=3))\n'
        'LISTEN 0 5 0.0.0.0:40001 0.0.0.0:* users:(("robot_state_pub",pid=11,fd=9))\n'
        'LISTEN 0 5 *:22 *:* users:(("sshd",pid=12,fd=3))\n'
        "LISTEN 0 5 0.0.0.0:631 0.0.0.0:*\n"
    )
    commands = {
        10: "/usr/bin/python3 rosmaster",
        11: "/usr/lib/robot_state_publisher/robot_state_publisher __name:=rsp __log:=/x",
        12: "sshd: /usr/sbin/sshd",
    }
    assert parse_listeners(text, commands.get) == [Listener("rsp", 11, "0.0.0.0", 40001)]


def test_own_and_foreign_addresses_are_told_apart():
    assert resolve("127.0.0.1") == ("127.0.0.1", True)
    assert resolve("192.0.2.77") == ("192.0.2.77", False)  # reserved for documentation
    assert resolve("no-such-host.invalid") == (None, False)


def test_a_workspace_that_was_never_set_up_has_one_fault():
    facts = replace(HEALTHY_LAB, is_built=False, is_fresh=None, was_set_up=False,
                    python=PythonFacts("/usr/bin/python3"))
    wrong = [finding for finding in examine(facts) if finding.level is Level.WRONG]
    assert [(finding.topic, finding.fix) for finding in wrong] == [("build", "./baxter.sh setup")]


def test_a_set_up_that_runs_is_told_with_its_step_and_nothing_is_wrong():
    facts = replace(HEALTHY_LAB, is_built=False, is_fresh=None, python=None,
                    set_up=SetUp("apt", "Unpacking numpy", True, "1 of 9", 40, "Debian packages"))
    finding, = (one for one in examine(facts) if one.level is not Level.OK)
    assert (finding.topic, finding.level) == ("build", Level.BUSY)
    assert "step 'Debian packages' (1 of 9, since 40 s)" in finding.what and "Unpacking numpy" in finding.what
    assert "apt.log" in finding.fix


def test_what_needs_the_build_waits_for_the_set_up_that_makes_it():
    facts = replace(HEALTHY_LAB, set_up=SetUp("build", "", True, "6 of 9", 40),
                    topics=TopicFacts(error="ModuleNotFoundError: No module named 'rospy'"),
                    move_group=replace(PLANNING, error="ModuleNotFoundError: No module named 'rosgraph'"))
    found = {one.topic: one for one in examine(facts)}
    assert [one.topic for one in found.values() if one.level is Level.WRONG] == []
    assert [found[topic].what for topic in ("robot", "move_group")] == ["not checked: set-up is running"] * 2


def test_the_lock_tells_a_running_set_up_from_one_that_was_cut_off(tmp_path):
    assert set_up_at_work(tmp_path) is None
    (tmp_path / ".baxter/logs").mkdir(parents=True)
    (tmp_path / ".baxter/at_work").write_text("apt\n")
    (tmp_path / ".baxter/logs/apt.log").write_bytes(b"x" * 10_000 + b"\nGet: 1\rGet: 2 \xff\n\n")
    with open(tmp_path / ".baxter/lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        assert set_up_at_work(tmp_path) == SetUp("apt", "Get: 2 \ufffd")
        (tmp_path / ".baxter/logs/apt.log").write_bytes(b"# Debian packages\n")
        assert set_up_at_work(tmp_path) == SetUp("apt")
        (tmp_path / ".baxter/progress").write_text(f"{int(time.time()) - 40}\t1 of 9\tDebian packages\n")
        found = set_up_at_work(tmp_path)
        assert (found.place, found.title) == ("1 of 9", "Debian packages") and found.since_s >= 40
    assert set_up_at_work(tmp_path) == SetUp("apt", is_running=False)


@pytest.fixture
def silent_server():
    """A port that takes connections and never answers, as a hung master does."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield server.getsockname()[1]


def test_hung_master_does_not_hang_the_doctor(silent_server, tmp_path):
    started = time.monotonic()
    facts = gather(tmp_path, {"ROS_MASTER_URI": f"http://localhost:{silent_server}", "ROS_HOSTNAME": "localhost"})
    assert time.monotonic() - started < 30.0
    assert facts.master is None or facts.master.error
    assert facts.topics is None
    assert not facts.is_built


def test_refused_connection_is_an_error_text():
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
    assert "111" in ask_master(f"http://127.0.0.1:{port}").error  # its text depends on the locale


class Graph:
    """A master, and the XML-RPC and service ports of one node. ``greets``: whether it answers handshakes."""

    def __init__(self, greets):
        self.port, self._greets = socket.create_server(("127.0.0.1", 0)), greets
        self.server = SimpleXMLRPCServer(("127.0.0.1", 0), logRequests=False)
        self.uri = "http://127.0.0.1:%d" % self.server.server_address[1]
        service = "rosrpc://127.0.0.1:%d" % self.port.getsockname()[1]
        services = [["/node/get_loggers", ["/node"]]]
        self.server.register_function(lambda *_: [1, "", [[], [], services]], "getSystemState")
        self.server.register_function(lambda *_: [1, "", service], "lookupService")
        self.server.register_function(lambda *_: [1, "", self.uri], "lookupNode")
        self.server.register_function(lambda *_: [1, "", 1], "getPid")
        for work in (self.server.serve_forever, self._greet):
            threading.Thread(target=work, daemon=True).start()

    def _greet(self):
        with contextlib.suppress(OSError):
            while True:
                connection, _ = self.port.accept()
                with connection:
                    asked = connection.recv(1000)
                    if self._greets and b"/node/get_loggers" in asked and b"probe=1" in asked:
                        connection.sendall(b"\0\0\0\0")
                    connection.recv(1)

    def close(self):
        self.server.shutdown()
        self.server.server_close()
        self.port.close()


@pytest.mark.parametrize("greets", [True, False])
def test_a_node_that_answers_calls_and_no_handshake_is_deaf(greets):
    graph = Graph(greets)
    try:
        if greets:
            assert find_deaf_nodes(graph.uri, 60.0) == []
        else:  # not at once where the machine is too busy for its calls
            wait_until(lambda: find_deaf_nodes(graph.uri, 0.5) == ["/node"], "the deaf node to be found")
    finally:
        graph.close()


@pytest.mark.parametrize("offset_s", [7.5, -40.0])
def test_clock_offset_is_read_from_the_date_line(offset_s):
    from email.utils import formatdate
    from http.server import BaseHTTPRequestHandler, HTTPServer

    class Skewed(BaseHTTPRequestHandler):
        def date_time_string(self, timestamp=None):
            return formatdate(time.time() + offset_s, usegmt=True)

        def do_GET(self):
            self.send_response(501)
            self.end_headers()

        def log_message(self, *args):
            pass

    server = HTTPServer(("127.0.0.1", 0), Skewed)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    try:
        measured = clock_offset_s(f"http://127.0.0.1:{server.server_port}", timeout_s=3.0)
    finally:
        server.shutdown()
        server.server_close()
    assert measured == pytest.approx(offset_s, abs=0.2)
