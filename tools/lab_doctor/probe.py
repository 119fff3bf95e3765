# SPDX-License-Identifier: BSD-3-Clause
"""Gather the facts in parallel, each with a deadline: the doctor must not hang on a dead network."""
import fcntl
import http.client
import json
import re
import shutil
import socket
import struct
import subprocess
import threading
import time
from collections.abc import Callable
from email.utils import parsedate_to_datetime
from pathlib import Path
from typing import Any
from urllib.parse import urlparse

import master_calls
import own_manifests
from lab_doctor.checks import SIMULATOR_TOPICS, is_loopback
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

DEADLINE_S = 15.0
# A check that takes longer than this is named on the terminal.
PATIENCE_S = 4.0
CALL_TIMEOUT_S = 1.0
CALLER_ID = "/lab_doctor"
# A node that has not answered a handshake for so long, and answers calls, takes no connections any more [s].
DEAF_S = 4.0
# Of the log of a running set-up: the end that is read, and the most of its last line that is shown.
LOG_TAIL_BYTES, LINE_LENGTH = 4096, 100
# Debian's roscpp nodes, and rospy nodes, carry their node name on the command line when roslaunch starts them.
ROS_PROCESS = re.compile(r"__name:=|rosmaster|roscore|roslaunch|rosrun|/lib/(tf2?|rviz|robot_state_publisher|rosout)")
# A node with this service is a move_group.
SCENE_SERVICE = "get_planning_scene"
DEBIAN_PYTHON = "/usr/lib/python3/dist-packages"
MODULES = ("rospy", "pybullet", "numpy", "transforms3d", "tf2_ros")


def gather(root: Path, variables: dict[str, str], say: Callable[[list[str]], object] = lambda names: None,
           deadline_s: float = DEADLINE_S) -> Facts:
    """Facts about the workspace at root and the ROS that the variables point to; takes at most deadline_s.

    say: called with the open questions after PATIENCE_S.
    """
    ros = {name: variables.get(name, "") for name in ("ROS_MASTER_URI", "ROS_HOSTNAME", "ROS_IP")}
    host = urlparse(ros["ROS_MASTER_URI"]).hostname or ""
    hosts = {name for name in (host, ros["ROS_HOSTNAME"], ros["ROS_IP"]) if name}
    questions = {
        "master": lambda: ask_master(ros["ROS_MASTER_URI"]),
        "topics": lambda: listen(root, ros["ROS_MASTER_URI"]),
        "move_group": lambda: ask_move_group(root, ros["ROS_MASTER_URI"]),
        "is_fresh": lambda: is_fresh(root),
        "set_up": lambda: set_up_at_work(root),
        "python": ask_python,
        "listeners": list_listeners,
        "other_masters": lambda: find_masters(ros["ROS_MASTER_URI"]),
        "deaf_nodes": lambda: find_deaf_nodes(ros["ROS_MASTER_URI"]),
        "users_python": lambda: users_python(variables),
        "own_packages": lambda: own_packages(root),
        **{f"address of {name}": lambda name=name: resolve(name) for name in hosts},
    }
    answers, timed_out = answer_all(questions, deadline_s, say)
    return Facts(
        root=str(root),
        variables=ros,
        addresses={name: answers.get(f"address of {name}") or (None, False) for name in hosts},
        master=answers.get("master"),
        topics=answers.get("topics"),
        move_group=answers.get("move_group"),
        is_built=(root / "devel" / "setup.bash").is_file(),
        is_fresh=answers.get("is_fresh"),
        set_up=answers.get("set_up"),
        own_packages=answers.get("own_packages") or [],
        was_set_up=(root / ".baxter" / "done").is_file(),
        failure=last_failure(root),
        python=answers.get("python"),
        listeners=answers.get("listeners"),
        other_masters=answers.get("other_masters") or [],
        deaf_nodes=answers.get("deaf_nodes") or [],
        users_python=answers.get("users_python") or "",
        timed_out=frozenset(timed_out),
        display=variables.get("DISPLAY", ""),
    )


