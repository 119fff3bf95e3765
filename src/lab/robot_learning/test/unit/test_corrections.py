# SPDX-License-Identifier: BSD-3-Clause
"""An expert corrects what a policy does, and ends what it began."""
from types import SimpleNamespace

import numpy as np
import pytest

from baxter_lab import Options
from demonstrations.collecting import Collected
from demonstrations.environment import STUDENT_STEPS, Conditions, core_of, expert_of, record
from demonstrations.frames import ACTION, EXPERT_ACTION, DemonstrationError, Episode, Schema, numbers
from demonstrations.writing import SetWriter
from robot_learning import command
from robot_learning.evaluation import Score

MADE = SimpleNamespace(task="Reach", made={"demonstrations": 5})


class Idle:
    """A student that stays where it is; counts what it was asked."""

    def __init__(self):
        self.asked = self.begun = 0

    def begin(self):
        self.begun += 1

    def act(self, observation):
        self.asked += 1
        assert np.isfinite(observation).all()
        return np.zeros(14)


def test_the_expert_ends_what_a_student_does_not():
    core, student = core_of("Reach", options=Options(with_meshes=False), control_freq=20), Idle()
    core.task.STEPS = 200
    episode = record(core, expert_of(core), 1, student=student)
    done, wanted = episode.columns[ACTION], episode.columns[EXPERT_ACTION]
    assert episode.success and (student.begun, student.asked) == (1, STUDENT_STEPS) and len(episode) > STUDENT_STEPS
    assert not done[:STUDENT_STEPS].any()
    np.testing.assert_array_equal(done[STUDENT_STEPS:], wanted[STUDENT_STEPS:])
    assert np.abs(wanted[:STUDENT_STEPS, :3]).max(axis=1).min() > 0.05  # it wants to go to the point all the time
    core.close()


def test_what_an_earlier_run_did_is_not_done_again(tmp_path, monkeypatch):
    done = []

    def add(folder, seeds):
        schema = Schema(20, {ACTION: numbers([("a", "")])}, about={"task": "Reach"})
        with SetWriter(folder, schema) as writer:
            for seed in list(seeds)[:-1]:  # the expert fails with the last one
                writer.add(Episode("Reach.", {ACTION: np.zeros((2, 1), np.float32)}, True, seed))
        return Collected(len(seeds) - 1, 1, 2)

    def collected(task, folder, seeds, *_, conditions, **__):
        done.append(("demonstrations", len(seeds)))
        assert conditions == Conditions()
        return add(folder, seeds)

    def corrected(path, folder, seeds, workers, say, conditions):
        assert conditions == Conditions()
        done.append(("corrections", len(seeds)))
        return add(folder, seeds)

    monkeypatch.setattr(command, "collect", collected)
    monkeypatch.setattr(command, "correct", corrected)
    monkeypatch.setattr(command, "_train", lambda options, source, path, steps: done.append(
        ("training", steps)) or path.touch())
    monkeypatch.setattr(command, "load", lambda path: SimpleNamespace(contract=MADE))
    monkeypatch.setattr(command, "draw_curve", lambda *_: None)
    options = command.parse(["Reach", "--demonstrations", "5", "--rounds", "1", "--corrections", "3", "--steps", "10"])
    command.learn(options, tmp_path)
    assert done == [("demonstrations", 5), ("training", 5), ("corrections", 3), ("training", 10)]
    done.clear()
    options.rounds = 2
    command.learn(options, tmp_path)
    # The seed that failed last has left nothing. A round goes on with its own student.
    assert done == [("demonstrations", 1), ("corrections", 1), ("training", 5), ("corrections", 3), ("training", 10)]
    options.profile = "robot"
    with pytest.raises(DemonstrationError, match="with profile sim, not with profile robot; choose another --out"):
        command.learn(options, tmp_path)


def test_what_is_measured_is_what_was_shown(tmp_path, monkeypatch):
    """Demonstrations, corrections and evaluation have the command line's conditions, and a folder of their own."""
    seen = []

    def collected(task, folder, seeds, *_, conditions, **__):
        seen.append(conditions)
        return Collected(1, 0, 1)

    monkeypatch.setattr(command, "collect", collected)
    monkeypatch.setattr(command, "correct", lambda *arguments: seen.append(arguments[-1]) or Collected(1, 0, 1))
    monkeypatch.setattr(command, "_train", lambda *_: None)
    monkeypatch.setattr(command, "DataSet", lambda path: [])
    monkeypatch.setattr(command, "load", lambda path: SimpleNamespace(contract=MADE))
    monkeypatch.setattr(command, "draw_curve", lambda *_: None)

    def evaluated(path, seeds, workers, progress, profile, randomised):
        seen.append(Conditions(profile, randomised))
        return Score({0: {"success": True, "steps": 1}}, {})

    monkeypatch.setattr(command, "evaluate", evaluated)
    monkeypatch.setenv("LAB_ROOT", str(tmp_path))
    assert command.main(["Reach", "--profile", "robot", "--randomised", "--rounds", "1", "--no-film"]) == 0
    assert seen == 3 * [Conditions("robot", {"mass": 0.5, "friction": 0.5})]
    assert (tmp_path / ".baxter/learned/Reach-robot-randomised" / command.SCORE).is_file()
