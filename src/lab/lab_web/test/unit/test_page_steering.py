# SPDX-License-Identifier: BSD-3-Clause
"""Arms that pages steer: only while something is held, and by the rules of the lab. Servos of the test's own."""
import numpy as np
import pytest
from test_lab import Hall, move

from lab_web.control import SILENCE_S
from lab_web.lab import TICK_S
from lab_web.steering import FRESH_S, SteeredMotion, operation

UP = [0, 0, 1, 0, 0, 0]


class Servo:
    def __init__(self):
        self.is_there, self.reason, self.sent, self.speeds = True, "", [], (0.2, 0.6)

    def steer(self, twist, in_tool):
        self.sent.append((twist.tolist(), in_tool))

    @property
    def moves(self):
        """Whether the last twist is one."""
        return bool(self.sent) and any(self.sent[-1][0])


class Steered(Hall):
    """A lab whose page 1 has the control, with a servo for each arm."""

    def __init__(self):
        super().__init__()
        self.servos, self.explained = {side: Servo() for side in ("left", "right")}, []
        #: Of both hands.
        self.pose = np.eye(4)
        self.steering = SteeredMotion(lambda: self.servos, self.explained.append, lambda side, measured: self.pose)
        self.lab.add("steer", operation(self.lab, self.steering, lambda: self.servos))
        self.lab.serve(1, True, {"op": "take"})

    def steer(self, client=1, tool=False, **hands):
        self.lab.serve(client, True, {"op": "steer", "hands": hands, "tool": tool})

    def hold(self, seconds, **hands):
        """As a page that sends every 50 ms what it holds."""
        for _ in range(round(seconds / 0.05)):
            self.steer(**hands)
            self.pass_time(0.05, beats_of=1)


@pytest.fixture
def hall():
    return Steered()


def test_both_hands_move_while_they_are_held_and_rest_when_they_are_let_go(hall):
    hall.hold(1.0, left=UP, right=[0.5, 0, 0, 0, 0, 0])
    left, right = hall.servos["left"], hall.servos["right"]
    assert left.sent[-1] == (UP, False) and right.moves and len(left.sent) > 0.9 / TICK_S
    hall.steer(right=UP, tool=True)
    assert not left.moves
    hall.pass_time(0.02, beats_of=1)
    assert right.sent[-1] == (UP, True)
    hall.steer()
    assert not right.moves
    sent = len(right.sent)
    hall.pass_time(1.0, beats_of=1)
    assert len(right.sent) == sent and hall.told == [] and hall.rested == [1] and not hall.lab.is_moving


@pytest.mark.parametrize("lose", [
    lambda hall: hall.lab.gone(1), lambda hall: hall.lab.serve(2, True, {"op": "take"}),
    lambda hall: hall.lab.serve(2, False, {"op": "stop"}), lambda hall: hall.pass_time(SILENCE_S + 2.0 * TICK_S),
    # Its connection speaks for the page, and says nothing of what is held.
    lambda hall: hall.pass_time(FRESH_S + 2.0 * TICK_S, beats_of=1),
    lambda hall: hall.pass_time(SILENCE_S + 2.0 * TICK_S, beats_of=1, page_answers=False),
    lambda hall: move(hall, left_s0=0.0), lambda hall: hall.lab.serve(1, True, {"op": "pose", "name": "neutral"})])
def test_an_arm_rests_when_its_page_is_lost_or_moves_it_otherwise(hall, lose):
    hall.hold(0.5, left=UP)
    assert hall.servos["left"].moves
    lose(hall)
    assert not hall.servos["left"].moves


def test_a_robot_that_is_not_ready_ends_it_with_the_reason(hall):
    hall.hold(0.5, left=UP)
    hall.robot.why = "not enabled: enable it"
    hall.pass_time(0.02, beats_of=1)
    assert not hall.servos["left"].moves and hall.told == [(1, "not_ready", "not enabled: enable it")]
    hall.steer(left=UP)
    assert not hall.servos["left"].moves and len(hall.told) == 2


def test_an_arm_that_does_not_follow_is_explained_once(hall):
    hall.hold(0.5, left=UP)
    hall.servos["left"].reason = "the arm does not follow: joint left_s0 is 0.1 rad behind its set-point"
    hall.hold(0.5, left=UP, right=UP)
    assert hall.explained == ["left"]
    hall.steer()
    hall.hold(0.5, left=UP)
    assert hall.explained == ["left", "left"]


