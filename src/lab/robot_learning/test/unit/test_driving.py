# SPDX-License-Identifier: BSD-3-Clause
"""When a policy may move a robot."""
import dataclasses
import math

import numpy as np
import pytest

from robot_learning.driving import DrivingLimits, Situation, limited, reason_to_wait

GOOD = Situation(held_s=0.1, seen_s=0.01, enabled=True, stopped=False, off_rad=0.1)


def test_it_may_while_all_is_well():
    assert reason_to_wait(DrivingLimits(), GOOD) == ""


@pytest.mark.parametrize(("change", "word"), [
    ({"held_s": 0.31}, "switch"), ({"held_s": math.inf}, "switch"), ({"seen_s": 0.3}, "old"),
    ({"seen_s": math.inf}, "old"), ({"enabled": False}, "enable_robot"),
    ({"stopped": True}, "stop"), ({"off_rad": 0.6}, "in the way")])
def test_each_fault_stops_it_with_its_reason(change, word):
    assert word in reason_to_wait(DrivingLimits(), dataclasses.replace(GOOD, **change))


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
def test_limits_without_sense_are_refused(value):
    with pytest.raises(ValueError, match="hold_s"):
        DrivingLimits(hold_s=value)


def test_a_far_set_point_is_taken_as_far_as_allowed_in_its_direction():
    before, target = np.zeros(7), np.array([0.4, -0.2, 0, 0, 0, 0, 0.0])
    np.testing.assert_allclose(limited(before, target, 0.1), 0.25 * target)
    np.testing.assert_array_equal(limited(before, target, 0.5), target)
