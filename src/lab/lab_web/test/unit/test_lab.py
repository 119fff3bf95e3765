# SPDX-License-Identifier: BSD-3-Clause
"""The page's users and the robot: who may move it, how it moves, what stops it. Clock and robot are the test's own."""
import pytest

from lab_web.control import CONNECTION_SILENCE_S, HEARTBEAT_S, SILENCE_S
from lab_web.lab import TICK_S, PageLab, RobotError
from lab_web.motion import LEAD_RAD, RAMP_S, SPEED_SHARE, MotionError, PageJointLimits, PageMotion, limits_of
from urdf_model import parse_urdf

LIMITS = {"left_s0": PageJointLimits(-1.7, 1.7, 1.5), "left_w2": PageJointLimits(-3.0, 3.0, 4.0)}
START = {"left_s0": 0.2, "left_w2": -0.5}


class Robot:
    """Follows its commands at once."""

    poses = {"neutral": {"left_s0": 0.0, "left_w2": 0.0}}

    def __init__(self):
        self.limits = LIMITS
        self.positions = dict(START)
        self.time_s = 0.0
        self.done = []
        self.why = ""
        #: {joint: how far it gets [rad]}
        self.walls = {}

    def measured(self):
        return dict(self.positions)

    def why_not_ready(self):
        return self.why

    def command(self, setpoints):
        self.positions.update({joint: min(angle, self.walls.get(joint, angle)) for joint, angle in setpoints.items()})
        self.done.append("command")

    def explain(self, joint, tell):
        tell("a wall keeps %s" % joint)

    def stop(self):
        self.done.append("stop")
        self.why = "stopped"

    def enable(self):
        self.done.append("enable")

    def disable(self):
        raise RobotError("it cannot")

    def grip(self, side, action):
        self.done.append((side, action))


class Hall:
    """A lab, its robot, its clock, and what the pages were told."""

    def __init__(self):
        self.now_s = 10.0
        self.told, self.rested = [], []
        self.changes = 0
        self.robot = Robot()
        self.lab = PageLab(self.robot, self.change, lambda *told: self.told.append(told), clock=lambda: self.now_s,
                           rested=self.rested.append)

    def change(self):
        self.changes += 1

    def pass_time(self, seconds, beats_of=None, page_answers=True, is_paused=False):
        beat_s = self.now_s
        for _ in range(round(seconds / TICK_S)):
            self.now_s += TICK_S
            if not is_paused:
                self.robot.time_s += TICK_S
            if beats_of is not None and self.now_s - beat_s >= HEARTBEAT_S:
                self.lab.beat(beats_of, page_answers)
                beat_s = self.now_s
            self.lab.tick(TICK_S)

    def codes(self):
        return [code for _, code, _ in self.told]


@pytest.fixture
def hall():
    return Hall()


def move(hall, client=1, may_act=True, **joints):
    hall.lab.serve(client, may_act, {"op": "move", "joints": joints})


def test_a_page_in_control_moves_the_joints_to_their_targets(hall):
    hall.lab.serve(1, True, {"op": "take"})
    move(hall, left_s0=0.5)
    hall.pass_time(3.0, beats_of=1)
    assert hall.robot.positions == {"left_s0": 0.5, "left_w2": -0.5}
    assert not hall.lab.is_moving and hall.told == []


def test_an_arm_stops_within_a_fifth_of_a_second_when_the_page_falls_silent(hall):
    hall.lab.serve(1, True, {"op": "take"})
    move(hall, left_s0=1.5)
    hall.pass_time(0.5, beats_of=1)
    hall.pass_time(0.2)
    stopped_at = dict(hall.robot.positions)
    hall.pass_time(1.0)
    assert hall.robot.positions == stopped_at != START and not hall.lab.is_moving
    assert hall.codes() == ["page_silent"] and SILENCE_S + TICK_S < 0.2
    # Heartbeats alone do not begin it again.
    hall.pass_time(1.0, beats_of=1)
    assert hall.robot.positions == stopped_at


ONE_CLICK = pytest.mark.parametrize("operation", [
    {"op": "pose", "name": "neutral"}, {"op": "go", "joints": {"left_s0": 0.0, "left_w2": 0.0}}], ids=["pose", "go"])


