# SPDX-License-Identifier: BSD-3-Clause
"""How the arms move: every command mode on the real physics, both limbs at once."""
import numpy as np
import pytest
from std_msgs.msg import Bool, Empty, Float64

from baxter_model import JOINTS
from baxter_sim_hardware.arms import stopping

HEARD = ()

POSITION, VELOCITY, TORQUE, RAW = 1, 2, 3, 4
SIDES = ("left", "right")
NAMES = tuple("%s_%s" % (side, joint) for side in SIDES for joint in JOINTS)
SMALL_MOVE = np.tile([0.2, 0.2, -0.2, 0.2, 0.3, -0.3, 0.3], 2)


def way_of_a_stop(lab):
    """Stopping distance of each joint (14,) [rad] from now, by the joints' torques."""
    return stopping.travel(lab.velocity, lab.plugin._baxter.arms.stopping())


def random_poses(lab, count):
    """`count` postures inside the limits; the first needs more than 50 Nm at s1."""
    rng = np.random.default_rng(7)
    lower, upper = lab.model.lower[lab.arm], lab.model.upper[lab.arm]
    full = lab.model.read_joints()[0].copy()
    poses, heavy = [], None
    while len(poses) < count - 1 or heavy is None:
        pose = rng.uniform(lower, upper)
        full[lab.arm] = pose
        if np.abs(lab.model.gravity_efforts(full)[lab.arm][[1, 8]]).max() > 50.0:
            heavy = pose if heavy is None else heavy
        elif len(poses) < count - 1:
            poses.append(pose)
    return [heavy, *poses]


def test_holds_random_poses(make_lab):
    lab = make_lab(parameters={"enable": True})
    lab.model.set_self_collision_pairs(())  # random postures of two arms may overlap
    for pose in random_poses(lab, 20):
        lab.model.set_joint_positions(lab.arm, pose)
        lab.plugin.joints_set()
        lab.run(0.2)
        position, _, effort = lab.record(1.0)
        assert np.ptp(position, axis=0).max() < 1e-4
        assert np.abs(position - pose).max() < 1e-3
        assert np.all(np.abs(effort) <= lab.effort_limit)


def test_heavy_pose_stays_for_ten_seconds(make_lab):
    lab = make_lab(parameters={"enable": True})
    pose = random_poses(lab, 1)[0]
    lab.model.set_joint_positions(lab.arm, pose)
    lab.plugin.joints_set()
    lab.run(0.2)
    position, _, _ = lab.record(10.0)
    assert np.ptp(position, axis=0).max() < 1e-4 and np.abs(position - pose).max() < 1e-3


def test_position_mode_arrives_without_overshoot_inside_the_velocity_limit(lab):
    goal = lab.position + SMALL_MOVE
    position, velocity, _ = lab.record(1.5, before=lambda lab: lab.command(POSITION, goal))
    assert np.abs(position[-1] - goal).max() < 1e-3
    assert ((position - goal) * np.sign(SMALL_MOVE)).max() < 0.05 * np.abs(SMALL_MOVE).min()
    assert np.all(np.abs(velocity) <= 1.02 * lab.model.max_velocity[lab.arm])


def test_raw_position_follows_a_smooth_stream_at_once(lab):
    start, begin = lab.position, lab.world.time_s

    def goal(time_s):
        return start + SMALL_MOVE * 0.5 * (1.0 - np.cos(np.pi * min(time_s - begin, 1.0)))

    errors = []
    lab.run(1.2, before=lambda lab: lab.command(RAW, goal(lab.world.time_s + 0.002)),
            after=lambda lab: errors.append(lab.position - goal(lab.world.time_s)))
    assert np.abs(errors).max() < 1e-3


