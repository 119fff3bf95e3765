# SPDX-License-Identifier: BSD-3-Clause
"""Steps of a navigator's wheel."""
import pytest

from baxter_interface.wheel import wheel_steps


@pytest.mark.parametrize("before, after, steps", [
    (0, 0, 0), (0, 1, 1), (1, 0, -1), (255, 0, 1), (0, 255, -1), (250, 4, 10), (4, 250, -10),
    (0, 127, 127), (127, 0, -127)])
def test_steps_cross_the_wrap(before, after, steps):
    assert wheel_steps(before, after) == steps