@ONE_CLICK
def test_a_motion_of_one_click_goes_on_while_the_page_is_too_busy_to_answer(hall, operation):
    hall.robot.positions["left_s0"] = -1.7
    hall.lab.serve(1, True, {"op": "take"})
    released = []
    hall.lab.when_lost(lambda: released.append(hall.now_s))
    hall.lab.serve(1, True, operation)
    hall.pass_time(1.5, beats_of=1, page_answers=False)
    # What the page holds ends as ever.
    assert released and released[0] - 10.0 < 0.2
    hall.pass_time(0.9 * CONNECTION_SILENCE_S)
    assert hall.lab.is_moving and hall.told == []
    hall.pass_time(4.0, beats_of=1, page_answers=False)
    assert hall.robot.positions["left_s0"] == 0.0 and hall.told == [] and hall.rested == [1]
    # A stream does not begin, and does not go on.
    move(hall, left_s0=1.0)
    assert hall.codes() == ["page_silent"] and not hall.lab.is_moving


@ONE_CLICK
def test_a_motion_of_one_click_ends_with_the_connection(hall, operation):
    hall.robot.positions["left_s0"] = -1.7
    hall.lab.serve(1, True, {"op": "take"})
    hall.lab.serve(1, True, operation)
    hall.pass_time(CONNECTION_SILENCE_S + 0.05)
    stopped_at = dict(hall.robot.positions)
    hall.pass_time(1.0)
    assert hall.codes() == ["page_silent"] and hall.robot.positions == stopped_at


def test_a_slider_that_takes_over_from_a_click_is_a_stream(hall):
    hall.lab.serve(1, True, {"op": "take"})
    hall.lab.serve(1, True, {"op": "pose", "name": "neutral"})
    move(hall, left_s0=1.5)
    hall.pass_time(0.2, beats_of=1, page_answers=False)
    assert hall.codes() == ["page_silent"] and not hall.lab.is_moving


def test_a_joint_that_something_holds_ends_the_motion_with_the_reason(hall):
    hall.robot.walls["left_s0"] = 0.5
    hall.lab.serve(1, True, {"op": "take"})
    move(hall, left_s0=1.5)
    hall.pass_time(1.5, beats_of=1)
    # A paused simulation holds nothing.
    hall.pass_time(5.0, beats_of=1, is_paused=True)
    assert hall.lab.is_moving and hall.told == []
    hall.pass_time(2.0, beats_of=1)
    (told,) = hall.told
    assert told[:2] == (1, "held") and "left_s0" in told[2] and "a wall keeps left_s0" in told[2]
    assert not hall.lab.is_moving and hall.robot.positions["left_s0"] == 0.5
    # Away from the wall is free.
    move(hall, left_s0=0.0)
    hall.pass_time(4.0, beats_of=1)
    assert hall.robot.positions["left_s0"] == 0.0 and len(hall.told) == 1


def test_a_small_move_of_a_joint_that_is_held_ends_with_the_reason_too(hall):
    hall.robot.walls["left_s0"] = START["left_s0"]
    hall.lab.serve(1, True, {"op": "take"})
    move(hall, left_s0=START["left_s0"] + 0.05)
    hall.pass_time(3.0, beats_of=1)
    assert hall.codes() == ["held"] and not hall.lab.is_moving and hall.rested == []


def test_an_arm_stops_when_the_page_goes(hall):
    hall.lab.serve(1, True, {"op": "take"})
    move(hall, left_s0=1.5)
    hall.pass_time(0.5, beats_of=1)
    hall.lab.gone(1)
    stopped_at = dict(hall.robot.positions)
    hall.pass_time(1.0)
    assert hall.robot.positions == stopped_at and hall.lab.holder is None


@pytest.mark.parametrize("may_act", [True, False])
def test_every_page_may_stop(hall, may_act):
    hall.lab.serve(1, True, {"op": "take"})
    move(hall, left_s0=1.5)
    hall.pass_time(0.5, beats_of=1)
    hall.lab.serve(2, may_act, {"op": "stop"})
    stopped_at = dict(hall.robot.positions)
    hall.pass_time(1.0, beats_of=1)
    assert "stop" in hall.robot.done and hall.robot.positions == stopped_at
    assert hall.told == [(None, "stopped", "a page has pressed stop")]


