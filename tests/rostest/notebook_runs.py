# SPDX-License-Identifier: BSD-3-Clause
"""Shared by the tests of the labs' notebooks: run one, with LAB_NOTEBOOK_ROUNDS=2 twice in one kernel, and check its
pictures.

The pictures go to .baxter/pictures, and with them those of docs/labs.md.
"""
import base64
import os
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import cv2
import nbformat
import numpy as np
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tools"))
import notebook as tool  # noqa: E402  (a tool at the root of the workspace is not an installed package)
from lab_web import jupyter  # noqa: E402

PICTURES = ROOT / ".baxter" / "pictures"
CELL_TIMEOUT_S = 150
ROUNDS = int(os.environ.get("LAB_NOTEBOOK_ROUNDS", "1"))
# Those that leave Baxter's arms alone, those that move them, and those that need none or start their own.
WATCHING = ("1_transforms_and_tf", "2_urdf", "3_rviz", "4_xacro")
MOVING = ("5_moving_baxter", "6_rotating_the_gripper", "7_waving")
OWN_LAB = ("joint_states_and_trajectories", "ros_control", "planning", "steering")
# It computes for a minute: only where the notebooks are run twice.
LEARNING = ("teach_it",)
# The one that starts the physical robot's profile, and takes minutes.
ROBOT = ("8_before_the_real_robot",)
# The pictures of docs/labs.md, drawn by a cell after the last one: notebook -> (file, expression for a matplotlib
# figure).
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
    """Whether a picture has almost only one colour."""
    pixels = cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR).reshape(-1, 3).astype(int)
    # As one number a pixel: rows take seven times as long to sort.
    _, first, counts = np.unique(pixels @ (1, 256, 65536), return_index=True, return_counts=True)
    paper = pixels[first[np.argmax(counts)]]
    return float((np.abs(pixels - paper).max(axis=1) > 16).mean()) < 0.01


class Run:
    """One notebook in its own kernel."""

    def __init__(self, path, environment):
        self.path = path
        self.notebook = nbformat.read(path, 4)
        self.environment = environment
        self.client = NotebookClient(self.notebook, timeout=CELL_TIMEOUT_S, kernel_name=jupyter.KERNEL,
                                     resources={"metadata": {"path": str(path.parent)}})

    def rounds(self):
        """Execute everything ROUNDS times; return the errors, one per line."""
        faults = []
        with self.client.setup_kernel(env=self.environment):
            for number in range(1, ROUNDS + 1):
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


def prepare():
    """Register the kernel through this process's environment, and make the folder of the pictures."""
    PICTURES.mkdir(parents=True, exist_ok=True)
    tool.write_kernel()
    os.environ.update(jupyter.environment(tool.STATE, tool.STATE))


def faults_of(*rows, environment=lambda: dict(os.environ)):
    """Run lists of notebooks in parallel, those of one list in turn; return the errors, one per line."""
    def run(names):
        return [fault for name in names for fault in Run(tool.find(name), environment()).rounds()]

    with ThreadPoolExecutor(len(rows)) as pool:
        return [fault for found in pool.map(run, rows) for fault in found]
