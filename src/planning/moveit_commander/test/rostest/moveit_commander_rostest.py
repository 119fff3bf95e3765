#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Commanders over real topics, services and actions, in both namespaces; programs and the shell end as they should."""
import subprocess
import sys
import threading
import unittest

import rospy
from std_msgs.msg import String

from lab_testing.waiting import stretched, wait_for_message, wait_until
from moveit_commander import (
    MoveGroupCommander,
    MoveItCommanderException,
    PlanningSceneInterface,
    RobotCommander,
    conversions,
)

GROUP = "manipulator"
UPWARD = [0.0, 0.0, 1.5708, 0.0, 1.5708, 0.0]
PROGRAM = """
import sys
import moveit_commander
moveit_commander.roscpp_initialize(sys.argv)
robot = moveit_commander.RobotCommander()
group = moveit_commander.MoveGroupCommander("manipulator")
scene = moveit_commander.PlanningSceneInterface()
print(group.go([0.1] * 6), len(group.get_current_joint_values()), robot.get_group_names())
moveit_commander.roscpp_shutdown()
"""


def run(*command, **options):
    return subprocess.run(command, text=True, capture_output=True, timeout=stretched(90.0), **options)


class CommanderTest(unittest.TestCase):
    def test_planning_and_moving_in_both_namespaces(self):
        for ns in ("", "robot1"):
            with self.subTest(ns=ns):
                group = MoveGroupCommander(GROUP, ns=ns, wait_for_servers=stretched(60.0))
                group.set_named_target("home")
                self.assertTrue(group.go(wait=True))
                success, plan, _, code = group.plan(UPWARD)
                self.assertTrue(success, code)
                self.assertEqual(list(plan.joint_trajectory.points[-1].positions), UPWARD)
                self.assertEqual(group.get_current_joint_values(), [0.0] * 6)
                self.assertTrue(group.execute(plan))
                self.assertEqual(group.get_current_joint_values(), UPWARD)
                self.assertTrue(group.go([0.2] * 6, wait=False))
                wait_until(lambda group=group: group.get_current_joint_values() == [0.2] * 6, "the robot to move")
                self.assertEqual(RobotCommander(ns=ns).get_group_names(), [GROUP])

    def test_the_full_name_of_the_description_works_too(self):
        group = MoveGroupCommander(GROUP, robot_description="robot1/robot_description", ns="robot1")
        self.assertEqual(len(group.get_current_joint_values()), 6)

    def test_objects_are_in_the_scene_when_the_call_returns(self):
        for ns in ("", "robot1"):
            scene = PlanningSceneInterface(ns=ns)
            self.assertTrue(scene.add_box("box", conversions.list_to_pose_stamped([1, 0, 0, 0, 0, 0], "base_link")))
            self.assertIn("box", scene.get_known_object_names())

    def test_a_program_publishes_and_calls_in_the_scenes_own_name(self):
        for ns in ("", "robot1"):
            with self.subTest(ns=ns):
                scene, at = PlanningSceneInterface(ns=ns, synchronous=False), ns and "/" + ns
                self.assertEqual(scene._pub_co.resolved_name, at + "/collision_object")
                self.assertEqual(scene._pub_aco.resolved_name, at + "/attached_collision_object")
                self.assertEqual(scene._apply_planning_scene_diff.resolved_name, at + "/apply_planning_scene")

    def test_without_a_server_it_says_so_and_waits_no_longer_than_told(self):
        with self.assertRaisesRegex(RuntimeError, "Unable to connect to move_group action server '/nobody/move_group'"):
            MoveGroupCommander(GROUP, robot_description="/robot_description", ns="nobody", wait_for_servers=0.2)
        with self.assertRaisesRegex(RuntimeError, "there is no /nothing and no /nothing_semantic"):
            MoveGroupCommander(GROUP, robot_description="/nothing")

    def test_stopping_ends_a_goal_and_is_heard(self):
        group = MoveGroupCommander(GROUP)
        group.set_planner_id("wait")
        outcome = []
        waiting = threading.Thread(target=lambda: outcome.append(group.go(UPWARD)))
        waiting.start()

        def stopped():
            group.stop()
            waiting.join(0.2)
            return not waiting.is_alive()

        wait_until(stopped, "the goal to end")
        self.assertEqual(outcome, [False])
        wait_for_message("heard", String, lambda message: message.data == "stop")

    def test_a_refused_goal_is_a_failure(self):
        group = MoveGroupCommander(GROUP)
        group.set_planner_id("refuse")
        plan = group.plan(UPWARD)
        self.assertFalse(plan[0])
        self.assertEqual(plan[3].val, 99999)

    def test_a_server_that_dies_ends_the_goal(self):
        fake = subprocess.Popen(["rosrun", "moveit_commander", "fake_move_group.py", "__ns:=mortal"])
        self.addCleanup(fake.kill)
        group = MoveGroupCommander(GROUP, robot_description="/robot_description", ns="mortal",
                                   wait_for_servers=stretched(60.0))
        group.set_planner_id("die")
        self.assertFalse(group.plan(UPWARD)[0])
        fake.wait(stretched(60.0))
        with self.assertRaises(MoveItCommanderException):
            group.get_current_joint_values()

    def test_programs_end_by_themselves(self):
        done = run(sys.executable, "-c", PROGRAM)
        self.assertEqual((done.returncode, done.stdout), (0, "True 6 ['manipulator']\n"), done.stderr)
        done = run(sys.executable, "-c", PROGRAM + "moveit_commander.os._exit(3)\n")
        self.assertEqual(done.returncode, 3, done.stderr)

    def test_the_shell(self):
        commands = "go upward\ncurrent\nrecord here\nshow here\n"
        done = run("rosrun", "moveit_commander", "moveit_commander_cmdline.py", GROUP, input=commands)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("using group manipulator", done.stdout)
        self.assertIn("here = [0 0 1.5708 0 1.5708 0]", done.stdout)
        done = run("rosrun", "moveit_commander", "moveit_commander_cmdline.py", GROUP, input="go nowhere\n")
        self.assertEqual(done.returncode, 1)
        self.assertIn("has no state 'nowhere'", done.stdout)


if __name__ == "__main__":
    import rostest
    rospy.init_node("moveit_commander_rostest")
    rostest.rosrun("moveit_commander", "moveit_commander", CommanderTest)