def test_a_page_that_only_watches_does_nothing_else(hall):
    for operation in ({"op": "take"}, {"op": "enable"}, {"op": "move", "joints": {"left_s0": 0.0}},
                      {"op": "pose", "name": "neutral"}, {"op": "grip", "side": "left", "action": "open"}):
        hall.lab.serve(1, False, operation)
    assert hall.codes() == ["only_watches"] * 5 and hall.robot.done == [] and hall.lab.holder is None


def test_only_the_page_in_control_acts_and_the_last_one_to_take_it_has_it(hall):
    move(hall, 1, left_s0=0.0)
    hall.lab.serve(1, True, {"op": "take"})
    move(hall, 1, left_s0=1.5)
    hall.pass_time(0.1, beats_of=1)
    hall.lab.serve(2, True, {"op": "take"})
    assert hall.lab.holder == 2 and not hall.lab.is_moving and hall.changes == 2
    hall.lab.serve(1, True, {"op": "enable"})
    assert hall.codes() == ["not_in_control", "not_in_control"] and "enable" not in hall.robot.done
    hall.lab.gone(1)
    assert hall.lab.holder == 2
    hall.lab.serve(2, True, {"op": "release"})
    assert hall.lab.holder is None


def test_a_robot_that_is_not_ready_says_why_and_a_motion_ends(hall):
    hall.lab.serve(1, True, {"op": "take"})
    move(hall, left_s0=1.5)
    hall.pass_time(0.2, beats_of=1)
    hall.robot.why = "disabled"
    hall.pass_time(0.1, beats_of=1)
    hall.robot.why = ""
    before = dict(hall.robot.positions)
    hall.pass_time(0.5, beats_of=1)
    assert hall.robot.positions == before and hall.told == [(1, "not_ready", "disabled")]


def test_what_needs_power_is_refused_with_the_reason_while_there_is_none(hall):
    hall.lab.add("nod", lambda *asked: hall.robot.done.append(asked), needs_power=True)
    hall.lab.serve(1, True, {"op": "take"})
    hall.robot.why = "not enabled: enable it"
    grip, nod = {"op": "grip", "side": "left", "action": "open"}, {"op": "nod"}
    for operation in (grip, nod):
        hall.lab.serve(1, True, operation)
    assert hall.told == [(1, "not_ready", "not enabled: enable it")] * 2 and hall.robot.done == []
    hall.robot.why = ""
    for operation in (grip, nod):
        hall.lab.serve(1, True, operation)
    assert hall.robot.done == [("left", "open"), (1, nod)] and len(hall.told) == 2


@pytest.mark.parametrize(("operation", "said"), [
    ({"op": "move", "joints": {"left_s0": 2.0}}, "-1.7000 to 1.7000 is possible"),
    ({"op": "move", "joints": {"left_s0": float("nan")}}, "left_s0 cannot go to nan rad"),
    ({"op": "move", "joints": {"left_s0": 10 ** 400}}, "-1.7000 to 1.7000 is possible"),
    ({"op": "move", "joints": {"left_s0": "1"}}, "a number is expected"),
    ({"op": "move", "joints": {"left_s0": True}}, "a number is expected"),
    ({"op": "move", "joints": {"tail": 0.0}}, "there is no joint 'tail'"),
    ({"op": "move", "joints": {}}, "no joint is named"),
    ({"op": "move"}, "must be an object"),
    ({"op": "pose", "name": "asleep"}, "there are neutral"),
    ({"op": "pose", "name": ["neutral"]}, "there are neutral"),
    ({"op": "disable"}, "it cannot"),
    ({"op": "grip", "side": "left", "action": ["open"]}, "must be texts"),
    ({"op": "dance"}, "unknown operation 'dance'"),
    ({"op": ["take"]}, "unknown operation"),
    ({}, "unknown operation None")])
