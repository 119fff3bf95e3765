#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""`./baxter.sh grade` with the real judge: a small class that is killed and continued; thirty submissions, twice."""
import contextlib
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import rostest

from lab_testing.waiting import wait_until
from processes import isolation

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
import class_of_thirty  # noqa: E402

#: Of a machine at 40 % of one core.
LIMIT_S = 3600.0
SMALL = ("olga", "goran", "a spy", "damaged")


class Graded(unittest.TestCase):
    """A folder for a class, removed at the end."""

    def setUp(self):
        # Short, because sockets are made below it.
        self.folder = Path(tempfile.mkdtemp(prefix="lab-class-"))
        self.addCleanup(shutil.rmtree, self.folder)
        (self.folder / "tmp").mkdir()

    @property
    def _command(self):
        words = [sys.executable, "-P", "-m", "rf_grading", str(self.folder / "class")]
        return [*words, "--trusted"] if isolation.problem() else words

    @property
    def _environment(self):
        return {**os.environ, "TMPDIR": str(self.folder / "tmp")}

    def grade(self):
        """The output of one start."""
        done = subprocess.run(self._command, env=self._environment, capture_output=True, text=True, timeout=LIMIT_S)
        print(done.stdout + done.stderr, flush=True)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        return done.stdout

    def start(self):
        process = subprocess.Popen(self._command, env=self._environment, start_new_session=True)

        def end():
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.wait()

        self.addCleanup(end)
        return process

    def verdicts(self):
        path = self.folder / "class-graded" / "verdicts.jsonl"
        return path.read_bytes().count(b"\n") if path.exists() else 0

    def table(self):
        """{entry: {exercise: (points, key of the fault)}}."""
        data = json.loads((self.folder / "class-graded" / "results.json").read_text(encoding="utf-8"))
        return {student["entry"]: {name: (cell["points"], (cell["verdict"] or {}).get("fault"))
                                   for name, cell in student["exercises"].items()} for student in data["students"]}

    def left_processes(self):
        """Processes of gradings below this test's folder: workers, labs, programs."""
        mark, found = str(self.folder / "tmp").encode(), []
        for path in Path("/proc").glob("[0-9]*"):
            with contextlib.suppress(OSError):
                if mark in (path / "environ").read_bytes() + (path / "cmdline").read_bytes():
                    found.append((path.name, (path / "cmdline").read_bytes()[:100]))
        return found

    def assert_nothing_left(self):
        wait_until(lambda: not self.left_processes(), "the end of all processes of the grading", timeout_s=60.0)
        self.assertEqual(os.listdir(self.folder / "tmp"), [])

    def assert_as_expected(self, table):
        for entry, (_, exercise, _) in ((entry, class_of_thirty.CLASS[entry]) for entry in table):
            least, most = class_of_thirty.EXPECTED.get(entry, (0.0, 50.0))
            points = sum(points for points, _ in table[entry].values())
            self.assertTrue(least <= points <= most, "%s, %s: %s" % (entry, exercise, table[entry]))


class Small(Graded):
    """Killed in the middle, and stopped by Ctrl-C: nothing is left, and the next start goes on."""

    def test_a_grading_goes_on_where_it_was(self):
        class_of_thirty.write(self.folder / "class", SMALL)
        grading = self.start()
        wait_until(lambda: self.verdicts() or grading.poll() is not None, "the first verdict", timeout_s=300.0)
        grading.kill()
        grading.wait()
        wait_until(lambda: not self.left_processes(), "the end of what a killed grading had started", timeout_s=60.0)
        known = self.verdicts()
        self.assertGreater(known, 0)
        said = self.grade()
        self.assertIn("%d have their verdict already" % known, said)
        self.assert_nothing_left()
        table = self.table()
        self.assert_as_expected(table)
        self.assertEqual(table["goran"]["joint_command"], (100.0, None))
        self.assertEqual(table["olga"]["rotate_gripper"], (0.0, "syntax"))
        page = (self.folder / "class-graded/feedback/goran/feedback.html").read_text(encoding="utf-8")
        self.assertIn("<animate", page)
        if not isolation.problem():
            spied = (self.folder / "class-graded/feedback/a spy/feedback.html").read_text(encoding="utf-8")
            self.assertIn("seen: []", spied)
            self.assertIn("no network", spied)
        # Once more: everything is known, and Ctrl-C in the middle of what is new leaves nothing.
        self.assertIn("0 to judge", self.grade())
        class_of_thirty.write(self.folder / "class" / "more", ["jana"])
        (self.folder / "class" / "more" / "jana").rename(self.folder / "class" / "jana")
        (self.folder / "class" / "more").rmdir()
        grading = self.start()
        wait_until(lambda: any(b"roslaunch" in line for _, line in self.left_processes()), "a lab", timeout_s=300.0)
        grading.send_signal(signal.SIGINT)
        self.assertEqual(grading.wait(120.0), 130)
        self.assert_nothing_left()
        self.assertIsNone(self.table()["jana"]["rotate_gripper"][0])


class Class(Graded):
    """Thirty submissions: what each must get, and the same again."""

    def test_thirty_submissions(self):
        class_of_thirty.write(self.folder / "class")
        self.grade()
        first = self.table()
        self.assert_as_expected(first)
        self.assert_nothing_left()
        shutil.rmtree(self.folder / "class-graded")
        self.grade()
        self.assertEqual(points_of(self.table()), points_of(first))
        self.assert_nothing_left()


def points_of(table):
    """A table without faults: of two effects of one program, the judge names the one that it sees first."""
    return {entry: {name: points for name, (points, _) in cells.items()} for entry, cells in table.items()}


SUITES = {"small": Small, "class": Class}

if __name__ == "__main__":
    name = next(word for word in sys.argv[1:] if word in SUITES)
    rostest.rosrun("rf_grading", "grading_" + name, SUITES[name])
