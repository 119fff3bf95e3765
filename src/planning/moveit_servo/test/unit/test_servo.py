# SPDX-License-Identifier: BSD-3-Clause
"""The servo alone: moves as told, within its limits, out of singularities, along limits and obstacles."""
import sys
from pathlib import Path

import numpy as np
import pytest

from motion_planning.constraints.regions import rotation_vector
from motion_planning.exact import ExactChecker
from motion_planning.scene import WorldObject
from moveit_servo.servo import ServoCommand, Status
from moveit_servo.settings import SettingsError
from urdf_model import Box

sys.path.insert(0, str(Path(__file__).parents[1]))
from steered_arms import DT, Driven, baxter_model, planar_model, probot_model  # noqa: E402

SIDES = ("left", "right")


@pytest.fixture(scope="module")
def baxter():
    return baxter_model()


@pytest.fixture(scope="module")
def probot():
    return probot_model()


@pytest.fixture(scope="module")
def planar():
    return planar_model()


def arm(model, side, **settings):
    """An arm of Baxter's with a bent elbow."""
    bent = {"s1": -1.0, "e1": 1.7, "w1": 0.8}
    values = {"%s_%s" % (one, joint): value for one in SIDES for joint, value in bent.items()}
    return Driven(model, side + "_arm", values, **settings)


def twist(**parts):
    return np.array([parts.get(name, 0.0) for name in ("x", "y", "z", "rx", "ry", "rz")])


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("row", range(6))
def test_the_hand_moves_as_told(baxter, side, row):
    driven = arm(baxter, side)
    before = driven.tip
    wanted = np.zeros(6)
    wanted[row] = 0.1 if row < 3 else 0.3
    driven.go(ServoCommand(twist=wanted), 1.0)
    moved = np.concatenate([driven.tip[:3, 3] - before[:3, 3], rotation_vector(driven.tip[:3, :3] @ before[:3, :3].T)])
    lost = moved - wanted * (moved @ wanted) / (wanted @ wanted)
    assert 0.85 < moved[row] / wanted[row] <= 1.0  # the rest is the time to speed up
    assert np.abs(lost[:3]).max() < 0.002 and np.abs(lost[3:]).max() < np.radians(0.5)


def test_a_tool_frame_is_given_by_axes(baxter):
    driven = arm(baxter, "left")
    before = driven.tip
    driven.go(ServoCommand(twist=twist(z=0.1), axes=before[:3, :3]), 0.5)
    moved = before[:3, :3].T @ (driven.tip[:3, 3] - before[:3, 3])
    assert moved[2] > 0.04 and np.abs(moved[:2]).max() < 0.002


def test_rows_that_may_drift_do_not_hold_the_others_back(planar):
    driven = Driven(planar, "arm", {"turn0": 0.3, "turn1": 0.8, "turn2": -0.5})
    # Three joints cannot keep six rows; without those that they cannot move, all of the motion is left.
    steps = driven.go(ServoCommand(twist=twist(x=-0.1), drift=np.array([0, 0, 1, 1, 1, 0], dtype=bool)), 0.5)
    assert {step.status for step in steps} == {Status.NO_WARNING}
    other = Driven(planar, "arm", {"turn0": 0.3, "turn1": 0.8, "turn2": -0.5})
    other.go(ServoCommand(twist=twist(x=-0.1), drift=np.array([0, 0, 1, 1, 1, 1], dtype=bool)), 0.5)
    assert other.tip[0, 3] == pytest.approx(driven.tip[0, 3], abs=0.004)


@pytest.mark.parametrize("side", SIDES)
def test_a_stream_that_ends_leaves_the_arm_at_rest_in_time(baxter, side):
    driven = arm(baxter, side)
    fast = np.where(np.arange(7) % 2, 1.0, -1.0) * driven.servo.limits.velocity
    driven.go(ServoCommand(joints=fast), 0.4)
    steps = driven.go(ServoCommand(), driven.servo.settings.stopping_time)
    assert np.abs(steps[-1].velocity).max() < 1e-3
    assert driven.go(ServoCommand(), DT)[-1].rests


def test_stops_in_the_middle_of_speeding_up(baxter):
    for count in range(1, 12):
        driven = arm(baxter, "left")
        driven.go(ServoCommand(joints=driven.servo.limits.velocity), count * DT)
        driven.go(ServoCommand(), 0.1)
        assert np.abs(driven.steps[-1].velocity).max() < 1e-3
        assert max(driven.worst()[:3]) < 1.0 + 1e-6