def test_a_request_that_cannot_be_served_is_answered_with_the_reason(hall, operation, said):
    hall.lab.serve(1, True, {"op": "take"})
    hall.lab.serve(1, True, operation)
    hall.pass_time(0.1, beats_of=1)
    (client, _, text), = hall.told
    assert client == 1 and said in text and hall.robot.positions == START


def test_joints_of_one_request_arrive_together_slower_than_their_limits_and_without_jumps():
    motion = PageMotion(LIMITS)
    motion.aim({"left_s0": 1.2, "left_w2": 2.5}, START)
    seen, measured = [dict(START)], dict(START)
    while motion.is_moving:
        measured.update(motion.step(TICK_S, measured))
        seen.append(dict(measured))
        assert len(seen) < 1000
    assert measured == {"left_s0": 1.2, "left_w2": 2.5}
    for joint, limits in LIMITS.items():
        steps = [abs(after[joint] - before[joint]) / TICK_S for before, after in zip(seen, seen[1:], strict=False)]
        assert max(steps) <= SPEED_SHARE * limits.velocity * 1.05
        assert max(abs(b - a) for a, b in zip(steps, steps[1:], strict=False)) <= SPEED_SHARE * limits.velocity * 0.1
    arrived = [next(number for number, state in enumerate(seen) if abs(state[joint] - measured[joint]) < 0.01)
               for joint in LIMITS]
    assert abs(arrived[0] - arrived[1]) * TICK_S < 0.3


def test_a_target_that_changes_on_the_way_is_followed():
    motion = PageMotion(LIMITS)
    motion.aim({"left_s0": 1.5}, START)
    measured = dict(START)
    for _ in range(100):
        measured.update(motion.step(TICK_S, measured))
    turned = measured["left_s0"]
    motion.aim({"left_s0": -0.3}, measured)
    measured.update(motion.step(TICK_S, measured))
    assert abs(measured["left_s0"] - turned) < 0.01
    for _ in range(1000):
        measured.update(motion.step(TICK_S, measured))
    assert measured["left_s0"] == -0.3


@pytest.mark.parametrize("away", [0.0005, 0.01, -0.0005, -0.1, 0.0])
@pytest.mark.parametrize("others", [{}, {"left_w2": 2.5}])
def test_a_moving_joint_with_a_new_target_nearby_brakes_as_quickly_as_ever(away, others):
    motion, measured = PageMotion(LIMITS), {"left_s0": -1.0, "left_w2": -0.5}
    motion.aim({"left_s0": 1.5}, measured)
    for _ in range(100):
        measured.update(motion.step(TICK_S, measured))
    full = SPEED_SHARE * LIMITS["left_s0"].velocity
    turned = measured["left_s0"]
    target = turned + away
    motion.aim({"left_s0": target, **others}, measured)
    seen = []
    while motion.is_moving:
        measured.update(motion.step(TICK_S, measured))
        seen.append(measured["left_s0"])
        assert len(seen) < 1000
    assert seen[-1] == target
    # The way on which a joint comes to rest from its full speed, and one step.
    assert max(seen) - max(turned, target) <= 0.5 * full * RAMP_S + full * TICK_S
    assert min(seen) >= min(turned, target) - 0.01


def test_the_set_point_waits_for_a_joint_that_is_held():
    motion = PageMotion(LIMITS)
    motion.aim({"left_s0": 1.5}, START)
    for _ in range(500):
        setpoints = motion.step(TICK_S, START)
    assert LEAD_RAD < setpoints["left_s0"] - START["left_s0"] < LEAD_RAD + 0.02


@pytest.mark.parametrize(("behind", "is_free"), [(0.4 * LEAD_RAD, True), (0.9 * LEAD_RAD, False)])
def test_a_joint_that_follows_stops_at_its_set_point_and_one_that_is_held_where_it_is(hall, behind, is_free):
    hall.lab.serve(1, True, {"op": "take"})
    move(hall, left_s0=1.5)
    hall.pass_time(1.0, beats_of=1)
    sent = hall.robot.positions["left_s0"]
    hall.robot.measured = lambda: {"left_s0": sent - behind, "left_w2": -0.5}
    hall.lab.gone(1)
    assert hall.robot.positions == {"left_s0": pytest.approx(sent if is_free else sent - behind), "left_w2": -0.5}


