#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Run the programs of the vendor's SDK on the simulator and judge them in numbers, one JSON line for each run.

The overlay is a catkin workspace with the vendor's packages, built on top of this one. Rows that the file of results
already has are not run again. Exit code: 0 if all runs passed, else 1.
"""
import argparse
import contextlib
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import checks_arms  # noqa: F401  the modules enter their checks into the table
import checks_parts  # noqa: F401
import checks_tools  # noqa: F401
import rospy
from program import PATIENCE_S, Program
from robot import Robot
from std_msgs.msg import Empty
from table import BARE, CHECKS

from lab_testing.fake_joystick import FakeJoystick
from lab_testing.waiting import DEADLINE_S, wait_for_message, wait_until

WORLD = ("baxter_gazebo", "baxter_world.launch", "gui:=false")
NO_GRIPPERS = ("left_gripper:=none", "right_gripper:=none")
# At rest: xbox's and logitech's triggers are axes that read 1.
STICKS_AT_REST, BUTTONS = (0, 0, 1, 0, 0, 1, 0, 0), 11
MASTER_LIMIT_S, START_LIMIT_S = 60.0, 120.0
LAB_END_S = 180.0  # a killed roslaunch leaves its nodes behind
EFFORT_SHARE = 1.001
MEAN_S, ALIKE_RAD, STAY_S = 2.0, 0.01, 2.0
SWING_LIMIT_S = 60.0  # of simulated time


class Lab:
    """One lab on one master, and the programs started beside it. A context manager."""

    def __init__(self, overlay, folder, bare):
        self.folder, self._bare, self.recording, self._notes = folder, bare, None, {}
        self._theirs = environment_of(overlay)

    def __enter__(self):
        with contextlib.ExitStack() as stack:
            port = os.environ["ROS_MASTER_URI"].rpartition(":")[2].rstrip("/")
            words = ["roslaunch", "-p", port, *WORLD, *(NO_GRIPPERS if self._bare else ())]
            self._launched = stack.enter_context(Program(words, dict(os.environ), self.folder, LAB_END_S))
            # A node that starts before the parameter is there takes its time from the wall clock.
            wait_until(has_simulated_time, "use_sim_time on the master", MASTER_LIMIT_S)
            rospy.init_node("sdk_checks", disable_signals=True)
            wait_for_message("/robot/sim/started", Empty, timeout_s=START_LIMIT_S)
            self.robot = Robot(with_grippers=not self._bare)
            self.neutral = self.robot.pose("neutral")
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *_):
        self._stack.close()

    def rosrun(self, package, script, *options):
        return Program(["rosrun", package, script, *options], self._theirs, self.folder)

    def roslaunch(self, package, file, *arguments):
        return Program(["roslaunch", package, file, *arguments], self._theirs, self.folder)

    @contextlib.contextmanager
    def steered(self, file, kind, ready):
        """An example's launch file with a joystick of a kind, plugged in: (FakeJoystick, Program) once it is ``ready``.
        """
        with contextlib.closing(FakeJoystick(STICKS_AT_REST, [0] * BUTTONS)) as stick, \
                self.roslaunch("baxter_examples", file, "joystick:=" + kind, "dev:=" + stick.path) as program:
            stick.plug_in()
            program.expect(ready)
            yield stick, program

    def prepare(self):
        """Enable the robot and bring arms, grippers and head to where each check begins."""
        self.robot.enable()
        if not self._bare:
            self.robot.move(self.neutral)

    def at(self, angles, tolerance, timeout_s=DEADLINE_S):
        """Wait until the arms are within ``tolerance`` of ``angles``, and return how far they are off [rad]."""
        wait_until(lambda: self.robot.off(angles) < tolerance,
                   lambda: "less than %g rad; it is %.3f" % (tolerance, self.robot.off(angles)), timeout_s)
        return self.robot.off(angles)

    def wait_for_off(self, angles, least, what):
        """Wait until a joint is further than ``least`` from ``angles`` [rad], and return how far one is."""
        wait_until(lambda: self.robot.off(angles) > least, what, interval_s=0.001)
        return self.robot.off(angles)

    def settled_off(self, angles):
        """How far a swinging arm's mean comes to be from ``angles``: the largest distance of a joint [rad].

        Means over MEAN_S of simulated time, until two of them are alike. Raises AssertionError after SWING_LIMIT_S.
        """
        end, last = rospy.get_time() + SWING_LIMIT_S, None
        while rospy.get_time() < end:
            mean = self._means(angles)
            if last is not None and max(abs(mean[name] - last[name]) for name in angles) < ALIKE_RAD:
                return max(abs(mean[name] - angle) for name, angle in angles.items())
            last = mean
        raise AssertionError("the arm does not settle within %g s" % SWING_LIMIT_S)

    def _means(self, angles):
        """{name: mean angle over MEAN_S of simulated time [rad]}"""
        watch, end = self.robot.watch(), rospy.get_time() + MEAN_S
        wait_until(lambda: rospy.get_time() > end, "%g s of simulated time" % MEAN_S)
        self.robot.unwatch(watch)
        return {name: watch.mean(name) for name in angles}

    def time_until_near(self, angles, tolerance):
        """The simulated time until the arm stays within ``tolerance`` of ``angles`` for STAY_S [s].

        Raises AssertionError after SWING_LIMIT_S.
        """
        begin = since = rospy.get_time()

        def stays():
            nonlocal since
            now = rospy.get_time()
            if self.robot.off(angles) > tolerance:
                since = now
            assert now < begin + SWING_LIMIT_S, "the arm does not stay within %g rad; it is %.3f rad off" % (
                tolerance, self.robot.off(angles))
            return now - since > STAY_S

        wait_until(stays, "the arm to stay within %g rad" % tolerance, PATIENCE_S)
        return since - begin

    def need_recording(self, record):
        """Make a recording by the vendor's recorder, unless this lab has one."""
        if self.recording is None:
            record(self)
            self.robot.move(self.neutral)

    def note(self, name, number):
        """Add a number to the row of the check that runs."""
        self._notes[name] = number

    def run(self, name):
        """Run a check and return its row."""
        self._notes = {}
        row = {"program": name, "passed": False, "load": os.getloadavg()[0]}
        began, simulated = time.monotonic(), rospy.get_time()
        watch = self.robot.watch()
        try:
            self.prepare()
            measured = CHECKS[name](self)
            share, joint = watch.load()
            row["measured"] = {**measured, **self._notes, "effort_share": share, "effort_joint": joint}
            assert share <= EFFORT_SHARE, "%s had %.2f of its largest effort" % (joint, share)
            row["passed"] = True
        except Exception as error:  # whatever it is, it belongs into the row
            row["why"] = "%s: %s" % (type(error).__name__, error)
        finally:
            self.robot.unwatch(watch)
        wall = time.monotonic() - began
        row.update(wall_s=wall, real_time_factor=(rospy.get_time() - simulated) / wall)
        return row


