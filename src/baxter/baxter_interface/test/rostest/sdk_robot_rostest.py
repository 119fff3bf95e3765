#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""RobotEnable and Limb against the fake robot, fault by fault."""
import errno
import functools
import statistics
import threading
import time
import unittest
from unittest import mock

import rospy
from baxter_core_msgs.msg import JointCommand
from std_msgs.msg import Bool, Float64

import baxter_model
from baxter_dataflow import wait_for
from baxter_interface import CHECK_VERSION, Limb, RobotEnable, VersionMismatch
from baxter_interface.joint_motion import MAKING_ROOM_S, PEAK_SPEED_RAD_S
from baxter_interface.limb import COMMAND_RATE_HZ
from baxter_interface.robot_enable import ENABLE_TIMEOUT_S
from lab_testing import knobs
from lab_testing.waiting import stretched

DEADLINE_S = 60.0


set_knobs = functools.partial(knobs.set_knobs, "/fake_robot")


class Recorder:
    """Keeps the messages of a topic."""

    def __init__(self, topic, kind):
        self.messages = []
        self._subscriber = rospy.Subscriber(topic, kind, self.messages.append)

    def wait_for_last(self, is_it, what):
        wait_for(lambda: self.messages and is_it(self.messages[-1]), DEADLINE_S, timeout_msg="no message: " + what)
        return self.messages[-1]

    def close(self):
        self._subscriber.unregister()


class LogRecorder(Recorder):
    def __init__(self):
        from rosgraph_msgs.msg import Log
        super().__init__("/rosout", Log)

    def wait_for_text(self, text):
        wait_for(lambda: any(text in message.msg for message in self.messages), DEADLINE_S,
                 timeout_msg="no log line with %r in %s" % (text, [message.msg for message in self.messages]))


class LatePublisher(rospy.Publisher):
    """A publisher without connections at first, as on a busy machine."""

    DELAY_S = ENABLE_TIMEOUT_S + 0.5

    def __init__(self, *arguments, **options):
        self._heard_from_s = time.monotonic() + self.DELAY_S
        super().__init__(*arguments, **options)

    def get_num_connections(self):
        return super().get_num_connections() if time.monotonic() > self._heard_from_s else 0

    def publish(self, *arguments):
        if time.monotonic() > self._heard_from_s:
            super().publish(*arguments)