def test_joints_without_bounds_or_speed_cannot_be_moved():
    made = (("bounded", "revolute", 'velocity="2" lower="-1" upper="1"'), ("endless", "continuous", 'velocity="2"'),
            ("slow", "revolute", 'velocity="0" lower="-1" upper="1"'))
    text = "".join('<link name="%s"/><joint name="%s" type="%s"><parent link="a"/><child link="%s"/>'
                   '<limit effort="1" %s/></joint>' % (name, name, kind, name, limit) for name, kind, limit in made)
    joints = parse_urdf('<robot name="r"><link name="a"/>%s</robot>' % text).joints
    assert limits_of(joints, ["bounded", "endless", "slow", "absent"]) == {"bounded": PageJointLimits(-1.0, 1.0, 2.0)}


def test_nothing_changes_where_one_target_of_several_is_wrong():
    motion = PageMotion(LIMITS)
    with pytest.raises(MotionError):
        motion.aim({"left_s0": 1.0, "left_w2": 9.0}, START)
    assert not motion.is_moving


@pytest.mark.parametrize("position", [float("nan"), float("inf")])
def test_a_joint_whose_measured_position_is_no_number_is_not_moved(hall, position):
    hall.lab.serve(1, True, {"op": "take"})
    hall.robot.positions["left_s0"] = position
    move(hall, left_s0=0.5)
    assert [text for _, _, text in hall.told] == ["the position of left_s0 is not known yet"]
    assert not hall.lab.is_moving and hall.robot.done == []


def test_an_arm_that_something_else_has_moved_stays_where_it_is(hall):
    hall.lab.serve(1, True, {"op": "take"})
    move(hall, left_s0=1.5)
    hall.pass_time(2.0, beats_of=1)
    hall.robot.positions.update(START)
    hall.pass_time(0.5, beats_of=1)
    assert hall.robot.positions == START and not hall.lab.is_moving
    assert hall.codes() == ["refused"] and "something else has moved left_s0" in hall.told[0][2]


def test_a_joint_whose_position_is_lost_on_the_way_waits_for_it(hall):
    hall.lab.serve(1, True, {"op": "take"})
    move(hall, left_s0=1.5)
    hall.pass_time(0.5, beats_of=1)
    hall.robot.measured = lambda: {"left_s0": float("nan"), "left_w2": -0.5}
    hall.pass_time(0.1, beats_of=1)
    waits_at = hall.robot.positions["left_s0"]
    hall.pass_time(0.5, beats_of=1)
    assert hall.robot.positions["left_s0"] == waits_at and hall.lab.is_moving
    # Nor is its last position, which is no number, commanded when the motion ends.
    hall.lab.gone(1)
    assert hall.robot.positions == {"left_s0": waits_at, "left_w2": -0.5}


def test_added_operations_are_served_to_the_page_in_control_or_to_all_that_may_act(hall):
    served = []
    hall.lab.add("press", lambda *asked: served.append(asked))
    hall.lab.add("ask", lambda *asked: served.append(asked), needs_control=False)
    press, ask = {"op": "press"}, {"op": "ask"}
    for operation in (press, ask):
        hall.lab.serve(2, False, operation)
    hall.lab.serve(1, True, press)
    hall.lab.serve(1, True, ask)
    hall.lab.serve(1, True, {"op": "take"})
    hall.lab.serve(1, True, press)
    assert served == [(1, ask), (1, press)] and hall.codes() == ["only_watches"] * 2 + ["not_in_control"]


@pytest.mark.parametrize("lose", [
    lambda hall: hall.lab.gone(1), lambda hall: hall.lab.serve(2, True, {"op": "take"}),
    lambda hall: hall.lab.serve(2, False, {"op": "stop"}), lambda hall: hall.pass_time(2.0 * SILENCE_S)])
def test_what_a_page_holds_ends_with_its_control(hall, lose):
    hall.lab.serve(1, True, {"op": "take"})
    hall.pass_time(1.0, beats_of=1)
    released = []
    hall.lab.when_lost(lambda: released.append(hall.now_s))
    hall.pass_time(1.0, beats_of=1)
    assert released == []
    lose(hall)
    assert released
