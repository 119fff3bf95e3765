#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Every notebook about Baxter, from top to bottom, on one robot; and the commands in a terminal."""
import subprocess
import tempfile
import unittest
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from notebook_runs import CELL_TIMEOUT_S, MOVING, WATCHING, faults_of, is_blank, prepare

# Arguments of `rosrun lab_display show`.
SHOWN = ("robot left_hand", "camera head_camera", "joints left_s1 --seconds 0.3 --out s1.png", "urdf --below left_hand",
         "tf --text --below left_lower_forearm", "matrix base head", "matrix base third_hand")


class LabNotebooksTest(unittest.TestCase):
    def test_no_error_and_no_blank_picture(self):
        prepare()
        faults = faults_of(WATCHING, MOVING)
        self.assertEqual(faults, [], "\n".join(faults))

    def test_pictures_in_a_terminal(self):
        with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(2) as pool:
            results = dict(zip(SHOWN, pool.map(lambda words: subprocess.run(
                ["rosrun", "lab_display", "show", *words.split()], cwd=folder, capture_output=True, text=True,
                timeout=CELL_TIMEOUT_S), SHOWN), strict=True))
            for words, result in results.items():
                self.assertEqual(result.returncode, 1 if "third_hand" in words else 0, words + result.stderr)
                if result.stdout.strip().endswith(".png"):
                    self.assertFalse(is_blank((Path(folder) / result.stdout.strip()).read_bytes()), words)
        self.assertIn("x 0.0600, y 0.0000, z 0.6860 m", results["matrix base head"].stdout)
        self.assertIn("[left_w2] left_wrist\n", results["tf --text --below left_lower_forearm"].stdout)
        self.assertIn("no frame third_hand", results["matrix base third_hand"].stderr)
        self.assertEqual(results["joints left_s1 --seconds 0.3 --out s1.png"].stdout, "s1.png\n")


if __name__ == "__main__":
    import rostest
    rostest.rosrun("workspace_tests", "lab_notebooks", LabNotebooksTest)