def test_raw_position_jumps_are_bounded_by_the_velocity_limit(lab):
    start = lab.position
    goal = start + SMALL_MOVE
    limit = lab.model.max_velocity[lab.arm]
    set_points = []
    lab.run(1.5, before=lambda lab: lab.command(RAW, goal),
            after=lambda lab: set_points.append(lab.plugin._baxter.arms.commanded_velocity))
    assert np.all(np.abs(set_points[:10]) <= limit + 1e-9)
    assert np.abs(lab.position - goal).max() < 1e-3


def test_position_mode_needs_one_message_and_keeps_its_goal(lab):
    goal = lab.position + SMALL_MOVE
    lab.command(POSITION, goal)
    lab.run(3.0)
    assert np.abs(lab.position - goal).max() < 1e-3


@pytest.mark.parametrize("ratio, profile", [(1.0, "sim"), (0.3, "robot"), (0.1, None), (0.0, None), (-1.0, None)])
def test_speed_ratio_scales_position_mode(make_lab, ratio, profile):
    lab = make_lab(parameters={"enable": True, "profile": profile or "sim", "effects": "none"})
    lab.run(0.1)
    if profile is None:
        for side in SIDES:
            lab.send("limb/%s/set_speed_ratio" % side, Float64(ratio))
    start = lab.position
    # Distances that all joints cover in the same time: joints move in step.
    limits = lab.model.max_velocity[lab.arm]
    lab.command(POSITION, start + 0.7 * limits * np.tile([1, 1, 1, 1, 1, -1, 1], 2))
    _, velocity, _ = lab.record(0.5)
    expected = max(ratio, 0.0) * lab.model.max_velocity[lab.arm]
    # The steepest part of the profile needs more than s0's 50 Nm; it catches up later.
    np.testing.assert_allclose(np.abs(velocity).max(axis=0), expected, rtol=0.1, atol=5e-3)


def test_joints_of_one_command_arrive_together_and_return_when_pushed(lab):
    """For any distances: except at the beginning, they stay near the straight line."""
    start, way = lab.position, np.tile([0.2, -0.3, 1.5, 0.4, -0.5, 0.3, 2.0], 2)
    lab.command(POSITION, start + way)
    position, _, _ = lab.record(1.3)
    share = (position - start) / way
    assert np.ptp(share, axis=1).max() < 0.35 and np.ptp(share[350:], axis=1).max() < 0.15
    assert np.abs(position[-1] - start - way).max() < 1e-3
    lab.command(POSITION, (lab.position + 0.5)[:1], names=["left_s0"])
    lab.run(1.0)
    assert lab.position[0] == pytest.approx(position[-1][0] + 0.5, abs=1e-3)


def test_speed_ratio_nan_is_refused(lab):
    lab.send("limb/left/set_speed_ratio", Float64(float("nan")))
    lab.run(0.01)
    assert "speed ratio is nan" in lab.log.lines[-1]
    assert lab.plugin._baxter.arms.speed_ratio("left") == 1.0


def test_velocity_is_reached_and_braked_before_the_joint_limit(lab):
    lab.model.set_self_collision_pairs(())  # the arms' ends are the joints' limits, not each other
    wanted = np.tile([0.5, -0.5, 0.5, 0.5, 1.0, 1.0, -1.0], 2)
    _, velocity, _ = lab.record(0.5, before=lambda lab: lab.command(VELOCITY, wanted))
    np.testing.assert_allclose(velocity[-1], wanted, atol=2e-3)

    def stream(lab):
        lab.command(VELOCITY, wanted)
        for side in SIDES:
            lab.send("limb/%s/suppress_collision_avoidance" % side, Empty())  # it would end at the head

    lab.run(8.0, before=stream)
    ends = np.where(wanted > 0, lab.model.upper[lab.arm], lab.model.lower[lab.arm])
    np.testing.assert_allclose(lab.position, ends, atol=1e-3)
    assert np.abs(lab.velocity).max() < 1e-3


