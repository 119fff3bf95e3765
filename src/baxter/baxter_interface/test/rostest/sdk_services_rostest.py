#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""CameraController, RobustController and Limb.ik against the fake services, fault by fault."""
import errno
import functools
import time
import unittest

import rospy
from baxter_core_msgs.srv import OpenCamera
from baxter_maintenance_msgs.msg import TareEnable
from geometry_msgs.msg import Pose, PoseStamped

from baxter_dataflow import wait_for
from baxter_interface import CameraController, Limb, NoIKSolution, RobustController
from baxter_interface.services import call_service
from lab_testing.knobs import set_only

DEADLINE_S = 60.0


# They are read at every request.
set_knobs = functools.partial(set_only, "/fake_services")


class ServicesTest(unittest.TestCase):
    def setUp(self):
        set_knobs()

    def assert_errno(self, number, text, call, *arguments, **options):
        with self.assertRaises(OSError) as caught:
            call(*arguments, **options)
        self.assertEqual(caught.exception.errno, number)
        self.assertIn(text, caught.exception.strerror)


class CameraTest(ServicesTest):
    def setUp(self):
        super().setUp()
        self.opened = []
        self.subscriber = rospy.Subscriber("/fake_services/opened", OpenCamera._request_class, self.opened.append)
        self.addCleanup(self.subscriber.unregister)
        wait_for(lambda: self.subscriber.get_num_connections(), DEADLINE_S, timeout_msg="no connection to ~opened")

    def last(self, is_it):
        wait_for(lambda: self.opened and is_it(self.opened[-1]), DEADLINE_S,
                 timeout_msg="the camera was opened otherwise: %s" % self.opened[-1:])
        return self.opened[-1]

    def test_every_setting_reaches_the_camera_at_once(self):
        camera = CameraController("left_hand_camera")
        self.assertEqual((camera.resolution, camera.fps, camera.exposure, camera.window, camera.flip),
                         ((320, 200), 20.0, camera.CONTROL_AUTO, (-1, -1), False))
        camera.resolution = (640, 400)
        request = self.last(lambda seen: seen.settings.width == 640)
        self.assertEqual((request.name, request.settings.height, request.settings.fps), ("left_hand_camera", 400, 20.0))
        camera.fps = 25.0
        self.last(lambda seen: seen.settings.fps == 25.0 and seen.settings.width == 640)
        for name, number, value in (("exposure", 100, 55), ("gain", 101, 3), ("white_balance_red", 102, 4095),
                                    ("white_balance_green", 103, 7), ("white_balance_blue", 104, 0),
                                    ("flip", 107, True), ("mirror", 108, True), ("half_resolution", 109, True)):
            setattr(camera, name, value)
            self.assertEqual(getattr(camera, name), value)
            self.last(lambda seen, number=number, value=value:
                      (number, value) in [(control.id, control.value) for control in seen.settings.controls])
        self.assertIs(camera.flip, True)

    def test_window(self):
        camera = CameraController("left_hand_camera")
        camera.window = (10, 20)
        self.last(lambda seen: [(c.id, c.value) for c in seen.settings.controls] == [(105, 10), (106, 20)])
        self.assertEqual(camera.window, (10, 20))
        self.assertRaises(ValueError, setattr, camera, "window", (1000, 0))

    def test_head_camera_is_turned(self):
        CameraController("head_camera").open()
        request = self.last(lambda seen: seen.name == "head_camera")
        self.assertEqual({control.id: control.value for control in request.settings.controls}, {107: 1, 108: 1})

    def test_bad_settings_open_nothing(self):
        camera = CameraController("left_hand_camera")
        self.assertRaises(ValueError, setattr, camera, "resolution", (1, 1))
        self.assertRaises(AttributeError, setattr, camera, "resolution", (1,))
        self.assertRaises(ValueError, setattr, camera, "gain", 80)
        self.assertRaises(ValueError, setattr, camera, "fps", 0)
        self.assertEqual((camera.resolution, camera.gain, camera.fps), ((320, 200), -1, 20.0))

    def test_camera_without_power_is_an_attribute_error_that_lists_the_others(self):
        self.assertRaisesRegex(AttributeError, "'left_hand_camera', 'head_camera'", CameraController,
                               "right_hand_camera")

    def test_refusal_is_the_robot_s_errno(self):
        camera = CameraController("left_hand_camera")
        set_knobs(refuse_cameras=True)
        self.assert_errno(errno.ENODEV, "failed to open the left_hand_camera", camera.open)

    def test_closing_twice_does_no_harm(self):
        camera = CameraController("left_hand_camera")
        camera.open()
        camera.close()
        camera.close()


