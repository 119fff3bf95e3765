#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""A block is picked up by each device through its real interface; letting go stops the arm."""
import contextlib
import json
import os
import pty
import struct
import subprocess
import sys
import threading
import unittest
from pathlib import Path

import numpy as np
import rospkg
import rospy
import rostest
from baxter_core_msgs.msg import DigitalIOState
from bullet_sim_msgs.msg import Drag
from bullet_sim_msgs.srv import Press
from control_msgs.msg import JointJog
from gazebo_msgs.msg import ModelState
from gazebo_msgs.srv import GetModelState, SetModelState, SpawnModel
from geometry_msgs.msg import Point, Pose, Quaternion, TwistStamped
from std_msgs.msg import String

from arm_kinematics import Chain, solve
from baxter_interface import Gripper, Limb, RobotEnable
from baxter_model import BASE_HEIGHT_M, joint_names
from lab_testing.browser import Browser, why_not
from lab_testing.fake_joystick import FakeJoystick
from lab_testing.skipping import skip
from lab_testing.waiting import stretched, wait_for_message, wait_for_time, wait_until
from lab_web.libraries import fetched
from processes.ports import free_port
from urdf_model import parse_urdf

SIDE, LINK = "left", "baxter::left_gripper"
# In the frame base: the block's middle, and where the hand begins.
BLOCK, START = np.array((0.7, 0.3, -0.11)), np.array((0.66, 0.34, 0.04))
ABOVE, AT, LIFTED = BLOCK + (0.0, 0.0, 0.12), BLOCK + (0.0, 0.0, 0.01), BLOCK + (0.0, 0.0, 0.14)
NEAR_M, RATE_HZ, FULL_M_S, AT_REST = 0.008, 20.0, 0.2, 0.01
BOX = """<robot name="%s"><link name="box"><inertial><mass value="%g"/><inertia ixx="%g" iyy="%g" izz="%g" ixy="0"
  ixz="0" iyz="0"/></inertial>
  <collision><geometry><box size="%g %g %g"/></geometry></collision></link>
  <gazebo reference="box"><mu1>1.0</mu1><mu2>1.0</mu2></gazebo>%s</robot>"""
FIXED = '<link name="world"/><joint name="fix" type="fixed"><parent link="world"/><child link="box"/></joint>'


def box(name, mass, size, is_fixed=False):
    return BOX % (name, mass, *[1e-3 * mass] * 3, *size, FIXED if is_fixed else "")


class Keys:
    """servo_keyboard in a terminal. A key counts as held for 0.15 s: 6 mm."""

    def __init__(self, case):
        self._end, terminal = pty.openpty()
        case.start("rosrun", "steering_devices", "servo_keyboard", "_servos:=left_servo", "_grippers:=left",
                   stdin=terminal, stdout=terminal, stderr=terminal, env={**os.environ, "TERM": "xterm"})
        os.close(terminal)
        screen = []
        threading.Thread(target=self._read, args=(screen,), daemon=True).start()
        wait_until(lambda: b"hand:" in b"".join(screen), "the keys on screen", 60.0)

    def _read(self, screen):
        with contextlib.suppress(OSError):  # the terminal is closed
            while data := os.read(self._end, 4096):
                screen.append(data)

    def push(self, way):
        for value, keys in zip(way, ("ws", "ad", "rf"), strict=True):
            if abs(value) > 0.6 * NEAR_M:
                os.write(self._end, keys[value < 0.0].encode())

    def let_go(self):
        pass  # no key

    def close_gripper(self):
        os.write(self._end, b"g")

    def mark(self):
        os.write(self._end, b"1")


class Pad:
    """A gamepad's device file, joy_node and servo_gamepad."""

    def __init__(self, case):
        self._pad = FakeJoystick(sticks=[0.0] * 8, buttons=[0] * 11)
        case.addCleanup(self._pad.close)
        case.start("roslaunch", "--no-summary", "steering_devices", "baxter_gamepad.launch", "dev:=" + self._pad.path)
        self._pad.plug_in()

    def push(self, way):
        self._pad.press(5)
        for stick, value in zip((1, 0, 4), np.clip(5.0 * way / FULL_M_S, -1.0, 1.0), strict=True):
            self._pad.push(stick, value)

    def let_go(self):
        self._pad.release()

    def close_gripper(self):
        self._pad.press(1)

    def mark(self):
        self._pad.press(3)


