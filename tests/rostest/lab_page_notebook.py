#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""An exercise in JupyterLab beside the robot, in one page of a real browser: run, checked, verdict and hint seen."""
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import rospkg
import rospy

from lab_testing.processes import is_alive
from lab_testing.skipping import skip
from lab_testing.waiting import stretched, wait_until
from processes.family import children_of

# What the tests of the page share is no part of an installed package.
sys.path.insert(0, str(Path(rospkg.RosPack().get_path("lab_web")) / "test" / "rostest"))
from lab_window import PageTest, wait_briefly, wait_for_state  # noqa: E402

FRAME = "document.getElementById('notebook-frame')"
CELLS = FRAME + ".contentDocument.querySelectorAll('.jp-NotebookPanel:not(.lm-mod-hidden) .jp-CodeCell')"
ENABLE = """import lab_session
lab = lab_session.connect("baxter")
import baxter_interface
baxter_interface.RobotEnable().enable()
"""
CHECK = "!$LAB_ROOT/baxter.sh check lab2 tf_listener %s"
CHECK_S = 300.0
SHIFT = 8


def cell(text):
    return {"cell_type": "code", "execution_count": None, "metadata": {}, "outputs": [], "id": "a%d" % abs(hash(text)),
            "source": text}


class LabNotebook(PageTest):
    @classmethod
    def setUpClass(cls):
        cls.exercises = Path(rospkg.RosPack().get_path("rf_checks")) / "exercises"
        cls.folder = Path(tempfile.mkdtemp(prefix="lab_notebook_test_"))
        cls.root = cls.folder / "home"
        # Other checks of this user write their results elsewhere.
        environment = {**os.environ, "ROS_HOME": str(cls.folder), "LAB_WEB_TOKEN": "drive",
                       "LAB_WEB_VIEW_TOKEN": "look"}
        cls.page = subprocess.Popen(["rosrun", "lab_web", "lab_web", "--port", "0", "--notebook-root", str(cls.root)],
                                    env=environment, stdin=subprocess.DEVNULL, start_new_session=True)
        super().setUpClass()

    @classmethod
    def tearDownClass(cls):
        try:
            super().tearDownClass()
            family = children_of([cls.page.pid])
            cls.page.send_signal(signal.SIGINT)
            cls.page.wait(stretched(120.0))
            wait_until(lambda: not any(map(is_alive, family)), lambda: "the end of %s" % family, 60.0)
        finally:
            if cls.page.poll() is None:
                cls.page.kill()
                cls.page.wait()
            shutil.rmtree(cls.folder, ignore_errors=True)

    def setUp(self):
        super().setUp()
        if not (self.exercises / "solutions").is_dir():
            skip(self, "a students' copy, which has no solutions")

    def open_notebook(self, name, *cells):
        """Write a notebook and open it in the page's frame."""
        content = {"cells": list(map(cell, cells)), "nbformat": 4, "nbformat_minor": 5,
                   "metadata": {"kernelspec": {"name": "baxter", "display_name": "Baxter lab", "language": "python"}}}
        (self.root / name).write_text(json.dumps(content), encoding="utf-8")
        self.browser.wait("!document.getElementById('notebook-toggle').hidden")
        if self.browser.evaluate("document.getElementById('notebook').hidden"):
            self.browser.click("#notebook-toggle")
        self.browser.wait("lab.notebook.loaded", 200.0)
        said = list(self.browser.errors)
        self.browser.evaluate("%s.src = lab.notebook.address('%s')" % (FRAME, name))
        self.browser.wait("%s.contentWindow.location.pathname.endsWith('%s')" % (FRAME, name))
        # A JupyterLab that is left while it loads says "Failed to fetch" of each of its requests; it takes long where
        # the machine is busy.
        self.browser.errors[:] = said
        document = FRAME + ".contentDocument"
        self.browser.wait("Boolean(%s.querySelector('.jp-NotebookPanel:not(.lm-mod-hidden) .jp-CodeCell'))" % document,
                          200.0)
        # The notebook's own light is not there where its tools have no room.
        self.browser.wait("%s.getElementById('jp-main-statusbar')?.textContent.includes('| Idle')" % document, 200.0)

    def run_cell(self, number):
        """Click into a cell of the notebook, and press Shift and Enter; again where a busy page has not heard it."""
        def runs():
            self._press_in_cell(number)
            return wait_briefly(lambda: self.browser.evaluate(
                "%s[%d].querySelector('.jp-InputPrompt').textContent !== '[ ]:'" % (CELLS, number)), 5.0)
        wait_until(runs, "cell %d that runs" % number, 60.0)

    def _press_in_cell(self, number):
        place = self.browser.evaluate("""(() => {
            const frame = %s;
            const editor = %s[%d].querySelector(".jp-InputArea-editor .cm-content");
            frame.scrollIntoView({block: "center"});
            editor.scrollIntoView({block: "center"});
            const [outer, inner] = [frame, editor].map((one) => one.getBoundingClientRect());
            return {x: outer.left + inner.left + 20, y: outer.top + inner.top + 8};
        })()""" % (FRAME, CELLS, number))
        for kind in ("mousePressed", "mouseReleased"):
            self.browser.call("Input.dispatchMouseEvent", type=kind, button="left", clickCount=1, **place)
        for kind in ("rawKeyDown", "keyUp"):
            self.browser.call("Input.dispatchKeyEvent", type=kind, key="Enter", code="Enter", windowsVirtualKeyCode=13,
                              modifiers=SHIFT)

    def verdict(self, words):
        """Wait for a verdict with these words; returns what the page's panel says."""
        self.browser.wait("document.getElementById('exercise-verdict').textContent.includes('%s')" % words, CHECK_S)
        return self.browser.evaluate("document.getElementById('exercise').innerText")

    def box(self, selector):
        return self.browser.evaluate("(({left, right, top, bottom}) => [left, right, top, bottom])"
                                     "(document.querySelector('%s').getBoundingClientRect())" % selector)

    def test_an_exercise_is_run_and_its_verdict_is_beside_the_robot(self):
        self.open_notebook("passes.ipynb", ENABLE, CHECK % (self.exercises / "solutions" / "tf_listener.py"))
        # A program in the notebook works with the lab that the page shows.
        self.run_cell(0)
        wait_for_state(enabled=True)
        self.browser.wait("lab.state.robot.enabled")
        self.run_cell(1)
        self.assertIn("100 of 100 points", self.verdict("tf_listener: passed"))
        # A click into the notebook has scrolled the page.
        self.browser.evaluate("scrollTo(0, 0)")
        self.keep("lab_page_notebook")
        right_of_notebook = self.box("#notebook")[1]
        for selector in ("#view", "#exercise-verdict"):
            left, right, top, bottom = self.box(selector)
            self.assertTrue(right_of_notebook < left < right <= 1280 and 0 <= top < bottom <= 800, selector)

    def test_on_a_telephone_a_hint_is_seen_below_the_notebook(self):
        self.open("drive", 390, 844)
        self.open_notebook("fails.ipynb", CHECK % (self.exercises / "skeletons" / "tf_listener.py"))
        self.run_cell(0)
        self.assertIn("Hint: ", self.verdict("tf_listener: not passed"))
        self.browser.wait("document.getElementById('notebook-frame').contentDocument.getElementById('jp-left-stack')"
                          ".offsetWidth === 0")
        self.assertLessEqual(self.browser.evaluate("document.documentElement.scrollWidth"), 390)
        self.browser.evaluate("document.getElementById('exercise').scrollIntoView()")
        self.keep("lab_page_notebook_telephone")
        left, right, top, bottom = self.box("#exercise-verdict")
        self.assertTrue(0 <= left < right <= 390 and self.box("header")[3] < top < bottom < 844, (left, right, top))
        left, right, top, bottom = self.box("#stop")
        self.assertTrue(0 <= left < right <= 390 and 0 <= top < bottom <= 844, "stop is in sight")


if __name__ == "__main__":
    import rostest
    rospy.init_node("lab_page_notebook")
    rostest.rosrun("workspace_tests", "lab_page_notebook", LabNotebook, sys.argv)
