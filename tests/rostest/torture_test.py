#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""tests/torture as a test: `slice` is short and always the same, `all` is long and starts from TORTURE_SEED."""
import json
import os
import random
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import rostest

from lab_testing.skipping import skip

PROGRAM = Path(__file__).resolve().parents[1] / "torture" / "torture.py"
SKIPPED = 77
SLICE_SEED, SLICE_MESSAGES = 16, 500
SEED = int(os.environ.get("TORTURE_SEED", random.SystemRandom().randrange(10**6)))


class Torture(unittest.TestCase):
    def torture(self, suite, seed, *options):
        """Run a suite; returns its result. The failure's text names the failed checks and how to repeat them."""
        with tempfile.TemporaryDirectory() as folder:
            command = [sys.executable, str(PROGRAM), suite, "--seed", str(seed), "--out", folder, *map(str, options)]
            done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
            print(done.stdout, flush=True)
            if done.returncode == SKIPPED:
                skip(self, done.stdout.strip().rpartition("skipped: ")[2])
            self.assertEqual(done.returncode, 0, done.stdout[-6000:])
            return json.loads((Path(folder) / "result.json").read_text(encoding="utf-8"))


class Slice(Torture):
    def test_hostile_messages_and_the_state_machine(self):
        result = self.torture("slice", SLICE_SEED, "--messages", SLICE_MESSAGES)
        self.assertGreater(result["sent"], SLICE_MESSAGES + 10)
        self.assertGreater(result["also"]["messages_received"], 0.8 * SLICE_MESSAGES)
        self.assertGreater(result["also"]["receivers"], 100)
        self.assertGreater(result["also"]["topics_read"], 10)
        self.assertGreater(result["also"]["ticks_in_lock_step"], 1000)


class All(Torture):
    def test_fuzz(self):
        self.torture("fuzz", SEED, "--messages", 20_000, "--minutes", 15)

    def test_garbage(self):
        self.torture("garbage", SEED, "--messages", 2000, "--minutes", 5)

    def test_handshakes(self):
        self.torture("handshakes", SEED, "--messages", 100_000)

    def test_names(self):
        self.torture("names", SEED, "--messages", 100_000)

    def test_submissions(self):
        self.torture("submissions", SEED, "--messages", 100_000)

    def test_machine(self):
        self.torture("machine", SEED, "--minutes", 10)

    def test_faults(self):
        self.torture("faults", SEED, "--messages", 2, "--minutes", 15)

    def test_disk(self):
        self.torture("disk", SEED)

    def test_shm(self):
        self.torture("shm", SEED)

    def test_crowd(self):
        self.torture("crowd", SEED)

    def test_bag(self):
        self.torture("bag", SEED)


if __name__ == "__main__":
    rostest.rosrun("workspace_tests", "torture", {"slice": Slice, "all": All}[sys.argv[1]])
