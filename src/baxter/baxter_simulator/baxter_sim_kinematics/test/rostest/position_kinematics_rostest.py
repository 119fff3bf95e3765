#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The IK service as clients use it. This process acts as the robot: the left arm's joints and a tf frame."""
import concurrent.futures
import math
import random
import struct
import sys
import threading
import time
import unittest

import numpy as np
import rosgraph
import rospy
import rostest
import tf2_ros
from baxter_core_msgs.srv import SolvePositionIK, SolvePositionIKRequest
from baxter_kinematics_msgs.msg import IKReport, IKVerdict
from geometry_msgs.msg import PoseStamped, TransformStamped
from rosgraph_msgs.msg import Log
from sensor_msgs.msg import JointState

from arm_kinematics import Chain
from lab_testing.waiting import beats, wait_until
from urdf_model import parse_urdf
from urdf_model.transforms import quaternion_from_matrix

JOINTS = ("s0", "s1", "e0", "e1", "w0", "w1", "w2")
NEUTRAL = (0.0, -0.55, 0.0, 0.75, 0.0, 1.26, 0.0)
CURRENT = (0.1, -0.7, -0.2, 0.9, 0.1, 1.1, -0.3)
# The labs' request, and the angles that their sheet prints for it.
LAB_POSE = ((0.644, 0.0, 0.066), (-0.381, 0.923, -0.015, 0.052))
LAB_ANGLES = (-1.0051802515115758, -1.0358377913378556, -0.33102594774694544, 1.7033657530084771, 0.3050684684989051,
              0.8610601980794869, -1.4742358938106646)
TOO_FAR = ((3.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0))
SHELF_IN_BASE = (0.2, -0.1, 0.3)
WAIT_S = 90.0
# Number of joint states sent at once, and the deadline for the last to be used: handled one by one they would take
# twice as long.
BURST = 1000
BURST_TIMEOUT_S = 10.0
# A robot's rate, and longer than a node listens to joint states after a request [s].
RATE_HZ, SILENCE_S = 100.0, 7.0


def pose(position, quaternion, frame="base"):
    message = PoseStamped()
    message.header.frame_id = frame
    message.pose.position.x, message.pose.position.y, message.pose.position.z = position
    turn = message.pose.orientation
    turn.x, turn.y, turn.z, turn.w = quaternion
    return message


def seed(side, values=NEUTRAL):
    return JointState(name=["%s_%s" % (side, joint) for joint in JOINTS[:len(values)]], position=list(values))