def answer_all(questions: dict[str, Callable[[], Any]], timeout_s: float,
               say: Callable[[list[str]], object] = lambda names: None,
               patience_s: float = PATIENCE_S) -> tuple[dict, set]:
    """(name -> answer, names of questions without an answer in time); a question that raises has no answer.

    say: called once with the open names after patience_s. Hanging threads are not stopped.
    """
    answers, timed_out, ended = {}, set(), set()

    def answer(name: str, question: Callable[[], Any]) -> None:
        try:
            answers[name] = question()
        except (TimeoutError, subprocess.TimeoutExpired):
            timed_out.add(name)
        except Exception:  # noqa: S110  (no answer: the checks say what that means)
            pass
        ended.add(name)

    threads = [threading.Thread(target=answer, args=item, daemon=True) for item in questions.items()]
    begin = time.monotonic()
    for thread in threads:
        thread.start()
    for limit_s in (min(patience_s, timeout_s), timeout_s):
        for thread in threads:
            thread.join(max(0.0, begin + limit_s - time.monotonic()))
        open_names = set(questions) - ended
        if open_names and limit_s < timeout_s:
            say(sorted(open_names))
    return dict(answers), timed_out | (set(questions) - ended)


def users_python(variables: dict[str, str]) -> str:
    """The path of the Python that comes first outside the lab's environment, "" for the system's own or the lab's.

    baxter.sh notes it in LAB_USERS_PYTHON before it changes PATH.
    """
    python = variables.get("LAB_USERS_PYTHON", "")
    lab = Path(variables.get("LAB_ROOT", "/nowhere"), ".venv", "bin")
    if not python or Path(python).parent in (lab, Path("/usr/bin"), Path("/bin")):
        return ""
    can_import = subprocess.run([python, "-c", "import rospy"], capture_output=True, env=_outside(variables),
                                timeout=DEADLINE_S).returncode == 0
    return "" if can_import else python


def _outside(variables: dict[str, str]) -> dict[str, str]:
    return {name: value for name, value in variables.items() if name not in ("PYTHONPATH", "PYTHONHOME")}


def find_masters(uri: str) -> list[OtherMaster]:
    """ROS masters of this machine at other ports; only of the user's own processes, since others cannot be
    inspected."""
    done = subprocess.run(["ss", "-Hltnp"], capture_output=True, text=True, timeout=DEADLINE_S, check=True)
    found = []
    for port in sorted(master_ports(done.stdout, _command_line) - {urlparse(uri).port}):
        other = f"http://localhost:{port}"
        try:
            publishers = dict(master_calls.proxy(other, CALL_TIMEOUT_S).getSystemState(CALLER_ID)[2][0])
        except master_calls.NO_ANSWER:
            continue
        found.append(OtherMaster(other, any(publishers.get(topic) for topic in SIMULATOR_TOPICS)))
    return found


def master_ports(text: str, command_line: Callable[[int], str]) -> set[int]:
    """Lines of `ss -Hltnp` -> the ports that a rosmaster listens on. command_line: pid -> its command line."""
    ports = set()
    for line in text.splitlines():
        columns = line.split()
        process = re.search(r"pid=(\d+)", line)
        if len(columns) >= 4 and process and re.search(r"/rosmaster( |$)", command_line(int(process[1]))):
            ports.add(int(columns[3].rpartition(":")[2]))
    return ports


def resolve(name: str) -> tuple[str | None, bool]:
    """(IPv4 address of a name or None, is it this machine's?): only own addresses can be bound to."""
    try:
        address = socket.gethostbyname(name)
    except OSError:
        return None, False
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.bind((address, 0))
        except OSError:
            return address, False
    return address, True


def ask_master(uri: str) -> Master:
    """Facts from the master at uri. Raises TimeoutError if it accepts connections and does not answer."""
    master = master_calls.proxy(uri, CALL_TIMEOUT_S)
    try:
        _, _, (publishers, _, _) = master.getSystemState(CALLER_ID)
        code, _, use_sim_time = master.getParam(CALLER_ID, "/use_sim_time")
    except TimeoutError:
        raise
    except master_calls.NO_ANSWER as error:
        return Master(error=str(error) or type(error).__name__)
    by_topic = dict(publishers)
    simulators = {node for topic in SIMULATOR_TOPICS for node in by_topic.get(topic, [])}
    host = urlparse(uri).hostname or ""
    states = {node: _node_state(master, node) for node in sorted(simulators)}
    return Master(
        use_sim_time=code == 1 and bool(use_sim_time),
        publishers=by_topic,
        dead_nodes=[node for node, state in states.items() if state == "dead"],
        slow_nodes=[node for node, state in states.items() if state == "slow"],
        clock_offset_s=None if is_loopback(host) else clock_offset_s(uri),
    )


def _node_state(master: Any, node: str) -> str:
    try:
        _, _, node_uri = master.lookupNode(CALLER_ID, node)
        master_calls.proxy(node_uri, CALL_TIMEOUT_S).getPid(CALLER_ID)
    except TimeoutError:
        return "slow"
    except master_calls.NO_ANSWER:
        return "dead"
    return "alive"


