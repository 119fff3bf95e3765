#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""DigitalIO, AnalogIO, Navigator and Head against the fake parts, fault by fault."""
import errno
import functools
import math
import time
import unittest
from unittest import mock

import rospy
from bullet_sim_msgs.srv import Press, PressRequest

from baxter_dataflow import wait_for
from baxter_interface import HEAD_PAN_ANGLE_TOLERANCE, AnalogIO, DigitalIO, Head, Navigator
from lab_testing import knobs

DEADLINE_S = 60.0


set_knobs = functools.partial(knobs.set_knobs, "/fake_parts")


def enable_robot(enabled):
    """Enable or disable the fake robot; in force when this returns."""
    rospy.set_param("/fake_robot/enabled", enabled)
    knobs.reload("/fake_robot")


class Fingers:
    """Presses, releases and turns."""

    def __init__(self):
        rospy.wait_for_service("/robot/sim/press", DEADLINE_S)
        self._do = rospy.ServiceProxy("/robot/sim/press", Press)

    def touch(self, name, pressed):
        self._insist(name, PressRequest.PRESS if pressed else PressRequest.RELEASE, 0)

    def turn(self, wheel, steps):
        self._insist(wheel, PressRequest.TURN, steps)

    def _insist(self, component, action, steps):
        answer = self._do(component=component, action=action, steps=steps)
        if not answer.success:
            raise AssertionError(answer.status_message)


class PartsTest(unittest.TestCase):
    def setUp(self):
        set_knobs()

    def assert_times_out(self, call, text):
        with self.assertRaises(OSError) as caught:
            call()
        self.assertEqual(caught.exception.errno, errno.ETIMEDOUT)
        self.assertIn(text, caught.exception.strerror)


class DigitalIOTest(PartsTest):
    def test_output_follows_before_the_call_returns(self):
        light = DigitalIO("torso_left_inner_light")
        self.assertTrue(light.is_output)
        for value in (True, False):
            light.set_output(value)
            self.assertIs(light.state, value)
        light.state = True
        self.assertIs(light.state, True)
        light.state = False

    def test_output_that_does_not_follow_times_out(self):
        light = DigitalIO("torso_left_inner_light")
        set_knobs(io_echo=False)
        self.assert_times_out(lambda: light.set_output(True, timeout=0.3), "torso_left_inner_light was set to True")
        light.set_output(True, timeout=0)  # does not wait

    def test_input_refuses_to_be_set(self):
        cuff = DigitalIO("left_lower_cuff")
        self.assertFalse(cuff.is_output)
        with self.assertRaises(OSError) as caught:
            cuff.set_output(True)
        self.assertEqual(caught.exception.errno, errno.EACCES)

    def test_signal_tells_changes_only(self):
        cuff, fingers, seen = DigitalIO("left_lower_cuff"), Fingers(), []
        note = seen.append
        cuff.state_changed.connect(note)
        for pressed in (True, False):
            fingers.touch("left_lower_cuff", pressed)
            wait_for(lambda pressed=pressed: cuff.state == pressed, DEADLINE_S)
        wait_for(lambda: len(seen) >= 2, DEADLINE_S)
        self.assertEqual(seen, [True, False])

    def test_channel_that_is_not_there_is_named(self):
        with self.assertRaises(OSError) as caught:
            DigitalIO("left_lower_cough")
        for text in ("/robot/digital_io/left_lower_cough/state", "left_lower_cuff", "torso_left_inner_light"):
            self.assertIn(text, caught.exception.strerror)
        self.assertNotIn("running", caught.exception.strerror)

    def test_name_of_sdk_1_0_stands_for_the_present_one(self):
        with mock.patch.object(rospy, "logwarn") as log:
            button, fingers = DigitalIO("torso_left_itb_button0"), Fingers()
        self.assertIn("torso_left_button_ok", str(log.mock_calls))
        self.addCleanup(fingers.touch, "torso_left_button_ok", False)
        fingers.touch("torso_left_button_ok", True)
        wait_for(lambda: button.state, DEADLINE_S)
        light = DigitalIO("torso_left_itb_light_inner")
        light.set_output(True)
        light.set_output(False)


class AnalogIOTest(PartsTest):
    def test_input_reads_and_refuses(self):
        hand_range = AnalogIO("left_hand_range")
        self.assertEqual(hand_range.state(), 123.0)
        self.assertFalse(hand_range.is_output())
        with self.assertRaises(OSError) as caught:
            hand_range.set_output(1)
        self.assertEqual(caught.exception.errno, errno.EACCES)

    def test_output_reports_the_very_number(self):
        fan = AnalogIO("torso_fan")
        self.assertTrue(fan.is_output())
        for value in (70, 65535, 0):
            fan.set_output(value)
            self.assertEqual(fan.state(), value)

    def test_number_that_does_not_fit_is_refused(self):
        fan = AnalogIO("torso_fan")
        for value in (-1, 65536, 0.5, float("nan"), "much"):
            self.assertRaisesRegex(ValueError, "torso_fan", fan.set_output, value)

    def test_output_that_does_not_follow_times_out(self):
        fan = AnalogIO("torso_fan")
        set_knobs(io_echo=False)
        self.assert_times_out(lambda: fan.set_output(7, timeout=0.3), "torso_fan was set to 7")