class PositionKinematics(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        robot = parse_urdf(rospy.get_param("robot_description"), source="robot_description")
        cls.chains = {side: Chain.from_robot(robot, "base", side + "_gripper") for side in ("left", "right")}
        cls.log = []
        cls.rosout = rospy.Subscriber("/rosout", Log, lambda message: cls.log.append(message.msg))
        cls.services, cls.reports = {}, []
        cls.listener = rospy.Subscriber("/ExternalTools/left/PositionKinematicsNode/IKReport", IKReport,
                                        cls.reports.append)
        for side in cls.chains:
            name = "/ExternalTools/%s/PositionKinematicsNode/IKService" % side
            rospy.wait_for_service(name, timeout=60.0)
            cls.services[side] = rospy.ServiceProxy(name, SolvePositionIK)
        cls.broadcaster = tf2_ros.StaticTransformBroadcaster()
        shelf = TransformStamped(child_frame_id="shelf")
        shelf.header.frame_id = "base"
        shelf.transform.translation.x, shelf.transform.translation.y, shelf.transform.translation.z = SHELF_IN_BASE
        shelf.transform.rotation.w = 1.0
        cls.broadcaster.sendTransform(shelf)
        # Only the left arm's joints are ever published: the right arm stands for a robot that has not published yet.
        cls.joint_states = rospy.Publisher("/robot/joint_states", JointState, queue_size=BURST, latch=True)
        cls.say_current()

    @classmethod
    def say(cls, posture, stamp=13.0):
        message = seed("left", posture)
        message.header.stamp = rospy.Time(stamp)
        cls.joint_states.publish(message)

    @classmethod
    def say_current(cls):
        cls.say(CURRENT, 12.5)
        wait_until(lambda: cls.ask("left", [pose(*LAB_POSE)]).joints[0].header.stamp == rospy.Time(12.5),
                   "joint states to arrive at the left arm's node")

    @classmethod
    def ask(cls, side, poses, seeds=(), mode=SolvePositionIKRequest.SEED_AUTO):
        return cls.services[side](SolvePositionIKRequest(pose_stamp=poses, seed_angles=list(seeds), seed_mode=mode))

    def assert_solved(self, side, response, index, position, quaternion, seed_type):
        self.assertTrue(response.isValid[index])
        self.assertEqual(response.result_type[index], seed_type)
        joints = response.joints[index]
        self.assertEqual(joints.name, ["%s_%s" % (side, joint) for joint in JOINTS])
        chain = self.chains[side]
        tip = chain.fk(joints.position)
        np.testing.assert_allclose(tip[:3, 3], position, atol=2e-6)
        x, y, z, w = np.array(quaternion) / np.linalg.norm(quaternion)
        np.testing.assert_allclose(tip[:3, 2], [2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)],
                                   atol=2e-6)
        self.assertTrue((np.array(joints.position) >= chain.lower).all())
        self.assertTrue((np.array(joints.position) <= chain.upper).all())

    def assert_invalid(self, response, index=0, count=1):
        self.assertEqual((len(response.isValid), len(response.result_type), len(response.joints)), (count,) * 3)
        self.assertIs(response.isValid[index], False)
        self.assertEqual(response.result_type[index], 0)
        self.assertEqual((response.joints[index].name, list(response.joints[index].position)), ([], []))

    def assert_logged(self, text, ask):
        """The node says ``text`` in its log when ``ask`` is called; returns the response."""
        del self.log[:]
        response = ask()
        wait_until(lambda: any(text in line for line in list(self.log)), "a log line with '%s', got %s"
                   % (text, self.log))
        return response

    def test_lab_request_gives_the_angles_of_the_lab_sheet(self):
        answers = [self.ask("left", [pose(*LAB_POSE)], [seed("left")], mode)
                   for mode in (SolvePositionIKRequest.SEED_USER, SolvePositionIKRequest.SEED_AUTO) for _ in range(2)]
        for answer in answers:
            self.assert_solved("left", answer, 0, *LAB_POSE, 1)
            np.testing.assert_allclose(answer.joints[0].position, LAB_ANGLES, atol=2e-3)
            self.assertEqual(answer.joints[0].position, answers[0].joints[0].position)
            # How the vendor's clients read it.
            self.assertEqual(struct.unpack("<%dB" % len(answer.result_type), answer.result_type), (1,))

    def test_answer_is_a_posture_in_which_the_robot_can_be(self):
        # Newton's steps lead to s0 = -1.05, the upper arm within the field of the head and the elbow in the torso.
        begin = (0.0329, -0.6053, -0.1102, 0.634, 0.0752, 1.3591, 0.0256)
        high = ((0.6, 0.3, 0.3), (0.0, 1.0, 0.0, 0.0))
        answer = self.ask("left", [pose(*high)], [seed("left", begin)])
        self.assert_solved("left", answer, 0, *high, 1)
        self.assertAlmostEqual(answer.joints[0].position[0], -0.272, delta=0.01)

    def test_seed_modes_start_where_they_say(self):
        tip = self.chains["left"].fk(CURRENT)
        here = pose(tip[:3, 3], quaternion_from_matrix(tip))
        for mode, expected in ((SolvePositionIKRequest.SEED_AUTO, 2), (SolvePositionIKRequest.SEED_CURRENT, 2)):
            answer = self.ask("left", [here], mode=mode)
            self.assertEqual(answer.result_type[0], expected)
            np.testing.assert_allclose(answer.joints[0].position, CURRENT, atol=1e-5)
        # CURRENT and NS_MAP ignore seeds.
        answer = self.ask("left", [here], [seed("left", [1.0] * 7)], SolvePositionIKRequest.SEED_CURRENT)
        np.testing.assert_allclose(answer.joints[0].position, CURRENT, atol=1e-5)
        neutral = self.chains["left"].fk(NEUTRAL)
        answer = self.ask("left", [pose(neutral[:3, 3], quaternion_from_matrix(neutral))], [seed("left", [1.0] * 7)],
                          SolvePositionIKRequest.SEED_NS_MAP)
        self.assertEqual(answer.result_type[0], 3)
        np.testing.assert_allclose(answer.joints[0].position, NEUTRAL, atol=1e-5)

    def test_joint_states_that_come_faster_than_they_are_taken_do_not_pile_up(self):
        last = list(CURRENT[:-1]) + [0.2]
        for number in range(BURST):
            self.say(list(CURRENT[:-1]) + [0.2 * (number + 1) / BURST])
        self.addCleanup(self.say_current)
        tip = self.chains["left"].fk(last)
        there = pose(tip[:3, 3], quaternion_from_matrix(tip))
        wait_until(lambda: np.allclose(self.ask("left", [there]).joints[0].position, last, atol=1e-5),
                   "the last of the burst to be the seed", BURST_TIMEOUT_S)

    def test_first_request_after_a_silence_has_the_state_of_its_moment(self):
        self.addCleanup(self.say_current)
        over, heard = threading.Event(), [0.0]
        # As the physical robot, which has a message of their own for them.
        fingers = JointState(name=["l_gripper_l_finger_joint"], position=[0.0])

        def publish():
            for number, _ in enumerate(beats(RATE_HZ, over.is_set)):
                stamp = 100.0 + number / RATE_HZ
                self.say(CURRENT, stamp)
                fingers.header.stamp = rospy.Time(stamp)
                self.joint_states.publish(fingers)

        # What has come here has been sent, however busy the machine is.
        listener = rospy.Subscriber("/robot/joint_states", JointState,
                                    lambda message: heard.append(message.header.stamp.to_sec()))
        publisher = threading.Thread(target=publish)
        publisher.start()
        try:
            wait_until(lambda: heard[-1] >= 100.0, "the first state", WAIT_S)
            for _ in range(3):
                until = heard[-1] + SILENCE_S
                wait_until(lambda until=until: heard[-1] >= until, "a silence", WAIT_S)
                before = heard[-1]
                answer = self.ask("left", [pose(*LAB_POSE)])
                self.assertGreaterEqual(answer.joints[0].header.stamp.to_sec(), before - 5.0 / RATE_HZ)
        finally:
            over.set()
            publisher.join()
            listener.unregister()

    def test_right_arm_without_joint_states_starts_at_neutral_and_says_so(self):
        neutral = self.chains["right"].fk(NEUTRAL)
        there = [pose(neutral[:3, 3], quaternion_from_matrix(neutral))]
        answer = self.assert_logged("no joint states", lambda: self.ask("right", there))
        self.assertEqual(answer.result_type[0], 2)
        np.testing.assert_allclose(answer.joints[0].position, NEUTRAL, atol=1e-5)

    def test_user_seeds_that_cannot_be_used(self):
        wrong_names = JointState(name=["a"] * 7, position=list(NEUTRAL))
        for seeds, text in (([], "needs one seed_angles entry"), ([JointState()], "needs one seed_angles entry"),
                            ([wrong_names], "no value for left_s0"), ([seed("right")], "no value for left_s0"),
                            ([seed("left", NEUTRAL[:6])], "no value for left_w2"),
                            ([JointState(position=list(NEUTRAL))], "0 joint names but 7 positions"),
                            ([JointState(name=seed("left").name)], "7 joint names but 0 positions"),
                            ([seed("left", (math.nan,) * 7)], "left_s0 = nan")):
            answer = self.assert_logged(text, lambda seeds=seeds: self.ask("left", [pose(*LAB_POSE)], seeds,
                                                                          SolvePositionIKRequest.SEED_USER))
            self.assert_invalid(answer)
        # AUTO says so and goes on with the current posture.
        answer = self.assert_logged("left out", lambda: self.ask("left", [pose(*LAB_POSE)], [wrong_names]))
        self.assert_solved("left", answer, 0, *LAB_POSE, 2)

    def test_user_seed_outside_the_limits_is_clamped(self):
        answer = self.ask("left", [pose(*LAB_POSE)], [seed("left", [9.0] * 7)], SolvePositionIKRequest.SEED_USER)
        self.assert_solved("left", answer, 0, *LAB_POSE, 1)

    def test_every_pose_is_answered_on_its_own(self):
        answer = self.ask("left", [pose(*LAB_POSE), pose(*TOO_FAR), pose(*LAB_POSE)], [seed("left"), seed("left")])
        self.assert_solved("left", answer, 0, *LAB_POSE, 1)
        self.assert_invalid(answer, 1, 3)
        self.assert_solved("left", answer, 2, *LAB_POSE, 2)
        self.assertEqual(len(self.ask("left", []).isValid), 0)

    def test_failure_is_explained(self):
        # The shoulder turned backwards, farther than it goes.
        tip = self.chains["left"].fk((2.4, -0.3, 0.0, 0.6, 0.0, 0.9, 0.0))
        behind = (tip[:3, 3], quaternion_from_matrix(tip))
        for question, text in ((TOO_FAR, "out of reach"), (behind, "joint limit: left_s0"),
                               (((0.6, 0.2, 0.1), (0, 0, 0, 0)), "length 0"),
                               (((0.6, 0.2, 0.1), (0, 0, 0, 3)), "length 3"),
                               (((math.nan, 0.2, 0.1), (0, 0, 0, 1)), "finite")):
            answer = self.assert_logged(text, lambda question=question: self.ask("left", [pose(*question)]))
            self.assert_invalid(answer)
        answer = self.assert_logged("seed_mode 9 is unknown", lambda: self.ask("left", [pose(*LAB_POSE)], mode=9))
        self.assert_invalid(answer)

    def report_on(self, *poses):
        """Ask the left arm, and return the report that goes with the answer: the one with the same target."""
        answer = self.ask("left", list(poses))

        def mine():
            return [report for report in list(self.reports) if [v.target for v in report.verdicts] == list(poses)]

        wait_until(mine, "the report on the answer")
        return answer, mine()[-1]

    def test_report_says_why(self):
        tip = self.chains["left"].fk((2.4, -0.3, 0.0, 0.6, 0.0, 0.9, 0.0))
        behind = (tip[:3, 3], quaternion_from_matrix(tip))
        too_far, empty = pose(*TOO_FAR), pose((0.6, 0.2, 0.1), (0, 0, 0, 0))
        answer, report = self.report_on(pose(*LAB_POSE), too_far, pose(*behind), empty)
        self.assertEqual((report.limb, report.header.frame_id), ("left", "base"))
        self.assertEqual([v.verdict for v in report.verdicts], [
            IKVerdict.SOLVED, IKVerdict.OUT_OF_REACH, IKVerdict.JOINT_LIMIT, IKVerdict.INVALID_REQUEST])
        solved, far, limit, invalid = report.verdicts
        self.assertEqual(solved.joints_there, answer.joints[0])
        self.assertEqual(solved.detail, "")
        # The distance is right, and the joint values reach the nearest pose.
        there = self.chains["left"].fk(far.joints_there.position)[:3, 3]
        nearest = far.nearest.position
        np.testing.assert_allclose([nearest.x, nearest.y, nearest.z], there, atol=1e-9)
        self.assertAlmostEqual(far.short_m, np.linalg.norm(there - TOO_FAR[0]), places=9)
        self.assertGreater(far.short_m, 1.5)
        self.assertEqual(limit.joints, ["left_s0"])
        self.assertGreater(limit.excess[0], 0.1)
        self.assertIn("length 0", invalid.detail)
        self.assertEqual(len(invalid.joints_there.position), 0)

    def test_poses_in_other_frames(self):
        position, quaternion = LAB_POSE
        on_shelf = np.subtract(position, SHELF_IN_BASE)
        for frame in ("shelf", "/shelf"):
            answer = self.ask("left", [pose(on_shelf, quaternion, frame)], [seed("left")])
            self.assert_solved("left", answer, 0, position, quaternion, 1)
        stamped = pose(on_shelf, quaternion, "shelf")
        stamped.header.stamp = rospy.Time(99.0)
        self.assert_solved("left", self.ask("left", [stamped], [seed("left")]), 0, position, quaternion, 1)
        self.assert_solved("left", self.ask("left", [pose(*LAB_POSE, "/base")], [seed("left")]), 0, *LAB_POSE, 1)
        answer = self.assert_logged("no frame_id", lambda: self.ask("left", [pose(*LAB_POSE, "")], [seed("left")]))
        self.assert_solved("left", answer, 0, *LAB_POSE, 1)

    def test_unknown_frames_hold_a_request_for_a_second_at_most(self):
        start = time.monotonic()
        answer = self.assert_logged("cannot relate frame 'nowhere'",
                                    lambda: self.ask("left", [pose(*LAB_POSE, "nowhere")] * 20))
        self.assertTrue(any("nowhere" in line and "shelf" in line for line in self.log), self.log)
        self.assert_invalid(answer, 19, 20)
        # A second for each of the poses would be 20.
        self.assertLess(time.monotonic() - start, 15.0)

    def test_many_connections_at_once_get_the_same_answer(self):
        def answer(_):
            return self.ask("left", [pose(*LAB_POSE)] * 20, [seed("left")] * 20).joints[-1].position

        with concurrent.futures.ThreadPoolExecutor(8) as pool:
            self.assertEqual(len(set(pool.map(answer, range(32)))), 1)

    def test_thousand_malformed_requests_leave_the_service_working(self):
        dice = random.Random(1)
        odd = (0.0, -1.0, 0.3, 1e-320, 1e308, -1e308, math.nan, math.inf, -math.inf)
        for _ in range(1000):
            poses = [pose([dice.choice(odd) for _ in range(3)], [dice.choice(odd) for _ in range(4)],
                          dice.choice(["base", "base", "", "/", "//base", "\u00fc", "base"]))
                     for _ in range(dice.randrange(4))]
            seeds = [JointState(name=[dice.choice(["left_s0", "left_e1", "", "x" * 300, "head_pan"])
                                      for _ in range(dice.randrange(9))],
                                position=[dice.choice(odd) for _ in range(dice.randrange(9))])
                     for _ in range(dice.randrange(4))]
            answer = self.ask("left", poses, seeds, dice.randrange(256) if dice.random() < 0.3 else dice.randrange(4))
            self.assertEqual({len(answer.joints), len(answer.isValid), len(answer.result_type)}, {len(poses)})
        answer = self.ask("left", [pose(*LAB_POSE)], [seed("left")])
        self.assert_solved("left", answer, 0, *LAB_POSE, 1)

    def test_names_that_clients_rely_on(self):
        self.assertEqual(rospy.get_param("/root_name"), "base")
        for side in self.chains:
            self.assertEqual(rospy.get_param("/%s_tip_name" % side), side + "_gripper")
            self.assertEqual(rospy.get_param("/robot_config/%s_config/joint_names" % side),
                             ["%s_%s" % (side, joint) for joint in JOINTS])

    def test_each_arm_is_a_node_although_one_process_serves_both(self):
        master = rosgraph.Master(rospy.get_name())
        of_services = dict(master.getSystemState()[2])
        for side in self.chains:
            name = "/baxter_sim_kinematics_" + side
            self.assertEqual(of_services["/ExternalTools/%s/PositionKinematicsNode/IKService" % side], [name])
            self.assertEqual(master.lookupNode(name), master.lookupNode("/baxter_sim_kinematics"))


if __name__ == "__main__":
    rospy.init_node("position_kinematics_rostest", disable_rostime=True)
    rostest.rosrun("baxter_sim_kinematics", "position_kinematics", PositionKinematics, sys.argv)