@pytest.mark.parametrize("mode, values", [
    (VELOCITY, np.full(14, 0.3)),
    (TORQUE, np.tile([2.0, 1.0, 1.0, 1.0, 0.2, 0.2, 0.1], 2)),
    (RAW, None),
])
@pytest.mark.parametrize("timeout", [0.2, 0.5])
def test_streams_that_stop_expire_into_a_hold(lab, mode, values, timeout):
    lab.set_timeout(timeout)
    start = lab.position

    def stream(lab):
        lab.command(mode, start + SMALL_MOVE if values is None else values)

    lab.run(0.1, before=stream)
    lab.run(timeout - 0.004)
    assert mode in set(lab.plugin._baxter.arms.modes("left"))
    lab.run(0.004)
    for side in SIDES:
        assert set(lab.plugin._baxter.arms.modes(side)) == {POSITION}
    lab.run(0.3)
    position, velocity, _ = lab.record(1.0)
    assert np.abs(velocity).max() < 1e-3 and np.ptp(position, axis=0).max() < 1e-4


def test_a_stream_expires_only_where_a_command_would_have_been_heard(lab, monkeypatch):
    """A world that is late reads what has come once for several ticks."""
    lab.set_timeout(0.02)
    lab.run(0.01, before=lambda lab: lab.command(VELOCITY, np.full(14, 0.3)))
    arms, count = lab.plugin._baxter.arms, lab.ros.reads()
    monkeypatch.setattr(lab.ros, "reads", lambda: count)
    lab.run(lab.world.time_step_s)
    lab.run(0.04)
    assert set(arms.modes("left")) == {VELOCITY}
    monkeypatch.setattr(lab.ros, "reads", lambda: count + 1)
    lab.command(VELOCITY, np.full(14, 0.3))
    lab.run(0.02)
    assert set(arms.modes("left")) == {VELOCITY}
    for number, mode in ((2, VELOCITY), (3, POSITION)):
        monkeypatch.setattr(lab.ros, "reads", lambda number=number: count + number)
        lab.run(0.02)
        assert set(arms.modes("left")) == {mode}, "a command that came just after a read is there at the next one"


def test_arm_too_heavy_to_brake_in_time_does_not_swing_back(lab):
    """The stretched-out arm turning at full speed overshoots the target of the stop, and then stays there."""
    lab.run(0.4, before=lambda lab: lab.command(VELOCITY, [1.5, 1.5], names=["left_s0", "right_s0"]))
    position, _, _ = lab.record(1.2)
    travelled = position[:, [0, 7]] - position[0, [0, 7]]
    assert np.all(travelled.max(axis=0) - travelled[-1] < 0.01)


@pytest.mark.parametrize("joint", [0, 1, 2, 3, 4, 5, 6])
def test_a_stop_uses_the_torque_that_there_is_and_no_more(lab, joint):
    """One joint at full speed, all others at rest: v^2 / 2 a, with the a that the torques allow."""
    lab.model.set_self_collision_pairs(())
    wanted = np.zeros(14)
    wanted[[joint, joint + 7]] = lab.model.max_velocity[lab.arm][joint]
    lab.run(0.25, before=lambda lab: lab.command(VELOCITY, wanted))
    speed, where = lab.velocity[joint], lab.position
    inertia, bias = lab.plugin._simulated._dynamics(lab.velocity)
    limits, arm = lab.effort_limit[:7], np.ix_(range(7), range(7))
    column = inertia[arm][:, joint]
    # The joint with the least spare torque decides: the moving one, or one that must hold against it.
    hardest = ((stopping.SHARE * limits + np.sign(column) * bias[:7]) / np.abs(column)).min()
    hardest = min(hardest, 16.0 * lab.plugin._baxter.arms._points.acceleration[joint])
    lab.stop()
    position, _, effort = lab.record(0.6)
    travelled = np.abs(position - where).max(axis=0)[joint]
    print("%s: %.4f rad, computed %.4f rad" % (NAMES[joint], travelled, speed * speed / (2.0 * hardest)))
    assert travelled == pytest.approx(speed * speed / (2.0 * hardest), abs=0.003, rel=0.05)
    assert np.all(np.abs(effort) <= lab.effort_limit + 1e-6)


