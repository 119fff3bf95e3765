# SPDX-License-Identifier: BSD-3-Clause
"""An expert corrects what a policy does, and ends what it began."""
import numpy as np

from baxter_lab import Options
from demonstrations.environment import STUDENT_STEPS, core_of, expert_of, record
from demonstrations.frames import ACTION, EXPERT_ACTION


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
    assert np.abs(wanted[:STUDENT_STEPS, :3]).max(axis=1).min() > 0.1  # it wants to go to the point all the time
    core.close()
