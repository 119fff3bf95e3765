# SPDX-License-Identifier: BSD-3-Clause
"""Runs a program as often as its exercise asks for, each time with the robot put back, and has it graded."""
import os
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from rf_checks import diagnosis
from rf_checks.lab import Lab, LabFailed, robot_description
from rf_checks.pacing import cpu_time_s
from rf_checks.recording import RECORD_S, Criterion, Fault, Recording, Run
from rf_checks.robot import Robot
from rf_checks.sandbox import PROCESSES, Student, adopt_orphans, has_namespaces, python

#: However slow the machine: one run takes no longer than this [s].
WALL_LIMIT_S = 45.0
#: A program that hardly ever rests for so much of its own processor time computes without end [s]; this share of the
#: moments at which the judge looks is hardly ever.
BUSY_S, BUSY_SHARE = 8.0, 0.3
#: Faults that the next run of the same program would only show again.
REPEATED = ("not_enabled", "wrong_arm", "wrong_frame", "early_exit", "no_end", "quaternion_order", "degrees",
            "not_asked", "made_up")
#: A world from which nothing is heard for so long [s] was paused.
PAUSED_S = 10.0
# After a program's end the robot is watched until it stands, and at most so long [sim s].
SETTLE_S = 1.5
_LOOK_S = 0.02
# Records that are looked at for a flood while a program runs.
RECENT = round(3 * diagnosis.FLOOD_WINDOW_S / RECORD_S)
_LOOK_AT_GRAPH_S = 0.3
OWN_TOPICS = ("/clock", "/robot/joint_states", "/robot/state")


@dataclass(frozen=True)
class RunResult:
    """One run: the program's words, its Criteria, its Fault or None."""

    arguments: tuple
    criteria: tuple
    fault: Fault | None

    @property
    def points(self):
        share = sum(one.share * one.weight for one in self.criteria) / sum(one.weight for one in self.criteria)
        return 100.0 * min(share, self.fault.cap if self.fault else 1.0)


@dataclass(frozen=True)
class Result:
    """What a check came to."""

    exercise: object
    program: str
    seed: int
    runs: tuple
    isolation: str
    lasted_s: float

    @property
    def points(self):
        """0 to 100."""
        return float(np.mean([run.points for run in self.runs]))

    @property
    def fault(self):
        """The first Fault, or None."""
        return next((run.fault for run in self.runs if run.fault), None)


