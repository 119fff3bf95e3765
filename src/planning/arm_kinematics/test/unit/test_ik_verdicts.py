# SPDX-License-Identifier: BSD-3-Clause
"""Unsolvable poses, constructed with a known cause: the verdict finds the cause."""
import numpy as np
import pytest

from arm_kinematics import Budget, Chain, NoSolution, Reason, Target, solve, solve_batch
from urdf_model.transforms import axis_rotation, rigid, rotation_angle

# The share of verdicts that must be right, of each kind of case.
RIGHT = 0.95


def random_rotation(rng):
    axis = rng.normal(size=3)
    return axis_rotation(axis / np.linalg.norm(axis), rng.uniform(0, np.pi))


def verdict(chain, target, seed, **options):
    """The NoSolution of a pose, after general checks of the verdict; None if there is a solution."""
    try:
        solve(chain, target, seed, **options)
    except NoSolution as failure:
        assert (failure.best >= chain.lower).all() and (failure.best <= chain.upper).all()
        np.testing.assert_allclose(failure.nearest, chain.fk(failure.best), atol=1e-12)
        off = np.linalg.norm(failure.nearest[:3, 3] - target[:3, 3])
        assert failure.residual_m == pytest.approx(off, abs=1e-9)
        angle = rotation_angle(failure.nearest[:3, :3].T @ target[:3, :3])
        assert failure.residual_rad == pytest.approx(angle, abs=1e-6)
        assert len(failure.joints) == len(failure.excess)
        assert bool(failure.joints) == (failure.reason is Reason.JOINT_LIMIT)
        return failure
    return None


def assert_mostly(right):
    assert sum(right) >= RIGHT * len(right), "%d of %d are right" % (sum(right), len(right))


def test_millimetres_are_told_as_such_and_a_far_target_is_not(chain):
    home = chain.fk(np.zeros(len(chain.joint_names)))
    for factor, told in ((3.0, False), (1000.0, True)):
        target = home.copy()
        target[:3, 3] *= factor
        with pytest.raises(NoSolution) as caught:
            solve(chain, target, np.zeros(len(chain.joint_names)))
        assert caught.value.reason is Reason.OUT_OF_REACH
        assert ("positions are in metres" in str(caught.value)) == told


def test_pose_beyond_the_outstretched_arm_is_out_of_reach(chain):
    """No joint angles bridge more than the lengths of the links; the nearest pose is no farther than that says."""
    rng = np.random.default_rng(31)
    right = []
    for _ in range(90):
        direction = rng.normal(size=3)
        over = rng.uniform(0.01, 1.0)
        position = chain.shoulder + direction / np.linalg.norm(direction) * (chain.tip_reach_m + over)
        failure = verdict(chain, rigid(random_rotation(rng), position), chain.mid_range)
        assert failure.residual_m >= over
        right.append(failure.reason is Reason.OUT_OF_REACH)
    assert_mostly(right)


def test_orientation_that_takes_the_wrist_out_of_reach_is_out_of_reach(chain):
    rng = np.random.default_rng(32)
    right = []
    while len(right) < 60:
        direction = rng.normal(size=3)
        position = chain.shoulder + direction / np.linalg.norm(direction) * chain.tip_reach_m * rng.uniform(0.8, 0.99)
        rotation = random_rotation(rng)
        wrist = position - rotation @ chain.wrist_in_tip
        if np.linalg.norm(wrist - chain.shoulder) > chain.wrist_reach_m + 0.005:
            failure = verdict(chain, rigid(rotation, position), chain.mid_range)
            right.append(failure.reason is Reason.OUT_OF_REACH)
    assert_mostly(right)


def narrowed(chain, home, joint, half_range, slack):
    """``chain`` with joint number ``joint`` kept within ``half_range`` of home and all others within ``slack``."""
    rotations, offsets, _ = chain.arrays
    steps = []
    for i, name in enumerate(chain.joint_names):
        width = half_range if i == joint else slack
        steps.append((name, "revolute", "l%d" % i, rigid(rotations[i], offsets[i]), (0, 0, 1), home[i] - width,
                      home[i] + width))
    steps.append(("tool", "fixed", "tip", rigid(rotations[-1], offsets[-1]), (0, 0, 1), None, None))
    return Chain("base", "tip", steps)


