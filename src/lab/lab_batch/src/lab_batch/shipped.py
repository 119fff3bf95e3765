# SPDX-License-Identifier: BSD-3-Clause
"""The jobs that come with the workspace. What a job needs is imported when it starts."""
from __future__ import annotations

import contextlib
import json
import os
import re
import shlex
import signal
import subprocess
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

from processes.family import with_parent
from processes.ports import free_port

from .job import Job

if TYPE_CHECKING:
    from _io import BufferedRandom

TAIL = 400  # characters of a program's output in the error of an episode
STOP_TIMEOUT_S = 20.0
# What roslaunch writes where a required node fails: its name, its exit code; and the line before, in red.
_REQUIRED = re.compile(r"REQUIRED process \[(.+?)\] has died!\s+process has died \[pid \d+, exit code (-?\d+)")
_BEFORE = "=\x1b[31m"


class InverseKinematics(Job):
    """Solves random reachable poses of one of Baxter's arms, as the IK service does."""

    def __init__(self, side: str = "left", poses: int = 200, tolerance: float = 1e-5) -> None:
        self._side, self._poses, self._tolerance = side, poses, tolerance

    def start(self) -> None:
        import rospkg

        from arm_kinematics import Chain, warm_up
        from baxter_model import BASE_FRAME, SIDES, tip_of
        from urdf_model import description_text, parse_urdf

        if self._side not in SIDES:
            raise ValueError("side is %r, not left or right" % (self._side,))
        file = Path(rospkg.RosPack().get_path("baxter_description")) / "urdf" / "baxter.urdf.xacro"
        robot = parse_urdf(description_text(file), source=str(file))
        self._chain = Chain.from_robot(robot, BASE_FRAME, tip_of(self._side))
        warm_up(self._chain)

    def run(self, seed: int) -> dict[str, Any]:
        import numpy as np

        from arm_kinematics import Budget, NoSolution, solve

        rng = np.random.default_rng(seed)
        chain = self._chain
        middle = 0.5 * (chain.lower + chain.upper)
        budget = Budget(tolerance_m=self._tolerance, tolerance_rad=self._tolerance)
        solved, farthest = 0, 0.0
        for _ in range(self._poses):
            target = chain.fk(rng.uniform(chain.lower, chain.upper))
            try:
                found = solve(chain, target, middle, budget=budget)
            except NoSolution:
                continue
            solved += 1
            farthest = max(farthest, float(np.abs(chain.fk(found.q)[:3, 3] - target[:3, 3]).max()))
        return {"poses": self._poses, "solved": solved, "all_solved": solved == self._poses, "farthest_off_m": farthest}


class Command(Job):
    """Runs a program, such as roslaunch, on a ROS master port of its own.

    {seed} in the command is replaced by the seed. The last line of its output that is a JSON object has results. A
    required node of roslaunch that ends with another exit code than 0 is a failure; roslaunch itself ends with 0.
    """

    def __init__(self, command: str = "", exit_codes: tuple[int] = (0,)) -> None:
        self._words, self._codes = shlex.split(command), set(exit_codes)

    def start(self) -> None:
        if not self._words:
            raise ValueError('set command, for instance --set command="roslaunch PACKAGE FILE seed:={seed}"')

    def run(self, seed: int) -> dict[str, Any]:
        words = [word.replace("{seed}", str(seed)) for word in self._words]
        with tempfile.TemporaryDirectory() as folder:
            environment = {**os.environ, "ROS_MASTER_URI": "http://localhost:%d" % free_port(),
                           "ROS_HOSTNAME": "localhost", "ROS_LOG_DIR": folder, "LAB_BATCH_SEED": str(seed)}
            with tempfile.TemporaryFile() as output:
                code = _run(words, environment, output)
                output.seek(0)
                text = output.read().decode("utf-8", "replace")
        if code not in self._codes:
            raise RuntimeError("exit code %s; the end of its output: %s" % (code, text[-TAIL:].strip()))
        if died := _REQUIRED.search(text):
            raise RuntimeError("required node %s ended with exit code %s; the end of the output before: %s" % (
                *died.groups(), text[:died.start()].rstrip(_BEFORE)[-TAIL:].strip()))
        return {"exit_code": code, **_last_object(text)}


def _run(words: list[str], environment: dict[str, str], output: BufferedRandom) -> int:
    """Exit code of a program; its children end with it."""
    # Ctrl-C for a program whose worker has died.
    child = subprocess.Popen(with_parent(words, "INT"), env=environment, stdin=subprocess.DEVNULL, stdout=output,
                             stderr=subprocess.STDOUT)
    try:
        return child.wait()
    finally:
        if child.poll() is None:
            child.send_signal(signal.SIGINT)
            try:
                child.wait(STOP_TIMEOUT_S)
            except subprocess.TimeoutExpired:
                child.kill()
                child.wait()


def _last_object(text: str) -> dict[str, Any]:
    """The last line that is a JSON object, or {}: behind those of its nodes roslaunch has lines of its own."""
    for line in reversed(text.splitlines()):
        if line.startswith("{"):
            with contextlib.suppress(ValueError, RecursionError):
                return json.loads(line)
    return {}


# Name: (class, one line for --list).
JOBS = {
    "ik": ("lab_batch.shipped:InverseKinematics", "random reachable poses of an arm: how many are solved, how exactly"),
    "reach": ("lab_batch.robot_jobs:ReachPart", "a part of a map of reach of Baxter's arm; the seed is its number"),
    "planning": ("lab_batch.robot_jobs:Planning", "a path of Baxter's arm between random postures among random boxes"),
    "tuning": ("lab_batch.robot_jobs:PidTuning", "random gains of a joint's PID: the answer to a step"),
    "serials": ("lab_batch.robot_jobs:Serials", "how far the hands of the robot with this serial are from the drawing"),
    "command": ("lab_batch.shipped:Command", "a program with {seed} in its arguments, such as roslaunch"),
}
