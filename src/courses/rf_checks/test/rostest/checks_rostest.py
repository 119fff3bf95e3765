#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The judge, on one separate lab for all programs of a suite: exercises, wrong, adversaries; slow, busy."""
import contextlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import rostest

from lab_testing import subtests
from lab_testing.skipping import skip
from processes import isolation

isolation.try_to_enter_network()  # before any library starts threads

from rf_checks import handout, report  # noqa: E402
from rf_checks.exercises import EXERCISES, LABS, UnknownExercise, choose  # noqa: E402
from rf_checks.judge import Judge  # noqa: E402
from rf_checks.lab import JudgedLab, robot_description  # noqa: E402

PACKAGE = Path(__file__).resolve().parents[2]
WORKSPACE = PACKAGE.parents[2]
sys.path.insert(0, str(WORKSPACE / "tools"))
from lab_tests.quota import ProcessorQuota, QuotaError  # noqa: E402

EXERCISE_OF = {exercise.name: exercise for exercise in EXERCISES}
# Keys of a report that hold times.
TIMES = ("wall_s", "cpu_s", "simulated_s", "real_time_factor")
# Program -> the key of its fault, and words, one of which its sentence must contain.
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
# The same for the exercise on planning, whose lab is restarted for each program.
PLANNING = {
    "knows_no_pillar": ("no_box", "PlanningSceneInterface().add_box"),
    "half_pillar": ("half_size", "whole edges"),
    "plans_only": ("not_executed", "go()"),
    "pillar_elsewhere": ("box_elsewhere", "header.frame_id"),
}
ADVERSARIES = {
    "names_twice": ("repeated_names", "push_back"),
    "tf_quaternion_order": ("quaternion_order", "quat = (q.x"),
    "tf_of_the_sheet": ("quaternion_order", "that of base -> head"),
    "crashes": ("crashed", "line 7"),
    "prints_made_up_matrices": ("wrong_numbers", "elsewhere"),
    "drags_the_hand": ("early_exit", "before any arm moved"),
    "teleports": ("crashed", "set_model_configuration] unavailable"),
    "fakes_clock": ("intruder", "/clock"),
    "pauses": ("crashed", "pause_physics] unavailable"),
    "unregisters_node": ("killed_nodes", "/baxter_sim_kinematics_left"),
    "leaves_children": ("not_enabled", "RobotEnable"),
    "reads_the_judge": ("made_up", "experiment"),
    "fills_output": ("output", "megabytes"),
    "fork_bomb": ("processes", "processes"),
    "creeps": ("not_enabled", "RobotEnable"),
    "forges_ik_report": ("intruder", "IKReport"),
    "fakes_joint_states": ("intruder", "/robot/joint_states"),
    "shuts_nodes_down": ("killed_nodes", "/base_to_world"),
    "shuts_master_down": ("killed_nodes", "the ROS master"),
    "takes_a_name": ("killed_nodes", "/baxter_sim_kinematics_left"),
    "unregisters_others": ("withdrawn", "/robot/limb/right/joint_command"),
    "changes_parameters": ("parameters", "/robot_description"),
}


class Judged(subtests.TestCase):
    """Base of all suites: one judge."""

    @classmethod
    def setUpClass(cls):
        cls.judge = Judge(trusted=True)

    @classmethod
    def tearDownClass(cls):
        cls.judge.close()

    def check(self, folder, name, seed=1):
        # A name without suffix is that of a Python file; invalid Python has another suffix, because of the linter.
        path = next((PACKAGE / folder).glob(name + ".*"))
        text = path.read_text(encoding="utf-8")
        for lab in LABS:
            try:
                exercise = EXERCISE_OF.get(name) or choose(lab, "", path.name, text)
            except UnknownExercise:
                continue
            result = self.judge.check(exercise, path, seed)
            print("%s\n%s\n" % (path.name, report.text(result)), flush=True)
            return result
        raise AssertionError("%s is meant for no exercise" % path)

    def check_solutions(self, exercises):
        for exercise in exercises:
            with self.subTest(solution=exercise.name):
                result = self.check("exercises/solutions", exercise.name)
                self.assertAlmostEqual(result.points, 100.0, delta=0.01)
                self.assertIsNone(result.fault)

    def check_skeletons(self, exercises):
        for exercise in exercises:
            with self.subTest(skeleton=exercise.name):
                result = self.check("exercises/skeletons", exercise.name)
                self.assertLess(result.points, 50.0)
                self.assertIsNotNone(result.fault, "no hint")

    def check_faults(self, programs):
        """Programs: name -> (key of its fault, words...), as WRONG."""
        for name, (key, *words) in programs.items():
            with self.subTest(program=name):
                result = self.check("test/wrong", name)
                self.assertIsNotNone(result.fault, report.text(result))
                self.assertEqual(result.fault.key, key, report.text(result))
                self.assertTrue(any(word in result.fault.sentence for word in words), result.fault.sentence)
                self.assertLess(result.points, 50.0)


