# SPDX-License-Identifier: BSD-3-Clause
"""Runs a program as often as its exercise requires, each time with the robot reset, and grades it."""
from __future__ import annotations

import os
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from processes import isolation
from rf_checks import diagnosis, hidden_paths, submission
from rf_checks.exercises import meant_instead
from rf_checks.graph import LabFailed, MasterSilent
from rf_checks.lab import JudgedLab, TooSlow, WhichRobot, robot_description, student_folder
from rf_checks.observing import Observer
from rf_checks.pacing import ProcessTree
from rf_checks.recording import RECORD_S, Criterion, GraphChanges, ProgramRun, RunFault, RunRecording
from rf_checks.robot import JudgedRobot
from rf_checks.run_clock import RunClock
from rf_checks.sandbox import CPU_S, RunningProgram, Startup, adopt_orphans
from rf_checks.similarity import References

if TYPE_CHECKING:
    from rf_checks.exercises import Exercise
    from rf_checks.tasks import ProgramCall

#: A check that is not done within this time [s, wall] ends without a grade: the only limit in wall time.
WALL_LIMIT_S = 900.0
#: Faults that another run of the same program would repeat.
REPEATED = ("not_enabled", "wrong_arm", "wrong_frame", "early_exit", "no_end", "quaternion_order", "degrees",
            "not_asked", "made_up")
#: A world without records for this time [s, of OwnTime] counts as paused.
PAUSED_S = 10.0
_LOOK_S = 0.05
#: End of a run -> its text in the report; other values are used as they are.
ENDS = {"sim time": "simulated time limit", "satisfied": "seen enough", "output": "wrote too much",
        "processes": "too many processes", "threads": "too many threads", "sockets": "too many connections",
        "files": "too many files", "memory": "too much memory", "flood": "flood of commands",
        "requests": "too many requests", "busy": "computed without end", "paused": "simulation paused",
        "meddled": "lab meddled with"}
MASTER = "/rosout and with it the ROS master"


@dataclass(frozen=True)
class RunResult:
    """One run: the program's arguments, its Criteria, its RunFault or None; end: how_it_ended, trace: the ProgramRun,
    both None when it did not run."""

    arguments: tuple[str, ...]
    criteria: tuple[Criterion, ...]
    fault: RunFault | None
    end: dict[str, Any] | None = None
    trace: ProgramRun | None = None

    @property
    def points(self) -> float:
        share = sum(one.share * one.weight for one in self.criteria) / sum(one.weight for one in self.criteria)
        return 100.0 * min(share, self.fault.cap if self.fault else 1.0)


@dataclass(frozen=True)
class Result:
    """The result of a check. not_graded: why there are no points, or ""."""

    exercise: Exercise
    program: str
    seed: int
    runs: tuple[RunResult, ...]
    isolation: str
    lasted_s: float
    not_graded: str = ""
    #: Sentences for the instructor, which change no points.
    notes: tuple[str, ...] = ()
    #: On which robot it ran.
    which: WhichRobot = WhichRobot()

    @property
    def points(self) -> float | None:
        """0 to 100; None if it was not graded."""
        return None if self.not_graded else float(np.mean([run.points for run in self.runs]))

    @property
    def fault(self) -> RunFault | None:
        """The first RunFault, or None."""
        return None if self.not_graded else next((run.fault for run in self.runs if run.fault), None)


