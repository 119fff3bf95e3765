# SPDX-License-Identifier: BSD-3-Clause
"""The IK service's answer to a seed: where the vendor's steps lead, made exact; else the nearest solution."""
import numpy as np
import pytest

from arm_kinematics import (
    Budget,
    Chain,
    NoSolution,
    Reason,
    Target,
    Touch,
    pose_from_quaternion,
    solve,
    solve_as_vendor,
)
from arm_kinematics.search import Search
from baxter_model import JOINTS, MIRROR_SIGNS
from lab_testing.kdl import kdl_arm
from urdf_model.transforms import rigid, rotation_angle

NEUTRAL = np.array([0.0, -0.55, 0.0, 0.75, 0.0, 1.26, 0.0])
# The labs' request, and the angles that their sheet prints for it.
LAB_POSE = pose_from_quaternion((0.644, 0.0, 0.066), (-0.381, 0.923, -0.015, 0.052))
LAB_ANGLES = np.array([-1.0051802515115758, -1.0358377913378556, -0.33102594774694544, 1.7033657530084771,
                       0.3050684684989051, 0.8610601980794869, -1.4742358938106646])
# A pose above the shoulder, from a posture near neutral: Newton's steps lead the upper arm to the head, and the elbow
# into the torso.
HIGH_POSE = pose_from_quaternion((0.6, 0.3, 0.3), (0.0, 1.0, 0.0, 0.0))
HIGH_SEED = np.array([0.0329, -0.6053, -0.1102, 0.634, 0.0752, 1.3591, 0.0256])
# Ends the search where the vendor's steps end: any posture is exact enough.
AS_IT_ARRIVES = Budget(tolerance_m=1.0, tolerance_rad=1.0)
MIRROR = np.diag([1.0, -1.0, 1.0, 1.0])
SIGNS = np.array([MIRROR_SIGNS[joint] for joint in JOINTS])


class Contact:
    """Touches where ``touches(q)`` says so."""

    def __init__(self, touches):
        self.touches = touches

    def contact(self, joint_names, q):
        return Touch("hand", "body", False, 0.01) if self.touches(q) else None


def assert_exact(chain, q, pose):
    tip = chain.fk(q)
    assert np.linalg.norm(tip[:3, 3] - pose[:3, 3]) <= 1.1e-6
    assert rotation_angle(tip[:3, :3].T @ pose[:3, :3]) <= 1.1e-6
    assert (q >= chain.lower).all() and (q <= chain.upper).all()


@pytest.fixture
def kdl_solve(robot, chain, side):
    """KDL's solver as the vendor's simulator sets it up: (pose (4, 4), seed (n,)) to (n,), or None."""
    kdl, arm = kdl_arm(robot, "base", side + "_gripper")

    def values(q):
        array = kdl.JntArray(len(q))
        for i, value in enumerate(q.tolist()):
            array[i] = value
        return array

    forward, velocity = kdl.ChainFkSolverPos_recursive(arm), kdl.ChainIkSolverVel_pinv(arm)
    solver = kdl.ChainIkSolverPos_NR_JL(arm, values(chain.lower), values(chain.upper), forward, velocity, 1000, 1e-2)

    def answer(pose, seed):
        frame = kdl.Frame(kdl.Rotation(*pose[:3, :3].ravel().tolist()), kdl.Vector(*pose[:3, 3].tolist()))
        q = kdl.JntArray(len(seed))
        return np.array([q[i] for i in range(len(seed))]) if solver.CartToJnt(values(seed), frame, q) >= 0 else None

    answer.of = (forward, velocity, arm)  # the solver only borrows them
    return answer


def test_neutral_leads_to_the_angles_of_the_sheet(chain, side):
    pose = LAB_POSE if side == "left" else MIRROR @ LAB_POSE @ MIRROR
    angles = LAB_ANGLES if side == "left" else SIGNS * LAB_ANGLES
    q = solve_as_vendor(chain, pose, NEUTRAL).q
    np.testing.assert_allclose(q, angles, atol=2e-3)
    assert_exact(chain, q, Target(pose).pose)
    # The sheet's own angles miss the pose, so no exact answer has its last digits.
    assert 0.5e-3 < np.linalg.norm(chain.fk(angles)[:3, 3] - pose[:3, 3]) < 1.5e-3


def test_steps_lead_where_kdls_do(chain, kdl_solve):
    agreed, close = 0, 0
    around = np.clip(NEUTRAL + np.random.default_rng(6).uniform(-1.5, 1.5, (200, 7)), chain.lower, chain.upper)
    poses = [LAB_POSE, *map(chain.fk, around)]
    for pose in poses:
        expected = kdl_solve(pose, NEUTRAL)
        found = Search(chain, Target.of(pose), NEUTRAL, None, AS_IT_ARRIVES).newton()
        if found.arrived and found.iterations <= 20:
            np.testing.assert_allclose(found.q, expected, atol=1e-4)
            close += 1
        agreed += bool(found.arrived) == (expected is not None)
    # After hundreds of steps, the last bit of a number can decide.
    assert agreed >= 0.97 * len(poses) and close >= 100


