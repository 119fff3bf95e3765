# SPDX-License-Identifier: BSD-3-Clause
"""The job of each worker: one judge, which has a separate lab for each program."""
from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lab_batch import Job
from processes import isolation
from rf_grading import motion

if TYPE_CHECKING:
    from rf_checks.judge import Judge

#: Bytes of a program's output and of its errors that the feedback shows: the end of each.
SHOWN = 3000


class Grade(Job):
    """Episode k judges the k-th task of a list; its result is {"verdict": ..., "motions": one for each run}."""

    def __init__(self, tasks: str = "", wall_limit: float = 900.0, trusted: bool = False,
                 hidden: Sequence[str] = ()) -> None:
        """tasks: a JSON file, list of {"lab", "exercise", "program", "seed", "profile", "serial"}. wall_limit: of a
        check [s]. trusted: judge without sandboxes where the machine allows none. hidden: folders that no program may
        see."""
        self._file, self._wall_limit, self._trusted, self._hidden = tasks, wall_limit, trusted, [
            Path(folder) for folder in hidden]

    def start(self) -> None:
        isolation.try_to_enter_network()
        # Not before: the kernel lets only a process without further threads enter a user namespace.
        from rf_checks.exercises import EXERCISES
        from rf_checks.judge import Judge

        self._make_judge = Judge
        self._exercises = {(exercise.lab, exercise.name): exercise for exercise in EXERCISES}
        self._tasks = json.loads(Path(self._file).read_text(encoding="utf-8"))
        self._judges = {}
        # Tells now, not at the first task, that this machine allows no sandbox.
        self._judge_of("sim", 0)

    def _judge_of(self, profile: str, serial: int) -> Judge:
        from rf_checks.lab import WhichRobot

        if (profile, serial) not in self._judges:
            self._judges[profile, serial] = self._make_judge(
                self._wall_limit, self._trusted, WhichRobot(profile, serial), self._hidden)
        return self._judges[profile, serial]

    def run(self, seed: int) -> dict[str, Any]:
        from rf_checks import report

        task = self._tasks[seed]
        judge = self._judge_of(task["profile"], task["serial"])
        try:
            result = judge.check(self._exercises[task["lab"], task["exercise"]], task["program"], task["seed"])
        finally:
            # What a program leaves in its lab must not reach the next one.
            judge.close()
        verdict = json.loads(report.as_json(result))
        verdict["program"] = Path(task["program"]).name
        for run, traced in zip(verdict["runs"], result.runs, strict=True):
            trace = traced.trace
            run["output"], run["errors"] = (_end(trace.output), _end(trace.errors)) if trace else ("", "")
        return {"verdict": verdict, "motions": [
            motion.of_run(one.trace.recording, judge.robot) if one.trace else {} for one in result.runs]}

    def end(self) -> None:
        for judge in self._judges.values():
            judge.close()


def _end(text: str):
    return text if len(text) <= SHOWN else "...\n" + text[-SHOWN:]
