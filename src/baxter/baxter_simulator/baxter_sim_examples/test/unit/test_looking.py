# SPDX-License-Identifier: BSD-3-Clause
"""Looking for a block in drawn pictures, whose truth is known."""
import math

import cv2
import numpy as np
import pytest

from baxter_sim_examples.looking import CameraView, NotSeen, find_block, locate, table_height
from baxter_sim_examples.scene import BLOCK_SIZE_M

TABLE_M = -0.155
SIZE = (640, 400)
K = np.array([[203.0, 0.0, 325.0], [0.0, 204.0, 196.0], [0.0, 0.0, 1.0]])
TABLE_COLOUR, BLOCK_COLOUR, FLOOR_COLOUR = (105, 72, 42), (150, 113, 66), (140, 144, 150)


def camera(x, y, z, tilt=0.0, turn=0.0):
    """(4, 4) pose of a camera that looks down, tilted about its x and turned about the vertical [rad]."""
    down = np.diag([1.0, -1.0, -1.0])
    about_x = np.array([[1, 0, 0], [0, math.cos(tilt), -math.sin(tilt)], [0, math.sin(tilt), math.cos(tilt)]])
    about_z = np.array([[math.cos(turn), -math.sin(turn), 0], [math.sin(turn), math.cos(turn), 0], [0, 0, 1]])
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = about_z @ down @ about_x, (x, y, z)
    return pose


def draw(pose, blocks, noise=2.0, dark=0.4):
    """A picture of the table with blocks (x, y, yaw, side [m])."""
    picture = np.full((SIZE[1], SIZE[0], 3), FLOOR_COLOUR, dtype=np.uint8)

    def pixels(corners):
        points = (np.column_stack([corners, np.ones(len(corners))]) @ np.linalg.inv(pose).T)[:, :3]
        return np.round((points[:, :2] / points[:, 2:]) * np.diag(K)[:2] + K[:2, 2]).astype(np.int32)

    def square(x, y, yaw, side, z):
        at = [(side / 2 * sx, side / 2 * sy) for sx, sy in ((1, 1), (-1, 1), (-1, -1), (1, -1))]
        return np.array([(x + math.cos(yaw) * a - math.sin(yaw) * b, y + math.sin(yaw) * a + math.cos(yaw) * b, z)
                         for a, b in at])

    cv2.fillConvexPoly(picture, pixels(square(1.0, 0.1, 0.0, 0.913, TABLE_M)), TABLE_COLOUR)
    for x, y, yaw, side in blocks:
        cv2.fillConvexPoly(picture, pixels(square(x, y, yaw, side, TABLE_M + BLOCK_SIZE_M)), BLOCK_COLOUR)
    u, v = (np.arange(SIZE[0]) - K[0, 2]) / K[0, 0], (np.arange(SIZE[1]) - K[1, 2]) / K[1, 1]
    tangent2 = u[None, :] ** 2 + v[:, None] ** 2
    light = 1.0 - dark * tangent2 / (1.0 + tangent2)
    noisy = picture * light[:, :, None] + noise * np.random.default_rng(3).standard_normal(picture.shape)
    return CameraView(np.clip(noisy, 0, 255).astype(np.uint8), K, pose)


@pytest.mark.parametrize("x, y, yaw", [(0.6, 0.0, 0.3), (0.75, 0.3, -0.7), (0.68, 0.15, 0.0), (0.62, 0.33, 1.2)])
@pytest.mark.parametrize("tilt, turn", [(0.0, 0.0), (0.1, 0.8), (-0.15, -2.0)])
def test_the_block_is_found_where_it_is(x, y, yaw, tilt, turn):
    view = draw(camera(0.67, 0.15, 0.2, tilt, turn), [(x, y, yaw, BLOCK_SIZE_M)])
    spot = find_block(view, TABLE_M)
    assert math.hypot(spot.x - x, spot.y - y) < 0.003
    quarter = math.pi / 2
    assert abs((spot.yaw - yaw + quarter / 2) % quarter - quarter / 2) < 0.12
    assert spot.z == pytest.approx(TABLE_M + BLOCK_SIZE_M / 2)


