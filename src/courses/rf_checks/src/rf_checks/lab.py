# SPDX-License-Identifier: BSD-3-Clause
"""A lab of the judge's own: master, simulator and the nodes around it, on a free port.

The judge itself is not a ROS node: it gets the robot's motion through the recorder's socket, and the list of nodes from
the master (graph.py).
"""
from __future__ import annotations

import contextlib
import functools
import json
import os
import re
import shutil
import signal
import socket
import subprocess
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import rospkg
from roslib.packages import find_node

from baxter_model import SIDES
from processes import isolation
from processes.family import children_of, direct_children, is_running, with_parent
from processes.ports import free_port
from rf_checks import hidden_paths
from rf_checks.graph import JudgedGraph, LabFailed
from rf_checks.pacing import OwnTime, Watch
from rf_checks.recorder_names import PLUGIN_ELEMENT, RECORDS, SOCKETS_VARIABLE, changes_the_world
from world_picture.results import ready_for

if TYPE_CHECKING:
    from rf_checks.run_clock import RunClock
    from rf_checks.tasks_planning import Obstacle

#: Time limits for the lab to start, and to reset the robot [s, of OwnTime].
START_TIMEOUT_S, RESET_TIMEOUT_S = 120.0, 30.0
STOP_TIMEOUT_S = 20.0
RECORD_S = 0.01
# After a reset the robot gets this many records to come to rest.
CALM_RECORDS = 20
# The simulator sends its clock at most 500 times a wall second: a record must not be faster than that [s].
_SHORTEST_RECORD_S = 0.0025
#: Programs whose responses a student's program waits for, or that still process its messages: time must wait for them,
#: too.
HELPERS = ("position_kinematics", "robot_state_publisher", "rosmaster", "gzserver", "move_group",
           "joint_trajectory_action_server", "servo_server")
SIMULATOR = "/gazebo"
#: The nodes that spawn the robot and an obstacle, and then end.
SPAWNER, OBSTACLE_SPAWNER = "/urdf_spawner", "/obstacle_spawner"
#: What move_group serves, once it can plan; and a servo, once it can be steered.
PLANNING_SERVICE, SERVO_SERVICE = "/plan_kinematic_path", "/left_servo/reset_servo_status"
#: How the IK nodes report their requests to the recorder.
OBSERVER = ("IK_OBSERVER", "rf_checks.ik_witness:Witness")
_NAME = b"__name:="
_ENDED_NODE = re.compile(r"\[([\w./-]+)\] process has finished cleanly")
_DEAD_NODE = re.compile(r"\[([\w./-]+)\] process has died \[pid \d+, exit code -?[1-9]")
Found = TypeVar("Found")


class TooSlow(Exception):
    """This machine was too slow to finish before the deadline; the text gives its speed."""


class WhichRobot(NamedTuple):
    """The robot of a lab: `profile` and `serial` as the arguments of baxter_world.launch."""

    profile: str = "sim"
    serial: int = 0

    @property
    def is_usual(self) -> bool:
        """Whether it is the one of the labs."""
        return self == WhichRobot()