class Judge:
    """Keeps one lab for any number of programs; a context manager."""

    def __init__(self, wall_limit_s: float = WALL_LIMIT_S, trusted: bool = False,
                 which: WhichRobot = WhichRobot(),  # noqa: B008 (a tuple)
                 hidden: Sequence[Path] = ()) -> None:
        """`wall_limit_s`: a check that takes longer ends without a grade [s]. `trusted`: if this machine allows no
        sandbox, run programs without one. `which`: the robot to judge on, a WhichRobot. `hidden`: further folders that
        no program may see, as other students' submissions. Raises isolation.NotIsolated, LabFailed.

        The caller must call `isolation.try_to_enter_network` before, while no other thread runs.
        """
        self._wall_limit_s = wall_limit_s
        self.has_walls = not isolation.problem()
        if not (self.has_walls or trusted):
            raise isolation.NotIsolated("%s. Your own program: add --trusted, and it runs without walls"
                                        % isolation.problem())
        self._which, self._hidden = which, tuple(map(str, hidden))
        self._description = robot_description(which.serial)
        self.robot = JudgedRobot(self._description)
        self._lab: JudgedLab | None = None
        adopt_orphans()

    def __enter__(self) -> Judge:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        if self._lab is not None:
            self._lab.close()
            self._lab = None

    def check(self, exercise: Exercise, program: Path, seed: int = 0) -> Result:
        """Run `program` (path) through the Exercise; returns a Result.

        Raises LabFailed, submission.BadSubmission, OSError.
        """
        began = time.monotonic()
        program = Path(program)
        program = program.parent.resolve() / program.name
        calls = exercise.task.calls(np.random.default_rng(seed))
        texts = submission.texts(program)
        fault = diagnosis.check_syntax(submission.read(program), program.name)
        other = meant_instead(exercise, program.name, texts[program.name])
        results, not_graded = [], ""
        not_run = (Criterion("not run", 0.0, 100.0, "because of the fault"),)
        for call in calls:
            if fault is not None:
                results.append(RunResult(call.arguments, not_run, fault))
                continue
            try:
                run = self.run(program, exercise, call, began + self._wall_limit_s)
            except TooSlow as error:
                not_graded = str(error)
                self.close()
                break
            criteria = tuple(exercise.task.criteria(call, run, self.robot))
            share = sum(one.share * one.weight for one in criteria) / 100.0
            found = diagnosis.diagnose(run, exercise, call, self.robot, share)
            is_final = found and (found.cap < 0.9 or (found.key in REPEATED and share < 0.5))
            if other and share < 0.5:
                found = diagnosis.of_another(found, exercise, other, program.name)
            results.append(RunResult(call.arguments, criteria, found, how_it_ended(run), run))
            # Such a fault repeats and costs time: the other runs count as this one.
            if is_final:
                fault = found
                not_run = (Criterion("as the run before", share, 100.0, "not run, because of the fault"),)
        walls = "bubblewrap" if self.has_walls else "none: trusted"
        return Result(exercise, str(program), seed, tuple(results), walls, time.monotonic() - began, not_graded,
                      tuple(References(hidden_paths.workspace()).notes(texts)), self._which)

    def run(self, program: Path, exercise: Exercise, call: ProgramCall, deadline: float = float("inf")) -> ProgramRun:
        """One run; returns a ProgramRun. Raises TooSlow at `deadline` (monotonic, s)."""
        lab = self._fresh_lab(call, deadline)
        run = ProgramRun(list(call.arguments), RunRecording(lab.joint_names), program=program.name)
        clock = RunClock()
        environment = {**os.environ, "ROS_MASTER_URI": lab.uri, "ROS_HOSTNAME": "localhost"}
        for name in ("ROS_IP", "ROS_NAMESPACE"):
            environment.pop(name, None)
        lab.watch.helpers.roots = lab.helper_pids()
        began = time.monotonic()
        student = RunningProgram(program, call.arguments, environment, self.has_walls,
                                 Startup(student_folder(), clock.environment, (clock.descriptor,), self._hidden))
        observer = Observer(call, student, lambda output: self._is_satisfied(exercise, call, run, output),
                            lambda: self._look_at_graph(lab, run))
        lab.watch.program = tree = ProcessTree((student.pid,))
        lab.watch.gives_up = lambda: time.monotonic() > deadline
        lab.run_clock, lab.is_hurried = clock, True
        lab.on_record = lambda record: observer.on_record(record, tree.used_s)
        try:
            lab.go_on()
            self._watch(lab, observer, deadline)
            if lab.is_alive and not run.changes:
                self._look_at_graph(lab, run, with_parameters=True)
            run.wall_s, run.ended, run.exit_code = time.monotonic() - began, observer.ended, student.exit_code
            if run.ended in ("busy", "sim time"):
                student.dump()
                run.stuck_at = diagnosis.line_of_dump(program, student.errors)
            run.cpu_s = tree.used_s
        finally:
            student.end()
            lab.is_hurried = False
            lab.on_record = lambda record: None
            lab.run_clock = None
            observer.release()
            tree.roots = ()
            clock.close()
        run.output, run.errors, run.survivors = student.output, student.errors, student.survivors
        run.recording = RunRecording(lab.joint_names, _with_exit(observer.records))
        if run.ended == "paused":
            self.close()
        else:
            lab.graph.forget_strangers()
        return run

    def _fresh_lab(self, call: ProgramCall, deadline: float) -> JudgedLab:
        # Nobody resets a move_group.
        if self._lab is not None and (call.obstacle or self._lab.obstacle or call.steered != self._lab.steered):
            self.close()
        for attempt in (1, 2):
            if self._lab is not None and not self._lab.is_as_it_was():
                self.close()
            try:
                if self._lab is None:
                    self._lab = JudgedLab(self._description, self.has_walls, self._which, call.obstacle,
                                          call.steered)
                    self._lab.start(deadline)
                self._lab.reset(call.posture, deadline)
                return self._lab
            except LabFailed:
                self.close()
                if attempt == 2:
                    raise
        raise AssertionError  # the loop above returns or raises

    @staticmethod
    def _watch(lab: JudgedLab, observer: Observer, deadline: float) -> None:
        """Wait for the end of a run, and end it if no more records come."""
        began = time.monotonic()
        while not observer.wait(_LOOK_S):
            excess = observer.student.excess()
            if not lab.is_alive:
                observer.end("simulator gone")
            elif lab.stood_still_s() > PAUSED_S:
                observer.end("paused")
            elif excess:
                observer.end(excess)
            elif time.monotonic() > deadline:
                simulated_s, wall_s = len(observer.records) * RECORD_S, time.monotonic() - began
                raise TooSlow("the machine reached %s of real time (%.1f simulated s in %.0f s)"
                              % (_rounded(simulated_s / wall_s), simulated_s, wall_s))

    @staticmethod
    def _is_satisfied(exercise: Exercise, call: ProgramCall, run: ProgramRun, output: str) -> bool:
        run.output = output
        return exercise.task.is_satisfied(call, run)

    @staticmethod
    def _look_at_graph(lab: JudgedLab, run: ProgramRun, with_parameters: bool = False) -> bool:
        """Whether a part of the lab is gone, or another node publishes its topics; sets `run.changes`."""
        try:
            run.changes = lab.graph.changes(with_parameters)
        except MasterSilent:
            # A busy master answers late; a stopped one does not answer at all.
            if lab.has_stopped_master():
                run.changes = GraphChanges([MASTER])
        except LabFailed:
            run.changes = GraphChanges([MASTER])
        return bool(run.changes)


def how_it_ended(run: ProgramRun) -> dict[str, Any]:
    """How a run ended, for the report: a dict of plain values."""
    how, number = run.ended, None
    if how == "exited":
        how = "finished" if run.exit_code == 0 else "exit code %s" % run.exit_code
        if run.exit_code is not None and run.exit_code < 0:
            number = -run.exit_code
            how = "killed by signal %d" % number
            if run.cpu_s > 0.95 * CPU_S:
                how = "cpu limit of %d s" % CPU_S
    return {"how": ENDS.get(how, how), "exit_code": None if number else run.exit_code, "signal": number,
            "simulated_s": round(run.simulated_s, 2), "cpu_s": round(run.cpu_s, 2), "wall_s": round(run.wall_s, 2),
            "real_time_factor": round(run.simulated_s / run.wall_s, 2) if run.wall_s else None}


def _rounded(factor: float) -> str:
    return "%.2f" % factor if factor < 0.1 else "%.1f" % factor


def _with_exit(records: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The records; the last one has the time of the program's end."""
    records = list(records)
    ends = [record["exited"] for record in records if "exited" in record]
    if ends:
        records[-1]["exited"] = ends[-1]
    return records
