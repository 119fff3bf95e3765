# SPDX-License-Identifier: BSD-3-Clause
"""An arm that is moved and recorded: what ends the motion, what is sent then, and what is written down."""
import numpy as np
import pytest
import rospkg

import xacro
from baxter_model import SIDES, poses
from baxter_sysid.errors import SysidError
from baxter_sysid.excitation import PERIOD_S, motion
from baxter_sysid.live import LARGEST_GAP_S, ArmReading, Space, Stopped, record, straight
from urdf_model import parse_urdf


def pose(name, side):
    return np.array(list(poses().angles(name, side).values()))


class FollowingArm:
    """A robot whose joints close an eighth of the way to their set-points at each of its ticks."""

    def __init__(self, position, period_s=PERIOD_S, noise_rad=0.0):
        self.time_s, self.position, self.goal, self.period_s = 7.0, position.copy(), position.copy(), period_s
        self.commands, self.events = [], {}
        self.noise_rad, self.random = noise_rad, np.random.default_rng(0)

    def next(self):
        self.time_s += self.period_s
        self.position += (self.goal - self.position) / 8.0
        event = self.events.get(len(self.commands), "")
        if isinstance(event, BaseException):
            raise event
        return ArmReading(self.time_s, self.position + self.noise_rad * self.random.standard_normal(7), event)

    def command(self, position, raw):
        self.commands.append((np.array(position), raw))
        self.goal = np.array(position)


@pytest.fixture(scope="module")
def space():
    path = rospkg.RosPack().get_path("baxter_description") + "/urdf/baxter.urdf.xacro"
    return Space(parse_urdf(xacro.process_file(path).toxml(), source=path))


@pytest.fixture
def arm():
    return FollowingArm(pose("untucked", "left"))


@pytest.fixture
def points():
    return motion("left", 10.0)


def test_the_arm_goes_to_the_first_set_point_slowly_and_follows_the_rest_raw(arm, points):
    way = straight(arm.position, points[0])
    recording = record(arm, way, points, "left")
    raws = [raw for _, raw in arm.commands]
    first = raws.index(True)
    assert not any(raws[:first]) and all(raws[first:-1]) and not raws[-1]
    steps = np.abs(np.diff([goal for goal, _ in arm.commands[:first]], axis=0)).max()
    assert steps < 1.01 * 0.25 * PERIOD_S
    assert len(recording.time_s) == len(points)
    np.testing.assert_allclose(recording.commanded["left"], points, atol=1e-9)
    assert np.abs(recording.sensed["left"] - points).max() < 8 * np.abs(np.diff(points, axis=0)).max()
    recording.check("it")


def test_a_sensor_with_noise_does_not_look_like_motion(points):
    noisy = FollowingArm(points[0], noise_rad=5e-4)
    record(noisy, straight(points[0], points[0]), points, "left")
    assert noisy.time_s < 7.0 + PERIOD_S * len(points) + 2.0


def test_a_gap_on_the_way_to_the_start_ends_nothing(arm, points):
    way = straight(arm.position, points[0])
    plain = arm.next

    def late():
        if len(arm.commands) == len(way) // 2:
            arm.time_s += 2.0 * LARGEST_GAP_S
        return plain()

    arm.next = late
    assert len(record(arm, way, points, "left").time_s) == len(points)


def test_joint_states_at_other_rates_give_the_same_rows(points):
    slow = FollowingArm(points[0], period_s=0.012)
    recording = record(slow, straight(points[0], points[0]), points, "left")
    assert recording.period_s == pytest.approx(PERIOD_S)
    # But for the corners where the motion halts.
    assert np.sqrt(np.mean((recording.commanded["left"][:len(points)] - points) ** 2)) < 5e-4


@pytest.mark.parametrize("event, said", [
    ("the robot is disabled", "disabled"), ("the left arm is too near to torso", "torso"),
    (KeyboardInterrupt(), None), (SysidError("no answer of the robot"), "no answer")])
def test_what_ends_the_motion_leaves_the_arm_where_it_is(arm, points, event, said):
    way = straight(arm.position, points[0])
    arm.events[len(way) + 600] = event
    with pytest.raises(type(event) if isinstance(event, BaseException) else Stopped, match=said):
        record(arm, way, points, "left")
    if isinstance(event, BaseException):
        # The robot is asked where it is once more; this one has nothing else to say.
        assert len(arm.commands) == len(way) + 600
    else:
        goal, raw = arm.commands[-1]
        assert not raw and np.abs(goal - arm.position).max() < 1e-9


def test_an_arm_is_not_sent_to_where_no_number_says_that_it_is(arm, points):
    way = straight(arm.position, points[0])
    arm.events[len(way) + 600] = "joint states say that left_s0 is at nan rad"
    plain = arm.next

    def broken():
        seen = plain()
        return seen._replace(position=np.full(7, np.nan)) if seen.trouble else seen

    arm.next = broken
    with pytest.raises(Stopped, match="at nan rad"):
        record(arm, way, points, "left")
    assert np.isfinite([goal for goal, _ in arm.commands]).all()


@pytest.mark.parametrize("jump", [LARGEST_GAP_S + 0.05, -1.0])
def test_a_clock_that_stands_still_or_goes_back_ends_it(arm, points, jump):
    way = straight(arm.position, points[0])
    count = len(way) + 400
    plain = arm.next

    def jumping():
        if len(arm.commands) == count:
            arm.time_s += jump
        return plain()

    arm.next = jumping
    with pytest.raises(Stopped, match="joint states went"):
        record(arm, way, points, "left")


def test_an_arm_that_is_held_on_its_way_is_named(arm, points):
    way = straight(arm.position, points[0])
    plain = arm.next

    def held():
        seen = plain()
        arm.position[3] = way[0, 3]
        return seen

    arm.next = held
    with pytest.raises(Stopped, match="e1 is"):
        record(arm, way, points, "left")


def test_the_motion_is_free_around_neutral_and_a_folded_arm_is_refused(space):
    for side in SIDES:
        other, = set(SIDES) - {side}
        space.require_free(side, motion(side, 40.0), pose("neutral", other))
        space.require_free(side, straight(pose("untucked", side), pose("neutral", side)), pose("untucked", other))
        with pytest.raises(SysidError, match="tuck_arms.py -u"):
            space.require_free(side, straight(pose("tucked", side), pose("neutral", side)), pose("tucked", other))


def test_the_other_arm_in_the_way_and_a_joint_s_limit_are_refused(space):
    way = motion("left", 10.0)
    across = pose("neutral", "right")
    across[0] += 1.0
    crossing = way.copy()
    crossing[:, 0] -= 1.2
    with pytest.raises(SysidError, match="right_"):
        space.require_free("left", crossing, across)
    beyond = way.copy()
    beyond[-1, 3] = -0.05
    with pytest.raises(SysidError, match="left_e1"):
        space.require_free("left", beyond, pose("neutral", "right"))