def test_joint_velocities_beyond_the_limits_keep_their_proportions(baxter):
    driven = arm(baxter, "left")
    wanted = np.linspace(-6.0, 6.0, 7)
    velocity = driven.go(ServoCommand(joints=wanted), 0.3)[-1].velocity
    assert np.abs(velocity - wanted * (velocity @ wanted) / (wanted @ wanted)).max() < 0.01
    assert (np.abs(velocity) / driven.servo.limits.velocity).max() == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize("group", ("left_arm", "manipulator"))
def test_random_streams_keep_all_limits_and_never_end_in_a_dead_end(group, request):
    model = request.getfixturevalue("probot" if group == "manipulator" else "baxter")
    for seed in range(3):
        rng = np.random.default_rng(seed)
        low, high = model.bounds.T
        driven = Driven(model, group, rng.uniform(low, high), max_acceleration=10.0)
        for _ in range(8):
            wanted = rng.normal(size=6) * np.repeat((0.5, 1.0), 3) * rng.integers(0, 2, 6)
            driven.go(ServoCommand(twist=wanted), rng.uniform(0.1, 0.6))
        velocity, acceleration, jerk, room = driven.worst()
        assert max(velocity, acceleration, jerk) < 1.0 + 1e-6, (seed, velocity, acceleration, jerk)
        assert room > min(0.0, np.minimum(driven.steps[0].position - driven.servo.limits.lower,
                                          driven.servo.limits.upper - driven.steps[0].position).min()) - 1e-9, seed
        driven.go(ServoCommand(), 0.2)
        assert any(moves(driven, row, sign) for row in range(6) for sign in (1.0, -1.0)), seed


def moves(driven, row, sign):
    """Whether the hand gets ahead along a row of the twist."""
    before = driven.tip
    driven.go(ServoCommand(twist=0.2 * sign * np.eye(6)[row]), 0.3)
    after = driven.tip
    moved = np.concatenate([after[:3, 3] - before[:3, 3], rotation_vector(after[:3, :3] @ before[:3, :3].T)])
    return sign * moved[row] > 0.01


# -- singularities -----------------------------------------------------------------------------------------------

@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("elbow", (-0.049, 0.0, 0.02))
def test_out_of_a_stretched_arm_in_any_direction(baxter, side, elbow):
    values = {side + "_s0": 0.2, side + "_s1": 0.3, side + "_e0": 0.1, side + "_e1": elbow, side + "_w0": 0.0,
              side + "_w1": 0.6, side + "_w2": 0.0}
    start = Driven(baxter, side + "_arm", values)
    shoulder = start.servo.pose(start.q, side + "_upper_shoulder")[:3, 3]
    inwards = shoulder - start.servo.pose(start.q, side + "_lower_forearm")[:3, 3]
    inwards /= np.linalg.norm(inwards)
    across = np.cross(inwards, (0.0, 0.0, 1.0))
    for direction in (inwards, across / np.linalg.norm(across), np.array((0.0, 0.0, -1.0))):
        driven = Driven(baxter, side + "_arm", values)
        before = driven.tip
        driven.go(ServoCommand(twist=np.concatenate([0.15 * direction, np.zeros(3)])), 2.0)
        assert direction @ (driven.tip[:3, 3] - before[:3, 3]) > 0.15, direction


def test_towards_a_singularity_the_other_directions_go_on(baxter):
    driven = Driven(baxter, "left_arm", {"left_s1": 0.3, "left_e1": 0.3, "left_w1": 0.6})
    shoulder = driven.servo.pose(driven.q, "left_upper_shoulder")[:3, 3]
    wrist = driven.servo.pose(driven.q, "left_lower_forearm")[:3, 3]
    outwards = (wrist - shoulder) / np.linalg.norm(wrist - shoulder)
    across = np.cross(outwards, (0.0, 0.0, 1.0))
    across /= np.linalg.norm(across)
    steps = driven.go(ServoCommand(twist=np.concatenate([0.2 * outwards, np.zeros(3)])), 5.0)
    assert steps[-1].status is Status.HALT_FOR_SINGULARITY and "singularity" in steps[-1].reason
    assert driven.q[baxter.index["left_e1"]] > 0.0
    before = driven.tip
    steps = driven.go(ServoCommand(twist=np.concatenate([0.2 * outwards + 0.1 * across, np.zeros(3)])), 1.0)
    assert across @ (driven.tip[:3, 3] - before[:3, 3]) > 0.08
    assert Status.DECELERATE_FOR_SINGULARITY in {step.status for step in steps}