class JudgedLab:
    """Start with :meth:`start`, end with :meth:`close`; a context manager."""

    def __init__(self, description_xml: str, walls: bool = True,
                 which: WhichRobot = WhichRobot(),  # noqa: B008 (a tuple)
                 obstacle: Obstacle | None = None, steered: bool = False) -> None:
        """`description_xml`: the robot's URDF text. `walls`: in a separate sandbox, as isolation.py says. `which`:
        a WhichRobot. `obstacle`: tasks_planning.Obstacle, which comes with move_group. `steered`: with a servo of the
        left arm."""
        self._port = free_port()
        self.uri = "http://localhost:%d" % self._port
        self.graph = JudgedGraph(self.uri)
        #: The folder of the lab's files.
        self.folder = Path(tempfile.mkdtemp(prefix="lab-judge-"))
        self.obstacle, self.steered = obstacle, steered
        self._walls, self._which = walls, which
        self.watch = Watch()
        #: Called with each record (dict), in the thread that steps the world: the world waits until it returns.
        self.on_record: Callable[[dict[str, Any]], None] = lambda record: None
        #: The RunClock of the running program, or None.
        self.run_clock: RunClock | None = None
        #: False: at most real time, because no program runs.
        self.is_hurried = False
        self.joint_names: tuple[str, ...] = ()
        self._description = description_xml
        self._processes: list[subprocess.Popen[bytes]] = []
        self._order: dict[str, list[Any]] | None = None
        self._done: str | None = None
        self._connection: socket.socket | None = None
        self._pacer: threading.Thread | None = None
        self._ended = threading.Event()
        self._has_time = False
        self._may_go = threading.Event()
        self._may_go.set()
        self._calm = threading.Event()
        self._own_time = OwnTime(self._pids)
        self._still_time = OwnTime(lambda: self.watch.helpers.roots)
        # Number of records, and that number at the last call of stood_still_s.
        self._heard = self._looked_at = 0
        self._is_held = False
        self._is_closed_world = False

    def __enter__(self) -> JudgedLab:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def is_alive(self) -> bool:
        """False once the simulator, or its robot, is gone."""
        return not self._ended.is_set()

    def start(self, deadline: float = float("inf")) -> None:
        """Start everything and wait until the robot is spawned. Raises LabFailed; TooSlow at `deadline` (monotonic,
        s)."""
        (self.folder / "sockets").mkdir()
        environment = isolation.environment_of(os.environ) if self._walls else dict(os.environ)
        environment.update({"ROS_MASTER_URI": self.uri, "ROS_HOSTNAME": "localhost",
                            "ROS_LOG_DIR": str(self.folder / "log"), SOCKETS_VARIABLE: str(self.folder / "sockets"),
                            OBSERVER[0]: OBSERVER[1],
                            # What roslaunch says of the nodes is read while it runs, and it writes to a file.
                            "PYTHONUNBUFFERED": "1"})
        environment.pop("ROS_IP", None)
        with socket.socket(socket.AF_UNIX) as listener:
            listener.bind(str(self.folder / "sockets" / RECORDS))
            listener.listen(1)
            listener.settimeout(0.1)
            description = self.folder / "robot.urdf"
            # First of the plugins, so that no plugin reads a message before the recorder has waited for it.
            description.write_text(re.sub(r"<robot\b[^>]*>", lambda tag: tag[0] + PLUGIN_ELEMENT, self._description,
                                          count=1), encoding="utf-8")
            self._run(["roslaunch", "-p", str(self._port), str(_share() / "launch" / "lab.launch"),
                       "description:=%s" % description, *("%s:=%s" % item for item in self._which._asdict().items()),
                       "steered:=%s" % str(self.steered).lower(), *self._obstacle_arguments()], environment)
            self._own_time.restart()
            self._connection = self._await(lambda: _accept(listener), "the simulator", deadline)
        self._connection.settimeout(None)
        self._pacer = threading.Thread(target=self._pace, args=(self._connection, self._ended), daemon=True)
        self._pacer.start()
        self._await(self._all_there, "the nodes around the robot", deadline)

    def reset(self, posture: dict[str, float], deadline: float = float("inf")) -> None:
        """Disable the robot, set its arms to `posture` {joint: rad}, and stop time until go_on().

        Raises LabFailed; TooSlow at `deadline` (monotonic, s).
        """
        self.is_hurried = True
        self._may_go.clear()
        self._done, self._calm = None, threading.Event()
        self._order = {"names": list(posture), "positions": list(posture.values())}
        self._own_time.restart()
        while not self._calm.wait(0.02):
            if self._done or not self.is_alive or self._own_time.passed_s() > RESET_TIMEOUT_S:
                self.go_on()
                raise LabFailed("the robot cannot be put back: %s" % (self._done or "the simulator does not answer"))
            if time.monotonic() > deadline:
                self.go_on()
                raise TooSlow("the robot was still being put back")
        self._own_time.restart()
        while not self._is_closed_world:
            # Closed services disappear from the master's lists a moment later.
            open_ways = {name for kind, name, node in self.graph.state()
                         if changes_the_world(kind, name) and (kind == "service" or node == SIMULATOR)}
            if open_ways and self._own_time.passed_s() > RESET_TIMEOUT_S:
                self.go_on()
                raise LabFailed("the check's own lab serves what it must not: %s" % ", ".join(sorted(open_ways)))
            self._is_closed_world = not open_ways
            if self._is_closed_world:
                self.graph.remember(self._node_processes())

    def go_on(self) -> None:
        """Continue time after reset()."""
        self._may_go.set()

    def stood_still_s(self) -> float:
        """Time since the last record [s, of OwnTime]. Call it several times a second."""
        if self._is_held or self._heard != self._looked_at:
            self._looked_at = self._heard
            self._still_time.restart()
        return self._still_time.passed_s()

    def is_as_it_was(self) -> bool:
        """Whether another program can be judged here: the lab is complete and unchanged, without other nodes."""
        try:
            return self.is_alive and self.graph.is_as_it_was()
        except LabFailed:
            return False

    def helper_pids(self) -> list[int]:
        """Process ids of HELPERS in this lab."""
        found = []
        for pid in self._pids():
            with contextlib.suppress(OSError):
                line = Path("/proc/%d/cmdline" % pid).read_bytes()
                found += [pid] if any(name.encode() in line for name in HELPERS) else []
        return found

    def has_stopped_master(self) -> bool:
        """Whether the ROS master has ended, or was stopped by a signal."""
        states = []
        for pid in self._pids():
            with contextlib.suppress(OSError):
                if b"rosmaster" in Path("/proc/%d/cmdline" % pid).read_bytes():
                    text = Path("/proc/%d/stat" % pid).read_bytes()
                    states.append(text[text.rfind(b")") + 2:][:1])
        return not set(states) - {b"T", b"Z"}

    def log_tail(self) -> str:
        """The last lines of the output of the lab's own processes."""
        lines = (self.folder / "output.txt").read_text(errors="replace").splitlines()
        return "\n".join(lines[-15:])

    def close(self) -> None:
        """End every process, quickly: nothing of this lab is needed any more."""
        self._ended.set()
        self.go_on()
        if self._connection is not None:
            self._connection.close()
            self._connection = None
        for sign, timeout_s in ((signal.SIGINT, STOP_TIMEOUT_S), (signal.SIGKILL, STOP_TIMEOUT_S)):
            for process in reversed(self._processes):
                with contextlib.suppress(ProcessLookupError):
                    os.killpg(process.pid, sign)
                with contextlib.suppress(subprocess.TimeoutExpired):
                    process.wait(timeout_s)
        # If roslaunch had to be killed, its nodes still run.
        for pid in self._pids():
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        self._processes = []
        if self._pacer is not None:
            # It may just be reading the list of processes.
            self.watch.gives_up = lambda: True
            self._pacer.join(STOP_TIMEOUT_S)
        self.watch.close()
        self._own_time.close()
        self._still_time.close()
        deadline = time.monotonic() + STOP_TIMEOUT_S
        # Killed processes may still write their last lines.
        while self.folder.exists() and time.monotonic() < deadline:
            shutil.rmtree(self.folder, ignore_errors=True)
            time.sleep(0.005)

    # -- below

    def _run(self, command: list[str], environment: dict[str, str]) -> None:
        if self._walls:
            ready, variables = ready_for(isolation.HOME)
            environment = {**environment, **variables}
            binds = [*ready, *isolation.caches(os.environ, self.folder / "caches")]
            command = [*isolation.command(os.environ, [(self.folder, self.folder, True), *binds],
                                          hidden_paths.SOLVED, not isolation.has_own_network()), *command]
        with open(self.folder / "output.txt", "ab") as output:
            # It ends with the judge in any case.
            self._processes.append(subprocess.Popen(with_parent(command, "INT"), env=environment,
                                                    stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.STDOUT,
                                                    start_new_session=True))

    def _pids(self) -> set[int]:
        """All processes of this lab."""
        roots = {process.pid for process in self._processes if process.poll() is None}
        # Orphans become children of the judge; a student's program does not have this variable.
        mark = ("%s=%s" % (SOCKETS_VARIABLE, self.folder)).encode()
        for pid in direct_children(os.getpid()) - roots:
            with contextlib.suppress(OSError):
                roots |= {pid} if mark in Path("/proc/%d/environ" % pid).read_bytes() else set()
        return children_of(roots)

    def _dead_nodes(self) -> list[str]:
        """Names of nodes that ended with an error according to roslaunch: they are not restarted."""
        return _DEAD_NODE.findall((self.folder / "output.txt").read_text(errors="replace"))

    def _await(self, condition: Callable[[], Found | None], what: str, deadline: float) -> Found:
        while True:
            found = condition()
            if found:
                return found
            ended = ["roslaunch" for process in self._processes if process.poll() is not None] or self._dead_nodes()
            if ended or self._own_time.passed_s() > START_TIMEOUT_S:
                reason = "%s ended" % ended[0] if ended else "not there after %g s" % START_TIMEOUT_S
                raise LabFailed("the check's own lab does not start: waiting for %s: %s\n%s"
                                % (what, reason, self.log_tail()))
            if time.monotonic() > deadline:
                raise TooSlow("the check's own lab was still starting, waiting for %s" % what)
            time.sleep(0.05)

    def _node_processes(self) -> dict[str, Callable[[], bool]]:
        """For each node of the lab, a function that returns whether its process lives."""
        named = {}
        for pid in self._pids():
            with contextlib.suppress(OSError):
                words = Path("/proc/%d/cmdline" % pid).read_bytes().split(b"\0")
                named.update((pid, "/" + word[len(_NAME):].decode()) for word in words if word.startswith(_NAME))
        # A process forked by a node has its name, too.
        return {name: functools.partial(is_running, pid) for pid, name in named.items()
                if not any(named[other] == name and other != pid and pid in children_of((other,)) for other in named)}

    def _obstacle_arguments(self) -> list[str]:
        if self.obstacle is None:
            return []
        file = self.folder / "obstacle.urdf"
        file.write_text(self.obstacle.urdf(), encoding="utf-8")
        return ["obstacle:=%s" % file, "obstacle_at:=-x %g -y %g -z %g" % self.obstacle.middle]

    def _plans(self) -> bool:
        """Whether the obstacle stands there and move_group can plan; True where the lab has neither."""
        return self.obstacle is None or (
            PLANNING_SERVICE in self.graph.services() and OBSTACLE_SPAWNER not in self.graph.nodes()
            and OBSTACLE_SPAWNER[1:] in self._ended_nodes())

    def _is_steerable(self, services: set[str]) -> bool:
        """Whether the servo is there; True where the lab has none."""
        return not self.steered or SERVO_SERVICE in services

    def _ended_nodes(self) -> set[str]:
        """Names of nodes that ended well according to roslaunch."""
        return {name.rpartition("-")[0] for name in
                _ENDED_NODE.findall((self.folder / "output.txt").read_text(errors="replace"))}

    def _all_there(self) -> bool:
        services, nodes = self.graph.services(), self.graph.nodes()
        return bool(self._plans() and self._is_steerable(services)
                    and all("/ExternalTools/%s/PositionKinematicsNode/IKService" % side in services for side in SIDES)
                    and "/robot_state_publisher" in nodes and self.joint_names and self._has_time
                    # The spawner still waits for the response of a service that the first reset withdraws.
                    and SPAWNER not in nodes)

    def _pace(self, connection: socket.socket, ended: Callable[[], bool]) -> None:
        """Read records, wait until the watched programs are idle, then step the world."""
        lines = connection.makefile("r", encoding="utf-8")
        calm_in = None
        try:
            self.joint_names = tuple(json.loads(next(lines))["joints"])
            for line in lines:
                came_at = time.monotonic()
                self._heard, self._is_held = self._heard + 1, True
                record = json.loads(line)
                self._has_time = True
                if record.get("done") is not None:
                    self._done, calm_in = record["done"], CALM_RECORDS
                if calm_in is not None:
                    calm_in -= 1
                    if calm_in == 0:
                        calm_in = None
                        self._calm.set()
                        self._may_go.wait()
                if self.run_clock is not None:
                    self.run_clock.advance(RECORD_S)
                record["rested"] = self.watch.wait_until_rest()
                record["helpers_s"] = self.watch.helpers.used_s
                self.on_record(record)
                left_s = came_at + (_SHORTEST_RECORD_S if self.is_hurried else RECORD_S) - time.monotonic()
                if left_s > 0.0:
                    time.sleep(left_s)
                order, self._order = self._order, None
                self._is_held = False
                connection.sendall((json.dumps(order) if order else "").encode() + b"\n")
        except (OSError, ValueError, StopIteration):
            pass  # the simulator has ended; is_alive reports it
        finally:
            ended.set()


def _accept(listener: socket.socket) -> socket.socket | None:
    with contextlib.suppress(TimeoutError):
        return listener.accept()[0]
    return None


def _share() -> Path:
    return Path(rospkg.RosPack().get_path("rf_checks"))


def student_folder() -> Path:
    """The folder with the start-up modules of a checked program."""
    return _share() / "student"


def robot_description(serial: int = 0) -> str:
    """The URDF text of the lab's robot, of the one with this serial number. Raises LabFailed."""
    packages = rospkg.RosPack()
    command = [find_node("baxter_sim_hardware", "robot_of_serial")[0], str(serial),
               str(Path(packages.get_path("xacro")) / "xacro"),
               str(Path(packages.get_path("baxter_description")) / "urdf" / "baxter.urdf.xacro")]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        raise LabFailed("the robot's description cannot be made: %s" % done.stderr.strip())
    return done.stdout
