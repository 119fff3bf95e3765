#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The judge at work, on one lab of its own for all programs of a suite: exercises, wrong, adversaries."""
import sys
import unittest
from pathlib import Path

import rostest

from rf_checks import report
from rf_checks.exercises import EXERCISES, LABS, UnknownExercise, choose
from rf_checks.judge import Judge

PACKAGE = Path(__file__).resolve().parents[2]
# Program -> the key of its fault, and words of which its sentence must have one.
WRONG = {
    "syntax_error": ("syntax", "line 7"),
    "infinite_loop": ("busy", "line 8"),
    "wrong_frame": ("wrong_frame", "`head`"),
    "quaternion_order": ("quaternion_order", "quat_t3d"),
    "degrees": ("degrees", "90 radians"),
    "never_enables": ("not_enabled", "RobotEnable"),
    "wrong_arm": ("wrong_arm", "right arm"),
    "exits_early": ("early_exit", "1 joint command "),
    "floods": ("flood", "rospy.Rate"),
    "kills_simulator": ("killed_simulator", "rosnode"),
}
ADVERSARIES = {
    "names_twice": ("repeated_names", "push_back"),
    "tf_quaternion_order": ("quaternion_order", "quat = (q.x"),
    "tf_of_the_sheet": ("quaternion_order", "that of base -> head"),
    "crashes": ("crashed", "line 7"),
    "prints_made_up_matrices": ("wrong_numbers", "elsewhere"),
    "teleports": ("teleport", "set_model_configuration"),
    "fakes_clock": ("intruder", "/clock"),
    "pauses": ("paused", "pause_physics"),
    "unregisters_node": ("killed_nodes", "/baxter_sim_kinematics_left"),
    "leaves_children": ("not_enabled", "RobotEnable"),
    "reads_the_judge": ("made_up", "experiment"),
    "fills_output": ("output", "megabytes"),
    "fork_bomb": ("processes", "processes"),
}


class Judged(unittest.TestCase):
    """What all suites need: one judge."""

    @classmethod
    def setUpClass(cls):
        cls.judge = Judge()

    @classmethod
    def tearDownClass(cls):
        cls.judge.close()

    def check(self, folder, name, seed=1):
        # A name without suffix is that of a Python file; what Python cannot read goes without, for the linter's sake.
        path = next((PACKAGE / folder).glob(name + ".*"))
        text = path.read_text(encoding="utf-8")
        for lab in LABS:
            try:
                exercise = choose(lab, "", path.name, text)
            except UnknownExercise:
                continue
            result = self.judge.check(exercise, path, seed)
            print("%s\n%s\n" % (path.name, report.text(result)), flush=True)
            return result
        raise AssertionError("%s is meant for no exercise" % path)


class Exercises(Judged):
    """Solutions and skeletons."""


class Wrong(Judged):
    """Ten ways to be wrong."""


class Adversaries(Judged):
    """Programs against the judge."""


def add(suite, name, test):
    setattr(suite, "test_" + name, test)


def solution(name):
    def test(self):
        result = self.check("exercises/solutions", name)
        self.assertAlmostEqual(result.points, 100.0, delta=0.01)
        self.assertIsNone(result.fault)
    return test


def skeleton(name):
    def test(self):
        result = self.check("exercises/skeletons", name)
        self.assertLess(result.points, 50.0)
        self.assertIsNotNone(result.fault, "no hint for the skeleton of %s" % name)
    return test


def fault(name, key, *words):
    def test(self):
        result = self.check("test/wrong", name)
        self.assertIsNotNone(result.fault, report.text(result))
        self.assertEqual(result.fault.key, key, report.text(result))
        self.assertTrue(any(word in result.fault.sentence for word in words), result.fault.sentence)
        self.assertLess(result.points, 50.0)
    return test


for exercise in EXERCISES:
    add(Exercises, exercise.name + "_solution", solution(exercise.name))
    add(Exercises, exercise.name + "_skeleton", skeleton(exercise.name))
for suite, programs in ((Wrong, WRONG), (Adversaries, ADVERSARIES)):
    for program, (key, *words) in programs.items():
        add(suite, program, fault(program, key, *words))

SUITES = {"exercises": Exercises, "wrong": Wrong, "adversaries": Adversaries}

if __name__ == "__main__":
    name = next(word for word in sys.argv[1:] if word in SUITES)
    rostest.rosrun("rf_checks", "checks_" + name, SUITES[name])
