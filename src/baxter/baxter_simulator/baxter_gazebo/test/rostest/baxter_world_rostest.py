#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The lab end to end: what a client sees of the robot, from the production launch file."""
import random
import subprocess
import unittest

import rospy
import tf2_ros
from baxter_core_msgs.msg import (
    AnalogIOState,
    AnalogIOStates,
    AnalogOutputCommand,
    DigitalIOState,
    DigitalIOStates,
    DigitalOutputCommand,
    EndEffectorCommand,
    EndEffectorProperties,
    EndEffectorState,
    HeadPanCommand,
    HeadState,
    JointCommand,
    NavigatorState,
    NavigatorStates,
    SEAJointState,
)
from bullet_sim_msgs.srv import Press
from robot_client import POSITION, RAW, SIDES, SUFFIXES, TORQUE, VELOCITY, Latest, Robot, joints
from std_msgs.msg import Bool

from lab_testing.waiting import wait_until

START = {
    "left": (0.192483, 1.047, 0.000806359, 0.491094, -0.178079, -0.0610333, -0.0124707),
    "right": (-0.272659, 1.047, -0.00123203, 0.49262, -0.0806423, -0.0620532, 0.0265941),
}
NEUTRAL = {name: angle for side in SIDES
           for name, angle in zip(joints(side), (0.0, -0.55, 0.0, 0.75, 0.0, 1.26, 0.0), strict=True)}
NAMES = sorted(["head_pan", *joints("left"), *joints("right"),
                *("%s_gripper_%s_finger_joint" % (hand, finger) for hand in "lr" for finger in "lr")])


class BaxterWorldTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.robot = Robot()

    # Tests run in alphabetical order: a_ gets the robot as it was started.

    def test_a_starts_disabled_in_the_start_pose(self):
        robot = self.robot
        self.assertEqual((robot.state.ready, robot.state.enabled, robot.state.stopped), (False, False, False))
        message = robot.history[0]
        state = dict(zip(message.name, message.position, strict=True))
        for side in SIDES:
            for name, angle in zip(joints(side), START[side], strict=True):
                self.assertAlmostEqual(state[name], angle, delta=1e-3, msg=name)
        self.assertAlmostEqual(state["head_pan"], 0.0, delta=1e-3)
        self.assertAlmostEqual(state["l_gripper_l_finger_joint"], 0.0208, delta=1e-4)

    def test_a_commands_are_ignored_while_disabled_and_the_log_says_how_to_enable(self):
        robot = self.robot
        before = robot.positions
        robot.stream(POSITION, {"left_w1": 0.5, "right_w1": 0.5}, 0.5)
        self.assertLess(robot.error(before), 1e-3)
        wait_until(lambda: any("enable_robot.py -e" in line for line in robot.lines), "a log line that says what to do")

    def test_b_joint_states_have_19_names_in_order_at_50_hz(self):
        robot = self.robot
        robot.wait_sim(3.0)
        messages = list(robot.history)
        for message in messages:
            self.assertEqual(message.name, NAMES)
            self.assertEqual({len(message.position), len(message.velocity), len(message.effort)}, {19})
        stamps = [message.header.stamp.to_sec() for message in messages][1:]
        for earlier, later in zip(stamps, stamps[1:], strict=False):
            self.assertAlmostEqual(later - earlier, 0.02, delta=1e-6)

    def test_b_parameters(self):
        self.assertEqual(rospy.get_param("rethink/software_version"), "1.2.0.57")
        self.assertTrue(rospy.get_param("manifest/robot_serial"))

    def test_b_tf(self):
        buffer = tf2_ros.Buffer()
        listener = tf2_ros.TransformListener(buffer)
        for frame in ("head", "left_hand", "right_hand", "head_camera", "left_gripper_base", "left_gripper"):
            wait_until(lambda frame=frame: buffer.can_transform("base", frame, rospy.Time()), "tf of " + frame)
        wait_until(lambda: buffer.can_transform("world", "base", rospy.Time()), "tf of world")
        transform = buffer.lookup_transform("world", "base", rospy.Time()).transform
        self.assertEqual((transform.translation.x, transform.translation.y, transform.translation.z), (0.0, 0.0, 0.0))
        self.assertEqual(transform.rotation.w, 1.0)
        tip = buffer.lookup_transform("base", "left_gripper", rospy.Time()).transform.translation
        seen = wait_until(lambda: self.robot.endpoints.get("left"), "endpoint_state").pose.position
        for axis in "xyz":
            self.assertAlmostEqual(getattr(tip, axis), getattr(seen, axis), delta=1e-3)
        listener.unregister()

    def test_c_enable_stop_reset(self):
        robot = self.robot
        robot.restart()
        self.assertTrue(robot.state.ready)
        robot.super_stop.publish()
        wait_until(lambda: robot.state.stopped, "stopped")
        self.assertFalse(robot.state.enabled or robot.state.ready)
        robot.super_enable.publish(True)
        robot.wait_sim(0.3)
        self.assertTrue(robot.state.stopped and not robot.state.enabled)
        robot.super_reset.publish()
        wait_until(lambda: not robot.state.stopped, "reset")
        self.assertEqual((robot.state.enabled, robot.state.error, robot.state.estop_button, robot.state.estop_source),
                         (False, False, 0, 0))
        robot.set_enabled(True)
        robot.set_enabled(False)

    def test_d_position_mode(self):
        self.robot.restart()
        self.robot.move(NEUTRAL)

    def test_d_raw_position_mode(self):
        robot = self.robot
        robot.restart()
        robot.move(NEUTRAL)
        goal = {name: angle + 0.05 for name, angle in NEUTRAL.items()}
        robot.stream(RAW, goal, 1.0)
        self.assertLess(robot.error(goal), 2e-3)

    def test_d_velocity_mode_and_its_timeout(self):
        robot = self.robot
        robot.restart()
        robot.move(NEUTRAL)
        wanted = dict.fromkeys(NEUTRAL, 0.1)

        def cruising():
            # Again and again: after a pause of 0.2 s of simulation between two commands the arms stop.
            robot.command(VELOCITY, wanted)
            velocities = robot.velocities
            return all(abs(velocities[name] - 0.1) < 0.01 for name in NEUTRAL)

        wait_until(cruising, lambda: "0.1 rad/s, got %s" % robot.velocities)
        wait_until(lambda: max(map(abs, robot.velocities.values())) < 1e-3, "the arms to stop without commands")
        rest = robot.positions
        robot.wait_sim(0.5)
        self.assertLess(robot.error(rest), 1e-4)

    def test_d_torque_mode_of_zero_holds(self):
        robot = self.robot
        robot.restart()
        robot.move(NEUTRAL)
        robot.stream(TORQUE, dict.fromkeys(NEUTRAL, 0.0), 3.0)
        self.assertLess(robot.error(NEUTRAL), 0.01)

    def test_d_speed_ratio(self):
        robot = self.robot
        robot.restart()
        robot.move(NEUTRAL)
        for side in SIDES:
            robot.ratios[side].publish(0.1)
        robot.wait_setting("speed ratio", 0.1)
        start = robot.now()
        goal = {"left_w2": 0.6, "right_w2": -0.6}
        robot.move(goal)
        self.assertAlmostEqual(robot.fastest("left_w2", start), 0.4, delta=0.02)

    def test_e_gravity_compensation_torques(self):
        for side in SIDES:
            message = rospy.wait_for_message("/robot/limb/%s/gravity_compensation_torques" % side, SEAJointState, 90.0)
            self.assertEqual(list(message.name), joints(side))
            self.assertEqual(len(message.gravity_model_effort), len(SUFFIXES))
            self.assertGreater(abs(message.gravity_model_effort[1]), 1.0)

    def test_e_a_light_follows_commands_in_all_its_topics(self):
        light = Latest("/robot/digital_io/left_outer_light/state", DigitalIOState)
        navigator = Latest("/robot/navigators/left_navigator/state", NavigatorState)
        command = rospy.Publisher("/robot/digital_io/command", DigitalOutputCommand, queue_size=10)
        wait_until(lambda: light.message and navigator.message and command.get_num_connections(), "the light's topics")
        self.assertFalse(light.message.isInputOnly)
        for value in (True, False):
            command.publish("left_outer_light", value)
            wait_until(lambda value=value: light.message.state == value, "light is %s" % value)
            wait_until(lambda value=value: navigator.message.lights == [False, value], "navigator: %s" % value)

    def test_e_the_fan_echoes_the_integer(self):
        fan = Latest("/robot/analog_io/torso_fan/state", AnalogIOState)
        command = rospy.Publisher("/robot/analog_io/command", AnalogOutputCommand, queue_size=10)
        wait_until(lambda: fan.message and command.get_num_connections(), "the fan's topics")
        for value in (70, 0):
            command.publish("torso_fan", value)
            wait_until(lambda value=value: fan.message.value == value, "fan at %d" % value)

    def test_e_buttons_and_wheels_are_pressed_and_turned(self):
        cuff = Latest("/robot/digital_io/left_lower_cuff/state", DigitalIOState)
        navigator = Latest("/robot/navigators/torso_right_navigator/state", NavigatorState)
        rospy.wait_for_service("/robot/sim/press", 90.0)
        press = rospy.ServiceProxy("/robot/sim/press", Press)
        self.assertTrue(press("left_lower_cuff", "press", 0).success)
        wait_until(lambda: cuff.message and cuff.message.state == 1 and cuff.message.isInputOnly, "cuff squeezed")
        subprocess.run(["rosrun", "baxter_sim_hardware", "press", "--release", "left_lower_cuff"], check=True)
        wait_until(lambda: cuff.message.state == 0, "cuff released")
        self.assertTrue(press("torso_right_wheel", "turn", -2).success)
        wait_until(lambda: navigator.message and navigator.message.wheel == 254, "wheel turned back by 2")
        self.assertEqual(navigator.message.button_names, ["ok", "back", "show"])
        refused = press("torso_right_inner_light", "press", 0)
        self.assertFalse(refused.success)
        self.assertIn("is not a digital input", refused.status_message)

    def test_e_head_pans_and_nods(self):
        self.robot.restart()
        head = Latest("/robot/head/head_state", HeadState)
        pan = rospy.Publisher("/robot/head/command_head_pan", HeadPanCommand, queue_size=10)
        nod = rospy.Publisher("/robot/head/command_head_nod", Bool, queue_size=10)
        wait_until(lambda: head.message and pan.get_num_connections() and nod.get_num_connections(),
                   "the head's topics")
        for target, ratio in ((1.0, 0.1), (0.0, 0.0)):
            pan.publish(target, ratio, HeadPanCommand.REQUEST_PAN_ENABLE)
            wait_until(lambda target=target: abs(head.message.pan - target) < 1e-2 and not head.message.isTurning,
                     "head at %g rad" % target)
        nod.publish(True)
        wait_until(lambda: head.message.isNodding, "nodding")
        wait_until(lambda: not head.message.isNodding, "nod over")

    def test_e_grippers_go_and_acknowledge(self):
        self.robot.restart()
        for side in SIDES:
            topic = "/robot/end_effector/%s_gripper/" % side
            state = Latest(topic + "state", EndEffectorState)
            properties = Latest(topic + "properties", EndEffectorProperties)
            command = rospy.Publisher(topic + "command", EndEffectorCommand, queue_size=10)
            wait_until(lambda state=state, properties=properties, command=command: (
                state.message and properties.message and command.get_num_connections()), "the gripper's topics")
            self.assertEqual((properties.message.id, properties.message.ui_type, state.message.id), (65538, 2, 65538))
            for sequence, percent in enumerate((0.0, 100.0), start=1):
                command.publish(65538, "go", '{"position": %g}' % percent, "test_go", sequence)
                wait_until(lambda state=state, sequence=sequence: (
                    (state.message.command_sender, state.message.command_sequence) == ("test_go", sequence)), "echo")
                wait_until(lambda state=state, percent=percent: (
                    abs(state.message.position - percent) < 2.0 and not state.message.moving), "%g %%" % percent)

    def test_e_aggregates(self):
        for name, kind, count in (("digital_io_states", DigitalIOStates, 57), ("analog_io_states", AnalogIOStates, 10),
                                  ("navigators_states", NavigatorStates, 4)):
            message = rospy.wait_for_message("/robot/" + name, kind, 90.0)
            self.assertEqual((len(message.names), len(message.states)), (count, count), name)

    def test_f_a_thousand_malformed_commands_do_nothing_and_a_good_one_works_at_once(self):
        robot = self.robot
        robot.restart()
        robot.move(NEUTRAL)
        random_numbers = random.Random(11)
        for number in range(1000):
            robot.commands[SIDES[number % 2]].publish(malformed_command(random_numbers, SIDES[number % 2], number))
            if number % 20 == 19:
                robot.wait_sim(0.02)
        robot.wait_sim(0.2)
        self.assertLess(robot.error(NEUTRAL), 1e-3)
        wait_until(lambda: any("this limb's joints are left_s0, left_s1" in line for line in robot.lines),
                 "a log line with the right names")
        robot.move({"left_w1": 1.0, "right_w1": 1.0})


def malformed_command(numbers, side, number):
    """A JointCommand with one fault."""
    names = numbers.sample(joints(side), numbers.randint(1, 7))
    values = [numbers.uniform(-1.0, 1.0) for _ in names]
    mode = numbers.randint(1, 4)
    fault = number % 6
    if fault == 0:
        mode = numbers.choice([0, 5, -1, 2**31 - 1, -2**31])
    elif fault == 1:
        values.append(0.5)
    elif fault == 2:
        values[0] = numbers.choice([float("nan"), float("inf"), -float("inf")])
    elif fault == 3:
        names[-1] = numbers.choice(["", side, "head_pan", "s0", "hand"])
    elif fault == 4:
        names, values = [*names, names[0]], [*values, 0.1]
    else:
        names, values = [], []
    return JointCommand(mode, values, names)


if __name__ == "__main__":
    import rostest
    rospy.init_node("baxter_world_rostest")
    rostest.rosrun("baxter_gazebo", "baxter_world", BaxterWorldTest)
