# SPDX-License-Identifier: BSD-3-Clause
"""Finds the simulator on this master, or starts one that ends with this process."""
from __future__ import annotations

import atexit
import contextlib
import fcntl
import os
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import IO, Any, cast
from urllib.parse import urlparse

import rosgraph
import rospkg
import rospy

from baxter_interface import startup
from baxter_interface.waiting import Condition, wait_in_order
from lab_web import page_files
from processes import keeper
from processes.ports import free_port

from .labs import LABS

# A simulator that another program has started may still be starting; after this time it counts as another robot's [s].
FOUND_TIMEOUT_S = 20.0
# Time limit for the start of our own simulator, on a busy machine [s].
START_TIMEOUT_S = 120.0
# Ports of further labs beside the first one.
FURTHER_PORTS = range(11411, 11500)
LOG_LINES_SHOWN = 12
# The server of the lab's page; its first start downloads a library [s].
PAGE = ("rosrun", "lab_web", "lab_web")
PAGE_TIMEOUT_S = 300.0


class NoLab(Exception):
    """No lab is available; the text says why and what to do."""


class RunningLab:
    """The result of :func:`connect`. Printing it shows what runs and how to stop it."""

    def __init__(self, command: Sequence[str], topic: str) -> None:
        self._command = command
        self._topic = topic
        self._master_keeper = None
        self._keeper = None
        self._programs = {}
        self._log = Path()

    @property
    def is_ours(self) -> bool:
        """Whether this process has started the simulator, and it still runs."""
        return self._keeper is not None and self._keeper.poll() is None

    @property
    def nodes(self) -> list[Any]:
        """Names of the nodes that the master knows."""
        try:
            listed: Any = rosgraph.Master("/lab_session").getSystemState()
        except (OSError, rosgraph.MasterException):
            return []
        return sorted({name for group in listed for _, names in group for name in names})

    def run(self, *command: str) -> Path:
        """Run a program beside the notebook, until :meth:`stop` or until the notebook's kernel ends.

        A running one is not started again. Returns the file with its output.
        """
        name = "-".join(word.rpartition("/")[2] for word in command[:3])
        log = _state_folder() / ("lab_session-%d-%s.log" % (os.getpid(), name))
        known = self._programs.get(command)
        if known is not None and known.poll() is None:
            print("runs already: %s" % " ".join(command))
            return log
        with open(log, "w") as output:
            self._programs[command] = _keep(log.with_suffix(".state"), list(command), output)
        print("started: %s (its output: %s)" % (" ".join(command), log))
        return log

    def page(self) -> str:
        """The address of the lab's page in a browser, with its token; starts the page's server where none runs.

        Raises NoLab where it does not start.
        """
        found = page_files.address(rosgraph.get_master_uri())
        if found is None:
            log = self.run(*PAGE)
            deadline = time.monotonic() + PAGE_TIMEOUT_S
            while found is None:
                if self._programs[PAGE].poll() is not None or time.monotonic() > deadline:
                    raise NoLab("the page did not start. Its output (%s) ends with:\n%s" % (log, _last_lines(log)))
                time.sleep(0.2)
                found = page_files.address(rosgraph.get_master_uri())
        return found

    def stop(self) -> None:
        """End the programs and the simulator that this process has started. The master stays until this process
        ends."""
        for command, program in self._programs.items():
            _closed(program)
            print("stopped: %s" % " ".join(command))
        self._programs.clear()
        if self._keeper is None:
            print("the simulator goes on: this notebook has not started it")
            return
        self._keeper = _closed(self._keeper)
        print("stopped: %s" % " ".join(self._command))

    def close(self) -> None:
        """End everything that this process has started, the master too."""
        for program in self._programs.values():
            _closed(program)
        self._keeper, self._master_keeper = _closed(self._keeper), _closed(self._master_keeper)

    def __repr__(self) -> str:
        uri = os.environ["ROS_MASTER_URI"]
        names = self.nodes
        if not names:
            return "No master answers at %s: run the cell that connects again." % uri
        running = "running on %s: %s" % (uri, ", ".join(names))
        shell = "./baxter.sh" if uri == "http://localhost:11311" else "ROS_MASTER_URI=%s ./baxter.sh" % uri
        if self.is_ours:
            stop = "lab.stop() stops it; it also ends with this notebook's kernel. Its output: %s" % self._log
        elif self._is_up():
            stop = "It was there before this notebook: stop it where it was started, with Ctrl-C."
        else:
            stop = "The simulator is stopped: run the cell that connects again."
        return "%s\n%s\nThe same lab in a terminal: %s" % (running, stop, shell)

    def _ask_for(self, command: list[str]) -> None:
        """Set `command` for the next start; our running simulator goes on."""
        if not self.is_ours:
            self._command = command
        elif command != self._command:
            _say("what runs was started as: roslaunch %s; lab.stop() stops it, and the next connect starts it again"
                 % " ".join(self._command))

    def _is_up(self) -> bool:
        return self._topic in {name for name, _ in _published_topics()}

    def _start(self, port: int, has_master: bool) -> None:
        """Start the simulator, and a master for it if there is none."""
        folder = _state_folder()
        state = folder / ("lab_session-%d" % port)
        self._log = folder / ("lab_session-%d.log" % port)
        log = open(self._log, "w")  # noqa: SIM115  (handed on to the children)
        with log:
            if not has_master:
                self._master_keeper = _keep(folder / ("lab_session-%d.master" % port), ["roscore", "-p", str(port)],
                                            log, after=state)
            self._keeper = _keep(state, ["roslaunch", "--wait", *self._command], log)
        self._wait(START_TIMEOUT_S)

    def _wait(self, timeout_s: float) -> None:
        """Wait for the robot's topic; raises OSError, or NoLab when a simulator of ours has died."""
        ours = self._keeper
        condition = startup.topic_published(self._topic)
        met = Condition(condition.what, lambda: condition.is_met() or (ours is not None and ours.poll() is not None),
                        condition.explain)
        # The keeper knows whether our own simulator is still starting.
        wait_in_order([met], timeout_s, startup.LINE, (lambda: False) if ours else startup.simulator_is_coming())
        if ours and ours.poll() is not None:
            lines = _last_lines(self._log)
            self.close()
            raise NoLab("roslaunch %s has ended. Its output (%s) ends with:\n%s"
                        % (" ".join(self._command), self._log, lines))