# -- limits, obstacles ---------------------------------------------------------------------------------------------

def test_slides_along_a_joint_limit(planar):
    driven = Driven(planar, "arm", {"turn0": 2.2, "turn1": 0.9, "turn2": 0.3}, joint_limit_margin=0.1)
    before = driven.tip
    steps = driven.go(ServoCommand(joints=np.array((0.8, -0.3, 0.0))), 1.5)
    assert steps[-1].position[0] == pytest.approx(2.4, abs=0.005)
    assert steps[-1].position[1] == pytest.approx(0.9 - 0.3 * 1.5, abs=0.05)
    assert steps[-1].status is Status.JOINT_BOUND and "turn0" in steps[-1].reason
    assert np.linalg.norm(driven.tip[:3, 3] - before[:3, 3]) > 0.1
    assert driven.go(ServoCommand(joints=np.array((-0.5, 0.0, 0.0))), 0.3)[-1].velocity[0] == pytest.approx(-0.5,
                                                                                                            abs=1e-3)


WALL = WorldObject("wall", np.array([[1.0, 0, 0, 0.2], [0, 1.0, 0, 0.75], [0, 0, 1.0, 0], [0, 0, 0, 1.0]]),
                   ((Box((2.0, 0.2, 0.6)), np.eye(4)),))
PLANE = np.array([0, 0, 1, 1, 1, 1], dtype=bool)


def test_stops_before_an_obstacle_slides_along_it_and_leaves_at_once(planar):
    driven = Driven(planar, "arm", {"turn0": 0.2, "turn1": 0.9, "turn2": -0.6}, [WALL])
    steps = driven.go(ServoCommand(twist=twist(y=0.5), drift=PLANE), 4.0)
    assert steps[-1].status in (Status.HALT_FOR_COLLISION, Status.DECELERATE_FOR_COLLISION) and "cm" in steps[-1].reason
    assert clear(driven)
    x = driven.tip[0, 3]
    steps = driven.go(ServoCommand(twist=twist(x=-0.2, y=0.3), drift=PLANE), 1.0)
    assert driven.tip[0, 3] < x - 0.1 and clear(driven)
    assert Status.DECELERATE_FOR_COLLISION in {step.status for step in steps}
    y = driven.tip[1, 3]
    driven.go(ServoCommand(twist=twist(y=-0.2), drift=PLANE), 0.5)
    assert driven.tip[1, 3] < y - 0.07
    assert max(driven.worst()[:3]) < 1.0 + 1e-6


def clear(driven):
    exact = ExactChecker(driven.model, None)
    states = [driven.model.state(dict(zip(driven.servo.joints, step.position, strict=True))).q
              for step in driven.steps[::10]]
    return exact.first_blocked(driven.scene, np.array(states)) is None


def test_a_body_that_comes_nearer_leaves_less_of_the_approach(baxter):
    from moveit_servo.surroundings import Near

    class Beside:
        def __init__(self, drift):
            self.drift = drift

        def near(self, *_):
            slope = np.zeros((1, len(baxter.groups["left_arm"])))
            slope[0, 0] = -1.0
            return Near(np.array([0.025]), slope, np.array([self.drift]), np.array([True]), False)

        def closed(self, _):
            return False

    speeds = []
    for drift in (0.0, -0.1, -0.5, 0.5):
        driven = arm(baxter, "left")
        driven.servo.surroundings = Beside(drift)
        speeds.append(driven.go(ServoCommand(joints=np.eye(7)[0]), 0.3)[-1].velocity[0])
    assert speeds == pytest.approx([0.2, 0.1, 0.0, 0.2], abs=1e-3)


# -- poses, arms that do not follow ----------------------------------------------------------------------------------

