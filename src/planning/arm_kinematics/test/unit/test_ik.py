# SPDX-License-Identifier: BSD-3-Clause
"""Inverse kinematics arrives, keeps the limits, repeats itself, stays near the seed, and says why it cannot."""
import math
import pickle
import subprocess
import sys

import numpy as np
import pytest

from arm_kinematics import (
    Budget,
    Chain,
    InvalidPosture,
    InvalidTarget,
    NoSolution,
    PostureMap,
    Reason,
    Target,
    pose_from_quaternion,
    solve,
)
from arm_kinematics.posture_map import mirrored
from urdf_model.transforms import rigid, rotation_angle, rpy_matrix

NEUTRAL = np.array([0.0, -0.55, 0.0, 0.75, 0.0, 1.26, 0.0])
# The labs' request.
LAB_POSE = pose_from_quaternion((0.644, 0.0, 0.066), (-0.381, 0.923, -0.015, 0.052))
# The target of the vendor's IK demo.
DEMO_POSES = {
    "left": ((0.657579481614, 0.851981417433, 0.0388352386502),
             (-0.366894936773, 0.885980397775, 0.108155782462, 0.262162481772)),
    "right": ((0.656982770038, -0.852598021641, 0.0388609422173),
              (0.367048116303, 0.885911751787, -0.108908281936, 0.261868353356)),
}


def planar_arm(*limits, length=1.0):
    """Links of equal length in a plane, each joint with (lower, upper) [rad]: its workspace is known."""
    steps = [("j%d" % (i + 1), "revolute", "l%d" % (i + 1), rigid(np.eye(3), (length if i else 0.0, 0, 0)), (0, 0, 1),
              *limit) for i, limit in enumerate(limits)]
    steps.append(("tool", "fixed", "tip", rigid(np.eye(3), (length, 0, 0)), (0, 0, 1), None, None))
    return Chain("base", "tip", steps)


def planar_pose(x, y, heading):
    return rigid(rpy_matrix(0, 0, heading), (x, y, 0))


def assert_on_target(chain, q, target, metres=1.1e-6, radians=1.1e-6):
    tip = chain.fk(q)
    assert np.linalg.norm(tip[:3, 3] - target[:3, 3]) <= metres
    assert rotation_angle(tip[:3, :3].T @ target[:3, :3]) <= radians
    assert (q >= chain.lower).all() and (q <= chain.upper).all()


def test_thousand_reachable_poses_are_reached_within_limits(chain):
    for q in np.random.default_rng(5).uniform(chain.lower, chain.upper, (1000, 7)):
        target = chain.fk(q)
        result = solve(chain, target, chain.mid_range)
        assert_on_target(chain, result.q, target)
        assert result.residual_m <= 1e-6 and result.residual_rad <= 1e-6


def test_poses_at_the_limits_are_reached_without_breaking_them(chain):
    rng = np.random.default_rng(6)
    for q in rng.uniform(chain.lower, chain.upper, (300, 7)):
        pinned = rng.random(7) < 0.4
        q[pinned] = np.where(rng.random(7) < 0.5, chain.lower, chain.upper)[pinned]
        target = chain.fk(q)
        assert_on_target(chain, solve(chain, target, np.clip(q + rng.normal(0, 0.1, 7), -3, 3)).q, target)


def test_lab_request_gives_the_angles_of_the_lab_sheet(left):
    """Seeded at neutral, where the lab's arm is at that moment."""
    for candidates in (1, 2, 32):
        result = solve(left, LAB_POSE, NEUTRAL, budget=Budget(candidates=candidates))
        assert_on_target(left, result.q, LAB_POSE)


def test_demo_poses_are_reached_from_anywhere(chain, side):
    target = pose_from_quaternion(*DEMO_POSES[side])
    for seed in np.random.default_rng(7).uniform(chain.lower, chain.upper, (200, 7)):
        assert_on_target(chain, solve(chain, target, seed).q, target)


def test_seed_that_is_a_solution_is_the_answer(chain):
    for q in np.random.default_rng(8).uniform(chain.lower, chain.upper, (100, 7)):
        np.testing.assert_allclose(solve(chain, chain.fk(q), q, budget=Budget(candidates=8)).q, q, atol=1e-6)


def test_answer_is_the_nearest_to_the_seed_on_its_self_motion(chain):
    """No small step within pose and limits gets nearer."""
    for q in np.random.default_rng(9).uniform(chain.lower, chain.upper, (200, 7)):
        answer = solve(chain, chain.fk(q), NEUTRAL).q
        free = (answer > chain.lower) & (answer < chain.upper)
        _, stretch, directions = np.linalg.svd(chain.jacobian(answer))
        if free.sum() < 7 or stretch[-1] < 0.01:
            continue  # at a limit it may not go on; near a singularity the walk may end early
        still = directions[-1]
        assert abs(still @ (NEUTRAL - answer)) < 1e-3


def test_more_candidates_never_end_farther_from_the_seed(left):
    for q in np.random.default_rng(10).uniform(left.lower, left.upper, (50, 7)):
        distances = [np.linalg.norm(solve(left, left.fk(q), NEUTRAL, budget=Budget(candidates=count)).q - NEUTRAL)
                     for count in (1, 4, 16)]
        assert distances[0] >= distances[1] >= distances[2]