def find_deaf_nodes(uri: str, patience_s: float = DEAF_S) -> list[str]:
    """Nodes that answer calls and take no connections any more: the thread that accepts them has ended, or hangs.

    Each is asked for one of its services, as a client asks.
    """
    services = master_calls.proxy(uri, CALL_TIMEOUT_S).getSystemState(CALLER_ID)[2][2]
    of_node = {node: service for service, nodes in services for node in nodes}
    questions = {node: lambda node=node, service=service: _greet(uri, node, service, patience_s)
                 for node, service in sorted(of_node.items())}
    answers, _ = answer_all(questions, 3.0 * patience_s, patience_s=3.0 * patience_s)
    return [node for node in questions if answers.get(node) == "deaf"]


def _greet(uri: str, node: str, service: str, patience_s: float) -> str | None:
    """ "deaf", or None where the node answers, or is not there, or is too slow in all."""
    master = master_calls.proxy(uri, CALL_TIMEOUT_S)
    address = urlparse(master.lookupService(CALLER_ID, service)[2])
    fields = (b"callerid=" + CALLER_ID.encode(), b"md5sum=*", b"probe=1", b"service=" + service.encode())
    header = b"".join(struct.pack("<I", len(field)) + field for field in fields)
    with socket.create_connection((address.hostname, address.port), patience_s) as connection:
        connection.sendall(struct.pack("<I", len(header)) + header)
        try:
            connection.recv(1)
        except TimeoutError:
            return "deaf" if _node_state(master, node) == "alive" else None
    return None


def clock_offset_s(uri: str, timeout_s: float = 1.5) -> float | None:
    """Clock of the master's host minus ours [s], from the Date line of its answers.

    Date has whole seconds; repeated queries find the moment when it changes. None if it does not change in time.
    """
    parts = urlparse(uri)
    first = None
    deadline = time.monotonic() + timeout_s
    while time.monotonic() < deadline:
        connection = http.client.HTTPConnection(parts.hostname or "", parts.port, timeout=CALL_TIMEOUT_S)
        try:
            before = time.time()
            connection.request("GET", "/")
            date = connection.getresponse().headers["Date"]
            middle = (before + time.time()) / 2
        except OSError:
            return None
        finally:
            connection.close()
        if date is None:
            return None
        if first is not None and date != first:
            return parsedate_to_datetime(date).timestamp() - middle
        first = date
        time.sleep(0.01)
    return None


def listen(root: Path, uri: str) -> TopicFacts:
    """Messages on /clock and /robot/state within two seconds, received by a process with ROS.

    Raises OSError without a master: rospy would wait for one.
    """
    master_calls.proxy(uri, CALL_TIMEOUT_S).getPid(CALLER_ID)
    script = root / "tools" / "lab_doctor" / "listen.py"
    command = [shutil.which("python3") or "python3", str(script)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=DEADLINE_S)
    if done.returncode != 0:
        return TopicFacts(error=(done.stderr.strip().splitlines() or ["no reason given"])[-1])
    return TopicFacts(**json.loads(done.stdout.splitlines()[-1]))


def ask_move_group(root: Path, uri: str) -> MoveGroupFacts | None:
    """Facts from a move_group, gathered by a process that has ROS; None if none runs. Raises TimeoutError, OSError."""
    services = dict(master_calls.proxy(uri, CALL_TIMEOUT_S).getSystemState(CALLER_ID)[2][2])
    name, nodes = next(((name, nodes) for name, nodes in sorted(services.items()) if name.endswith("/" + SCENE_SERVICE)
                        and nodes), ("", []))
    if not nodes:
        return None
    script = root / "tools" / "lab_doctor" / "ask_move_group.py"
    command = [shutil.which("python3") or "python3", str(script), nodes[0], name[:-len(SCENE_SERVICE)]]
    done = subprocess.run(command, capture_output=True, text=True, timeout=DEADLINE_S)
    if done.returncode != 0:
        return MoveGroupFacts(nodes[0], error=(done.stderr.strip().splitlines() or ["no reason given"])[-1])
    answer = json.loads(done.stdout.splitlines()[-1])
    return MoveGroupFacts(**{**answer, "controllers": [ControllerFacts(**one) for one in answer["controllers"]],
                             "sensors": [Sensor(**one) for one in answer["sensors"]]})