def test_a_far_pose_is_reached_without_a_jump(baxter):
    driven = arm(baxter, "left")
    there = dict(zip(driven.servo.joints, (-0.6, -0.6, -0.4, 1.4, 0.3, 0.7, 0.5), strict=True))
    target = driven.servo.pose(baxter.state(there).q)
    assert np.linalg.norm(driven.tip[:3, 3] - target[:3, 3]) > 0.3
    steps = driven.go(ServoCommand(pose=target), 6.0)
    assert steps[-1].reached and np.linalg.norm(driven.tip[:3, 3] - target[:3, 3]) < 1e-3
    assert max(driven.worst()[:3]) < 1.0 + 1e-6


def test_a_blocked_arm_is_not_pushed_and_the_reason_is_told(baxter):
    driven = arm(baxter, "left")
    driven.follows = False
    steps = driven.go(ServoCommand(joints=np.eye(7)[1] * 0.5), 2.0)
    lead = steps[-1].position - driven.q[driven.indices]
    assert 0.05 < lead[1] < 0.2 and steps[-1].status is Status.JOINT_BOUND
    assert "left_s1" in steps[-1].reason and "enabled" in steps[-1].reason
    # When the arm has been moved by others meanwhile, a new motion begins where it is.
    driven.go(ServoCommand(), 0.3)
    driven.q[driven.indices] += 0.4
    driven.follows = True
    step = driven.go(ServoCommand(joints=np.eye(7)[1] * 0.5), DT)[-1]
    assert step.position == pytest.approx(driven.q[driven.indices], abs=1e-3)


def test_a_group_that_is_no_chain_is_refused(baxter):
    with pytest.raises(SettingsError, match="left_arm"):
        Driven(baxter, "both_arms", {})
    with pytest.raises(SettingsError, match="nothing.*left_arm"):
        Driven(baxter, "nothing", {})
    with pytest.raises(SettingsError, match="left_w2"):
        arm(baxter, "left", max_acceleration={"left_" + name: 9.0 for name in ("s0", "s1", "e0", "e1", "w0", "w1")})


def test_an_arm_that_others_move_goes_on_from_where_it_is(planar):
    """As by a cuff that is squeezed while the arm is steered, or by a simulator that puts it elsewhere."""
    driven = Driven(planar, "arm", {"turn0": 0.3, "turn1": 0.8, "turn2": -0.5})
    command = ServoCommand(joints=np.array([0.5, 0.0, 0.0]))
    driven.go(command, 0.5)
    driven.q[driven.indices] += (0.0, -1.0, 0.2)
    begin, (first, *rest) = driven.q[driven.indices], driven.go(command, 0.5)
    assert np.abs(first.position - begin).max() < 0.01 and np.abs(first.velocity).max() < 0.1
    assert first.status is Status.JOINT_BOUND and "turn1 was moved by others, 1.00 rad" in first.reason
    assert rest[-1].status is Status.NO_WARNING and rest[-1].position[0] > begin[0] + 0.15
    driven.follows = False
    driven.q[driven.indices] += 1.0
    last = driven.go(ServoCommand(), DT)[-1]
    assert last.rests and last.position == pytest.approx(driven.q[driven.indices]) and "moved by others" in last.reason


def test_of_directions_that_may_all_drift_x_counts(planar):
    """As in MoveIt's node; an error ended each step."""
    driven = Driven(planar, "arm", {"turn0": 0.3, "turn1": 0.8, "turn2": -0.5})
    before = driven.tip[:3, 3]
    steps = driven.go(ServoCommand(twist=twist(x=-0.1, y=0.3), drift=np.ones(6, dtype=bool)), 0.5)
    assert driven.tip[0, 3] == pytest.approx(before[0] - 0.05, abs=0.01) and steps[-1].status is Status.NO_WARNING


def test_an_arm_of_few_joints_turns_its_hand_and_says_what_it_cannot_do(planar):
    driven = Driven(planar, "arm", {"turn0": 0.3, "turn1": 0.8, "turn2": -0.5})
    before = driven.tip
    steps = driven.go(ServoCommand(twist=twist(rz=0.3)), 0.5)
    turn = rotation_vector(driven.tip[:3, :3] @ before[:3, :3].T)
    assert turn == pytest.approx([0.0, 0.0, 0.14], abs=0.02) and steps[-1].status is Status.NO_WARNING
    assert driven.tip[:3, 3] == pytest.approx(before[:3, 3], abs=0.002)
    last = driven.go(ServoCommand(twist=twist(z=0.1)), 0.5)[-1]
    assert last.status is Status.HALT_FOR_SINGULARITY and "3 joints cannot move the hand" in last.reason
