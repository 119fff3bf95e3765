# SPDX-License-Identifier: BSD-3-Clause
"""The vendor's tools; see checks_arms.py."""
from sensor_msgs.msg import Image
from table import check

from baxter_model.names import SIDES, joint_names
from lab_testing.waiting import wait_for_message

# enable_robot.py: option, and (enabled, stopped) afterwards
SWITCHES = (("-d", False, False), ("-e", True, False), ("-s", True, False), ("-S", False, True), ("-e", True, False),
            ("-S", False, True), ("-r", False, False), ("-e", True, False))
TUCKS = (("-t", "tucked"), ("-t", "tucked"), ("-u", "untucked"), ("-u", "untucked"))
SMOKE_TESTS = ("Enable", "Messages", "Services", "Head", "MoveArms", "Grippers", "BlinkLEDs", "Cameras")
LONG_LIMIT_S = 1800.0  # only keeps a run from hanging: minutes of simulated time on a slow machine
CAMERA = "left_hand_camera"


@check("enable_robot.py")
def enable(lab):
    for option, enabled, stopped in SWITCHES:
        with lab.rosrun("baxter_tools", "enable_robot.py", option) as program:
            program.finish()
            if option == "-s":
                program.expect("enabled: True", 1.0)
        lab.robot.wait_for_state(enabled, stopped)
    return {"options": len(SWITCHES)}


@check("tuck_arms.py")
def tuck(lab):
    offs = []
    for option, pose in TUCKS:
        with lab.rosrun("baxter_tools", "tuck_arms.py", option) as program:
            program.finish()
        offs.append(lab.at(lab.robot.pose(pose), 0.1))
    return {"off_rad": max(offs), "gripper_percent": min(lab.robot.grippers[side].position for side in SIDES)}


@check("camera_control.py")
def cameras(lab):
    topic = "/cameras/%s/image" % CAMERA
    with lab.rosrun("baxter_tools", "camera_control.py", "-l") as program:
        program.finish()
        program.expect(CAMERA, 1.0)
    for options in (("-c", CAMERA), ("-o", CAMERA, "-r", "640x400"), ("-e",), ("-o", CAMERA, "-r", "640x400")):
        with lab.rosrun("baxter_tools", "camera_control.py", *options) as program:
            program.finish()
        if options[0] == "-o":
            wait_for_message(topic, Image, lambda message: (message.width, message.height) == (640, 400))
    return {"width": 640, "height": 400}


@check("update_robot.py -l")
def update(lab):
    with lab.rosrun("baxter_tools", "update_robot.py", "-l") as program:
        code = program.end()
        program.expect("software updates must be run", 1.0)
    assert code == 1, "exit code %d" % code
    return {"exit_code": code}


@check("smoke_test.py")
def smoke(lab):
    with lab.rosrun("baxter_tools", "smoke_test.py", "-p") as program:
        program.expect("Press <Enter> to Begin")
        program.type("\n")
        program.finish(LONG_LIMIT_S)
        output = program.output
    reports = [path.read_text() for path in lab.folder.glob("*.smoketest")]
    for path in lab.folder.glob("*.smoketest"):
        path.unlink()
    failed = [name for name in SMOKE_TESTS if "Test: %s ------ Result: Success" % name not in "".join(reports)]
    assert not failed, "not a success: %s; %r" % (", ".join(failed), output[-300:])
    return {"successes": len(SMOKE_TESTS)}


def procedure(lab, script, spoken):
    """A bare arm moves through a procedure's poses, and the robot is disabled at the end."""
    spans = []
    for side in SIDES:
        watch = lab.robot.watch()
        with lab.rosrun("baxter_tools", script, "-l", side) as program:
            program.finish(LONG_LIMIT_S)
            program.expect(spoken, 1.0)
        lab.robot.unwatch(watch)
        spans.append(max(map(watch.span, joint_names(side))))
        lab.robot.wait_for_state(False, False)
    assert min(spans) > 0.3, "the arms moved by %s rad" % spans
    return {"least_motion_rad": min(spans), "largest_motion_rad": max(spans)}


@check("tare.py", bare=True)
def tare(lab):
    return procedure(lab, "tare.py", "Tare finished")


@check("calibrate_arm.py", bare=True)
def calibrate(lab):
    return procedure(lab, "calibrate_arm.py", "Calibrate arm finished")
