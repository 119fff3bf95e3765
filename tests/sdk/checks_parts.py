# SPDX-License-Identifier: BSD-3-Clause
"""Programs for grippers, head, lights, buttons and the screen; see checks_arms.py."""
from functools import partial

import cv2
import numpy as np
import rospy
from actionlib_msgs.msg import GoalStatus
from baxter_core_msgs.msg import URDFConfiguration
from checks_arms import ask_for_help, press_key
from control_msgs.msg import GripperCommandActionResult
from sensor_msgs.msg import Image
from table import check

from baxter_model.names import SIDES
from lab_testing.waiting import wait_for_message, wait_until

# gripper_keyboard.py: (key for the left gripper; shifted for the right one; what follows, [%])
GRIPPER_KEYS = (("c", (90, 100)), ("q", (0, 5)), ("i", (8, 22)), ("i", (23, 37)), ("u", (8, 22)), ("w", (95, 100)))
SHIFTED = str.maketrans("[]", "{}")
GRIPPER_STICKS = {"right": 0, "left": 3}  # horizontal axes of logitech's mapping
CALIBRATE = {"left": 1, "right": 3}  # btnRight, btnUp
TRIGGER = {"right": 2, "left": 5}
GRIPPER_GOALS = 6
NAVIGATORS = (*SIDES, "torso_left", "torso_right")
LIGHTS = ["%s_%s_light" % (where, which) for where in NAVIGATORS for which in ("inner", "outer")]
FRAGMENT = '<robot name="extra"><link name="left_gripper_base"/></robot>\n'


@check("gripper_keyboard.py")
def gripper_keyboard(lab):
    robot, lost = lab.robot, 0
    with lab.rosrun("baxter_examples", "gripper_keyboard.py") as program:
        program.expect("Controlling grippers")
        for side in SIDES:
            def typed(key, side=side):
                return press_key(program, key if side == "left" else key.upper().translate(SHIFTED), "command: ")
            lost += typed("r")
            robot.wait_for_flag(side, "calibrated", 0)
            for key, (low, high) in GRIPPER_KEYS:
                robot.wait_for_flag(side, "moving", 0)
                lost += typed(key)
                robot.wait_for_gripper(side, low, high)
            for key, percent in (("]", 30), ("[", 100)):
                lost += typed(key)
                begin = rospy.get_time()
                lost += typed("q")
                robot.wait_for_gripper(side, 0, 5)
                lab.note("close_at_%d_percent_s" % percent, rospy.get_time() - begin)
                lost += typed("w")
                robot.wait_for_gripper(side, 95, 100)
            lost += typed("s")
            robot.wait_for_flag(side, "moving", 0)
        program.press("\x1b")
        program.finish()
    return {"keys_lost": lost}


@check("gripper_joystick.launch logitech")
def gripper_joystick(lab):
    robot = lab.robot
    with lab.steered("gripper_joystick.launch", "logitech", "Ctrl-C to stop...") as (stick, program):
        ask_for_help(stick, program)
        for side in SIDES:
            seen = len(program.output)
            stick.press(CALIBRATE[side])
            program.expect(side + ": calibrate", beyond=seen)
            stick.release()
            robot.wait_for_gripper(side, 90, 100)
            stick.push(TRIGGER[side], -1.0)
            robot.wait_for_gripper(side, 0, 5)
            stick.push(GRIPPER_STICKS[side], 1.0)
            robot.wait_for_gripper(side, 50, 100)
            stick.push(GRIPPER_STICKS[side], -1.0)
            robot.wait_for_gripper(side, 0, 10)
            stick.push(GRIPPER_STICKS[side], 0.0)
            stick.push(TRIGGER[side], 1.0)
            robot.wait_for_gripper(side, 95, 100)
        program.stop()
    return {"sides": 2}


@check("gripper_cuff_control.py")
def cuff(lab):
    robot = lab.robot
    with lab.rosrun("baxter_examples", "gripper_cuff_control.py") as program:
        program.expect("Press cuff buttons")
        for side in SIDES:
            robot.press(side + "_upper_button", partial(robot.wait_for_gripper, side, 0, 5))
            robot.press(side + "_lower_button", partial(robot.wait_for_gripper, side, 95, 100))
            robot.press(side + "_lower_cuff", partial(robot.wait_for_lights, side, True))
            robot.wait_for_lights(side, False)
        program.stop()
    return {"sides": 2}


def judge_gripper_client(lab, side, program):
    results = []
    listener = rospy.Subscriber("/robot/end_effector/%s_gripper/gripper_action/result" % side,
                                GripperCommandActionResult, results.append)
    watch = lab.robot.watch()
    program.expect("Exiting - Gripper Action Test Example Complete")
    wait_until(lambda: len(results) >= GRIPPER_GOALS, "the results of all goals")
    listener.unregister()
    lab.robot.unwatch(watch)
    low, high = min(watch.percents[side]), max(watch.percents[side])
    ends = [(r.status.status, round(r.result.position, 1), r.result.reached_goal, r.result.stalled) for r in results]
    succeeded = sum(status == GoalStatus.SUCCEEDED for status, *_ in ends)
    assert low < 5 < 95 < high and succeeded == GRIPPER_GOALS, (
        "%.1f to %.1f %%; (status, position, reached_goal, stalled) of the goals: %s" % (low, high, ends))
    return {"low_percent": low, "high_percent": high, "succeeded": succeeded, "ends": ends}


