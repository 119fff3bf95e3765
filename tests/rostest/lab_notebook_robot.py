#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The notebook "before the real robot": green in front of ideal drives, red on a robot, mended; twice in one kernel."""
import os
import unittest
import uuid

from notebook_runs import ROBOT, faults_of, prepare

from lab_tests import processes
from lab_web import jupyter
from processes.ports import free_port

MARKER = "LAB_NOTEBOOK_TEST"


class LabNotebookRobotTest(unittest.TestCase):
    def test_no_error_and_no_blank_picture_and_no_process_left(self):
        prepare()
        run_id = uuid.uuid4().hex
        faults = faults_of(ROBOT, environment=lambda: {
            **os.environ, MARKER: run_id, "ROS_MASTER_URI": "http://localhost:%d" % free_port(),
            "ROS_HOSTNAME": "localhost"})
        self.assertEqual(faults, [], "\n".join(faults))
        self.assertEqual(processes.wait_until_gone(run_id, jupyter.STOP_TIMEOUT_S, MARKER), {})


if __name__ == "__main__":
    import rostest
    rostest.rosrun("workspace_tests", "lab_notebook_robot", LabNotebookRobotTest)
