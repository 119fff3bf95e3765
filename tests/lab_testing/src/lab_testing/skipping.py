# SPDX-License-Identifier: BSD-3-Clause
"""Skipping in tests that rostest runs: rosunit would count a test that skips itself as passed."""
import os
import unittest
import uuid
from pathlib import Path
from xml.etree import ElementTree


def skip(case, reason):
    """End the test of a ``unittest.TestCase``, from the test itself or ``setUp``: this machine lacks a requirement.

    reason: the missing requirement. `./baxter.sh test` finds it in rostest's folder of results, counts and prints it.
    """
    folder = os.environ.get("ROS_TEST_RESULTS_DIR")
    if folder:
        suite = ElementTree.Element("testsuite")
        names = {"classname": type(case).__name__, "name": case._testMethodName}
        ElementTree.SubElement(ElementTree.SubElement(suite, "testcase", names), "skipped", {"message": reason})
        Path(folder, "skipped-%s.xml" % uuid.uuid4().hex).write_bytes(ElementTree.tostring(suite))
    raise unittest.SkipTest(reason)