class Cap:
    """HID reports of a SpaceMouse."""

    def __init__(self, case):
        start, self._end = os.pipe2(os.O_DIRECT)
        case.addCleanup(os.close, start)
        case.addCleanup(os.close, self._end)
        os.set_blocking(self._end, False)
        case.start("roslaunch", "--no-summary", "steering_devices", "baxter_spacemouse.launch",
                   "dev:=/proc/%d/fd/%d" % (os.getpid(), start))
        case.until_it_steers("delta_twist_cmds", TwistStamped, lambda: self.push(np.array((0.0, 0.0, 0.006))))
        self.let_go()

    def _report(self, number, *values):
        with contextlib.suppress(BlockingIOError):  # nobody reads yet
            os.write(self._end, bytes([number]) + struct.pack("<3h", *map(int, values)))

    def push(self, way):
        ahead, left, up = np.clip(5.0 * way / FULL_M_S, -1.0, 1.0) * 350.0
        self._report(1, -left, -ahead, -up)

    def let_go(self):
        self._report(1, 0, 0, 0)

    def close_gripper(self):
        os.write(self._end, bytes([3, 2, 0]))
        os.write(self._end, bytes([3, 0, 0]))

    mark = None


class LeadingRobot:
    """Another master with a robot whose arm moves as the way says."""

    def __init__(self, case):
        port = free_port(range(11430, 11435))
        address = "http://localhost:%d" % port
        case.start("roscore", "-p", str(port), env={**os.environ, "ROS_MASTER_URI": address})
        self._robot = case.start(sys.executable, str(Path(__file__).with_name("leading_robot.py")), text=True,
                                 stdin=subprocess.PIPE, env={**os.environ, "ROS_MASTER_URI": address})
        case.start("roslaunch", "--no-summary", "steering_devices", "baxter_leader.launch", "leader:=" + address)
        self._chain, self._names = case.chain, joint_names(SIDE)
        self._q = np.array(case.angles()) + 0.1
        case.until_it_steers("delta_joint_cmds", JointJog, lambda: self._say(cuff=True))
        self.let_go()

    def _say(self, **parts):
        angles = dict(zip(self._names, self._q.tolist(), strict=True))
        self._robot.stdin.write(json.dumps({"position": angles, **parts}) + "\n")
        self._robot.stdin.flush()

    def push(self, way):
        speed = np.clip(4.0 * way, -0.15, 0.15)
        self._q = self._q + np.linalg.pinv(self._chain.jacobian(self._q)) @ [*speed, 0.0, 0.0, 0.0] / RATE_HZ
        self._say(cuff=True)

    def let_go(self):
        self._say(cuff=False)

    def close_gripper(self):
        self._say(cuff=False, press="lower_button")

    def mark(self):
        self._say(cuff=False, press="navigator")


class Cuff:
    """The arm floats while its cuff is squeezed, and a spring pulls it, as the mouse does in the world's window."""

    def __init__(self, case):
        self._case = case
        self._press = rospy.ServiceProxy("/robot/sim/press", Press)
        self._drag = rospy.Publisher("/gazebo/drag", Drag, queue_size=1)
        case.start("roslaunch", "--no-summary", "steering_devices", "baxter_cuff.launch")
        self._held = False

    def _squeeze(self, is_held):
        if is_held is not self._held:
            self._press("left_lower_cuff", Press._request_class.PRESS if is_held else Press._request_class.RELEASE, 0)
            self._held = is_held

    def push(self, way):
        self._squeeze(True)
        target = self._case.hand() + np.clip(5.0 * way, -0.08, 0.08) + (0.0, 0.0, BASE_HEIGHT_M)
        self._drag.publish(Drag(LINK, True, Point(0.0, 0.0, 0.0), Point(*target)))

    def let_go(self):
        self._drag.publish(Drag(link=LINK, hold=False))
        self._squeeze(False)

    def close_gripper(self):
        self._tap("left_lower_button")

    mark = None

    def _tap(self, name):
        for action, state in ((Press._request_class.PRESS, 1), (Press._request_class.RELEASE, 0)):
            self._press(name, action, 0)
            wait_for_message("/robot/digital_io/%s/state" % name, DigitalIOState,
                             lambda message, state=state: message.state == state)


