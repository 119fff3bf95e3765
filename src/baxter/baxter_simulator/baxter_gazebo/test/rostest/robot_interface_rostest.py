#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The interface table row by row: a message on each published topic, an effect of each topic that the robot listens to.

The right arm carries no gripper, so that tests can describe custom tools to the robot there.
"""
import dataclasses
import unittest
from pathlib import Path

import roslib.message
import rospkg
import rospy
import yaml
from baxter_core_msgs.msg import EndEffectorCommand, HeadPanCommand, JointCommand, URDFConfiguration
from bullet_sim_msgs.srv import Press
from robot_client import POSITION, RAW, SIDES, TORQUE, VELOCITY, Robot, joints
from sensor_msgs.msg import Image

from baxter_conformance import comparison
from baxter_conformance.reader import read
from baxter_model.interface import physical_robot
from baxter_sim_hardware.arms import collision
from baxter_sim_hardware.topics import coverage, interface
from lab_testing.waiting import stretched, wait_for_message, wait_until

NEUTRAL = {name: angle for side in SIDES
           for name, angle in zip(joints(side), (0.0, -0.55, 0.0, 0.75, 0.0, 1.26, 0.0), strict=True)}
BATCH = 40  # topics listened to at a time
LISTENING = [row for row in interface.TOPICS if not row.is_published]
# Beginning of the names of their tests, and the rows whose effect another row's test sees.
EFFECT = "test_effect_of_"
SEEN_WITH_OTHERS = {"suppress_hand_overwrench_safety": "suppress_contact_safety"}


def resolved(name):
    return name if name.startswith("/") else "/robot/" + name


class Table:
    """Subscribers and publishers of rows by their keys, made when first asked for."""

    def __init__(self):
        self._rows = {row.key: row for row in interface.TOPICS}
        self._newest, self._subscribers, self._publishers = {}, {}, {}

    def _names(self, key):
        row = self._rows[key]
        return roslib.message.get_message_class(row.type), {part: resolved(name) for part, name in row.names()}

    def newest(self, key, part=None):
        """The newest message of a published row; waits for the first."""
        kind, names = self._names(key)
        name = names[part]
        if name not in self._subscribers:
            self._subscribers[name] = rospy.Subscriber(
                name, kind, lambda message: self._newest.update({name: message}), queue_size=1)
        return wait_until(lambda: self._newest.get(name), "a message on " + name)

    def publish(self, key, message, part=None):
        """Publish on a listening row, once the robot is connected. `message`: its fields, or a message."""
        kind, names = self._names(key)
        name = names[part]
        if name not in self._publishers:
            self._publishers[name] = rospy.Publisher(name, kind, queue_size=20, tcp_nodelay=True)
            wait_until(self._publishers[name].get_num_connections, "the robot listens to " + name)
        self._publishers[name].publish(message if isinstance(message, kind) else kind(*message))

    def until(self, condition, what, *sends):
        """Repeat publish(*send) for each of `sends` at about 50 Hz of wall time until the condition holds."""
        def step():
            for send in sends:
                self.publish(*send)
            return condition()

        wait_until(step, what, interval_s=0.02)


class RobotInterfaceTest(unittest.TestCase):
    """One method for each row that the robot listens to, by its key: test_effect_of_KEY."""

    @classmethod
    def setUpClass(cls):
        cls.robot, cls.table = Robot(), Table()
        cls.press = staticmethod(rospy.ServiceProxy("/robot/sim/press", Press))

    def see(self, key, part, condition, what):
        wait_until(lambda: condition(self.table.newest(key, part)), what)

    def refused(self, text):
        wait_until(lambda: any(text in line for line in self.robot.lines), "the log says '%s'" % text)

    def neutral(self):
        self.robot.restart()
        self.robot.move(NEUTRAL)

    def set_both(self, key, name, value):
        """Send both limbs a setting, and wait until the diagnostics show it under `name`."""
        for side in SIDES:
            self.table.publish(key, (value,), side)
        self.robot.wait_setting(name, value)

    def test_conformance_misses_only_what_is_left_out_with_a_reason(self):
        folder = Path(rospkg.RosPack().get_path("baxter_sim_hardware"))
        table = yaml.safe_load((folder / "config" / "topics_not_served.yaml").read_text())
        kinds = coverage.physical()
        # On a slow machine the cameras come some time after the robot.
        for name in ("/cameras/list", "/cameras/open", "/cameras/close", "/cameras/reset"):
            rospy.wait_for_service(name, stretched(90.0))
        wait_for_message("/cameras/right_hand_camera/image", Image)
        # The frames of the set-points come with reference_frames:=true; nobody need wait for them.
        awaited = dataclasses.replace(physical_robot(), frames=tuple(
            name for name in physical_robot().frames if not name.startswith("reference/")))
        findings = comparison.compare(physical_robot(), read(awaited, stretched(20.0)))
        left = [one for one in findings if one.is_public and one.verdict is not comparison.Verdict.MET
                and not coverage.reason_to_leave_out(one.name, kinds.get(one.name, ""), table)]
        # rostest starts no rosout node.
        self.assertEqual([one.name for one in left], ["/rosout_agg", "reference/base"], left)

    # -- state

    def test_effect_of_set_super_enable(self):
        self.robot.restart()
        self.table.publish("set_super_enable", (False,))
        self.see("state", None, lambda state: not state.enabled, "disabled")

    def test_effect_of_set_super_stop(self):
        self.robot.restart()
        self.table.publish("set_super_stop", ())
        for key, part in (("state", None), ("assembly_state", "torso"), ("limb_state", "left")):
            self.see(key, part, lambda state: state.stopped, "%s stopped" % key)

    def test_effect_of_set_super_reset(self):
        self.test_effect_of_set_super_stop()
        self.table.publish("set_super_reset", ())
        self.see("state", None, lambda state: not state.stopped, "reset")

    def test_effect_of_joint_state_publish_rate(self):
        self.table.publish("joint_state_publish_rate", (100,))
        wait_until(lambda: abs((self.robot.history[-1].header.stamp - self.robot.history[-2].header.stamp).to_sec()
                               - 0.01) < 1e-6, "joint states 10 ms apart")
        self.table.publish("joint_state_publish_rate", (50,))

    # -- limbs

    def test_effect_of_joint_command(self):
        self.neutral()
        for side in SIDES:
            self.table.publish("joint_command", JointCommand(POSITION, [0.9], [side + "_w1"]), side)
        wait_until(lambda: self.robot.error({side + "_w1": 0.9 for side in SIDES}) < 2e-3, "both w1 at 0.9")

    def test_effect_of_joint_position_controller(self):
        self.neutral()
        for side in SIDES:
            self.table.publish("joint_position_controller", (0.9,), (side, "w1"))
        wait_until(lambda: self.robot.error({side + "_w1": 0.9 for side in SIDES}) < 2e-3, "both w1 at 0.9")

    def test_effect_of_joint_velocity_controller(self):
        self.neutral()
        self.table.until(lambda: max(self.robot.positions[side + "_w1"] for side in SIDES) < 1.0, "both w1 turn",
                         *(("joint_velocity_controller", (-0.4,), (side, "w1")) for side in SIDES))

    def test_effect_of_joint_effort_controller(self):
        self.neutral()
        self.table.until(lambda: min(self.robot.positions[side + "_w2"] for side in SIDES) > 0.2, "both w2 turn",
                         *(("joint_effort_controller", (1.0,), (side, "w2")) for side in SIDES))

    def test_effect_of_head_position_controller(self):
        self.robot.restart()
        self.table.publish("head_position_controller", (0.4,))
        self.see("head_state", None, lambda state: abs(state.pan - 0.4) < 0.01, "head at 0.4")

    def test_effect_of_joint_command_timeout(self):
        """One velocity command lasts until its time-out."""
        self.neutral()
        self.set_both("joint_command_timeout", "command time-out [s]", 1.5)
        self.robot.command(VELOCITY, {side + "_w1": -0.4 for side in SIDES})
        wait_until(lambda: max(self.robot.positions[side + "_w1"] for side in SIDES) < 0.9, "0.36 rad further")

    def test_effect_of_set_speed_ratio(self):
        self.neutral()
        self.set_both("set_speed_ratio", "speed ratio", 0.0)
        here = self.robot.positions
        self.robot.command(POSITION, {side + "_w1": 0.5 for side in SIDES})
        self.robot.wait_sim(0.5)
        self.assertLess(self.robot.error({name: here[name] for name in NEUTRAL}), 1e-3)
        self.set_both("set_speed_ratio", "speed ratio", 1.0)
        wait_until(lambda: self.robot.error({side + "_w1": 0.5 for side in SIDES}) < 2e-3, "w1 at 0.5")

    def test_effect_of_inverse_dynamics_command(self):
        """Raw set-points with a velocity are led by that velocity; invalid ones are refused."""
        for side in SIDES:
            self.table.publish("inverse_dynamics_command", ([], [0.1] * 6, [], [], rospy.Duration()), side)
        self.refused("must have 7 finite numbers")
        self.neutral()
        goal = dict(NEUTRAL)

        def led():
            return min(self.robot.positions[side + "_w1"] - NEUTRAL[side + "_w1"] for side in SIDES) > 5e-3

        def send():
            self.robot.command(RAW, goal)
            for side in SIDES:
                self.table.publish("inverse_dynamics_command", ([], [3.0] * 7, [], [], rospy.Duration()), side)
            return led()

        wait_until(send, "set-points led by their velocity")

    def test_effect_of_command_twist_stamped(self):
        self.neutral()
        for side in SIDES:
            start = self.table.newest("endpoint_state", side).pose.position.z

            def lifted(side=side, start=start):
                return self.table.newest("endpoint_state", side).pose.position.z > start + 0.03

            message = roslib.message.get_message_class("geometry_msgs/TwistStamped")()
            message.header.frame_id = "base"
            message.twist.linear.z = 0.1
            self.table.until(lifted, "%s tip 3 cm higher" % side, ("command_twist_stamped", message, side))

    def test_effect_of_command_velocity_tozero(self):
        self.neutral()
        self.set_both("set_speed_ratio", "speed ratio", 0.1)
        goal = {side + "_w1": 0.0 for side in SIDES}
        self.robot.command(POSITION, goal)
        wait_until(lambda: min(abs(self.robot.velocities[name]) for name in goal) > 0.1, "both wrists move")
        for side in SIDES:
            self.table.publish("command_velocity_tozero", (True,), side)
        wait_until(lambda: max(abs(self.robot.velocities[name]) for name in goal) < 1e-3, "both wrists stand")
        self.assertGreater(self.robot.error(goal), 0.05)

    # -- what an arm runs into

    def crossed(self):
        """Both arms, stretched forward, press against each other."""
        self.robot.restart()
        self.robot.move(dict.fromkeys(NEUTRAL, 0.0))
        self.robot.command(POSITION, {"left_s0": -1.5, "right_s0": 1.5})
        for side in SIDES:
            self.see("collision_avoidance_state", side, lambda state: state.other_arm, "%s arm is touched" % side)

    def test_effect_of_suppress_collision_avoidance(self):
        self.crossed()
        kind = collision.AVOIDANCE
        self.table.until(lambda: all(not self.table.newest("collision_avoidance_state", side).collision_object
                                     for side in SIDES), "nothing listed", *((kind, (), side) for side in SIDES))
        self.see("collision_avoidance_state", "left", lambda state: state.other_arm, "listed again")

    def press_hard(self, *kinds):
        """Have crossed arms push with all they have, avoidance suppressed; `kinds` suppressed as well."""
        sends = [(kind, (), side) for kind in (collision.AVOIDANCE, *kinds) for side in SIDES]
        wanted = not kinds
        self.table.until(lambda: all(self.table.newest("collision_detection_state", side).collision_state == wanted
                                     for side in SIDES), "collision detected: %s" % wanted, *sends)

    def test_effect_of_suppress_contact_safety(self):
        self.crossed()
        self.press_hard()
        self.press_hard(collision.CONTACT, collision.OVERWRENCH)

    def test_effect_of_suppress_body_avoidance(self):
        self.neutral()
        for side, sign in (("left", -1.0), ("right", 1.0)):
            self.robot.command(POSITION, {side + "_s0": sign * 1.7, side + "_s1": -0.3, side + "_e1": 2.6})
            self.see("collision_avoidance_state", side, lambda state: "base" in state.collision_object, "body touched")
            self.table.until(lambda side=side: "base" not in self.table.newest(
                "collision_avoidance_state", side).collision_object, "body not listed",
                (collision.BODY_AVOIDANCE, (), side))
            self.robot.move({name: angle for name, angle in NEUTRAL.items() if name.startswith(side)})

    def test_effect_of_suppress_cuff_interaction(self):
        self.neutral()
        for side in SIDES:
            self.assertTrue(self.press(side + "_lower_cuff", "press", 0).success)
            self.see("digital_io", side + "_lower_cuff", lambda state: state.state == 1, "cuff squeezed")
            wrist = side + "_w1"

            def moved(wrist=wrist, side=side):
                self.robot.command(POSITION, {wrist: 0.9})
                return abs(self.robot.positions[wrist] - 0.9) < 2e-3

            before = len(self.robot.lines)
            wait_until(lambda side=side, before=before: self.robot.command(POSITION, {side + "_w1": 0.9}) or any(
                "its cuff is squeezed" in line for line in self.robot.lines[before:]), "commands refused")
            self.table.until(moved, "commands obeyed again", (collision.CUFF, (), side))
            self.assertTrue(self.press(side + "_lower_cuff", "release", 0).success)

    def test_effect_of_suppress_gravity_compensation(self):
        self.neutral()

        def fallen():
            self.robot.command(TORQUE, dict.fromkeys(NEUTRAL, 0.0))
            return all(self.robot.error({side + "_s1": NEUTRAL[side + "_s1"]}) > 0.1 for side in SIDES)

        self.table.until(fallen, "both arms fall", *((collision.GRAVITY, (), side) for side in SIDES))
        self.neutral()

    # -- head, panel

    def test_effect_of_command_head_pan(self):
        self.robot.restart()
        self.table.publish("command_head_pan", HeadPanCommand(0.5, 1.0, 1))
        self.see("head_state", None, lambda state: abs(state.pan - 0.5) < 0.02, "head at 0.5 rad")

    def test_effect_of_command_head_nod(self):
        self.robot.restart()
        self.table.until(lambda: self.table.newest("head_state").isNodding, "nodding", ("command_head_nod", (True,)))

    def test_effect_of_digital_io_command(self):
        self.table.publish("digital_io_command", ("left_inner_light", True))
        self.see("digital_io", "left_inner_light", lambda state: state.state == 1, "light on")
        self.see("navigator", "left", lambda state: state.lights[0], "the navigator's light on")

    def test_effect_of_analog_io_command(self):
        self.table.publish("analog_io_command", ("torso_fan", 42))
        self.see("analog_io", "torso_fan", lambda state: state.value == 42.0, "fan at 42")
        self.see("analog_io_uint32", "torso_fan", lambda state: state.data == 42, "fan at 42")

    # -- grippers

    def test_effect_of_gripper_command(self):
        self.robot.restart()
        for sequence, side in enumerate(SIDES, 7):
            state = self.table.newest("gripper_state", side)
            self.table.publish("gripper_command", EndEffectorCommand(
                state.id, "configure", "{}", "interface_test", sequence), side)
        self.see("gripper_state", "left", lambda state: (state.command_sender, state.command_sequence) == (
            "interface_test", 7), "the gripper's echo")

    def test_effect_of_gripper_set_properties(self):
        kind = roslib.message.get_message_class("baxter_core_msgs/EndEffectorProperties")
        wanted = kind(id=131073, ui_type=kind.PASSIVE_GRIPPER, product="interface test")
        self.table.until(lambda: self.table.newest("gripper_properties", "right").product == "interface test",
                         "the tool's properties", ("gripper_set_properties", wanted, "right"))

    def test_effect_of_gripper_set_state(self):
        self.test_effect_of_gripper_set_properties()
        kind = roslib.message.get_message_class("baxter_core_msgs/EndEffectorState")
        self.table.until(lambda: self.table.newest("gripper_state", "right").position == 33.0,
                         "the tool's state", ("gripper_set_state", kind(id=131073, position=33.0), "right"))

    # -- senses

    def test_effect_of_set_sonars_enabled(self):
        for mask in (0, 4095):
            self.table.publish("set_sonars_enabled", (mask,))
            self.see("sonars_enabled", None, lambda echo, mask=mask: echo.data == mask, "sonars %d" % mask)

    def test_effect_of_set_lights(self):
        self.table.until(lambda: self.table.newest("sonar_lights").data == 0x8AAA, "the lights asked for",
                         ("set_lights", (0x8AAA,)))

    def test_effect_of_set_green_level(self):
        self.table.publish("set_green_level", (60.0,))
        self.see("sonar_green_level", None, lambda level: level.data == 60.0, "green at 60")

    def test_effect_of_set_red_level(self):
        self.table.publish("set_red_level", (20.0,))
        self.see("sonar_red_level", None, lambda level: level.data == 20.0, "red at 20")

    # -- screen, description, maintenance

    def test_effect_of_xdisplay(self):
        picture = Image(width=2, height=1, encoding="8UC3", step=6, data=bytes(range(1, 7)))
        self.table.publish("xdisplay", picture)
        self.see("screen", None, lambda image: image.data[:9] == bytes([3, 2, 1, 6, 5, 4, 0, 0, 0]), "two pixels")

    def test_effect_of_urdf_fragment(self):
        fragment = URDFConfiguration(rospy.Time(7), "left_hand", "left_gripper_base",
                                     '<robot name="tool"><link name="tool"/></robot>')
        self.table.publish("urdf_fragment", fragment)
        self.refused("urdf fragment on link 'left_hand' is passed on")
        latched = rospy.wait_for_message("/robot/urdf", URDFConfiguration, 90.0)
        self.assertEqual(latched.joint, "left_gripper_base")

    def procedure(self, name):
        self.robot.restart()
        kind = roslib.message.get_message_class("baxter_maintenance_msgs/%sEnable" % name)
        for side in SIDES:
            ask = ("procedure_enable_" + name, kind(isEnabled=True, uid="sdk"), side)

            def status(side=side):
                return self.table.newest("procedure_status_" + name, side)

            self.table.until(lambda status=status: status().isEnabled and status().controlUid == "sdk", "running", ask)
            self.table.publish("procedure_enable_" + name, kind(isEnabled=False, uid="sdk"), side)
            wait_until(lambda status=status: not status().isEnabled, "ended")

    def test_effect_of_procedure_enable_Tare(self):
        self.procedure("Tare")

    def test_effect_of_procedure_enable_CalibrateArm(self):
        self.procedure("CalibrateArm")

    def test_effect_of_updater_start(self):
        self.table.publish("updater_start", ("no such update",))
        self.see("updater_status", None, lambda status: status.status == 1, "invalid")

    def test_effect_of_updater_stop(self):
        self.test_effect_of_updater_start()
        self.table.publish("updater_stop", ())
        self.see("updater_status", None, lambda status: status.status == 0, "idle")

    def test_every_published_row_has_messages_of_its_type(self):
        """Name, type, latch; a unit test checks that rates are exact in simulation time."""
        rows = [(resolved(name), row) for row in interface.TOPICS if row.is_published for _, name in row.names()]
        for first in range(0, len(rows), BATCH):
            batch = rows[first:first + BATCH]
            headers = {}
            subscribers = [rospy.Subscriber(
                name, rospy.AnyMsg, lambda message, name=name, headers=headers: headers.setdefault(
                    name, message._connection_header)) for name, _ in batch]
            names = {name for name, _ in batch}
            wait_until(lambda headers=headers, names=names: len(headers) == len(names),
                     "a message on each of %s" % sorted(names))
            for subscriber in subscribers:
                subscriber.unregister()
            for name, row in batch:
                header, kind = headers[name], roslib.message.get_message_class(row.type)
                self.assertEqual((header["type"], header["md5sum"]), (row.type, kind._md5sum), name)
                self.assertEqual(header.get("latching") == "1", row.rate == interface.LATCHED, name)

    def test_every_listening_row_has_an_effect_here(self):
        tested = {name.removeprefix(EFFECT) for name in dir(self) if name.startswith(EFFECT)}
        self.assertEqual(tested | set(SEEN_WITH_OTHERS), {row.key for row in LISTENING})


if __name__ == "__main__":
    import rostest

    rospy.init_node("robot_interface_rostest")
    rostest.rosrun("baxter_gazebo", "robot_interface", RobotInterfaceTest)
