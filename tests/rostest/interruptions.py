#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Every kind of motion, interrupted in every way: nothing moves afterwards until a new command comes.

The world is paused and advanced in beats of 10 ms, so that each interruption comes at the same place of the motion.
Private parameters: ~motions, ~interruptions: names, separated by spaces; default: all.
"""
import contextlib
import re
import sys

import rospy
import rostest
from actionlib_msgs.msg import GoalStatus
from interruption_bench import Bench
from motions import POSITION, ActionMotion, ProgramMotion, Stream, all_motions

from lab_testing import subtests
from lab_testing.waiting import wait_until

# A motion is interrupted when a joint is this far from its start; by then all joints move [rad, m].
UNDER_WAY = {"gripper": 0.004}
UNDER_WAY_RAD = 0.15
# Largest stopping distance of a joint, also after a reset [rad, m]. Wrists are
# fast, and their torques are small: from full speed they need 0.35 (README of baxter_sim_hardware).
BRAKING_RAD, WRIST_BRAKING_RAD = 0.15, 0.35
# Largest motion of a holding joint in HOLD_S [rad, m].
STILL_RAD, HOLD_S = 0.005, 1.0
STILL = {"gripper": 0.0005}
# A robot rests when nothing has moved by REST_RAD in REST_S, at most REST_DEADLINE_S after a motion's end: a commanded
# position is still reached after its program has ended [s, simulated].
REST_RAD, REST_S, REST_DEADLINE_S = 1e-4, 0.3, 8.0

ABORTED, PREEMPTED, SUCCEEDED = GoalStatus.ABORTED, GoalStatus.PREEMPTED, GoalStatus.SUCCEEDED
ELSEWHERE = "put elsewhere|time went back"


class Interruption:
    """``brakes``: whether moving joints stop at once, or continue to their target; ``status``, ``text``: final state of
    a goal, and a regular expression for its text."""

    def __init__(self, do, brakes=True, status=None, text="", only=object, without=()):
        self.do, self.brakes, self.status, self.text, self.only = do, brakes, status, text, only
        self.without = without  # kinds of motion without an expectation


def put_joints(bench, motion):
    bench.put_joints(motion.here)


def pause(bench, motion):
    """Unpause the world, pause it, and continue."""
    bench.call["unpause_physics"]()
    try:
        before = bench._joints
        wait_until(lambda: (bench._joints.header.stamp - before.header.stamp).to_sec() > 0.05, "the world runs")
    finally:
        bench.call["pause_physics"]()
    bench.run(0.002)


def press_and_release(bench, motion):
    bench.press("press")
    bench.run(0.2)
    bench.press("release")
    bench.run(0.2)


def disable_and_enable(bench, motion):
    bench.enabled(False)
    bench.enabled(True)


def another_goal(bench, motion):
    here = bench.positions()
    motion.other = motion.replace({name: here[name] + 0.1 for name in motion.names})


INTERRUPTIONS = {
    "reset_world": Interruption(lambda bench, motion: bench.call["reset_world"](), True, ABORTED, ELSEWHERE),
    "reset_simulation": Interruption(lambda bench, motion: bench.call["reset_simulation"](), True, ABORTED, ELSEWHERE),
    "set_joints": Interruption(put_joints, True, ABORTED, ELSEWHERE),
    "pause": Interruption(pause, False, SUCCEEDED),
    "disable": Interruption(lambda bench, motion: bench.enabled(False), True, ABORTED, "disabled|not enabled"),
    "disable_and_enable": Interruption(disable_and_enable, True, ABORTED, "disabled|not enabled",
                                       without=(ProgramMotion,)),
    "stop": Interruption(lambda bench, motion: bench.stop(), True, ABORTED, "stopped|not enabled"),
    "estop": Interruption(press_and_release, True, ABORTED, "stopped|not enabled"),
    "respawn": Interruption(lambda bench, motion: bench.respawn(), True, ABORTED,
                            "put elsewhere|disabled|lost|not enabled|no joint states"),
    "lost_client": Interruption(lambda bench, motion: motion.lose_client(), False),
    "cancel": Interruption(lambda bench, motion: motion.cancel(), False, PREEMPTED, "cancelled|stopped at",
                           only=ActionMotion),
    "another_goal": Interruption(another_goal, False, PREEMPTED, "another goal|stopped at", only=ActionMotion),
    "killed_server": Interruption(lambda bench, motion: motion.kill_server(), False, only=ActionMotion),
}


class InterruptionsTest(subtests.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.bench = Bench()
        cls.motions = all_motions(cls.bench)

    def test_motions_end_with_an_interruption_and_nothing_moves_afterwards(self):
        interruptions = chosen("interruptions", INTERRUPTIONS)
        for name in chosen("motions", self.motions):
            motion = self.motions[name]
            # Programs of a motion are started once for all its interruptions.
            with self.subTest(motion=name), contextlib.closing(motion):
                motion.prepare()
                for each in interruptions:
                    kind = INTERRUPTIONS[each]
                    if isinstance(motion, kind.only) and not isinstance(motion, kind.without):
                        with self.subTest(motion=name, interruption=each):
                            self.interrupt(name, each)

    def interrupt(self, name, interruption_name):
        """One motion, interrupted once."""
        bench, motion, interruption = self.bench, self.motions[name], INTERRUPTIONS[interruption_name]
        bench.as_new()
        start = bench.positions()
        motion.start()
        bench.run_until(lambda: bench.farthest(start)[0] > UNDER_WAY.get(name, UNDER_WAY_RAD), "%s moves" % name,
                        before=motion.beat, most_s=60.0)
        interruption.do(bench, motion)
        if isinstance(motion, Stream):
            motion.lose_client()  # no commands from here on
        bench.run(0.004)
        here = bench.positions()
        if interruption_name not in ("killed_server", "lost_client"):
            bench.run_until(motion.has_ended, "%s ends" % motion.title)
        if interruption_name == "another_goal":
            bench.run_until(lambda: motion.other.get_goal_status() == SUCCEEDED, "the other goal succeeds")
        self.rest(name)
        if interruption.brakes:
            for joint, position in bench.positions().items():
                self.assertLess(abs(position - here[joint]), WRIST_BRAKING_RAD if "_w" in joint else BRAKING_RAD,
                                "%s has moved after the interruption" % joint)
        self.hold(name, "after it came to rest")
        if isinstance(motion, ActionMotion) and interruption.status is not None:
            self.assertEqual((motion.status, bool(re.search(interruption.text, motion.text))),
                             (interruption.status, True), motion.text)
        # After every interruption, the robot can be enabled again, and continues from its position.
        bench.press("release")
        if not bench.state.enabled:
            bench.clear()
            self.hold(name, "after a reset of its stop")
            bench.enabled(True)
            self.hold(name, "after it was enabled")
        self.follows(motion, interruption_name)

    def rest(self, name):
        for _ in range(round(REST_DEADLINE_S / REST_S)):
            before = self.bench.positions()
            self.bench.run(REST_S, patience_s=0.005)
            if self.bench.farthest(before)[0] < REST_RAD:
                return
        self.fail("%s is %g rad farther than %g s ago, and never came to rest" % (
            *reversed(self.bench.farthest(before)), REST_S))

    def hold(self, name, when):
        before = self.bench.positions()
        self.bench.run(HOLD_S, patience_s=0.002)
        far, joint = self.bench.farthest(before)
        self.assertLess(far, STILL.get(name, STILL_RAD), "%s has moved %s, without a command" % (joint, when))

    def follows(self, motion, interruption_name):
        """A new command works."""
        bench = self.bench
        if isinstance(motion, ActionMotion):
            if interruption_name in ("killed_server", "lost_client"):
                motion.close()
                motion.prepare()
            here = bench.positions()
            return motion.succeeds({name: here[name] + 0.1 for name in motion.names})
        follower = motion if not isinstance(motion, (Stream, ProgramMotion)) else Stream(bench, motion.side, POSITION)
        before = bench.positions()
        try:
            if follower is not motion:
                follower.start()
                bench.run_until(lambda: bench.farthest(before)[0] > 0.1, "a new command", before=follower.beat)
            else:
                motion.go_back()
                bench.run_until(lambda: bench.farthest(before)[0] > 0.002, "a new command")
        finally:
            if follower is not motion:
                follower.close()


def chosen(parameter, table):
    names = rospy.get_param("~" + parameter, "").split() or list(table)
    unknown = set(names) - set(table)
    assert not unknown, "unknown %s: %s; there are %s" % (parameter, " ".join(unknown), " ".join(table))
    return names


if __name__ == "__main__":
    rospy.init_node("interruptions")
    rostest.rosrun("workspace_tests", rospy.get_name().strip("/"), InterruptionsTest, sys.argv)