class PageKeys:
    """Keys that are held in the lab's page, in Chromium. They are let go within a step of the way's end."""

    # The page's slider of speed [%]: of 0.2 m/s.
    speed = 30

    def __init__(self, case):
        if reason := why_not():
            skip(case, reason)
        fetched(Path(rospkg.RosPack().get_path("lab_web")) / "page")
        token = "drive"
        case.start("rosrun", "lab_web", "lab_web", "--port", "0", "--token", token)
        case.addCleanup(rospy.delete_param, "/lab_web/address")
        wait_until(lambda: rospy.has_param("/lab_web/address"), "the page's address", 90.0)
        self.browser = Browser(1000, 800)
        case.addCleanup(self.browser.close)
        self.browser.open(rospy.get_param("/lab_web/address") + "?token=" + token)
        self.browser.wait("globalThis.lab?.state.connected && lab.state.robot && lab.view.revision !== null")
        self.browser.wait("!document.getElementById('control').disabled")
        self.browser.click("#control")
        self.browser.wait("lab.state.mine && lab.state.robot.enabled")
        self.browser.evaluate("document.getElementById('steering-open').open = true")
        self.browser.wait("!document.querySelector('#steer-up').disabled")
        self.browser.evaluate("""(() => {
            const slider = document.getElementById("steer-speed");
            slider.value = %d;
            slider.oninput();
            document.activeElement.blur();
        })()""" % self.speed)
        self._held = set()

    def _hold(self, keys):
        for name, kind in [*((name, "keyUp") for name in self._held - keys),
                           *((name, "keyDown") for name in keys - self._held)]:
            self.browser.call("Input.dispatchKeyEvent", type=kind, key=name, code="Key" + name.upper())
        self._held = keys

    def push(self, way):
        if self._held and not self.browser.evaluate("lab.steering.held.size"):
            self._hold(set())  # a page that was silent too long has let go
        self._hold({names[value < 0.0] for value, names in zip(way, ("ws", "ad", "rf"), strict=True)
                    if abs(value) > 0.5 * NEAR_M})

    def let_go(self):
        self._hold(set())

    def close_gripper(self):
        self.browser.click("#%s-close" % SIDE)

    def mark(self):
        self.browser.click("#steer-success")


class PagePad(PageKeys):
    """A gamepad of the browser's Gamepad API, as the page reads it."""

    speed = 100

    def __init__(self, case):
        super().__init__(case)
        self.browser.evaluate("""globalThis.pad = {connected: true, mapping: "standard", axes: [0, 0, 0, 0],
            buttons: Array.from({length: 17}, () => ({pressed: false}))}; navigator.getGamepads = () => [null, pad]""")
        self.browser.wait("!lab.steering.padLocked")

    def push(self, way):
        ahead, left, up = np.clip(5.0 * way / FULL_M_S, -1.0, 1.0).tolist()
        # A page that was silent too long has let go: the button has to be pressed again.
        self.browser.evaluate("pad.axes = [%g, %g, 0, %g]; pad.buttons[5].pressed = !lab.steering.padLocked"
                              % (-left, -ahead, -up))

    def let_go(self):
        self.browser.evaluate("pad.buttons[5].pressed = false; pad.axes = [0, 0, 0, 0]")

    def close_gripper(self):
        self._press(1)

    def mark(self):
        self._press(3)

    def _press(self, number):
        """Press a button as long as the page needs to see it."""
        for is_pressed in ("true", "false"):
            self.browser.evaluate("pad.buttons[%d].pressed = %s" % (number, is_pressed))
            self.browser.evaluate("new Promise((done) => setTimeout(done, 200))")


class PickTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        RobotEnable().enable()
        cls.limb, cls.gripper = Limb(SIDE), Gripper(SIDE)
        cls.chain = Chain.from_robot(parse_urdf(rospy.get_param("robot_description"), source="robot"), "base",
                                     SIDE + "_gripper")
        cls.listens = rospy.Publisher("/left_servo/delta_twist_cmds", TwistStamped, queue_size=1)
        wait_until(cls.listens.get_num_connections, "the servo", 120.0)
        spawn = rospy.ServiceProxy("/gazebo/spawn_urdf_model", SpawnModel)
        table = Pose(Point(0.8, 0.2, BASE_HEIGHT_M - 0.54), Quaternion(0, 0, 0, 1))
        spawn("table", box("table", 1.0, (0.6, 1.2, 0.78), True), "/", table, "world")
        spawn("block", box("block", 0.2, (0.04, 0.04, 0.08)), "/", cls.place_of_block(), "world")

    @staticmethod
    def place_of_block():
        return Pose(Point(*(BLOCK + (0.0, 0.0, BASE_HEIGHT_M))), Quaternion(0, 0, 0, 1))

    def start(self, *command, **options):
        """Start a program that ends with the test."""
        program = subprocess.Popen(command, **options)

        def end():
            program.terminate()
            try:
                program.wait(timeout=30.0)
            except subprocess.TimeoutExpired:
                program.kill()
                program.wait()
            if program.stdin is not None:
                program.stdin.close()
        self.addCleanup(end)
        return program

    def until_it_steers(self, topic, kind, push):
        """Push a little until the device's node steers: what is pushed before that is lost."""
        heard = []
        subscriber = rospy.Subscriber("/left_servo/" + topic, kind, heard.append)

        def steers():
            push()
            return heard
        wait_until(steers, "a command on " + topic, 90.0, interval_s=0.05)
        subscriber.unregister()

    def angles(self):
        return [self.limb.joint_angle(name) for name in joint_names(SIDE)]

    def hand(self):
        return self.chain.fk(self.angles())[:3, 3]

    def block_height(self):
        return rospy.ServiceProxy("/gazebo/get_model_state", GetModelState)("block", "world").pose.position.z

    def fly(self, device, goal):
        """Steer until the hand is at ``goal``, as one who sees it."""
        def there():
            way = goal - self.hand()
            if np.linalg.norm(way) < NEAR_M:
                return True
            device.push(way)
            wait_for_time(1.0 / RATE_HZ)
            return False
        wait_until(there, lambda: "the hand at %s, is at %s" % (goal, self.hand()), 150.0)
        device.let_go()
        return self.seconds_to_rest()

    def seconds_to_rest(self):
        begin = rospy.get_time()
        wait_until(lambda: rospy.get_time() > begin + 0.02 and max(
            map(abs, self.limb.joint_velocities().values())) < AT_REST, "the arm to rest", 30.0)
        return rospy.get_time() - begin

    def pick(self, kind):
        down = np.diag((1.0, -1.0, -1.0, 1.0))
        down[:3, 3] = START
        self.gripper.open(block=True)
        state = ModelState(model_name="block", pose=self.place_of_block(), reference_frame="world")
        seed = np.array([-0.3, -0.6, -0.2, 1.4, 0.1, 0.8, 0.0])
        goal = solve(self.chain, down, seed).q
        self.limb.move_to_joint_positions(dict(zip(joint_names(SIDE), goal.tolist(), strict=True)), timeout=30.0)
        rospy.ServiceProxy("/gazebo/set_model_state", SetModelState)(state)
        marks = []
        subscriber = rospy.Subscriber("/steering/mark", String, lambda message: marks.append(message.data))
        self.addCleanup(subscriber.unregister)
        device = kind(self)
        rests = [self.fly(device, ABOVE), self.fly(device, AT)]
        device.close_gripper()
        wait_until(lambda: self.gripper.position() < 90.0 and not self.gripper.moving(), "a closed gripper", 60.0)
        if kind is not Cuff:  # a hand that floats tilts, and loses the block
            rests.append(self.fly(device, LIFTED))
            self.assertGreater(self.block_height() - BASE_HEIGHT_M, BLOCK[2] + 0.08)
        if device.mark is not None:
            device.mark()
            wait_until(lambda: marks, "a mark", 30.0)
            self.assertEqual(marks, ["success"])
        print("%s: done; at rest after %s s" % (kind.__name__, " ".join("%.2f" % rest for rest in rests)), flush=True)
        if kind is not Cuff:  # what floats ends in its own time
            # A key counts as held for 0.15 s; then the servo's time-out or a zero, braking, and delays.
            self.assertLess(max(rests), 0.1 + (0.15 if kind is Keys else 0.0) + stretched(0.15))

    def test_keys(self):
        self.pick(Keys)

    def test_gamepad(self):
        self.pick(Pad)

    def test_spacemouse(self):
        self.pick(Cap)

    def test_leader(self):
        self.pick(LeadingRobot)

    def test_page_keys(self):
        self.pick(PageKeys)

    def test_page_gamepad(self):
        self.pick(PagePad)

    def test_cuff(self):
        self.pick(Cuff)


if __name__ == "__main__":
    rospy.init_node("devices_pick")
    rostest.rosrun("workspace_tests", "devices_pick", PickTest, sys.argv)
