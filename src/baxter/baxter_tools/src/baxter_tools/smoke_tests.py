# SPDX-License-Identifier: BSD-3-Clause
"""Short tests of everything the robot has; each is a function that raises when something is wrong."""
from __future__ import annotations

import concurrent.futures
import itertools
import os
from typing import TYPE_CHECKING, Any

import cv_bridge
import numpy as np
import rospy
from baxter_core_msgs.msg import AnalogIOStates
from sensor_msgs.msg import Image, JointState

from baxter_dataflow import wait_for
from baxter_dataflow.ros_clock import RosClock
from baxter_interface import CameraController, DigitalIO, Gripper, Head, Limb, RobotEnable, startup
from baxter_interface.camera import list_cameras
from baxter_interface.navigator import LOCATIONS
from baxter_interface.programs import ProgramFailed, expect
from baxter_model import ELECTRIC, SIDES, poses

if TYPE_CHECKING:
    from collections.abc import Callable
    from datetime import datetime

ZERO_G_S = 10.0
MESSAGE_TIMEOUT_S = 5.0
MOVE_TIMEOUT_S = 20.0
HEAD_SPEED = 0.05
NODS = 3
PICTURE_S = 5.0
CAMERA_S = 10.0
BLINKS, BLINK_S = 9, 0.1
SCREEN = (600, 1024)
# Postures from shoulder to wrist [rad], the same numbers on both arms; neutral comes before and after them.
POSTURES = ((0.5, -0.8, 2.8, 0.15, 0.0, 1.9, 2.8), (-0.1, -0.8, -1.0, 2.5, 0.0, -1.4, -2.8))
# A pose that the left arm can reach: position [m], quaternion x y z w, in base.
REACHABLE = ((0.657579481614, 0.851981417433, 0.0388352386502),
             (-0.366894936773, 0.885980397775, 0.108155782462, 0.262162481772))
LIGHTS = tuple("%s_%s_light" % pair for pair in itertools.product(LOCATIONS, ("inner", "outer")))
CAMERA_RESOLUTION = (960, 600)
# The cameras' settings after the tests.
USUAL_RESOLUTION, USUAL_FPS = (640, 400), 25.0


def test_enable(say: Callable[[str], object]) -> None:
    """The robot can be enabled and disabled."""
    robot = RobotEnable()
    robot.enable()
    say("enabled for %.0f s: squeeze a cuff and move the arm, if you like" % ZERO_G_S)
    RosClock().sleep(ZERO_G_S)
    robot.disable()


def test_messages(say: Callable[[str], object]) -> None:
    """Joint states and analog states arrive."""
    for topic, kind in (("robot/joint_states", JointState), ("robot/analog_io_states", AnalogIOStates)):
        say("waiting for %s" % topic)
        seen = []
        subscriber = rospy.Subscriber(topic, kind, seen.append, queue_size=1)
        try:
            name = str(subscriber.resolved_name)
            startup.wait_for_start([startup.message_arrives(name, lambda seen=seen: bool(seen))],
                                   MESSAGE_TIMEOUT_S)
        finally:
            subscriber.unregister()


def test_services(say: Callable[[str], object]) -> None:
    """The left arm's inverse kinematics finds a posture."""
    angles = Limb("left").ik(REACHABLE)
    say("a posture for the pose: %s" % ", ".join("%s %.3f" % item for item in angles.items()))