def environment_of(overlay):
    """The variables that a shell has after sourcing the overlay's setup file."""
    setup = Path(overlay) / "devel" / "setup.bash"
    if not setup.is_file():
        raise SystemExit("%s is missing: --overlay must be a built catkin workspace with the vendor's packages" % setup)
    done = subprocess.run(["bash", "-c", 'source "$1" && env -0', "bash", str(setup)], capture_output=True, check=True)
    variables = dict(entry.split("=", 1) for entry in done.stdout.decode().split("\0") if "=" in entry)
    for package in ("baxter_interface", "baxter_tools", "baxter_examples"):
        words = ["rospack", "find", package]
        found = subprocess.run(words, env=variables, capture_output=True, text=True).stdout.strip()
        if not Path(found).is_relative_to(Path(overlay).resolve()):
            raise SystemExit("%s is %s, not the vendor's in %s" % (package, found or "missing", overlay))
    return variables


def has_simulated_time():
    try:
        return rospy.get_param("/use_sim_time", False)
    except OSError:
        return False


def run_part(arguments, bare, todo):
    """Run ``todo``, [(round, name)], in one lab; each row is written as soon as it is known."""
    with tempfile.TemporaryDirectory() as folder, Lab(arguments.overlay, Path(folder), bare) as lab:
        for number, name in todo:
            row = {"round": number, "label": arguments.label, **lab.run(name)}
            with arguments.results.open("a") as file:
                file.write(json.dumps(row) + "\n")
            print("%-44s %d %s %5.0f s %s" % (name, number, "passed" if row["passed"] else "FAILED", row["wall_s"],
                                              row.get("why", "")), flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--overlay", help="built catkin workspace with the vendor's packages")
    parser.add_argument("--results", type=Path, default=Path("sdk_results.jsonl"), help="file of rows")
    parser.add_argument("--rounds", type=int, default=1)
    parser.add_argument("--only", action="append", default=[], help="checks whose names contain this; repeatable")
    parser.add_argument("--port", type=int, default=11420, help="of the lab's master; the bare arms' is the next one")
    parser.add_argument("--label", default="", help="written into each row: quiet, busy, slow")
    parser.add_argument("--summary", action="store_true", help="only print how many of the rows passed, by program")
    parser.add_argument("--part", choices=("arms", "bare"), help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    # A shell starts its background jobs with Ctrl-C ignored, and programs started here would inherit that.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGTERM, end_in_order)
    if arguments.summary:
        return summarize(arguments.results)
    if not arguments.overlay:
        parser.error("--overlay is missing")
    if arguments.part:
        known = {(row["round"], row["program"]) for row in rows(arguments.results) if row["label"] == arguments.label}
        todo = [(number, name) for number in range(1, arguments.rounds + 1) for name in CHECKS
                if (name in BARE) == (arguments.part == "bare") and (number, name) not in known
                and (not arguments.only or any(word in name for word in arguments.only))]
        if todo:
            run_part(arguments, arguments.part == "bare", todo)
        return 0
    # A process for each kind of lab: a rospy node knows one master.
    for offset, part in enumerate(("arms", "bare")):
        uri = "http://localhost:%d" % (arguments.port + offset)
        run_child([sys.executable, *sys.argv, "--part", part],
                  {**os.environ, "ROS_MASTER_URI": uri, "ROS_HOSTNAME": "localhost"})
    return summarize(arguments.results)


def run_child(words, environment):
    """Run a command. Whatever ends this process meanwhile also ends the command, once, with time to clean up."""
    child = subprocess.Popen(words, env=environment, start_new_session=True)
    try:
        code = child.wait()
    except BaseException:
        child.terminate()
        child.wait()
        raise
    if code:
        raise SystemExit("the lab's process ended with exit code %d" % code)


def end_in_order(*_):
    """Handle SIGTERM: everything that was started is ended."""
    raise SystemExit(128 + signal.SIGTERM)


def rows(path):
    return [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []


def summarize(path):
    """Print the counts by program and label; return 1 if a run failed."""
    found = rows(path)
    for label in sorted({row["label"] for row in found}):
        for name in CHECKS:
            passed = [row["passed"] for row in found if (row["label"], row["program"]) == (label, name)]
            if passed:
                print("%-10s %-44s %d of %d" % (label, name, sum(passed), len(passed)))
    return 0 if all(row["passed"] for row in found) else 1


if __name__ == "__main__":
    sys.exit(main())