def graded(result):
    """The part of the report that must not depend on the machine: without times."""
    def without_times(value):
        if isinstance(value, dict):
            return {key: without_times(one) for key, one in value.items() if key not in TIMES}
        return [without_times(one) for one in value] if isinstance(value, list) else value

    found = without_times(json.loads(report.as_json(result)))
    for run in found["runs"]:
        # This criterion contains a time.
        run["criteria"] = [one for one in run["criteria"] if one["name"] != "time"] + \
            [one["points"] for one in run["criteria"] if one["name"] == "time"]
    return found


class Loaded(unittest.TestCase):
    """The same points on a busy machine, or no grade."""

    def judge_all(self, programs):
        """Program -> its graded report: dict. Programs: (folder, name)."""
        judged = Judged()
        judged.judge = Judge(wall_limit_s=3600.0, trusted=True)
        try:
            return {program: graded(judged.check(*program)) for program in programs}
        finally:
            judged.judge.close()

    def compare(self, programs, loads, times=1):
        expected = self.judge_all(programs)
        for name, load in loads.items():
            for _ in range(times):
                try:
                    with load():
                        found = self.judge_all(programs)
                except QuotaError as reason:
                    skip(self, "%s: %s" % (name, reason))
                for program, result in found.items():
                    if not result["graded"]:
                        print("%s: %s: not graded: %s" % (name, program[1], result["not_graded"]), flush=True)
                    else:
                        self.assertEqual(result, expected[program], "%s, %s" % (name, program[1]))


@contextlib.contextmanager
def other_labs(count):
    """Run this many other labs, in real time."""
    with contextlib.ExitStack() as stack:
        for _ in range(count):
            stack.enter_context(JudgedLab(robot_description())).start()
        yield


class Slow(Loaded):
    """A solution and a wrong program at a fifth of a processor."""

    def test_a_slow_machine_changes_no_points(self):
        self.compare([("exercises/solutions", "joint_command"), ("test/wrong", "exits_early")],
                     {"20 %": lambda: ProcessorQuota(20)})


class Busy(Loaded):
    """All solutions and all wrong programs, twice, on slow and on busy machines."""

    PROGRAMS = [*(("exercises/solutions", exercise.name) for exercise in EXERCISES),
                *(("test/wrong", name) for name in WRONG)]

    def test_full_speed(self):
        self.compare(self.PROGRAMS, {"full speed": contextlib.nullcontext})

    def test_40_percent(self):
        self.compare(self.PROGRAMS, {"40 %": lambda: ProcessorQuota(40)}, times=2)

    def test_20_percent(self):
        self.compare(self.PROGRAMS, {"20 %": lambda: ProcessorQuota(20)}, times=2)

    def test_eight_other_labs(self):
        self.compare(self.PROGRAMS, {"eight labs": lambda: other_labs(8)}, times=2)


class Repeated(Loaded):
    """Wrong programs get the same report each time."""

    def test_five_times(self):
        self.compare([("test/wrong", name) for name in WRONG], {"again": contextlib.nullcontext}, times=4)


# A lab with move_group or a servo is restarted for each program, and time waits for a servo at each of its steps.
def is_slow(exercise):
    return exercise.lab == "steering"