def own_packages(root: Path) -> list[str]:
    """Faults in the package.xml of the user's own packages, in sentences."""
    script = 'LAB_ROOT=$1; source "$1/tools/environment.bash"; own_folders'
    command = ["bash", "-c", script, "own", str(root)]
    listed = subprocess.run(command, capture_output=True, text=True, timeout=DEADLINE_S)
    return own_manifests.problems(root, listed.stdout.split())


def is_fresh(root: Path) -> bool:
    """Whether the last set-up is still valid, by baxter.sh's own functions."""
    script = ('LAB_ROOT=$1; source "$1/tools/environment.bash"; '
              '[[ $(<"$1/.baxter/done") == "$(fingerprint)" ]] && loops_are_compiled')
    return subprocess.run(["bash", "-c", script, "fresh", str(root)], capture_output=True).returncode == 0


def set_up_at_work(root: Path) -> SetUp | None:
    """The set-up that runs or was cut off: it names its step in a file, and holds a lock while it runs."""
    state = root / ".baxter"
    try:
        step = (state / "at_work").read_text().strip()
        lock = (state / "lock").open()
    except OSError:
        return None
    with lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return SetUp(step, _last_line(state / "logs" / f"{step}.log"), True, *_progress(state / "progress"))
    return SetUp(step, is_running=False)


def _progress(file: Path) -> tuple[str, int, str]:
    """Place of the running step, the time since it began [s], its title; ("", 0, "") if set-up has not written them."""
    try:
        began, place, title = file.read_text().rstrip("\n").split("\t")
        return place, max(0, int(time.time()) - int(began)), title
    except (OSError, ValueError):
        return "", 0, ""


def last_failure(root: Path) -> SetupFailure | None:
    try:
        step, _, cause = (root / ".baxter" / "failure").read_text(errors="replace").strip().partition("\t")
    except OSError:
        return None
    return SetupFailure(step, cause)


def _last_line(log: Path) -> str:
    try:
        lines = log.read_bytes()[-LOG_TAIL_BYTES:].decode(errors="replace").splitlines()
    except OSError:
        return ""
    # A log begins with a heading.
    return next((line.strip()[:LINE_LENGTH] for line in reversed(lines) if line.strip() and line[0] != "#"), "")


def ask_python() -> PythonFacts:
    """Which Python a node gets, and whether it can import what nodes need."""
    executable = shutil.which("python3") or ""
    program = (
        "import importlib, json\n"
        "versions, errors = {}, {}\n"
        f"for name in {MODULES!r}:\n"
        "    try:\n"
        "        versions[name] = str(getattr(importlib.import_module(name), '__version__', ''))\n"
        "    except Exception as error:\n"
        "        errors[name] = f'{type(error).__name__}: {error}'\n"
        # PyPI's rospkg can be imported, but finds none of the packages that Debian's finds.
        "try:\n"
        "    import rospkg\n"
        "    rospkg.RosPack().get_path('rospy')\n"
        "except Exception as error:\n"
        "    errors['rospkg'] = f'it finds no ROS packages ({type(error).__name__})'\n"
        "import importlib.metadata\n"
        f"debian = importlib.metadata.distributions(name='numpy', path=[{DEBIAN_PYTHON!r}])\n"
        "print(json.dumps([versions, errors, next((found.version for found in debian), '')]))\n"
    )
    done = subprocess.run([executable, "-c", program], capture_output=True, text=True, timeout=DEADLINE_S)
    return PythonFacts(executable, *json.loads(done.stdout.splitlines()[-1]))


def list_listeners() -> list[Listener]:
    """ROS processes of ours that listen on an address other than loopback."""
    done = subprocess.run(["ss", "-Hltnp"], capture_output=True, text=True, timeout=DEADLINE_S, check=True)
    return parse_listeners(done.stdout, _command_line)


def _command_line(pid: int) -> str:
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")
    except OSError:
        return ""


def parse_listeners(text: str, command_line: Callable[[int], str]) -> list[Listener]:
    """Lines of `ss -Hltnp` -> ROS processes open beyond loopback. command_line: pid -> its command line."""
    found = []
    for line in text.splitlines():
        columns = line.split()
        process = re.search(r'"([^"]+)",pid=(\d+)', line)
        if len(columns) < 4 or process is None:
            continue
        address, _, port = columns[3].rpartition(":")
        pid = int(process[2])
        command = command_line(pid)
        if address.startswith(("127.", "[::1]")) or not ROS_PROCESS.search(command):
            continue
        node = re.search(r"__name:=(\S+)", command)
        found.append(Listener(node[1] if node else process[1], pid, address, int(port)))
    return found