def test_same_request_gives_the_same_bits_in_every_process(left):
    targets = [left.fk(q) for q in np.random.default_rng(11).uniform(left.lower, left.upper, (50, 7))]
    first = [solve(left, target, NEUTRAL).q.tobytes() for target in targets]
    assert first == [solve(left, target, NEUTRAL).q.tobytes() for target in targets]
    code = ("import sys, pickle; from arm_kinematics import solve\n"
            "chain, targets, seed = pickle.load(sys.stdin.buffer)\n"
            "sys.stdout.buffer.write(pickle.dumps([solve(chain, target, seed).q.tobytes() for target in targets]))")
    other = subprocess.run([sys.executable, "-c", code], input=pickle.dumps((left, targets, NEUTRAL)),
                           capture_output=True, check=True)
    assert pickle.loads(other.stdout) == first


def test_seed_outside_the_limits_is_clamped(left):
    result = solve(left, LAB_POSE, np.full(7, 10.0))
    assert_on_target(left, result.q, LAB_POSE)
    np.testing.assert_array_equal(result.q, solve(left, LAB_POSE, left.upper).q)


def test_position_only_leaves_the_orientation_free(left):
    # Pointing backwards there is beyond the wrist, any orientation is not.
    target = rigid(rpy_matrix(0, -math.pi / 2, 0), (1.15, 0.4, 0.2))
    with pytest.raises(NoSolution):
        solve(left, target, NEUTRAL)
    result = solve(left, Target(target, position_only=True), NEUTRAL)
    np.testing.assert_allclose(left.fk(result.q)[:3, 3], target[:3, 3], atol=1.1e-6)


def test_joint_without_limits_stays_within_half_a_turn_of_the_seed():
    chain = planar_arm((None, None), (-2.0, 2.0))
    seed = np.array([20.0, 0.5])
    result = solve(chain, chain.fk([20.4, 0.6]), seed)
    np.testing.assert_allclose(result.q, [20.4, 0.6], atol=1e-5)


@pytest.mark.parametrize(
    "limits, target, reason, joints, text",
    [
        # Two links of 1 m: farther than 2 m.
        ([(-3, 3)] * 2, planar_pose(2.5, 0, 0), Reason.OUT_OF_REACH, (), "beyond the outstretched arm"),
        # In reach, but out of the plane.
        ([(-3, 3)] * 3, rigid(np.eye(3), (1.0, 0, 0.5)), Reason.OUT_OF_REACH, (), "0.5"),
        # The point is in reach, the wrist would have to be 3 m away.
        ([(-3, 3)] * 3, planar_pose(2.2, 0, math.pi / 2), Reason.OUT_OF_REACH, (), "orientation"),
        # Only an elbow folded to 2 rad gets this near, and it stops at 1.
        ([(-3, 3), (-1, 1)], planar_pose(1 + math.cos(2.0), math.sin(2.0), 2.0),
         Reason.JOINT_LIMIT, ("j2",), "upper limit is 1.000"),
        # Behind the back.
        ([(-1, 1), (0, 0.5)], planar_pose(-math.cos(0.2) - 1, math.sin(0.2), math.pi), Reason.JOINT_LIMIT, ("j1",),
         "j1 would have to go to"),
    ])
def test_failure_says_why(limits, target, reason, joints, text):
    chain = planar_arm(*limits)
    with pytest.raises(NoSolution, match=text) as caught:
        solve(chain, target, np.zeros(len(chain)))
    error = caught.value
    assert error.reason is reason
    assert error.joints == joints
    np.testing.assert_array_equal(error.target, target)
    assert error.residual_m > 1e-3 or error.residual_rad > 1e-3
    assert (error.best >= chain.lower).all() and (error.best <= chain.upper).all()


@pytest.mark.parametrize("xyz, quaternion, reason", [
    ((3.0, 0.0, 0.0), (0, 1, 0, 0), Reason.OUT_OF_REACH),
    ((0.6, 0.3, 2.0), (0, 1, 0, 0), Reason.OUT_OF_REACH),
    ((0.6, -0.95, 0.2), (0, 1, 0, 0), Reason.OUT_OF_REACH),
    ((1.15, 0.4, 0.2), (0, -0.7071068, 0, 0.7071068), Reason.OUT_OF_REACH),
])
def test_failure_of_baxter_says_why(left, xyz, quaternion, reason):
    with pytest.raises(NoSolution) as caught:
        solve(left, pose_from_quaternion(xyz, quaternion), NEUTRAL)
    assert caught.value.reason is reason


@pytest.mark.parametrize("posture, joint", [
    ((2.4, -0.3, 0.0, 0.6, 0.0, 0.9, 0.0), "left_s0"),
    ((-0.3, -0.6, 0.2, 3.12, -0.2, 0.9, 0.1), "left_e1"),
    ((-0.3, -0.6, 0.2, 1.0, -0.2, 2.59, 0.1), "left_w1"),
])
def test_joint_limit_of_baxter_is_named(left, posture, joint):
    with pytest.raises(NoSolution, match="%s would have to go to" % joint) as caught:
        solve(left, left.fk(posture), NEUTRAL)
    assert caught.value.reason is Reason.JOINT_LIMIT
    assert joint in caught.value.joints