@pytest.mark.parametrize("mode", [POSITION, VELOCITY, TORQUE, RAW])
def test_no_drive_exerts_more_than_its_limit(make_lab, mode):
    """Wild commands, arms that meet, enabling and disabling in motion: the applied effort equals the reported one."""
    lab = make_lab(parameters={"enable": True})
    rng, lower, upper = np.random.default_rng(11), lab.model.lower[lab.arm], lab.model.upper[lab.arm]
    wild = {POSITION: lambda: rng.uniform(lower, upper), RAW: lambda: rng.uniform(lower, upper),
            VELOCITY: lambda: rng.choice([-1.0, 1.0], 14) * lab.model.max_velocity[lab.arm],
            TORQUE: lambda: rng.choice([-1.0, 1.0], 14) * lab.effort_limit}[mode]
    for turn in range(12):
        values = wild()
        _, _, effort = lab.record(0.4, before=lambda lab, values=values: lab.command(mode, values))
        assert np.all(np.abs(effort) <= lab.effort_limit + 1e-6), turn
        for enabled in (False, True):
            lab.send("set_super_enable", Bool(enabled))
            _, _, effort = lab.record(0.1)
            assert np.all(np.abs(effort) <= lab.effort_limit + 1e-6), turn


@pytest.mark.parametrize("seconds", [float("nan"), -1.0, 0.0])
def test_senseless_timeouts_are_refused(lab, seconds):
    lab.set_timeout(seconds)
    lab.run(0.01)
    assert "must be greater than 0" in lab.log.lines[-1]
    assert lab.plugin._baxter.arms.timeout("left") == 0.2


def test_raw_commands_that_come_together_are_one_step_of_their_stream(lab):
    """A client at 200 Hz, of which two commands are read at a time, every 10 ms."""
    start, begin, speed, seen = lab.position, lab.world.time_s, 0.3, []

    def stream(lab):
        now_s = lab.world.time_s - begin
        if lab.world.tick % 5 == 0:
            for ahead_s in (0.005, 0.010):
                lab.command(RAW, start + speed * (now_s + ahead_s))
        if now_s > 0.2:
            seen.append(lab.velocity - speed)

    lab.run(0.4, before=stream)
    assert len(seen) > 50 and np.abs(seen).max() < 0.05


def test_zero_torque_holds_still_for_ten_seconds(lab):
    start = lab.position
    position, _, _ = lab.record(10.0, before=lambda lab: lab.command(TORQUE, np.zeros(14)))
    assert np.abs(position - start).max() < 0.01


def test_torque_accelerates_the_joint_in_its_direction_and_not_beyond_the_velocity_limit(lab):
    limit = lab.model.max_velocity[lab.arm]
    for sign in (1.0, -1.0):
        torque = sign * np.tile([40.0, 0.0, 0.0, 0.0, 0.0, 0.0, 15.0], 2)
        _, velocity, _ = lab.record(0.4, before=lambda lab, torque=torque: lab.command(TORQUE, torque))
        assert np.all(velocity[50, [0, 7]] * sign > 0.2)
        assert np.all(np.abs(velocity[:, [0, 6, 7, 13]]) <= 1.02 * limit[[0, 6, 7, 13]])


def test_torque_beyond_the_effort_limit_is_clamped(lab):
    lab.run(0.05, before=lambda lab: lab.command(TORQUE, np.full(14, 1e6)))
    assert any("clamped to the limits" in line for line in lab.log.lines)
    arms = lab.plugin._baxter.arms
    np.testing.assert_array_equal(arms.commanded_torque, lab.effort_limit)


