# SPDX-License-Identifier: BSD-3-Clause
"""Making a path shorter, without a robot."""
import numpy as np
import pytest

from motion_planning.planners import NoPath, trees


@pytest.mark.parametrize("seconds_a_try", [1e-5, 1e-3, 0.3])
def test_making_a_path_shorter_ends_at_its_deadline_however_long_a_try_takes(monkeypatch, seconds_a_try):
    now, tries = [0.0], []

    def shorter(path, checker, numbers, effort):
        now[0] += seconds_a_try * effort[0]
        tries.append(effort[0])
        return path

    monkeypatch.setattr(trees, "_shorter", shorter)
    trees.improve(trees.Path(np.zeros((2, 1))), None, trees.TreeSearch(1, 0.1, lambda: now[0]))
    assert sum(tries) == trees.IMPROVING or 0.1 <= now[0] < 0.1 + max(0.005, 4.0 * seconds_a_try)
    assert len(tries) < 100


def test_making_a_path_shorter_can_be_stopped(monkeypatch):
    monkeypatch.setattr(trees, "_shorter", lambda path, *_: path)
    with pytest.raises(NoPath, match="stopped"):
        trees.improve(trees.Path(np.zeros((2, 1))), None, trees.TreeSearch(1, 1.0, lambda: 0.0, lambda: True))
