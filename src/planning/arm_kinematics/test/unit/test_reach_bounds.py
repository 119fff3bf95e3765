# SPDX-License-Identifier: BSD-3-Clause
"""Balls around an arm's tip and wrist: no posture leaves them, and they are small."""
import math

import numpy as np
import pytest

from arm_kinematics import Chain
from arm_kinematics.reach_bounds import balls, beyond
from urdf_model.transforms import rigid, rpy_matrix

_COUNT = 4000


def tips(chain, rng):
    low, high = np.clip(chain.lower, -math.pi, math.pi), np.clip(chain.upper, -math.pi, math.pi)
    return np.array([chain.fk(q) for q in rng.uniform(low, high, (_COUNT, len(chain)))])


def random_chain(rng):
    """Joints of any kind in any places, some of their axes through one point."""
    steps = []
    for i in range(int(rng.integers(1, 8))):
        kind = rng.choice(["revolute", "continuous", "prismatic"], p=[0.6, 0.2, 0.2])
        origin = rigid(rpy_matrix(*rng.uniform(-3, 3, 3)), rng.uniform(-0.4, 0.4, 3) * rng.integers(0, 2))
        steps.append(("j%d" % i, kind, "l%d" % i, origin, rng.normal(size=3), -0.8, 2.0))
    steps.append(("end", "fixed", "tip", rigid(rpy_matrix(*rng.uniform(-3, 3, 3)), rng.uniform(-0.2, 0.2, 3)),
                  (0, 0, 1), None, None))
    return Chain("base", "tip", steps)


@pytest.mark.parametrize("seed", range(40))
def test_no_posture_of_any_arm_is_outside(seed):
    rng = np.random.default_rng(seed)
    chain = random_chain(rng)
    assert not beyond(balls(chain), tips(chain, rng)).any()


def test_balls_of_baxter_and_of_a_desk_arm_are_small(chain, six_axes):
    """The farthest of random postures is nearly on them."""
    for arm in (chain, six_axes):
        poses = tips(arm, np.random.default_rng(1))
        found = balls(arm)
        assert len(found) == 2
        for ball in found:
            points = poses[:, :3, 3] + poses[:, :3, :3] @ ball.in_tip
            assert 0.93 * ball.radius < np.linalg.norm(points - ball.centre, axis=1).max() <= ball.radius


def test_poses_beyond_are_found(left):
    poses = tips(left, np.random.default_rng(3))
    poses[:, :3, 3] += 1.5 * (poses[:, :3, 3] - left.shoulder)
    assert beyond(balls(left), poses).mean() > 0.8
