# SPDX-License-Identifier: BSD-3-Clause
"""Further features of inverse kinematics: several solutions, free axes, a preferred posture, batches, other arms."""
import math

import numpy as np
import pytest

from arm_kinematics import (
    Budget,
    Chain,
    InvalidPosture,
    InvalidTarget,
    NoSolution,
    Reason,
    Several,
    Target,
    Targets,
    Touch,
    solve,
    solve_all,
    solve_batch,
)
from urdf_model.transforms import axis_rotation, rigid, rotation_angle


def assert_solution(chain, q, target, metres=1.1e-6, radians=1.1e-6):
    tip = chain.fk(q)
    assert np.linalg.norm(tip[:3, 3] - target[:3, 3]) <= metres
    assert rotation_angle(tip[:3, :3].T @ target[:3, :3]) <= radians
    assert (q >= chain.lower).all() and (q <= chain.upper).all()


def poses(chain, count, seed):
    return [chain.fk(q) for q in np.random.default_rng(seed).uniform(chain.lower, chain.upper, (count, len(chain)))]


# -- several solutions ---------------------------------------------------------------------------------------------


def test_distinct_solutions_are_solutions_and_distinct(chain):
    for settle in (True, False):
        several = []
        for target in poses(chain, 40, 41):
            results = solve_all(chain, target, chain.mid_range, Several(8, settle=settle))
            assert 1 <= len(results) <= 8
            for k, result in enumerate(results):
                assert_solution(chain, result.q, target)
                assert all(np.abs(result.q - other.q).max() >= 0.05 for other in results[:k])
            far = [np.linalg.norm(result.q - chain.mid_range) for result in results]
            assert far == sorted(far)
            several.append(len(results))
        assert np.median(several) >= 4


def test_six_axes_have_as_many_solutions_as_the_books_say():
    """A wrist of three crossing axes on shoulder and elbow: the two ways of each make eight (full turns allowed)."""
    joints = [((0, 0, 0.3), (0, 0, 1)), ((0, 0, 0), (0, 1, 0)), ((0.4, 0, 0), (0, 1, 0)), ((0.3, 0, 0), (1, 0, 0)),
              ((0, 0, 0), (0, 1, 0)), ((0, 0, 0), (1, 0, 0))]
    chain = Chain("base", "tip", [
        *(("j%d" % i, "revolute", "l%d" % i, rigid(np.eye(3), origin), axis, -math.pi, math.pi)
          for i, (origin, axis) in enumerate(joints)),
        ("tool", "fixed", "tip", rigid(np.eye(3), (0.1, 0, 0)), (0, 0, 1), None, None)])
    target = chain.fk([0.3, -0.5, 0.8, 0.4, 0.7, -0.2])
    results = solve_all(chain, target, np.zeros(6), 20, budget=Budget(max_starts=1000))
    assert len(results) == 8
    for result in results:
        assert_solution(chain, result.q, target)


def test_first_of_several_is_no_farther_than_the_single_answer(left):
    for target in poses(left, 20, 42):
        one = solve(left, target, left.mid_range, budget=Budget(candidates=200)).q
        several = solve_all(left, target, left.mid_range, 3)
        assert np.linalg.norm(several[0].q - left.mid_range) <= np.linalg.norm(one - left.mid_range) + 1e-4


def test_several_of_an_unreachable_pose_say_why(left):
    with pytest.raises(NoSolution) as caught:
        solve_all(left, rigid(np.eye(3), (3, 0, 0)), left.mid_range, 4)
    assert caught.value.reason is Reason.OUT_OF_REACH
    with pytest.raises(ValueError, match="number of solutions"):
        solve_all(left, left.fk(left.mid_range), left.mid_range, 0)


# -- free axes --------------------------------------------------------------------------------------------------