def test_answers_are_exact_whether_the_steps_arrive_or_not(chain):
    arrived, round_about = 0, 0
    for q in np.random.default_rng(8).uniform(chain.lower, chain.upper, (200, 7)):
        target = Target.of(chain.fk(q))
        result = solve_as_vendor(chain, target, NEUTRAL)
        assert_exact(chain, result.q, target.pose)
        found, nearest = Search(chain, target, NEUTRAL, None, Budget()).newton(), solve(chain, target, NEUTRAL).q
        is_near = (np.abs(found.q - NEUTRAL) - np.abs(nearest - NEUTRAL)).max() <= np.pi / 2
        arrived += found.arrived
        round_about += found.arrived and not is_near
        np.testing.assert_array_equal(result.q, found.q if found.arrived and is_near else nearest)
    assert 80 < arrived < 150 and 20 < round_about < 0.6 * arrived


def test_answers_near_the_seed_are_the_vendors(chain):
    """Poses as programs ask for them: nineteen of twenty times, Newton's steps lead to the nearest configuration."""
    around = np.clip(NEUTRAL + np.random.default_rng(4).uniform(-0.8, 0.8, (200, 7)), chain.lower, chain.upper)
    found = [Search(chain, Target.of(pose), NEUTRAL, None, Budget()).newton() for pose in map(chain.fk, around)]
    kept = [np.array_equal(solve_as_vendor(chain, chain.fk(q), NEUTRAL).q, one.q)
            for q, one in zip(around, found, strict=True) if one.arrived]
    assert len(kept) >= 180 and sum(kept) >= 0.9 * len(kept)


def test_posture_in_which_the_robot_cannot_be_is_not_the_answer(chain, side, own_body):
    pose, seed = (HIGH_POSE, HIGH_SEED) if side == "left" else (MIRROR @ HIGH_POSE @ MIRROR, SIGNS * HIGH_SEED)
    newton = solve_as_vendor(chain, pose, seed).q
    # Either would hold the arm: the field around the head, and the torso.
    assert not own_body(newton) and own_body._is_held(newton)
    assert own_body._checker.contact(chain.joint_names, newton) is not None
    answer = solve_as_vendor(chain, pose, seed, is_possible=own_body).q
    np.testing.assert_array_equal(answer, solve(chain, pose, seed).q)
    assert own_body(answer)
    lab_pose = LAB_POSE if side == "left" else MIRROR @ LAB_POSE @ MIRROR
    np.testing.assert_array_equal(solve_as_vendor(chain, lab_pose, NEUTRAL, is_possible=own_body).q,
                                  solve_as_vendor(chain, lab_pose, NEUTRAL).q)


def test_no_answer_is_impossible_where_the_nearest_solution_is_possible(chain, own_body):
    refused, saved = 0, 0
    for q in np.random.default_rng(11).uniform(chain.lower, chain.upper, (200, 7)):
        pose = chain.fk(q)
        answer, nearest = (own_body(one.q) for one in (
            solve_as_vendor(chain, pose, NEUTRAL, is_possible=own_body), solve(chain, pose, NEUTRAL)))
        assert answer or not nearest
        saved += answer and not nearest
        refused += nearest and not own_body(solve_as_vendor(chain, pose, NEUTRAL).q)
    assert refused > 0 and saved > 0


def test_near_the_seed_the_answer_is_nearly_the_nearest(chain):
    dice, ratios = np.random.default_rng(9), []
    for q in dice.uniform(0.8 * chain.lower, 0.8 * chain.upper, (100, 7)):
        seed = q + dice.uniform(-0.02, 0.02, 7)
        answer, nearest = (function(chain, chain.fk(q), seed).q for function in (solve_as_vendor, solve))
        ratios.append(np.linalg.norm(answer - seed) / np.linalg.norm(nearest - seed))
    assert np.median(ratios) < 1.01 and max(ratios) < 3.0, sorted(ratios)[-10:]


def test_posture_that_touches_is_not_the_answer(left):
    free = solve_as_vendor(left, LAB_POSE, NEUTRAL, checker=Contact(lambda q: False))
    np.testing.assert_array_equal(free.q, solve_as_vendor(left, LAB_POSE, NEUTRAL).q)
    checker = Contact(lambda q: np.abs(q - free.q).max() < 0.1)
    other = solve_as_vendor(left, LAB_POSE, NEUTRAL, checker=checker)
    np.testing.assert_array_equal(other.q, solve(left, LAB_POSE, NEUTRAL, checker=checker).q)


def test_pose_without_a_solution_has_the_reason_of_solve(left):
    with pytest.raises(NoSolution) as failure:
        solve_as_vendor(left, rigid(np.eye(3), (5.0, 0.0, 0.0)), NEUTRAL)
    assert failure.value.reason is Reason.OUT_OF_REACH


def test_joint_without_limits_stays_within_half_a_turn_of_the_seed():
    steps = [("j%d" % i, "continuous", "l%d" % i, rigid(np.eye(3), (1.0 if i else 0.0, 0, 0)), (0, 0, 1), None, None)
             for i in range(3)]
    arm = Chain("base", "tip", [*steps, ("tool", "fixed", "tip", rigid(np.eye(3), (0.5, 0, 0)), (0, 0, 1), None, None)])
    seed, goal = np.array([7.0, 0.5, 0.2]), arm.fk([-0.9, 1.4, 0.8])
    result = solve_as_vendor(arm, goal, seed)
    np.testing.assert_allclose(arm.fk(result.q), goal, atol=2e-6)
    assert np.abs(result.q - seed).max() <= np.pi