def test_things_of_another_size_are_no_block():
    view = draw(camera(0.67, 0.15, 0.2), [(0.6, 0.0, 0.3, 0.09), (0.7, 0.2, 0.0, 0.02)])
    with pytest.raises(NotSeen, match="no block of 40 mm is seen on the table; light patches: .* mm"):
        find_block(view, TABLE_M)
    both = draw(camera(0.67, 0.15, 0.2), [(0.6, 0.0, 0.3, 0.09), (0.72, 0.25, 0.5, BLOCK_SIZE_M)])
    assert math.hypot(find_block(both, TABLE_M).x - 0.72, find_block(both, TABLE_M).y - 0.25) < 0.003


def test_an_empty_table_has_none():
    with pytest.raises(NotSeen, match="light patches: none"):
        find_block(draw(camera(0.67, 0.15, 0.2), []), TABLE_M)


def test_a_wrong_height_is_a_wrong_place():
    """So the table has to be felt before a camera from the side tells where something is."""
    view = draw(camera(0.5, 0.15, 0.2, tilt=0.3), [(0.7, 0.3, 0.0, BLOCK_SIZE_M)])
    right, wrong = find_block(view, TABLE_M), find_block(view, TABLE_M + 0.03)
    assert math.hypot(right.x - 0.7, right.y - 0.3) < 0.003 < math.hypot(wrong.x - 0.7, wrong.y - 0.3)


def test_the_table_is_as_high_as_the_mean_of_the_readings_says():
    readings = [0.3, 0.301, 0.299, 65.535, 0.302, 0.298, 0.05]
    assert table_height(0.145, readings) == pytest.approx(-0.155, abs=0.001)
    with pytest.raises(NotSeen, match="sees no table: 1 of 4 readings"):
        table_height(0.145, [0.3, 65.535, 65.535, 65.535])


def test_noise_of_the_sensor_does_not_lower_the_table():
    """Neither one reading's noise of 3 mm counts, nor the lower one of two places."""
    random, felt = np.random.default_rng(1), []
    arm = Arm((0.62, 0.3, 0.4, BLOCK_SIZE_M), noise=random)
    for _ in range(20):
        arm.places.clear()
        felt.append(locate(arm, (0.67, 0.15), TABLE_M + 0.01).z - TABLE_M - BLOCK_SIZE_M / 2)
    assert abs(np.mean(felt)) < 0.0003 and np.std(felt) < 0.0006


class Arm:
    """An arm over the table with one block, of which the first `hidden` pictures show nothing.

    Its camera is 0.12 m above the tool and 0.04 m beside it, the range sensor as high.
    """

    name = "left"

    def __init__(self, block, hidden=0, noise=None):
        self._block, self._hidden, self._noise, self.places = block, hidden, noise, []

    def ik(self, position, orientation, seed):
        return position

    def move_to(self, angles):
        self.places.append(angles)
        return angles

    def look(self):
        x, y, z = self.places[-1]
        self._hidden -= 1
        return draw(camera(x + 0.04, y, z + 0.12), [] if self._hidden >= 0 else [self._block])

    def feel(self):
        x, y, z = self.places[-1]
        under = math.hypot(x - self._block[0], y - self._block[1]) < 0.03
        top = TABLE_M + (BLOCK_SIZE_M if under else 0.0)
        off = 0.001 * np.arange(-2, 3) if self._noise is None else 0.003 * self._noise.standard_normal(50)
        return z + 0.12, (z + 0.12 - top + off).tolist()


@pytest.mark.parametrize("block, hidden", [
    ((0.62, 0.3, 0.4, BLOCK_SIZE_M), 0), ((0.70, 0.02, -0.2, BLOCK_SIZE_M), 2), ((0.67, 0.15, 0.1, BLOCK_SIZE_M), 0),
    ((0.67, 0.23, 0.1, BLOCK_SIZE_M), 3)])
def test_an_arm_finds_the_block_though_it_lies_below_the_sensor_or_is_hidden(block, hidden):
    """The table's height is known to 2 cm only."""
    arm = Arm(block, hidden)
    spot = locate(arm, (0.67, 0.15), TABLE_M + 0.02)
    assert math.hypot(spot.x - block[0], spot.y - block[1]) < 0.003
    assert spot.z == pytest.approx(TABLE_M + BLOCK_SIZE_M / 2, abs=0.002)
    assert len(arm.places) == 3 + hidden


def test_an_arm_that_sees_nothing_says_so_after_it_has_looked_around():
    arm = Arm((0.62, 0.3, 0.4, BLOCK_SIZE_M), hidden=99)
    with pytest.raises(NotSeen, match="light patches: none"):
        locate(arm, (0.67, 0.15), TABLE_M)
    assert len(arm.places) == 5
