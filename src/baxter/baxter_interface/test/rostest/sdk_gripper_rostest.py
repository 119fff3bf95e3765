#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Gripper of every kind against the fake gripper, fault by fault."""
import errno
import functools
import json
import unittest
from unittest import mock

import rospy
from baxter_core_msgs.msg import EndEffectorCommand

from baxter_dataflow import wait_for
from baxter_interface import CHECK_VERSION, Gripper, VersionMismatch
from lab_testing import knobs

DEADLINE_S = 5.0
SUCTION, ELECTRIC, CUSTOM = 1, 2, 3


set_knobs = functools.partial(knobs.set_knobs, "/fake_gripper")


def gripper_of(kind, **knobs):
    set_knobs(ui_type=kind, **knobs)
    return Gripper("left")


class Commands:
    """Keeps what is commanded."""

    def __init__(self):
        self.messages = []
        topic = "/robot/end_effector/left_gripper/command"
        self._subscriber = rospy.Subscriber(topic, EndEffectorCommand, self.messages.append)
        # A node has one publisher for a topic, and it knows of a connection a moment after the subscriber does.
        self._publisher = rospy.Publisher(topic, EndEffectorCommand, queue_size=1)
        nothing = EndEffectorCommand(command=EndEffectorCommand.CMD_NO_OP)
        wait_for(lambda: self.messages, DEADLINE_S, body=lambda: self._publisher.publish(nothing))

    def wait_for_last(self, command):
        wait_for(lambda: any(message.command == command for message in self.messages), DEADLINE_S,
                 timeout_msg="no command %s" % command)
        return [message for message in self.messages if message.command == command][-1]

    def close(self):
        self._subscriber.unregister()
        self._publisher.unregister()


class ElectricTest(unittest.TestCase):
    def test_identity(self):
        gripper = gripper_of(ELECTRIC)
        self.assertEqual((gripper.name, gripper.type(), gripper.hardware_id()), ("left_gripper", "electric", 65538))
        self.assertEqual((gripper.hardware_name(), gripper.firmware_build_date(), gripper.firmware_version()),
                         ("SDK End Effector", "2014/7/24 18:30:00", "3.0.0 5.5"))
        self.assertTrue(gripper.has_force() and gripper.has_position())
        self.assertTrue(gripper.version_check())

    def test_blocking_moves_arrive(self):
        gripper = gripper_of(ELECTRIC)
        self.assertIs(gripper.close(block=True), True)
        self.assertLess(gripper.position(), 5.0)
        self.assertIs(gripper.command_position(60.0, block=True), True)
        self.assertAlmostEqual(gripper.position(), 60.0, delta=5.0)
        self.assertIs(gripper.open(), True)
        wait_for(lambda: gripper.position() > 95.0, DEADLINE_S)

    def test_gripping_ends_a_move_and_signals(self):
        gripper, seen = gripper_of(ELECTRIC, block_at=40.0), []
        note = seen.append
        gripper.on_gripping_changed.connect(note)
        self.assertIs(gripper.close(block=True), True)
        self.assertTrue(gripper.gripping())
        wait_for(lambda: seen, DEADLINE_S)
        self.assertEqual(seen, [True])

    def test_gripper_that_is_not_calibrated_does_not_move_until_it_is(self):
        gripper = gripper_of(ELECTRIC, calibrated=False, error=True)
        self.assertIs(gripper.command_position(0.0, block=True), False)
        self.assertIs(gripper.calibrate(), True)
        self.assertTrue(gripper.calibrated() and gripper.ready() and not gripper.error())
        self.assertIs(gripper.command_position(0.0, block=True), True)
        self.assertIs(gripper.clear_calibration(), True)
        self.assertFalse(gripper.calibrated())

    def test_reset_reboot_and_stop(self):
        gripper = gripper_of(ELECTRIC, error=True)
        self.assertIs(gripper.reset(), True)
        self.assertFalse(gripper.error())
        self.assertIs(gripper.stop(), True)
        self.assertIs(gripper.reboot(), True)
        self.assertFalse(gripper.calibrated())

    def test_command_without_effect_returns_false(self):
        gripper = gripper_of(ELECTRIC, works=False)
        self.assertIs(gripper.close(block=True, timeout=0.3), False)
        self.assertIs(gripper.close(), True)  # nobody waited

    def test_command_to_a_robot_that_is_not_enabled_ends_soon_and_says_so(self):
        gripper = gripper_of(ELECTRIC, enabled=False)
        begin_s = rospy.get_time()
        for block in (True, False):
            with mock.patch.object(rospy, "logwarn") as log:
                self.assertIs(gripper.close(block=block, timeout=60.0), not block)
                wait_for(lambda log=log: any("not enabled" in str(call) for call in log.mock_calls), DEADLINE_S)
        self.assertLess(rospy.get_time() - begin_s, 30.0)

    def test_gripper_that_never_acknowledges_is_judged_by_its_state(self):
        gripper = gripper_of(ELECTRIC, acknowledges=False)
        self.assertIs(gripper.close(block=True, timeout=1.0), True)

    def test_wire_format(self):
        gripper, commands = gripper_of(ELECTRIC), Commands()
        gripper.command_position(140.0)
        message = commands.wait_for_last("go")
        self.assertEqual((message.id, message.sender), (65538, rospy.get_name() + "_go"))
        self.assertEqual(json.loads(message.args), {"position": 100.0})
        gripper.set_velocity(-3.0)
        following = commands.wait_for_last("configure")
        self.assertEqual(following.sequence, message.sequence + 1)
        self.assertEqual(json.loads(following.args),
                         {"velocity": 0.0, "moving_force": 40.0, "holding_force": 30.0, "dead_zone": 5.0})
        commands.close()

    def test_parameters(self):
        gripper = gripper_of(ELECTRIC)
        self.assertEqual(gripper.parameters(), gripper.valid_parameters())
        gripper.set_holding_force(120.0)
        gripper.set_dead_band(2.0)
        gripper.set_parameters({"velocity": 10.0, "colour": 1.0})
        self.assertEqual(gripper.parameters(),
                         {"velocity": 10.0, "moving_force": 40.0, "holding_force": 100.0, "dead_zone": 2.0})
        gripper.set_parameters(defaults=True)
        self.assertEqual(gripper.parameters(), gripper.valid_parameters())
        self.assertIn("dead_zone 5", gripper.valid_parameters_text())

    def test_old_firmware_is_refused_if_versions_count(self):
        set_knobs(firmware_date="2013/9/1 00:00:00")
        self.assertFalse(Gripper("left").version_check())
        with self.assertRaisesRegex(VersionMismatch, "too old"):
            Gripper("left", CHECK_VERSION)

    def test_what_it_cannot_do_returns_none(self):
        gripper = gripper_of(ELECTRIC)
        for result in (gripper.command_suction(), gripper.vacuum(), gripper.vacuum_sensor(), gripper.sucking(),
                       gripper.blowing(), gripper.reset_custom_properties(), gripper.reset_custom_state()):
            self.assertIsNone(result)