class NavigatorTest(PartsTest):
    def test_lights_follow_and_read_back(self):
        navigator = Navigator("torso_left")
        for value in (True, False):
            navigator.inner_led = value
            navigator.outer_led = not value
            wait_for(lambda value=value: navigator.inner_led is value and navigator.outer_led is not value, DEADLINE_S)

    def test_light_that_does_not_follow_raises(self):
        navigator = Navigator("torso_left")
        set_knobs(io_echo=False)
        self.assert_times_out(lambda: setattr(navigator, "inner_led", not navigator.inner_led), "inner_light")

    def test_buttons_signal(self):
        navigator, fingers = Navigator("torso_left"), Fingers()
        for number, channel in enumerate(("ok", "back", "show")):
            seen = []
            note = seen.append
            getattr(navigator, "button%d_changed" % number).connect(note)
            for pressed in (True, False):
                fingers.touch("torso_left_button_" + channel, pressed)
                wait_for(lambda n=number, p=pressed: getattr(navigator, "button%d" % n) is p, DEADLINE_S)
            wait_for(lambda seen=seen: len(seen) >= 2, DEADLINE_S)
            self.assertEqual(seen, [True, False])

    def test_wheel_signals_steps_across_its_wrap(self):
        navigator, fingers, seen = Navigator("torso_left"), Fingers(), []
        fingers.turn("torso_left_wheel", 250 - navigator.wheel)
        wait_for(lambda: navigator.wheel == 250, DEADLINE_S)
        note = seen.append
        navigator.wheel_changed.connect(note)
        for steps, count in ((9, 3), (-8, 251)):
            fingers.turn("torso_left_wheel", steps)
            wait_for(lambda count=count: navigator.wheel == count, DEADLINE_S)
        wait_for(lambda: len(seen) >= 2, DEADLINE_S)
        self.assertEqual(seen, [9, -8])

    def test_other_place_is_an_attribute_error_that_lists_the_right_ones(self):
        self.assertRaisesRegex(AttributeError, "'head'.*'torso_right'", Navigator, "head")


class HeadTest(PartsTest):
    def setUp(self):
        super().setUp()
        self.head = Head()
        self.head.set_pan(0.0)

    def test_pan_arrives_within_the_tolerance(self):
        self.head.set_pan(1.0)
        self.assertAlmostEqual(self.head.pan(), 1.0, delta=HEAD_PAN_ANGLE_TOLERANCE)

    def test_speed_is_a_share_or_percent(self):
        for speed, scale_speed in ((0.1, False), (10.0, True)):
            begin_s = time.monotonic()
            self.head.set_pan(1.0, speed=speed, scale_speed=scale_speed)
            self.assertGreater(time.monotonic() - begin_s, 0.5)
            self.head.set_pan(0.0)
        self.assertFalse(self.head.nodding())

    def test_panning_is_told_while_it_turns(self):
        self.head.set_pan(1.0, speed=0.02, timeout=0)
        wait_for(self.head.panning, DEADLINE_S)

    def test_pan_that_does_not_arrive_times_out(self):
        set_knobs(head_turns=False)
        self.assert_times_out(lambda: self.head.set_pan(-1.0, timeout=0.3), "did not turn to -1.000 rad within 0.3 s")
        self.assertRaises(ValueError, self.head.set_pan, float("nan"))

    def test_pan_out_of_range_is_refused_at_once(self):
        for angle in (-3.0, 3.0):
            begin_s = time.monotonic()
            with self.assertRaisesRegex(OSError, "-1.571 to 1.571 rad, not to %.3f rad" % angle):
                self.head.set_pan(angle, timeout=DEADLINE_S)
            self.assertLess(time.monotonic() - begin_s, 0.5 * DEADLINE_S)
        self.head.set_pan(math.pi / 2)

    def test_head_of_a_robot_that_is_not_enabled_says_so_soon(self):
        set_knobs(head_turns=False, nods=False)
        self.addCleanup(enable_robot, True)
        enable_robot(False)
        for call in (lambda: self.head.set_pan(-1.0, timeout=DEADLINE_S),
                     lambda: self.head.command_nod(timeout=DEADLINE_S)):
            begin_s = time.monotonic()
            self.assert_times_out(call, "not enabled")
            self.assertLess(time.monotonic() - begin_s, 0.5 * DEADLINE_S)

    def test_nod_begins_and_ends(self):
        self.head.command_nod()
        self.assertFalse(self.head.nodding())

    def test_nod_that_does_not_begin_or_end_times_out(self):
        set_knobs(nod_ends=False)
        self.assert_times_out(lambda: self.head.command_nod(timeout=0.5), "did not end its nod")
        set_knobs(nods=False)
        wait_for(lambda: not self.head.nodding(), DEADLINE_S)
        self.assert_times_out(lambda: self.head.command_nod(timeout=0.3), "did not begin to nod")


if __name__ == "__main__":
    import rostest
    rospy.init_node("sdk_parts_rostest")
    rostest.rosrun("baxter_interface", "sdk_parts", "__main__")