def test_free_axis_lets_the_tip_turn_about_it_and_nothing_else(chain):
    rng = np.random.default_rng(43)
    turns = []
    for target in poses(chain, 60, 44):
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        tip = chain.fk(solve(chain, Target(target, free_axis=2.0 * axis), chain.mid_range).q)
        np.testing.assert_allclose(tip[:3, 3], target[:3, 3], atol=1.1e-6)
        np.testing.assert_allclose(tip[:3, :3] @ axis, target[:3, :3] @ axis, atol=1.5e-6)
        turns.append(rotation_angle(tip[:3, :3].T @ target[:3, :3]))
    assert np.median(turns) > 0.1  # it uses the given array


def test_free_axis_reaches_what_the_full_pose_does_not(six_axes):
    """The last joint of the desk arm turns about the tip's z: with it locked, only a free z helps."""
    rotations, offsets, _ = six_axes.arrays
    home = np.array([0.3, 0.4, 0.8, 0.2, 0.7, 0.0])
    locked = Chain("base", "tip", [
        *(("j%d" % i, "revolute", "l%d" % i, rigid(rotations[i], offsets[i]), (0, 0, 1),
           *((-0.01, 0.01) if i == 5 else (six_axes.lower[i], six_axes.upper[i]))) for i in range(6)),
        ("tool", "fixed", "tip", rigid(rotations[-1], offsets[-1]), (0, 0, 1), None, None)])
    turned = locked.fk(home) @ rigid(axis_rotation(np.array([0, 0, 1.0]), 1.0), (0, 0, 0))
    with pytest.raises(NoSolution):
        solve(locked, turned, home)
    np.testing.assert_allclose(solve(locked, Target(turned, free_axis=(0, 0, 1)), home).q, home, atol=0.02)


@pytest.mark.parametrize("axis", [(0, 0, 0), (1, 0), "z", (math.nan, 0, 1)])
def test_free_axis_that_is_no_direction_is_refused(left, axis):
    with pytest.raises(ValueError, match="direction|could not convert"):
        solve(left, Target(left.fk(left.mid_range), free_axis=axis), left.mid_range)


# -- the null space ------------------------------------------------------------------------------------------------


def test_posture_draws_the_elbow(left):
    """Seeded the same, two postures to stay near: each answer is nearer to its own."""
    rng = np.random.default_rng(45)
    seed = left.mid_range
    for target in poses(left, 20, 46):
        near, far = rng.uniform(left.lower, left.upper, (2, 7))
        answers = [solve(left, target, seed, posture=posture, budget=Budget(candidates=64)).q
                   for posture in (near, far)]
        for q in answers:
            assert_solution(left, q, target)
        assert np.linalg.norm(answers[0] - near) <= np.linalg.norm(answers[1] - near) + 1e-6
        assert np.linalg.norm(answers[1] - far) <= np.linalg.norm(answers[0] - far) + 1e-6


def test_posture_that_is_a_solution_is_the_answer(chain):
    """Except one or two in a hundred, where the path along the self-motion first leads away."""
    postures = np.random.default_rng(47).uniform(chain.lower, chain.upper, (400, 7))
    missed = 0
    for q in postures:
        found = solve(chain, chain.fk(q), np.clip(q + 0.1, chain.lower, chain.upper), posture=q).q
        missed += np.abs(found - q).max() > 1e-4
    assert missed <= 0.03 * len(postures)


# -- batches -------------------------------------------------------------------------------------------------------


def test_batch_gives_the_answers_of_single_calls_on_any_number_of_threads(chain):
    targets = [*poses(chain, 300, 48), rigid(np.eye(3), (3, 0, 0))]
    seeds = np.random.default_rng(49).uniform(chain.lower, chain.upper, (301, 7))
    result = solve_batch(chain, targets, seeds)
    assert result.solved.tolist() == [True] * 300 + [False]
    assert (result.residual_m[:300] <= 1e-6).all() and result.residual_m[300] > 1.0
    for k in range(300):
        assert result.q[k].tobytes() == solve(chain, targets[k], seeds[k]).q.tobytes()
    np.testing.assert_array_equal(solve_batch(chain, targets, seeds, threads=1).q, result.q)
    assert (result.q >= chain.lower).all() and (result.q <= chain.upper).all()


