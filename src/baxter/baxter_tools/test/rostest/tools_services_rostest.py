#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""camera_control.py, tare.py, calibrate_arm.py and update_robot.py as users call them."""
import subprocess
import unittest

import rospy
from baxter_core_msgs.msg import AssemblyState
from baxter_core_msgs.srv import OpenCamera

from lab_testing.knobs import set_knobs, set_only

DEADLINE_S = 60.0


class ToolsTest(unittest.TestCase):
    def setUp(self):
        set_only("/fake_services")
        rospy.set_param("/rethink/software_version", "1.2.0.57")

    def expect(self, command, status, *texts):
        """Run the tool and check its exit status and what it prints; return that."""
        result = subprocess.run(["rosrun", "baxter_tools", *command], capture_output=True, text=True,
                                timeout=DEADLINE_S)
        output = result.stdout + result.stderr
        self.assertEqual(result.returncode, status, output)
        for text in texts:
            self.assertIn(text, output)
        self.assertNotIn("Traceback", output)
        return output


class CameraControlTest(ToolsTest):
    def test_open_list_close(self):
        self.expect(["camera_control.py", "-o", "left_hand_camera", "-r", "640x400"], 0)
        request = rospy.wait_for_message("/fake_services/opened", OpenCamera._request_class, DEADLINE_S)
        self.assertEqual((request.name, request.settings.width, request.settings.height),
                         ("left_hand_camera", 640, 400))
        self.assertEqual(self.expect(["camera_control.py", "-l"], 0),
                         "left_hand_camera - (open)\nhead_camera\n")
        self.expect(["camera_control.py", "-c", "left_hand_camera"], 0)
        self.assertEqual(self.expect(["camera_control.py", "-l"], 0), "left_hand_camera\nhead_camera\n")
        self.expect(["camera_control.py", "-e"], 0)

    def test_what_does_not_fit_is_said(self):
        self.expect(["camera_control.py", "-o", "right_hand_camera"], 1, "'left_hand_camera', 'head_camera'")
        self.expect(["camera_control.py", "-o", "head_camera", "-r", "640x480"], 2, "1280x800, 960x600")
        self.expect(["camera_control.py"], 2, "one of the arguments")
        self.expect(["camera_control.py", "-l", "-e"], 2, "not allowed with")


class ArmProcedureTest(ToolsTest):
    def setUp(self):
        super().setUp()
        self.set_gripper(ui_type=3)

    def set_gripper(self, **knobs):
        set_knobs("/fake_gripper", **knobs)

    def assert_disabled(self):
        self.assertFalse(rospy.wait_for_message("/robot/state", AssemblyState, DEADLINE_S).enabled)

    def test_both_run_to_their_end_and_leave_the_robot_disabled(self):
        for tool, name in (("tare.py", "Tare"), ("calibrate_arm.py", "CalibrateArm")):
            self.expect([tool, "-l", "left"], 0, "%s of the left arm is complete" % name)
            self.assert_disabled()

    def test_failure_of_the_procedure(self):
        set_only("/fake_services", procedure_fails=True)
        self.expect(["tare.py", "-l", "left"], 1, "/robustcontroller/left/Tare", "ARM_MOVED")
        self.assert_disabled()

    def test_gripper_has_to_come_off(self):
        self.set_gripper(ui_type=2)
        self.expect(["calibrate_arm.py", "-l", "left"], 1, "carries a gripper (electric): take it off")

    def test_no_gripper_at_all_is_right(self):
        self.set_gripper(ui_type=0)
        self.expect(["tare.py", "-l", "left"], 0)

    def test_limb_is_required(self):
        self.expect(["tare.py"], 2, "--limb")
        self.expect(["tare.py", "-l", "middle"], 2, "middle", "left", "right")


class UpdateRobotTest(ToolsTest):
    def test_newer_robot_is_refused(self):
        self.expect(["update_robot.py", "-l"], 1, "software is 1.2.0.57", "SSH")

    def test_list_and_update_of_an_old_robot(self):
        rospy.set_param("/rethink/software_version", "1.0.0")
        self.expect(["update_robot.py", "-l"], 0, "uuid-one  1.0.0  sda  one.zip", "uuid-two")
        self.expect(["update_robot.py", "-u", "uuid-one"], 0, "verify_update", "load_kexec 100 %")
        self.expect(["update_robot.py", "-u", "uuid-three"], 1, "'uuid-three'", "uuid-one, uuid-two")


if __name__ == "__main__":
    import rostest
    rospy.init_node("tools_services_rostest")
    rostest.rosrun("baxter_tools", "tools_services", "__main__")