class Judge:
    """Keeps one lab for any number of programs; a context manager."""

    def __init__(self):
        self._description = robot_description()
        self.robot = Robot(self._description)
        self._lab = None
        adopt_orphans()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def close(self):
        if self._lab is not None:
            self._lab.close()
            self._lab = None

    def check(self, exercise, program, seed=0):
        """Run `program` (path) through the Exercise; returns a Result. Raises LabFailed, OSError."""
        began = time.monotonic()
        program = Path(program).resolve()
        calls = exercise.task.calls(np.random.default_rng(seed))
        fault = diagnosis.check_syntax(program.read_bytes().decode("utf-8", errors="replace"), program.name)
        results = []
        not_run = (Criterion("not run", 0.0, 100.0, "for the fault below"),)
        for call in calls:
            if fault is not None:
                results.append(RunResult(call.arguments, not_run, fault))
                continue
            run = self.run(program, exercise, call)
            criteria = tuple(exercise.task.criteria(call, run, self.robot))
            share = sum(one.share * one.weight for one in criteria) / 100.0
            found = diagnosis.diagnose(run, exercise, call, self.robot, share)
            results.append(RunResult(call.arguments, criteria, found))
            # What went that wrong goes wrong again, and costs time: the other runs count as this one.
            if found and (found.cap < 0.9 or (found.key in REPEATED and share < 0.5)):
                fault = found
                not_run = (Criterion("as the run before", share, 100.0, "not run, for the fault below"),)
        isolation = "namespaces" if has_namespaces() else "session"
        return Result(exercise, str(program), seed, tuple(results), isolation, time.monotonic() - began)

    def run(self, program, exercise, call):
        """One run; returns a Run."""
        lab = self._fresh_lab(call.posture)
        records = []
        helpers = lab.helper_pids()
        lab.watch.roots = helpers
        lab.on_record = records.append
        environment = {**os.environ, "ROS_MASTER_URI": lab.uri, "ROS_HOSTNAME": "localhost"}
        for name in ("ROS_IP", "ROS_NAMESPACE", "LAB_JUDGE_SOCKET"):
            environment.pop(name, None)
        student = Student([python(), str(program), *call.arguments], environment, _workspace(), lab.folder)
        lab.watch.roots = [*helpers, student.pid]
        run = Run(list(call.arguments), Recording(lab.joint_names), program=program.name)
        try:
            run.ended = self._watch(lab, student, records, run, exercise, call)
            run.exit_code = student.exit_code
            if run.ended in ("busy", "sim time", "wall time"):
                student.dump()
                run.stuck_at = diagnosis.line_of_dump(program.name, student.errors)
            elif run.ended == "exited":
                if records:
                    records[-1]["exited"] = records[-1]["t"]
                self._settle(lab, records)
        finally:
            student.end()
            lab.is_hurried = False
            lab.on_record = lambda record: None
            lab.watch.roots = ()
        run.output, run.errors, run.survivors = student.output, student.errors, student.survivors
        run.recording = Recording(lab.joint_names, _with_exit(records))
        if run.ended == "paused":
            self.close()
        else:
            lab.forget_strangers()
        return run

    def _fresh_lab(self, posture):
        for attempt in (1, 2):
            if self._lab is not None and not self._lab.is_as_it_was():
                self.close()
            try:
                if self._lab is None:
                    self._lab = Lab(self._description)
                    self._lab.start()
                self._lab.reset(posture)
                return self._lab
            except LabFailed:
                self.close()
                if attempt == 2:
                    raise
        raise AssertionError  # the loop above returns or raises

    def _watch(self, lab, student, records, run, exercise, call):
        """Wait for the end of a run, whichever comes first; returns what it was."""
        give_up = time.monotonic() + WALL_LIMIT_S
        look_at_graph = 0.0
        since, cpu_then = 0, 0.0
        heard, heard_at = 0, time.monotonic()
        lab.is_hurried = True
        while True:
            time.sleep(_LOOK_S)
            count = len(records)
            ended = student.exit_code is not None
            if time.monotonic() > look_at_graph or ended:
                look_at_graph = time.monotonic() + _LOOK_AT_GRAPH_S
                self._look_at_graph(lab, run)
            if not lab.is_alive:
                return "simulator gone"
            if count > heard:
                heard, heard_at = count, time.monotonic()
            elif time.monotonic() > heard_at + PAUSED_S:
                return "paused"
            if run.missing_nodes or run.intruders or ended:
                return "exited" if ended else "satisfied"
            if student.wrote_too_much:
                return "output"
            family = student.family()
            if len(family) > PROCESSES:
                return "processes"
            recent = Recording(lab.joint_names, records[max(0, count - RECENT):count])
            if count and diagnosis.is_flood(recent.command_counts()):
                return "flood"
            used = cpu_time_s(family)
            if used - cpu_then > BUSY_S:
                if np.mean([record["rested"] for record in records[since:count]] or [False]) < BUSY_SHARE:
                    return "busy"
                since, cpu_then = count, used
            if count and records[count - 1]["t"] - records[0]["t"] > call.limit_s:
                return "sim time"
            if time.monotonic() > give_up:
                return "wall time"
            run.output = student.output
            if exercise.task.is_satisfied(call, run):
                return "satisfied"

    @staticmethod
    def _look_at_graph(lab, run):
        try:
            run.missing_nodes = lab.missing_nodes()
            for topic in OWN_TOPICS:
                strangers = lab.publishers(topic) - lab.own_nodes
                if strangers:
                    run.intruders[topic] = sorted(strangers)
        except LabFailed:
            run.missing_nodes = ["/rosout and with it the ROS master"]

    @staticmethod
    def _settle(lab, records):
        """Wait until the arms have stood for a moment."""
        until = len(records) + round(SETTLE_S / RECORD_S)
        quiet = round(0.3 / RECORD_S)
        deadline = time.monotonic() + 20.0
        while lab.is_alive and len(records) < until and time.monotonic() < deadline:
            time.sleep(0.01)
            recent = np.array([record["q"] for record in records[-quiet:]])
            since = until - round(SETTLE_S / RECORD_S)
            if len(records) > since + quiet and np.ptp(recent, axis=0).max() < 1e-4:
                return


def _with_exit(records):
    """The records, the last of which knows when the program ended."""
    records = list(records)
    ends = [record["exited"] for record in records if "exited" in record]
    if ends:
        records[-1]["exited"] = ends[-1]
    return records


def _workspace():
    return os.environ.get("LAB_ROOT") or str(Path(__file__).resolve().parents[5])
