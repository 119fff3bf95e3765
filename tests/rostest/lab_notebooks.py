#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Every notebook of the labs, top to bottom, twice in one kernel: no error, pictures that show something, nothing left.

The pictures go to .baxter/pictures, and with them those of docs/labs.md.
"""
import base64
import json
import os
import re
import signal
import subprocess
import sys
import unittest
import urllib.error
import urllib.request
import uuid
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import cv2
import nbformat
import numpy as np
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tools"))
import notebook as tool  # noqa: E402  (a tool at the root of the workspace is no installed package)
from lab_tests import processes  # noqa: E402
from lab_tests.rostests import free_port  # noqa: E402

PICTURES = ROOT / ".baxter" / "pictures"
CELL_TIMEOUT_S = 150
# Set for one server and all that it starts.
MARKER = "LAB_NOTEBOOK_TEST"
# Those that leave Baxter's arms alone, those that move them, and those whose robot is another one.
WATCHING = ("1_transforms_and_tf", "2_urdf", "3_rviz", "4_xacro")
MOVING = ("5_moving_baxter", "6_rotating_the_gripper", "7_waving")
OWN_LAB = ("joint_states_and_trajectories", "ros_control")
# What docs/labs.md shows, drawn by a cell after the last one: notebook -> (file, expression for a matplotlib figure).
DRAWN = {
    "1_transforms_and_tf": ("labs_tree.svg", "show.tf_tree(below='left_arm_mount').figure('left arm')"),
    "5_moving_baxter": ("labs_move.svg", "joint_plot.figure_of(log.samples, title='from neutral to the pose')"),
    "7_waving": ("labs_wave.svg", "joint_plot.figure_of(log.samples, title='waving with both arms')"),
}
DRAW = """import matplotlib
from lab_display import joint_plot
with matplotlib.rc_context({'svg.fonttype': 'none', 'svg.hashsalt': 'labs', 'path.simplify_threshold': 0.5}):
    %s.savefig(%r, metadata={'Date': None})
"""


def is_blank(png):
    """Whether a picture shows one colour, or hardly anything else."""
    pixels = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR)
    most = np.median(pixels.reshape(-1, 3), axis=0)
    return float((np.abs(pixels - most).max(axis=2) > 24).mean()) < 0.01


class Run:
    """One notebook in a kernel of its own."""

    def __init__(self, path, environment):
        self.path = path
        self.notebook = nbformat.read(path, 4)
        self.environment = environment
        self.client = NotebookClient(self.notebook, timeout=CELL_TIMEOUT_S, kernel_name=tool.KERNEL,
                                     resources={"metadata": {"path": str(path.parent)}})

    def twice(self):
        """Execute everything twice; returns what is wrong, a line each."""
        faults = []
        with self.client.setup_kernel(env=self.environment):
            for number in (1, 2):
                faults += ["%s, round %d: %s" % (self.path.stem, number, text) for text in self._once(number)]
            if self.path.stem in DRAWN and not faults:
                name, figure = DRAWN[self.path.stem]
                cell = nbformat.v4.new_code_cell(DRAW % (figure, str(PICTURES / name)))
                self.notebook.cells.append(cell)
                self.client.execute_cell(cell, len(self.notebook.cells) - 1)
        return faults

    def _once(self, number):
        pictures = 0
        for index, cell in enumerate(self.notebook.cells):
            try:
                self.client.execute_cell(cell, index)
            except CellExecutionError as error:
                yield "cell %d: %s" % (index, error)
                return
            for output in cell.get("outputs", ()):
                if "image/png" in output.get("data", {}):
                    png = base64.b64decode(output["data"]["image/png"])
                    (PICTURES / ("%s_%02d.png" % (self.path.stem, index))).write_bytes(png)
                    pictures += 1
                    if is_blank(png):
                        yield "cell %d: its picture is blank" % index
        if not pictures:
            yield "it shows no picture"


class LabNotebooksTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        PICTURES.mkdir(parents=True, exist_ok=True)
        tool.write_kernel(tool.STATE)
        # nbclient looks for kernels by this process's environment.
        os.environ.update(tool.environment(tool.STATE))

    def run_all(self, *rows, environment=lambda: dict(os.environ)):
        """Run rows of notebooks beside each other, those of a row one after the other."""
        def run(names):
            return [fault for name in names for fault in Run(tool.find(name), environment()).twice()]

        with ThreadPoolExecutor(len(rows)) as pool:
            faults = [fault for found in pool.map(run, rows) for fault in found]
        self.assertEqual(faults, [], "\n".join(faults))

    def test_notebooks_that_share_the_simulated_baxter(self):
        self.run_all(WATCHING, MOVING)

    def test_notebooks_with_a_simulator_of_their_own(self):
        self.run_all(*([name] for name in OWN_LAB), environment=lambda: {
            **os.environ, "ROS_MASTER_URI": "http://localhost:%d" % free_port(), "ROS_HOSTNAME": "localhost"})

    def test_no_notebook_is_left_out(self):
        self.assertEqual(sorted(path.stem for path in tool.notebooks()), sorted([*WATCHING, *MOVING, *OWN_LAB]))

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
            request = urllib.request.Request(base + "/api/kernels", json.dumps({"name": tool.KERNEL}).encode(),
                                             {"Authorization": "token " + token, "Content-Type": "application/json"})
            with urllib.request.urlopen(request, timeout=CELL_TIMEOUT_S) as answer:
                self.assertEqual(json.load(answer)["name"], tool.KERNEL)
            with self.assertRaises(urllib.error.HTTPError):
                urllib.request.urlopen(base + "/api/kernels", timeout=CELL_TIMEOUT_S)
            self.assertGreater(len(processes.marked(run_id, MARKER)), 2)
            server.send_signal(signal.SIGINT)
            server.wait(CELL_TIMEOUT_S)
            self.assertEqual(processes.marked(run_id, MARKER), {})
        finally:
            processes.kill_all(run_id, MARKER)
            server.wait()
            server.stdout.close()


if __name__ == "__main__":
    import rostest
    rostest.rosrun("workspace_tests", "lab_notebooks", LabNotebooksTest)