def test_joint_that_would_have_to_leave_its_range_is_named(left):
    """Lock all other joints, then request a pose that only this joint could reach."""
    for index, name in enumerate(left.joint_names):
        home = left.mid_range
        locked = Chain("base", "tip", [(joint, "revolute", "l%d" % i, *_step(left, i), home[i], home[i])
                                       if i != index else (joint, "revolute", "l%d" % i, *_step(left, i), -0.5, 0.5)
                                       for i, joint in enumerate(left.joint_names)])
        beyond = home.copy()
        beyond[index] = 0.9
        with pytest.raises(NoSolution) as caught:
            solve(locked, locked.fk(beyond), home)
        assert caught.value.reason is Reason.JOINT_LIMIT
        assert name in caught.value.joints


def _step(chain, i):
    rotations, offsets, _ = chain.arrays
    return rigid(rotations[i], offsets[i]), (0, 0, 1)


def test_too_small_a_budget_is_not_mistaken_for_an_unreachable_pose(left):
    with pytest.raises(NoSolution, match="allow more") as caught:
        solve(left, LAB_POSE, NEUTRAL, budget=Budget(max_starts=1, max_iterations=2))
    assert caught.value.reason is Reason.NOT_CONVERGED


@pytest.mark.parametrize("quaternion, text", [
    ((0, 0, 0, 0), "length 0.*identity is 0 0 0 1"), ((0, 0, 0, 2), "length 2"), ((0, 0, 0, 1.02), "length 1.02"),
    ((0, 0, math.nan, 1), "finite"), ((0, 0, math.inf, 1), "finite"), ((1e300, 1e300, 0, 0), "length"),
])
def test_quaternion_that_is_no_rotation_is_refused(quaternion, text):
    with pytest.raises(InvalidTarget, match=text):
        pose_from_quaternion((0.6, 0, 0), quaternion)


def test_rounded_quaternion_is_normalised():
    pose = pose_from_quaternion((1, 2, 3), (-0.381, 0.923, -0.015, 0.052))
    np.testing.assert_allclose(pose[:3, :3] @ pose[:3, :3].T, np.eye(3), atol=1e-12)
    assert pose[:3, 3].tolist() == [1, 2, 3]


@pytest.mark.parametrize("change", [
    lambda m: m.__setitem__((0, 3), math.nan), lambda m: m.__setitem__((0, 3), math.inf),
    lambda m: m.__setitem__((1, 1), math.nan), lambda m: m.__setitem__((slice(3), slice(3)), 0.0),
    lambda m: m.__setitem__((slice(3), 0), -m[:3, 0]), lambda m: m.__setitem__((slice(3), slice(3)), 2 * m[:3, :3]),
])
def test_matrix_that_is_no_pose_is_refused(left, change):
    target = LAB_POSE.copy()
    change(target)
    with pytest.raises(InvalidTarget):
        solve(left, target, NEUTRAL)


def test_target_or_seed_of_the_wrong_shape_is_refused(left):
    with pytest.raises(InvalidTarget, match="4 x 4"):
        solve(left, LAB_POSE[:3], NEUTRAL)
    with pytest.raises(InvalidTarget, match="4 x 4"):
        solve(left, "here", NEUTRAL)
    with pytest.raises(InvalidPosture, match="7 joint values"):
        solve(left, LAB_POSE, NEUTRAL[:6])
    with pytest.raises(InvalidPosture, match="left_s0 = nan"):
        solve(left, LAB_POSE, [math.nan] * 7)


def test_slightly_rounded_matrix_is_accepted(left):
    rounded = np.round(LAB_POSE, 4)
    assert_on_target(left, solve(left, rounded, NEUTRAL).q, rounded, radians=1e-4)


def test_posture_map_returns_the_posture_nearest_the_pose(chain):
    postures = np.random.default_rng(12).uniform(chain.lower, chain.upper, (8, 7))
    table = PostureMap(chain, postures)
    for posture in postures:
        np.testing.assert_array_equal(table.nearest(chain.fk(posture + 0.01)), posture)
    with pytest.raises(InvalidPosture):
        PostureMap(chain, [[0.0] * 6])
    with pytest.raises(ValueError, match="at least one"):
        PostureMap(chain, [])


def test_mirrored_posture_puts_the_other_tip_on_the_other_side(robot):
    left, right = (Chain.from_robot(robot, "base", side + "_gripper") for side in ("left", "right"))
    joints = ("s0", "s1", "e0", "e1", "w0", "w1", "w2")
    for q in np.random.default_rng(13).uniform(left.lower, left.upper, (20, 7)):
        there = right.fk(mirrored(q, joints, ("s0", "e0", "w0", "w2")))[:3, 3]
        np.testing.assert_allclose(there, left.fk(q)[:3, 3] * [1, -1, 1], atol=1e-5)