def bent_postures(chain, rng, count):
    """Postures without two collinear joint axes, because such joints can replace each other."""
    postures = []
    while len(postures) < count:
        q = rng.uniform(chain.lower, chain.upper)
        if np.linalg.svd(chain.jacobian(q), compute_uv=False)[-1] > 0.05:
            postures.append(q)
    return postures


@pytest.mark.parametrize("arm", ["baxter", "six_axes"])
def test_joint_that_stops_short_is_named(left, six_axes, arm):
    """All other joints are nearly locked, so that none of them can replace the joint."""
    chain = left if arm == "baxter" else six_axes
    rng = np.random.default_rng(33)
    right = []
    for joint, name in enumerate(chain.joint_names):
        for home in bent_postures(chain, rng, 16):
            arm = narrowed(chain, home, joint, 0.3, 0.01)
            there = home.copy()
            beyond = rng.uniform(0.2, 0.8) * rng.choice([-1, 1])
            there[joint] += beyond + np.sign(beyond) * 0.3
            failure = verdict(arm, arm.fk(there), home)
            right.append(failure.reason is Reason.JOINT_LIMIT and name in failure.joints
                         and abs(failure.excess[failure.joints.index(name)] - abs(beyond)) < 0.15)
    assert_mostly(right)


def test_limit_of_the_whole_arm_is_named_with_what_would_do(left):
    """With only the named joint's limit removed, the pose is reached, at about the excess of the posture it was built
    from."""
    rng = np.random.default_rng(34)
    right = []
    while len(right) < 60:
        joint = int(rng.choice([0, 1, 3, 5]))
        q = rng.uniform(left.lower, left.upper)
        beyond = rng.uniform(0.1, 0.6)
        q[joint] = left.upper[joint] + beyond
        target = left.fk(q)
        # Counts as wrong only if a search with ten times a request's effort finds no solution inside the limits.
        if solve_batch(left, [target], left.mid_range, budget=Budget(candidates=1, max_starts=2000)).solved[0]:
            continue
        failure = verdict(left, target, left.mid_range)
        if failure.reason is not Reason.JOINT_LIMIT or len(failure.joints) != 1 or failure.excess[0] > 1.05 * beyond:
            right.append(False)
            continue
        index = left.joint_names.index(failure.joints[0])
        lower, upper = left.lower.copy(), left.upper.copy()
        lower[index] -= failure.excess[0] + 1e-3
        upper[index] += failure.excess[0] + 1e-3
        wider = Chain("base", "tip", [
            (name, "revolute", "l%d" % i, rigid(left.arrays[0][i], left.arrays[1][i]), (0, 0, 1), lower[i], upper[i])
            for i, name in enumerate(left.joint_names)]
            + [("tool", "fixed", "tip", rigid(left.arrays[0][-1], left.arrays[1][-1]), (0, 0, 1), None, None)])
        patient = Budget(candidates=1, max_starts=2000)
        right.append(bool(solve_batch(wider, [target], failure.best, budget=patient).solved[0]))
    assert_mostly(right)


def test_budget_that_is_too_small_is_called_that(chain):
    """The pose has a solution, since it was made from one; only the search was cut short."""
    rng = np.random.default_rng(35)
    right = []
    while len(right) < 50:
        target = chain.fk(rng.uniform(chain.lower, chain.upper))
        failure = verdict(chain, target, chain.mid_range, budget=Budget(max_starts=1, max_iterations=3))
        if failure is not None:
            right.append(failure.reason is Reason.NOT_CONVERGED)
    assert_mostly(right)


def test_nearest_pose_in_reach_is_the_nearest(left):
    """A thousand postures around the answer, and a thousand anywhere: none comes nearer, position only."""
    rng = np.random.default_rng(36)
    for _ in range(20):
        direction = rng.normal(size=3)
        position = left.shoulder + direction / np.linalg.norm(direction) * rng.uniform(1.3, 2.0)
        failure = verdict_of_position(left, position)
        around = np.clip(failure.best + rng.normal(0, 0.05, (1000, 7)), left.lower, left.upper)
        anywhere = rng.uniform(left.lower, left.upper, (1000, 7))
        others = [np.linalg.norm(left.fk(q)[:3, 3] - position) for q in (*around, *anywhere)]
        assert failure.residual_m <= min(others) + 1e-4


def verdict_of_position(chain, position):
    with pytest.raises(NoSolution) as caught:
        solve(chain, Target(rigid(np.eye(3), position), position_only=True), chain.mid_range)
    assert caught.value.reason is Reason.OUT_OF_REACH
    return caught.value
