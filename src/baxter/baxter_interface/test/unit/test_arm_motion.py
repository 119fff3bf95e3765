# SPDX-License-Identifier: BSD-3-Clause
"""The trajectory server's commands to an arm, and when a goal ends."""
import numpy as np
import pytest

from baxter_interface import parameter_tables
from joint_trajectory import BeyondPosition, GoalOutcome, GoalTolerances, Limits, TrajectoryCommand
from joint_trajectory_action.arm_motion import STOP_DURATION_S, ArmMotion, CommandMode, GoalDefaults

NAMES = ["left_%s" % joint for joint in ("s0", "s1", "e0")]
PERIOD = 0.01
LIMITS = Limits(NAMES, [-2.0] * 3, [2.0] * 3, [1.5] * 3, 0.05)
TABLES = {CommandMode.POSITION: parameter_tables.POSITION, CommandMode.VELOCITY: parameter_tables.VELOCITY,
          CommandMode.POSITION_WITH_DYNAMICS: parameter_tables.POSITION_FF}


class Arm:
    """Joints that follow their commands one tick later; those in `stuck` do not."""

    def __init__(self, mode=CommandMode.POSITION_WITH_DYNAMICS, **changes):
        self.mode = mode
        self.motion = ArmMotion(NAMES, mode, PERIOD, LIMITS)
        self.settings = GoalDefaults.from_config(
            {**{p.name: p.default for p in TABLES[mode]}, **changes}, NAMES)
        self.position, self.velocity = np.zeros(3), np.zeros(3)
        self.stuck = np.zeros(3, dtype=bool)
        self.ticks = 0
        self.commands = []

    @property
    def now_s(self):
        return self.ticks * PERIOD

    def go(self, points, names=NAMES, goal="goal", start=None, **options):
        return self.motion.begin(TrajectoryCommand(names, points, start), self.now_s, self.position, goal,
                                 self.settings, **options)

    def run(self, seconds):
        """Returns the verdicts."""
        verdicts = []
        for _ in range(round(seconds / PERIOD)):
            verdict = self.motion.tick(self.now_s, self.position, self.velocity)
            if verdict is not None:
                verdicts.append((self.now_s, verdict))
            command = self.motion.command()
            self.commands.append(command)
            before = self.position.copy()
            for joint, name in enumerate(NAMES):
                if name in command and not self.stuck[joint]:
                    is_velocity = self.mode is CommandMode.VELOCITY
                    self.position[joint] += command[name] * PERIOD if is_velocity else command[name] - before[joint]
            self.velocity = (self.position - before) / PERIOD
            self.ticks += 1
        return verdicts

    def path(self, name):
        return np.array([command[name] for command in self.commands])


def there(*positions):
    return list(positions), [], []


@pytest.mark.parametrize("mode", CommandMode)
def test_goal_is_followed_reached_once_and_held(mode):
    arm = Arm(mode)
    arm.go([(1.0, *there(0.5, -0.5, 0.2)), (2.0, *there(0.5, 0.5, 0.4))])
    verdicts = arm.run(3.0)
    assert [verdict.outcome for _, verdict in verdicts] == [GoalOutcome.SUCCEEDED]
    assert verdicts[0][0] == pytest.approx(2.0, abs=0.03)
    np.testing.assert_allclose(arm.position, [0.5, 0.5, 0.4], atol=1e-3)
    assert arm.motion.engaged and arm.motion.goal is None


@pytest.mark.parametrize("mode", [CommandMode.POSITION, CommandMode.POSITION_WITH_DYNAMICS])
def test_commanded_positions_do_not_jump(mode):
    arm = Arm(mode)
    arm.go([(0.0, *there(0.04, 0.0, 0.0)), (1.0, *there(0.5, -0.5, 0.2)), (1.5, *there(0.5, 0.0, 0.2))])
    arm.run(0.7)
    arm.go([(1.0, *there(-0.2, 0.3, 0.0))])
    arm.run(1.5)
    for name in NAMES:
        assert np.abs(np.diff(arm.path(name), 2)).max() < 0.01, name


def test_only_named_joints_are_commanded_and_a_goal_in_flight_adds_its_own():
    arm = Arm()
    arm.go([(1.0, *there(0.5))], names=NAMES[:1])
    arm.run(0.5)
    assert set(arm.commands[-1]) == {NAMES[0]}
    arm.go([(1.0, *there(0.5))], names=NAMES[1:2])
    arm.run(2.0)
    assert set(arm.commands[-1]) == set(NAMES[:2])
    np.testing.assert_allclose(arm.position, [0.5, 0.5, 0.0], atol=1e-9)
    arm.motion.release()
    arm.go([(1.0, *there(0.1))], names=NAMES[2:])
    arm.run(0.1)
    assert set(arm.commands[-1]) == {NAMES[2]}


def test_dynamics_come_for_all_joints_with_velocities_and_accelerations():
    arm = Arm()
    arm.go([(1.0, *there(0.5))], names=NAMES[:1])
    arm.run(0.3)
    assert arm.motion.output.shape == (3, 3)
    assert (arm.motion.output[:, 0] != 0.0).all() and not arm.motion.output[:, 1:].any()