_labs = {}
_run_id = None


def connect(name: str, *arguments: str) -> RunningLab:
    """Return the :class:`RunningLab` of that name (a key of :data:`lab_session.labs.LABS`), and make this process a ROS
    node.

    Uses the simulator on the master that ROS_MASTER_URI names; if there is none, starts one there, with further launch
    `arguments` such as "gui:=false"; if another robot runs there, starts one on a separate port and sets
    ROS_MASTER_URI. Calling it again is safe: it finds the lab of the first call, or starts it again with the present
    arguments.

    Raises :class:`NoLab` when no lab can be found or started.
    """
    if name not in LABS:
        raise NoLab("there is no lab '%s'; there are: %s" % (name, ", ".join(LABS)))
    start = LABS[name]
    lab = _labs.setdefault(name, RunningLab(start.command, start.topic))
    lab._ask_for([*start.command, *arguments])
    try:
        with _only_one():
            _find_or_start(lab)
        _become_node("notebook")
        startup.wait_for_start([], START_TIMEOUT_S)
    except (OSError, rosgraph.MasterException) as error:
        raise NoLab(getattr(error, "strerror", None) or str(error)) from error
    print(lab)
    return lab


def _find_or_start(lab: RunningLab) -> None:
    if lab.is_ours:
        lab._wait(START_TIMEOUT_S)
        return
    port = _master_port()
    is_local = rosgraph.get_master_uri().split("://")[-1].startswith(("localhost:", "127."))
    state = _state_folder() / ("lab_session-%d" % port)
    # A simulator of an ended notebook is shutting down, or still starting.
    if keeper.is_held(state) and state.read_text().startswith("ending"):
        wait_in_order([Condition("the simulator before this one to end", lambda: not keeper.is_held(state),
                                 lambda: "it still runs")], keeper.STOP_TIMEOUT_S + 10.0, startup.LINE)
    has_simulator = any(name == "/gazebo" for name in lab.nodes)
    if has_simulator or keeper.is_held(state) or not is_local:
        try:
            lab._wait(START_TIMEOUT_S if _holds(state, lab) else FOUND_TIMEOUT_S)
            return
        except OSError as error:
            if not is_local or rospy.core.is_initialized():
                raise NoLab("the lab at %s has no %s: %s. Stop it, or restart this notebook's kernel to work beside "
                            "it." % (rosgraph.get_master_uri(), lab._topic, error.strerror)) from error
        _say("the simulator at %s has no %s; starting another one beside it" % (rosgraph.get_master_uri(), lab._topic))
        port = free_port(FURTHER_PORTS)
        os.environ["ROS_MASTER_URI"] = "http://localhost:%d" % port
        os.environ["ROS_HOSTNAME"] = "localhost"
    _say("starting roslaunch %s ..." % " ".join(lab._command))
    lab._start(port, has_master=bool(lab.nodes))