def test_head(say: Callable[[str], object]) -> None:
    """The head turns and nods, and the screen shows pictures."""
    RobotEnable().enable()
    head = Head()
    for angle in (0.0, 1.0, -1.0, 0.0):
        say("turning the head to %.1f rad" % angle)
        head.set_pan(angle, speed=HEAD_SPEED)
    for _ in range(NODS):
        head.command_nod()
    screen = rospy.Publisher("/robot/xdisplay", Image, latch=True, queue_size=1)
    rows, columns = np.mgrid[0:SCREEN[0], 0:SCREEN[1]]
    shade = (255 * columns // SCREEN[1]).astype(np.uint8)
    check = np.where((rows // 75 + columns // 64) % 2, 255, 0).astype(np.uint8)
    for picture in (shade, check):
        screen.publish(cv_bridge.CvBridge().cv2_to_imgmsg(np.dstack([picture] * 3), encoding="bgr8"))
        RosClock().sleep(PICTURE_S)


def test_move_arms(say: Callable[[str], object]) -> None:
    """Both arms move through four postures."""
    RobotEnable().enable()
    limbs = [Limb(side) for side in SIDES]
    with concurrent.futures.ThreadPoolExecutor(len(limbs)) as workers:
        neutral = {limb.name: poses().angles("neutral", limb.name) for limb in limbs}
        stops = [neutral, *({limb.name: dict(zip(limb.joint_names(), posture, strict=True)) for limb in limbs}
                            for posture in POSTURES), neutral]
        for number, stop in enumerate(stops, 1):
            say("moving both arms to posture %d of %d" % (number, len(stops)))
            moves = [workers.submit(limb.move_to_joint_positions, stop[limb.name], MOVE_TIMEOUT_S) for limb in limbs]
            for limb, move in zip(limbs, moves, strict=True):
                expect(move.result(), "the %s arm did not get to posture %d" % (limb.name, number))


def test_grippers(say: Callable[[str], object]) -> None:
    """Both electric grippers calibrate, open, close and take positions and speeds."""
    RobotEnable().enable()
    for gripper in [Gripper(side) for side in SIDES]:
        if gripper.type() != ELECTRIC.name:
            raise ProgramFailed("%s is of type %s; this test is for two electric grippers"
                                % (gripper.name, gripper.type()))
        say("%s: reboot, calibrate" % gripper.name)
        expect(gripper.reboot(), "%s did not restart" % gripper.name)
        expect(gripper.calibrate(), "%s did not calibrate" % gripper.name)
        for name, command in (
                ("close", gripper.close), ("open", gripper.open),
                *(("position %d" % p, lambda block, p=p, g=gripper: g.command_position(p, block=block))
                  for p in (50.0, 75.0, 0.0, 100.0))):
            say("%s: %s" % (gripper.name, name))
            expect(command(block=True), "%s did not do: %s" % (gripper.name, name))
        for velocity in (50.0, 25.0, 100.0):
            say("%s: velocity %d" % (gripper.name, velocity))
            gripper.set_velocity(velocity)
            expect(gripper.close(block=True) and gripper.open(block=True),
                   "%s did not close and open at velocity %d" % (gripper.name, velocity))
        gripper.set_parameters(defaults=True)


def test_blink_leds(say: Callable[[str], object]) -> None:
    """Every light of the navigators follows."""
    for name in LIGHTS:
        say("blinking %s" % name)
        light = DigitalIO(name)
        before = light.state
        for turn in range(BLINKS):
            light.set_output((turn % 2 == 0) != before)
            RosClock().sleep(BLINK_S)
        light.set_output(before)


def test_cameras(say: Callable[[str], object]) -> None:
    """Every camera that has power opens, and its pictures arrive; they are shown on the screen."""
    names = list_cameras(MESSAGE_TIMEOUT_S)
    expect(names, "no camera has power")
    screen = rospy.Publisher("/robot/xdisplay", Image, queue_size=1)
    try:
        for name in names:
            say("opening %s at %dx%d" % (name, *CAMERA_RESOLUTION))
            camera = CameraController(name)
            camera.resolution = CAMERA_RESOLUTION
            sizes = set()

            def on_image(message: Any, sizes=sizes) -> None:
                sizes.add((message.width, message.height))
                screen.publish(message)

            subscriber = rospy.Subscriber("/cameras/%s/image" % name, Image, on_image, queue_size=1)
            try:
                wait_for(lambda sizes=sizes: CAMERA_RESOLUTION in sizes, MESSAGE_TIMEOUT_S,
                         timeout_msg="no picture of %s at %dx%d came; sizes seen: %s" % (
                             name, *CAMERA_RESOLUTION, sizes or "none"))
                RosClock().sleep(CAMERA_S)
            finally:
                subscriber.unregister()
                camera.close()
    finally:
        for name in ("left_hand_camera", "right_hand_camera"):
            if name in list_cameras(MESSAGE_TIMEOUT_S):
                camera = CameraController(name)
                camera.resolution = USUAL_RESOLUTION
                camera.fps = USUAL_FPS


TESTS = {
    "Enable": test_enable,
    "Messages": test_messages,
    "Services": test_services,
    "Head": test_head,
    "MoveArms": test_move_arms,
    "Grippers": test_grippers,
    "BlinkLEDs": test_blink_leds,
    "Cameras": test_cameras,
}


def log_file_name(serial: str, version: str, now: datetime) -> str:
    """Name the log file of a robot's tests at `now`, a datetime."""
    return "%s-%d.%d.%d-rsdk-%s.smoketest" % (serial.replace(os.sep, "_"), now.month, now.day, now.year, version)