def test_blocked_joint_fails_the_goal_on_the_way_and_the_arm_stops_where_it_is():
    arm = Arm()
    arm.stuck[1] = True
    arm.go([(2.0, *there(0.5, 1.0, 0.0))])
    (at_s, verdict), = arm.run(2.0)
    assert verdict.outcome is GoalOutcome.PATH_TOLERANCE_VIOLATED
    assert verdict.text.startswith("left_s1 path error 0.35") and "tolerance 0.35" in verdict.text
    assert "at %.3f s" % at_s in verdict.text
    assert arm.motion.engaged
    arm.run(0.5)
    np.testing.assert_allclose(np.diff(arm.path(NAMES[0])[-20:]), 0.0, atol=1e-9)
    assert arm.path(NAMES[1])[-1] == pytest.approx(0.0, abs=1e-9)


def test_goal_tolerance_and_goal_time():
    arm = Arm()
    arm.stuck[2] = True
    arm.go([(1.0, *there(0.0, 0.0, 0.2))], wanted=GoalTolerances(
        goal=[("left_e0", 0.1, 0.0, 0.0)], goal_time_s=0.3))
    (at_s, verdict), = arm.run(2.0)
    assert verdict.outcome is GoalOutcome.GOAL_TOLERANCE_VIOLATED
    assert "left_e0 goal error 0.2" in verdict.text and at_s == pytest.approx(1.32, abs=0.021)


def test_default_goal_tolerance_is_none_and_path_tolerance_can_be_lifted():
    arm = Arm(goal_time=0.0)
    arm.stuck[2] = True
    arm.go([(1.0, *there(0.0, 0.0, 0.9))], wanted=GoalTolerances(path=[("left_e0", -1.0, 0.0, 0.0)]))
    (_, verdict), = arm.run(1.5)
    assert verdict.outcome is GoalOutcome.SUCCEEDED


def test_stop_comes_to_rest_within_its_time():
    arm = Arm()
    arm.go([(2.0, *there(1.0, 1.0, 1.0))])
    arm.run(1.0)
    arm.motion.stop(arm.now_s, arm.position)
    assert arm.motion.goal is None
    assert arm.run(STOP_DURATION_S + 2 * PERIOD) == []
    resting = arm.position.copy()
    arm.run(0.5)
    np.testing.assert_allclose(arm.position, resting, atol=1e-9)
    assert 0.5 < resting[0] < 0.75


def test_refused_goal_leaves_the_one_before_alone():
    arm = Arm()
    arm.go([(1.0, *there(0.5, 0.5, 0.5))], goal="first")
    arm.run(0.5)
    with pytest.raises(BeyondPosition, match="left_s0 would have to be at 2.5"):
        arm.go([(5.0, *there(2.5, 0.0, 0.0))], goal="second")
    assert arm.motion.goal == "first"
    (_, verdict), = arm.run(1.0)
    assert verdict.outcome is GoalOutcome.SUCCEEDED


def test_refused_goal_engages_nothing():
    arm = Arm()
    with pytest.raises(BeyondPosition):
        arm.go([(5.0, *there(2.5, 0.0, 0.0))])
    assert not arm.motion.engaged and arm.motion.goal is None


def test_velocity_mode_corrects_what_is_amiss():
    arm = Arm(CommandMode.VELOCITY, left_s0_kp=4.0)
    arm.go([(2.0, *there(0.5, 0.5, 0.5))])
    arm.run(1.0)
    arm.position[0] += 0.2
    arm.run(3.0)
    np.testing.assert_allclose(arm.position, 0.5, atol=1e-3)


def test_future_start_waits():
    arm = Arm()
    arm.go([(0.0, *there(0.0, 0.0, 0.0)), (1.0, *there(0.5, 0.0, 0.0))], start=1.0)
    arm.run(0.99)
    assert not arm.position.any() and arm.motion.begin_s == 1.0
    (at_s, _), = arm.run(2.0)
    assert at_s == pytest.approx(2.0, abs=0.03)


def test_farthest_joint_from_the_end():
    arm = Arm()
    arm.go([(1.0, *there(0.5, -0.7, 0.5))])
    assert arm.motion.farthest(arm.position) == ("left_s1", pytest.approx(-0.7))


def test_defaults_are_those_of_the_robot():
    """Modes position_w_id, position, velocity: time, stopped velocity, path, goal."""
    found = {mode: Arm(mode).settings for mode in CommandMode}
    for mode, expected in ((CommandMode.POSITION_WITH_DYNAMICS, (0.1, 0.20, 0.35, -1.0)),
                           (CommandMode.POSITION, (0.1, 0.25, 0.2, -1.0)),
                           (CommandMode.VELOCITY, (0.0, -1.0, -1.0, -1.0))):
        settings = found[mode]
        assert (settings.goal_time_s, settings.stopped_velocity, settings.path[0], settings.goal[0]) == expected
    assert found[CommandMode.VELOCITY].gains[:, 0].tolist() == [2.0, 0.0, 0.0]