class ProcedureTest(ServicesTest):
    def run_tare(self, timeout=30.0):
        controller = RobustController("/robustcontroller/left/Tare", TareEnable(isEnabled=True, uid="sdk"),
                                      TareEnable(isEnabled=False, uid="sdk"), timeout)
        self.addCleanup(lambda: self.assertEqual(controller.state, controller.STATE_IDLE))
        return controller.run()

    def test_success_returns(self):
        begin_s = time.monotonic()
        self.assertIsNone(self.run_tare())
        self.assertGreater(time.monotonic() - begin_s, 0.3)

    def test_failure_is_eio_with_the_robot_s_codes(self):
        set_knobs(procedure_fails=True)
        self.assert_errno(errno.EIO, "ARM_MOVED", self.run_tare)

    def test_endless_procedure_is_stopped(self):
        set_knobs(procedure_runs_s=1000.0)
        self.assert_errno(errno.ETIMEDOUT, "not complete", self.run_tare, timeout=1.0)
        set_knobs()
        self.run_tare()

    def test_procedure_that_never_begins(self):
        set_knobs(procedure_runs_s=-1.0)
        self.assert_errno(errno.ETIMEDOUT, "did not begin", self.run_tare, timeout=1.0)

    def test_robot_without_the_procedure_is_told_within_seconds(self):
        controller = RobustController("/robustcontroller/left/Dance", TareEnable(), TareEnable())
        self.assert_errno(errno.ETIMEDOUT, "/robustcontroller/left/Dance/status", controller.run)


class IKTest(ServicesTest):
    def setUp(self):
        super().setUp()
        self.limbs = [Limb("left"), Limb("right")]

    def test_pose_in_every_form(self):
        for limb in self.limbs:
            pose = Pose()
            pose.position.x, pose.orientation.w = 0.5, 1.0
            stamped = PoseStamped(pose=pose)
            there = {"position": limb.Point(0.5, 0.0, 0.0), "orientation": limb.Quaternion(0.0, 0.0, 0.0, 1.0)}
            for form in (pose, stamped, there, ((0.5, 0, 0), [0, 0, 0, 1])):
                angles = limb.ik(form)
                self.assertEqual(sorted(angles), sorted(limb.joint_names()))
                self.assertEqual(angles[limb.name + "_s0"], 0.5)
            self.assertEqual(stamped.header.frame_id, "")  # the caller's own message is left alone

    def test_seed_is_completed_with_the_current_angles(self):
        for limb in self.limbs:
            angles = limb.ik(((0.5, 0, 0), (0, 0, 0, 1)), seed={limb.name + "_w2": 1.5})
            self.assertEqual(angles[limb.name + "_w2"], 1.5)
            self.assertEqual(angles[limb.name + "_s1"], limb.joint_angle(limb.name + "_s1"))

    def test_unreachable_pose_raises_and_names_it(self):
        for limb in self.limbs:
            self.assertRaisesRegex(NoIKSolution, "the %s arm .* x y z 2.000 0.000" % limb.name,
                                   limb.ik, ((2.0, 0, 0), (0, 0, 0, 1)))

    def test_what_is_no_pose_is_refused(self):
        for bad, error in ((3, TypeError), ({"position": (0, 0, 0)}, KeyError), (((0, 0), (0, 0, 0, 1)), ValueError),
                           (((0, 0, float("nan")), (0, 0, 0, 1)), ValueError)):
            self.assertRaises(error, self.limbs[0].ik, bad)
        self.assertRaises(ValueError, self.limbs[0].ik, ((0, 0, 0), (0, 0, 0, 1)), seed={"right_s0": 0.0})

    def test_slow_service_is_given_up(self):
        set_knobs(slow_ik=2.0)
        self.assert_errno(errno.ETIMEDOUT, "did not answer within", self.limbs[0].ik, ((0, 0, 0), (0, 0, 0, 1)),
                          timeout=0.5)

    def test_missing_service_is_named(self):
        self.assert_errno(errno.ETIMEDOUT, "there is no service /none", call_service, "/none", OpenCamera,
                          timeout_s=0.5)


if __name__ == "__main__":
    import rostest
    rospy.init_node("sdk_services_rostest")
    rostest.rosrun("baxter_interface", "sdk_services", "__main__")
