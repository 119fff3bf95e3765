# SPDX-License-Identifier: BSD-3-Clause
"""An expert corrects what a policy does, and ends what it began."""
from types import SimpleNamespace

import numpy as np

from baxter_lab import Options
from demonstrations.collecting import Collected
from demonstrations.environment import STUDENT_STEPS, core_of, expert_of, record
from demonstrations.frames import ACTION, EXPERT_ACTION, Episode, Schema, numbers
from demonstrations.writing import SetWriter
from robot_learning import command


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

    def collected(task, folder, seeds, *_, **__):
        done.append(("demonstrations", len(seeds)))
        return add(folder, seeds)

    def corrected(path, folder, seeds, *_):
        done.append(("corrections", len(seeds)))
        return add(folder, seeds)

    monkeypatch.setattr(command, "collect", collected)
    monkeypatch.setattr(command, "correct", corrected)
    monkeypatch.setattr(command, "_train", lambda options, source, path, steps: done.append(("training", steps)))
    monkeypatch.setattr(command, "load", lambda path: SimpleNamespace(contract=SimpleNamespace(task="Reach")))
    monkeypatch.setattr(command, "draw_curve", lambda *_: None)
    options = command.parse(["Reach", "--demonstrations", "5", "--rounds", "1", "--corrections", "3", "--steps", "10"])
    command.learn(options, tmp_path)
    assert done == [("demonstrations", 5), ("training", 5), ("corrections", 3), ("training", 10)]
    done.clear()
    options.rounds = 2
    command.learn(options, tmp_path)
    assert done == [("demonstrations", 1), ("training", 5), ("corrections", 3), ("training", 10)]