@pytest.mark.parametrize(("hands", "said"), [
    (None, "must be an object"), ({"left": [1, 0]}, "six numbers"), ({"left": [2, 0, 0, 0, 0, 0]}, "six numbers"),
    ({"left": [float("nan")] * 6}, "six numbers"), ({"left": [True] * 6}, "six numbers"),
    ({"left": ["1"] * 6}, "six numbers"), ({"left": [10 ** 400] * 6}, "six numbers"),
    ({"t" * 10**4: UP}, "nothing steers the tttttttttttttttttttt hand"),
    ({"tail": UP}, "nothing steers the tail hand; start the servos: roslaunch moveit_servo baxter_servo.launch")])
def test_what_cannot_be_steered_is_refused_with_the_reason(hall, hands, said):
    hall.lab.serve(1, True, {"op": "steer", "hands": hands})
    (client, code, text), = hall.told
    assert (client, code) == (1, "refused") and said in text and not hall.lab.is_moving


def test_a_servo_that_has_ended_is_told(hall):
    hall.servos["left"].is_there = False
    hall.steer(left=UP)
    assert "nothing steers the left hand" in hall.told[0][2]


def test_only_the_page_in_control_steers(hall):
    hall.hold(0.2, left=UP)
    hall.steer(2, right=UP)
    assert hall.codes() == ["not_in_control"] and not hall.servos["right"].sent
    hall.steer(2)
    assert hall.servos["left"].moves, "another page lets nothing go"


def test_servos_that_are_no_longer_listened_to_are_no_error(hall):
    hall.hold(0.2, left=UP)
    hall.servos.clear()
    hall.pass_time(0.05, beats_of=1)
    hall.lab.gone(1)
    assert not hall.lab.is_moving


def led(number=1, shift=(0, 0, 0), turn=(0, 0, 0, 1)):
    return {"number": number, "shift": list(shift), "turn": list(turn)}


def test_a_hand_that_is_led_goes_where_it_is_led_from_where_it_is(hall):
    left = hall.servos["left"]

    def lead(**what):
        hall.lab.serve(1, True, {"op": "steer", "hands": {}, "led": {"left": led(**what)}})
        hall.pass_time(TICK_S, beats_of=1)
        return left.sent[-1][0]

    assert lead() == pytest.approx([0.0] * 6, abs=1e-9)
    assert lead(shift=(0.01, 0, 0)) == pytest.approx([0.3, 0, 0, 0, 0, 0])
    assert lead(shift=(0.1, 0.1, 0)) == pytest.approx([0.5**0.5, 0.5**0.5, 0, 0, 0, 0]), "no faster than at full speed"
    hall.pose[:3, 3] = (0.1, 0.1, 0)
    assert lead(shift=(0.1, 0.1, 0)) == pytest.approx([0.0] * 6, abs=1e-9), "it has arrived"
    turn = [0, 0, np.sin(0.025), np.cos(0.025)]
    assert lead(shift=(0.1, 0.1, 0), turn=turn) == pytest.approx([0, 0, 0, 0, 0, 0.5])
    # Tracking that leaps, and another grip, begin another way.
    assert lead(shift=(0.5, 0.1, 0), turn=turn) == pytest.approx([0.0] * 6, abs=1e-9)
    assert lead(number=2) == pytest.approx([0.0] * 6, abs=1e-9)
    hall.lab.serve(1, True, {"op": "steer", "hands": {}, "led": {}})
    assert not left.moves and not hall.servos["right"].sent


def test_a_hand_that_is_led_rests_when_nothing_comes(hall):
    hall.lab.serve(1, True, {"op": "steer", "hands": {}, "led": {"left": led()}})
    hall.pass_time(TICK_S, beats_of=1)
    hall.lab.serve(1, True, {"op": "steer", "hands": {}, "led": {"left": led(shift=(0.01, 0, 0))}})
    hall.pass_time(FRESH_S - 2 * TICK_S, beats_of=1)
    assert hall.servos["left"].moves
    hall.pass_time(4 * TICK_S, beats_of=1)
    assert not hall.servos["left"].moves


@pytest.mark.parametrize("bad", [[], {"left": 1}, {"left": {}}, {"left": led(number="x")}, {"left": led(shift=(1, 2))},
                                 {"left": led(turn=(0, 0, 0, 0))}, {"left": led(shift=(float("nan"), 0, 0))},
                                 {"left": led(number=10**400)}, {"left": led(number=float("nan"))}])
def test_what_leads_nowhere_is_refused(hall, bad):
    before = len(hall.told)
    hall.lab.serve(1, True, {"op": "steer", "hands": {}, "led": bad})
    assert len(hall.told) > before and not hall.servos["left"].sent