def has_slow_skeleton(exercise):
    return exercise.lab in ("moveit", "steering")


class Exercises(Judged):
    """Solutions and skeletons."""

    def test_solutions_get_all_points(self):
        self.check_solutions(exercise for exercise in EXERCISES if not is_slow(exercise))

    def test_skeletons_get_a_hint(self):
        self.check_skeletons(exercise for exercise in EXERCISES if not has_slow_skeleton(exercise))


class Wrong(Judged):
    """Ten ways to be wrong."""

    def test_faults_are_named(self):
        self.check_faults(WRONG)


class Planning(Judged):
    """Programs for the exercise on planning that are wrong, its skeleton, and the exercise on steering."""

    def test_solutions_get_all_points(self):
        self.check_solutions(exercise for exercise in EXERCISES if is_slow(exercise))

    def test_skeletons_get_a_hint(self):
        self.check_skeletons(exercise for exercise in EXERCISES if has_slow_skeleton(exercise))

    def test_faults_are_named(self):
        self.check_faults(PLANNING)


class Adversaries(Judged):
    """Programs against the judge."""

    def test_faults_are_named(self):
        self.check_faults(ADVERSARIES)

    def test_what_a_run_plants_is_gone_in_the_next(self):
        result = self.check("test/wrong", "plants_files")
        self.assertEqual([run.fault.key for run in result.runs], ["no_matrix", "no_matrix"], report.text(result))
        self.assertEqual(result.points, 0.0)

    def test_a_solution_cannot_be_run_and_the_attempt_is_noted(self):
        result = self.check("test/wrong", "runs_the_solution")
        self.assertTrue(any("runpy.run_path" in note for note in result.notes), result.notes)
        if not self.judge.has_walls:
            skip(self, "no walls: %s" % isolation.problem())
        # It would get all points.
        self.assertEqual(result.points, 0.0, report.text(result))

    def test_the_next_program_finds_the_lab_as_it_was(self):
        for name in ("takes_a_name", "unregisters_others", "changes_parameters"):
            self.check("test/wrong", name)
            result = self.check("exercises/solutions", "joint_command")
            self.assertAlmostEqual(result.points, 100.0, delta=0.01, msg="after %s" % name)

    def test_a_copied_solution_is_noted(self):
        note, *_ = self.check("exercises/solutions", "tf_listener").notes
        self.assertIn("exercises/solutions/tf_listener.py", note)


class Handout(unittest.TestCase):
    """The check in a students' copy: its own files, with what the workspace has built."""

    def test_a_student_is_graded_there(self):
        with tempfile.TemporaryDirectory(prefix="lab-handout-") as folder:
            copy, result = Path(folder) / "workspace", Path(folder) / "result.json"
            handout.make(WORKSPACE, copy)
            program = Path(shutil.copy(PACKAGE / "exercises/solutions/tf_listener.py", folder))
            sources = [str(setup.parent / "src") for setup in sorted((copy / "src").rglob("setup.py"))]
            environment = {**os.environ, "LAB_ROOT": str(copy),
                           "PYTHONPATH": os.pathsep.join((*sources, os.environ["PYTHONPATH"])),
                           "ROS_PACKAGE_PATH": "%s/src:%s" % (copy, os.environ["ROS_PACKAGE_PATH"])}
            check = copy / "src/courses/rf_checks/scripts/check"
            done = subprocess.run([sys.executable, check, "lab2", program, "--trusted", "--json", result],
                                  env=environment, cwd=folder, capture_output=True, text=True, timeout=900.0)
            self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
            found = json.loads(result.read_text(encoding="utf-8"))
            self.assertEqual((found["points"], found["fault"]), (100.0, None), found)
            # There is no solution to compare with.
            self.assertEqual(found["notes"], [])


SUITES = {"exercises": Exercises, "wrong": Wrong, "planning": Planning, "adversaries": Adversaries, "slow": Slow,
          "busy": Busy, "repeated": Repeated, "handout": Handout}

if __name__ == "__main__":
    name = next(word for word in sys.argv[1:] if word in SUITES)
    rostest.rosrun("rf_checks", "checks_" + name, SUITES[name])
