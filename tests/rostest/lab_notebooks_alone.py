#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The notebooks that start their own simulator, from top to bottom; Jupyter. No process may be left."""
import json
import os
import re
import signal
import subprocess
import unittest
import urllib.error
import urllib.request
import uuid

import cv2
import numpy as np
from notebook_runs import (
    CELL_TIMEOUT_S,
    LEARNING,
    MOVING,
    OWN_LAB,
    ROBOT,
    ROOT,
    ROUNDS,
    WATCHING,
    faults_of,
    is_blank,
    prepare,
    tool,
)

from lab_testing.waiting import wait_until
from lab_tests import processes
from lab_web import jupyter
from processes.ports import free_port

# Set for one server and all its children.
MARKER = "LAB_NOTEBOOK_TEST"


class LabNotebooksAloneTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        prepare()

    def test_no_error_and_no_blank_picture_and_no_process_left(self):
        run_id = uuid.uuid4().hex
        faults = faults_of(*([name] for name in (*OWN_LAB, *(LEARNING if ROUNDS > 1 else ()))), environment=lambda: {
            **os.environ, MARKER: run_id, "ROS_MASTER_URI": "http://localhost:%d" % free_port(),
            "ROS_HOSTNAME": "localhost"})
        self.assertEqual(faults, [], "\n".join(faults))
        self.assertEqual(processes.wait_until_gone(run_id, jupyter.STOP_TIMEOUT_S, MARKER), {})

    def test_a_blank_picture_is_told_from_one_that_shows_little(self):
        pixels = np.full((90, 120, 3), 200, np.uint8)
        self.assertTrue(is_blank(cv2.imencode(".png", pixels)[1].tobytes()))
        pixels[:20, :20] = 90
        self.assertFalse(is_blank(cv2.imencode(".png", pixels)[1].tobytes()))

    def test_no_notebook_is_left_out(self):
        self.assertEqual(sorted(path.stem for path in tool.notebooks()),
                         sorted([*WATCHING, *MOVING, *OWN_LAB, *LEARNING, *ROBOT]))

    def test_jupyter_starts_a_kernel_and_ctrl_c_leaves_nothing(self):
        run_id = uuid.uuid4().hex
        server = subprocess.Popen([str(ROOT / "baxter.sh"), "notebook", "waving", "--port", str(free_port())],
                                  env={**os.environ, MARKER: run_id}, stdout=subprocess.PIPE, text=True,
                                  stdin=subprocess.DEVNULL, start_new_session=True)
        try:
            address = next(line.strip() for line in server.stdout if "http://" in line)
            found = re.fullmatch(r"(http://127\.0\.0\.1:\d+)/lab/tree/(\S+)\?token=(\S+)", address)
            self.assertTrue(found, address)
            base, page, token = found.groups()
            self.assertTrue((ROOT / page).is_file(), page)
            request = urllib.request.Request(base + "/api/kernels", json.dumps({"name": jupyter.KERNEL}).encode(),
                                             {"Authorization": "token " + token, "Content-Type": "application/json"})
            with urllib.request.urlopen(request, timeout=CELL_TIMEOUT_S) as answer:
                self.assertEqual(json.load(answer)["name"], jupyter.KERNEL)
            with self.assertRaises(urllib.error.HTTPError):
                urllib.request.urlopen(base + "/api/kernels", timeout=CELL_TIMEOUT_S)
            # During exec a process shows no environment.
            wait_until(lambda: len(processes.marked(run_id, MARKER)) > 2, "Jupyter and its kernel")
            server.send_signal(signal.SIGINT)
            server.wait(CELL_TIMEOUT_S)
            self.assertEqual(processes.wait_until_gone(run_id, jupyter.STOP_TIMEOUT_S, MARKER), {})
        finally:
            processes.kill_all(run_id, MARKER)
            server.wait()
            server.stdout.close()


if __name__ == "__main__":
    import rostest
    rostest.rosrun("workspace_tests", "lab_notebooks_alone", LabNotebooksAloneTest)