def test_no_jump_between_any_two_modes(lab):
    modes = (POSITION, VELOCITY, TORQUE, RAW)
    for first in modes:
        for second in modes:
            here = lab.position
            rest = {mode: here if mode in (POSITION, RAW) else np.zeros(14) for mode in modes}
            lab.run(0.1, before=lambda lab, first=first, rest=rest: lab.command(first, rest[first]))
            position, velocity, _ = lab.record(
                0.1, before=lambda lab, second=second, rest=rest: lab.command(second, rest[second]))
            assert np.abs(position - here).max() < 1e-3, (first, second)
            assert np.abs(velocity).max() < 0.02, (first, second)


def test_position_command_of_one_joint_leaves_the_others_goals(lab):
    start = lab.position
    goal = start + SMALL_MOVE
    lab.command(POSITION, goal)
    lab.run(0.05)
    lab.command(POSITION, [start[6] - 0.1, start[7 + 6] - 0.1], names=["left_w2", "right_w2"])
    lab.run(2.0)
    expected = goal.copy()
    expected[[6, 13]] = start[[6, 13]] - 0.1
    assert np.abs(lab.position - expected).max() < 1e-3


def test_two_commands_for_different_joints_in_one_tick_both_count(lab):
    start = lab.position
    lab.command(POSITION, [start[0] + 0.1], names=["left_s0"])
    lab.command(POSITION, [start[6] + 0.1], names=["left_w2"])
    lab.run(1.0)
    expected = start.copy()
    expected[[0, 6]] += 0.1
    assert np.abs(lab.position - expected).max() < 1e-3


@pytest.mark.parametrize("mode, value", [(VELOCITY, 0.3), (TORQUE, 1.0)])
def test_joints_that_a_stream_does_not_name_stop_and_hold(lab, mode, value):
    lab.command(POSITION, lab.position + 3.0 * SMALL_MOVE)
    lab.run(0.2)
    here = lab.position
    others = [i for i in range(7) if i != 6]
    assert np.abs(lab.velocity[others]).min() > 0.3
    lab.run(1.0, before=lambda lab: lab.command(mode, [value], names=["left_w2"]))
    assert np.abs(lab.velocity[others]).max() < 0.02
    assert np.abs(lab.position - here)[others].max() < 0.1  # they stopped on their way
    assert abs(lab.position[6] - here[6]) > 0.1
    assert np.abs(lab.position - here)[7:].max() > 0.2  # the other limb went on


def test_interleaved_streams_of_single_joints_all_run(lab):
    """One message per joint, as some teleoperation nodes send: each keeps its own velocity."""
    names = [name for name in NAMES if name.startswith("left")]

    def stream(lab):
        joint = lab.world.tick % len(names)
        lab.command(VELOCITY, [0.2], names=[names[joint]])

    _, velocity, _ = lab.record(0.4, before=stream)
    np.testing.assert_allclose(velocity[-1][:7], 0.2, atol=5e-3)
    np.testing.assert_allclose(velocity[-1][7:], 0.0, atol=5e-3)


@pytest.mark.parametrize("force, moves", [(20.0, 5e-6), (150.0, 0.1)])
def test_push_deflects_and_the_arm_returns(lab, force, moves):
    start = lab.position

    def push(lab):
        lab.model.apply_wrench("left_gripper", (0.0, force, 0.0), position=lab.model.link_pose("left_gripper").position)

    position, _, _ = lab.record(0.5, before=push)
    assert np.abs(position - start).max() > moves
    lab.run(4.0)
    assert np.abs(lab.position - start).max() < 1e-4


