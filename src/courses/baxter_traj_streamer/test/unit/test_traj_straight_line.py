# SPDX-License-Identifier: BSD-3-Clause
"""Straight lines: straight, not turned, within limits, on one branch; and where they end."""
import math
import pathlib
import types

import numpy as np
import pytest

import urdf_model
from arm_kinematics import Chain, solve
from baxter_traj_streamer.curve import interpolate
from baxter_traj_streamer.straight_line import LeavesReach, straight_line

# The expanded model, made by the workspace's set-up.
MODEL = pathlib.Path(__file__).resolve().parents[4] / "baxter/baxter_common/baxter_description/urdf/baxter.urdf"
VELOCITY = np.array([0.5, 0.5, 0.5, 0.5, 1.0, 1.0, 1.0])
ACCELERATION = np.full(7, 2.0)
SPEED = 0.15
# The untucked posture of the left arm; the right one's is its mirror image.
UNTUCKED = np.array([-0.08, -1.0, -1.19, 1.94, 0.67, 1.03, -0.50])
MIRROR = {"left": np.ones(7), "right": np.array([-1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0])}


@pytest.fixture(scope="module")
def robot():
    return urdf_model.parse_urdf(MODEL.read_text(encoding="utf-8"), source=str(MODEL))


@pytest.fixture(params=MIRROR)
def arm(robot, request):
    """The chain, and a posture that is mirrored for the other arm."""
    return Chain.from_robot(robot, "base", "%s_gripper" % request.param), UNTUCKED * MIRROR[request.param]


@pytest.mark.parametrize("displacement", [(0.1, 0.0, 0.0), (0.0, 0.1, 0.0), (0.0, 0.0, -0.2), (0.2, 0.1, -0.1),
                                          (0.0, 0.0, 0.001)])
def test_tip_goes_straight_and_does_not_turn_and_limits_hold(arm, displacement):
    chain, start = arm
    displacement = np.array(displacement)
    length = np.linalg.norm(displacement)
    times, positions, velocities = straight_line(chain, start, displacement).timed(VELOCITY, ACCELERATION, SPEED)
    way = interpolate(times, list(zip(times, positions, velocities, [()] * len(times), strict=True)), start, "fields")
    grid = np.array([way.sample(t) for t in np.arange(0.0, way.end_time, 2e-3)])
    assert (np.abs(grid[:, 1]) <= VELOCITY * 1.001).all()
    assert (np.abs(grid[:, 2]) <= ACCELERATION).all()
    tips = np.array([chain.fk(q) for q in [*grid[:, 0], way.sample(way.end_time)[0]]])
    moved = tips[:, :3, 3] - tips[0, :3, 3]
    along = moved @ displacement / length
    assert np.linalg.norm(moved - np.outer(along, displacement / length), axis=1).max() < 2e-5
    assert np.abs(tips[:, :3, :3] - tips[0, :3, :3]).max() < 2e-5
    assert moved[-1] == pytest.approx(displacement, abs=1e-6)
    # Never backwards, never faster than requested.
    steps = np.diff(along[:-1]) / 2e-3
    assert steps.min() > -1e-6 and steps.max() < SPEED * 1.01
    assert np.abs(np.diff(positions, axis=0)).max() < 0.05


@pytest.mark.parametrize("displacement, reached_m, words", [
    ((2.0, 0.0, 0.0), 0.30, "out of reach"), ((0.0, 0.0, 1.0), 0.44, "w1"), ((-0.5, 0.0, 0.0), 0.35, "e1")])
def test_line_that_leaves_reach_says_where_and_why(arm, displacement, reached_m, words):
    chain, start = arm
    with pytest.raises(LeavesReach) as caught:
        straight_line(chain, start, displacement)
    assert caught.value.reached_m == pytest.approx(reached_m, abs=0.02)
    assert "after %.3f m of %.3f m" % (caught.value.reached_m, caught.value.length_m) in str(caught.value)
    assert words in str(caught.value)
    # It can be followed up to there.
    straight_line(chain, start, np.array(displacement) * (0.98 * caught.value.reached_m / caught.value.length_m))


def test_solutions_on_another_branch_are_the_end_of_the_line(arm, monkeypatch):
    chain, start = arm
    pose = chain.fk(start)

    def solve_with_a_jump(chain, target, *arguments, **options):
        found = solve(chain, target, *arguments, **options)
        if target[2, 3] - pose[2, 3] < -0.0501:
            return types.SimpleNamespace(q=found.q + 0.5 * np.eye(7)[4])
        return found

    monkeypatch.setattr("baxter_traj_streamer.straight_line.solve", solve_with_a_jump)
    with pytest.raises(LeavesReach, match="w0 would have to turn by .* another way of holding the arm") as caught:
        straight_line(chain, start, (0.0, 0.0, -0.1))
    assert caught.value.reached_m == pytest.approx(0.05, abs=0.001)


@pytest.mark.parametrize("displacement", [(0.0, 0.0, 0.0), (math.nan, 0.0, 0.0), (1e-5, 0.0, 0.0), (0.1, 0.2)])
def test_no_line_is_refused(arm, displacement):
    with pytest.raises(ValueError, match="three finite numbers"):
        straight_line(*arm, displacement)