class SuctionTest(unittest.TestCase):
    def test_sucks_and_releases(self):
        gripper = gripper_of(SUCTION)
        self.assertEqual((gripper.type(), gripper.hardware_id()), ("suction", 65537))
        self.assertIs(gripper.close(block=True), True)
        self.assertTrue(gripper.vacuum() and gripper.sucking())
        wait_for(lambda: gripper.vacuum_sensor() > 95.0, DEADLINE_S)
        self.assertIs(gripper.open(block=True), True)
        self.assertFalse(gripper.sucking() or gripper.blowing())
        self.assertIs(gripper.command_position(50.0, block=True), True)
        self.assertIs(gripper.command_position(100.0, block=True), True)

    def test_sucking_air_returns_false(self):
        self.assertIs(gripper_of(SUCTION, seal=False).command_suction(block=True, timeout=0.3), False)

    def test_parameters(self):
        gripper = gripper_of(SUCTION)
        gripper.set_vacuum_threshold(30.0)
        gripper.set_blow_off(1.0)
        self.assertEqual(gripper.parameters(), {"vacuum_sensor_threshold": 30.0, "blow_off_seconds": 1.0})
        self.assertIsNone(gripper.calibrate())


class CustomTest(unittest.TestCase):
    def test_can_be_told_what_it_is_and_nothing_else(self):
        gripper = gripper_of(CUSTOM)
        self.assertEqual((gripper.type(), gripper.parameters()), ("custom", {}))
        self.assertIs(gripper.reset_custom_properties(), True)
        self.assertIs(gripper.reset_custom_state(), True)
        self.assertFalse(gripper.calibrated())
        self.assertIsNone(gripper.open())

    def test_change_of_type_signals(self):
        gripper, seen = gripper_of(CUSTOM), []
        note = seen.append
        gripper.on_type_changed.connect(note)
        set_knobs(ui_type=ELECTRIC)
        wait_for(lambda: seen, DEADLINE_S)
        self.assertEqual((seen, gripper.type()), (["electric"], "electric"))

    def test_arm_without_gripper_says_so(self):
        set_knobs(ui_type=0)
        with self.assertRaises(OSError) as caught:
            Gripper("left")
        self.assertEqual(caught.exception.errno, errno.ETIMEDOUT)
        self.assertIn("no gripper on the left arm", caught.exception.strerror)
        self.assertRaisesRegex(ValueError, "'left' and 'right'", Gripper, "middle")


if __name__ == "__main__":
    import rostest
    rospy.init_node("sdk_gripper_rostest")
    rostest.rosrun("baxter_interface", "sdk_gripper", "__main__")