@pytest.mark.parametrize("mode, values", [
    (POSITION, np.tile([1.0, 0.9, 1.0, 1.0, 2.0, -2.0, 2.0], 2)),
    (VELOCITY, np.tile([1.5, 1.0, 1.5, 1.5, 4.0, -4.0, 4.0], 2)),
    (RAW, None),
    (TORQUE, np.tile([15.0, 5.0, 5.0, 5.0, 2.0, -2.0, 0.5], 2)),
])
@pytest.mark.parametrize("end", ["stop", "disable"])
def test_stop_and_disable_halt_any_motion(lab, mode, values, end):
    start, begin = lab.position, lab.world.time_s

    def stream(lab):
        if mode == RAW:
            lab.command(RAW, start + np.tile([1.0, 0.7, 1.0, 1.0, 3.0, -3.0, 3.0], 2) * (lab.world.time_s - begin))
        else:
            lab.command(mode, start + values if mode == POSITION else values)

    lab.run(0.3, before=stream)
    assert np.abs(lab.velocity).max() > 0.5
    where, computed = lab.position, way_of_a_stop(lab)
    if end == "stop":
        lab.stop()
    else:
        lab.enable(False)
    position, velocity, effort = lab.record(0.6, before=stream)
    travelled = np.abs(position - where).max(axis=0)
    print("stopped after %s rad, computed %s rad" % (travelled.round(4), computed.round(4)))
    np.testing.assert_allclose(travelled, computed, atol=0.004 + 0.05 * computed.max())
    assert np.all(np.abs(effort) <= lab.effort_limit + 1e-6)
    assert np.abs(velocity[150:]).max() < 0.01  # 0.3 s later
    # and re-enabling moves nothing
    rest = lab.position
    lab.send("set_super_reset", Empty())
    lab.enable()
    position, _, _ = lab.record(0.5)
    assert np.abs(position - rest).max() < 1e-3


def test_a_far_goal_with_the_physical_robots_speed_ratio(make_lab):
    """0.3 of the velocity limits until a client requests more; both times the arms arrive at their targets."""
    lab = make_lab(pose="neutral", parameters={"enable": True, "profile": "robot", "effects": "none"})
    start, far = lab.position, np.tile([-0.8, 0.6, 1.5, 0.8, 2.5, -1.5, 2.5], 2)
    limits = lab.model.max_velocity[lab.arm]
    for ratio, goal in ((0.3, start + far), (1.0, start)):
        if ratio != 0.3:
            for side in ("left", "right"):
                lab.send("limb/%s/set_speed_ratio" % side, Float64(ratio))
        lab.command(POSITION, goal)
        seconds = (np.abs(goal - lab.position) / (ratio * limits)).max() + 0.6
        position, velocity, _ = lab.record(seconds)
        assert np.abs(position[-1] - goal).max() < 2e-3
        assert (np.abs(velocity).max(axis=0) < 1.02 * ratio * limits + 0.01).all()
        assert (np.abs(velocity).max(axis=0) > 0.95 * ratio * limits).any()


def test_disabled_arms_sink_slowly_if_asked(make_lab):
    lab = make_lab(pose="neutral", parameters={"disabled": "sink"})
    start = lab.position
    _, velocity, _ = lab.record(3.0)
    assert np.abs(lab.position - start)[[1, 8]].min() > 0.1
    assert 0.0 < np.abs(velocity).max() < 0.6
    lab.enable()
    lab.run(0.3)
    held = lab.position
    lab.run(1.0)
    assert np.abs(lab.position - held).max() < 1e-3


def test_disabled_arms_hold_by_default_and_ignore_commands(make_lab):
    lab = make_lab()
    start = lab.position
    lab.run(1.0, before=lambda lab: lab.command(POSITION, start + SMALL_MOVE))
    assert np.abs(lab.position - start).max() < 1e-3
    notes = [line for line in lab.log.lines if "enable_robot.py -e" in line]
    assert len(notes) == 2  # one per limb, then throttled


def test_two_runs_are_bit_identical(make_lab):
    def run():
        lab = make_lab(parameters={"enable": True})
        rng = np.random.default_rng(3)

        def stream(lab):
            if lab.world.tick % 5 == 0:
                lab.command(1 + (lab.world.tick // 200) % 4, rng.uniform(-1.0, 1.0, 14))

        return lab.record(2.0, before=stream)

    np.testing.assert_array_equal(run(), run())