def test_batch_with_free_axis_and_posture(left):
    targets = poses(left, 20, 50)
    for options in ({"free_axis": (0, 0, 1)}, {"position_only": True}):
        result = solve_batch(left, Targets(targets, **options), left.mid_range, postures=left.lower)
        for q, target in zip(result.q, targets, strict=True):
            expected = solve(left, Target(target, **options), left.mid_range, posture=left.lower).q
            assert q.tobytes() == expected.tobytes()


def test_batch_of_nothing_and_bad_batches(left):
    assert solve_batch(left, np.empty((0, 4, 4)), left.mid_range).q.shape == (0, 7)
    good = np.array(poses(left, 3, 51))
    bad = good.copy()
    bad[1, 0, 3] = math.nan
    with pytest.raises(InvalidTarget, match="target 1 "):
        solve_batch(left, bad, left.mid_range)
    with pytest.raises(InvalidTarget, match="shape"):
        solve_batch(left, good[0], left.mid_range)
    with pytest.raises(InvalidPosture, match="3 finite postures of 7"):
        solve_batch(left, good, np.zeros((2, 7)))
    with pytest.raises(ValueError, match="at least 1"):
        solve_batch(left, good, left.mid_range, budget=Budget(max_starts=0))


# -- other arms ----------------------------------------------------------------------------------------------------


def snake(count):
    axes = [(0, 0, 1), (0, 1, 0), (1, 0, 0)]
    return Chain("base", "l%d" % (count - 1), [
        ("j%d" % i, "prismatic" if i == 4 else "revolute", "l%d" % i, rigid(np.eye(3), (0.15, 0.02, 0.05)), axes[i % 3],
         -0.2 if i == 4 else -2.0, 0.2 if i == 4 else 2.0) for i in range(count)])


@pytest.mark.parametrize("count", [6, 8, 11])
def test_any_number_of_joints(count):
    chain = snake(count)
    for target in poses(chain, 60, 52):
        assert_solution(chain, solve(chain, target, chain.mid_range).q, target)


def test_thousand_poses_of_a_desk_arm(six_axes):
    result = solve_batch(six_axes, poses(six_axes, 1000, 53), six_axes.mid_range, budget=Budget(candidates=1))
    assert result.solved.all()


# -- keeping clear -------------------------------------------------------------------------------------------------


class Fence:
    """A checker that reports a contact for every posture whose first joint is beyond a fence."""

    def __init__(self, fence, with_world=False):
        self._fence, self._with_world = fence, with_world
        self.asked = 0

    def contact(self, joint_names, q):
        self.asked += 1
        return Touch("fore", "post", self._with_world, 0.1) if q[0] > self._fence else None


def test_answer_keeps_clear_where_a_clear_one_exists(left):
    kept = 0
    for q in np.random.default_rng(54).uniform(left.lower, left.upper, (40, 7)):
        target = left.fk(q)
        fence = Fence(q[0] + 1e-6)  # q itself is clear
        plain = solve(left, target, left.mid_range)
        answer = solve(left, target, left.mid_range, checker=fence)
        assert_solution(left, answer.q, target)
        assert answer.q[0] <= q[0] + 1e-6
        if plain.q[0] <= q[0] + 1e-6:
            np.testing.assert_array_equal(answer.q, plain.q)
            assert fence.asked == 1
        else:
            kept += 1
        for other in solve_all(left, target, left.mid_range, 4, checker=fence):
            assert other.q[0] <= q[0] + 1e-6
    assert kept > 5


@pytest.mark.parametrize("with_world, reason", [(False, Reason.SELF_COLLISION), (True, Reason.WORLD_COLLISION)])
def test_pose_that_nothing_clear_reaches_names_the_pair(left, with_world, reason):
    with pytest.raises(NoSolution, match="fore touches post in (\\d+) of the \\1 postures") as caught:
        solve(left, left.fk(left.mid_range), left.mid_range, checker=Fence(-10.0, with_world))
    assert caught.value.reason is reason
    assert caught.value.pair == ("fore", "post")
    with pytest.raises(NoSolution, match="fore touches post"):
        solve_all(left, left.fk(left.mid_range), left.mid_range, 3, checker=Fence(-10.0, with_world))
