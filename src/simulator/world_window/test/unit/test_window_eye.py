# SPDX-License-Identifier: BSD-3-Clause
"""The eye orbits, pans and zooms so that the point under the pointer stays there."""
import math

import numpy as np
import pytest

from sensor_renderer.pinhole import Pinhole
from world_window.eye import FARTHEST_M, NEAREST_M, Eye

PINHOLE = Pinhole.from_field_of_view(1000, 700, 1.0, 0.05, 100.0)
POINT = np.array([0.3, -0.4, 0.8])


def seen(eye, point):
    local = np.linalg.inv(eye.pose()) @ [*point, 1.0]
    assert local[2] > 0.0
    return PINHOLE.project([local[:3]])[0]


@pytest.fixture
def eye():
    return Eye.looking_at((3.0, 1.0, 1.5), (0.0, 0.0, 1.0))


def test_an_eye_looks_at_its_target_with_a_level_horizon(eye):
    np.testing.assert_allclose(seen(eye, (0.0, 0.0, 1.0)), (499.5, 349.5), atol=1e-9)
    assert seen(eye, (0.0, 0.0, 1.5))[1] < 300.0  # up is up
    rotation = eye.rotation()
    np.testing.assert_allclose(rotation.T @ rotation, np.eye(3), atol=1e-12)
    assert np.linalg.det(rotation) == pytest.approx(1.0) and rotation[2, 0] == 0.0


def test_orbiting_keeps_the_point_and_its_distance(eye):
    turned = eye.orbited(POINT, 0.7, -0.2)
    np.testing.assert_allclose(seen(turned, POINT), seen(eye, POINT), atol=1e-6)
    assert np.linalg.norm(np.subtract(turned.position, POINT)) == pytest.approx(
        np.linalg.norm(np.subtract(eye.position, POINT)))
    assert turned.yaw == pytest.approx(eye.yaw + 0.7)


def test_no_look_turns_over(eye):
    for up in (-9.0, 9.0):
        assert abs(eye.orbited(POINT, 0.0, up).pitch) < math.pi / 2.0
    straight = Eye.looking_at((0.0, 0.0, 2.0), (0.0, 0.0, 0.0))
    assert abs(straight.pitch) < math.pi / 2.0


def test_panning_moves_the_point_with_the_pointer(eye):
    depth = (np.linalg.inv(eye.pose()) @ [*POINT, 1.0])[2]
    moved = eye.panned(40.0, -25.0, PINHOLE, depth)
    np.testing.assert_allclose(seen(moved, POINT) - seen(eye, POINT), (40.0, -25.0), atol=1e-6)
    assert (moved.yaw, moved.pitch) == (eye.yaw, eye.pitch)


def test_zooming_goes_to_the_point_and_stops_before_it(eye):
    half = eye.zoomed(POINT, 0.5)
    np.testing.assert_allclose(seen(half, POINT), seen(eye, POINT), atol=1e-6)
    assert np.linalg.norm(np.subtract(half.position, POINT)) == pytest.approx(
        0.5 * np.linalg.norm(np.subtract(eye.position, POINT)))
    for _ in range(100):
        half = half.zoomed(POINT, 0.5)
    assert np.linalg.norm(np.subtract(half.position, POINT)) == pytest.approx(NEAREST_M)
    for _ in range(100):
        half = half.zoomed(POINT, 2.0)
    assert np.linalg.norm(half.position) == pytest.approx(FARTHEST_M)
