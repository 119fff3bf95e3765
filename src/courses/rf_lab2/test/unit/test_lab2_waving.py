# SPDX-License-Identifier: BSD-3-Clause
"""The wave: mirrored, smooth, at rest at both ends."""
import numpy as np
import pytest

from baxter_model import MIRROR_SIGNS
from rf_lab2.waving import Swing, hands_up, shifts

ROWS = np.sin(np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False))[:, None] * [[0.3, -0.2]] + [[1.0, 2.0]]


def test_right_arm_is_the_left_one_in_a_mirror():
    left, right = hands_up("left"), hands_up("right")
    for joint, angle in left.items():
        name = joint.partition("_")[2]
        assert right["right_" + name] == MIRROR_SIGNS[name] * angle
    np.testing.assert_allclose(shifts("left", 0.1, 8) * (1, -1, 1), shifts("right", 0.1, 8))
    assert np.abs(shifts("left", 0.1, 8)).max() == pytest.approx(0.1)


def test_swing_begins_and_ends_at_rest_in_its_first_row():
    swing = Swing(ROWS, 2.0)
    for elapsed in (0.0, 6.0):
        np.testing.assert_allclose(swing.angles(elapsed, 6.0), ROWS[0])
        near = swing.angles(abs(elapsed - 1e-4), 6.0)
        assert np.abs(near - ROWS[0]).max() < 1e-7


def test_swing_passes_its_rows_without_a_jump():
    swing = Swing(ROWS, 2.0)
    np.testing.assert_allclose(swing.angles(2.0 + 2.0 * 5 / 24, 6.0), ROWS[5], atol=1e-9)
    times = np.arange(0.0, 6.0, 0.02)
    path = np.array([swing.angles(time, 6.0) for time in times])
    # The steepest a sine of this amplitude and period gets, and a little for the ramp.
    assert np.abs(np.diff(path, axis=0)).max() / 0.02 < 1.3 * 0.3 * np.pi


def test_no_path_is_refused():
    for rows, period in (([[1.0]], 2.0), (ROWS, 0.0), (ROWS * np.nan, 2.0)):
        with pytest.raises(ValueError, match="a swing needs"):
            Swing(rows, period)
