#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Loops and moves during which robot, simulation or master ends and restarts: they go on, or report why not."""
import os
import sys

from lab_testing.waiting import wait_until

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from own_master import DEADLINE_S, OwnMasterTest  # noqa: E402

CLOCK_START_S = 1000.0
# A loop as in the examples, which prints at each turn; and a long move.
LOOP = """
import sys
import baxter_dataflow.ros_clock, baxter_interface.programs
from baxter_interface import Limb
baxter_dataflow.ros_clock.STALL_NOTICE_S = 1.0
baxter_interface.programs.LOST_AFTER_S = 1.0
baxter_interface.programs.LAST_WORD_S = 1.0

def body():
    with baxter_interface.programs.EnabledRobot() as robot:
        limb = Limb("left")
        for number, _ in enumerate(robot.beats(20.0)):
            print("beat %d." % number, flush=True)
            if {moves}:
                baxter_interface.programs.expect(limb.move_to_joint_positions({{"left_s1": -1.0}}), "no move")
                print("moved", flush=True)

sys.exit(baxter_interface.programs.run("client", body))
"""


class RestartTest(OwnMasterTest):
    def start_loop(self, moves=False):
        return self.start(sys.executable, "-c", LOOP.format(moves=moves))

    def start_simulation(self, **knobs):
        self.master.setParam("/use_sim_time", True)
        return self.start_robot(clock_start_s=CLOCK_START_S, **knobs)

    def beats(self, client):
        return client.output().count("beat")

    def wait_for_beats(self, client, count=5):
        before = self.beats(client)
        wait_until(lambda: self.beats(client) >= before + count or client.poll() is not None, "beats of the loop",
                   DEADLINE_S)
        self.assertIsNone(client.poll(), client.output())

    def start_loop_that_loses_its_simulation(self):
        self.start_master()
        robot = self.start_simulation()
        client = self.start_loop()
        self.wait_for_beats(client)
        self.end(robot)
        self.wait_for_text(client, "simulated time stands still")
        return client

    def expect_end(self, client, text):
        self.assertEqual(client.wait(DEADLINE_S), 1, client.output())
        self.assertEqual(client.output().count(text), 1, client.output())
        self.assertNotIn("Traceback", client.output())

    def test_simulation_that_comes_back_disabled_ends_the_loop_with_one_line(self):
        client = self.start_loop_that_loses_its_simulation()
        self.assertIsNone(client.poll())
        self.start_simulation()
        self.expect_end(client, "lost the robot: it was disabled, or restarted")

    def test_simulation_that_comes_back_enabled_is_gone_on_with(self):
        client = self.start_loop_that_loses_its_simulation()
        robot = self.start_simulation(enabled=True)
        self.wait_for_beats(client)
        self.end(robot)
        self.wait_for_text(client, "simulated time stands still")
        client.terminate()
        self.assertEqual(client.wait(DEADLINE_S), 130, client.output())
        self.assertIn("does not answer any more", client.output())

    def test_move_under_which_the_simulation_is_restarted_fails_with_the_reason(self):
        self.start_master()
        robot = self.start_simulation(lag_s=5.0)
        client = self.start_loop(moves=True)
        self.wait_for_text(client, "beat 0.")
        self.end(robot)
        self.wait_for_text(client, "simulated time stands still")
        self.start_simulation()
        self.expect_end(client, "left arm: the robot is not enabled")

    def test_robot_in_wall_time_that_falls_silent_ends_the_loop_with_one_line(self):
        self.start_master()
        robot = self.start_robot()
        client = self.start_loop()
        self.wait_for_beats(client)
        self.end(robot)
        self.expect_end(client, "lost the robot: it has reported nothing")

    def test_master_that_is_restarted_ends_the_program_with_one_line(self):
        master = self.start_master()
        robot = self.start_simulation()
        client = self.start_loop()
        self.wait_for_beats(client)
        self.end(robot)
        self.end(master)
        self.wait_for_text(client, "the ROS master at %s is gone" % self.uri)
        self.start_master()
        self.start_simulation()
        self.expect_end(client, "was restarted and does not know this program: start it again")


if __name__ == "__main__":
    import rostest
    rostest.rosrun("baxter_interface", "sdk_restart", "__main__")