def _holds(state: Path, lab: RunningLab) -> bool:
    return keeper.is_held(state) and " ".join(lab._command) in state.read_text()


def _become_node(name: str) -> None:
    """rospy.init_node, once in a process; its master must stay the same."""
    global _run_id
    run_id = rosgraph.Master("/lab_session").getParam("/run_id")  # roslaunch and roscore set it
    if not rospy.core.is_initialized():
        rospy.init_node(name, anonymous=True, disable_signals=True)
        _run_id = run_id
    elif run_id != _run_id:
        raise NoLab("the master at %s is not the one that this notebook has worked with; restart the notebook's "
                    "kernel (Kernel > Restart Kernel)" % rosgraph.get_master_uri())


def _published_topics() -> list[str]:
    try:
        found: Any = rosgraph.Master("/lab_session").getPublishedTopics("/")
        return found
    except (OSError, rosgraph.MasterException):
        return []


def _keep(state: Path, command: list[str], log: IO[str], after: Path | None = None) -> subprocess.Popen[bytes]:
    environment = dict(os.environ)
    environment.pop("LAB_SESSION_AFTER", None)
    if after:
        environment["LAB_SESSION_AFTER"] = str(after)
    return subprocess.Popen([sys.executable, keeper.__file__, str(state), *command], stdin=subprocess.PIPE,
                            stdout=log, stderr=subprocess.STDOUT, env=environment, start_new_session=True)


def _closed(process: subprocess.Popen[bytes] | None) -> None:
    """Let a keeper end its command, and wait for it; returns None, to replace the keeper's reference."""
    if process is not None:
        with contextlib.suppress(OSError):
            cast("IO[bytes]", process.stdin).close()
        process.wait(keeper.STOP_TIMEOUT_S + 10.0)


def _state_folder() -> Path:
    folder = Path(rospkg.get_ros_home())
    folder.mkdir(parents=True, exist_ok=True)
    return folder


@contextlib.contextmanager
def _only_one() -> Iterator[None]:
    """Two notebooks that connect to the same master at the same time do so one after the other."""
    with open(_state_folder() / ("lab_session-%d.lock" % _master_port()), "a") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


def _master_port() -> int:
    uri = rosgraph.get_master_uri()
    try:
        port = urlparse(uri).port
    except ValueError:
        port = None
    if port is None:
        raise NoLab("ROS_MASTER_URI is %r; it should look like http://localhost:11311" % uri)
    return port


def _last_lines(log: Path) -> str:
    lines = Path(log).read_text(errors="replace").splitlines()[-LOG_LINES_SHOWN:]
    return "\n".join("  | " + line for line in lines)


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


@atexit.register
def _end_labs() -> None:
    for lab in _labs.values():
        lab.close()
