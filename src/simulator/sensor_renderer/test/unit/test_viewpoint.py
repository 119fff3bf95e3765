# SPDX-License-Identifier: BSD-3-Clause
"""Cameras outside of the world look where they should, and see all of it."""
import itertools

import numpy as np
import pytest

from sensor_renderer.pinhole import Pinhole
from sensor_renderer.viewpoint import looking_at, overview


def test_camera_looks_at_its_target():
    pose = looking_at((2.0, 1.0, 1.5), (0.2, 0.1, 0.9))
    pinhole = Pinhole.from_field_of_view(640, 480, 0.75, 0.05, 100.0)
    local = np.linalg.inv(pose) @ np.array([[0.2, 0.1, 0.9, 1.0], [0.2, 0.1, 1.0, 1.0]]).T
    middle, above = pinhole.project(local[:3].T)
    np.testing.assert_allclose(middle, (319.5, 239.5), atol=1e-9)
    assert above[1] < middle[1] and above[0] == pytest.approx(middle[0])
    with pytest.raises(ValueError, match="straight up"):
        looking_at((0.0, 0.0, 1.0), (0.0, 0.0, 2.0))


@pytest.mark.parametrize("size", [(1000, 700), (300, 900)])
@pytest.mark.parametrize("high", [(0.4, 1.2, 1.7), (9.0, 0.2, 0.1), (0.03, 0.03, 0.03)])
def test_an_overview_shows_the_whole_box_and_little_more(size, high):
    low, high = -np.array([0.02, 0.5, 0.0]), np.array(high)
    eye, target = overview(low, high, size[0] / size[1], 0.9)
    np.testing.assert_allclose(target, (low + high) / 2.0)
    pinhole = Pinhole.from_field_of_view(*size, 0.9, 0.01, 100.0)
    corners = np.array([(*corner, 1.0) for corner in itertools.product(*zip(low, high, strict=True))])
    local = (np.linalg.inv(looking_at(eye, target)) @ corners.T)[:3].T
    assert (local[:, 2] > 0.0).all()
    aside = np.abs(pinhole.project(local) - np.array(size) / 2.0) / (np.array(size) / 2.0)
    assert 0.85 < aside.max() < 1.0
