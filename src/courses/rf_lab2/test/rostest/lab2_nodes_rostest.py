#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""move_baxter.py and tf_listener.py as students call them."""
import ast
import os
import signal
import subprocess
import unittest

import rospy
import tf2_ros
from baxter_core_msgs.srv import SolvePositionIK, SolvePositionIKResponse
from baxter_kinematics_msgs.msg import IKReport, IKVerdict
from geometry_msgs.msg import Point, Pose, PoseStamped, Quaternion, TransformStamped
from sensor_msgs.msg import JointState

from baxter_interface import Limb, NoIKSolution
from lab_testing.knobs import set_knobs
from lab_testing.waiting import stretched, wait_until

DEADLINE_S = stretched(60.0)
SIDES = ("left", "right")
# What the lab sheet prints for its pose [rad].
LAB_ANGLES = {"s0": -1.0051802515115758, "s1": -1.0358377913378556, "e0": -0.33102594774694544,
              "e1": 1.7033657530084771, "w0": 0.3050684684989051, "w1": 0.8610601980794869, "w2": -1.4742358938106646}


def run(node, *arguments, **environment):
    return subprocess.run(["rosrun", "rf_lab2", node, *arguments], capture_output=True, text=True, timeout=DEADLINE_S,
                          env=dict(os.environ, **environment))


class MoveBaxterTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.requests = []
        cls.services = [
            rospy.Service("/ExternalTools/%s/PositionKinematicsNode/IKService" % side, SolvePositionIK,
                          lambda request, side=side: cls.solve(side, request))
            for side in SIDES]

    @classmethod
    def solve(cls, side, request):
        """Give the lab's angles for every pose within 2 m, and none for others."""
        pose = request.pose_stamp[0]
        cls.requests.append((side, pose))
        if pose.pose.position.x > 2.0:
            return SolvePositionIKResponse(joints=[JointState()], isValid=[False], result_type=[0])
        names = ["%s_%s" % (side, joint) for joint in LAB_ANGLES]
        return SolvePositionIKResponse(joints=[JointState(name=names, position=list(LAB_ANGLES.values()))],
                                       isValid=[True], result_type=[2])

    def setUp(self):
        self.requests.clear()
        self.set_knobs()

    def set_knobs(self, **knobs):
        set_knobs("/fake_robot", **knobs)

    def wait_at(self, side, wanted):
        """A program ends within its tolerance; the robot moves on to the goal."""
        limb = Limb(side)
        wait_until(lambda: all(abs(limb.joint_angle(name) - angle) < 0.002 for name, angle in wanted.items()),
                   lambda: "%s; they are at %s" % (wanted, limb.joint_angles()))

    def test_left_arm_goes_to_the_angles_and_they_are_printed(self):
        result = run("move_baxter.py")
        self.assertEqual(result.returncode, 0, result.stderr)
        printed = ast.literal_eval(next(line for line in result.stdout.splitlines() if line.startswith("{")))
        self.assertEqual(printed, {"left_" + joint: angle for joint, angle in LAB_ANGLES.items()})
        side, pose = self.requests[0]
        self.assertEqual((side, pose.header.frame_id), ("left", "base"))
        self.assertEqual((pose.pose.position.x, pose.pose.position.y, pose.pose.position.z), (0.644, 0.0, 0.066))
        self.assertAlmostEqual(pose.pose.orientation.y, 0.923, delta=0.001)
        self.wait_at("left", printed)
        # The other arm is at neutral.
        self.wait_at("right", {"right_s1": -0.55})

    def test_arm_and_pose_are_arguments(self):
        result = run("move_baxter.py", "--arm", "right", "--point", "0.6", "-0.4", "-0.1",
                     "--quaternion", "0", "2", "0", "0")
        self.assertEqual(result.returncode, 0, result.stderr)
        side, pose = self.requests[0]
        self.assertEqual((side, pose.pose.position.y, pose.pose.orientation.y), ("right", -0.4, 1.0))

    def test_pose_without_a_solution_is_status_1(self):
        result = run("move_baxter.py", "--point", "3", "0", "0")
        self.assertEqual(result.returncode, 1)
        self.assertIn("no joint angles put the left gripper at [3.0, 0.0, 0.0]", result.stderr)
        self.assertNotIn("Traceback", result.stderr)

    def test_limb_says_what_the_report_on_its_pose_says(self):
        reports = rospy.Publisher("/ExternalTools/left/PositionKinematicsNode/IKReport", IKReport, queue_size=1,
                                  latch=True)
        self.addCleanup(reports.unregister)
        limb, pose = Limb("left"), Pose(Point(2.5, 0.0, 0.0), Quaternion(0.0, 0.0, 0.0, 1.0))
        self.assertRaisesRegex(NoIKSolution, "left arm.* 2.500 ", limb.ik, pose)
        target = PoseStamped(pose=pose)
        target.header.frame_id = "base"
        reports.publish(verdicts=[IKVerdict(detail="of another pose"), IKVerdict(detail="too far", target=target)])
        self.assertRaisesRegex(NoIKSolution, "left arm.*too far", limb.ik, pose)

    def test_robot_that_refuses_to_be_enabled_is_status_1(self):
        self.set_knobs(refuse_enable=True)
        result = run("move_baxter.py")
        self.assertEqual(result.returncode, 1)
        self.assertIn("failed to enable the robot", result.stderr)

    def test_wave_asks_for_a_mirrored_sine_and_ends_where_it_began(self):
        result = run("wave.py", "--seconds", "1.5", "--amplitude", "0.1")
        self.assertEqual(result.returncode, 0, result.stderr)
        asked = {side: [pose.pose.position.y for name, pose in self.requests if name == side] for side in SIDES}
        shift = {side: [y - values[0] for y in values] for side, values in asked.items()}
        self.assertAlmostEqual(max(shift["left"]), 0.1, delta=0.001)
        for left, right in zip(shift["left"], shift["right"], strict=True):
            self.assertAlmostEqual(left, -right, delta=1e-6)
        for side in SIDES:
            self.wait_at(side, {"%s_%s" % (side, joint): angle for joint, angle in LAB_ANGLES.items()})

    def test_wave_refuses_a_period_that_no_arm_follows(self):
        result = run("wave.py", "--period", "0.2")
        self.assertEqual(result.returncode, 2)
        self.assertRegex(result.stderr, r"--period: .* from 1, .* 0\.2")

    def test_quaternion_of_nothing_is_a_wrong_option(self):
        result = run("move_baxter.py", "--quaternion", "0", "0", "0", "0")
        self.assertEqual(result.returncode, 2)
        self.assertIn("not all zero", result.stderr)

    def test_point_of_no_number_is_a_wrong_option_and_moves_nothing(self):
        result = run("move_baxter.py", "--point", "nan", "0", "0")
        self.assertEqual(result.returncode, 2)
        self.assertRegex(result.stderr, "--point: .* nan")


class TfListenerTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.broadcaster = tf2_ros.TransformBroadcaster()
        cls.timer = rospy.Timer(rospy.Duration(0.05), cls.broadcast)

    @classmethod
    def tearDownClass(cls):
        cls.timer.shutdown()

    @classmethod
    def broadcast(cls, _event):
        """A half turn about x between base and left_hand: w first and w last could not be more different."""
        for parent, child in (("base", "left_hand"), ("base", "right_hand"), ("base", "head_camera"),
                              ("left_hand", "left_gripper_base")):
            transform = TransformStamped()
            transform.header.stamp = rospy.Time.now()
            transform.header.frame_id, transform.child_frame_id = parent, child
            transform.transform.translation.z = 0.5
            transform.transform.rotation.x = 1.0
            cls.broadcaster.sendTransform(transform)

    def test_two_frames_are_printed_as_vector_quaternion_and_matrices(self):
        result = run("tf_listener.py", "base", "left_hand", "--once")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(result.stdout.strip().splitlines(), [
            "base -> left_hand",
            "Translation x y z [m]:", "[0.  0.  0.5]",
            "Quaternion x y z w:", "[1. 0. 0. 0.]",
            "Rotation matrix:", "[[ 1.  0.  0.]", " [ 0. -1.  0.]", " [ 0.  0. -1.]]",
            "Homogeneous matrix:", "[[ 1.   0.   0.   0. ]", " [ 0.  -1.   0.   0. ]", " [ 0.   0.  -1.   0.5]",
            " [ 0.   0.   0.   1. ]]"])

    def test_a_slip_in_a_frame_is_answered_while_it_waits(self):
        with subprocess.Popen(["rosrun", "rf_lab2", "tf_listener.py", "base", "left_hnad"], stderr=subprocess.PIPE,
                              text=True) as listener:
            lines = iter(listener.stderr.readline, "")
            self.assertTrue(any("did you mean left_hand?" in line for line in lines))
            listener.send_signal(signal.SIGINT)
            listener.communicate(timeout=DEADLINE_S)

    def test_pairs_of_the_lab_are_the_default(self):
        result = run("tf_listener.py", "--once")
        self.assertEqual(result.returncode, 0, result.stderr)
        for pair in ("base -> left_hand", "left_hand -> right_hand", "head_camera -> left_gripper_base"):
            self.assertIn(pair, result.stdout)

    def test_output_survives_a_plain_locale(self):
        result = run("tf_listener.py", "--once", LC_ALL="C", PYTHONIOENCODING="", PYTHONUTF8="0")
        self.assertEqual(result.returncode, 0, result.stderr)

    def test_one_frame_is_a_wrong_option(self):
        result = run("tf_listener.py", "base")
        self.assertEqual(result.returncode, 2)
        self.assertIn("two frames or none", result.stderr)


if __name__ == "__main__":
    import rostest
    rospy.init_node("lab2_nodes_rostest")
    rostest.rosrun("rf_lab2", "lab2_nodes", "__main__")