class RobotEnableTest(unittest.TestCase):
    def setUp(self):
        set_knobs()
        self.robot = RobotEnable(CHECK_VERSION)
        wait_for(lambda: not (self.robot.state().enabled or self.robot.state().stopped), DEADLINE_S)

    def test_enable_and_disable(self):
        self.robot.enable()
        self.assertTrue(self.robot.state().enabled)
        self.robot.disable()
        self.assertFalse(self.robot.state().enabled)

    def test_enabling_an_enabled_robot_publishes_nothing(self):
        self.robot.enable()
        recorder = Recorder("/robot/set_super_enable", Bool)
        self.robot.enable()
        self.assertEqual(recorder.messages, [])
        recorder.close()

    def test_time_to_connect_is_not_the_robots(self):
        with mock.patch.object(rospy, "Publisher", LatePublisher):
            self.robot.enable()
        self.assertTrue(self.robot.state().enabled)

    def test_request_that_nobody_hears_says_so(self):
        with self.assertRaises(OSError) as caught:
            self.robot._request("robot/elsewhere", Bool(True), 0.2, lambda state: state.enabled, "enable")
        self.assertEqual(caught.exception.errno, errno.ETIMEDOUT)
        self.assertIn("nobody listens to /robot/elsewhere (enabled: False", caught.exception.strerror)

    def test_stop_disables_and_enable_resets_first(self):
        self.robot.enable()
        self.robot.stop()
        self.assertTrue(self.robot.state().stopped)
        self.robot.enable()
        self.assertTrue(self.robot.state().enabled)
        self.assertFalse(self.robot.state().stopped)

    def test_reset_leaves_the_robot_disabled(self):
        self.robot.enable()
        self.assertTrue(self.robot.reset() in (True,))
        self.assertFalse(self.robot.state().enabled)

    def test_state_is_a_copy(self):
        self.robot.state().enabled = True
        self.assertFalse(self.robot.state().enabled)

    def test_refused_enable_says_what_the_state_is(self):
        set_knobs(refuse_enable=True)
        begin_s = time.monotonic()
        with self.assertRaises(OSError) as caught:
            self.robot.enable()
        self.assertEqual(caught.exception.errno, errno.ETIMEDOUT)
        self.assertIn("failed to enable", caught.exception.strerror)
        self.assertIn("enabled: False, stopped: False", caught.exception.strerror)
        self.assertGreater(time.monotonic() - begin_s, ENABLE_TIMEOUT_S - 0.1)

    def test_enable_that_collision_avoidance_refuses_says_so_and_what_helps(self):
        set_knobs(refuse_enable=True, near=["collision_head_link_2"])
        with self.assertRaises(OSError) as caught:
            self.robot.enable()
        for text in ("the left arm", "collision_head_link_2", "tuck_arms.py -u"):
            self.assertIn(text, caught.exception.strerror)

    def test_pressed_stop_button_is_named_at_once(self):
        set_knobs(stop_button=True)
        wait_for(lambda: self.robot.state().stopped, DEADLINE_S)
        with self.assertRaises(OSError) as caught:
            self.robot.enable()
        self.assertEqual(caught.exception.errno, errno.EREMOTEIO)
        self.assertIn("stop button is pressed", caught.exception.strerror)

    def test_error_that_stays_is_no_failure_of_reset(self):
        set_knobs(sticky_error=True)
        wait_for(lambda: self.robot.state().error, DEADLINE_S)
        self.assertIs(self.robot.reset(), False)

    def test_version_mismatch_raises_and_says_how_to_fix_it(self):
        self.addCleanup(rospy.set_param, "/rethink/software_version", "1.2.0.57")
        rospy.set_param("/rethink/software_version", "2.1.2")
        self.assertFalse(self.robot.version_check())
        with self.assertRaises(VersionMismatch) as caught:
            RobotEnable(CHECK_VERSION)
        self.assertIn("2.1.2", caught.exception.strerror)
        self.assertIn("rosparam set", caught.exception.strerror)
        RobotEnable(False)


class LimbTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        set_knobs(enabled=True)
        cls.limbs = {side: Limb(side) for side in ("left", "right")}

    def setUp(self):
        set_knobs(enabled=True)
        self.log = LogRecorder()
        self.addCleanup(self.log.close)

    def commands_of(self, side):
        recorder = Recorder("/robot/limb/%s/joint_command" % side, JointCommand)
        self.addCleanup(recorder.close)
        # The limb's first message must find the recorder connected.
        connected = self.limbs[side]._command_publisher.get_num_connections
        wait_for(lambda: connected() >= 2, DEADLINE_S)
        return recorder

    def test_names_and_state(self):
        for side, limb in self.limbs.items():
            self.assertEqual(limb.name, side)
            names = [side + "_" + joint for joint in ("s0", "s1", "e0", "e1", "w0", "w1", "w2")]
            self.assertEqual(limb.joint_names(), names)
            for readings in (limb.joint_angles(), limb.joint_velocities(), limb.joint_efforts()):
                self.assertEqual(sorted(readings), sorted(names))
        # The fake's efforts count its joints in their alphabetical order.
        self.assertEqual(self.limbs["left"].joint_effort("left_w2"), 6.0)
        self.assertEqual(self.limbs["right"].joint_effort("right_e0"), 7.0)

    def test_endpoint(self):
        limb = self.limbs["right"]
        self.assertEqual(limb.endpoint_pose(),
                         {"position": Limb.Point(0.0, -0.5, 0.0), "orientation": Limb.Quaternion(0.0, 0.0, 0.0, 1.0)})
        self.assertEqual(limb.endpoint_velocity(), {"linear": (0.0, 0.0, 0.0), "angular": (0.0, 0.0, 0.25)})
        self.assertEqual(limb.endpoint_effort()["force"].x, 3.0)

    def test_what_is_returned_is_a_copy(self):
        limb = self.limbs["left"]
        limb.joint_names().clear()
        limb.joint_angles().clear()
        limb.joint_velocities().clear()
        self.assertEqual(len(limb.joint_names()), 7)
        self.assertEqual(len(limb.joint_angles()), 7)
        self.assertEqual(len(limb.joint_velocities()), 7)

    def test_wrong_names_and_numbers_are_refused(self):
        limb = self.limbs["left"]
        for kind in (ValueError, KeyError):
            with self.assertRaisesRegex(kind, "left"):
                Limb("middle")
            with self.assertRaisesRegex(kind, "left_s0"):
                limb.joint_angle("s0")
            with self.assertRaisesRegex(kind, "left_s0"):
                limb.set_joint_positions({"right_s0": 0.0})
            with self.assertRaisesRegex(kind, "left_s0"):
                limb.move_to_joint_positions({"left_x": 0.0})
        for command in (limb.set_joint_positions, limb.set_joint_velocities, limb.set_joint_torques,
                        limb.move_to_joint_positions):
            with self.assertRaisesRegex(ValueError, "left_s1.*finite"):
                command({"left_s0": 0.0, "left_s1": float("nan")})
        for setting in (limb.set_command_timeout, limb.set_joint_position_speed):
            with self.assertRaisesRegex(ValueError, "finite"):
                setting(float("inf"))

    def test_modes_and_partial_commands(self):
        limb, recorder = self.limbs["left"], self.commands_of("left")
        for command, mode in (
                (limb.set_joint_positions, JointCommand.POSITION_MODE),
                (lambda values: limb.set_joint_positions(values, raw=True), JointCommand.RAW_POSITION_MODE),
                (limb.set_joint_velocities, JointCommand.VELOCITY_MODE),
                (limb.set_joint_torques, JointCommand.TORQUE_MODE)):
            command({"left_w2": 0.25, "left_s0": -0.125})
            message = recorder.wait_for_last(lambda message, mode=mode: message.mode == mode, "mode %d" % mode)
            self.assertEqual(dict(zip(message.names, message.command, strict=True)),
                             {"left_w2": 0.25, "left_s0": -0.125})

    def test_first_command_after_construction_is_not_lost(self):
        recorder = self.commands_of("right")
        for turn in range(5):
            angle = 0.01 * turn
            Limb("right").set_joint_positions({"right_w2": angle})
            recorder.wait_for_last(lambda message, angle=angle: message.command == (angle,), "command %d" % turn)

    def test_settings_are_latched(self):
        limb = self.limbs["left"]
        limb.set_joint_position_speed(0.7)
        limb.set_command_timeout(0.4)
        late = [Recorder("/robot/limb/left/set_speed_ratio", Float64),
                Recorder("/robot/limb/left/joint_command_timeout", Float64)]
        late[0].wait_for_last(lambda message: message.data == 0.7, "speed ratio")
        late[1].wait_for_last(lambda message: message.data == 0.4, "time-out")
        limb.exit_control_mode()
        late[1].wait_for_last(lambda message: message.data == 0.2, "time-out of exit_control_mode")

    def test_both_arms_reach_neutral_in_a_few_seconds(self):
        recorders = {side: self.commands_of(side) for side in self.limbs}
        results = {}

        def move(side):
            results[side] = self.limbs[side].move_to_neutral()

        self.limbs["left"].set_joint_positions({"left_s1": 1.047})
        wait_for(lambda: self.limbs["left"].joint_angle("left_s1") > 1.0, DEADLINE_S)
        threads = [threading.Thread(target=move, args=(side,)) for side in self.limbs]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(DEADLINE_S)
        self.assertEqual(results, {"left": True, "right": True})
        for side, recorder in recorders.items():
            target = baxter_model.poses().angles("neutral", side)
            wait_for(lambda recorder=recorder, target=target:
                     dict(zip(recorder.messages[-1].names, recorder.messages[-1].command, strict=True)) == target,
                     DEADLINE_S, timeout_msg="the exact target is not the last command")
            # The number of commands for this many seconds; a slow machine skips some.
            self.assertLess(sum(message.command != recorder.messages[-1].command for message in recorder.messages),
                            3.0 * COMMAND_RATE_HZ)
            for name, angle in target.items():
                self.assertAlmostEqual(self.limbs[side].joint_angle(name), angle, delta=0.001)

    def test_commands_come_at_100_hz_and_without_jumps(self):
        limb, recorder = self.limbs["left"], self.commands_of("left")
        self.assertTrue(limb.move_to_joint_positions({"left_s0": -0.5}))
        commands, stamps = [limb.joint_angle("left_s0")], [rospy.get_time()]
        send = limb._send

        def command(mode, positions):
            commands.append(positions["left_s0"])
            send(mode, positions)

        recorder.messages.clear()
        with mock.patch.object(limb, "_send", command):
            self.assertTrue(limb.move_to_joint_positions({"left_s0": 0.5},
                                                         test=lambda: stamps.append(rospy.get_time())))
        self.assertEqual(len(commands), len(stamps))
        # A quarter of the periods, because a busy machine makes others longer.
        periods = [b - a for a, b in zip(stamps, stamps[1:], strict=False)]
        self.assertLess(statistics.quantiles(periods, n=4)[0], 0.0125)
        # Each command was computed after the stamp before its own, however long the process stood still in between.
        for i in range(2, len(commands)):
            self.assertLess(abs(commands[i] - commands[i - 1]),
                            PEAK_SPEED_RAD_S["s0"] * (stamps[i] - stamps[i - 2]) + 0.001)
        self.assertAlmostEqual(commands[1], commands[0], delta=PEAK_SPEED_RAD_S["s0"] * (stamps[1] - stamps[0]) + 0.001)
        recorder.wait_for_last(lambda message: message.command == (0.5,), "the target")
        self.assertGreater(len(recorder.messages), 0.5 * len(commands))

    def test_no_joints_return_at_once_with_the_question(self):
        steps = []
        self.assertIs(self.limbs["left"].move_to_joint_positions({}, test=lambda: steps.append(1)), False)
        self.assertEqual(steps, [])
        self.log.wait_for_text("no joints given: did IK find a solution?")

    def test_degrees_move_nothing_and_are_told(self):
        limb, steps = self.limbs["left"], []
        self.assertIs(limb.move_to_joint_positions({"left_s0": 45.0}, test=lambda: steps.append(1)), False)
        self.assertEqual(steps, [])
        self.log.wait_for_text("left_s0 cannot turn to 45 rad")

    def test_stuck_joint_is_reported(self):
        set_knobs(enabled=True, stuck=["left_w1"])
        off = self.limbs["left"].joint_angle("left_w1") + 0.5
        self.assertIs(self.limbs["left"].move_to_joint_positions({"left_w1": off, "left_w2": 0.1}, timeout=2.5), False)
        self.log.wait_for_text("left arm: not there after 2.5 s: left_w1 is 0.5000 rad from its target")

    def test_arm_held_by_collision_avoidance_ends_the_move_with_the_reason_and_the_command_that_helps(self):
        set_knobs(enabled=True, stuck=["left_s1"], near=["collision_head_link_2"])
        limb = self.limbs["left"]
        off = {"left_s1": limb.joint_angle("left_s1") - 0.5}
        begin_s = rospy.get_time()
        self.assertIs(limb.move_to_joint_positions(off, timeout=DEADLINE_S), False)
        self.assertLess(rospy.get_time() - begin_s, stretched(1.4))
        self.log.wait_for_text("too near to collision_head_link_2")
        self.log.wait_for_text("tuck_arms.py -u")
        # The same for commands that nobody waits for, and for short moves.
        for command in (lambda: limb.set_joint_positions(off), lambda: limb.set_joint_velocities({"left_s1": -0.5}),
                        lambda: limb.move_to_joint_positions(off, timeout=0.0)):
            with mock.patch.object(rospy, "logwarn") as log:
                wait_for(lambda log=log: any("too near" in str(call) for call in log.mock_calls), DEADLINE_S,
                         body=command)
            limb._warned_at_s.clear()

    def test_other_arm_may_make_room(self):
        set_knobs(enabled=True, stuck=["left_s1"], near=["right_lower_forearm"], other_arm=True)
        off, begin_s = self.limbs["left"].joint_angle("left_s1") - 0.5, rospy.get_time()
        self.assertIs(self.limbs["left"].move_to_joint_positions({"left_s1": off}, timeout=DEADLINE_S), False)
        self.assertGreater(rospy.get_time() - begin_s, MAKING_ROOM_S)
        self.log.wait_for_text("too near to right_lower_forearm")

    def test_command_to_a_robot_that_is_not_enabled_says_so(self):
        limb = self.limbs["left"]
        limb.set_joint_positions(limb.joint_angles())
        set_knobs(enabled=False)
        limb._warned_at_s.clear()
        wait_for(lambda: limb._refusal(), DEADLINE_S)
        with mock.patch.object(rospy, "logwarn") as log:
            wait_for(lambda: any("not enabled" in str(call) for call in log.mock_calls), DEADLINE_S,
                     body=lambda: limb.set_joint_velocities({"left_s0": 0.1}))

    def test_own_test_stops_the_move(self):
        limb, recorder = self.limbs["left"], self.commands_of("left")
        self.assertTrue(limb.move_to_joint_positions({"left_s0": 0.0}))
        seen = []

        def is_far():
            seen.append(limb.joint_angle("left_s0"))
            return seen[-1] > 0.3

        self.assertIs(limb.move_to_joint_positions({"left_s0": 1.0}, test=is_far), False)
        self.log.wait_for_text("stopped by the test")
        self.assertLessEqual(seen[-2], 0.3)

        def is_stopped():
            last = recorder.messages[-1].command[0]
            return seen[-2] <= last <= seen[-1] and abs(limb.joint_angle("left_s0") - last) < 0.01

        wait_for(is_stopped, DEADLINE_S, timeout_msg="the arm does not hold where it was when the test stopped it")

    def test_loss_of_enable_ends_the_move(self):
        limb = self.limbs["left"]
        self.assertTrue(limb.move_to_joint_positions({"left_s0": 0.0}))
        disable = mock.Mock(wraps=set_knobs)

        def disable_on_the_way():
            if limb.joint_angle("left_s0") > 0.1 and not disable.called:
                disable(enabled=False)

        self.assertIs(limb.move_to_joint_positions({"left_s0": 1.5}, test=disable_on_the_way), False)
        # And not because of a time-out.
        self.log.wait_for_text("the robot is not enabled")

    def test_move_right_after_enable_is_not_refused(self):
        for _ in range(5):
            set_knobs(enabled=False)
            robot = RobotEnable()
            wait_for(lambda robot=robot: not robot.state().enabled, DEADLINE_S)
            robot.enable()
            self.assertTrue(self.limbs["left"].move_to_joint_positions({"left_w0": 0.0}))


if __name__ == "__main__":
    import rostest
    rospy.init_node("sdk_robot_rostest")
    rostest.rosrun("baxter_interface", "sdk_robot", "__main__")