@check("gripper_action_client.py")
def gripper_client(lab):
    with lab.rosrun("baxter_interface", "gripper_action_server.py", "-g", "left") as server:
        server.expect("Running. Ctrl-c to quit")
        with lab.rosrun("baxter_examples", "gripper_action_client.py", "-g", "left") as program:
            measured = judge_gripper_client(lab, "left", program)
            program.finish()
        server.stop()
    return measured


@check("gripper_action_client.launch")
def gripper_client_launch(lab):
    with lab.roslaunch("baxter_examples", "gripper_action_client.launch") as program:
        measured = judge_gripper_client(lab, "right", program)
        program.stop()
    return measured


@check("head_wobbler.py")
def head_wobbler(lab):
    watch = lab.robot.watch()
    with lab.rosrun("baxter_examples", "head_wobbler.py") as program:
        program.finish()
    lab.robot.unwatch(watch)
    assert watch.nodded and watch.span("head_pan") > 0.2, "nodded: %s; panned by %.2f rad" % (
        watch.nodded, watch.span("head_pan"))
    return {"pan_rad": watch.span("head_pan"), "end_rad": lab.robot.angles["head_pan"]}


@check("head_action_client.py")
def head_client(lab):
    watch = lab.robot.watch()
    with lab.rosrun("baxter_interface", "head_action_server.py") as server:
        server.expect("Running. Ctrl-c to quit")
        with lab.rosrun("baxter_examples", "head_action_client.py") as program:
            program.finish()
        server.stop()
    lab.robot.unwatch(watch)
    most, least, end = watch.high["head_pan"], watch.low["head_pan"], lab.robot.angles["head_pan"]
    assert most > 1.35 and least < -0.95 and abs(end) < 0.05, "%.2f, %.2f, %.2f rad" % (most, least, end)
    return {"most_rad": most, "least_rad": least, "end_rad": end}


@check("ik_service_client.py")
def ik_client(lab):
    for side in SIDES:
        with lab.rosrun("baxter_examples", "ik_service_client.py", "-l", side) as program:
            program.finish()
            program.expect("SUCCESS - Valid Joint Solution Found", 1.0)
    return {"sides": 2}


@check("analog_io_rampup.py")
def analog_ramp(lab):
    watch = lab.robot.watch()
    with lab.rosrun("baxter_examples", "analog_io_rampup.py") as program:
        program.finish()
    wait_until(lambda: lab.robot.analog["torso_fan"] == 0, "a fan at rest")
    lab.robot.unwatch(watch)
    values = {state["torso_fan"] for state in watch.analog}
    missing = set(range(0, 101, 10)) - values
    assert not missing, "values that the fan did not have: %s" % sorted(missing)
    return {"values": len(values)}


@check("digital_io_blink.py")
def digital_blink(lab):
    watch = lab.robot.watch()
    with lab.rosrun("baxter_examples", "digital_io_blink.py") as program:
        program.finish()
        place = program.expect("New state:  True", 1.0)
        program.expect("Final state: False", 1.0, place)
    lab.robot.unwatch(watch)
    assert watch.changes("left_outer_light") == 2, "the light changed %d times" % watch.changes("left_outer_light")
    return {"changes": 2}


@check("navigator_io.py -b")
def navigator_blink(lab):
    watch = lab.robot.watch()
    with lab.rosrun("baxter_examples", "navigator_io.py", "-b") as program:
        program.finish()
    lab.robot.unwatch(watch)
    fewest = min(map(watch.changes, LIGHTS))
    assert fewest >= 50, "a light changed %d times" % fewest
    return {"fewest_changes": fewest}


@check("navigator_io.py -i")
def navigator_input(lab):
    with lab.rosrun("baxter_examples", "navigator_io.py", "-i") as program:
        program.expect("Press input buttons")
        for number, button in enumerate(("ok", "back", "show")):
            lab.robot.press("left_button_" + button, partial(program.expect, "Button %d: True" % number))
            program.expect("Button %d: False" % number)
        lab.robot.turn("left_wheel", 3)
        program.expect("Wheel Increment: ")
        program.finish()
    return {"buttons": 3}


@check("xdisplay_image.py")
def display(lab):
    path = lab.folder / "picture.png"
    pixels = np.random.default_rng(1).integers(0, 256, (60, 100, 3), dtype=np.uint8).repeat(10, 0).repeat(10, 1)
    cv2.imwrite(str(path), pixels)
    with lab.rosrun("baxter_examples", "xdisplay_image.py", "-f", str(path)) as program:
        def shown(message):
            screen = np.frombuffer(message.data, np.uint8).reshape(message.height, message.width, 3)
            return np.array_equal(screen[:600, :1000, ::-1], pixels)
        wait_for_message("/robot/sim/screen", Image, shown)
        program.finish()
    return {"bytes": pixels.size}


@check("send_urdf_fragment.py")
def urdf_fragment(lab):
    path = lab.folder / "fragment.urdf.xacro"
    path.write_text(FRAGMENT)
    with lab.rosrun("baxter_examples", "send_urdf_fragment.py", "-f", str(path), "-l", "left_hand", "-j",
                    "left_gripper_base") as program:
        # The robot publishes its own description there.
        message = wait_for_message("/robot/urdf", URDFConfiguration, lambda message: message.link == "left_hand")
        assert '<link name="left_gripper_base"/>' in message.urdf, message.urdf
        program.stop()
    return {"characters": len(message.urdf)}
