#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Both gripper controllers as clients see them: Debian's action client, joints with faults, no physics."""

import actionlib
import rospy
import rostest
from actionlib_msgs.msg import GoalStatus
from control_msgs.msg import GripperCommand, GripperCommandAction, GripperCommandGoal
from controller_manager_msgs.srv import LoadController, SwitchController
from std_srvs.srv import SetBool

from lab_testing import subtests
from lab_testing.waiting import wait_until

WAIT_S = 90.0
GRIPPERS = ("position_gripper", "effort_gripper")
TOLERANCE = 0.01  # the default of goal_tolerance


def service(name, srv_class, *arguments):
    rospy.wait_for_service(name, WAIT_S)
    return rospy.ServiceProxy(name, srv_class)(*arguments)


def switch(start=(), stop=()):
    assert service("/robot/controller_manager/switch_controller", SwitchController, start, stop, 2, False, 0.0).ok


def freeze(frozen):
    service("/robot/freeze", SetBool, frozen)


def goal(position, max_effort=100.0):
    return GripperCommandGoal(GripperCommand(position, max_effort))


class GripperControllerTest(subtests.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.clients = {}
        for name in GRIPPERS:
            assert service("/robot/controller_manager/load_controller", LoadController, name).ok
            client = actionlib.SimpleActionClient("/robot/%s/gripper_cmd" % name, GripperCommandAction)
            assert client.wait_for_server(rospy.Duration(WAIT_S)), "no action server of " + name
            cls.clients[name] = client

    def setUp(self):
        freeze(False)
        switch(start=GRIPPERS)

    def tearDown(self):
        switch(stop=GRIPPERS)

    def end(self, client):
        """(state, result) of the goal that was sent last."""
        self.assertTrue(client.wait_for_result(rospy.Duration(WAIT_S)), "no result")
        return client.get_state(), client.get_result()

    def each(self):
        for name, client in self.clients.items():
            with self.subTest(name):
                yield client

    def test_a_position_is_reached(self):
        for client in self.each():
            for position in (0.3, -0.2):
                client.send_goal(goal(position))
                state, result = self.end(client)
                self.assertEqual(state, GoalStatus.SUCCEEDED)
                self.assertEqual((result.reached_goal, result.stalled), (True, False))
                self.assertAlmostEqual(result.position, position, delta=TOLERANCE)

    def test_a_gripper_that_is_held_stalls(self):
        freeze(True)
        for client in self.each():
            client.send_goal(goal(1.0))
            state, result = self.end(client)
            self.assertEqual(state, GoalStatus.ABORTED)
            self.assertEqual((result.reached_goal, result.stalled), (False, True))

    def begin_what_does_not_end(self, name):
        """An active goal that neither succeeds nor stalls soon: frozen, with seconds to go, or drifting."""
        freeze(name == "position_gripper")
        client = self.clients[name]
        client.send_goal(goal(1e6, 0.01))
        wait_until(lambda: client.get_state() != GoalStatus.PENDING, "the goal to be accepted", WAIT_S)
        return client

    def test_a_cancelled_goal_is_preempted(self):
        for name in GRIPPERS:
            with self.subTest(name):
                client = self.begin_what_does_not_end(name)
                client.cancel_goal()
                self.assertEqual(self.end(client)[0], GoalStatus.PREEMPTED)

    def test_a_newer_goal_takes_its_place(self):
        for name in GRIPPERS:
            with self.subTest(name):
                other = actionlib.SimpleActionClient("/robot/%s/gripper_cmd" % name, GripperCommandAction)
                self.assertTrue(other.wait_for_server(rospy.Duration(WAIT_S)))
                client = self.begin_what_does_not_end(name)
                other.send_goal(goal(0.1))
                self.assertEqual(self.end(client)[0], GoalStatus.PREEMPTED)
                self.assertEqual(client.get_goal_status_text(), "another goal has come")
                freeze(False)
                self.assertEqual(self.end(other)[0], GoalStatus.SUCCEEDED)

    def test_a_controller_that_does_not_run_rejects(self):
        switch(stop=GRIPPERS)
        try:
            for client in self.each():
                client.send_goal(goal(0.0))
                self.assertEqual(self.end(client)[0], GoalStatus.REJECTED)
                self.assertIn("does not run", client.get_goal_status_text())
        finally:
            switch(start=GRIPPERS)

    def test_what_is_not_finite_is_rejected(self):
        for client in self.each():
            client.send_goal(goal(float("nan")))
            self.assertEqual(self.end(client)[0], GoalStatus.REJECTED)
            self.assertIn("must be finite", client.get_goal_status_text())

    def test_the_effort_is_at_most_what_the_goal_allows(self):
        client = self.clients["effort_gripper"]
        client.send_goal(goal(0.0))
        self.assertEqual(self.end(client)[0], GoalStatus.SUCCEEDED)
        freeze(True)
        for most in (2.5, 40.0):
            client.send_goal(goal(1.0, -most))
            state, result = self.end(client)
            self.assertEqual(state, GoalStatus.ABORTED)
            self.assertAlmostEqual(result.effort, most)


if __name__ == "__main__":
    rospy.init_node("gripper_controller_test")
    rostest.rosrun("ros_controllers", "gripper_controller", GripperControllerTest)
